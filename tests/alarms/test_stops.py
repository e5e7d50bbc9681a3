"""How often a machine was stopped, and by what first, told by an engine."""

from app.alarms.stops import Stops, read_stops
from tests.alarms.conftest import BLOCKED, HOT, OPEN, TRIP, Plot


async def read(plot: Plot, begin: int = 0) -> dict[str, Stops]:
    await plot.engine.journal.flush()
    until = plot.clock.micros() + 1
    return await plot.database.read(lambda connection: read_stops(connection, begin, until))


async def test_a_stop_is_counted_once_with_what_came_first(plot: Plot) -> None:
    await plot.begin(TRIP, OPEN, HOT)
    plot.put(status=6, after=5)
    plot.put(status=4, after=5)
    plot.put(status=1, after=60)
    found = (await read(plot))["m1"]
    assert (found.count, found.first_out.alarm) == (1, "m1.open")
    plot.put(status=4, after=60)  # though nobody has acknowledged the one before
    found = (await read(plot))["m1"]
    assert (found.count, found.first_out.alarm) == (2, "m1.trip")


async def test_a_warning_stops_nothing_and_another_day_has_its_own(plot: Plot) -> None:
    await plot.begin(BLOCKED, HOT)
    plot.put(t=90.0, after=60)
    assert await read(plot) == {}
    plot.put(status=5, after=60)
    later = plot.clock.micros() + 1
    assert (await read(plot))["m1"].first_out.alarm == "m1.blocked"
    plot.clock.advance(1)
    assert await read(plot, later) == {}
