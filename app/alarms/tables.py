"""Tables of `pogon.db` about alarms: how each one stands, and everything that became of it. Times are integer µs UTC."""

from sqlalchemy import BigInteger, Boolean, Column, Float, Index, Integer, String, Table, Text

from app.db import pogon_tables

state_table = Table(
    "alarm_state",
    pogon_tables,
    Column("alarm", String(160), primary_key=True),
    Column("equipment", String(64), nullable=False),
    Column("key", String(64), nullable=False),
    Column("occurrence", Integer, nullable=False),
    Column("active", Boolean, nullable=False),
    Column("acked", Boolean, nullable=False),
    Column("latched", Boolean, nullable=False),
    Column("shelved", Boolean, nullable=False),
    Column("suppressed", Boolean, nullable=False),
    Column("out_of_service", Boolean, nullable=False),
    Column("known", Boolean, nullable=False),
    Column("first_true", BigInteger, nullable=False),
    Column("annunciated", BigInteger, nullable=False),
    Column("returned", BigInteger, nullable=False),
    Column("acked_at", BigInteger, nullable=False),
    Column("acked_by", String(80), nullable=False),
    Column("count", Integer, nullable=False),
    Column("ordinal", Integer, nullable=False),
    Column("uncertain", Boolean, nullable=False),
    Column("value", Float),
    Column("limit", Float),
    Column("params", Text, nullable=False),
    Column("hiding", Text, nullable=False, server_default="{}"),
)
"""Every alarm that is not normal."""

journal_table = Table(
    "alarm_journal",
    pogon_tables,
    Column("seq", Integer, primary_key=True),
    Column("time", BigInteger, nullable=False),
    Column("first_true", BigInteger, nullable=False),
    Column("event", String(16), nullable=False),
    Column("detail", String(200), nullable=False),
    Column("alarm", String(160), nullable=False),
    Column("occurrence", Integer, nullable=False),
    Column("equipment", String(64), nullable=False),
    Column("area", String(64), nullable=False),
    Column("alarm_class", String(32), nullable=False),
    Column("priority", Integer, nullable=False),
    Column("before", String(1), nullable=False),
    Column("after", String(1), nullable=False),
    Column("active", Boolean, nullable=False),
    Column("acked", Boolean, nullable=False),
    Column("latched", Boolean, nullable=False),
    Column("hidden", String(16), nullable=False),
    Column("silent", Boolean, nullable=False),
    Column("ordinal", Integer, nullable=False),
    Column("value", Float),
    Column("unit", String(16), nullable=False),
    Column("quality", String(40), nullable=False),
    Column("limit", Float),
    Column("person_id", Integer, nullable=False),
    Column("person", String(64), nullable=False),
    Column("roles", String(64), nullable=False),
    Column("address", String(64), nullable=False),
    Column("session", String(16), nullable=False),
    Column("comment", Text, nullable=False),
    Column("type", String(64), nullable=False),
    Column("text_id", String(160), nullable=False),
    Column("params", Text, nullable=False),
    Column("text", Text, nullable=False),
    Column("config", String(16), nullable=False),
    Column("mac", String(64), nullable=False),
    Index("ix_alarm_journal_time", "time"),
    Index("ix_alarm_journal_alarm", "alarm", "seq"),
    Index("ix_alarm_journal_equipment", "equipment", "seq"),
)
"""One row per transition; nothing is ever changed."""

event_mark_table = Table(
    "alarm_event_mark",
    pogon_tables,
    Column("equipment", String(64), primary_key=True),
    Column("boot", Integer, nullable=False),
    Column("sequence", BigInteger, nullable=False),
    Column("time", BigInteger, nullable=False),
)
"""The last event of each machine that the alarms have taken, written with what it did."""
