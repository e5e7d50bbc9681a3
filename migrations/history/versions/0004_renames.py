"""The name under which the rows of a machine are, by its lasting id."""

import sqlalchemy as sa
from alembic import op

revision = "0004"
down_revision = "0003"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "event_machine",
        sa.Column("lasting_id", sa.String, nullable=False),
        sa.Column("name", sa.String, nullable=False),
        sa.PrimaryKeyConstraint("lasting_id", name="pk_event_machine"),
    )


def downgrade() -> None:
    op.drop_table("event_machine")
