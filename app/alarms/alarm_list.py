"""What is shown: the active list, what is hidden, and the revision by which a screen knows that it changed."""

import asyncio
from collections.abc import Sequence

from app.alarms.index import AlarmIndex
from app.alarms.lifecycle import ANNUNCIATED, HIDDEN, AlarmState
from app.alarms.watch import ListedAlarm, Watch, listed
from app.clock import Clock


class AlarmList:
    """Every alarm that is not normal, most important first; drawn once per revision."""

    def __init__(self, index: AlarmIndex, clock: Clock, wake: asyncio.Event) -> None:
        """`wake` is set when there is something new to publish."""
        self.revision = 0
        """Number of the last change of anything that a list shows."""
        self._index = index
        self._clock = clock
        self._wake = wake
        self._drawn: tuple[int, Sequence[ListedAlarm]] = (-1, ())

    def touch(self) -> None:
        """Something that lists show has changed."""
        self.revision += 1
        self._wake.set()

    def changed(self, watch: Watch) -> None:
        """What lists show of `watch` has changed."""
        watch.listed = None
        self.touch()

    def active(self) -> list[ListedAlarm]:
        """The active list: everything that is annunciated, most important first."""
        return [one for one in self._all() if one.state in ANNUNCIATED]

    def hidden(self) -> list[ListedAlarm]:
        """What is shelved, suppressed or out of service."""
        return [one for one in self._all() if one.state in HIDDEN]

    def latest(self) -> ListedAlarm | None:
        """The most important one that waits for an acknowledgement: by priority, then the newest."""
        return next((one for one in self._all() if one.unacked), None)

    def of(self, watch: Watch) -> ListedAlarm:
        """How lists show `watch`."""
        if watch.listed is None:
            root = self._index.root(watch.equipment)
            rule = root.alarm.key if root and watch.life.suppressed else ""
            watch.listed = listed(watch, watch.chattering(self._clock.monotonic()), rule)
        return watch.listed

    def _all(self) -> Sequence[ListedAlarm]:
        if self._drawn[0] != self.revision:
            found = [self.of(watch) for watch in self._index if watch.life.state is not AlarmState.NORMAL]
            self._drawn = (self.revision, sorted(found, key=lambda one: one.order))
        return self._drawn[1]
