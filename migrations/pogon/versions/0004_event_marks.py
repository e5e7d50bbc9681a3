"""How far the events of each machine were taken by the alarms."""

import sqlalchemy as sa
from alembic import op

revision = "0004"
down_revision = "0003"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "alarm_event_mark",
        sa.Column("equipment", sa.String(64), nullable=False),
        sa.Column("boot", sa.Integer(), nullable=False),
        sa.Column("sequence", sa.BigInteger(), nullable=False),
        sa.Column("time", sa.BigInteger(), nullable=False),
        sa.PrimaryKeyConstraint("equipment", name="pk_alarm_event_mark"),
    )


def downgrade() -> None:
    op.drop_table("alarm_event_mark")
