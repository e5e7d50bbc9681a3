"""The newest ten of a kind beside one another: exactly ten, with everything that is known of each; the same ones as CSV."""

import re
from collections.abc import Iterator
from html import unescape
from typing import Any

import pytest
from sqlalchemy import Connection

from app import bundled
from app.historian.records import RecordFold
from app.plant.plant_files.languages import LANGUAGES
from app.settings import Settings
from app.sim.crane.register_map import Step
from app.web.record_last import COUNT
from tests.historian import books, crane_story
from tests.virtual import house
from tests.web.operating import runtime_of
from tests.web.people import Staff

TOLD, ABORTED = 13, 9
LIST = "/records/crane_cycle"


@pytest.fixture(scope="module")
def staff(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Staff]:
    settings = Settings(plant=bundled("plants/crane"), data=tmp_path_factory.mktemp("last") / "data")
    with house(settings) as client:
        crew = Staff(client)
        runtime = runtime_of(client)
        for link in runtime.plant.links if runtime.plant else ():
            crew.wait(runtime.supervisor.end, f"link.{link}")
        fold = RecordFold(runtime.plant.equipment.values() if runtime.plant else ())

        def fill(connection: Connection) -> None:
            books.store(connection, fold, "cr1", crane_story.cycles(TOLD, aborted=ABORTED), 0)

        crew.wait(runtime.history.write, fill)
        yield crew


def table(staff: Staff, path: str = LIST, language: str = "en", **query: Any) -> tuple[list[str], dict[str, list[str]]]:
    """(heads of the columns, line → cells)."""
    staff.enter("ana", "viewer")
    staff.client.cookies.set("pogon_lang", language)
    answer = staff.client.get(path, params={"view": "last"} | query)
    assert answer.status_code == 200, answer.text[:300]
    html = unescape(answer.text).replace("\u202f", "").replace("\u00a0", " ")
    assert not re.search(r"\[(record|records|event)\.", html)
    lines = re.findall(r'<tr><th scope="row">(.*?)</th>(.*?)</tr>', html, re.DOTALL)
    return (
        re.findall(r"<time datetime=\"([^\"]+)\"", html.partition("</thead>")[0]),
        {name: re.findall(r"<td[^>]*>(.*?)</td>", cells, re.DOTALL) for name, cells in lines},
    )


NEWEST = list(range(TOLD, TOLD - COUNT, -1))


@pytest.mark.parametrize("language", LANGUAGES)
def test_it_is_exactly_ten_with_every_step_in_every_language(staff: Staff, language: str) -> None:
    heads, lines = table(staff, language=language)
    assert len(heads) == COUNT == 10 and heads == sorted(heads, reverse=True)
    assert all(len(cells) == COUNT for cells in lines.values())
    assert sum(bool(re.match(r"S\d{3} ", name)) for name in lines) == len([step for step in Step if step >= 100])


def test_the_last_step_of_each_is_told_by_its_name(staff: Staff) -> None:
    _, lines = table(staff, language="de")
    assert {cell for cell, number in zip(lines["Letzter Schritt"], NEWEST, strict=True) if number != ABORTED} == {
        "S423 Hubwerk auf sichere Fahrhöhe heben"
    }


def test_path_times_sway_and_faults_of_each_are_those_that_were_told(staff: Staff) -> None:
    _, lines = table(staff)
    whole = [number != ABORTED for number in NEWEST]
    assert lines["Sway left"] == [
        f"{crane_story.sway(n):.1f} mm" if there else "–" for n, there in zip(NEWEST, whole, strict=True)
    ]
    assert lines["Greatest path error"] == [
        f"{crane_story.path_error(n):.1f} mm" if there else "–" for n, there in zip(NEWEST, whole, strict=True)
    ]
    assert [cell != "–" for cell in lines["Alarms"]] == [not there for there in whole]
    step = next(name for name in lines if name.startswith("S302"))
    assert [cell.split(" ")[0] for cell, there in zip(lines[step], whole, strict=True) if there] == [
        f"{crane_story.seconds(n, Step.TO_SET_DOWN):.1f}" for n in NEWEST if n != ABORTED
    ]


def test_a_filter_gives_the_newest_ten_that_it_lets_through(staff: Staff) -> None:
    heads, lines = table(staff, outcome="done")
    assert len(heads) == COUNT
    assert lines["Load"] == [f"{200 + n:.1f} t" for n in range(TOLD, 0, -1) if n != ABORTED][:COUNT]
    few, _ = table(staff, outcome="aborted")
    assert len(few) == 1
    assert table(staff, path=f"{LIST}/list", outcome="aborted")[0] == few
    assert table(staff, equipment="cr1", until="2026-03-01T00:00") == ([], {})


def test_the_file_has_the_same_ones(staff: Staff) -> None:
    staff.enter("ana", "viewer")
    page = unescape(staff.client.get(LIST, params={"view": "last", "equipment": "cr1"}).text)
    found = re.search(rf'href="({LIST}/export\.csv\?[^"]+)"', page)
    assert found and "view=last" in found.group(1)
    lines = staff.client.get(re.sub(r"locale=\w+", "locale=machine", found.group(1))).text.split("\r\n")
    rows = [line.split(",") for line in lines if line and not line.lstrip("\ufeff").startswith("#")]
    head, told = rows[0], rows[1:]
    assert "sway_mm" in head, head
    assert len(told) == COUNT
    assert [row[head.index("sway_mm")] for row in told] == [
        "" if n == ABORTED else f"{crane_story.sway(n):g}" for n in NEWEST
    ]
    size = staff.client.get(f"{LIST}/export/size", params={"view": "last"}).json()
    assert size["rows"] == COUNT
    assert staff.client.get(f"{LIST}/export/size").json()["rows"] == TOLD
