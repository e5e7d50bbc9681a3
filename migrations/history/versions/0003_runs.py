"""Runs of sequences: their events, steps and forces, and the definitions by which they ran."""

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "sequence_run",
        sa.Column("id", sa.Integer, nullable=False),
        sa.Column("equipment", sa.String, nullable=False),
        sa.Column("boot", sa.Integer, nullable=False),
        sa.Column("sequence", sa.BigInteger, nullable=False),
        sa.Column("definition", sa.String, nullable=False),
        sa.Column("started", sa.BigInteger, nullable=False),
        sa.Column("seen", sa.Integer, nullable=False),
        sa.Column("outcome", sa.String, nullable=False),
        sa.Column("ended", sa.BigInteger),
        sa.Column("seconds", sa.Float),
        sa.Column("step", sa.Integer, nullable=False),
        sa.Column("suspensions", sa.Integer, nullable=False),
        sa.Column("suspended", sa.BigInteger, nullable=False),
        sa.Column("suspended_at", sa.BigInteger),
        sa.Column("stalls", sa.Integer, nullable=False),
        sa.Column("losses", sa.Integer, nullable=False),
        sa.Column("forces", sa.Integer, nullable=False),
        sa.Column("cause", sa.Integer, nullable=False),
        sa.Column("first_out", sa.String, nullable=False),
        sa.Column("first_step", sa.Integer),
        sa.Column("first_bit", sa.Integer),
        sa.Column("first_time", sa.BigInteger),
        sa.Column("first_value", sa.Float),
        sa.Column("first_together", sa.Integer, nullable=False),
        sa.Column("acknowledged", sa.BigInteger),
        sa.Column("acknowledged_by", sa.String, nullable=False),
        sa.Column("person", sa.String, nullable=False),
        sa.Column("missed", sa.Integer, nullable=False),
        sa.PrimaryKeyConstraint("id", name="pk_sequence_run"),
    )
    op.create_index("ix_sequence_run_started", "sequence_run", ["started"])
    op.create_index("ix_sequence_run_equipment", "sequence_run", ["equipment", "started"])
    op.create_index(
        "ix_sequence_run_first_out",
        "sequence_run",
        ["equipment", "first_out"],
        sqlite_where=sa.text("first_out <> ''"),
    )
    op.create_table(
        "sequence_event",
        sa.Column("run", sa.Integer, nullable=False),
        sa.Column("boot", sa.Integer, nullable=False),
        sa.Column("sequence", sa.BigInteger, nullable=False),
        sa.Column("time", sa.BigInteger, nullable=False),
        sa.Column("code", sa.Integer, nullable=False),
        sa.Column("step", sa.Integer, nullable=False),
        sa.Column("bit", sa.Integer),
        sa.Column("value", sa.Float),
        sa.Column("signal", sa.Float),
        sa.Column("together", sa.Integer, nullable=False),
        sa.Column("abort_word", sa.Integer, nullable=False),
        sa.Column("step_word", sa.Integer, nullable=False),
        sa.Column("person", sa.String, nullable=False),
        sa.Column("reason", sa.String, nullable=False),
        sa.PrimaryKeyConstraint("run", "boot", "sequence", name="pk_sequence_event"),
        sqlite_with_rowid=False,
    )
    op.create_table(
        "sequence_step",
        sa.Column("run", sa.Integer, nullable=False),
        sa.Column("step", sa.Integer, nullable=False),
        sa.Column("key", sa.String, nullable=False),
        sa.Column("state", sa.String, nullable=False),
        sa.Column("entered", sa.BigInteger),
        sa.Column("ended", sa.BigInteger),
        sa.Column("seconds", sa.Float),
        sa.Column("suspended", sa.BigInteger, nullable=False),
        sa.PrimaryKeyConstraint("run", "step", name="pk_sequence_step"),
        sqlite_with_rowid=False,
    )
    op.create_table(
        "sequence_force",
        sa.Column("equipment", sa.String, nullable=False),
        sa.Column("boot", sa.Integer, nullable=False),
        sa.Column("sequence", sa.BigInteger, nullable=False),
        sa.Column("definition", sa.String, nullable=False),
        sa.Column("step", sa.Integer, nullable=False),
        sa.Column("bit", sa.Integer, nullable=False),
        sa.Column("since", sa.BigInteger, nullable=False),
        sa.Column("asked", sa.Float, nullable=False),
        sa.Column("until", sa.BigInteger, nullable=False),
        sa.Column("ending", sa.String, nullable=False),
        sa.Column("person", sa.String, nullable=False),
        sa.Column("reason", sa.String, nullable=False),
        sa.PrimaryKeyConstraint("equipment", "boot", "sequence", name="pk_sequence_force"),
    )
    op.create_index("ix_sequence_force_until", "sequence_force", ["equipment", "until"])
    op.create_table(
        "sequence_definition",
        sa.Column("id", sa.String, nullable=False),
        sa.Column("text", sa.String, nullable=False),
        sa.PrimaryKeyConstraint("id", name="pk_sequence_definition"),
    )


def downgrade() -> None:
    for name in ("sequence_definition", "sequence_force", "sequence_step", "sequence_event", "sequence_run"):
        op.drop_table(name)
