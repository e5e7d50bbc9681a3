"""Points that are computed while the plant runs: with what they depend on, with time, and from where they were."""

from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest

from app.clock import ManualClock
from app.db import Database
from app.plant.derive import Derivation
from app.plant.loader import read_plant
from app.plant.retained import RetainedStates
from app.running.derived import DERIVED, DerivedPoints
from app.tags.batch import Batch, Value
from app.tags.database import Tag, TagDatabase
from tests.conftest import ROOT
from tests.virtual import inline

PLANT, _ = read_plant(ROOT / "plants" / "demo")


class Hall:
    """The derived points of the demo plant over a real database."""

    def __init__(self, folder: Path, database: Database) -> None:
        self.clock = ManualClock()
        self.tags = TagDatabase(self.clock)
        assert PLANT is not None
        self.derivation = Derivation(PLANT)
        names = sorted(self.derivation.inputs | self.derivation.names)
        self.tags.configure(
            [Tag(name, name, DERIVED if name in self.derivation.names else "link.hall") for name in names]
        )
        self.points = DerivedPoints(self.tags, self.clock, RetainedStates(database))
        self.tags.subscribe(self.points.follow)

    def take(self) -> None:
        self.points.take(self.derivation)
        self.points.renew()

    def tell(self, **values: Value) -> None:
        now = self.clock.micros()
        handles = [self.tags.handle(f"m1.{key}") for key in values]
        self.tags.publish(Batch("link.hall", 0, now, now, handles, list(values.values())))

    def kept(self, name: str) -> Mapping[str, object]:
        return self.derivation.retained()[name]


@pytest.fixture
def database(tmp_path: Path) -> Iterator[Database]:
    opened = Database(tmp_path / "pogon.db", "pogon", inline)
    opened.migrate()
    yield opened
    opened.close()


@pytest.fixture
def hall(tmp_path: Path, database: Database) -> Hall:
    return Hall(tmp_path, database)


def run_for(hall: Hall, seconds: int) -> None:
    hall.tell(status=1)
    for _ in range(seconds):
        hall.clock.advance(1)
        hall.points.pass_time()


async def test_without_a_plant_nothing_is_computed(hall: Hall) -> None:
    hall.points.renew()
    hall.tell(status=1)
    hall.points.pass_time()
    hall.points.compute_all()
    await hall.points.keep()
    assert all(hall.tags.value(hall.tags.handle(name)) is None for name in hall.derivation.names)


async def test_hours_run_with_time_and_go_on_after_a_restart(hall: Hall, database: Database, tmp_path: Path) -> None:
    hall.take()
    run_for(hall, 3600)
    hours = hall.tags.handle("m1.running_hours")
    assert hall.tags.value(hours) == pytest.approx(1.0, abs=0.01)
    await hall.points.keep()
    again = Hall(tmp_path, database)
    await again.points.restore(again.derivation)
    again.take()
    again.points.compute_all()
    assert again.tags.value(hours) == pytest.approx(1.0, abs=0.01)


async def test_another_plant_goes_on_from_what_was_counted(hall: Hall) -> None:
    hall.take()
    run_for(hall, 1800)
    former = hall.derivation
    assert PLANT is not None
    hall.derivation = Derivation(PLANT)
    hall.take()
    assert hall.derivation.retained() == former.retained()


async def test_what_it_published_itself_sets_nothing_off(hall: Hall) -> None:
    hall.take()
    seen: list[str] = []
    hall.tags.subscribe(lambda batch: seen.append(batch.source))
    hall.tell(status=1)
    assert seen.count(DERIVED) <= 1 and seen.count("link.hall") == 1
