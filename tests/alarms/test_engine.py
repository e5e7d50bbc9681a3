"""All alarms of a plant at work: the stories of reference/alarms.md section 12 against a real database."""

from collections.abc import AsyncIterator, Callable, Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from app.access.roles import Person, permissions_of
from app.alarms import journal
from app.alarms.definitions import SYSTEM_ALARMS, alarm_points
from app.alarms.engine import AlarmEngine
from app.alarms.lifecycle import AlarmState
from app.alarms.tables import journal_table, state_table
from app.clock import ManualClock
from app.db import Database
from app.errors import Refused, StorageError
from app.plant.definitions import Alarm, Command, Device, Equipment, EquipmentType, Kind, Plant, Point
from app.plant.texts import Texts
from app.records.snapshot import Field
from app.tags.batch import Batch, Value
from app.tags.database import Tag, TagDatabase
from app.tags.quality import COMM_FAILURE, GOOD
from tests.virtual import inline

KEY = b"k" * 32
ANA = Person(7, "ana", "Ana Kos", frozenset({"operator"}), permissions_of({"operator"}), "a" * 64, address="10.0.0.7")
IVO = replace(ANA, id=8, name="ivo", display="Ivo Ban")

HOT = Alarm("hot", "alarm.hot.label", "", 3, kind="high", value="t", limit=70.0, dead_band=1.0)
TRIP = Alarm("trip", "alarm.trip.label", "status == 4", 2, alarm_class="drive", value="status")
BLOCKED = Alarm("blocked", "alarm.blocked.label", "status == 5", 2, alarm_class="drive", value="status")
OPEN = Alarm("open", "alarm.open.label", "status in (4, 5, 6)", 2, alarm_class="drive", value="status")
LOST = Alarm("communication", "alarm.lost.label", "bad(status)", 2, on_delay=3.0, off_delay=5.0, alarm_class="comm")
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


async def test_shorter_than_the_on_delay_is_no_alarm_and_no_record(plot: Plot) -> None:
    engine = await plot.begin(replace(HOT, on_delay=10.0))
    plot.put(t=71.0)
    plot.wait(9.9)
    plot.put(t=60.0)
    plot.wait(10)
    assert engine.list.active() == []
    assert await plot.records() == []


async def test_raise_time_is_when_it_first_was_true_and_annunciation_comes_after_the_delay(plot: Plot) -> None:
    engine = await plot.begin(replace(HOT, on_delay=10.0))
    began = plot.clock.micros()
    plot.put(t=71.0)
    assert engine.evaluation.due == plot.clock.monotonic() + 10
    plot.wait(10)
    (one,) = engine.list.active()
    assert (one.state, one.first_true, one.annunciated) == (AlarmState.UNACKNOWLEDGED, began, began + 10_000_000)
    (record,) = await plot.records()
    assert (record.first_true, record.time, record.value, record.limit, record.unit) == (
        began,
        began + 10_000_000,
        71.0,
        70.0,
        "°C",
    )
    assert record.text == "Vruće: 71.0 > 70.0"


async def test_acknowledging_ends_the_sound_and_says_who_in_the_journal(plot: Plot) -> None:
    engine = await plot.begin(HOT)
    plot.put(t=71.0)
    assert plot.count("sound") == 3
    (answer,) = await engine.acknowledge([engine.list.active()[0].occurrence], ANA, "I go and look")
    assert (answer.outcome, answer.by) == ("done", "Ana Kos")
    assert plot.letters == "C"
    assert plot.count("sound") == 0
    last = (await plot.records())[-1]
    assert (last.event, last.person, last.address, last.comment, last.roles) == (
        "ACK",
        "ana",
        "10.0.0.7",
        "I go and look",
        "operator",
    )


async def test_a_returned_alarm_stays_until_it_is_acknowledged(plot: Plot) -> None:
    engine = await plot.begin(HOT)
    plot.put(t=71.0)
    plot.put(t=60.0, after=5)
    assert plot.letters == "D"
    assert engine.list.active()[0].symbol == "rtn"
    assert plot.count("sound") == 0, "silenced on return"
    await engine.acknowledge([engine.list.active()[0].occurrence], ANA)
    assert plot.letters == ""


async def test_an_acknowledged_alarm_goes_by_itself(plot: Plot) -> None:
    engine = await plot.begin(HOT)
    plot.put(t=71.0)
    await engine.acknowledge([engine.list.active()[0].occurrence], ANA)
    plot.put(t=60.0)
    assert plot.letters == ""
    assert await plot.story() == ["RAISED AB", "ACK BC", "RTN CA"]


async def test_a_late_acknowledgement_never_meets_the_next_occurrence(plot: Plot) -> None:
    engine = await plot.begin(HOT)
    plot.put(t=71.0)
    first = engine.list.active()[0]
    plot.put(t=60.0)
    plot.put(t=71.0)
    second = engine.list.active()[0]
    assert second.count == 2
    assert second.occurrence != first.occurrence
    (answer,) = await engine.acknowledge([first.occurrence], ANA)
    assert answer.outcome == "gone"
    assert plot.letters == "B"


async def test_the_second_of_two_acknowledgements_says_by_whom(plot: Plot) -> None:
    engine = await plot.begin(HOT)
    plot.put(t=71.0)
    occurrence = engine.list.active()[0].occurrence
    first, second = await engine.acknowledge([occurrence], ANA), await engine.acknowledge([occurrence], IVO)
    assert (first[0].outcome, second[0].outcome, second[0].by) == ("done", "already", "Ana Kos")
    plot.put(t=60.0)
    assert (await engine.acknowledge([occurrence], IVO))[0].by == "Ana Kos", "also when it is over"
    assert (await plot.story()).count("ACK BC") == 1


async def test_a_latched_alarm_waits_for_acknowledgement_and_reset_in_this_order(plot: Plot) -> None:
    engine = await plot.begin(replace(HOT, latching=True))
    plot.put(t=71.0)
    occurrence = engine.list.active()[0].occurrence
    with pytest.raises(Refused, match="still_active"):
        await engine.reset(occurrence, ANA)
    plot.put(t=60.0)
    assert plot.letters == "E"
    assert plot.count("sound") == 3
    with pytest.raises(Refused, match="acknowledge_first"):
        await engine.reset(occurrence, ANA)
    await engine.acknowledge([occurrence], ANA)
    assert plot.letters == "F"
    await engine.reset(occurrence, ANA)
    assert plot.letters == ""
    assert await plot.story() == ["RAISED AB", "RTN BE", "ACK EF", "RESET FA"]


async def test_a_class_without_acknowledgement_goes_by_itself(plot: Plot) -> None:
    await plot.begin(replace(HOT, ack_required=False))
    plot.put(t=71.0)
    plot.put(t=60.0)
    assert plot.letters == ""
    assert [(one.event, one.detail) for one in await plot.records()] == [("RAISED", ""), ("RTN", "AUTOACK")]


async def test_the_off_delay_keeps_an_alarm(plot: Plot) -> None:
    engine = await plot.begin(replace(HOT, off_delay=5.0))
    plot.put(t=71.0)
    await engine.acknowledge([engine.list.active()[0].occurrence], ANA)
    plot.put(t=60.0)
    plot.wait(4.9)
    plot.put(t=71.0)
    plot.put(t=60.0)
    plot.wait(4.9)
    assert plot.letters == "C"
    plot.wait(0.2)
    assert plot.letters == ""


async def test_high_and_very_high_are_two_alarms(plot: Plot) -> None:
    engine = await plot.begin(HOT, replace(HOT, key="very_hot", limit=80.0, priority=1))
    plot.put(t=81.0)
    assert [one.key for one in engine.list.active()] == ["very_hot", "hot"]
    await engine.acknowledge([engine.list.active()[1].occurrence], ANA)
    assert [(one.key, str(one.state)) for one in engine.list.active()] == [("very_hot", "B"), ("hot", "C")]


async def test_data_that_vanish_never_end_an_alarm_and_the_lost_link_is_told_once(plot: Plot) -> None:
    engine = await plot.begin(HOT, LOST)
    plot.put(t=71.0, status=1)
    plot.put(quality=COMM_FAILURE, t=71.0, status=1)
    assert [(one.key, str(one.state), one.known) for one in engine.list.active()] == [("hot", "B", False)]
    plot.wait(3)
    assert [one.key for one in engine.list.active()] == ["communication"]
    assert [(one.key, str(one.state), one.rule) for one in engine.list.hidden()] == [("hot", "H", "communication")]
    plot.put(quality=COMM_FAILURE, t=0.0, status=0, after=1)
    plot.wait(60)
    assert (await plot.story()).count("RAISED AB") == 2
    assert "RTN" not in " ".join(await plot.story())


async def test_garbage_raises_nothing(plot: Plot) -> None:
    engine = await plot.begin(HOT, TRIP)
    plot.put(quality=COMM_FAILURE, t=999.0, status=4)
    plot.wait(60)
    assert engine.list.active() == []
    assert await plot.records() == []


async def test_when_the_device_answers_again_its_alarms_come_back_after_their_delay(plot: Plot) -> None:
    engine = await plot.begin(replace(HOT, on_delay=2.0), LOST)
    plot.put(t=71.0, status=1)
    plot.wait(2)
    hot = engine.list.active()[0].occurrence
    plot.put(quality=COMM_FAILURE, t=71.0, status=1)
    plot.wait(3)
    plot.put(t=72.0, status=1)
    plot.wait(5)
    assert [one.key for one in engine.list.active()] == ["communication"], "the link is back, the rest is judged anew"
    plot.wait(2)
    assert {one.key for one in engine.list.active()} == {"communication", "hot"}
    assert next(one for one in engine.list.active() if one.key == "hot").occurrence > hot


async def test_what_raises_while_its_device_is_silent_is_written_down_silently(plot: Plot) -> None:
    engine = await plot.begin(replace(HOT, value="t"), LOST)
    plot.put(t=60.0, status=1)
    plot.put(quality=COMM_FAILURE, status=1)
    plot.wait(3)
    told = engine.annunciations.count
    plot.put(t=75.0)
    assert engine.annunciations.count == told
    assert [(one.event, one.before, one.after, one.silent) for one in await plot.records()][-2:] == [
        ("SUPPRESSED", "A", "H", False),
        ("RAISED", "H", "H", True),
    ]


async def test_a_restart_changes_nothing_and_tells_nothing(plot: Plot) -> None:
    alarms = [replace(HOT, key=key, latching=key in "ef") for key in "bcdef"]
    machines = list("bcdef")
    everything = [replace(one, on_delay=0.0) for one in alarms]
    engine = await plot.begin(*everything, machines=machines)
    for machine in machines:
        plot.put(machine, t=71.0)
    keep = {f"{key}.{key}" for key in "bcdef"}
    own = {one.id: one for one in engine.list.active()}
    await engine.acknowledge([own["c.c"].occurrence, own["f.f"].occurrence], ANA)
    for machine in "def":
        plot.put(machine, t=60.0)
    before = {one.id: one for one in engine.list.active()}
    assert "".join(str(before[id].state) for id in sorted(keep)) == "BCDEF"
    await engine.journal.flush()
    sounds = plot.count("sound")
    again = await plot.begin(*everything, machines=machines)
    after = {one.id: one for one in again.list.active()}
    assert after.keys() == before.keys()
    for id, one in before.items():
        assert replace(after[id], chattering=one.chattering) == one
    assert again.annunciations.count == 0
    assert plot.count("sound") == sounds
    story = await plot.story()
    assert [line for line in story if line.startswith("RAISED")] == ["RAISED AB"] * 25
    assert sum(line.startswith("RESTORED") for line in story) == len(before)
    for machine in machines:
        plot.put(machine, t=60.0)
    assert after["c.c"].id not in {one.id for one in again.list.active()}, "it goes on from where it stood"


async def test_occurrences_are_never_numbered_twice(plot: Plot) -> None:
    engine = await plot.begin(HOT)
    plot.put(t=71.0)
    first = engine.list.active()[0].occurrence
    await engine.acknowledge([first], ANA)
    plot.put(t=60.0)
    await engine.journal.flush()
    again = await plot.begin(HOT)
    plot.put(t=71.0)
    assert again.list.active()[0].occurrence > first


async def test_an_acknowledged_alarm_asks_again_when_its_class_says_so(plot: Plot) -> None:
    engine = await plot.begin(replace(HOT, realarm=600.0))
    plot.put(t=71.0)
    await engine.acknowledge([engine.list.active()[0].occurrence], ANA)
    plot.wait(599)
    assert plot.letters == "C"
    plot.wait(1)
    assert plot.letters == "B"
    assert (await plot.story())[-1] == "REALARM CB"


async def test_members_of_a_first_out_group_are_numbered_as_they_came(plot: Plot) -> None:
    engine = await plot.begin(
        replace(HOT, key="a", alarm_class="drive"),
        replace(HOT, key="b", limit=80.0, alarm_class="drive"),
        replace(HOT, key="c", limit=90.0, alarm_class="drive"),
    )
    plot.put(t=75.0)
    plot.put(t=85.0, after=0.040)
    plot.put(t=95.0, after=1.160)
    by = {one.key: one for one in engine.list.active()}
    assert [(by[key].ordinal, by[key].uncertain) for key in "abc"] == [(1, False), (2, False), (3, False)]
    times = [by[key].first_true - by["a"].first_true for key in "abc"]
    assert times == [0, 40_000, 1_200_000]
    await engine.acknowledge([one.occurrence for one in engine.list.active()], ANA)
    assert {one.key: one.ordinal for one in engine.list.active()} == {"a": 1, "b": 2, "c": 3}, "acknowledging keeps it"
    plot.put(t=60.0)
    plot.put(t=85.0)
    assert min(one.ordinal for one in engine.list.active()) == 1, "the next trip begins anew"


async def test_two_of_one_scan_have_no_known_order(plot: Plot) -> None:
    engine = await plot.begin(TRIP, OPEN)
    plot.put(status=4)
    assert [(one.ordinal, one.uncertain) for one in sorted(engine.list.active(), key=lambda one: one.ordinal)] == [
        (1, True),
        (2, True),
    ]


async def test_the_list_has_what_waits_first_then_priority_then_the_newest(plot: Plot) -> None:
    engine = await plot.begin(
        replace(HOT, key="one", priority=1),
        replace(HOT, key="three", limit=80.0),
        replace(HOT, key="later", limit=90.0),
    )
    plot.put(t=75.0)
    await engine.acknowledge([engine.list.active()[0].occurrence], ANA)
    plot.put(t=85.0, after=1)
    plot.put(t=95.0, after=1)
    assert [one.key for one in engine.list.active()] == ["later", "three", "one"]
    latest = engine.list.latest()
    assert latest is not None
    assert latest.key == "later"


async def test_a_chattering_alarm_is_one_row_with_its_count(plot: Plot) -> None:
    engine = await plot.begin(HOT)
    for _ in range(5):
        plot.put(t=71.0, after=5)
        plot.put(t=60.0, after=5)
    (one,) = engine.list.active()
    assert (one.count, one.chattering) == (5, True)
    assert [line.split()[0] for line in await plot.story()] == ["RAISED", "RTN"] * 5
    await engine.acknowledge([one.occurrence], ANA)
    plot.put(t=71.0, after=3600)
    assert (engine.list.active()[0].count, engine.list.active()[0].chattering) == (1, False)


async def test_a_flood_begins_with_ten_in_ten_minutes_and_ends_below_five(plot: Plot) -> None:
    engine = await plot.begin(HOT)
    for _ in range(9):
        plot.put(t=71.0, after=15)
        plot.put(t=60.0, after=15)
    assert not engine.annunciations.flood
    plot.put(t=71.0, after=15)
    assert engine.annunciations.flood
    assert plot.count("flood") == 1
    plot.wait(480)  # the sixth of the ten is 600 s old
    assert engine.annunciations.flood
    plot.wait(1)
    assert not engine.annunciations.flood


async def test_a_thousand_alarms_at_once_are_all_in_the_journal(plot: Plot) -> None:
    machines = [f"m{index}" for index in range(1000)]
    engine = await plot.begin(TRIP, machines=machines)
    now = plot.clock.micros()
    handles = [plot.tags.handle(f"{machine}.status") for machine in machines]
    plot.tags.publish(Batch("hall", 0, now, now, handles, [4] * 1000))
    records = await plot.records()
    assert len(engine.list.active()) == 1000
    assert [one.seq for one in records] == list(range(1, 1001))
    assert plot.count("unack_2") == 1000


async def test_every_transition_is_one_record_in_a_chain_without_gaps(plot: Plot) -> None:
    engine = await plot.begin(HOT, TRIP)
    for value, status in ((71.0, 1), (60.0, 4), (75.0, 1)):
        plot.put(t=value, status=status, after=1)
        await engine.acknowledge([one.occurrence for one in engine.list.active()], ANA)
    records = await plot.records()
    assert [one.seq for one in records] == list(range(1, len(records) + 1))
    for id in {one.alarm for one in records}:
        own = [one for one in records if one.alarm == id]
        assert [one.before for one in own][1:] == [one.after for one in own][:-1], (
            "each begins where the last one ended"
        )
    assert (await engine.journal.verify()).ok
    assert (await engine.journal.verify()).count == len(records)


@pytest.mark.parametrize(
    ("spoil", "why"),
    [
        (
            lambda c: c.execute(journal_table.update().where(journal_table.c.seq == 2).values(person="nobody")),
            "changed",
        ),
        (lambda c: c.execute(journal_table.delete().where(journal_table.c.seq == 2)), "removed"),
        (lambda c: c.execute(journal_table.update().where(journal_table.c.seq == 2).values(value=1.5)), "changed"),
    ],
)
async def test_a_record_that_was_tampered_with_is_found(
    plot: Plot, spoil: Callable[[object], object], why: str
) -> None:
    engine = await plot.begin(HOT)
    plot.put(t=71.0)
    await engine.acknowledge([engine.list.active()[0].occurrence], ANA)
    plot.put(t=60.0)
    await engine.journal.flush()
    await plot.database.write(spoil)
    verdict = await engine.journal.verify()
    assert (verdict.bad, verdict.why) == (2, why)


async def test_a_new_limit_acts_at_once_on_the_alarm_that_stands(plot: Plot) -> None:
    engine = await plot.begin(HOT)
    plot.put(t=72.0)
    one = engine.list.active()[0]
    await engine.acknowledge([one.occurrence], ANA)
    plot.configure(plant(replace(HOT, limit=71.0)))
    assert [(now.occurrence, str(now.state)) for now in engine.list.active()] == [(one.occurrence, "C")]
    plot.configure(plant(replace(HOT, limit=75.0)))
    assert engine.list.active() == []
    records = await plot.records()
    assert [(r.event, r.detail) for r in records][2:] == [
        ("LIMIT_CHANGED", "limit: 70.0 → 71.0"),
        ("LIMIT_CHANGED", "limit: 71.0 → 75.0"),
        ("RTN", ""),
    ]


async def test_an_alarm_whose_definition_is_gone_is_closed(plot: Plot) -> None:
    engine = await plot.begin(HOT, TRIP)
    plot.put(t=72.0, status=4)
    plot.configure(plant(TRIP))
    assert [one.key for one in engine.list.active()] == ["trip"]
    assert (await plot.story())[-1] == "REMOVED BA"
    again = await plot.begin(HOT)
    assert again.list.active() == []
    assert (await plot.story())[-1] == "REMOVED BA", "also when it went while the server was down"
    await again.journal.flush()
    assert await plot.database.read(lambda c: c.execute(state_table.select()).all()) == []


async def test_a_new_priority_sounds_again_only_upward(plot: Plot) -> None:
    engine = await plot.begin(HOT)
    plot.put(t=72.0)
    told = engine.annunciations.count
    plot.configure(plant(replace(HOT, priority=4)))
    assert engine.annunciations.count == told
    plot.configure(plant(replace(HOT, priority=1)))
    assert engine.annunciations.count == told + 1
    assert [r.detail for r in await plot.records()][1:] == ["3 → 4", "4 → 1"]


async def test_alarms_of_the_system_are_told_and_over(plot: Plot) -> None:
    engine = await plot.begin(HOT)
    engine.system.report("link_down", None, True, {"link": "hall"})
    engine.system.report("link_down", None, True, {"link": "yard"})
    assert engine.list.active() == [], "it may be a moment only"
    plot.wait(5)
    assert [one.id for one in engine.list.active()] == ["sys.link_down.hall", "sys.link_down.yard"]
    engine.system.report("link_down", None, False, {"link": "hall"})
    plot.wait(5)
    assert {one.id: str(one.state) for one in engine.list.active()} == {
        "sys.link_down.hall": "D",
        "sys.link_down.yard": "B",
    }
    assert plot.count("by.sys.p2") == 2
    with pytest.raises(KeyError):
        engine.system.report("no_such_alarm")


async def test_something_that_happened_is_over_when_it_is_acknowledged(plot: Plot) -> None:
    engine = await plot.begin(HOT)
    engine.system.report("command_unconfirmed", "m1", True, {"command": "forward"})
    (one,) = engine.list.active()
    assert (one.id, one.equipment, one.priority) == ("sys.command_unconfirmed.m1", "m1", 3)
    await engine.acknowledge([one.occurrence], ANA)
    assert engine.list.active() == []


async def test_an_unconfirmed_stop_stands_until_the_machine_stands(plot: Plot) -> None:
    engine = await plot.begin(HOT)
    plot.put(status=1)
    engine.system.stop_unconfirmed("m1")
    (one,) = engine.list.active()
    assert one.priority == 1
    await engine.acknowledge([one.occurrence], ANA)
    assert plot.letters == "C", "acknowledging does not stop a machine"
    plot.put(status=0)
    assert plot.letters == ""


async def test_counts_are_tags(plot: Plot) -> None:
    engine = await plot.begin(HOT, TRIP, machines=("m1", "m2"))
    plot.put("m1", t=71.0, status=1)
    plot.put("m2", t=71.0, status=4)
    await engine.acknowledge([one.occurrence for one in engine.list.active() if one.id == "m1.hot"], ANA)
    assert [
        plot.count(key) for key in ("total", "unack_2", "unack_3", "active_3", "by.m2.p2", "by.m1.p2", "sound")
    ] == [3, 1, 1, 2, 1, 0, 2]
    revision = plot.count("revision")
    plot.put("m1", t=72.0)
    assert plot.count("revision") == revision, "a value that changes is not a change of the list"


async def test_a_database_that_does_not_take_the_journal_stops_nothing(plot: Plot) -> None:
    engine = await plot.begin(HOT)
    plot.put(t=71.0)
    write = plot.database.write

    async def full(work: object) -> object:
        raise StorageError("disk full")

    plot.database.write = full  # type: ignore[method-assign, assignment]
    (answer,) = await engine.acknowledge([engine.list.active()[0].occurrence], ANA)
    assert answer.outcome == "done"
    assert not engine.journal.healthy
    assert "sys.journal_waiting" in [one.id for one in engine.list.active()]
    plot.database.write = write  # type: ignore[method-assign]
    records = await plot.records()
    assert [one.event for one in records] == ["RAISED", "ACK", "RAISED"]
    assert engine.journal.healthy
    assert (await engine.journal.verify()).ok


async def test_the_last_occurrences_have_their_times(plot: Plot) -> None:
    engine = await plot.begin(HOT)
    for _ in range(3):
        plot.put(t=71.0, after=60)
        await engine.acknowledge([engine.list.active()[0].occurrence], ANA)
        plot.put(t=60.0, after=7)
    await engine.journal.flush()
    past = await plot.database.read(lambda c: journal.occurrences(c, "m1.hot", 2))
    assert [(one.returned - one.raised, one.acked_by, one.value) for one in past] == [(7_000_000, "ana", 71.0)] * 2


async def test_texts_of_parameters_stay_data(plot: Plot) -> None:
    engine = await plot.begin(HOT)
    engine.system.report("task_down", None, True, {"task": "<img onerror=alert(1)>"})
    plot.wait(1)
    assert engine.list.active()[0].params == {"task": "<img onerror=alert(1)>"}
    assert (await plot.records())[0].parameters == {"task": "<img onerror=alert(1)>"}
