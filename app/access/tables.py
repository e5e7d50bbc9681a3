"""Tables of `pogon.db` about people and what they did. Times are integer µs UTC."""

from sqlalchemy import JSON, BigInteger, Boolean, Column, ForeignKey, Index, Integer, String, Table, Text

from app.db import pogon_tables

person_table = Table(
    "person",
    pogon_tables,
    Column("id", Integer, primary_key=True),
    Column("name", String(64), nullable=False, unique=True),
    Column("display", String(80), nullable=False),
    Column("password", String(200), nullable=False),
    Column("must_change", Boolean, nullable=False),
    Column("initial_until", BigInteger),
    Column("disabled", Boolean, nullable=False),
    Column("language", String(8), nullable=False),
    Column("theme", String(8), nullable=False),
    Column("created", BigInteger, nullable=False),
    Column("last_seen", BigInteger),
    sqlite_autoincrement=True,  # an id is never given twice
)

role_table = Table(
    "person_role",
    pogon_tables,
    Column("person", ForeignKey("person.id", ondelete="CASCADE"), primary_key=True),
    Column("role", String(16), primary_key=True),
)

session_table = Table(
    "session",
    pogon_tables,
    Column("id_hash", String(64), primary_key=True),
    Column("person", ForeignKey("person.id", ondelete="CASCADE"), nullable=False, index=True),
    Column("created", BigInteger, nullable=False),
    Column("active", BigInteger, nullable=False),
    Column("until", BigInteger, nullable=False),
    Column("address", String(64), nullable=False),
    Column("agent", String(200), nullable=False),
)

token_table = Table(
    "token",
    pogon_tables,
    Column("id", Integer, primary_key=True),
    Column("name", String(64), nullable=False),
    Column("hash", String(64), nullable=False, unique=True),
    Column("permissions", String(200), nullable=False),
    Column("person", ForeignKey("person.id", ondelete="CASCADE"), nullable=False),
    Column("created", BigInteger, nullable=False),
    Column("until", BigInteger, nullable=False),
    Column("last_used", BigInteger),
    Column("revoked", Boolean, nullable=False),
    sqlite_autoincrement=True,
)

factor_table = Table(
    "factor",
    pogon_tables,
    Column("person", ForeignKey("person.id", ondelete="CASCADE"), primary_key=True),
    Column("sealed", Text, nullable=False),
    Column("since", BigInteger, nullable=False),
    Column("last_step", BigInteger, nullable=False),
)

recovery_table = Table(
    "recovery_code",
    pogon_tables,
    Column("person", ForeignKey("person.id", ondelete="CASCADE"), primary_key=True),
    Column("hash", String(64), primary_key=True),
)

kept_table = Table(
    "kept",
    pogon_tables,
    Column("person", ForeignKey("person.id", ondelete="CASCADE"), primary_key=True),
    Column("kind", String(16), primary_key=True),
    Column("name", String(200), primary_key=True),
    Column("since", BigInteger, nullable=False),
    Column("value", JSON, nullable=False),
)

audit_table = Table(
    "audit",
    pogon_tables,
    Column("seq", Integer, primary_key=True),
    Column("time", BigInteger, nullable=False),
    Column("kind", String(64), nullable=False),
    Column("person_id", Integer, nullable=False),
    Column("person", String(64), nullable=False),
    Column("address", String(64), nullable=False),
    Column("session", String(16), nullable=False),
    Column("object", String(120), nullable=False),
    Column("old", Text, nullable=False),
    Column("new", Text, nullable=False),
    Column("result", String(32), nullable=False),
    Column("reason", Text, nullable=False),
    Column("params", Text, nullable=False),
    Column("mac", String(64), nullable=False),
    Index("ix_audit_time", "time"),
    Index("ix_audit_kind", "kind"),
    Index("ix_audit_person", "person"),
    Index("ix_audit_object", "object"),
)
