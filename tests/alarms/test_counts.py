"""Counts are tags."""

from tests.alarms.conftest import ANA, HOT, TRIP, Plot


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


async def test_an_alarm_of_a_machine_that_a_reload_took_away_counts_as_the_systems(plot: Plot) -> None:
    """A hold that ends while its machine goes tells that the drive was left with another setpoint."""
    engine = await plot.begin(HOT, machines=("m1",))
    before = plot.count("by.sys.p2")
    engine.system.report("left_changed", "gone", params={"point": "@set_frequency"})
    engine.tick()
    plot.wait(1.0)
    assert [one.equipment for one in engine.list.active()] == ["gone"]
    assert [plot.count(key) for key in ("total", "active_2", "by.m1.p2")] == [1, 1, 0]
    assert (before, plot.count("by.sys.p2")) == (0, 1)
