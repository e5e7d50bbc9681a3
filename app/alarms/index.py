"""Every alarm at work, found by its id, by the points it reads, by its machine and by the machine's events."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from app.alarms.conditions import Delay, Reported, condition, delay, inputs, needs_time
from app.alarms.definitions import SYSTEM_ALARMS
from app.alarms.event_params import untold
from app.alarms.watch import Watch
from app.plant import expression
from app.plant.definitions import Alarm, Equipment, Kind
from app.plant.system import SYSTEM
from app.tags.batch import Value
from app.tags.database import TagDatabase
from app.tags.quality import NO_DATA

COMM = "comm"
"""Class of the alarm that says that a device does not answer."""


@dataclass(frozen=True, slots=True)
class View:
    """How alarms see the tags of a machine, by the keys of its points."""

    names: Mapping[str, str]
    """Names of the tags."""
    look: Callable[[str], tuple[Value, int]]
    """Value and quality."""
    age: Callable[[str], float | None]
    """[s]; infinite when it was never seen, None when there is no such tag."""


class AlarmIndex:
    """The alarms of the plant and of the system, in the order of evaluation."""

    def __init__(self, tags: TagDatabase, handles: Mapping[str, int] | None = None) -> None:
        """`handles`: of tags that `tags` is going to have; else those that it has."""
        self.equipment: Mapping[str, Equipment] = {}
        """The machines of the plant by id."""
        self.known = False
        """Whether there is a plant: else nobody knows of its alarms."""
        self._tags = tags
        self._given = handles
        self._by_id: dict[str, Watch] = {}
        self._readers: dict[int, list[Watch]] = {}
        self._timed: list[Watch] = []
        self._roots: dict[str, Watch] = {}
        self._members: dict[str, list[Watch]] = {}
        self._by_event: dict[str, dict[int, list[Watch]]] = {}
        self._views: dict[str, View] = {}
        """How the alarms of a machine look at its tags, by its id."""

    def fill(self, equipment: Mapping[str, Equipment]) -> None:
        """Take in the alarms of the machines `equipment`."""
        self.equipment, self.known = equipment, True
        for item in equipment.values():
            for alarm in item.alarms:
                self.add(self.of_plant(item, alarm))

    def take(self, other: "AlarmIndex") -> dict[str, Watch]:
        """Be as `other`, which is not used any more; the alarms that were there, by id."""
        old = self._by_id
        self.equipment, self.known = other.equipment, other.known
        self._by_id, self._readers, self._timed = other._by_id, other._readers, other._timed
        self._roots, self._members, self._by_event = other._roots, other._members, other._by_event
        self._views = other._views
        return old

    def add(self, watch: Watch) -> None:
        """Take `watch` in, behind all others."""
        watch.index = len(self._by_id)
        self._by_id[watch.id] = watch
        self._members.setdefault(watch.equipment, []).append(watch)
        for handle in watch.handles:
            self._readers.setdefault(handle, []).append(watch)
        if needs_time(watch.alarm):
            self._timed.append(watch)
        for code in (watch.alarm.event, watch.alarm.event_clear):
            if code:
                self._by_event.setdefault(watch.equipment, {}).setdefault(code, []).append(watch)
        if watch.equipment and watch.alarm.alarm_class == COMM and not isinstance(watch.condition, Reported):
            self._roots[watch.equipment] = watch

    def listen(self, watch: Watch, until: str) -> None:
        """Let the sentence `until` over the points of its machine end what was told of `watch`."""
        assert isinstance(watch.condition, Reported)
        watch.condition.until = expression.parse(until)
        names = self._view(self.equipment.get(watch.equipment)).names
        for handle in self._handles(names, watch.condition.until.names):
            readers = self._readers.setdefault(handle, [])
            if watch not in readers:
                readers.append(watch)

    def look_anew(self, watch: Watch) -> None:
        """Let `watch` of another revision look at the tags of this one; at nothing when its machine is gone."""
        view = self._view(self.equipment.get(watch.equipment))
        watch.look, watch.age = view.look, view.age

    # ---- who is asked for -----------------------------------------------------------------------------

    def __iter__(self) -> Iterator[Watch]:
        return iter(self._by_id.values())

    def get(self, id: str) -> Watch | None:
        """The alarm `id`; None = there is none."""
        return self._by_id.get(id)

    def readers(self, handles: Iterable[int]) -> list[Watch]:
        """The alarms that one of the points `handles` decides, in order."""
        found: dict[int, Watch] = {}
        for handle in handles:
            for watch in self._readers.get(handle, ()):
                found[watch.index] = watch
        return [found[index] for index in sorted(found)]

    @property
    def timed(self) -> Sequence[Watch]:
        """Those that may change although no value does."""
        return self._timed

    def members(self, equipment: str) -> Sequence[Watch]:
        """All alarms of a machine; "" are those of the server."""
        return self._members.get(equipment, ())

    def root(self, equipment: str) -> Watch | None:
        """The alarm that says that a machine does not answer; None = it has none."""
        return self._roots.get(equipment)

    def of_event(self, equipment: str, code: int) -> Sequence[Watch]:
        """The alarms that the event `code` of a machine raises or ends."""
        return self._by_event.get(equipment, {}).get(code, ())

    # ---- what is made ---------------------------------------------------------------------------------

    def of_plant(self, item: Equipment, alarm: Alarm) -> Watch:
        """The alarm of a row of a machine, not taken in yet.

        Raises:
            ConfigurationError: its sentence is none of the grammar (the plant reader has refused it before).
        """
        view = self._view(item)
        point = item.points.get(alarm.value)
        numeric = point is not None and point.kind not in (Kind.ENUM, Kind.TEXT, Kind.BOOL) and not point.texts
        return Watch(
            id=f"{item.id}.{alarm.key}",
            index=0,
            equipment=item.id,
            area=item.area,
            type=item.type.name,
            alarm=alarm,
            condition=condition(alarm),
            delay=delay(alarm),
            look=view.look,
            age=view.age,
            handles=frozenset(self._handles(view.names, inputs(alarm))),
            unit=point.unit if point and numeric else "",
            decimals=point.decimals if point else 1 if alarm.event else 0,
            params=untold(item.type.snapshot) if alarm.event else {},
            layout=item.type.snapshot,
        )

    def of_system(self, id: str, key: str, equipment: str) -> Watch:
        """The alarm `key` of `SYSTEM_ALARMS` about a machine ("" = the server), not taken in yet.

        Raises:
            KeyError: no such alarm.
        """
        definition = SYSTEM_ALARMS[key]
        row = definition.row(key)
        item = self.equipment.get(equipment)
        view = self._view(item)
        return Watch(
            id=id,
            index=0,
            equipment=equipment,
            area=item.area if item else SYSTEM,
            type=item.type.name if item else "",
            alarm=row,
            condition=Reported(),
            delay=Delay(row.on_delay, row.off_delay),
            look=view.look,
            age=view.age,
            handles=frozenset(),
            once=definition.once,
        )

    @property
    def _known(self) -> Mapping[str, int]:
        return self._tags.handles if self._given is None else self._given

    def _handles(self, names: Mapping[str, str], keys: Iterable[str]) -> list[int]:
        known = self._known
        return [known[names[key]] for key in keys if names.get(key) in known]

    def _view(self, item: Equipment | None) -> View:
        id = item.id if item else ""
        found = self._views.get(id)
        if found is None:
            found = self._views[id] = self._view_of(item)
        return found

    def _view_of(self, item: Equipment | None) -> View:
        known, tags = self._known, self._tags
        names = {key: point.name for key, point in item.points.items()} if item else {}
        handles = {key: known[name] for key, name in names.items() if name in known}

        def look(key: str) -> tuple[Value, int]:
            handle = handles.get(key)
            return (None, NO_DATA) if handle is None else (tags.value(handle), tags.quality(handle))

        def age(key: str) -> float | None:
            handle = handles.get(key)
            return None if handle is None else tags.age(handle)

        return View(names, look, age)
