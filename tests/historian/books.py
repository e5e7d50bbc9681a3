"""The history of events with one thing that is made of them, as the tests of that want it."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace

from sqlalchemy import Connection

from app.clock import Clock
from app.db import Database
from app.historian import passages, runs
from app.historian.events import Delivery, Events, store
from tests.historian.rings import Event


class Passages(Events):
    def __init__(
        self, database: Database, clock: Clock, changed: Callable[[str], None] = lambda equipment: None
    ) -> None:
        super().__init__(database, clock, changed, (passages.Passages(),))


class Runs(Events):
    def __init__(
        self, database: Database, clock: Clock, changed: Callable[[str], None] = lambda equipment: None
    ) -> None:
        super().__init__(database, clock, changed, (runs.Runs(),))


def caused(events: Sequence[Event], code: int, request: int, word: int | None = None) -> list[Event]:
    """`events`, those with `code` (and this first word of the snapshot) caused by command `request`."""
    return [
        replace(event, request=request) if event.code == code and word in (None, event.snapshot[0]) else event
        for event in events
    ]


def store_passages(connection: Connection, delivery: Delivery, alarms: Collection[int], now: int) -> bool:
    """Store what a machine that tracks products told; `alarms` are the codes that are alarms."""
    return store(connection, delivery, (passage_fold(delivery.equipment, alarms),), now)


def passage_fold(equipment: str, alarms: Collection[int] = ()) -> passages.Passages:
    """What is made of the events of a machine that tracks products."""
    fold = passages.Passages()
    fold._alarms, fold.machines = {equipment: frozenset(alarms)}, frozenset({equipment})
    return fold


def run_fold(**definitions: runs.Kept) -> runs.Runs:
    """What is made of the events of machines that run these sequences."""
    fold = runs.Runs()
    fold._definitions, fold.machines = definitions, frozenset(definitions)
    return fold
