"""Whose turn it is on a line that is too short for all: everybody's, the quick ones more often."""

from app.links.contract import Block
from app.links.planner import Reading
from app.links.scan_block import ScanBlock
from app.links.schedule import Schedule
from app.plant.definitions import Scan


def block(number: int, scan: Scan, period: float) -> ScanBlock:
    return ScanBlock("hall", number, 1, Reading(Block(number, 1), scan, ()), period)


def test_nobody_starves_where_fast_scans_ask_for_thirty_times_what_the_line_carries() -> None:
    schedule, telegram = Schedule(), 0.05
    fast = [block(n, Scan.FAST, 0.1) for n in range(50)]
    slow = [block(n, Scan.SLOW, 1.0) for n in range(50, 60)]
    for each in (*fast, *slow):
        schedule.at(each, 0.0)
    last = {each.number: 0.0 for each in (*fast, *slow)}
    longest = dict.fromkeys(last, 0.0)
    turns = dict.fromkeys(last, 0)
    now = 0.0
    while now < 120.0:
        taken = schedule.take(now)
        assert isinstance(taken, ScanBlock), "there is always something to do"
        now += telegram
        longest[taken.number] = max(longest[taken.number], now - last[taken.number])
        last[taken.number] = now
        turns[taken.number] += 1
        schedule.at(taken, max(now, taken.due + taken.period))
    everybody = len(last) * telegram
    assert max(longest.values()) <= 2 * everybody + 1.0
    assert max(turns[each.number] for each in fast) - min(turns[each.number] for each in fast) <= 1
    assert min(turns[each.number] for each in fast) > max(turns[each.number] for each in slow)


def test_a_slow_scan_that_is_late_goes_before_a_fast_one_that_is_just_due() -> None:
    schedule, fast, slow = Schedule(), block(1, Scan.FAST, 0.1), block(2, Scan.SLOW, 60.0)
    schedule.at(slow, 10.0)
    schedule.at(fast, 11.0)
    assert schedule.take(11.0) is fast
    schedule.at(fast, 12.0)
    assert schedule.take(12.0) is slow
    assert schedule.take(12.0) is fast and schedule.take(12.0) is None
