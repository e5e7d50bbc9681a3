"""Events are found by machine, code, time and text, page by page, as brute force finds them."""

import random
from dataclasses import replace

import pytest
from sqlalchemy import Connection

from app.db import Database
from app.historian import event_search as search
from app.historian.event_search import EventFilter
from app.historian.events import Delivery, EndedCommand, attribute, store
from app.records.event import Event
from tests.historian.rings import BEGIN, SECOND, Ring

PEOPLE = (("", ""), ("Ana Kos", "fell down"), ("Ivo Čačić", "ŠTO JE OVO"))


@pytest.fixture
def told(history: Database) -> list[Event]:
    source = random.Random(5)

    def work(connection: Connection) -> None:
        for id in ("p1", "p2", "p3"):
            ring = Ring(time=BEGIN)
            for number in range(200):
                ring.tell(source.randrange(1, 9), number, request=number % 3, after=source.choice((0, 1, 30)))
            store(connection, Delivery(id, ring.drain()), (), BEGIN)
            for request, (person, reason) in enumerate(PEOPLE):
                if request:
                    attribute(connection, EndedCommand(id, (request,), person, reason, BEGIN, ring.time), ())

    history.run(work)
    everything = history.run(lambda connection: search.find(connection, EventFilter(), 10_000))
    assert len(everything) == 600
    return everything


CASES = [
    EventFilter(),
    EventFilter("p2"),
    EventFilter("nobody"),
    EventFilter(begin=BEGIN + 300 * SECOND, end=BEGIN + 900 * SECOND),
    EventFilter("p1", begin=BEGIN + 300 * SECOND),
    EventFilter(codes={"p1": [3, 4], "p3": [7]}),
    EventFilter("p2", codes={"p1": [3]}),
    EventFilter(text="FELL"),
    EventFilter(text="čačić"),
    EventFilter(text="što je"),
    EventFilter(text="nothing like it"),
    EventFilter(text="ana", worded={"p2": [1], "p3": []}),
    EventFilter(text="%"),
    EventFilter(code=4),
    EventFilter("p2", code=4, codes={"p2": [3]}),
    EventFilter(code=4, codes={"p2": [3, 4]}),
    EventFilter(text="ana", people=False),
    EventFilter(text="ana", worded={"p2": [1], "p3": []}, people=False),
]


def lets_through(wanted: EventFilter, one: Event) -> bool:
    text = wanted.text.casefold()
    return (
        wanted.equipment in ("", one.equipment)
        and (wanted.begin is None or one.time >= wanted.begin)
        and (wanted.end is None or one.time < wanted.end)
        and (wanted.codes is None or one.code in wanted.codes.get(one.equipment, ()))
        and wanted.code in (None, one.code)
        and (
            not text
            or (wanted.people and (text in one.person.casefold() or text in one.reason.casefold()))
            or one.code in (wanted.worded or {}).get(one.equipment, ())
        )
    )


@pytest.mark.sweep(8)
@pytest.mark.parametrize("wanted", CASES, ids=range(len(CASES)))
def test_filters_and_pages_are_those_of_brute_force(history: Database, told: list[Event], wanted: EventFilter) -> None:
    expected = sorted(
        (one for one in told if lets_through(wanted, one)), key=lambda one: (one.time, one.id), reverse=True
    )
    assert history.run(lambda connection: search.count(connection, wanted, 10_000)) == len(expected)
    assert history.run(lambda connection: search.count(connection, wanted, 7)) == min(7, len(expected))
    found: list[Event] = []
    while True:
        before = (found[-1].time, found[-1].id) if found else None
        asked = replace(wanted, before=before)
        page = history.run(lambda connection, asked=asked: search.find(connection, asked, 17))  # type: ignore[misc]
        found += page
        if len(page) < 17:
            break
    assert found == expected


def test_one_event_and_a_machine_are_known_or_not(history: Database, told: list[Event]) -> None:
    assert history.run(lambda connection: search.get(connection, told[0].id)) == told[0]
    assert history.run(lambda connection: search.get(connection, 10**9)) is None
    assert history.run(lambda connection: (search.known(connection, "p1"), search.known(connection, "x"))) == (
        True,
        False,
    )
