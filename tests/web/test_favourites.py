"""Each person marks pages with a star: they stand in the menu and first in the search, and outlive the server."""

import re
from dataclasses import replace

import pytest
from fastapi.testclient import TestClient

from app.access.kept import FAVOURITE
from tests.web.operating import Operator
from tests.web.people import Staff
from tests.web.test_palette import hits


@pytest.fixture(scope="module")
def staff(demo: TestClient) -> Staff:
    demo.pass_time(2)
    return Staff(demo)


def in_menu(page: str) -> list[str]:
    menu = re.search(r'<div id="favourites"[^>]*>(.*?)</div>', page, re.DOTALL)
    assert menu
    return re.findall(r'<a href="([^"]*)"', menu[1])


def pressed(page: str) -> str:
    star = re.search(r'id="star"[^>]*aria-pressed="(\w+)"', page)
    return star[1] if star else "none"


def test_a_star_puts_a_page_into_the_menu_and_first_into_the_search_and_takes_it_out(staff: Staff) -> None:
    zoe = Operator(staff, "zoe", ("operator",))
    assert pressed(zoe.get("/equipment/m2", fragment=False).text) == "false"
    answer = zoe.post("/favourites", at="/equipment/m2", on="1")
    assert (answer.status_code, pressed(answer.text), in_menu(answer.text)) == (200, "true", ["/equipment/m2"])
    zoe.post("/favourites", at="/trends", on="1")
    page = zoe.get("/equipment/m2", fragment=False).text
    assert (pressed(page), in_menu(page)) == ("true", ["/equipment/m2", "/trends"])
    assert [url for url, _ in hits(zoe.get("/palette/found").text)][:2] == ["/equipment/m2", "/trends"]
    assert hits(zoe.get("/palette/found?q=fan").text)[0] == ("/equipment/m2", "Fan 2")
    answer = zoe.post("/favourites", at="/equipment/m2", on="")
    assert (pressed(answer.text), in_menu(answer.text)) == ("false", ["/trends"])
    zoe.post("/favourites", at="/trends", on="")


@pytest.mark.sweep(8)
def test_who_has_one_opens_every_page_that_a_frame_has(staff: Staff) -> None:
    """What a page is drawn with has other names than what its frame is drawn with; a lesson's had one of the menu's."""
    leo = Operator(staff, "leo", ("admin", "engineer", "operator"))
    leo.post("/favourites", at="/trends", on="1")
    first = leo.get("/", fragment=False).text
    pages = {url for url in re.findall(r'href="(/[^"#?]*)"', first) if not url.startswith("/static/")}
    pages |= {url for page in pages for url in re.findall(r'href="(/[^"#?]*)"', leo.get(page, fragment=False).text)}
    pages = {url for url in pages if not url.startswith(("/static/", "/api/v1/"))}
    assert {"/lessons/motor", "/account", "/equipment/m2", "/instructor"} <= pages
    for url in sorted(pages):
        answer = leo.get(url, fragment=False)
        assert answer.status_code in (200, 303, 404), url
        whole = answer.status_code == 200 and answer.text.startswith("<!doctype html>")
        assert not whole or in_menu(answer.text) == ["/trends"], url


def test_it_is_ones_own_and_names_the_page_in_ones_language(staff: Staff) -> None:
    Operator(staff, "ana", ("operator",)).post("/favourites", at="/alarms", on="1")
    iva = Operator(staff, "iva", ("operator",), "hr")
    assert in_menu(iva.get("/alarms", fragment=False).text) == []
    iva.post("/favourites", at="/equipment/c1", on="1")
    assert re.search(
        r'href="/equipment/c1">.*?<span hx-ignore>Pokretna traka 1', iva.get("/alarms", fragment=False).text, re.S
    )


def test_only_a_page_that_one_may_see_can_be_marked(staff: Staff) -> None:
    ana = Operator(staff, "ana", ("operator",))
    for at in ("/users", "/nowhere", "https://evil.test/", "//evil.test", ""):
        answer = ana.post("/favourites", at=at, on="1")
        assert answer.status_code == 422, at
    assert "/nowhere" in ana.post("/favourites", at="/nowhere", on="1").text
    assert pressed(ana.get("/", fragment=False).text) == "none", "home is a button already"
    staff.have()
    assert pressed(staff.client.get("/equipment/m2").text) == "none", "a guest keeps nothing"
    assert staff.post("/favourites", {"at": "/trends", "on": "1"}).status_code in (303, 401, 403)


def test_as_many_as_fit_a_menu(staff: Staff) -> None:
    eva = Operator(staff, "eva", ("operator", "engineer"))
    urls = [url for url, _ in hits(eva.get("/palette/found").text) if url != "/"]
    machine_pages = [f"/equipment/{one}/parameters" for one in ("m1", "m2", "c1", "cc1", "seq1", "cr1", "a1")]
    answers = [eva.post("/favourites", at=at, on="1") for at in dict.fromkeys(urls + machine_pages)]
    codes = [answer.status_code for answer in answers]
    assert codes[: FAVOURITE.most] == [200] * FAVOURITE.most
    assert codes[FAVOURITE.most] == 409
    assert str(FAVOURITE.most) in answers[FAVOURITE.most].text


def test_what_is_kept_is_read_back_from_the_database(staff: Staff) -> None:
    ida = Operator(staff, "ida", ("operator",))
    ida.post("/favourites", at="/alarms", on="1")
    ida.post("/favourites", at="/equipment/m1", on="1")
    staff.access.kept._all.clear()
    staff.wait(staff.access.kept.load)
    assert in_menu(ida.get("/alarms", fragment=False).text) == ["/alarms", "/equipment/m1"]


def test_without_script_it_comes_back_to_the_page(staff: Staff) -> None:
    staff.enter("ada")
    answer = staff.client.request("GET", "/equipment/m1")
    assert answer.status_code == 200
    sent = staff.post("/favourites", {"at": "/equipment/m1", "on": "1"}, **{"Sec-Fetch-Site": "same-origin"})
    assert (sent.status_code, sent.headers["location"]) == (303, "/equipment/m1")


def test_a_page_that_says_what_is_wrong_has_no_star(staff: Staff) -> None:
    ana = Operator(staff, "ana", ("operator",))
    wrong = ana.get("/audit?since=yesterday", fragment=False)
    assert (wrong.status_code, pressed(wrong.text)) == (422, "none")


def gone_in_menu(page: str) -> list[tuple[str, str]]:
    """Address and name of what is listed as gone."""
    menu = re.search(r'<div id="favourites"[^>]*>(.*?)</div>', page, re.DOTALL)
    assert menu
    return re.findall(
        r'name="at" value="([^"]*)"><span class="grow"><span hx-ignore>([^<]*)</span>\s*<small>no longer', menu[1]
    )


@pytest.mark.sweep(8)
def test_a_machine_that_was_taken_out_of_the_plant_is_told_in_the_menu_until_it_is_removed_there(
    staff: Staff, demo: TestClient
) -> None:
    una, runtime = Operator(staff, "una", ("operator",)), staff.client.app.state.runtime  # type: ignore[attr-defined]
    for at in ("/equipment/m2", "/equipment/a1/page/words", "/trends"):
        assert una.post("/favourites", at=at, on="1").status_code == 200
    assert gone_in_menu(una.get("/alarms", fragment=False).text) == []
    whole = runtime.plant
    try:
        runtime.plant = replace(
            whole, equipment={key: one for key, one in whole.equipment.items() if key not in ("m2", "a1")}
        )
        page = una.get("/alarms", fragment=False).text
        assert in_menu(page) == ["/trends"]
        assert gone_in_menu(page) == [
            ("/equipment/m2", "Fan 2 · m2 · Frequency converter EURA E800"),
            ("/equipment/a1/page/words", "Words and faults · Axis 1 · a1"),
        ]
        answer = una.post("/favourites", at="/equipment/m2", on="")
        assert (answer.status_code, len(gone_in_menu(answer.text)), in_menu(answer.text)) == (200, 1, ["/trends"])
        sent = staff.post(
            "/favourites", {"at": "/equipment/a1/page/words", "on": ""}, **{"Sec-Fetch-Site": "same-origin"}
        )
        assert (sent.status_code, sent.headers["location"]) == (303, "/"), "where it was is no page any more"
        assert gone_in_menu(una.get("/alarms", fragment=False).text) == []
    finally:
        runtime.plant = whole
