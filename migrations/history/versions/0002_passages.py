"""Passages of products, their steps, and how far the events of each machine were read."""

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "passage",
        sa.Column("id", sa.Integer, nullable=False),
        sa.Column("equipment", sa.String, nullable=False),
        sa.Column("boot", sa.Integer, nullable=False),
        sa.Column("product", sa.BigInteger, nullable=False),
        sa.Column("entered", sa.BigInteger, nullable=False),
        sa.Column("entry", sa.Integer, nullable=False),
        sa.Column("length", sa.Float),
        sa.Column("corrections", sa.Integer, nullable=False),
        sa.Column("greatest", sa.Float),
        sa.Column("alarms", sa.String, nullable=False),
        sa.Column("outcome", sa.String, nullable=False),
        sa.Column("ended", sa.BigInteger),
        sa.Column("missed", sa.Integer, nullable=False),
        sa.PrimaryKeyConstraint("id", name="pk_passage"),
    )
    op.create_index("ix_passage_entered", "passage", ["entered"])
    op.create_index("ix_passage_equipment", "passage", ["equipment", "entered"])
    op.create_index("ix_passage_product", "passage", ["product", "equipment"])
    op.create_index("ix_passage_open", "passage", ["equipment"], sqlite_where=sa.text("outcome = 'open'"))
    op.create_table(
        "passage_step",
        sa.Column("passage", sa.Integer, nullable=False),
        sa.Column("boot", sa.Integer, nullable=False),
        sa.Column("sequence", sa.BigInteger, nullable=False),
        sa.Column("time", sa.BigInteger, nullable=False),
        sa.Column("code", sa.Integer, nullable=False),
        sa.Column("source", sa.Integer, nullable=False),
        sa.Column("value", sa.Float),
        sa.Column("second", sa.BigInteger, nullable=False),
        sa.Column("second_value", sa.Float),
        sa.Column("person", sa.String, nullable=False),
        sa.Column("reason", sa.String, nullable=False),
        sa.PrimaryKeyConstraint("passage", "boot", "sequence", name="pk_passage_step"),
        sqlite_with_rowid=False,
    )
    op.create_table(
        "event_mark",
        sa.Column("equipment", sa.String, nullable=False),
        sa.Column("boot", sa.Integer, nullable=False),
        sa.Column("sequence", sa.BigInteger, nullable=False),
        sa.Column("time", sa.BigInteger, nullable=False),
        sa.PrimaryKeyConstraint("equipment", name="pk_event_mark"),
    )
    op.create_table(
        "event_gap",
        sa.Column("equipment", sa.String, nullable=False),
        sa.Column("boot", sa.Integer, nullable=False),
        sa.Column("sequence", sa.BigInteger, nullable=False),
        sa.Column("time", sa.BigInteger, nullable=False),
        sa.Column("count", sa.Integer, nullable=False),
        sa.PrimaryKeyConstraint("equipment", "boot", "sequence", name="pk_event_gap"),
    )


def downgrade() -> None:
    for name in ("event_gap", "event_mark", "passage_step", "passage"):
        op.drop_table(name)
