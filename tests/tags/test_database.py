"""The tag database: last values, quality, age, one batch at a time."""

import weakref

import pytest

from app.clock import ManualClock
from app.tags.batch import Batch, Value
from app.tags.database import Tag, TagDatabase, TagTable
from app.tags.quality import BAD, COMM_FAILURE, GOOD, NO_DATA, STALE, Origin, is_good, level, name, worst


def database(*names: str, stale_after: float = 2.0) -> tuple[TagDatabase, ManualClock]:
    clock = ManualClock()
    tags = TagDatabase(clock)
    tags.configure([Tag(n, n, "hall", stale_after) for n in names])
    return tags, clock


def batch(clock: ManualClock, values: dict[int, Value], quality: int = GOOD, block: int = 0) -> Batch:
    return Batch("hall", block, clock.micros(), clock.micros(), list(values), list(values.values()), quality)


def test_a_tag_without_data_is_bad_and_has_no_age() -> None:
    tags, _ = database("m1.speed")
    sample = tags.sample("m1.speed")
    assert (sample.value, sample.quality) == (None, NO_DATA)
    assert tags.age(0) == float("inf")


def test_a_value_that_does_not_change_stays_fresh() -> None:
    tags, clock = database("m1.speed")
    tags.publish(batch(clock, {0: 1180.0}))
    for _ in range(10):
        clock.advance(1)
        tags.publish(batch(clock, {}))
        tags.sweep()
    assert tags.age(0) == 0
    assert is_good(tags.quality(0))
    assert tags.read(0).time < tags.read(0).seen


def test_an_overdue_value_turns_stale_once_keeps_its_number_and_comes_back() -> None:
    tags, clock = database("m1.speed", "m1.current")
    heard: list[Batch] = []
    tags.publish(batch(clock, {0: 1180.0, 1: 2.1}, GOOD | Origin.SIMULATED))
    tags.subscribe(heard.append)
    clock.advance(2.5)
    tags.sweep()
    tags.sweep()
    assert len(heard) == 1
    assert tags.read(0).value == 1180.0
    assert tags.read(0).quality == STALE | Origin.SIMULATED
    tags.publish(batch(clock, {1: 2.2}, GOOD | Origin.SIMULATED))
    assert [is_good(tags.quality(h)) for h in (0, 1)] == [True, True]
    assert {h for b in heard[1:] for h in b.handles} == {0, 1}


def test_an_overdue_value_stays_not_good_when_its_block_comes_back_bad() -> None:
    tags, clock = database("m1.speed")
    tags.publish(batch(clock, {0: 1180.0}))
    clock.advance(3)
    tags.sweep()
    tags.publish(batch(clock, {0: None}, COMM_FAILURE))
    assert level(tags.quality(0)) == BAD


def test_each_block_has_its_own_age() -> None:
    tags, clock = database("m1.speed", "m1.temperature")
    tags.publish(batch(clock, {0: 1.0}, block=0))
    tags.publish(batch(clock, {1: 1.0}, block=1))
    clock.advance(1)
    tags.publish(batch(clock, {}, block=0))
    assert (tags.age(0), tags.age(1)) == (0, 1)


def test_a_new_revision_keeps_values_by_identity_over_a_rename() -> None:
    tags, clock = database("m1.speed", "m1.current")
    tags.publish(batch(clock, {0: 1180.0, 1: 2.1}))
    tags.configure([Tag("m9.new", "m9.new", "hall"), Tag("fan.speed", "m1.speed", "hall")])
    assert tags.sample("fan.speed").value == 1180.0
    assert tags.sample("m9.new").quality == NO_DATA
    assert "m1.speed" not in tags
    assert tags.revision == 2


def test_what_was_looked_up_in_a_table_that_is_gone_decides_nothing_and_no_former_table_is_kept() -> None:
    clock = ManualClock()
    tags = TagDatabase(clock)
    first, second, third = (TagTable(Tag(name, name, "hall") for name in names) for names in ("ab", "ba", "cb"))
    tags.take(first)
    tags.publish(batch(clock, {0: 1.0, 1: 2.0}))
    third.look_up(first)  # the second one comes between
    second.look_up(first)
    tags.take(second)
    assert [tags.value(handle) for handle in range(2)] == [2.0, 1.0]
    tags.take(third)
    assert [tags.value(handle) for handle in range(2)] == [None, 2.0] and tags.table is third
    kept = [weakref.ref(first), weakref.ref(second)]
    del first, second
    assert [one() for one in kept] == [None, None]


def test_a_subscriber_that_fails_does_not_keep_the_others_from_it(caplog: pytest.LogCaptureFixture) -> None:
    tags, clock = database("m1.speed")
    heard: list[Batch] = []

    def broken(_: Batch) -> None:
        raise RuntimeError("broken on purpose")

    tags.subscribe(broken)
    tags.subscribe(heard.append)
    tags.publish(batch(clock, {0: 1.0}))
    assert len(heard) == 1
    assert "subscriber failed" in caplog.text


def test_two_tags_of_one_name_are_refused() -> None:
    tags, _ = database()
    with pytest.raises(ValueError, match="unique"):
        tags.configure([Tag("a", "1", "x"), Tag("a", "2", "x")])


@pytest.mark.parametrize(
    ("qualities", "result"),
    [
        ([GOOD, GOOD], "good"),
        ([GOOD, STALE], "uncertain:stale"),
        ([STALE, COMM_FAILURE, GOOD], "bad:comm_failure"),
        ([GOOD | Origin.SIMULATED, STALE], "uncertain:stale"),
    ],
)
def test_a_computed_value_is_as_good_as_its_worst_input(qualities: list[int], result: str) -> None:
    assert name(worst(qualities)) == result
    assert worst(qualities) & 0xF00 == (0x100 if any(q & 0x100 for q in qualities) else 0)


def test_a_value_that_moved_to_another_block_does_not_go_stale_with_its_old_one() -> None:
    tags, clock = database("m1.speed")
    tags.publish(batch(clock, {0: 1180.0}, block=1))
    for _ in range(4):
        clock.advance(1)
        tags.publish(batch(clock, {0: 1181.0}, block=2))
        tags.sweep()
    assert is_good(tags.quality(0))


def test_a_value_with_a_shorter_limit_that_joins_its_block_later_counts() -> None:
    clock = ManualClock()
    tags = TagDatabase(clock)
    tags.configure(
        [Tag("a.slow", "a.slow", "hall", 30.0), Tag("a.never", "a.never", "hall"), Tag("a.fast", "a.fast", "hall", 2.0)]
    )
    tags.publish(batch(clock, {0: 1.0, 1: 1.0}))
    clock.advance(5)
    tags.sweep()
    assert is_good(tags.quality(0)) and is_good(tags.quality(1))
    tags.publish(batch(clock, {2: 1.0}))
    clock.advance(5)
    tags.sweep()
    assert [is_good(tags.quality(handle)) for handle in (0, 1, 2)] == [True, True, False]
    clock.advance(26)
    tags.sweep()
    assert [is_good(tags.quality(handle)) for handle in (0, 1, 2)] == [False, True, False]
    tags.publish(batch(clock, {}))
    assert all(is_good(tags.quality(handle)) for handle in (0, 1, 2))
