"""Screens that a plant folder brings: drawn with the values of now, linked, and telling what is wrong with them."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from app import bundled
from app.plant.loader import read_plant
from app.running.page_tags import page_tags
from app.settings import Settings
from app.sim.bus import LineFaultMode
from tests.virtual import house
from tests.web.conftest import Start

HALL = bundled("plants/hall")
LABELS = {"hr": "Hala", "en": "Hall", "de": "Halle", "cs": "Hala"}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """The plant with a hall, to be changed."""
    return Path(shutil.copytree(HALL, tmp_path / "plant"))


@pytest.fixture(scope="module")
def hall(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    with house(Settings(plant=HALL, data=tmp_path_factory.mktemp("hall") / "data")) as browser:
        yield browser


@pytest.fixture
def client(hall: TestClient) -> TestClient:
    """A browser at the plant with a hall, without cookies."""
    hall.cookies.clear()
    return hall


@pytest.mark.parametrize("lang", LABELS)
def test_the_screen_is_a_tab_and_is_found_in_every_language(client: TestClient, lang: str) -> None:
    client.cookies.set("pogon_lang", lang)
    page = client.get("/screens/hall")
    assert page.status_code == 200
    assert f'<a href="/screens/hall" aria-current="page">{LABELS[lang]}</a>' in page.text
    assert "/screens/hall" in client.get("/palette/found", params={"q": LABELS[lang]}).text


def test_a_value_is_drawn_as_every_value_and_a_part_leads_to_its_machine(client: TestClient) -> None:
    text = client.get("/screens/hall").text
    assert 'data-tag="m1.speed" data-q="' in text and 'class="val bare"' in text
    assert '<a href="/equipment/m1" aria-label="' in text
    assert "<script>" not in text.partition('class="panel drawn"')[2].partition("</section>")[0]


@pytest.mark.sweep(8)
@pytest.mark.parametrize("lang", LABELS)
def test_the_name_of_a_machine_is_in_the_language_of_the_page(client: TestClient, lang: str) -> None:
    plant, _ = read_plant(HALL)
    assert plant is not None
    client.cookies.set("pogon_lang", lang)
    text = client.get("/screens/hall").text
    for machine in ("m1", "m2", "c1", "cr1"):
        assert f">{plant.equipment[machine].label[lang]}</text>" in text
        assert f'data-mark-of="{machine}" data-look="alm-l"' in text


def test_its_socket_is_sent_its_tags_and_no_others() -> None:
    plant, problems = read_plant(HALL)
    assert plant is not None and not problems and not plant.screens["hall"].problems
    names = page_tags("screens/hall", plant, plant.points)
    assert {"m1.speed", "cr1.trolley_position"} <= set(names) and "m1.voltage" not in names
    with pytest.raises(KeyError):
        page_tags("screens/none", plant, plant.points)


def test_there_is_no_other_screen(client: TestClient) -> None:
    assert client.get("/screens/none").status_code == 404


def test_a_broken_screen_says_what_is_wrong_and_everything_else_runs(start: Start, folder: Path) -> None:
    (folder / "screens" / "bad.svg").write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 9 9">\n<script/><text data-tag="m1.sped"/></svg>', "utf-8"
    )
    client = start(folder)
    page = client.get("/screens/bad")
    assert page.status_code == 200
    assert "screens/bad.svg:2" in page.text and "m1.speed" in page.text and "&lt;script&gt;" in page.text
    assert client.get("/screens/hall").status_code == client.get("/equipment/m1").status_code == 200


@pytest.mark.sweep(8)
def test_what_is_not_known_is_drawn_as_such_and_never_left_out(start: Start, folder: Path) -> None:
    (folder / "screens" / "one.svg").write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 9 9"><rect data-tag="m1.running" data-show="1" data-class="d-run:1"/>'
        '<circle data-tag="m1.running" data-show="bad"/><text data-tag="m1.speed"/></svg>', "utf-8"
    )  # fmt: skip
    client = start(folder)
    sim = client.app.state.runtime.sim  # type: ignore[attr-defined]
    sim.devices["m1"].line_fault.mode = LineFaultMode.SILENT
    client.pass_time(3)  # type: ignore[attr-defined]
    text = client.get("/screens/one").text
    follows = 'data-tag="m1.running" data-class="d-run:1;d-unknown:bad;d-old:uncertain" data-show="1,bad">'
    assert f'<rect class=" d-unknown" {follows}' in text
    assert '<circle class=" " data-tag="m1.running" data-class="d-old:uncertain" data-show="bad">' in text
    sim.devices["m1"].line_fault.mode = LineFaultMode.NONE
    client.pass_time(5)  # type: ignore[attr-defined]
    text = client.get("/screens/one").text
    assert f'<rect class=" d-run" {follows}' in text
    assert 'data-show="bad" display="none">' in text


def test_a_pipe_a_link_out_of_the_folder_and_a_huge_file_are_told(folder: Path, tmp_path: Path) -> None:
    import os

    os.mkfifo(folder / "screens" / "pipe.svg")
    (tmp_path / "secret.svg").write_text("secret", "utf-8")
    (folder / "screens" / "out.svg").symlink_to(tmp_path / "secret.svg")
    (folder / "screens" / "huge.svg").write_bytes(b" " * 600_000)
    plant, problems = read_plant(folder)
    assert plant is not None and not problems
    told = {name: str(screen.problems[0]) for name, screen in plant.screens.items() if screen.problems}
    assert set(told) == {"pipe", "out", "huge"}
    assert "a pipe" in told["pipe"] and "leads out" in told["out"] and "600000 bytes" in told["huge"]


def test_what_stands_on_the_root_holds_for_the_whole_picture(start: Start, folder: Path) -> None:
    """As editors write icons: without it outlines became black faces."""
    root = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 9 9" fill="none" class="d-line" style="stroke:#111" id="all" width="9mm">'
    (folder / "screens" / "one.svg").write_text(root + "<rect/></svg>", "utf-8")
    text = start(folder).get("/screens/one").text
    drawn = text.partition('class="panel drawn"')[2].partition("<rect")[0]
    assert '<g class="d-line" fill="none" stroke="#111">' in drawn and "mm" not in drawn and "all" not in drawn


def test_the_box_of_a_value_stands_where_its_numbers_say(start: Start, folder: Path) -> None:
    (folder / "screens" / "one.svg").write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 900 900"><text x=".5" y="+1e2" data-tag="m1.speed"/></svg>',
        "utf-8",
    )
    assert '<foreignObject x="0.5" y="59.84"' in start(folder).get("/screens/one").text


@pytest.mark.sweep(8)
def test_screens_stand_in_the_order_that_their_files_say_and_the_others_after_them(start: Start, folder: Path) -> None:
    for name, told in (("b", "place = 2"), ("c", ""), ("d", "place = 1"), ("a", "")):
        shutil.copy(folder / "screens" / "hall.svg", folder / "screens" / f"{name}.svg")
        (folder / "screens" / f"{name}.toml").write_text(told, "utf-8")
    text = start(folder).get("/screens/hall").text
    at = [text.index(f'href="/screens/{name}"') for name in ("d", "b", "a", "c", "hall")]
    assert at == sorted(at)
    plant, _ = read_plant(folder)
    assert plant is not None
    assert list(plant.screens) == ["d", "b", "a", "c", "hall"]


@pytest.mark.parametrize("wrong", ["place = 0", "place = 100", 'place = "1"', "place = true"])
def test_a_place_that_is_none_is_told(folder: Path, wrong: str) -> None:
    (folder / "screens" / "hall.toml").write_text(wrong, "utf-8")
    plant, _ = read_plant(folder)
    assert plant is not None
    assert "screens/hall.toml:1: place" in str(plant.screens["hall"].problems[0])


@pytest.mark.parametrize(
    ("file", "said"),
    [
        ("alone.toml", 'screens/alone.toml: (file) = alone.toml: expected a drawing beside it, alone.svg'),
        ("hall.TOML", "screens/hall.TOML: (file) = hall.TOML: expected a name of small letters, digits and _ with .toml"),
        ("HALL2.SVG", "screens/HALL2.SVG: (file) = HALL2.SVG: expected a name of small letters, digits and _ with .svg"),
        ("A b.svg", "screens/A b.svg: (file) = A b.svg: expected a name of small letters, digits and _ with .svg"),
        ("more/x.svg", "screens/more: (file) = a folder: expected drawings, with .svg, in this folder itself"),
    ],
)  # fmt: skip
def test_what_nobody_would_read_is_told(folder: Path, file: str, said: str) -> None:
    (folder / "screens" / file).parent.mkdir(exist_ok=True)
    shutil.copy(folder / "screens" / "hall.svg", folder / "screens" / file)
    plant, problems = read_plant(folder)
    assert plant is not None and not problems
    assert [str(doubt) for doubt in plant.doubts] == [said]


def test_a_folder_in_the_place_of_a_drawing_and_a_file_in_that_of_the_folder_are_told(folder: Path) -> None:
    (folder / "screens" / "x.svg").mkdir()
    plant, _ = read_plant(folder)
    assert plant is not None
    assert str(plant.screens["x"].problems[0]) == "screens/x.svg: (file) = a folder: expected an SVG file"
    shutil.rmtree(folder / "screens")
    (folder / "screens").write_text("", "utf-8")
    plant, _ = read_plant(folder)
    assert plant is not None
    assert [str(doubt) for doubt in plant.doubts] == ["screens: (file) = a file: expected a folder of drawings"]


def test_a_folder_that_may_not_be_read_costs_its_screens_and_nothing_else(folder: Path) -> None:
    shutil.rmtree(folder / "screens")
    (folder / "screens").symlink_to(folder / "screens")
    plant, problems = read_plant(folder)
    assert plant is not None and not problems and not plant.screens
    assert [str(doubt) for doubt in plant.doubts] == [
        "screens: (file) = Too many levels of symbolic links: expected a folder of drawings"
    ]


def test_another_drawing_is_a_change_that_a_reload_takes(folder: Path) -> None:
    from app.plant.changes import compare

    old, _ = read_plant(folder)
    file = folder / "screens" / "hall.svg"
    file.write_text(file.read_text("utf-8").replace('r="58"', 'r="50"'), "utf-8")
    new, _ = read_plant(folder)
    assert old is not None and new is not None
    assert [change.details for change in compare(old, new)] == [("screens: hall",)]
    assert compare(new, new) == []


def test_who_reads_the_plant_anew_is_told_before_which_screens_go_and_which_lose_their_picture(folder: Path) -> None:
    """It said that labels and places change, and the picture was gone: a machine had another name."""
    from app.plant.changes import compare

    shutil.copy(folder / "screens" / "hall.svg", folder / "screens" / "one.svg")
    old, _ = read_plant(folder)
    (folder / "screens" / "one.svg").unlink()
    file = folder / "plant.toml"
    file.write_text(file.read_text("utf-8").replace("[equipment.m1]", '[equipment.m9]\nwas = "m1"'), "utf-8")
    new, _ = read_plant(folder)
    assert old is not None and new is not None
    told = {
        effect.key: effect.params for change in compare(old, new) if change.what == "plant" for effect in change.effects
    }
    assert told["screens_gone"] == {"names": "one"} and told["screens_broken"] == {"names": "hall"}
    assert not [effect for change in compare(new, new) for effect in change.effects]
    (back,) = (change for change in compare(new, old) if change.what == "plant")
    assert [effect.key for effect in back.effects] == ["texts"]
