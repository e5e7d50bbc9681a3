"""First-out: which alarm of a stop came first."""

from dataclasses import replace

from tests.alarms.conftest import ANA, HOT, OPEN, TRIP, Plot


async def test_members_of_a_first_out_group_are_numbered_as_they_came(plot: Plot) -> None:
    engine = await plot.begin(
        replace(HOT, key="a", alarm_class="drive"),
        replace(HOT, key="b", limit=80.0, alarm_class="drive"),
        replace(HOT, key="c", limit=90.0, alarm_class="drive"),
    )
    plot.put(t=75.0)
    plot.put(t=85.0, after=0.040)
    plot.put(t=95.0, after=1.160)
    by = {one.key: one for one in engine.list.active()}
    assert [(by[key].ordinal, by[key].uncertain) for key in "abc"] == [(1, False), (2, False), (3, False)]
    times = [by[key].first_true - by["a"].first_true for key in "abc"]
    assert times == [0, 40_000, 1_200_000]
    await engine.acknowledge([one.occurrence for one in engine.list.active()], ANA)
    assert {one.key: one.ordinal for one in engine.list.active()} == {"a": 1, "b": 2, "c": 3}, "acknowledging keeps it"
    plot.put(t=60.0)
    plot.put(t=85.0)
    assert min(one.ordinal for one in engine.list.active()) == 1, "the next trip begins anew"


async def test_two_of_one_scan_have_no_known_order(plot: Plot) -> None:
    engine = await plot.begin(TRIP, OPEN)
    plot.put(status=4)
    assert [(one.ordinal, one.uncertain) for one in sorted(engine.list.active(), key=lambda one: one.ordinal)] == [
        (1, True),
        (2, True),
    ]
