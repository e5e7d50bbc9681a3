"""An alarm that was put aside keeps by whom, why and until when."""

import sqlalchemy as sa
from alembic import op

revision = "0006"
down_revision = "0005"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("alarm_state", sa.Column("hiding", sa.Text(), nullable=False, server_default="{}"))


def downgrade() -> None:
    op.drop_column("alarm_state", "hiding")
