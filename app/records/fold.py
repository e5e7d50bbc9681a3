"""What an event does to the records of a machine. Here, and in the functions of a kind, are all the rules.

`fold` makes of a record and an event of it another record. `take` finds the record, on a `Shelf`: a dictionary in tests, the history
otherwise.
"""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from app.records.kind import Belongs, End, Field, RecordKind, Rule, Verb
from app.records.record import OPEN, UNKNOWN, Names, Part, Reading, Record, Unnamed, Value

ACTIVE = "active"


@dataclass(frozen=True, slots=True)
class Machine:
    """What is known of a machine."""

    kinds: Sequence[RecordKind] = ()
    alarms: Collection[int] = frozenset()
    """Codes of its events that are alarms."""
    names: Names = field(default_factory=Unnamed)


class Shelf(Protocol):
    """The records of one machine. What it hands out nobody changes; what is put back takes its place."""

    def latest(self, kind: RecordKind, number: int) -> Record | None:
        """The newest record of a number."""
        ...

    def open(self, kind: RecordKind) -> Iterable[Record]:
        """Those under way, the oldest first."""
        ...

    def lasting(self, kind: str, time: int) -> int:
        """How many of a kind are under way at `time` [µs UTC]."""
        ...

    def add(self, record: Record) -> Record:
        """Keep a new one; it has an id then."""
        ...

    def put(self, record: Record) -> None:
        """Keep what became of one."""
        ...

    def note(self, record: Record, event: Reading) -> None:
        """The event is one of this record."""
        ...


# ---- a machine's events -------------------------------------------------------------------------------------


def take(machine: Machine, shelf: Shelf, event: Reading) -> bool:
    """Put a new event of a machine where it belongs; whether it belongs to any record."""
    found = False
    for kind in machine.kinds:
        number = number_of(kind, event)
        if number is None:
            continue
        record = _place(kind, machine, shelf, event, number)
        if record is None:
            continue
        found = True
        _shared(kind, machine, shelf, event, number)
        _overtaken(kind, shelf, event, record)
    return found


def lose(machine: Machine, shelf: Shelf, lost: int) -> None:
    """So many events were lost before the next one: all records under way have missed them."""
    for kind in machine.kinds:
        for record in shelf.open(kind):
            changed = record.copy()
            changed.missed += lost
            shelf.put(changed)


def begin_again(machine: Machine, shelf: Shelf, event: Reading) -> None:
    """The ring counts from 1 again with `event`: the machine knows nothing any more of what was under way."""
    for kind in machine.kinds:
        if event.code in kind.restart or (kind.lasts and not kind.forgotten):  # it ends by the event, or by itself
            continue
        for record in list(shelf.open(kind)):
            if not kind.lasts:
                shelf.put(forgotten(record, event.time))
            elif _stands(record, event.time):
                changed = record.copy()
                changed.outcome, changed.ended = kind.forgotten, max(record.begun, event.time)
                shelf.put(changed)


def number_of(kind: RecordKind, event: Reading) -> int | None:
    """Which record of `kind` an event is about; None: about none."""
    if kind.only is not None and event.code not in kind.only:
        return None
    if kind.hooks.number is not None:
        return kind.hooks.number(event)
    if not kind.number:
        return 0
    said = event.words.get(kind.number)
    return int(said) if said else None


def belongs(kind: RecordKind, latest: Record | None, event: Reading) -> Belongs:
    """Where an event belongs whose number `latest` has as the newest."""
    own = kind.hooks.belongs(latest, event) if kind.hooks.belongs else None
    if own is not None:
        return own
    if event.code in kind.begin:
        return Belongs.SEEN
    if latest is not None:
        over = latest.ended is None or event.time - latest.ended > kind.late * 1e6
        if latest.open or latest.outcome in kind.reopen or (kind.late and not over):
            return Belongs.HERE
    if event.code in kind.found:
        return Belongs.SEEN
    return Belongs.UNSEEN if kind.implied is None or event.code in kind.implied else Belongs.NOWHERE


def _place(
    kind: RecordKind, machine: Machine, shelf: Shelf, event: Reading, number: int, *, second: bool = False
) -> Record | None:
    """Put an event into the record that it belongs to, a new one where it begins one; `second`: of what it says only an alarm is its."""
    queued = event.code in kind.oldest
    latest = next(iter(shelf.open(kind)), None) if queued else shelf.latest(kind, number)
    where = belongs(kind, latest, event)
    if where is Belongs.NOWHERE:
        return None
    if where is Belongs.HERE and latest is not None:
        record = latest
    else:
        if latest is not None and latest.open and not kind.oldest:
            shelf.put(displaced(kind, latest, event.time))
        record = shelf.add(_new(kind, machine, shelf, event, number, seen=where is Belongs.SEEN))
        for other in machine.kinds:
            counting = [one.name for one in other.fields.values() if one.overlapping == kind.name]
            if counting and not (latest is not None and latest.outcome == OPEN and _stands(latest, event.time)):
                _count(other, counting, shelf)
    record = _alarmed(kind, record, event, machine.alarms) if second else fold(kind, record, event, machine)
    shelf.put(record)
    shelf.note(record, event)
    return record


def _new(kind: RecordKind, machine: Machine, shelf: Shelf, event: Reading, number: int, *, seen: bool) -> Record:
    record = Record(kind.name, number, event.boot, event.sequence, event.time, event.code if seen else 0)
    if kind.definition:
        record.definition = machine.names.id
    for one in kind.fields.values():
        if one.overlapping:
            record.fields[one.name] = shelf.lasting(one.overlapping, event.time)
        elif one.initial is not None:
            record.fields[one.name] = one.initial
    if kind.lasts:
        record.ended = event.time + round(max(0.0, float(_said(kind.lasts, event) or 0.0)) * 1e6)
    return record


def _count(kind: RecordKind, fields: Iterable[str], shelf: Shelf) -> None:
    for record in list(shelf.open(kind)):
        changed = record.copy()
        for name in fields:
            changed.fields[name] = int(changed.fields.get(name) or 0) + 1
        shelf.put(changed)


def _stands(record: Record, time: int) -> bool:
    return record.ended is None or record.ended > time


def _shared(kind: RecordKind, machine: Machine, shelf: Shelf, event: Reading, number: int) -> None:
    """An event that is about a second one, too, is part of that one's record."""
    second = event.words.get(kind.also) if kind.also and event.code in kind.shared else None
    if second and int(second) != number:
        _place(kind, machine, shelf, event, int(second), second=True)


def _overtaken(kind: RecordKind, shelf: Shelf, event: Reading, record: Record) -> None:
    """Of those that came before one that leaves, and of which events were lost, the end was among these."""
    if kind.order is None or event.code not in kind.order.ended or record.entry not in kind.order.begun:
        return
    for one in list(shelf.open(kind)):
        if one.missed and one.entry in kind.order.begun and one.begun < record.begun:
            shelf.put(forgotten(one, event.time))


# ---- one record ---------------------------------------------------------------------------------------------


def fold(kind: RecordKind, former: Record, event: Reading, machine: Machine) -> Record:
    """What becomes of a record by an event that belongs to it."""
    record = _alarmed(kind, former, event, machine.alarms)
    if event.code in kind.reopen.get(record.outcome, ()):
        record.outcome, record.ended, record.seconds = OPEN, None, None
    for one in kind.fields.values():
        for rule in one.rules:
            if rule.when.fits(event):
                _apply(record, one, rule, event)
    _pause(kind, record, event)
    _parts(kind, record, event, machine.names)
    end = _end(kind, record, event)
    if end is not None:
        _finish(record, end, event)
    if kind.hooks.fold is not None:
        kind.hooks.fold(record, former, event, machine.names)
    if not record.open:
        record.memo = {}
    return record


def _alarmed(kind: RecordKind, former: Record, event: Reading, alarms: Collection[int]) -> Record:
    record = former.copy()
    if kind.alarms and event.code in alarms and event.code not in record.alarms:
        record.alarms = (*record.alarms, event.code)
    return record


def forgotten(former: Record, time: int) -> Record:
    """The end of a record was not seen."""
    record = former.copy()
    record.outcome, record.ended, record.pause, record.memo = UNKNOWN, time, None, {}
    _leave_parts(record, UNKNOWN)
    return record


def displaced(kind: RecordKind, former: Record, time: int) -> Record:
    """Another one of its number begins."""
    if kind.lasts and former.ended is not None:
        record = former.copy()
        if former.ended > time:
            record.outcome, record.ended = kind.displaced, time
        else:
            record.outcome = kind.expired
        return record
    record = forgotten(former, time)
    record.outcome = kind.displaced
    return record


def _said(of: str, event: Reading) -> Value:
    match of:
        case "value":
            return event.value
        case "source":
            return event.source
        case "time":
            return event.time
    return event.words.get(of)


def _apply(record: Record, field: Field, rule: Rule, event: Reading) -> None:
    said = _said(rule.of, event) if rule.of else 1
    if said is None or isinstance(said, str) or (rule.above is not None and not said > rule.above):
        return
    new = abs(said) if rule.amount else said
    known = record.fields.get(field.name)
    old = None if isinstance(known, str) else known
    match rule.verb:
        case Verb.SET:
            record.fields[field.name] = new
        case Verb.FIRST:
            record.fields[field.name] = new if old is None else old
        case Verb.COUNT:
            record.fields[field.name] = (old or 0) + 1
        case Verb.SUM:
            record.fields[field.name] = (old or 0) + new
        case Verb.LARGEST:
            record.fields[field.name] = new if old is None else max(old, new)
        case Verb.SMALLEST:
            record.fields[field.name] = new if old is None else min(old, new)


def _pause(kind: RecordKind, record: Record, event: Reading) -> None:
    if kind.pause is None:
        return
    if event.code in kind.pause.end and record.pause is not None:
        passed = max(0, event.time - record.pause)
        record.paused, record.pause = record.paused + passed, None
        for part in record.parts.values():
            if part.state == ACTIVE:
                part.paused += passed
    if event.code in kind.pause.begin:
        record.pause = event.time


def _parts(kind: RecordKind, record: Record, event: Reading, names: Names) -> None:
    if kind.parts is None:
        return
    number, alone = event.source, record.missed or not kind.parts.together
    if event.code in kind.parts.begin:
        if alone:
            _leave_parts(record, UNKNOWN)  # the end of the former one was among the lost events
        before = record.parts.get(number)
        if kind.parts.together and before is not None and before.seconds is not None:
            record.memo[f"part.{number}"] = [before.seconds]
        record.parts[number] = Part(number, names.part(number), ACTIVE, event.time)
    elif event.code in kind.parts.end:
        if alone:
            _leave_parts(record, UNKNOWN, but=number)
        part = record.parts.setdefault(number, Part(number, names.part(number), ACTIVE))
        passed = record.memo.get(f"part.{number}", [0.0])[0]
        seconds = event.value + passed if event.value is not None and isinstance(passed, int | float) else event.value
        part.state, part.ended, part.seconds = "done", event.time, seconds


def _leave_parts(record: Record, state: str, *, but: int | None = None) -> None:
    for part in record.parts.values():
        if part.state == ACTIVE and part.number != but:
            part.state = state


def _end(kind: RecordKind, record: Record, event: Reading) -> End | None:
    """How an event ends a record; None: it does not."""
    return next((end for end in kind.ends if record.outcome in end.after and end.when.fits(event)), None)


def _finish(record: Record, end: End, event: Reading) -> None:
    known = end.seconds != "unknown"
    for part in record.parts.values():
        if part.state == ACTIVE:
            part.state, part.ended = end.part or end.outcome, event.time
            if known and part.begun is not None:
                part.seconds = _between(part.begun + part.paused, event.time)
    record.outcome, record.ended, record.pause = end.outcome, max(record.begun, event.time), None
    record.seconds = None
    if known:
        record.seconds = event.value if end.seconds == "value" else _between(record.begun, event.time)


def _between(begin: int, end: int) -> float | None:
    """How long it was [s]; None where the clock of the device was set back between, as nobody knows then."""
    return (end - begin) / 1e6 if begin <= end else None
