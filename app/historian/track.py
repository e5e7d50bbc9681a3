"""Which samples of one point are stored: the dead-band as a corridor around the line that a trend draws. Pure."""

import math
from dataclasses import dataclass
from typing import TypeGuard

from app.historian.store import HEARTBEAT, RAMP, Row
from app.tags.batch import Value
from app.tags.quality import BAD, NO_DATA, QualityReason

SET_BACK = 1_000_000
"""A sample so much later than now is of before the clock was set back [µs]; less is a correction of the clock."""
SLACK = 1 + 1e-9
"""A difference of just the dead-band is not above it: 0.4 − 0.3 is more than 0.1 in binary."""


@dataclass(slots=True)
class Track:
    """What the recorder remembers of one point.

    The suppressed samples since the stored one lie in a corridor: every line from the stored sample with a slope of `least` to `most`
    passes them within the dead-band.
    """

    number: int
    dead_band: float
    linear: bool
    """Drawn as a line between samples, so that corners count; else a value holds until the next one."""
    value: Value = None
    quality: int = -1
    time: int = 0
    held: Value = None
    held_time: int = 0
    """The last sample suppressed; 0 = none."""
    strayed: bool = False
    """Whether one of them was outside the dead-band of the stored one: only a line tells it, and that is drawn for so long only."""
    least: float = -math.inf
    most: float = math.inf
    ahead: tuple[int, ...] = ()
    """Up to these times, the next one first, was told what was so before the clock was set back [µs]."""

    def take(self, time: int, value: Value, quality: int, seen: int, rows: list[Row]) -> None:
        """Add to `rows` what has to be stored now that the point is `value`.

        `seen` is when its source last made sure of the value before: until then it had not changed [µs UTC].
        """
        self._pass(time, rows)
        if self.linear and self.quality >= 0 and (self.held_time or self.time) < seen < time:
            self._put(seen, self.held if self.held_time else self.value, self.quality, rows)
        self._put(time, value, quality, rows)

    def beat(self, now: int, rows: list[Row]) -> None:
        """Add the value as it stands when the last sample is 10 minutes old, and the end of a ramp when no more came after it.

        When the last one is later than `now` the clock was set back: what does not change is told from here on, too.
        """
        if self.quality >= 0 and max(self.time, self.held_time) - now > SET_BACK:
            value = self.held if self.held_time else self.value
            self.end(rows)
            rows.append(self._row(now, value, self.quality))
            self._anchor(now, value, self.quality)
        self._pass(now, rows)
        if self.held_time and now - self.time >= RAMP and self.strayed:
            self.end(rows)
        if self.quality >= 0 and now - self.time >= HEARTBEAT:
            self._put(now, self.held if self.held_time else self.value, self.quality, rows)

    def end(self, rows: list[Row]) -> None:
        """Add the last sample suppressed, when there is one."""
        if self.held_time:
            rows.append(self._row(self.held_time, self.held, self.quality))
            self._anchor(self.held_time, self.held, self.quality)

    def lose(self, time: int, rows: list[Row]) -> None:
        """Add that from `time` on nothing is known of the point, also behind what was told before a clock was set back."""
        self.end(rows)
        told = {*self.ahead, self.time}
        ends = {one + 1 for one in told if one >= time} | ({time} - told)
        rows += [(self.number, end, None, None, NO_DATA) for end in sorted(ends)]

    def lived_until(self, *ends: int) -> None:
        """Up to `ends` [µs] something is told that was so before the clock was set back: behind each of them it is told what is so then."""
        self.ahead = tuple(sorted({*self.ahead, *(end for end in ends if end >= self.time)}))

    def _pass(self, time: int, rows: list[Row]) -> None:
        """Behind what was told before the clock was set back the point is what it is now, not what it was then."""
        while self.ahead and time > self.ahead[0]:
            self.end(rows)
            behind, self.ahead = self.ahead[0] + 1, self.ahead[1:]
            if self.quality >= 0:
                rows.append(self._row(behind, self.value, self.quality))
                self._anchor(behind, self.value, self.quality)

    def _put(self, time: int, value: Value, quality: int, rows: list[Row]) -> None:
        if quality == self.quality and 0 < time - self.time < HEARTBEAT and self._suppressed(time, value, rows):
            return
        if self.held_time and self.held_time < time:
            rows.append(self._row(self.held_time, self.held, self.quality))
        rows.append(self._row(time, value, quality))
        self._anchor(time, value, quality)

    def _suppressed(self, time: int, value: Value, rows: list[Row]) -> bool:
        if not self.linear or not self.dead_band or not _is_number(value) or not _is_number(self.value):
            if value != self.value:
                return False
            if self.linear:
                self.held, self.held_time = value, time
            return True
        if not self._fits(time, value):
            # the sample before becomes a corner, from which it may go on
            if not self.held_time or self.held_time >= time:
                return False
            self.end(rows)
            if not self._fits(time, value):
                return False
        slope, reach = (value - self.value) / (time - self.time), self.dead_band * SLACK / (time - self.time)
        self.least, self.most = max(self.least, slope - reach), min(self.most, slope + reach)
        self.held, self.held_time = value, time
        self.strayed = self.strayed or not self._within(value)
        return True

    def _fits(self, time: int, value: float) -> bool:
        """Whether (time, value) may be told by the line from the stored sample on."""
        if time - self.time > RAMP and (self.strayed or not self._within(value)):
            return False
        change: float = value - self.value  # type: ignore[operator]
        return math.isfinite(change) and (not self.held_time or self.least <= change / (time - self.time) <= self.most)

    def _within(self, value: Value) -> bool:
        return bool(abs(value - self.value) <= self.dead_band * SLACK)  # type: ignore[operator]

    def _anchor(self, time: int, value: Value, quality: int) -> None:
        if time < self.time:
            self.lived_until(self.time)
        self.time, self.value, self.quality = time, value, quality
        self.held, self.held_time, self.strayed = None, 0, False
        self.least, self.most = -math.inf, math.inf

    def _row(self, time: int, value: Value, quality: int) -> Row:
        if quality & 3 == BAD:
            return (self.number, time, None, None, quality)
        if isinstance(value, str):
            return (self.number, time, None, value, quality)
        if value is None:
            return (self.number, time, None, None, quality & 0xF00 | NO_DATA)
        if not math.isfinite(value):
            return (self.number, time, None, None, quality & 0xF00 | QualityReason.OUT_OF_RANGE << 2 | BAD)
        return (self.number, time, float(value), None, quality)


def _is_number(value: Value) -> TypeGuard[float]:
    return isinstance(value, int | float)
