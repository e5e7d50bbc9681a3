"""What other parts of the server report."""

import pytest

from tests.alarms.conftest import ANA, HOT, Plot


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
