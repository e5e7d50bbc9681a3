"""Looks after the files of both databases: one that is lost is told, and recording goes on.

What the history was when it was last seen (its id and until when it was recorded) is kept in `pogon.db`, so that one which was removed or
exchanged while the server was stopped is told at the start.
"""

import asyncio
import logging
from collections.abc import Callable
from datetime import UTC, datetime
from typing import Any
from zoneinfo import ZoneInfo

from app.alarms.engine import AlarmEngine
from app.clock import Clock
from app.db import Database
from app.db_file import Incident, Loss, Mended
from app.errors import StorageError
from app.historian import query
from app.historian.events import Events
from app.historian.recorder import Recorder
from app.plant.retained import RetainedStates

log = logging.getLogger(__name__)

PERIOD = 1.0
"""How often is looked [s]."""
NOTE_PERIOD = 60.0
"""How often is noted until when the history was recorded [s]."""
CHECKPOINT_PERIOD = 600.0
"""How often the journals are carried into their files [s]: each time writes every page that has changed once more. What the audit
tells of, such as who signed in, is carried at the next look. While the disk is slow nothing is carried: commands would wait for it."""
KNOWN = "sys.history"
"""Under which id the history is remembered among the retained states."""
OLDER = 5 * 60_000_000
"""A history that ends so long before what is remembered of it is an older state [µs]."""


class DatabaseWatch:
    """Looks each second whether the files are those that were opened."""

    def __init__(
        self,
        people: Database,
        history: Database,
        recorder: Recorder,
        events: Events,
        alarms: AlarmEngine,
        retained: RetainedStates,
        clock: Clock,
        zone: Callable[[], ZoneInfo],
        audited: Callable[[], int],
        disk_slow: Callable[[], bool],
    ) -> None:
        """`zone` says in which zone times are told, `audited` which line of the audit is the newest, `disk_slow` that nothing is to be
        written that can wait.
        """
        self._people = people
        self._history = history
        self._recorder = recorder
        self._events = events
        self._alarms = alarms
        self._retained = retained
        self._clock = clock
        self._zone = zone
        self._told: dict[str, Incident] = {}
        self._known: Any = None
        self._recognised = False
        self._noted = 0.0
        self._checkpoint_at = 0.0
        self._audited = audited
        self._disk_slow = disk_slow
        self._carried = 0
        """Newest line of the audit when `pogon.db` was carried into its file."""

    async def load(self) -> None:
        """Read what is remembered of the history, and compare it when it can be opened; one that is rubbish is put aside."""
        self._known = (await self._retained.read()).get(KNOWN)
        await self._look_at(self._history)
        await self.recognise()

    async def run(self) -> None:
        """Look, for ever."""
        while True:
            await asyncio.sleep(PERIOD)
            await self.look()

    async def look(self) -> None:
        """Look once."""
        for database in (self._people, self._history):
            await self._look_at(database)
        if not self._disk_slow():
            self._carry()
        await self.recognise()
        if self._recognised and self._clock.monotonic() - self._noted >= NOTE_PERIOD:
            await self._note()

    def _carry(self) -> None:
        """Carry the journals into their files where it is time."""
        due, line = self._clock.monotonic() >= self._checkpoint_at, self._audited()
        if due or line != self._carried:
            self._carried = line
            self._people.checkpoint()
        if due:
            self._checkpoint_at = self._clock.monotonic() + CHECKPOINT_PERIOD
            self._history.checkpoint()

    async def recognise(self) -> None:
        """Compare the history that was opened with what is remembered of it; one that cannot be read is compared later."""
        if self._recognised or not self._history.id:
            return
        try:
            alive = await self._history.read(query.alive)
        except StorageError:
            return
        known, last = self._remembered()
        if known and known.get("id") != self._history.id:
            self._tell_loss(Loss.REPLACED if alive else Loss.REMOVED, last)
        elif known and alive < last - OLDER:
            self._tell_loss(Loss.OLDER, last)
        self._recognised = True
        await self._note()

    async def _look_at(self, database: Database) -> None:
        incident = await database.check()
        before = self._told.get(database.path.name)
        if incident is None:
            if before is not None:
                del self._told[database.path.name]
                self._alarms.system.report("database_lost", active=False, params={"file": database.path.name})
            return
        if incident != before:
            log.error(
                "database lost file=%s what=%s done=%s aside=%s reason=%s",
                incident.database,
                incident.loss,
                incident.mended,
                incident.aside or "-",
                incident.reason or "-",
            )
        if incident.mended is Mended.NOTHING:
            self._told[database.path.name] = incident
            self._alarms.system.report("database_lost", params=_params(incident.loss, incident.database))
        elif incident.mended is Mended.RESTORED:
            self._alarms.system.report("database_restored", params=_params(incident.loss, incident.database))
        elif incident.mended is Mended.SHORTENED:
            self._alarms.system.report("database_shortened", params=_params(incident.loss, incident.database))
        if database is self._history and incident.mended in (Mended.FRESH, Mended.ADOPTED):
            last = 0 if self._recognised else self._remembered()[1]
            self._tell_loss(incident.loss, last or self._clock.micros())
            self._recognised = True
        if database is self._history and incident.mended not in (Mended.RESTORED, Mended.NOTHING):
            await self._events.load()
            await self._note()

    def _remembered(self) -> tuple[dict[str, Any], int]:
        """What is remembered of the history, and until when it was recorded [µs UTC]; 0: nothing is."""
        known = self._known if isinstance(self._known, dict) else {}
        return known, int(known.get("last", 0))

    def _tell_loss(self, loss: Loss, until: int) -> None:
        """What was recorded until then [µs UTC] is not there any more, or a part of it."""
        log.error("history lost what=%s until=%s", loss, self._time(until))
        self._alarms.system.report("history_lost", params={**_params(loss, "history.db"), "time": self._time(until)})

    async def _note(self) -> None:
        """Remember the history as it is now."""
        self._noted = self._clock.monotonic()
        if not self._history.id or self._recorder.full:
            return
        try:
            alive = await self._history.read(query.alive)
            await self._retained.write({KNOWN: {"id": self._history.id, "last": alive}})
        except StorageError as error:
            log.error("state of the history not kept reason=%s", error)

    def _time(self, micros: int) -> str:
        return datetime.fromtimestamp(micros // 1_000_000, UTC).astimezone(self._zone()).strftime("%Y-%m-%d %H:%M:%S")


def _params(loss: Loss, file: str) -> dict[str, object]:
    return {"file": file, "loss": f"@alarm.loss.{loss}"}
