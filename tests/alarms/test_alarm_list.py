"""The active list and its order."""

from dataclasses import replace

from tests.alarms.conftest import ANA, HOT, Plot


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
