"""Nothing is lost on the way to the journal, and nobody waits for it."""

import pytest

from app.errors import StorageError
from app.tags.batch import Batch
from tests.alarms.conftest import ANA, HOT, TRIP, Plot


@pytest.mark.sweep(8)
async def test_a_thousand_alarms_at_once_are_all_in_the_journal(plot: Plot) -> None:
    machines = [f"m{index}" for index in range(1000)]
    engine = await plot.begin(TRIP, machines=machines)
    now = plot.clock.micros()
    handles = [plot.tags.handle(f"{machine}.status") for machine in machines]
    plot.tags.publish(Batch("hall", 0, now, now, handles, [4] * 1000))
    records = await plot.records()
    assert len(engine.list.active()) == 1000
    assert [one.seq for one in records] == list(range(1, 1001))
    assert plot.count("unack_2") == 1000


async def test_a_database_that_does_not_take_the_journal_stops_nothing(plot: Plot) -> None:
    engine = await plot.begin(HOT)
    plot.put(t=71.0)
    write = plot.database.write

    async def full(work: object) -> object:
        raise StorageError("disk full")

    plot.database.write = full  # type: ignore[method-assign, assignment]
    (answer,) = await engine.acknowledge([engine.list.active()[0].occurrence], ANA)
    assert (answer.outcome, answer.stored) == ("done", False)
    (late,) = await engine.acknowledge([99], ANA)
    assert (late.outcome, late.stored) == ("gone", True), "nothing of it waits"
    assert not engine.journal.healthy
    assert "sys.journal_waiting" in [one.id for one in engine.list.active()]
    plot.database.write = write  # type: ignore[method-assign]
    records = await plot.records()
    assert [one.event for one in records] == ["RAISED", "ACK", "RAISED"]
    assert engine.journal.healthy
    assert (await engine.journal.verify()).ok
