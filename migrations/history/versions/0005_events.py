"""Every event of every ring, and a number for each machine that they name.

Machines had only a name and a lasting id; their events say the number, so that one that is renamed keeps millions of rows as they are.
"""

import sqlalchemy as sa
from alembic import op

revision = "0005"
down_revision = "0004"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.rename_table("event_machine", "event_machine_before")
    op.create_table(
        "event_machine",
        sa.Column("id", sa.Integer, nullable=False),
        sa.Column("lasting_id", sa.String, nullable=False),
        sa.Column("name", sa.String, nullable=False),
        sa.PrimaryKeyConstraint("id", name="pk_event_machine"),
        sa.UniqueConstraint("lasting_id", name="uq_event_machine_lasting_id"),
    )
    op.execute(
        "INSERT INTO event_machine (lasting_id, name) SELECT lasting_id, name FROM event_machine_before ORDER BY lasting_id"
    )
    op.drop_table("event_machine_before")
    op.create_table(
        "event",
        sa.Column("id", sa.Integer, nullable=False),
        sa.Column("machine", sa.Integer, nullable=False),
        sa.Column("boot", sa.Integer, nullable=False),
        sa.Column("sequence", sa.BigInteger, nullable=False),
        sa.Column("time", sa.BigInteger, nullable=False),
        sa.Column("code", sa.Integer, nullable=False),
        sa.Column("source", sa.Integer, nullable=False),
        sa.Column("value", sa.Float),
        sa.Column("words", sa.LargeBinary, nullable=False),
        sa.Column("request", sa.Integer, nullable=False),
        sa.Column("person", sa.String, nullable=False),
        sa.Column("reason", sa.String, nullable=False),
        sa.PrimaryKeyConstraint("id", name="pk_event"),
    )
    op.create_index("ix_event_machine", "event", ["machine", "time"])


def downgrade() -> None:
    op.drop_table("event")
    op.rename_table("event_machine", "event_machine_after")
    op.create_table(
        "event_machine",
        sa.Column("lasting_id", sa.String, nullable=False),
        sa.Column("name", sa.String, nullable=False),
        sa.PrimaryKeyConstraint("lasting_id", name="pk_event_machine"),
    )
    op.execute("INSERT INTO event_machine (lasting_id, name) SELECT lasting_id, name FROM event_machine_after")
    op.drop_table("event_machine_after")
