"""Answers that a repeater says twice: told by time, as a former one heard again sooner than the wire allows."""

from collections import deque

FORMER = 4
"""So many answers back one may be said again, ..."""
AGAIN = 0.2
"""... and not later than so long after its time on the wire [s]."""


class Repeats:
    """The last answers of one line, and what it has shown of itself since it was opened."""

    def __init__(self, character: float) -> None:
        """`character`: time of one on the wire [s]."""
        self._character = character
        self._former: deque[tuple[int, bytes, float]] = deque(maxlen=FORMER)
        """Units and PDUs of the last answers that were one, and when they were heard [s]."""
        self._paced = True
        """False: an answer that was surely one came sooner than this speed allows."""
        self.doubles = False
        """Whether an answer was heard twice."""

    def taken(self, unit: int, pdu: bytes, now: float, *, twice: bool) -> None:
        """An answer was one; `twice`: it was heard before it was believed."""
        self.doubles = self.doubles or twice
        self._former.append((unit, pdu, now))

    def was_said(self, unit: int, pdu: bytes, now: float) -> bool:
        """Whether this may be a former answer, said again."""
        since = now - AGAIN - (len(pdu) + 3) * self._character
        return any((of, said) == (unit, pdu) and heard >= since for of, said, heard in self._former)

    def doubtful(self, unit: int, pdu: bytes, now: float, *, soon: bool, expected: bool) -> bool:
        """Whether an answer that would fit may be a former one; `soon`: sooner than this speed allows; `owed`: an earlier
        request may still be answered."""
        if not self.was_said(unit, pdu, now):
            if soon and not expected:
                self._paced = False
            return False
        return self.doubles or (soon and self._paced)
