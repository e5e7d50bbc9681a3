"""The journal of alarms: one record per transition, numbered without gaps, chained as the audit is; nothing is ever changed.

    mac_n = HMAC-SHA256(K, mac_{n-1} || SHA-256(record n))      K = HMAC(audit key, "alarm journal")

A record keeps the text's key and parameters, so that everybody reads it in their language, and the text in the plant's first language as
it was. Source: reference/alarms.md section 7.
"""

import hashlib
import hmac
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any

from sqlalchemy import ColumnElement, Connection, RowMapping, Select, bindparam, delete, func, insert, select

from app.access.audit.chain import begin_now, chained, genesis, is_mac
from app.access.audit.verification import Verdict
from app.alarms.lifecycle import Life
from app.alarms.tables import event_mark_table, journal_table, state_table
from app.plant.events import RingPosition

DAY = 86_400_000_000
HOUR = 3_600_000_000
"""[µs]"""


@dataclass(frozen=True, slots=True)
class Record:
    """One transition of one alarm."""

    time: int
    """When it was told [µs UTC]; of RAISED the annunciation. What an event of the device raised or ended has the time of the event."""
    first_true: int
    """When the condition first was true [µs UTC]; 0 = it never was."""
    event: str
    detail: str
    alarm: str
    occurrence: int
    equipment: str
    """Empty for the system."""
    area: str
    alarm_class: str
    priority: int
    before: str
    """Letter of the state."""
    after: str
    active: bool
    acked: bool
    latched: bool
    hidden: str
    """What keeps it from being shown: `shelved`, `suppressed`, `oos`, with + between; empty = nothing."""
    silent: bool
    ordinal: int
    """Place in its first-out group; 0 = in none."""
    value: float | None
    unit: str
    quality: str
    limit: float | None
    person_id: int
    person: str
    roles: str
    address: str
    session: str
    comment: str
    type: str
    """Equipment type whose texts are asked; empty = the product's."""
    text_id: str
    params: str
    """JSON object for the placeholders."""
    text: str
    """In the plant's first language."""
    config: str
    """Digest of the alarm definitions."""
    seq: int = 0

    @property
    def parameters(self) -> Mapping[str, object]:
        """`params` as a mapping."""
        found = json.loads(self.params)
        return found if isinstance(found, dict) else {}


@dataclass(frozen=True, slots=True)
class Filter:
    """Which records a person wants to see; empty fields do not filter."""

    equipment: str = ""
    area: str = ""
    event: str = ""
    state: str = ""
    """Letter of the state that it led to."""
    priority: int = 0
    """This priority and more important ones; 0 = all."""
    text: str = ""
    """Part of the alarm's name or of its text in the plant's first language."""
    since: int | None = None
    """µs UTC."""
    until: int | None = None
    before: int | None = None
    """Only records with a smaller number: the next page."""
    alarms: Sequence[str] | None = None
    """Only these alarms, besides those whose text fits: what fits in the reader's language."""


@dataclass(frozen=True, slots=True)
class Stored:
    """How an alarm stood when the server last wrote it down."""

    alarm: str
    equipment: str
    key: str
    occurrence: int
    active: bool
    acked: bool
    latched: bool
    shelved: bool
    suppressed: bool
    out_of_service: bool
    known: bool
    first_true: int
    annunciated: int
    returned: int
    acked_at: int
    acked_by: str
    count: int
    ordinal: int
    uncertain: bool
    value: float | None
    limit: float | None
    params: str
    hiding: str = "{}"
    """Who put it aside, why and until when (shelf.py), as JSON."""

    @property
    def life(self) -> Life:
        """Its layers."""
        return Life(self.active, self.acked, self.latched, self.shelved, self.suppressed, self.out_of_service)


@dataclass(frozen=True, slots=True)
class Past:
    """One earlier occurrence."""

    occurrence: int
    raised: int
    """[µs UTC]"""
    returned: int
    """0 = it still stands, or nothing is written about its end."""
    acked: int
    acked_by: str
    value: float | None
    limit: float | None


def journal_key(audit_key: bytes) -> bytes:
    """Key of the journal's chain, other than the audit's."""
    return hmac.new(audit_key, b"alarm journal", hashlib.sha256).digest()


def write(
    connection: Connection,
    key: bytes,
    records: Sequence[Record],
    states: Iterable[Stored],
    gone: Iterable[str],
    positions: Mapping[str, RingPosition] = {},
) -> int:
    """Append `records`, keep how the alarms stand and how far the events were taken (`positions`, by machine), in one transaction.

    Number of the newest record, 0 for an empty journal.
    """
    begin_now(connection)
    last = connection.execute(
        select(journal_table.c.seq, journal_table.c.mac).order_by(journal_table.c.seq.desc()).limit(1)
    ).first()
    seq, mac = (last.seq, last.mac) if last else (0, genesis(key))
    rows = []
    for record in records:
        seq += 1
        row = {**asdict(record), "seq": seq}
        mac = chained(key, mac, row)
        rows.append({**row, "mac": mac})
    if rows:
        connection.execute(insert(journal_table), rows)
    kept = [asdict(one) for one in states]
    names = [{"name": name} for name in dict.fromkeys([*gone, *(row["alarm"] for row in kept)])]
    if names:
        connection.execute(delete(state_table).where(state_table.c.alarm == bindparam("name")), names)
    if kept:
        connection.execute(insert(state_table), kept)
    if positions:
        machines = [{"name": name} for name in positions]
        connection.execute(delete(event_mark_table).where(event_mark_table.c.equipment == bindparam("name")), machines)
        connection.execute(
            insert(event_mark_table),
            [
                {"equipment": name, "boot": position.boot, "sequence": position.sequence, "time": position.time}
                for name, position in positions.items()
            ],
        )
    return seq


def ring_positions(connection: Connection) -> dict[str, RingPosition]:
    """Machine → its last event that the alarms have taken."""
    rows = connection.execute(select(event_mark_table))
    return {row.equipment: RingPosition(row.boot, row.sequence, row.time) for row in rows}


def stored(connection: Connection) -> list[Stored]:
    """How every alarm stood that was not normal."""
    return [Stored(**row._mapping) for row in connection.execute(select(state_table).order_by(state_table.c.alarm))]


def newest_occurrence(connection: Connection) -> int:
    """Number of the newest occurrence; 0 for none. Numbers are never given twice."""
    return max(
        connection.execute(select(func.max(journal_table.c.occurrence))).scalar() or 0,
        connection.execute(select(func.max(state_table.c.occurrence))).scalar() or 0,
    )


def annunciations(connection: Connection, since: int, alarm: str = "") -> list[int]:
    """Times of everything that asked for attention since `since` [µs UTC], oldest first; of one alarm, or of all."""
    table = journal_table.c
    query = select(table.time).where(table.time >= since, asks_attention())
    if alarm:
        query = query.where(table.alarm == alarm)
    return list(connection.execute(query.order_by(table.seq)).scalars())


def asks_attention() -> ColumnElement[bool]:
    """The records by which an alarm asked for attention: raised where everybody sees it, raised again, or active when it came back."""
    table = journal_table.c
    again = table.event.in_(("REALARM", "UNSHELVED", "OOS_OFF")) & (table.after == "B")
    return ((table.event == "RAISED") & table.silent.is_(False)) | again


def find(connection: Connection, wanted: Filter, limit: int = 100) -> list[Record]:
    """The newest `limit` records that `wanted` lets through, newest first."""
    query = _filtered(select(journal_table), wanted).order_by(journal_table.c.seq.desc()).limit(limit)
    return [_record(row._mapping) for row in connection.execute(query)]


def newest(connection: Connection, alarms: Iterable[str]) -> dict[str, Record]:
    """The newest record of each of `alarms` that has one."""
    table = journal_table.c
    numbers = select(func.max(table.seq)).where(table.alarm.in_(list(alarms))).group_by(table.alarm)
    rows = connection.execute(select(journal_table).where(table.seq.in_(numbers)))
    return {row.alarm: _record(row._mapping) for row in rows}


def by_number(connection: Connection, numbers: Iterable[int]) -> dict[int, Record]:
    """The records of these numbers that are there."""
    rows = connection.execute(select(journal_table).where(journal_table.c.seq.in_(list(numbers))))
    return {row.seq: _record(row._mapping) for row in rows}


def count(connection: Connection, wanted: Filter) -> int:
    """How many records `wanted` lets through."""
    found: int = connection.execute(_filtered(select(func.count()).select_from(journal_table), wanted)).scalar_one()
    return found


def occurrences(connection: Connection, alarm: str, limit: int = 10) -> list[Past]:
    """The newest `limit` occurrences of `alarm`, newest first."""
    table = journal_table.c
    numbers = (
        select(table.occurrence)
        .where(table.alarm == alarm, table.event == "RAISED")
        .order_by(table.seq.desc())
        .limit(limit)
    )
    rows = connection.execute(
        select(journal_table).where(table.alarm == alarm, table.occurrence.in_(numbers)).order_by(table.seq)
    )
    found: dict[int, Past] = {}
    for row in rows:
        past = found.get(row.occurrence)
        if row.event == "RAISED" or past is None:
            found[row.occurrence] = Past(row.occurrence, row.first_true or row.time, 0, 0, "", row.value, row.limit)
        elif row.event in ("RTN", "REMOVED"):
            found[row.occurrence] = Past(
                past.occurrence, past.raised, row.time, past.acked, past.acked_by, past.value, past.limit
            )
        elif row.event == "ACK":
            found[row.occurrence] = Past(
                past.occurrence, past.raised, past.returned, row.time, row.person, past.value, past.limit
            )
    return sorted(found.values(), key=lambda past: -past.occurrence)


def events(connection: Connection) -> list[str]:
    """Events that occur, sorted."""
    query = select(journal_table.c.event).distinct().order_by(journal_table.c.event)
    return list(connection.execute(query).scalars())


def verify(connection: Connection, key: bytes) -> Verdict:
    """Walk the chain from its first record. That its end was cut off is told by the audit, which has a line for every acknowledgement."""
    before, expected = genesis(key), 1
    for row in connection.execute(select(journal_table).order_by(journal_table.c.seq)).yield_per(1000):
        if row.seq != expected:
            return Verdict(expected - 1, expected, "removed", row.seq)
        content = {name: value for name, value in row._mapping.items() if name != "mac"}
        if not is_mac(row.mac, chained(key, before, {name: content[name] for name in _NAMES})):
            return Verdict(expected - 1, row.seq, "changed", row.seq)
        before, expected = row.mac, expected + 1
    return Verdict(expected - 1, newest=expected - 1)


_NAMES = tuple(field.name for field in fields(Record))


def _record(row: RowMapping) -> Record:
    return Record(**{name: row[name] for name in _NAMES})


def _filtered(query: Select[Any], wanted: Filter) -> Select[Any]:
    table = journal_table.c
    found = query
    if wanted.equipment:
        found = found.where(table.equipment == ("" if wanted.equipment == "sys" else wanted.equipment))
    if wanted.area:
        found = found.where(table.area == wanted.area)
    if wanted.event:
        found = found.where(table.event == wanted.event)
    if wanted.state:
        found = found.where(table.after == wanted.state)
    if wanted.priority:
        found = found.where(table.priority <= wanted.priority)
    if wanted.text:
        fits = table.text.icontains(wanted.text, autoescape=True) | table.alarm.icontains(wanted.text, autoescape=True)
        if wanted.alarms:
            fits = fits | table.alarm.in_(wanted.alarms)
        found = found.where(fits)
    if wanted.since is not None:
        found = found.where(table.time >= wanted.since)
    if wanted.until is not None:
        found = found.where(table.time < wanted.until)
    if wanted.before is not None:
        found = found.where(table.seq < wanted.before)
    return found
