"""The fault buffer of a SINAMICS drive (r0945, r0947 …): situations of faults, each closed by an acknowledgement; and its alarm buffer."""

from collections.abc import Sequence
from dataclasses import dataclass

SITUATIONS, PLACES = 8, 8
"""So many situations of so many faults; so many alarms that are there, and seven times as many that are gone."""


@dataclass(slots=True)
class Message:
    """A fault or an alarm in its place; number 0 = the place is free. Times [ms] since power-up, 0 = not yet."""

    number: int = 0
    came: int = 0
    gone: int = 0
    value: int = 0


def _free() -> list[Message]:
    return [Message() for _ in range(PLACES)]


def _filled(messages: list[Message]) -> list[Message]:
    return [*messages, *_free()[len(messages) :]]


class FaultBuffer:
    """Faults by situation, the present one first."""

    def __init__(self) -> None:
        """No fault ever."""
        self.messages = [_free() for _ in range(SITUATIONS)]
        self.new: list[int] = []
        """Entered since the drive last reacted."""
        self.changes = 0
        """Counts them, as r0944 does."""
        self.now = 0
        """[ms]"""

    @property
    def situations(self) -> list[list[int]]:
        """Numbers by situation; 0 = none."""
        return [[message.number for message in places] for places in self.messages]

    @property
    def present(self) -> list[int]:
        """Places of the present situation."""
        return [message.number for message in self.messages[0]]

    @property
    def active(self) -> list[int]:
        """Faults that are active."""
        return [number for number in self.present if number]

    @property
    def flat(self) -> list[Message]:
        """All 64 places, as the parameters number them."""
        return [message for places in self.messages for message in places]

    @property
    def count(self) -> int:
        """Situations that hold a fault."""
        return sum(any(message.number for message in places) for places in self.messages)

    def enter(self, number: int, value: int = 0) -> None:
        """A fault comes: into the next free place, or over the last one; one that stands already is not entered again."""
        present = self.present
        if number in present:
            return
        place = present.index(0) if 0 in present else PLACES - 1
        self.messages[0][place] = Message(number, self.now, 0, value)
        self.new.append(number)
        self.changes = self.changes + 1 & 0xFFFF

    def take_new(self) -> list[int]:
        """What was entered since the last call."""
        new, self.new = self.new, []
        return new

    def acknowledge(self) -> None:
        """Situations move on by one, the last is forgotten; nothing happens where none is open.

        What came since the drive last reacted was not there to be acknowledged: it opens the next situation.
        """
        closed = [message for message in self.messages[0] if message.number and message.number not in self.new]
        if not closed:
            return
        for message in closed:
            message.gone = message.gone or self.now
        opened = [message for message in self.messages[0] if message.number in self.new]
        self.messages = [_filled(opened), _filled(closed), *self.messages[1:-1]]
        self.changes = self.changes + 1 & 0xFFFF

    def clear(self) -> None:
        """Forget the acknowledged situations; what stands stays (p0952 = 0)."""
        self.messages = [self.messages[0], *(_free() for _ in range(SITUATIONS - 1))]
        self.changes = self.changes + 1 & 0xFFFF


class AlarmBuffer:
    """Alarms that are there, oldest first, and behind them those that are gone, latest first (r2122)."""

    def __init__(self) -> None:
        """No alarm ever."""
        self.present: list[Message] = []
        self.gone: list[Message] = []
        self.changes = 0

    def step(self, alarms: Sequence[int], now: int) -> None:
        """At `now` [ms] these are there."""
        for message in [one for one in self.present if one.number not in alarms]:
            message.gone = now
            self.present.remove(message)
            self.gone = [message, *self.gone][: PLACES * (SITUATIONS - 1)]
            self.changes = self.changes + 1 & 0xFFFF
        known = {message.number for message in self.present}
        for number in alarms:
            if number not in known and len(self.present) < PLACES:
                self.present.append(Message(number, now))
                self.changes = self.changes + 1 & 0xFFFF

    @property
    def flat(self) -> list[Message]:
        """All 64 places, as the parameters number them."""
        free = [Message()] * (PLACES - len(self.present))
        return [*self.present, *free, *self.gone]
