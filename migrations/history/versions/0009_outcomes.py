"""Records are found by how they ended."""

from alembic import op

revision = "0009"
down_revision = "0008"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_index("ix_record_outcome", "record", ["kind", "outcome", "begun"])


def downgrade() -> None:
    op.drop_index("ix_record_outcome", "record")
