"""Annunciations are counted, and a flood is told."""

from tests.alarms.conftest import HOT, Plot


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
