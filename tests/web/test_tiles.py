"""Tiles that were just drawn are good for the next who looks: they cost little, are true, and hold nothing of one person or another."""

import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from html import unescape
from typing import Any

import pytest
from fastapi.testclient import TestClient
from jinja2 import UndefinedError, meta

from app import bundled
from app.tags.batch import Batch
from app.tags.quality import BAD
from app.web import tiles
from app.web.points import EquipmentView
from app.web.view import templates
from tests.web.conftest import Start
from tests.web.operating import Operator, runtime_of
from tests.web.people import Staff

GIVEN = {"equipment", "marks", "operation", "picture", "machines_of", "tells"}
"""What a tile and a picture get, and what one of them says to its part."""
OWN = re.compile(r'name="csrf" value="[^"]*"|data-(?:revision|nonce|mark)="[^"]*"|<time.*?</time>', re.S)


@pytest.fixture
def client(start: Start) -> TestClient:
    client = start()
    client.pass_time(1)  # type: ignore[attr-defined]
    return client


class Calls:
    """Of functions, while they are counted."""

    count = 0

    def __call__(self, frame: Any, event: str, argument: Any) -> None:
        self.count += event in ("call", "c_call")


@contextmanager
def calls() -> Iterator[Calls]:
    counted = Calls()
    sys.setprofile(counted)
    try:
        yield counted
    finally:
        sys.setprofile(None)


def work_of(client: TestClient, path: str) -> int:
    with calls() as counted:
        assert client.get(path).status_code in (200, 401)
    return counted.count


def put(client: TestClient, name: str, value: float) -> None:
    """The machine says `value`, and no time passes."""
    runtime = runtime_of(client)

    async def publish() -> None:
        now, handle = runtime.clock.micros(), runtime.tags.handle(name)
        runtime.tags.publish(Batch("probe", 1, now, now, [handle], [value], quality=runtime.tags.quality(handle)))

    client.run(publish())  # type: ignore[attr-defined]


def grid(client: TestClient, path: str = "/") -> str:
    """Pictures and tiles of the page."""
    page = client.get(path).text
    return page[page.index('<div class="ov-grid') : page.index('id="alarm-summary"')]


@pytest.mark.sweep(8)
def test_who_comes_at_the_same_moment_costs_a_part_of_the_first(client: TestClient) -> None:
    work_of(client, "/")
    client.pass_time(1)  # type: ignore[attr-defined]
    first = work_of(client, "/")
    others = sorted(work_of(client, "/") for _ in range(29))
    assert others[15] * 4 < first, f"{first} calls of functions for the first, {others[15]} for the next"


@pytest.mark.sweep(8)
def test_the_sheet_of_the_sign_in_lies_over_tiles_that_others_have_drawn(client: TestClient) -> None:
    Staff(client).add("ada", "operator")
    for path in ("/", "/signin"):
        client.get(path)
    client.pass_time(1)  # type: ignore[attr-defined]
    first = work_of(client, "/")
    others = sorted(work_of(client, "/signin") for _ in range(5))
    assert others[2] * 4 < first, f"{first} calls of functions for the first, {others[2]} for the sheet"


@pytest.mark.sweep(8)
def test_a_number_on_a_tile_is_never_older_than_a_moment(client: TestClient) -> None:
    view, runtime = client.app.state.view, runtime_of(client)  # type: ignore[attr-defined]
    drawn = tiles.Tiles(view._environment(runtime.texts, "en"))
    item = runtime.plant.equipment["m1"]  # type: ignore[union-attr]

    def shown(value: float) -> str:
        put(client, "m1.current", value)
        tile = drawn.tile(EquipmentView(item, runtime, "en", partial(runtime.texts.text, "en")), {})
        found = re.search(r'data-tag="m1\.current".*?<b>([^<]*)</b>', tile, re.S)
        return found[1] if found else ""

    assert 0 < tiles.FRESH <= 0.3
    assert [shown(1.11), shown(2.22)] == ["1.11", "1.11"]
    client.pass_time(tiles.FRESH + 0.01)  # type: ignore[attr-defined]
    assert shown(2.33) == "2.33"


@pytest.mark.sweep(8)
@pytest.mark.parametrize("value", [0, 1, 2, 4])
def test_a_state_on_a_tile_and_in_the_picture_is_as_it_is_now(client: TestClient, value: int) -> None:
    client.cookies.set("pogon_lang", "en")
    grid(client)
    put(client, "m1.status", value)
    says = runtime_of(client).plant.equipment["m1"]  # type: ignore[union-attr]
    text = says.type.texts["en"][says.points["status"].texts[value]]
    shown = re.findall(r'data-tag="m1\.status"[^>]*data-silent[^>]*>([^<]*)<', grid(client))
    assert [unescape(one) for one in shown] == [text, text]


@pytest.mark.sweep(8)
def test_a_lost_link_shows_at_once_on_every_tile(client: TestClient) -> None:
    runtime = runtime_of(client)
    client.pass_time(1)  # type: ignore[attr-defined]
    assert 'data-tag="m1.current" data-q="good"' in grid(client)

    async def lose() -> None:
        now, handle = runtime.clock.micros(), runtime.tags.handle("m1.current")
        runtime.tags.publish(Batch("probe", 1, now, now, [handle], [0.0], quality=BAD))

    client.run(lose())  # type: ignore[attr-defined]
    assert not re.search(r'class="val[^>]*data-tag="m1\.current" data-q="good"', grid(client))


@pytest.mark.sweep(8)
def test_an_alarm_marks_the_tile_of_its_machine_at_once(client: TestClient) -> None:
    place = re.compile(r'data-mark-of="m2" data-look="alm-[ls]">(.*?)</span>', re.S)
    client.pass_time(1)  # type: ignore[attr-defined]
    assert set(place.findall(grid(client))) == {""}

    async def report() -> None:
        runtime_of(client).alarms.system.report("command_unconfirmed", "m2", params={"command": "x"})

    client.run(report())  # type: ignore[attr-defined]
    client.pass_time(0.1)  # type: ignore[attr-defined]
    marks = place.findall(grid(client))
    assert len(marks) == 2 and all("<svg" in mark for mark in marks)


@pytest.mark.sweep(8)
def test_every_language_has_tiles_of_its_own(client: TestClient) -> None:
    seen = set()
    for language in ("hr", "en", "de", "cs"):
        client.cookies.set("pogon_lang", language)
        seen.add(grid(client))
    assert len(seen) == 4


@pytest.mark.sweep(8)
def test_nothing_of_one_person_reaches_another(client: TestClient) -> None:
    staff = Staff(client)
    ada = Operator(staff, "ada", ("admin", "engineer", "operator"))
    boris = Operator(staff, "boris", ("operator",))
    vera = Operator(staff, "vera", ("viewer",))
    ada.take("m1")
    boris.take("m2")

    def seen_by(person: Operator | None) -> str:
        if person:
            person.sit()
        else:
            staff.have()
            client.cookies.set("pogon_lang", "en")
        return OWN.sub("", grid(client))

    for first in (ada, boris, vera, None):
        client.pass_time(1)  # type: ignore[attr-defined]
        shown = {person and person.name: seen_by(person) for person in (first, None, ada, boris, vera)}
        assert {
            name for text in shown.values() for name in ("ada", "boris", "vera") if re.search(rf"\b{name}\b", text)
        } == set()
        assert all("csrf" not in text and "nonce" not in text and "<form" not in text for text in shown.values())


def test_a_tile_is_given_nothing_of_who_asks() -> None:
    environment = templates()
    known = set(environment.globals) | GIVEN
    folder = bundled("templates")
    names = [*folder.glob("screens/*/tile.html"), *folder.glob("screens/*/part_why.html")]
    names += [
        folder / "fragments" / name for name in ("tile.html", "tile_why.html", "plant_picture.html", "part_why.html")
    ]
    assert len(names) > 10
    for file in names:
        asked = meta.find_undeclared_variables(environment.parse(file.read_text("utf-8")))
        assert {"person", "csrf", "request", "alarms", "operation_of", "status"}.isdisjoint(asked - known), file


@pytest.mark.sweep(8)
def test_a_tile_that_asks_who_looks_is_an_error(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    runtime, view = runtime_of(client), client.app.state.view  # type: ignore[attr-defined]
    environment = view._environment(runtime.texts, "en")
    item = runtime.plant.equipment["m1"]  # type: ignore[union-attr]
    source = environment.from_string("{{ person.name }}")
    monkeypatch.setattr(environment, "select_template", lambda names: source)
    with pytest.raises(UndefinedError):
        tiles.Tiles(environment).tile(EquipmentView(item, runtime, "en", lambda key: key), {})


@pytest.mark.sweep(8)
def test_who_may_not_view_gets_no_tile_that_another_has_just_drawn(client: TestClient) -> None:
    staff = Staff(client)
    Operator(staff, "ada", ("admin", "engineer", "operator")).get("/", fragment=False)
    runtime = runtime_of(client)
    staff.have()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(type(runtime), "simulated", property(lambda self: False))
        page = client.get("/signin").text
        assert client.get("/").status_code in (303, 401)
    assert 'class="panel ov' not in page and 'data-tag="m1.' not in page and "data-mark-of" not in page


@pytest.mark.sweep(8)
def test_the_lines_of_all_tiles_are_asked_for_at_once_and_are_those_of_the_tiles(client: TestClient) -> None:
    for address, area in (("/", ""), ("/area/drives", "?area=drives")):
        page = client.get(address).text
        asked = re.findall(r'hx-get="([^"]*)" hx-trigger="[^"]*every 5s', page)
        assert asked == [f"/why{area}"]
        lines = dict(
            re.findall(r'<p id="why-(\w+)" hx-swap-oob="innerHTML">(.*?)</p>', client.get(asked[0]).text, re.S)
        )
        places = re.findall(r'id="why-(\w+)"[^>]*hx-trigger="signal">', page)
        assert len(places) > 1 and set(lines) == set(places) and page.count('id="why-') == len(places)
        for machine, line in lines.items():
            assert line.strip() == client.get(f"/equipment/{machine}/part/why").text.strip()


@pytest.mark.sweep(8)
def test_a_tile_is_not_asked_for_again_because_a_page_begins_to_follow(client: TestClient) -> None:
    """The script dispatches `signal` when the value is another one than the page was made with (static/js/values.js)."""
    runtime = runtime_of(client)
    made = re.findall(r'data-tag="([^"]*)"\s+data-signal="([^"]*)"\s+hx-get="/equipment/', client.get("/").text)
    assert len(made) == len(runtime.plant.equipment)  # type: ignore[union-attr]
    for tag, value in made:
        assert value == f"{runtime.tags.value(runtime.tags.handle(tag)):g}", tag


@pytest.mark.sweep(8)
def test_thirty_pages_that_ask_for_their_lines_cost_little_more_than_one(client: TestClient) -> None:
    work_of(client, "/why")
    client.pass_time(2)  # type: ignore[attr-defined]
    first = work_of(client, "/why")
    others = sorted(work_of(client, "/why") for _ in range(29))
    single = sum(work_of(client, f"/equipment/{id}/part/why") for id in runtime_of(client).plant.equipment)  # type: ignore[union-attr]
    assert others[15] * 2 < first and others[15] * 6 < single, (first, others[15], single)
