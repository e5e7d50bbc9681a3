"""The life of an alarm: latches, re-alarms, and definitions that change."""

from dataclasses import replace

import pytest

from app.alarms.tables import state_table
from app.errors import Refused
from tests.alarms.conftest import ANA, HOT, TRIP, Plot, plant


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


async def test_an_acknowledged_alarm_asks_again_when_its_class_says_so(plot: Plot) -> None:
    engine = await plot.begin(replace(HOT, realarm=600.0))
    plot.put(t=71.0)
    await engine.acknowledge([engine.list.active()[0].occurrence], ANA)
    plot.wait(599)
    assert plot.letters == "C"
    plot.wait(1)
    assert plot.letters == "B"
    assert (await plot.story())[-1] == "REALARM CB"


async def test_it_asks_again_although_the_clock_was_set_back_by_a_year(plot: Plot) -> None:
    engine = await plot.begin(replace(HOT, realarm=600.0))
    plot.put(t=71.0)
    await engine.acknowledge([engine.list.active()[0].occurrence], ANA)
    plot.clock.step_wall(-60)
    plot.wait(1)
    assert plot.letters == "C"
    plot.clock.step_wall(-365 * 86_400)
    plot.wait(1)
    assert plot.letters == "B"


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


@pytest.mark.parametrize(("gone", "stays"), [("m1", "m2"), ("m2", "m1")])
async def test_a_machine_goes_with_an_alarm_and_the_value_of_another_one_is_not_told_as_its_own(
    plot: Plot, gone: str, stays: str
) -> None:
    """Where the tags of a machine stood others stand after the plant files were read anew, or none."""
    await plot.begin(HOT, TRIP, machines=("m1", "m2"))
    plot.put(stays, t=20.0, status=1)
    plot.put(gone, t=72.0, status=4)
    plot.configure(plant(HOT, TRIP, machines=(stays,)))
    plot.put(stays, t=20.0, status=1)
    removed = [one for one in await plot.records() if one.event == "REMOVED"]
    assert [one.alarm for one in removed] == [f"{gone}.hot", f"{gone}.trip"]
    assert [one.value for one in removed] == [None, None]
    assert plot.letters == ""
