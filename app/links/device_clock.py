"""The clock of a Pogon PLC, read with its header."""

from collections.abc import Sequence
from math import inf

from app.clock import is_moment
from app.links.restarts import Restarts
from app.registers import plc_map
from app.registers.plc_map import TimeQuality

DRIFT = 50_000
"""The offset between the device's time and ours is kept until it is wrong by more than this [µs]."""
SCAN = 100_000
"""Longest scan of a device: two answers may be so much out of order [µs]."""


class DeviceClock:
    """Device time → UTC. A device that keeps UTC itself is believed; of others the offset is measured with every header and kept."""

    def __init__(self) -> None:
        self.boots: int | None = None
        self.restarts = Restarts()
        self._offset: int | None = None
        self._time = 0
        self._began = -inf
        self._stood = False
        """Whether its clock, which counts its scans, stood still when it was last looked at, as far as is known."""
        self._before: tuple[int, int, int] | None = None
        """Of the start before this one: last device time, offset, boot count."""

    def header(
        self, words: Sequence[int], first: int, began: float, ended: float, wall: int, *, halted: bool = False
    ) -> bool:
        """Take header words from `first` on, read between `began` and `ended` [s, monotonic] when it was `wall` [µs UTC] at the end;
        `halted`: its program stood still, or was never seen to go round.

        Returns whether the device was restarted. Which answer is the later one, and how long it took, our wall clock does not say: it may
        have been set meanwhile.
        """
        boots = words[plc_map.AT_BOOTS - first]
        time = plc_map.time_of(words[plc_map.AT_TIME - first : plc_map.AT_TIME_QUALITY - first])
        quality = words[plc_map.AT_TIME_QUALITY - first]
        if began < self._began:  # overtaken on another connection
            return False
        since, self._began = round((began - self._began) * 1e6) if self.boots is not None else 0, began
        took = round((ended - began) * 1e6)
        went_back = time + took + SCAN < self._time
        restarted = self.boots is not None and (boots != self.boots or went_back)
        stands = halted or (time == self._time and since > SCAN)
        if restarted and self._offset is not None and self.boots is not None:
            # the first that the new start tells has the time at which the clock of the one before stood
            self._before, self._offset = (self._time - (self._stood or stands), self._offset, self.boots), None
        self._stood = not restarted and stands
        self.boots, self._time = boots, time
        low, high = wall - took - time, wall - time
        if quality != TimeQuality.FREE:
            self._offset = 0
        elif self._offset is None or not low - DRIFT <= self._offset <= high + DRIFT:
            self._offset = (low + high) // 2
        return restarted

    def forget_former(self) -> None:
        """Nothing will be asked any more that happened in the start before this one: its times may come again."""
        self._before = None

    def utc(self, time: int, *, instead: int = 0) -> int:
        """Device time `time` [µs] as µs UTC; `instead` of one that no calendar has: that is no time."""
        offset = self._before[1] if self._before and self._is_before(time) else self._offset or 0
        return time + offset if is_moment(time + offset) else instead

    def boot(self, time: int) -> int:
        """Start of the device in which `time` was."""
        return self._before[2] if self._before and self._is_before(time) else self.boots or 0

    def _is_before(self, time: int) -> bool:
        """Whether `time` belongs to the start before this one; what happened after its last header is taken for this one."""
        assert self._before is not None
        until = self._before[0]
        return time <= until if self._time >= until else time > self._time
