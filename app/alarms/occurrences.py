"""Occurrences: each time an alarm raises it gets a new number, by which people acknowledge it and nothing else."""

from collections import OrderedDict

from app.alarms.lifecycle import AlarmState
from app.alarms.watch import Answer, Watch

REMEMBERED = 10_000
"""Acknowledged occurrences whose acknowledger is known."""


class Occurrences:
    """Gives the numbers, finds the alarm of one, and remembers who acknowledged what is over."""

    def __init__(self) -> None:
        self._next = 1
        self._present: dict[int, Watch] = {}
        self._acknowledged: OrderedDict[int, Answer] = OrderedDict()

    def restore(self, newest: int) -> None:
        """Go on behind the number `newest` of the journal; 0 = there was none."""
        self._next = newest + 1

    def clear(self) -> None:
        """Forget which alarms have which number, because they are read anew; who acknowledged what stays."""
        self._present = {}

    def keep(self, watch: Watch) -> None:
        """Know the present occurrence of `watch`, if it has one."""
        if watch.occurrence:
            self._present[watch.occurrence] = watch

    def begin(self, watch: Watch) -> None:
        """Give `watch` a new number, because it raises."""
        self._present.pop(watch.occurrence, None)
        watch.occurrence = self._next
        self._next += 1
        self.keep(watch)

    def find(self, occurrence: int) -> Watch | None:
        """The alarm whose last occurrence this is."""
        return self._present.get(occurrence)

    def present(self, occurrence: int) -> Watch | None:
        """The alarm whose present occurrence this is; None = it is over."""
        watch = self._present.get(occurrence)
        return watch if watch is not None and watch.life.state is not AlarmState.NORMAL else None

    def acknowledged(self, watch: Watch) -> None:
        """Remember by whom and when the occurrence of `watch` was acknowledged."""
        answer = Answer(watch.occurrence, "already", watch.id, watch.acked_by, watch.acked_at)
        self._acknowledged[watch.occurrence] = answer
        while len(self._acknowledged) > REMEMBERED:
            self._acknowledged.popitem(last=False)

    def answer(self, occurrence: int) -> Answer:
        """What is told to somebody who is too late: who was first, or that it is gone."""
        return self._acknowledged.get(occurrence) or Answer(occurrence, "gone")
