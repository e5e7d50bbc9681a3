"""Every page has a help of its own, in every language, and every machine says what it is."""

import re

import pytest
from fastapi.testclient import TestClient

from app.plant.loader import read_plant
from app.plant.texts import Texts
from app.web.help import PAGES, subject
from app.web.view import ENGINEERING
from app.web.view import PAGES as TABS
from tests.demo_plant import DEMO, MACHINES
from tests.web.operating import Operator
from tests.web.people import Staff

LANGUAGES = ("hr", "en", "de", "cs")


@pytest.mark.parametrize(
    ("address", "about"),
    [
        ("/", ("overview", "")),
        ("/area/drives", ("area", "")),
        ("/equipment/m1", ("machine", "m1")),
        ("/equipment/cr1/page/hoist", ("machine", "cr1")),
        ("/equipment/m1/faceplate", ("machine", "m1")),
        ("/equipment/m1/parameters", ("parameters", "m1")),
        ("/equipment/m1/drive/compare", ("parameters", "m1")),
        ("/equipment/c1/events", ("events", "c1")),
        ("/records/run?equipment=seq1", ("records", "")),
        ("/instructor/m1", ("instructor", "m1")),
        ("/no-such-page", ("other", "")),
        ("//evil.example/<b>", ("other", "")),
    ],
)
def test_an_address_says_what_a_page_is_about(address: str, about: tuple[str, str]) -> None:
    assert subject(address) == about


def test_every_tab_and_every_engineering_page_has_its_own() -> None:
    urls = [url for _, url in TABS] + [url for _, url, _ in ENGINEERING] + ["/lessons", "/events", "/account"]
    assert [url for url in urls if subject(url)[0] == "other"] == []


@pytest.mark.sweep(8)
@pytest.mark.parametrize("language", LANGUAGES)
def test_nothing_is_missing_in_any_language(language: str) -> None:
    plant, _ = read_plant(DEMO)
    assert plant is not None
    texts = Texts.read()
    for topic in (*PAGES, "overview", "machine", "parameters", "other"):
        for part in ("what", "do"):
            assert not texts.text(language, f"help.on.{topic}.{part}").startswith("["), topic
    for kind in plant.types.values():
        assert len(kind.texts[language]["help.what"]) > 40, kind.name


@pytest.mark.parametrize("machine", MACHINES)
def test_the_help_of_a_machine_names_it_and_says_what_it_is(client: TestClient, machine: str) -> None:
    client.cookies.set("pogon_lang", "en")
    answer = client.get(f"/help?of=/equipment/{machine}", headers={"HX-Request": "true"})
    assert answer.status_code == 200
    assert "About this machine" in answer.text
    assert re.search(r"<kbd>F1</kbd>", answer.text)
    assert "What do colours and signs mean?" in answer.text


def test_an_address_that_is_none_gives_the_general_help(client: TestClient) -> None:
    client.cookies.set("pogon_lang", "en")
    page = client.get("/help", params={"of": "/equipment/<script>"}).text
    assert "<script>" not in page
    assert "About this machine" not in page


@pytest.mark.sweep(8)
def test_the_first_page_offers_what_one_may_do_and_every_way_is_there(demo: TestClient) -> None:
    staff = Staff(demo)
    for role, offered in {
        "viewer": {"/"},
        "operator": {"/equipment/m1", "/lessons", "/"},
        "engineer": {"/equipment/m1", "/lessons", "/instructor", "/"},
        "admin": {"/users", "/"},
    }.items():
        person = Operator(staff, f"new-{role}", (role,))
        page = person.get("/welcome", fragment=False).text
        found = set(re.findall(r'<li><a href="([^"]+)"', page))
        assert found == offered, role
        for url in found:
            assert person.get(url, fragment=False).status_code == 200, url
