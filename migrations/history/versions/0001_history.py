"""Points, samples, roll-ups per minute and hour, runs of the recorder."""

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "point",
        sa.Column("id", sa.Integer, nullable=False),
        sa.Column("lasting_id", sa.String, nullable=False),
        sa.Column("name", sa.String, nullable=False),
        sa.Column("unit", sa.String, nullable=False),
        sa.Column("kind", sa.String, nullable=False),
        sa.PrimaryKeyConstraint("id", name="pk_point"),
        sa.UniqueConstraint("lasting_id", name="uq_point_lasting_id"),
    )
    op.create_table(
        "sample",
        sa.Column("point", sa.Integer, nullable=False),
        sa.Column("t", sa.BigInteger, nullable=False),
        sa.Column("v", sa.Float),
        sa.Column("s", sa.String),
        sa.Column("q", sa.Integer, nullable=False),
        sa.PrimaryKeyConstraint("point", "t", name="pk_sample"),
        sqlite_with_rowid=False,
    )
    for name in ("minute", "hour"):
        op.create_table(
            name,
            sa.Column("point", sa.Integer, nullable=False),
            sa.Column("t", sa.BigInteger, nullable=False),
            sa.Column("low", sa.Float),
            sa.Column("high", sa.Float),
            sa.Column("first_t", sa.BigInteger, nullable=False),
            sa.Column("first", sa.Float),
            sa.Column("last_t", sa.BigInteger, nullable=False),
            sa.Column("last", sa.Float),
            sa.Column("last_q", sa.Integer, nullable=False),
            sa.Column("mean", sa.Float),
            sa.Column("good", sa.BigInteger, nullable=False),
            sa.Column("held", sa.BigInteger, nullable=False),
            sa.Column("count", sa.Integer, nullable=False),
            sa.Column("level", sa.Integer, nullable=False),
            sa.PrimaryKeyConstraint("point", "t", name=f"pk_{name}"),
            sqlite_with_rowid=False,
        )
    op.create_table(
        "run",
        sa.Column("start", sa.BigInteger, nullable=False),
        sa.Column("alive", sa.BigInteger, nullable=False),
        sa.PrimaryKeyConstraint("start", name="pk_run"),
    )
    op.create_table(
        "mark",
        sa.Column("name", sa.String, nullable=False),
        sa.Column("t", sa.BigInteger, nullable=False),
        sa.PrimaryKeyConstraint("name", name="pk_mark"),
    )
    op.create_table(
        "volume",
        sa.Column("t", sa.BigInteger, nullable=False),
        sa.Column("rows", sa.Integer, nullable=False),
        sa.Column("grown", sa.BigInteger, nullable=False),
        sa.PrimaryKeyConstraint("t", name="pk_volume"),
    )


def downgrade() -> None:
    for name in ("volume", "mark", "run", "hour", "minute", "sample", "point"):
        op.drop_table(name)
