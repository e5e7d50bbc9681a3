"""Tables of `history.db`."""

from sqlalchemy import BigInteger, Column, Float, Index, Integer, String, Table, text

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
"""When the recorder ran: from `start` to `alive` [µs UTC]. The next run closes the gap between with a bad sample per point."""

mark = Table(
    "mark",
    history_tables,
    Column("name", String, primary_key=True),
    Column("t", BigInteger, nullable=False),
)
"""Up to when roll-ups are written [µs UTC]; a late sample sets it back."""

volume = Table(
    "volume",
    history_tables,
    Column("t", BigInteger, primary_key=True),
    Column("rows", Integer, nullable=False),
    Column("grown", BigInteger, nullable=False),
)
"""Per hour [µs UTC]: rows stored and bytes by which the database has grown."""

passage = Table(
    "passage",
    history_tables,
    Column("id", Integer, primary_key=True),
    Column("equipment", String, nullable=False),
    Column("boot", Integer, nullable=False),
    Column("product", BigInteger, nullable=False),
    Column("entered", BigInteger, nullable=False),
    Column("entry", Integer, nullable=False),
    Column("length", Float),
    Column("corrections", Integer, nullable=False),
    Column("greatest", Float),
    Column("alarms", String, nullable=False),
    Column("outcome", String, nullable=False),
    Column("ended", BigInteger),
    Column("missed", Integer, nullable=False),
    Index("ix_passage_entered", "entered"),
    Index("ix_passage_equipment", "equipment", "entered"),
    Index("ix_passage_product", "product", "equipment"),
    Index("ix_passage_open", "equipment", sqlite_where=text("outcome = 'open'")),
)
"""One row per product on a machine: when it entered [µs UTC] and by which event (0: not seen), length [mm], number of corrections and
greatest amount [mm], codes of events that are alarms (` 10 20 `), what became of it and when, events lost meanwhile."""

passage_step = Table(
    "passage_step",
    history_tables,
    Column("passage", Integer, primary_key=True),
    Column("boot", Integer, primary_key=True),
    Column("sequence", BigInteger, primary_key=True),
    Column("time", BigInteger, nullable=False),
    Column("code", Integer, nullable=False),
    Column("source", Integer, nullable=False),
    Column("value", Float),
    Column("second", BigInteger, nullable=False),
    Column("second_value", Float),
    Column("person", String, nullable=False),
    Column("reason", String, nullable=False),
    sqlite_with_rowid=False,
)
"""What happened to it: one row per event, and who had asked for it."""

event_mark = Table(
    "event_mark",
    history_tables,
    Column("equipment", String, primary_key=True),
    Column("boot", Integer, nullable=False),
    Column("sequence", BigInteger, nullable=False),
    Column("time", BigInteger, nullable=False),
)
"""The last event of each machine that is in the passages, written with it."""

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
