"""How each alarm stands, and the journal of alarms."""

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "alarm_state",
        sa.Column("alarm", sa.String(160), nullable=False),
        sa.Column("equipment", sa.String(64), nullable=False),
        sa.Column("key", sa.String(64), nullable=False),
        sa.Column("occurrence", sa.Integer(), nullable=False),
        *(
            sa.Column(name, sa.Boolean(), nullable=False)
            for name in ("active", "acked", "latched", "shelved", "suppressed", "out_of_service", "known")
        ),
        *(
            sa.Column(name, sa.BigInteger(), nullable=False)
            for name in ("first_true", "annunciated", "returned", "acked_at")
        ),
        sa.Column("acked_by", sa.String(80), nullable=False),
        sa.Column("count", sa.Integer(), nullable=False),
        sa.Column("ordinal", sa.Integer(), nullable=False),
        sa.Column("uncertain", sa.Boolean(), nullable=False),
        sa.Column("value", sa.Float()),
        sa.Column("limit", sa.Float()),
        sa.Column("params", sa.Text(), nullable=False),
        sa.PrimaryKeyConstraint("alarm", name="pk_alarm_state"),
    )
    op.create_table(
        "alarm_journal",
        sa.Column("seq", sa.Integer(), nullable=False),
        sa.Column("time", sa.BigInteger(), nullable=False),
        sa.Column("first_true", sa.BigInteger(), nullable=False),
        sa.Column("event", sa.String(16), nullable=False),
        sa.Column("detail", sa.String(200), nullable=False),
        sa.Column("alarm", sa.String(160), nullable=False),
        sa.Column("occurrence", sa.Integer(), nullable=False),
        sa.Column("equipment", sa.String(64), nullable=False),
        sa.Column("area", sa.String(64), nullable=False),
        sa.Column("alarm_class", sa.String(32), nullable=False),
        sa.Column("priority", sa.Integer(), nullable=False),
        sa.Column("before", sa.String(1), nullable=False),
        sa.Column("after", sa.String(1), nullable=False),
        sa.Column("active", sa.Boolean(), nullable=False),
        sa.Column("acked", sa.Boolean(), nullable=False),
        sa.Column("latched", sa.Boolean(), nullable=False),
        sa.Column("hidden", sa.String(16), nullable=False),
        sa.Column("silent", sa.Boolean(), nullable=False),
        sa.Column("ordinal", sa.Integer(), nullable=False),
        sa.Column("value", sa.Float()),
        sa.Column("unit", sa.String(16), nullable=False),
        sa.Column("quality", sa.String(40), nullable=False),
        sa.Column("limit", sa.Float()),
        sa.Column("person_id", sa.Integer(), nullable=False),
        sa.Column("person", sa.String(64), nullable=False),
        sa.Column("roles", sa.String(64), nullable=False),
        sa.Column("address", sa.String(64), nullable=False),
        sa.Column("session", sa.String(16), nullable=False),
        sa.Column("comment", sa.Text(), nullable=False),
        sa.Column("type", sa.String(64), nullable=False),
        sa.Column("text_id", sa.String(160), nullable=False),
        sa.Column("params", sa.Text(), nullable=False),
        sa.Column("text", sa.Text(), nullable=False),
        sa.Column("config", sa.String(16), nullable=False),
        sa.Column("mac", sa.String(64), nullable=False),
        sa.PrimaryKeyConstraint("seq", name="pk_alarm_journal"),
    )
    op.create_index("ix_alarm_journal_time", "alarm_journal", ["time"])
    op.create_index("ix_alarm_journal_alarm", "alarm_journal", ["alarm", "seq"])
    op.create_index("ix_alarm_journal_equipment", "alarm_journal", ["equipment", "seq"])


def downgrade() -> None:
    op.drop_table("alarm_journal")
    op.drop_table("alarm_state")
