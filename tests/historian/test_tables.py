"""The tables of the history are those that its migrations make."""

from pathlib import Path

from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from sqlalchemy import Connection

from app.db import history_tables
from tests.migrated import by_migrations


def test_the_migration_makes_the_tables_that_the_program_knows(tmp_path: Path) -> None:
    def differences(connection: Connection) -> list[object]:
        return list(compare_metadata(MigrationContext.configure(connection), history_tables))

    history = by_migrations(tmp_path / "history.db", "history")
    try:
        assert history.run(differences) == []
    finally:
        history.close()
