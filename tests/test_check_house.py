"""The checks of the house's shape find what they are for."""

from pathlib import Path

import pytest

from tools.check_house import (
    LONGEST_SCRIPT,
    MOST_SCRIPT,
    forks,
    import_circles,
    large_parts,
    long_lines,
    much_script,
    named_machines,
    raw_sql,
)


def house(root: Path, **modules: str) -> Path:
    """A house of `folder__module` = its source."""
    for name, source in modules.items():
        path = root / "app" / f"{name.replace('__', '/')}.py"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(source)
    return root


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("from app.a.two import x", "from app.a.one import y"),
        ("from app.a import two", "import app.a.one"),
        ("def late():\n    from app.a.two import x", "from app.a import one"),
        ("if TYPE_CHECKING:\n    from app.a.two import X", "from app.a.one import (\n    Y,\n)"),
    ],
)
def test_a_circle_is_named_however_it_is_closed(tmp_path: Path, one: str, other: str) -> None:
    found = list(import_circles(house(tmp_path, a__one=one, a__two=other)))
    assert len(found) == 1
    assert {"app.a.one", "app.a.two"} == set(found[0].removeprefix("imports go round: ").split(" → "))


def test_a_longer_circle_is_found_and_a_straight_road_is_not_one(tmp_path: Path) -> None:
    straight = house(tmp_path, a__one="from app.b import two", b__two="import app.c", c="import asyncio")
    assert not list(import_circles(straight))
    assert list(import_circles(house(tmp_path, c="from app.a.one import x")))


@pytest.mark.sweep(8)
def test_the_house_has_none() -> None:
    assert not list(import_circles(Path(__file__).resolve().parent.parent))


MACHINE = {
    "app/equipment/press/device.toml": 'label = "type"',
    "app/equipment/press/tables.toml": "[die]\n",
    "app/equipment/press/records.toml": "[stroke]\n[run]\n",
}


@pytest.mark.parametrize(
    ("file", "text", "word"),
    [
        ("app/web/page.py", "x = 'press'", "press"),
        ("app/web/deep/page.py", "x = _('press.state')", "press"),
        ("app/alarms/engine.py", "x = f'screens/press/{name}.html'", "press"),
        ("app/runtime.py", "from app.sim.press.program import Press", "press"),
        ("app/cli_probe.py", "from app.sim import press", "press"),
        ("app/historian/keep.py", "TABLE = 'die'", "die"),
        ("app/links/one.py", "KIND = 'stroke'", "stroke"),
        ("app/live/one.py", "text = 'run.outcome'", "run"),
        ("templates/pages/list.html", "{% if equipment.type == 'press' %}", "press"),
        ("templates/macros/list.html", '<use href="#e-press"/>', "press"),
        ("static/js/list.js", 'fetch(`/x/die`); const a = ["die"];', "die"),
        ("static/css/list.css", '@import "../screens/press.css";', "press"),
    ],
)
def test_a_machine_that_is_named_in_a_general_room_is_found(tmp_path: Path, file: str, text: str, word: str) -> None:
    root = tree(tmp_path, {**MACHINE, file: text})
    assert [line.split(": ") for line in named_machines(root)] == [[f"{file}:1", f"names the machine word {word!r}"]]


@pytest.mark.parametrize(
    ("file", "text"),
    [
        ("app/web/page.py", '"""The pages of a press."""\npressed = "pressure"'),
        ("app/web/page.py", "outcome = 'run'"),
        ("app/web/screens/press.py", "x = 'press'"),
        ("app/sim/press/program.py", "type = 'press'"),
        ("templates/screens/press/page.html", "{{ _('press.state') }}"),
        ("templates/pages/list.html", "{# of a 'press' #}"),
        ("static/screens/press.js", "'press'"),
    ],
)
def test_what_is_of_the_machine_or_only_explains_is_not(tmp_path: Path, file: str, text: str) -> None:
    assert not list(named_machines(tree(tmp_path, {**MACHINE, file: text})))


@pytest.mark.sweep(8)
def test_the_general_rooms_of_the_house_name_none() -> None:
    assert not list(named_machines(Path(__file__).resolve().parent.parent))


def tree(root: Path, files: dict[str, str]) -> Path:
    for name, text in files.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    return root


@pytest.mark.parametrize(
    ("length", "told"), [(160, []), (161, ["templates/pages/list.html:2: 161 characters, expected at most 160"])]
)
@pytest.mark.parametrize("sign", ["a", "č"])
def test_a_line_of_a_template_that_is_too_long_is_told(tmp_path: Path, length: int, told: list[str], sign: str) -> None:
    root = tree(tmp_path, {"templates/pages/list.html": f"<p>\n{sign * length}\n</p>\n", "app/web/long.py": "#" * 500})
    assert list(long_lines(root)) == told


def test_no_line_of_the_templates_is() -> None:
    assert not list(long_lines(Path(__file__).resolve().parent.parent))


@pytest.mark.parametrize(
    ("lines", "told"),
    [
        (300, []),
        (301, ["app/a/one.py:2: class Big has 301 lines, expected at most 300"]),
        (599, ["app/a/one.py:2: class Big has 599 lines, expected at most 300"]),
        (
            600,
            [
                "app/a/one.py: 601 lines, expected at most 600",
                "app/a/one.py:2: class Big has 600 lines, expected at most 300",
            ],
        ),
    ],
)
def test_a_part_that_is_too_large_is_told(tmp_path: Path, lines: int, told: list[str]) -> None:
    source = "\nclass Big:\n" + "    x = 1\n" * (lines - 1)
    assert list(large_parts(house(tmp_path, a__one=source))) == told


@pytest.mark.sweep(8)
def test_no_part_of_the_house_is() -> None:
    assert not list(large_parts(Path(__file__).parent.parent))


@pytest.mark.parametrize("folder", ["js", "screens"])
def test_scripts_beyond_their_measure_are_told_one_and_all(tmp_path: Path, folder: str) -> None:
    for name, lines in [("js/one.js", LONGEST_SCRIPT), ("vendor/big.js", MOST_SCRIPT)]:
        (tmp_path / "static" / name).parent.mkdir(parents=True)
        (tmp_path / "static" / name).write_text("x;\n" * lines)
    assert not list(much_script(tmp_path))
    more = tmp_path / "static" / folder / "more.js"
    more.parent.mkdir(exist_ok=True)
    more.write_text("x;\n" * (MOST_SCRIPT + 1 - LONGEST_SCRIPT))
    told = list(much_script(tmp_path))
    assert told[-1] == f"static: {MOST_SCRIPT + 1} lines of script, expected at most {MOST_SCRIPT}"
    assert told[0].startswith(f"static/{folder}/more.js: ")


def test_the_house_has_no_more_script_than_it_may() -> None:
    assert not list(much_script(Path(__file__).parent.parent))


@pytest.mark.parametrize(
    "source",
    [
        "connection.exec_driver_sql(what)",
        "x = 'SELECT id FROM point'",
        "x = f'INSERT OR REPLACE INTO {table} (t) VALUES (?)'",
        'x = """\nWITH part AS (SELECT 1) SELECT * FROM part"""',
        "x = 'UPDATE point SET name = ?'",
        "x = 'DELETE FROM point'",
        "x = 'PRAGMA page_count'",
        "import sqlite3",
        "from sqlalchemy.dialects import sqlite",
        "from sqlalchemy.dialects.sqlite import insert",
    ],
)
def test_a_statement_written_as_text_is_found(tmp_path: Path, source: str) -> None:
    found = list(raw_sql(house(tmp_path, historian__store=source)))
    assert found and all("app/historian/store.py:" in one for one in found)
    assert not list(raw_sql(house(tmp_path / "other", historian__dialect=source, db=source)))


@pytest.mark.parametrize(
    "source",
    [
        '"""SELECT what you see."""',
        "x = 'Select a machine'",
        "x = 'BEGINNING'",
        "x = select(point.c.id)",
        "x = 'Delete'",
    ],
)
def test_words_that_are_no_statement_are_none(tmp_path: Path, source: str) -> None:
    assert not list(raw_sql(house(tmp_path, historian__store=source)))


@pytest.mark.parametrize(
    ("numbers", "told"),
    [
        ((("1", None), ("2", "1"), ("3", "2")), []),
        ((("1", None), ("2", "1"), ("3", "1")), ["comes after 1, as "]),
        ((("1", None), ("2", "1"), ("2", "1")), ["revision 2 is also that of "]),
        ((("1", None), ("3", "2")), ["comes after 2, which is not there"]),
        ((("1", None), ("2", None)), ["comes after None, as "]),
    ],
)
def test_migrations_that_are_no_row_are_told(
    tmp_path: Path, numbers: tuple[tuple[str, str | None], ...], told: list[str]
) -> None:
    folder = tmp_path / "migrations" / "pogon" / "versions"
    folder.mkdir(parents=True)
    for index, (number, last) in enumerate(numbers):
        (folder / f"{index}_x.py").write_text(f"revision = {number!r}\ndown_revision = {last!r}\n")
    found = list(forks(tmp_path))
    assert len(found) == len(told) and all(one in two for one, two in zip(told, found, strict=True))


def test_those_of_the_house_are() -> None:
    assert not list(forks(Path(__file__).parent.parent))
