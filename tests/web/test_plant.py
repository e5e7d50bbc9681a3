"""The page of the plant files: what would change, what is wrong, and only an engineer who has read it takes it."""

import re
import shutil
from collections.abc import Iterator
from html import unescape
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from app import bundled
from tests.web.conftest import Start
from tests.web.people import Staff

DEMO = (bundled("plants/demo") / "plant.toml").read_text("utf-8")
LONGER = DEMO.replace('en = "Fan 1"', 'en = "<b>Fan</b> West"')


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    found = tmp_path / "plant"
    found.mkdir()
    shutil.copytree(bundled("plants/demo"), found, dirs_exist_ok=True)
    (found / "plant.toml").write_text(DEMO, "utf-8")
    return found


@pytest.fixture
def staff(start: Start, folder: Path) -> Iterator[Staff]:
    client: TestClient = start(plant=folder)
    people = Staff(client)
    people.enter("ivana", "engineer")
    client.cookies.set("pogon_lang", "en")
    yield people


def digest(page: str) -> str:
    found = re.search(r'name="digest" value="(\w+)"', page)
    assert found
    return found[1]


def test_the_page_says_when_the_files_are_what_runs(staff: Staff) -> None:
    page = staff.client.get("/plant").text
    assert "The files are the plant that runs." in page and 'name="digest"' not in page


@pytest.mark.sweep(8)
def test_changes_are_read_confirmed_and_taken(staff: Staff, folder: Path) -> None:
    (folder / "plant.toml").write_text(LONGER, "utf-8")
    page = staff.client.get("/plant").text
    assert "Equipment m1: changed" in page and "nothing is interrupted" in page
    assert "<b>Fan</b> West" not in page and "&lt;b&gt;Fan" in page
    unread = staff.post("/plant", {"digest": digest(page)})
    assert unread.status_code == 422 and "confirm that the changes were read" in unread.text
    taken = staff.post("/plant", {"digest": digest(page), "read": "1"})
    assert (taken.status_code, taken.headers["location"]) == (303, "/plant?done=1")
    assert "The changes were taken." in staff.client.get("/plant?done=1").text
    assert "&lt;b&gt;Fan&lt;/b&gt; West" in staff.client.get("/").text
    assert "Plant files read anew, changes: 1" in staff.client.get("/audit").text


@pytest.mark.sweep(8)
def test_other_changes_than_those_read_are_shown_first(staff: Staff, folder: Path) -> None:
    (folder / "plant.toml").write_text(LONGER, "utf-8")
    seen = digest(staff.client.get("/plant").text)
    (folder / "plant.toml").write_text(DEMO.replace("unit = 2", "unit = 7"), "utf-8")
    answer = staff.post("/plant", {"digest": seen, "read": "1"})
    assert answer.status_code == 409 and "have changed since" in answer.text and "unit: 2 → 7" in answer.text


@pytest.mark.sweep(8)
def test_mistakes_are_listed_and_change_nothing(staff: Staff, folder: Path) -> None:
    (folder / "plant.toml").write_text(DEMO.replace("unit = 2", "unit = 1"), "utf-8")
    page = staff.client.get("/plant").text
    assert "runs on as it is" in page and "m1 has it" in page and 'name="digest"' not in page
    answer = staff.post("/plant", {"digest": "x", "read": "1"})
    assert answer.status_code == 409 and "the files have mistakes" in answer.text
    assert staff.client.get("/equipment/m2").status_code == 200


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("language", "told"),
    [
        (
            "hr",
            (
                "adresa koju na vezi",
                "200 do 240 V ili 380 do 440 V: serija nema drugu klasu",
                "vremenska zona, na primjer Europe/Zagreb (možda Europe/Zagreb)",
            ),
        ),
        (
            "de",
            (
                "eine Adresse, die kein anderes Gerät an",
                "200 bis 240 V oder 380 bis 440 V: Die Baureihe hat keine andere Klasse",
                "eine Zeitzone, etwa Europe/Zagreb (vielleicht Europe/Zagreb)",
            ),
        ),
        (
            "cs",
            (
                "adresa, kterou nemá žádné jiné zařízení na spojení",
                "200 až 240 V nebo 380 až 440 V: řada jinou třídu nemá",
                "časové pásmo, například Europe/Zagreb (možná Europe/Zagreb)",
            ),
        ),
    ],
)
def test_mistakes_are_told_in_the_language_of_who_reads(
    staff: Staff, folder: Path, language: str, told: tuple[str, ...]
) -> None:
    wrong = DEMO.replace("unit = 2", "unit = 1\nrated_voltage = 300").replace("Europe/Zagreb", "Europe/Zagrep")
    (folder / "plant.toml").write_text(wrong, "utf-8")
    staff.client.cookies.set("pogon_lang", language)
    page = unescape(staff.client.get("/plant").text)
    assert [one for one in told if one not in page] == []
    assert "expected" not in page and 'lang="en"' not in page[page.index("problems") :]


@pytest.mark.sweep(8)
def test_only_an_engineer_reads_and_takes_plant_files(staff: Staff, folder: Path) -> None:
    (folder / "plant.toml").write_text(LONGER, "utf-8")
    seen = digest(staff.client.get("/plant").text)
    for role in ("viewer", "operator", "admin"):
        staff.enter(f"some_{role}", role)
        assert staff.client.get("/plant").status_code == 403
        assert staff.post("/plant", {"digest": seen, "read": "1"}).status_code == 403
    assert "West" not in staff.client.get("/").text


def test_it_lists_the_machines_that_run_and_where_they_are_connected(staff: Staff, folder: Path) -> None:
    plant = staff.client.app.state.runtime.plant  # type: ignore[attr-defined]
    rows = re.findall(
        r'<tr><th scope="row"><a class="link" href="/equipment/(\w+)">.*?</tr>',
        page := staff.client.get("/plant").text,
        re.S,
    )
    assert rows == list(plant.equipment)
    for item in plant.equipment.values():
        found = re.search(rf'<tr><th scope="row"><a class="link" href="/equipment/{item.id}">(.*?)</tr>', page, re.S)
        assert found
        numbers = [int(one) for one in re.findall(r'class="r num">(\d+)<', found[1])]
        assert numbers == [item.unit, len(item.points), len(item.alarms)]
        assert plant.links[item.link].name in found[1] or plant.links[item.link].label["en"] in found[1]
    (folder / "plant.toml").write_text("rubbish", "utf-8")
    page = staff.client.get("/plant").text
    assert 'href="/equipment/m1"' in page, "what runs does so while the files have mistakes"


@pytest.mark.sweep(8)
def test_warnings_are_told_and_hold_nothing_up(staff: Staff, folder: Path) -> None:
    row = '[[alarms]]\nequipment = "m1"\nkey = "fast"\nlabel = "Fast"\nexpression = "frequency > 45"\npriority = 3\n'
    assert "Warnings" not in staff.client.get("/plant").text
    (folder / "plant.toml").write_text(f"{DEMO}\n{row}", "utf-8")
    page = unescape(staff.client.get("/plant").text)
    assert "Warnings in the plant files" in page and page.count("a text for the operator, who reads a dash") == 3
    assert digest(page) and "Mistakes in the plant files" not in page
    staff.client.cookies.set("pogon_lang", "de")
    assert "ein Text für den Bediener, der einen Strich liest" in unescape(staff.client.get("/plant").text)
