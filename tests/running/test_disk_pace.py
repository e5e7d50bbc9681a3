"""A write that takes long is a slow disk, until none was slow for a while."""

import pytest

from app.clock import ManualClock
from app.running.disk_pace import CALM, DiskPace
from app.threads import Turns
from tests.virtual import inline

LOOK = 0.25


class Disk:
    """Numbers of the writes of two threads."""

    def __init__(self) -> None:
        self.clock = ManualClock()
        self.threads = [Turns(inline(1, "disk")), Turns(inline(1, "disk"))]
        self.pace = DiskPace(self.clock, *self.threads)

    def looks(self, seconds: float) -> bool:
        """Look for so long; whether it is slow at the end."""
        slow = False
        for _ in range(round(seconds / LOOK)):
            self.clock.advance(LOOK)
            slow = self.pace.is_slow()
        return slow


@pytest.mark.parametrize("thread", [0, 1])
def test_one_write_of_more_than_two_seconds_is_a_slow_disk_until_none_was_for_half_a_minute(thread: int) -> None:
    disk = Disk()
    assert not disk.looks(60)
    disk.threads[thread].at_work = 1
    assert not disk.looks(2)
    assert disk.looks(2 * LOOK)
    disk.threads[thread].at_work = 0
    assert disk.looks(CALM - 1)
    assert not disk.looks(1)


def test_many_quick_writes_one_after_the_other_are_no_slow_disk() -> None:
    disk = Disk()
    for number in range(1, 100):
        for thread in disk.threads:
            thread.at_work = number
        assert not disk.looks(1)


def test_a_process_that_stood_still_did_not_wait_for_its_disk() -> None:
    disk = Disk()
    disk.threads[0].at_work = 1
    assert not disk.looks(LOOK)
    disk.clock.advance(3600)
    assert not disk.pace.is_slow()
