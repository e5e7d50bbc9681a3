"""What the journal says to the statistics, told by an engine and not by hand."""

from app.alarms.statistics import BUCKET, DAY, SECOND, Figures
from app.alarms.statistics_query import read_figures
from tests.alarms.conftest import ANA, HOT, TRIP, Plot


async def read(plot: Plot, begin: int, end: int | None = None, area: str = "") -> Figures | None:
    await plot.engine.journal.flush()
    until = plot.clock.micros() + 1 if end is None else end
    return await plot.database.read(lambda connection: read_figures(connection, begin, until, 1, area))


async def test_an_empty_journal_has_no_figures(plot: Plot) -> None:
    await plot.begin(HOT)
    assert await read(plot, 0) is None


async def test_what_was_raised_on_a_shelf_counts_in_no_rate(plot: Plot) -> None:
    engine = await plot.begin(HOT, TRIP)
    plot.put(t=71.0, after=60)
    plot.put(t=60.0, after=60)
    engine.hiding.shelve("m1.hot", ANA, 3600, "Sensor fault")
    plot.put(t=71.0, after=60)
    plot.put(t=60.0, after=60)
    found = await read(plot, 0)
    assert found is not None
    assert (found.total, found.hidden, found.by_alarm) == (1, 1, [("m1.hot", 1)])


async def test_it_begins_with_the_journal_and_has_ten_minutes_at_least(plot: Plot) -> None:
    await plot.begin(HOT)
    plot.put(t=71.0, after=60)
    now = plot.clock.micros() + 1
    found = await read(plot, now - 30 * DAY)
    assert found is not None and found.end - found.begin == BUCKET
    plot.clock.advance(3600.0)
    found = await read(plot, now - 30 * DAY)
    assert found is not None and 3600 * SECOND <= found.end - found.begin < 3720 * SECOND
    assert await read(plot, now - 60 * DAY, now - 50 * DAY) is None


async def test_what_stood_when_the_time_began_stands_since_it_was_raised(plot: Plot) -> None:
    engine = await plot.begin(HOT, TRIP)
    plot.put(t=71.0, status=4, after=1)
    raised = plot.clock.micros() - SECOND
    await engine.acknowledge([one.occurrence for one in engine.list.active()], ANA)
    plot.clock.advance(10.0)
    plot.put(status=1, after=60)
    plot.clock.advance(2 * 86_400.0)
    found = await read(plot, plot.clock.micros() - DAY)
    assert found is not None
    (run,) = found.standing
    assert (run.alarm, run.goes_on, found.total) == ("m1.hot", True, 0)
    assert abs(run.begin - raised) <= 2 * SECOND
    assert found.most_standing == 1


async def test_an_area_has_its_own_figures(plot: Plot) -> None:
    await plot.begin(HOT)
    plot.put(t=71.0, after=60)
    found, other = await read(plot, 0, area="drives"), await read(plot, 0, area="sys")
    assert found is not None and other is not None
    assert (found.total, other.total) == (1, 0)
