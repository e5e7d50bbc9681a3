"""Annunciations are counted, and a flood is told."""

from app.alarms.annunciations import Annunciations
from app.clock import ManualClock
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


async def test_a_clock_that_is_set_changes_no_rate(plot: Plot) -> None:
    engine = await plot.begin(HOT)
    plot.put(t=71.0, after=15)
    for step in (7200, -86_400, 3600):
        plot.wait(100)
        plot.clock.step_wall(step)
    now, (at,) = plot.clock.micros(), engine.annunciations.times
    assert 300e6 <= now - at < 320e6, "it was five minutes ago, whatever the clock says"
    plot.wait(86_400)
    assert engine.annunciations.times == ()


def test_of_the_journal_counts_what_was_and_not_what_is_still_to_come() -> None:
    clock = ManualClock()
    now, told = clock.micros(), Annunciations(clock)
    told.restore([now - 60_000_000, now + 3_600_000_000, now - 600_000_000])
    assert [round((now - at) / 1e6) for at in told.times] == [600, 60] and told.count == 0
