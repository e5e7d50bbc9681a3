"""Scan times are what the stopwatch says, and nothing without one."""

from app.sim.plc.scan_time import ScanTime


def test_last_longest_and_overruns() -> None:
    times = ScanTime()
    times.begin()
    times.end(0.01)
    assert (times.last, times.longest, times.overruns) == (0, 0, 0)
    ticks = iter([0.0, 0.004, 1.0, 1.012, 2.0, 2.001, 3.0, 9.0])
    times.stopwatch = ticks.__next__
    found = []
    for _ in range(4):
        times.begin()
        times.end(0.01)
        found.append((times.last, times.longest, times.overruns))
    assert found == [(4000, 4000, 0), (12000, 12000, 1), (1000, 12000, 1), (0xFFFF, 0xFFFF, 2)]
    times.start_up()
    assert (times.last, times.longest, times.overruns) == (0, 0, 0)
