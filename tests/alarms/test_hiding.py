"""Shelving and service: who, how long, why, and how an alarm comes back."""

from collections.abc import Callable
from dataclasses import replace

import pytest

from app.access.roles import Person, permissions_of
from app.alarms import journal
from app.alarms.engine import AlarmEngine
from app.alarms.hiding import Hiding
from app.alarms.shelf import MOST_SHELVED
from app.errors import Refused
from app.plant.alarm_class import AlarmClass
from app.tags.quality import NO_DATA
from tests.alarms.conftest import ANA, HOT, LOST, TRIP, Plot, plant

EVA = Person(8, "eva", "Eva", frozenset({"engineer"}), permissions_of({"engineer"}), "b" * 64)
HOUR = 3600.0
WHY = "sensor fault"


def one(engine: AlarmEngine) -> str:
    return "".join(str(found.state) for found in [*engine.list.active(), *engine.list.hidden()])


async def test_a_shelf_ends_by_its_time_and_what_is_active_asks_anew(plot: Plot) -> None:
    engine = await plot.begin(HOT)
    plot.put(t=71.0)
    await engine.acknowledge([engine.list.active()[0].occurrence], ANA)
    engine.hiding.shelve("m1.hot", ANA, HOUR, WHY)
    assert (one(engine), plot.count("shelved"), plot.count("hidden"), plot.count("total")) == ("G", 1, 1, 0)
    (shelved,) = engine.list.hidden()
    assert shelved.shelf is not None and (shelved.shelf.by, shelved.shelf.reason) == ("Ana Kos", WHY)
    sounds = engine.annunciations.count
    plot.wait(HOUR - 1)
    assert one(engine) == "G"
    plot.wait(1)
    assert (one(engine), engine.annunciations.count, plot.count("sound")) == ("B", sounds + 1, 3), "not C"
    assert engine.list.active()[0].shelf is None and engine.list.active()[0].acked_by == ""
    assert [(r.event, r.detail, r.person, r.comment) for r in await plot.records()][2:] == [
        ("SHELVED", "60 min", "ana", WHY),
        ("UNSHELVED", "timer", "", ""),
    ]


async def test_a_shelf_over_a_calm_alarm_ends_without_a_sound(plot: Plot) -> None:
    engine = await plot.begin(HOT)
    engine.hiding.shelve("m1.hot", ANA, HOUR, WHY)
    plot.put(t=71.0)
    plot.put(t=60.0)
    plot.wait(HOUR)
    assert (one(engine), engine.annunciations.count) == ("", 0)
    records = await plot.records()
    assert [(r.event, r.silent) for r in records] == [
        ("SHELVED", False), ("RAISED", True), ("RTN", True), ("UNSHELVED", False),
    ]  # fmt: skip


async def test_a_shelf_for_one_return_ends_with_it_and_the_next_alarm_is_heard(plot: Plot) -> None:
    engine = await plot.begin(HOT)
    plot.put(t=71.0)
    engine.hiding.shelve("m1.hot", ANA, HOUR, WHY, once=True)
    plot.put(t=60.0)
    assert one(engine) == ""
    plot.put(t=71.0)
    assert one(engine) == "B"
    assert [(r.event, r.detail) for r in await plot.records()][1:] == [
        ("SHELVED", "60 min one-shot"), ("RTN", ""), ("UNSHELVED", "one-shot"), ("RAISED", ""),
    ]  # fmt: skip


async def test_a_shelf_ends_by_hand_once(plot: Plot) -> None:
    engine = await plot.begin(HOT)
    engine.hiding.shelve("m1.hot", ANA, HOUR, WHY)
    engine.hiding.unshelve("m1.hot", ANA)
    assert one(engine) == ""
    with pytest.raises(Refused, match="not_shelved"):
        engine.hiding.unshelve("m1.hot", ANA)


@pytest.mark.parametrize(
    ("alarm", "seconds", "reason", "person", "why", "status"),
    [
        (HOT, HOUR, "", ANA, "reason", 422),
        (HOT, HOUR, "a  b ", ANA, "reason", 422),
        (HOT, 0.0, WHY, ANA, "shelve_time", 422),
        (HOT, float("nan"), WHY, ANA, "shelve_time", 422),
        (HOT, 12 * HOUR + 1, WHY, ANA, "shelve_time", 422),
        (replace(LOST, priority=3), 5 * HOUR, WHY, ANA, "shelve_time", 422),
        (TRIP, HOUR, WHY, ANA, "priority_engineer", 403),
        (replace(HOT, priority=1), HOUR, WHY, ANA, "priority_engineer", 403),
        (replace(HOT, alarm_class="highly-managed"), HOUR, WHY, EVA, "never_shelved", 409),
        (replace(HOT, key="other"), HOUR, WHY, ANA, "no_such_alarm", 404),
    ],
)
async def test_what_may_not_be_shelved_is_refused_with_its_reason_and_nothing_is_written(
    plot: Plot, alarm: object, seconds: float, reason: str, person: Person, why: str, status: int
) -> None:
    engine = await plot.begin(alarm)  # type: ignore[arg-type]
    key = "m1." + (alarm.key if why != "no_such_alarm" else "hot")  # type: ignore[attr-defined]
    with pytest.raises(Refused, match=f"alarm.why.{why}") as told:
        engine.hiding.shelve(key, person, seconds, reason)
    assert told.value.status == status
    assert one(engine) == "" and await plot.records() == []


async def test_an_engineer_shelves_what_is_important(plot: Plot) -> None:
    engine = await plot.begin(replace(HOT, priority=1))
    engine.hiding.shelve("m1.hot", EVA, HOUR, WHY)
    assert one(engine) == "G"
    with pytest.raises(Refused, match="already_shelved"):
        engine.hiding.shelve("m1.hot", EVA, HOUR, WHY)


async def test_an_area_has_no_more_shelves_than_it_may(plot: Plot) -> None:
    machines = [f"m{n}" for n in range(MOST_SHELVED + 1)]
    engine = await plot.begin(HOT, machines=machines)
    for machine in machines[:-1]:
        engine.hiding.shelve(f"{machine}.hot", ANA, HOUR, WHY)
    with pytest.raises(Refused, match="too_many_shelved"):
        engine.hiding.shelve(f"{machines[-1]}.hot", ANA, HOUR, WHY)
    assert plot.count("shelved") == MOST_SHELVED


async def test_out_of_service_has_no_end_and_reminds_after_a_week(plot: Plot) -> None:
    engine = await plot.begin(HOT)
    plot.put(t=71.0)
    engine.hiding.take_out("m1.hot", EVA, "pump dismantled", "P-17")
    assert (one(engine), plot.count("oos")) == ("I", 1)
    plot.wait(7 * 24 * HOUR - 1)
    assert one(engine) == "I"
    plot.wait(1)
    assert [found.id for found in engine.list.active()] == ["sys.service_review"]
    engine.hiding.review("m1.hot")
    assert not engine.list.active()[0].life.active, "it waits for its acknowledgement only"
    engine.hiding.put_back("m1.hot", EVA)
    assert {found.id for found in engine.list.active()} == {"m1.hot", "sys.service_review"}
    record = next(r for r in await plot.records() if r.event == "OOS_ON")
    assert (record.detail, record.comment, record.person) == ("P-17", "pump dismantled", "eva")
    for again in (lambda: engine.hiding.review("m1.hot"), lambda: engine.hiding.put_back("m1.hot", EVA)):
        with pytest.raises(Refused, match="not_out"):
            again()


async def test_service_goes_before_suppression_before_shelves(plot: Plot) -> None:
    engine = await plot.begin(replace(LOST, on_delay=0.0, off_delay=0.0), HOT)
    hiding: Hiding = engine.hiding
    plot.put(t=71.0, status=0)
    hiding.shelve("m1.hot", ANA, HOUR, WHY)
    seen: list[str] = []

    def look() -> None:
        seen.append(str(engine._index.get("m1.hot").life.state))  # type: ignore[union-attr]

    steps: list[Callable[[], object]] = [
        lambda: plot.put(status=0, quality=NO_DATA),
        lambda: hiding.take_out("m1.hot", EVA, WHY),
        lambda: hiding.put_back("m1.hot", EVA),
        lambda: plot.put(status=0),
        lambda: hiding.unshelve("m1.hot", ANA),
    ]
    look()
    for step in steps:
        step()
        look()
    assert "".join(seen) == "GHIHGB"


async def test_a_restart_and_a_reload_keep_shelves_and_service(plot: Plot) -> None:
    engine = await plot.begin(HOT, machines=["m1", "m2"])
    plot.put(t=71.0)
    engine.hiding.shelve("m1.hot", ANA, HOUR, WHY, once=True)
    engine.hiding.take_out("m2.hot", EVA, WHY, "P-1")
    before = {found.id: (found.shelf, found.service, found.state) for found in engine.list.hidden()}
    plot.configure(plant(replace(HOT, limit=65.0), machines=["m1", "m2"]))
    await engine.journal.flush()
    assert {found.id: (found.shelf, found.service, found.state) for found in engine.list.hidden()} == before
    plot.clock.advance(HOUR - 10)
    again = await plot.begin(HOT, machines=["m1", "m2"])
    assert {found.id: (found.shelf, found.service, found.state) for found in again.list.hidden()} == before
    plot.put(t=71.0)
    plot.wait(9)
    assert one(again) == "GI"
    plot.wait(1)
    assert one(again) == "BI"
    await again.journal.flush()
    times = await plot.database.read(lambda connection: journal.annunciations(connection, 0))
    assert len(times) == 2, "what came back counts as heard, also for the server that reads the journal next"


@pytest.mark.parametrize("restart", [False, True])
async def test_a_clock_set_back_by_a_year_hides_no_alarm_for_a_year(plot: Plot, restart: bool) -> None:
    engine = await plot.begin(HOT, machines=["m1", "m2"])
    plot.put(t=71.0)
    engine.hiding.shelve("m1.hot", ANA, HOUR, WHY)
    engine.hiding.take_out("m2.hot", EVA, WHY)
    plot.clock.step_wall(-365 * 24 * HOUR)
    if restart:
        await engine.journal.flush()
        engine = await plot.begin(HOT, machines=["m1", "m2"])
        plot.put(t=71.0)
    plot.wait(1)
    assert {found.id for found in engine.list.active()} == {"m1.hot", "sys.service_review"}
    assert [found.id for found in engine.list.hidden()] == ["m2.hot"]


async def test_a_clock_set_back_a_little_ends_no_shelf_and_lengthens_it_by_that(plot: Plot) -> None:
    engine = await plot.begin(HOT)
    plot.put(t=71.0)
    engine.hiding.shelve("m1.hot", ANA, HOUR, WHY)
    plot.clock.step_wall(-HOUR / 2)
    plot.wait(1.5 * HOUR - 1)
    assert one(engine) == "G"
    plot.wait(1)
    assert one(engine) == "B"


async def test_a_definition_that_goes_takes_its_shelf_along(plot: Plot) -> None:
    engine = await plot.begin(HOT)
    engine.hiding.shelve("m1.hot", ANA, HOUR, WHY)
    plot.configure(plant())
    plot.configure(plant(HOT))
    assert one(engine) == "" and engine._index.get("m1.hot").shelf is None  # type: ignore[union-attr]


async def test_the_plant_file_says_what_may_be_done_with_a_class(plot: Plot) -> None:
    engine = await plot.begin(HOT)
    assert plot.plant is not None
    kind = HOT.alarm_class
    plot.configure(
        replace(plot.plant, alarm_classes={kind: AlarmClass(0.5 * HOUR, out_of_service=False, reason=False)})
    )
    with pytest.raises(Refused) as told:
        engine.hiding.shelve("m1.hot", ANA, HOUR, WHY)
    assert (told.value.reason, told.value.params["most"]) == ("alarm.why.shelve_time", "30 min")
    with pytest.raises(Refused, match="never_out"):
        engine.hiding.take_out("m1.hot", EVA, WHY)
    assert engine.hiding.shelve("m1.hot", ANA, 0.5 * HOUR, "").life.shelved
    engine.hiding.unshelve("m1.hot", ANA)
    plot.configure(replace(plot.plant, alarm_classes={kind: AlarmClass(0.0)}))
    with pytest.raises(Refused, match="never_shelved"):
        engine.hiding.shelve("m1.hot", ANA, 60.0, WHY)
    with pytest.raises(Refused, match=r"alarm\.why\.reason"):
        engine.hiding.take_out("m1.hot", EVA, "")
    plot.configure(replace(plot.plant, alarm_classes={}))
    assert engine.hiding.shelve("m1.hot", ANA, 12 * HOUR, WHY).life.shelved
