"""The page of all events: found by machine, event, time and text; one with all that it says; CSV; in four languages."""

import re
from collections.abc import Iterator
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient
from sqlalchemy import Connection

from app.errors import StorageError
from app.historian.events import Delivery, EndedCommand, attribute, has_ring, store
from app.runtime import Runtime
from app.settings import Settings
from tests import virtual
from tests.historian.rings import BEGIN, SECOND, Ring
from tests.web.people import Staff

MARCH = {"since": "2026-03-09T00:00", "until": "2026-03-10T00:00"}


def runtime_of(client: TestClient) -> Runtime:
    found: Runtime = client.app.state.runtime  # type: ignore[attr-defined]
    return found


def fill(connection: Connection) -> None:
    """What a conveyor told in March, and a machine that is gone; one event that somebody asked for, with a text that is no text."""
    ring = Ring()
    for product in range(1, 131):
        ring.tell(1, product, source=1)
    ring.tell(24, source=2, value=12.5)
    ring.tell(20, 9, second=8, value=4.5, other=6.25)
    ring.tell(6, 9, request=77)
    ring.tell(999, 1)
    store(connection, Delivery("c1", ring.drain(), 3), (), BEGIN)
    asked = EndedCommand("c1", (77,), "=Ana; Kos", '<b>fell</b> "down"\n=HYPERLINK("x")', ring.time - SECOND, ring.time)
    assert attribute(connection, asked, ())
    ring = Ring()
    ring.tell(7)
    store(connection, Delivery("gone", ring.drain()), (), BEGIN)
    connection.exec_driver_sql("DELETE FROM event_mark WHERE equipment = 'c1'")


@pytest.fixture(scope="module")
def staff(demo: TestClient) -> Iterator[Staff]:
    crew = Staff(demo)
    crew.wait(runtime_of(demo).history.write, fill)
    yield crew


def get(staff: Staff, path: str, status: int = 200, **query: Any) -> Any:
    answer = staff.client.get(path, params=query)
    assert answer.status_code == status, answer.text
    return answer


def count(page: str) -> int:
    return page.count('data-row="')


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("query", "wanted"),
    [
        (MARCH, 100),
        ({**MARCH, "equipment": "gone"}, 1),
        ({**MARCH, "event": "jam"}, 1),
        ({**MARCH, "event": "jam", "equipment": "gone"}, 0),
        ({**MARCH, "event": "deleted", "equipment": "c1"}, 1),
        ({**MARCH, "event": "999"}, 1),
        ({**MARCH, "event": "7"}, 1),
        ({**MARCH, "event": "7", "equipment": "c1"}, 0),
        ({**MARCH, "q": "FELL"}, 1),
        ({**MARCH, "q": "=ana"}, 1),
        ({**MARCH, "q": "jam"}, 1),
        ({**MARCH, "q": "nothing of the kind"}, 0),
        ({"since": "2026-03-09T07:00", "until": "2026-03-09T07:00:03", "equipment": "c1"}, 2),
    ],
)
def test_filters(staff: Staff, query: dict[str, str], wanted: int) -> None:
    staff.enter("ana", "viewer")
    for path in ("/events", "/events/list"):
        assert count(get(staff, path, **query).text) == wanted
    times = {"since": "from", "until": "to"}
    asked = {times.get(name, name): f"{value}Z" if name in times else value for name, value in utc(query).items()}
    assert len(get(staff, "/api/v1/events", **asked).json()["events"]) == wanted


def utc(query: dict[str, str]) -> dict[str, str]:
    """The same with times of UTC, an hour behind those of the plant in March."""
    return {
        name: (datetime.fromisoformat(value) - timedelta(hours=1)).isoformat() if name in ("since", "until") else value
        for name, value in query.items()
    }


def test_programs_read_the_same_events_page_by_page(staff: Staff) -> None:
    staff.enter("ana", "viewer")
    span = {"from": "2026-03-09T00:00:00Z", "to": "2026-03-10T00:00:00Z", "equipment": "c1"}
    seen: list[dict[str, Any]] = []
    before = ""
    while before is not None:
        page = get(staff, "/api/v1/events", limit=50, before=before, **span).json()
        seen += page["events"]
        assert page["lost"] == 3
        before = page["next"]
    assert [one["sequence"] for one in seen] == list(range(134, 0, -1))
    unknown, deleted, gap = seen[:3]
    assert (unknown["event"], unknown["code"], unknown["person"]) == ("999", 999, "")
    assert (deleted["event"], deleted["code"], deleted["command"]) == ("deleted", 6, 77)
    assert (deleted["person"], deleted["reason"]) == ("=Ana; Kos", '<b>fell</b> "down"\n=HYPERLINK("x")')
    assert deleted["words"]["product"] == 9 and deleted["raw"][:4] == [0, 9, 0, 0]
    assert (gap["value"], gap["raw"][1], gap["raw"][3]) == (4.5, 9, 8)
    (gone,) = get(staff, "/api/v1/events", equipment="gone").json()["events"]
    assert (gone["event"], gone["words"], gone["code"]) == ("7", {}, 7)
    assert get(staff, "/api/v1/events", equipment="nobody").json() == {
        "events": [],
        "lost": 0,
        "gaps": [],
        "waiting": 0,
        "next": None,
    }


@pytest.mark.parametrize(
    "query",
    [
        {"event": "explosion"},
        {"event": "9" * 90},
        {"from": "2026-03-09T00:00:00"},
        {"from": "2026-03-10T00:00:00Z", "to": "2026-03-09T00:00:00Z"},
        {"before": "x"},
        {"limit": "0"},
        {"limit": "1001"},
        {"code": "7"},
        {"equipment": ["c1", "c2"]},
        {"q": "x" * 81},
    ],
)
def test_what_a_program_asks_wrongly_is_refused(staff: Staff, query: dict[str, Any]) -> None:
    staff.enter("ana", "viewer")
    get(staff, "/api/v1/events", 422, **query)


def test_a_guest_reads_that_it_was_somebody_and_nothing_that_they_wrote(staff: Staff) -> None:
    roads = [("/events", MARCH), ("/events/list", MARCH), ("/api/v1/events", {})]
    staff.enter("ana", "viewer")
    number = re.search(r'data-row="(\d+)"', get(staff, "/events", **MARCH, event="deleted").text)
    assert number
    roads.append((f"/events/detail/{number[1]}", {}))
    for words, wanted in ((("Ana", "fell"), True), (("Ana", "fell", "HYPERLINK"), False)):
        if not wanted:
            staff.have()
        for path, query in roads:
            text = get(staff, path, **query).text
            assert [word for word in words if word in text] == (list(words) if wanted else []), path
    for word in ("fell", "ana"):
        assert count(get(staff, "/events", **MARCH, q=word).text) == 0
        assert get(staff, "/api/v1/events", q=word).json()["events"] == []
    assert count(get(staff, "/events", **MARCH, q="jam").text) == 1


@pytest.mark.parametrize("path", ["/events?equipment=c1", "/records/passage?equipment=c1"])
def test_what_happens_while_a_list_is_read_is_asked_for_again(
    staff: Staff, monkeypatch: pytest.MonkeyPatch, path: str
) -> None:
    runtime = runtime_of(staff.client)
    reads = runtime.history.read

    async def read(work: Any) -> Any:
        found = await reads(work)
        runtime.events.changed("c1")
        return found

    monkeypatch.setattr(runtime.history, "read", read)
    staff.have()
    page = get(staff, path).text
    monkeypatch.undo()
    counted = re.search(r'data-tag="sys.events.c1" data-signal="(\d+)"', page)
    assert counted and int(counted[1]) < runtime.tags.value(runtime.tags.handle("sys.events.c1"))


def test_a_history_that_cannot_be_read_says_so(staff: Staff, monkeypatch: pytest.MonkeyPatch) -> None:
    staff.enter("ana", "viewer")

    async def broken(_work: Any) -> Any:
        raise StorageError("history.db: disk I/O error")

    for name in ("read", "read_long"):
        monkeypatch.setattr(runtime_of(staff.client).history, name, broken)
    for path in ("/events", "/events/list", "/api/v1/events"):
        get(staff, path, 503)


UNSTORED = {
    "hr": "Još nije zapisano događaja: {n}",
    "en": "Events not recorded yet: {n}",
    "de": "Noch nicht aufgezeichnete Ereignisse: {n}",
    "cs": "Dosud nezaznamenané události: {n}",
}


@pytest.mark.sweep(8)
def test_events_that_a_full_disk_does_not_take_are_missing_and_that_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On the lists of events and of records of that machine, for programs, and no longer when they are stored."""
    with virtual.house(Settings(data=tmp_path / "data")) as client:
        _full_disk(Staff(client), monkeypatch)


def _full_disk(staff: Staff, monkeypatch: pytest.MonkeyPatch) -> None:
    runtime = runtime_of(staff.client)
    staff.enter("ana", "viewer")

    async def full(_work: Any) -> Any:
        raise StorageError("history.db: database or disk is full")

    async def happen() -> None:
        ring = Ring(time=runtime.clock.micros(), sequence=20_000)
        for _ in range(3):
            ring.tell(24, source=2, value=12.5)
        with pytest.raises(StorageError):
            await runtime.events.take("c1", ring.drain())

    def told(path: str, lang: str, **query: str) -> str:
        staff.client.cookies.set("pogon_lang", lang)
        found = re.search(r'class="p-lost" role="status".*?<span>(.*?)</span>', get(staff, path, **query).text, re.S)
        return found[1] if found else ""

    lists = ("/events", "/events/list", "/records/passage", "/records/passage/list")
    assert [told(path, "hr") for path in lists] == [""] * 4
    before = runtime.tags.value(runtime.tags.handle("sys.events.c1"))
    monkeypatch.setattr(runtime.history, "write", full)
    staff.wait(happen)
    n = runtime.events.unstored(["c1"])
    assert n >= 3 and runtime.tags.value(runtime.tags.handle("sys.events.c1")) != before, "an open page asks again"
    for lang, sentence in UNSTORED.items():
        for path in lists:
            assert told(path, lang, equipment="c1") == sentence.format(n=n), (path, lang)
    assert told("/events", "hr", equipment="m1") == told("/records/run", "hr") == ""
    staff.client.cookies.delete("pogon_lang")
    for path in ("/api/v1/events", "/api/v1/records/passage"):
        assert get(staff, path, equipment="c1").json()["waiting"] == n
    monkeypatch.undo()
    staff.client.pass_time(10)  # type: ignore[attr-defined]
    assert [told(path, "hr", equipment="c1") for path in lists] == [""] * 4
    staff.client.cookies.delete("pogon_lang")
    for path in ("/api/v1/events", "/api/v1/records/passage"):
        assert get(staff, path, equipment="c1").json()["waiting"] == 0


def test_pages_follow_one_another_without_a_gap(staff: Staff) -> None:
    staff.enter("ana", "viewer")
    page = get(staff, "/events", equipment="c1", **MARCH).text
    older = re.search(r'href="([^"]+)" rel="next"', page)
    assert older
    rest = staff.client.get(older[1].replace("&amp;", "&")).text
    assert (count(page), count(rest)) == (100, 34)
    assert 'data-renewed="list"' in page and 'data-renewed="list"' not in rest


def test_it_is_told_where_events_are_missing(staff: Staff) -> None:
    """Between the machine's last event before and the first one after: on the page, for programs, in the file."""
    staff.enter("eva", "engineer", "viewer")
    span = {"from": "2026-03-09T00:00:00Z", "to": "2026-03-10T00:00:00Z", "equipment": "c1"}
    answer = get(staff, "/api/v1/events", limit=200, **span).json()
    first = answer["events"][-1]
    assert answer["gaps"] == [
        {
            "equipment": "c1",
            "count": 3,
            "after": None,
            "before": {name: first[name] for name in ("boot", "sequence", "time")},
        }
    ]
    for language, words in (("en", "3 before"), ("hr", "3 prije"), ("de", "3 vor"), ("cs", "3 před")):
        staff.client.cookies.set("pogon_lang", language)
        page = get(staff, "/events", **MARCH).text
        assert words in page and re.search(rf"{words} .*1, .*1\)", page), language
    staff.client.cookies.delete("pogon_lang")
    csv = get(staff, "/events/export.csv", **MARCH, locale="machine").text
    assert f"# lost: 3 events of c1 before {first['time'][:10]}" in csv
    assert "(boot 1, sequence 1)" in csv


def test_a_file_says_the_shift_of_each_event(staff: Staff) -> None:
    staff.enter("ana", "viewer")
    csv = get(staff, "/events/export.csv", **MARCH, locale="machine", shift="1").text
    head, *rows = [line.split(",") for line in csv.splitlines() if not line.startswith(("#", '"#'))]
    assert head[:3] == ["shift", "time_utc", "time_local"]
    assert "# shifts begin at: 06:00 14:00 22:00" in csv
    assert rows
    for row in rows:
        begun, time = datetime.fromisoformat(row[0]), datetime.fromisoformat(row[2])
        assert (begun.hour, begun.minute) in ((6, 0), (14, 0), (22, 0))
        assert timedelta() <= time - begun < timedelta(hours=8)
    page = get(staff, "/events", **MARCH).text
    assert "shift=1" in page, "a file for a person has them"
    german = get(staff, "/events/export.csv", **MARCH, locale="de", shift="1").text
    assert "\r\nSchicht;Zeit UTC;" in german


def test_whoever_has_no_menu_finds_the_events_beside_the_alarms(staff: Staff) -> None:
    """The menu of who is signed in has them; a small screen has no tabs."""
    staff.client.cookies.clear()
    assert 'href="/events"' in get(staff, "/alarms").text
    staff.enter("ana", "viewer")
    assert get(staff, "/alarms").text.count('href="/events"') == 1


def test_lost_events_are_told_and_a_machine_has_a_list_of_its_own(staff: Staff) -> None:
    staff.enter("ana", "viewer")
    assert 'class="p-lost tap"' in get(staff, "/events", **MARCH).text
    assert "p-lost" not in get(staff, "/events", **MARCH, equipment="gone").text
    assert count(get(staff, "/equipment/gone/events", **MARCH).text) == 1
    get(staff, "/equipment/nobody/events", 404)


@pytest.mark.parametrize("lang", ["hr", "en", "de", "cs"])
def test_a_machine_that_keeps_no_events_says_so_and_where_else_to_look(staff: Staff, lang: str) -> None:
    """Rather than that none fits, as if a filter hid them; a machine that keeps some and has none yet keeps its words."""
    staff.client.cookies.set("pogon_lang", lang)
    texts = runtime_of(staff.client).texts
    none, no_ring = (texts.text(lang, f"events.{name}") for name in ("none", "no_ring"))
    for page in (get(staff, "/equipment/m1/events").text, get(staff, "/events/list", equipment="m1").text):
        assert no_ring in page and none not in page
        assert '/alarms?tab=journal&amp;source=m1"' in page
    page = get(staff, "/events", equipment="c1", q="nothing of that kind").text
    assert none in page and no_ring not in page
    staff.client.cookies.delete("pogon_lang")


def test_one_event_says_all_that_it_knows_and_nothing_of_it_is_markup(staff: Staff) -> None:
    staff.enter("ana", "viewer")
    page = get(staff, "/events", **MARCH, event="deleted").text
    number = re.search(r'data-row="(\d+)"', page)
    assert number
    detail = get(staff, f"/events/detail/{number[1]}").text
    assert "6 deleted" in detail and "&lt;b&gt;fell" in detail and "<b>fell" not in page + detail
    assert "0000 0009 0000 0000" in detail and ">77<" in detail
    for wrong in (0, 10**9, 2**63, 10**30):
        assert staff.client.get(f"/events/detail/{wrong}").status_code in (404, 422)


@pytest.mark.parametrize(
    "query",
    [
        {"event": "explosion"},
        {"since": "yesterday-ish"},
        {"before": "x"},
        {"before": "1-" + "9" * 30},
        {"event": "9" * 90},
    ],
)
def test_what_cannot_be_read_is_refused(staff: Staff, query: dict[str, str]) -> None:
    staff.enter("ana", "viewer")
    for path in ("/events", "/events/list"):
        assert staff.client.get(path, params=query).status_code == 422


@pytest.mark.sweep(8)
@pytest.mark.parametrize("lang", ["hr", "en", "de", "cs", "machine"])
def test_csv_in_every_language(staff: Staff, lang: str) -> None:
    staff.enter("eva", "engineer")
    answer = get(staff, "/events/export.csv", equipment="c1", locale=lang, **MARCH)
    lines = [line for line in answer.text.splitlines() if not line.startswith(("#", '"#'))]
    assert len(lines) == 1 + 134
    last = next(line for line in lines if ";6;" in line or ",6," in line)
    assert "'=Ana; Kos" in last and "\n" not in last
    if lang == "machine":
        assert ",deleted,6,0,,product = 9," in last
    assert get(staff, "/events/export/size", equipment="c1", **MARCH).json()["rows"] == 134


def test_a_guest_reads_the_list_and_takes_nothing_home(staff: Staff) -> None:
    staff.have()
    assert "export.csv" not in get(staff, "/events", **MARCH).text
    assert staff.client.get("/events/export.csv").status_code in (303, 401)


@pytest.mark.sweep(8)
@pytest.mark.parametrize("lang", ["hr", "en", "de", "cs"])
def test_from_its_screen_one_comes_to_what_became_of_things_on_a_machine_and_to_what_it_told(
    staff: Staff, lang: str
) -> None:
    staff.enter("eva", "engineer")
    staff.client.cookies.set("pogon_lang", lang)
    plant = runtime_of(staff.client).plant
    assert plant is not None
    ways: dict[str, list[str]] = {}
    for item in plant.equipment.values():
        page = get(staff, f"/equipment/{item.id}").text
        assert '<a href="/events">' in page
        menu = re.search(r'<details class="drop histories">.*?</details>', page, re.S)
        found = re.findall(r'<a href="([^"]+)">([^<\[]+)</a>', menu[0]) if menu else []
        ways[item.id] = [url for url, _ in found]
        assert ways[item.id] == [
            *(f"/records/{kind}?equipment={item.id}" for kind in item.type.records),
            *([f"/equipment/{item.id}/events"] if has_ring(item) else []),
            *([f"/equipment/{item.id}/definition"] if item.type.name == "sequence" else []),
            f"/instructor/{item.id}",  # all of them are simulated
        ]
        for url, text in found:
            assert f"<h1>{text}</h1>" in get(staff, url).text
    assert len(ways["m1"]) == 1 and ways["cc1"][-2] == "/equipment/cc1/events" and len(ways["cc1"]) > 2
    staff.client.cookies.delete("pogon_lang")
