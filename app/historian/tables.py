"""Tables of `history.db`."""

from sqlalchemy import BigInteger, Column, Float, Index, Integer, LargeBinary, String, Table, text

from app.db import history_tables

point = Table(
    "point",
    history_tables,
    Column("id", Integer, primary_key=True),
    Column("lasting_id", String, nullable=False, unique=True),
    Column("name", String, nullable=False),
    Column("unit", String, nullable=False),
    Column("kind", String, nullable=False),
)
"""One row per point that was ever recorded; `lasting_id` survives a rename."""

sample = Table(
    "sample",
    history_tables,
    Column("point", Integer, primary_key=True),
    Column("t", BigInteger, primary_key=True),
    Column("v", Float),
    Column("s", String),
    Column("q", Integer, nullable=False),
    sqlite_with_rowid=False,
)
"""What was recorded: time [µs UTC], number or text, quality word. A bad sample has neither number nor text."""

block = Table(
    "block",
    history_tables,
    Column("id", Integer, primary_key=True),
    Column("point", Integer, nullable=False),
    Column("t", BigInteger, nullable=False),
    Column("last", BigInteger, nullable=False),
    Column("count", Integer, nullable=False),
    Column("data", LargeBinary, nullable=False),
    Index("ix_block_point", "point", "t"),
)
"""Samples of hours that are over, packed (packing.py): `count` of one point, from the time `t` to `last` [µs UTC]."""


def _roll_up(name: str) -> Table:
    return Table(
        name,
        history_tables,
        Column("point", Integer, primary_key=True),
        Column("t", BigInteger, primary_key=True),
        Column("low", Float),
        Column("high", Float),
        Column("first_t", BigInteger, nullable=False),
        Column("first", Float),
        Column("last_t", BigInteger, nullable=False),
        Column("last", Float),
        Column("last_q", Integer, nullable=False),
        Column("mean", Float),
        Column("good", BigInteger, nullable=False),
        Column("held", BigInteger, nullable=False),
        Column("count", Integer, nullable=False),
        Column("level", Integer, nullable=False),
        sqlite_with_rowid=False,
    )


minute = _roll_up("minute")
"""One row per point and minute that has samples: `t` start [µs UTC], extremes, time and value of the first and the last sample (no value:
it was bad), quality word of the last, time-weighted mean of the good values, time with a good value and with any [µs], number of samples,
worst level among them. A value holds until the next sample, from the minute before too."""
hour = _roll_up("hour")
"""The same per hour."""

run = Table(
    "run",
    history_tables,
    Column("start", BigInteger, primary_key=True),
    Column("alive", BigInteger, nullable=False),
)
"""When the recorder ran: from `start` to `alive` [µs UTC]. The next run closes the gap between with a bad sample per point.

A recorder whose clock is set back begins another run.
"""

mark = Table(
    "mark",
    history_tables,
    Column("name", String, primary_key=True),
    Column("t", BigInteger, nullable=False),
)
"""Up to when roll-ups are written [µs UTC], which a late sample sets back; up to when anything is sealed; start of the last run."""

volume = Table(
    "volume",
    history_tables,
    Column("t", BigInteger, primary_key=True),
    Column("rows", Integer, nullable=False),
    Column("grown", BigInteger, nullable=False),
)
"""Per hour [µs UTC]: rows stored and bytes by which the database has grown."""

event_mark = Table(
    "event_mark",
    history_tables,
    Column("equipment", String, primary_key=True),
    Column("boot", Integer, nullable=False),
    Column("sequence", BigInteger, nullable=False),
    Column("time", BigInteger, nullable=False),
)
"""The last event of each machine that is stored, written with it."""

event_machine = Table(
    "event_machine",
    history_tables,
    Column("id", Integer, primary_key=True),
    Column("lasting_id", String, nullable=False, unique=True),
    Column("name", String, nullable=False),
)
"""The name that a machine had when its events were last stored: rows say names, and follow a machine that is renamed; its events say
`id`, and stay as they are."""

event = Table(
    "event",
    history_tables,
    Column("id", Integer, primary_key=True),
    Column("machine", Integer, nullable=False),
    Column("boot", Integer, nullable=False),
    Column("sequence", BigInteger, nullable=False),
    Column("time", BigInteger, nullable=False),
    Column("code", Integer, nullable=False),
    Column("source", Integer, nullable=False),
    Column("value", Float),
    Column("words", LargeBinary, nullable=False),
    Column("request", Integer, nullable=False),
    Column("person", String, nullable=False),
    Column("reason", String, nullable=False),
    Index("ix_event_machine", "machine", "time"),
)
"""Every event of every ring (records/event.py). `id` rises in the order of storing; `time` is the event's own [µs UTC]; a `value` that
is none is NULL; `words` are the snapshot as packed there; `request` is the command that caused it (0: none); `person` and `reason` are of
who gave that command (empty: not known)."""

event_gap = Table(
    "event_gap",
    history_tables,
    Column("equipment", String, primary_key=True),
    Column("boot", Integer, primary_key=True),
    Column("sequence", BigInteger, primary_key=True),
    Column("time", BigInteger, nullable=False),
    Column("count", Integer, nullable=False),
)
"""Events that were lost, by the first one after them."""

record = Table(
    "record",
    history_tables,
    Column("id", Integer, primary_key=True),
    Column("machine", Integer, nullable=False),
    Column("kind", String, nullable=False),
    Column("number", BigInteger, nullable=False),
    Column("boot", Integer, nullable=False),
    Column("sequence", BigInteger, nullable=False),
    Column("begun", BigInteger, nullable=False),
    Column("entry", Integer, nullable=False),
    Column("outcome", String, nullable=False),
    Column("ended", BigInteger),
    Column("seconds", Float),
    Column("paused", BigInteger, nullable=False),
    Column("pause", BigInteger),
    Column("missed", Integer, nullable=False),
    Column("alarms", String, nullable=False),
    Column("definition", String, nullable=False),
    Column("key", String, nullable=False),
    Column("value", Float),
    Column("fields", String, nullable=False),
    Column("memo", String, nullable=False),
    Index("ix_record_begun", "kind", "begun"),
    Index("ix_record_machine", "machine", "kind", "begun"),
    Index("ix_record_number", "machine", "kind", "number"),
    Index("ix_record_open", "machine", "kind", sqlite_where=text("outcome = 'open'")),
    Index("ix_record_outcome", "kind", "outcome", "begun"),
    Index("ix_record_key", "machine", "kind", "key", sqlite_where=text("key <> ''")),
)
"""What became of one thing on a machine (records/record.py): `machine` as in `event`, `alarms` codes (` 10 20 `), `fields` what its kind
declares and `memo` what it remembers meanwhile, as JSON (empty: nothing); `key` and `value` are those fields by which its kind is found."""

record_part = Table(
    "record_part",
    history_tables,
    Column("record", Integer, primary_key=True),
    Column("number", Integer, primary_key=True),
    Column("key", String, nullable=False),
    Column("state", String, nullable=False),
    Column("begun", BigInteger),
    Column("ended", BigInteger),
    Column("seconds", Float),
    Column("paused", BigInteger, nullable=False),
    sqlite_with_rowid=False,
)
"""Its parts: when each began and ended [µs UTC], how long it was active [s], pauses [µs] not counted."""

record_event = Table(
    "record_event",
    history_tables,
    Column("record", Integer, primary_key=True),
    Column("event", Integer, primary_key=True),
    sqlite_with_rowid=False,
)
"""Its events; one may be of several records."""

definition = Table(
    "definition",
    history_tables,
    Column("id", String, primary_key=True),
    Column("text", String, nullable=False),
)
"""What machines were configured to do when a record was made, as JSON, whatever the plant file says today."""
