"""What engineers change in sequences before it is taken, and what was taken."""

import sqlalchemy as sa
from alembic import op

revision = "0011"
down_revision = "0010"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "sequence_draft",
        sa.Column("sequence", sa.String(32), nullable=False),
        sa.Column("person", sa.Integer(), sa.ForeignKey("person.id", ondelete="CASCADE"), nullable=False),
        sa.Column("text", sa.Text(), nullable=False),
        sa.Column("base", sa.Text(), nullable=False),
        sa.Column("version", sa.Integer(), nullable=False),
        sa.Column("tab", sa.String(32), nullable=False),
        sa.Column("changed", sa.BigInteger(), nullable=False),
        sa.PrimaryKeyConstraint("sequence", "person", name="pk_sequence_draft"),
    )
    op.create_table(
        "sequence_revision",
        sa.Column("sequence", sa.String(32), nullable=False),
        sa.Column("number", sa.Integer(), nullable=False),
        sa.Column("text", sa.Text(), nullable=False),
        sa.Column("taken", sa.BigInteger(), nullable=False),
        sa.Column("person", sa.String(80), nullable=False),
        sa.Column("reason", sa.String(400), nullable=False),
        sa.Column("returned_to", sa.Integer(), nullable=False),
        sa.PrimaryKeyConstraint("sequence", "number", name="pk_sequence_revision"),
    )


def downgrade() -> None:
    op.drop_table("sequence_revision")
    op.drop_table("sequence_draft")
