"""A plant, its clock and its alarms against a real database, and words for stories."""

from collections.abc import AsyncIterator, Sequence
from pathlib import Path

import pytest

from app.access.roles import Person, permissions_of
from app.alarms import journal
from app.alarms.definitions import SYSTEM_ALARMS, alarm_points
from app.alarms.engine import AlarmEngine
from app.clock import ManualClock
from app.db import Database
from app.plant.definitions import Alarm, Command, Device, Equipment, EquipmentType, Kind, Plant, Point
from app.plant.texts import Texts
from app.records.snapshot import Field
from app.tags.batch import Batch, Value
from app.tags.database import Tag, TagDatabase
from app.tags.quality import GOOD
from tests.virtual import inline

KEY = b"k" * 32
ANA = Person(7, "ana", "Ana Kos", frozenset({"operator"}), permissions_of({"operator"}), "a" * 64, address="10.0.0.7")
HOT = Alarm("hot", "alarm.hot.label", "", 3, kind="high", value="t", limit=70.0, dead_band=1.0)
OPEN = Alarm("open", "alarm.open.label", "status in (4, 5, 6)", 2, alarm_class="drive", value="status")
LOST = Alarm("communication", "alarm.lost.label", "bad(status)", 2, on_delay=3.0, off_delay=5.0, alarm_class="comm")
BLOCKED = Alarm("blocked", "alarm.blocked.label", "status == 5", 2, alarm_class="drive", value="status")
TRIP = Alarm("trip", "alarm.trip.label", "status == 4", 2, alarm_class="drive", value="status")
SNAPSHOT = {"product": Field(0, "u32", 0, "products"), "second": Field(2, "u32", 0), "second_value": Field(4, "f32")}
TEXTS = {
    "hr": {"alarm.hot.label": "Vruće: {value} > {limit}", "alarm.trip.label": "Ispad", "alarm.lost.label": "Veza"},
    "en": {"alarm.hot.label": "Hot: {value} > {limit}", "alarm.trip.label": "Trip", "alarm.lost.label": "Link"},
}


def plant(*alarms: Alarm, machines: Sequence[str] = ("m1",)) -> Plant:
    stop = Command("stop", "command.stop", (), "status == 0", "5", stop=True)
    keys = {"t": Kind.ANALOG, "status": Kind.ENUM}
    kind = EquipmentType(
        "fan", Path(), "type", Device(), {}, {"stop": stop}, (), (), {}, alarms, TEXTS, snapshot=SNAPSHOT
    )
    equipment = {}
    for id in machines:
        points = {
            key: Point(
                f"{id}.{key}", f"{id}.{key}", id, key, f"point.{key}", of, unit="°C" if key == "t" else "", decimals=1
            )
            for key, of in keys.items()
        }
        equipment[id] = Equipment(id, kind, "hall", 1, {"hr": id.upper()}, "drives", points, alarms)
    return Plant(Path(), {}, "Europe/Zagreb", ("hr", "en"), {}, {}, equipment, {"fan": kind})


class Plot:
    """A plant, its clock, its alarms, and words for stories."""

    def __init__(self, database: Database, clock: ManualClock) -> None:
        self.database = database
        self.clock = clock
        self.tags = TagDatabase(clock)
        self.engine: AlarmEngine

    async def begin(self, *alarms: Alarm, machines: Sequence[str] = ("m1",)) -> AlarmEngine:
        self.plant = plant(*alarms, machines=machines)
        self.tags = TagDatabase(self.clock)
        self.engine = AlarmEngine(self.tags, self.clock, self.database, Texts(PRODUCT, self.plant), KEY)
        await self.engine.load()
        self.configure(self.plant)
        return self.engine

    def configure(self, plant: Plant) -> None:
        points = [*plant.points.values(), *alarm_points(plant.equipment)]
        self.tags.configure(Tag(p.name, p.id, "sys" if p.equipment == "sys" else "hall") for p in points)
        self.engine.configure(plant)

    def put(self, machine: str = "m1", quality: int = GOOD, after: float = 0.0, **values: Value) -> None:
        self.clock.advance(after)
        now = self.clock.micros()
        handles = [self.tags.handle(f"{machine}.{key}") for key in values]
        self.tags.publish(Batch("hall", 0, now, now, handles, list(values.values()), quality))

    def wait(self, seconds: float) -> None:
        self.clock.advance(seconds)
        self.engine.tick()

    @property
    def letters(self) -> str:
        return "".join(str(one.state) for one in [*self.engine.list.active(), *self.engine.list.hidden()])

    async def records(self) -> list[journal.Record]:
        await self.engine.journal.flush()
        found = await self.database.read(lambda connection: journal.find(connection, journal.Filter(), 10_000))
        return found[::-1]

    async def story(self) -> list[str]:
        return [f"{one.event} {one.before}{one.after}" for one in await self.records()]

    def count(self, key: str) -> Value:
        self.engine.counts.publish()
        return self.tags.sample(f"sys.alarms.{key}").value


PRODUCT = {lang: {f"alarm.system.{key}.label": key for key in SYSTEM_ALARMS} for lang in ("hr", "en")}


@pytest.fixture
async def plot(tmp_path: Path) -> AsyncIterator[Plot]:
    database = Database(tmp_path / "pogon.db", "pogon", inline)
    database.migrate()
    yield Plot(database, ManualClock())
    database.close()
