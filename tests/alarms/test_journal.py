"""The journal is one chain without gaps."""

from collections.abc import Callable

import pytest

from app.alarms import journal
from app.alarms.tables import journal_table
from tests.alarms.conftest import ANA, HOT, TRIP, Plot


async def test_every_transition_is_one_record_in_a_chain_without_gaps(plot: Plot) -> None:
    engine = await plot.begin(HOT, TRIP)
    for value, status in ((71.0, 1), (60.0, 4), (75.0, 1)):
        plot.put(t=value, status=status, after=1)
        await engine.acknowledge([one.occurrence for one in engine.list.active()], ANA)
    records = await plot.records()
    assert [one.seq for one in records] == list(range(1, len(records) + 1))
    for id in {one.alarm for one in records}:
        own = [one for one in records if one.alarm == id]
        assert [one.before for one in own][1:] == [one.after for one in own][:-1], (
            "each begins where the last one ended"
        )
    assert (await engine.journal.verify()).ok
    assert (await engine.journal.verify()).count == len(records)


@pytest.mark.parametrize(
    ("spoil", "why"),
    [
        (
            lambda c: c.execute(journal_table.update().where(journal_table.c.seq == 2).values(person="nobody")),
            "changed",
        ),
        (lambda c: c.execute(journal_table.delete().where(journal_table.c.seq == 2)), "removed"),
        (lambda c: c.execute(journal_table.update().where(journal_table.c.seq == 2).values(value=1.5)), "changed"),
    ],
)
async def test_a_record_that_was_tampered_with_is_found(
    plot: Plot, spoil: Callable[[object], object], why: str
) -> None:
    engine = await plot.begin(HOT)
    plot.put(t=71.0)
    await engine.acknowledge([engine.list.active()[0].occurrence], ANA)
    plot.put(t=60.0)
    await engine.journal.flush()
    await plot.database.write(spoil)
    verdict = await engine.journal.verify()
    assert (verdict.bad, verdict.why) == (2, why)


async def test_the_last_occurrences_have_their_times(plot: Plot) -> None:
    engine = await plot.begin(HOT)
    for _ in range(3):
        plot.put(t=71.0, after=60)
        await engine.acknowledge([engine.list.active()[0].occurrence], ANA)
        plot.put(t=60.0, after=7)
    await engine.journal.flush()
    past = await plot.database.read(lambda c: journal.occurrences(c, "m1.hot", 2))
    assert [(one.returned - one.raised, one.acked_by, one.value) for one in past] == [(7_000_000, "ana", 71.0)] * 2
