"""The points `sys.alarms.…`: how many alarms are active and wait, by priority and by machine, and which priority sounds."""

from app.alarms.alarm_list import AlarmList
from app.alarms.annunciations import Annunciations
from app.alarms.definitions import COUNTS, PREFIX, PRIORITIES
from app.alarms.index import AlarmIndex
from app.alarms.lifecycle import AUDIBLE, AlarmState
from app.clock import Clock
from app.plant.system import SYSTEM
from app.tags import quality
from app.tags.batch import Batch, Value
from app.tags.database import TagDatabase

BLOCK = 2
"""Number of the block of our points within those of the system."""
PUBLISH_PERIOD = 0.25
"""Least time between two changes of the counts [s]."""
NO_PLANT = quality.UNCERTAIN | quality.QualityReason.CONFIGURATION << 2
"""Quality of the counts of a plant that cannot start: they know of the system's alarms alone."""
COUNTED = frozenset(COUNTS) - {"revision", "new", "sound"}
"""Points that say how many alarms of the whole plant there are."""


class AlarmCounts:
    """Counts what the list shows and publishes it as tags."""

    def __init__(
        self, shown: AlarmList, annunciations: Annunciations, index: AlarmIndex, tags: TagDatabase, clock: Clock
    ) -> None:
        self._list = shown
        self._annunciations = annunciations
        self._index = index
        self._tags = tags
        self._clock = clock
        self._sent_at = -PUBLISH_PERIOD
        self._sent_revision = -1

    @property
    def wait(self) -> float | None:
        """In how long the next publishing is due [s], 0 or below for at once; None while the points are up to date."""
        if self._list.revision == self._sent_revision:
            return None
        return self._sent_at + PUBLISH_PERIOD - self._clock.monotonic()

    def values(self) -> dict[str, Value]:
        """Values of the points `sys.alarms.…`, by what follows that."""
        unack = dict.fromkeys(PRIORITIES, 0)
        active = dict.fromkeys(PRIORITIES, 0)
        by = {item: dict.fromkeys(PRIORITIES, 0) for item in (*self._index.equipment, SYSTEM)}
        sound = 0
        hidden = [one.state for one in self._list.hidden()]
        for one in self._list.active():
            active[one.priority] += 1
            unack[one.priority] += one.unacked
            # of a machine that a reload took away: the system's, until it ends
            by.get(one.equipment, by[SYSTEM])[one.priority] += 1
            if one.state in AUDIBLE and (not sound or one.priority < sound) and one.audible:
                sound = one.priority
        values: dict[str, Value] = {
            "revision": self._list.revision,
            "new": self._annunciations.count,
            "sound": sound,
            "total": sum(active.values()),
            "unack": sum(unack.values()),
            "flood": int(self._annunciations.flood),
            "hidden": len(hidden),
            "shelved": hidden.count(AlarmState.SHELVED),
            "suppressed": hidden.count(AlarmState.SUPPRESSED),
            "oos": hidden.count(AlarmState.OUT_OF_SERVICE),
        }
        for priority in PRIORITIES:
            values[f"unack_{priority}"], values[f"active_{priority}"] = unack[priority], active[priority]
        for item, numbers in by.items():
            values |= {f"by.{item}.p{priority}": number for priority, number in numbers.items()}
        return values

    def publish(self) -> None:
        """Bring the points up to date."""
        self._sent_at, self._sent_revision = self._clock.monotonic(), self._list.revision
        known, tags, now = self._tags.handles, self._tags, self._clock.micros()
        handles, values, qualities = [], [], []
        for key, value in self.values().items():
            handle = known.get(f"{SYSTEM}.{PREFIX}.{key}")
            worth = quality.GOOD if self._index.known or key not in COUNTED else NO_PLANT
            if handle is not None and (tags.value(handle), tags.quality(handle)) != (value, worth):
                handles.append(handle)
                values.append(value)
                qualities.append(worth)
        tags.publish(Batch(SYSTEM, BLOCK, now, now, handles, values, qualities=qualities))
