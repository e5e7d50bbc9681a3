"""Points that are computed while the plant runs: with what they depend on, with time, and from where they were."""

import asyncio
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


@pytest.mark.sweep(8)
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


async def killed(hall: Hall, database: Database, folder: Path, after: float) -> Hall:
    """The points of a server that starts anew, `after` [s] the one of `hall` was killed."""
    work = asyncio.create_task(hall.points.run())
    await asyncio.sleep(after)
    work.cancel()
    again = Hall(folder, database)
    await again.points.restore(again.derivation)
    again.take()
    again.points.compute_all()
    return again


async def test_starts_are_kept_when_the_server_is_killed_soon_after(
    hall: Hall, database: Database, tmp_path: Path
) -> None:
    """Not with the next minute: a motor of two starts had none after a kill."""
    hall.take()
    for status in (0, 1, 0, 1):
        hall.tell(status=status)
        hall.clock.advance(1)
    again = await killed(hall, database, tmp_path, after=11)
    assert again.tags.value(again.tags.handle("m1.starts")) == 2


@pytest.mark.sweep(8)
async def test_the_hours_of_a_motor_that_stopped_are_kept_to_the_second(
    hall: Hall, database: Database, tmp_path: Path
) -> None:
    hall.take()
    run_for(hall, 7200)
    hall.tell(status=0)
    again = await killed(hall, database, tmp_path, after=11)
    value = again.derivation.retained()["m1.running_hours"]["value"]
    assert value == pytest.approx(2.0, abs=1e-6)


@pytest.mark.sweep(8)
async def test_a_counter_that_was_set_back_stays_so(hall: Hall, database: Database, tmp_path: Path) -> None:
    hall.take()
    run_for(hall, 3600)
    await hall.points.keep()
    hall.derivation.reset("m1.running_hours")
    hall.points.pass_time()
    again = await killed(hall, database, tmp_path, after=11)
    assert again.derivation.retained()["m1.running_hours"]["value"] == 0


async def test_many_starts_are_one_write(hall: Hall) -> None:
    hall.take()
    writes: list[int] = []

    async def keep() -> None:
        writes.append(round(asyncio.get_running_loop().time()))

    hall.points.keep = keep  # type: ignore[method-assign]
    begun = round(asyncio.get_running_loop().time())
    work = asyncio.create_task(hall.points.run())
    for _ in range(20):
        hall.tell(status=1)
        await asyncio.sleep(0.05)
        hall.tell(status=0)
        await asyncio.sleep(0.05)
    await asyncio.sleep(140)
    work.cancel()
    assert [at - begun for at in writes] == [10, 70, 130]
