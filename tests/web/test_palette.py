"""The palette finds what somebody may use, whatever marks are typed, and leads there without doing anything."""

import re
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from app import bundled
from app.plant.loader import read_plant
from app.settings import Settings
from app.web.palette import MOST, Place, _places, _with_letters, folded, ranked
from tests.demo_plant import DEMO
from tests.virtual import house, pass_time
from tests.web.operating import Operator
from tests.web.people import Staff

LANGUAGES = ("hr", "en", "de", "cs")


@pytest.fixture(scope="module")
def staff(demo: TestClient) -> Staff:
    demo.pass_time(2)
    return Staff(demo)


def hits(answer: str) -> list[tuple[str, str]]:
    """(address, name) of each."""
    return [
        (url.replace("&amp;", "&"), name)
        for url, name in re.findall(r'<a role="option"[^>]*?href="([^"]*)".*?<b>(.*?)</b>', answer, re.DOTALL)
    ]


@pytest.mark.parametrize(
    ("text", "letters"),
    [
        ("Greška", "greska"),
        ("Đuro", "duro"),
        ("STRASSE Größe", "strasse grosse"),
        ("Přeprava", "preprava"),
        ("Ausgangs\u00adstrom", "ausgangsstrom"),
    ],
)
def test_letters_count_without_their_marks(text: str, letters: str) -> None:
    assert folded(text) == folded(letters) == letters


def place(kind: str, label: str, detail: str = "") -> Place:
    return _with_letters(Place(kind, label, detail, "/"))


def test_names_come_before_details_and_beginnings_before_the_middle_of_words() -> None:
    fan, unfan, detail = place("point", "Fan speed"), place("point", "Unfan"), place("machine", "Pump", "beside a fan")
    assert ranked([detail, unfan, fan], "fan") == [fan, unfan, detail]
    assert ranked([detail, unfan, fan], "fan speed") == [fan]
    assert ranked([fan, detail], "") == [detail]
    assert len(ranked([fan] * 99, "f")) == MOST


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("language", "looked", "url"),
    [
        ("hr", "prijevoz", "/equipment/seq1"),
        ("hr", "ventilator 2 naprijed", "/equipment/m2#do-forward"),
        ("hr", "postavi frekv ventilator 1", "/equipment/m1#do-set_frequency"),
        ("en", "fan 1 speed", "/trends?tags=m1.speed"),
        ("de", "lufter 1 uberstrom", "/alarms?tab=journal&source=m1&q=Umrichter%3A%20%C3%9Cberstrom"),
        ("de", "lufter 1 ausgangsstrom", "/trends?tags=m1.current"),
        ("cs", "dopravnik", "/equipment/c1"),
        ("en", "m1.heatsink", "/trends?tags=m1.heatsink_temperature"),
    ],
)
def test_what_is_looked_for_comes_in_every_language(staff: Staff, language: str, looked: str, url: str) -> None:
    operator = Operator(staff, "ana", ("operator",), language)
    found = [address for address, _ in hits(operator.get(f"/palette/found?q={looked}").text)]
    assert url in found[:4], found


@pytest.mark.parametrize(
    ("role", "sees", "not_sees"),
    [
        (
            "viewer",
            set(),
            {"/equipment/m1#do-forward", "/equipment/m1#do-stop", "/instructor/m1", "/users", "/lessons"},
        ),
        ("operator", {"/equipment/m1#do-forward", "/equipment/m1#do-stop", "/lessons"}, {"/instructor/m1", "/users"}),
        ("engineer", {"/equipment/m1#do-forward", "/instructor/m1"}, {"/users"}),
        ("admin", {"/users"}, {"/equipment/m1#do-forward", "/instructor/m1"}),
    ],
)
def test_only_what_one_may_use_is_found(staff: Staff, role: str, sees: set[str], not_sees: set[str]) -> None:
    operator = Operator(staff, f"one-{role}", (role,))
    asked = ("forward fan 1", "stop fan 1", "instructor fan 1", "users", "lessons")
    found = {url for words in asked for url, _ in hits(operator.get(f"/palette/found?q={words}").text)}
    assert sees <= found
    assert not found & not_sees


@pytest.mark.sweep(8)
def test_everything_that_can_be_found_is_there(staff: Staff) -> None:
    """Each address once, as somebody who may do everything."""
    plant, _ = read_plant(DEMO)
    assert plant is not None
    boss = Operator(staff, "boss", ("admin", "engineer", "operator"))
    texts = staff.client.app.state.runtime.texts  # type: ignore[attr-defined]
    found = [one for one in _places(texts, plant, "en") if one.kind in ("machine", "page")]
    for url in sorted({one.url for one in found}):
        assert boss.get(url, fragment=False).status_code in (200, 303), url
    for language in LANGUAGES:
        assert not [one for one in _places(texts, plant, language) if one.label.startswith("[")]


@pytest.mark.sweep(8)
def test_a_hit_is_a_way_and_no_deed(staff: Staff) -> None:
    operator = Operator(staff, "ana", ("operator",))
    dialog = operator.get("/palette/found").text
    assert "<form" not in dialog
    assert hits(dialog)
    assert hits(operator.get("/palette/found?q=" + "x" * 500).text) == []
    assert "&lt;b&gt;" in operator.get("/palette/found?q=%3Cb%3E").text


@pytest.mark.sweep(8)
@pytest.mark.parametrize("language", LANGUAGES)
def test_a_code_leads_to_its_row_on_the_page_of_every_drive_that_has_it(staff: Staff, language: str) -> None:
    engineer = Operator(staff, "mate", ("engineer",), language)
    for looked, code, machines in (
        ("F114", "F114", {"m1", "m2"}),
        ("f114", "F114", {"m1", "m2"}),
        ("f114 m2", "F114", {"m2"}),
        ("F612", "F612", {"m1", "m2"}),  # nothing is known of it but that a drive may have it
    ):
        found = {url: name for url, name in hits(engineer.get(f"/palette/found?q={looked}").text) if code in name}
        assert {url.split("/")[2] for url in found} == machines, looked
        for url, name in found.items():
            assert name.startswith(f"{code} ") and "[" not in name
            assert f'<tr data-code="{code}"' in engineer.get(url, fragment=False).text
    assert not hits(engineer.get("/palette/found?q=F999").text), "no drive may have it"


@pytest.mark.sweep(8)
def test_a_drive_behind_a_mailbox_is_found_by_the_number_of_its_parameter(tmp_path: Path) -> None:
    with house(Settings(plant=bundled("plants/sinamics"), data=tmp_path / "data")) as browser:
        staff = Staff(browser)
        pass_time(3)
        engineer, operator = Operator(staff, "mate", ("engineer",)), Operator(staff, "ana", ("operator",))
        for looked in ("p1082", "1082"):
            found = {url for url, _ in hits(engineer.get(f"/palette/found?q={looked}").text)}
            assert "/equipment/d1/drive-parameters?q=p1082" in found
            assert not hits(operator.get(f"/palette/found?q={looked}").text), "she may not open that page"
        page = engineer.get("/equipment/d1/drive-parameters?q=p1082", fragment=False).text
        assert re.findall(r'<tr data-code="(\w+)"', page) == ["p1082"]
