"""Coils of a coil car: one being wound while the car carries another, each with its own beginning and end."""

import pytest

from app.plant import types
from app.records import fold
from app.records.fold import Machine
from app.records.record import Reading
from tests.records.shelf import MemoryShelf
from tests.sim.coil_car.line import Line

CAR = types.read_type("coil_car", [])[0].type
COIL = CAR.records["coil"]
CODES = {key: code for code, key in CAR.events.items()}
SECOND = 1_000_000


def told(*events: tuple[str, int, float]) -> MemoryShelf:
    shelf = MemoryShelf()
    for number, (key, source, value) in enumerate(events, 1):
        reading = Reading(1, number, number * SECOND, CODES[key], key, source, value)
        fold.take(Machine((COIL,)), shelf, reading)
    return shelf


def outcomes(shelf: MemoryShelf) -> list[tuple[object, ...]]:
    return [
        (one.begun // SECOND, one.entry > 0, one.outcome, one.fields.get("diameter"), one.fields.get("saddle"))
        for one in shelf.records
    ]


def test_the_next_is_wound_while_the_car_carries_one() -> None:
    shelf = told(
        ("winding_started", 0, 508.0),
        ("winding_stopped", 0, 700.0),
        ("winding_started", 0, 700.0),
        ("coil_finished", 0, 1200.0),
        ("coil_on_car", 0, 1200.0),
        ("winding_started", 0, 508.0),
        ("coil_laid", 2, 1200.0),
        ("coil_finished", 0, 900.0),
        ("coil_on_car", 0, 900.0),
        ("coil_laid", 1, 900.0),
    )
    assert outcomes(shelf) == [(1, True, "laid", 1200.0, 2), (6, True, "laid", 900.0, 1)]
    assert [one.fields["windings"] for one in shelf.records] == [2, 1]
    assert [[event.sequence for event in events] for events in shelf.events.values()] == [
        [1, 2, 3, 4, 5, 7],
        [6, 8, 9, 10],
    ]


@pytest.mark.parametrize(
    ("events", "wanted"),
    [
        (
            [("coil_finished", 0, 900.0), ("coil_on_car", 0, 900.0), ("coil_laid", 3, 900.0)],
            [(1, False, "laid", 900.0, 3)],
        ),
        ([("coil_on_car", 2, 900.0), ("coil_laid", 3, 900.0)], []),
        (
            [("winding_started", 0, 508.0), ("coil_on_car", 2, 900.0), ("coil_laid", 3, 900.0)],
            [(1, True, "open", None, None)],
        ),
        (
            [
                ("winding_started", 0, 508.0),
                ("coil_finished", 0, 900.0),
                ("coil_on_car", 0, 900.0),
                ("collision", 5, 10.0),
            ],
            [(1, True, "dropped", 900.0, None)],
        ),
        (
            [
                ("winding_started", 0, 508.0),
                ("coil_on_car", 0, 900.0),
                ("coil_on_mandrel", 0, 900.0),
                ("coil_on_car", 0, 900.0),
                ("coil_laid", 1, 900.0),
            ],
            [(1, True, "laid", 900.0, 1)],
        ),
        ([("winding_started", 0, 508.0), ("collision", 1, 10.0)], [(1, True, "open", None, None)]),
        ([("coil_removed", 1, 900.0), ("guard_opened", 1, 0.0)], []),
    ],
)
def test_what_becomes_of_a_coil(events: list[tuple[str, int, float]], wanted: list[tuple[object, ...]]) -> None:
    assert outcomes(told(*events)) == wanted


@pytest.mark.sweep(8)
def test_the_virtual_car_tells_what_the_kind_reads() -> None:
    """The same codes as the virtual device puts into its ring: a coil that the sequence transports from the mandrel to a saddle."""
    line = Line()
    line.machine.events()
    line.start()
    line.until(lambda: not line.plc.block.running, 300)
    shelf = MemoryShelf()
    for event in line.machine.events():
        key = CAR.events[event.code]
        reading = Reading(1, event.sequence, event.time, event.code, key, event.source, event.value)
        fold.take(Machine((COIL,)), shelf, reading)
    assert [(one.outcome, one.fields["saddle"]) for one in shelf.records if not one.open] == [("laid", 1)]
    assert float(shelf.records[0].fields["diameter"] or 0) > 500
