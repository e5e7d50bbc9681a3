"""A host is silent when its heartbeat stands still for longer than the time-out."""

import pytest

from app.sim.plc.host import HostWatch


@pytest.mark.parametrize("timeout", [0.0, 0.05, 0.1, 1.0])
@pytest.mark.parametrize("scans", [0, 1, 4, 5, 6, 10, 11, 101, 1000])
def test_it_is_silent_after_the_time_out_if_it_is_watched(timeout: float, scans: int) -> None:
    watch = HostWatch()
    for _ in range(scans):
        watch.step(0.01)
    watch.judge(timeout)
    assert watch.silent is (timeout > 0 and scans > round(timeout / 0.01))
    watch.take(watch.heartbeat)
    watch.judge(timeout)
    assert watch.silent is (timeout > 0 and scans > round(timeout / 0.01)), "the same heartbeat is none"
    watch.take(watch.heartbeat + 1)
    watch.judge(timeout)
    assert not watch.silent
