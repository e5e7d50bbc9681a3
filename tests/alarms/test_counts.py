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
