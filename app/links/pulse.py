"""Whether the program of a PLC goes round, told by what nobody but its program changes. Pure: it is told the time.

Its Modbus server answers also while the program stands (a PLC in stop, a task that hangs): the registers then keep their last values and
look as good as ever. Heartbeat and step number rise with every scan, so a header that stays as it was accuses; the generation of any image
that moves clears. What counts is time that was looked at: two looks far apart show no more than `limit / 2` of standing.
"""

from collections.abc import Sequence

from app.registers import plc_map

STANDS = 1.0
"""A program that did not go round for so long stands [s], or for `SCANS` of its scans if that is longer."""
SCANS = 3
ONSET = 2.0
"""The same while the time of its scan is not known [s]."""
FEWEST = 2
"""Scans from which their time is told."""
ENOUGH = 4
FIRST, LAST = plc_map.AT_HEARTBEAT, plc_map.AT_STEP + 3
"""The words of the header that tell."""


class Pulse:
    """The signs of life of one PLC."""

    def __init__(self) -> None:
        self.halted = False
        """Whether the program stands still."""
        self.scan = 0.0
        """Longest that one scan can take by what was seen [s]; 0 = not known."""
        self.moved = False
        """Whether it was ever seen to go round."""
        self._told: dict[int, tuple[int, ...]] = {}
        self._quiet = 0.0
        """Time that it was seen to stand [s]."""
        self._at = 0.0
        """Up to when it was looked at [s]."""
        self._asked = 0.0
        self._anchor: tuple[int, float] | None = None

    def begin(self, now: float) -> None:
        """The unit is there, again: what was seen before tells nothing, how long its scans take still holds."""
        self._told.clear()
        self.halted, self.moved = False, False
        self._quiet, self._at, self._asked, self._anchor = 0.0, now, now, None

    @property
    def limit(self) -> float:
        """From when on it stands [s]."""
        return max(STANDS, SCANS * self.scan) if self.scan else ONSET

    @property
    def due(self) -> float:
        """When somebody should look at the header, unless an image moves before [s]."""
        return self._at + (self.limit / 4 if self._quiet else self.limit / 2)

    def image(self, address: int, words: Sequence[int], now: float) -> None:
        """An image that begins at `address` was read: another generation is a sign of life, the same one is none to the contrary."""
        mark = words[0], words[-1]
        before = self._told.get(address)
        self._told[address] = mark
        if before is not None and before != mark:
            self._moves(now)

    def header(self, words: Sequence[int], started: float, now: float, *, paused: bool = False) -> None:
        """Words `FIRST` to `LAST` of the header, asked for at `started` and answered at `now` [s]; `paused`: its simulation
        is, and that it does not go round is no fault of its program."""
        if paused:
            self._rest(now)
            return
        if started < self._asked:  # overtaken on another connection
            return
        self._asked = started
        mark = words[0], *words[plc_map.AT_STEP - FIRST : plc_map.AT_STEP - FIRST + 4]
        before = self._told.get(-1)
        self._told[-1] = mark
        if before is None:
            self._anchor = words[0], started
        elif before != mark:
            self._measure(words[0], started, now)
            self._moves(now)
        else:
            self._quiet += min(max(0.0, started - self._at), self.limit / 2)
            self._at = max(self._at, started)
            self.halted = self.halted or self._quiet >= self.limit - 1e-6

    def _rest(self, now: float) -> None:
        self.halted, self._quiet, self._at, self._anchor = False, 0.0, max(self._at, now), None
        self._told.pop(-1, None)

    def _moves(self, now: float) -> None:
        if self.halted:
            self._anchor = None
        self.halted, self.moved = False, True
        self._quiet, self._at = 0.0, max(self._at, now)

    def _measure(self, heartbeat: int, started: float, now: float) -> None:
        if self._anchor is None:
            self._anchor = heartbeat, started
            return
        scans = heartbeat - self._anchor[0] & 0xFFFF
        if scans >= 0x8000:  # it was started anew
            self._anchor = heartbeat, started
        elif scans >= (ENOUGH if self.scan else FEWEST):
            longest = (now - self._anchor[1]) / (scans - 1)
            self.scan = max(longest, self.scan / 2)
            self._anchor = heartbeat, started
