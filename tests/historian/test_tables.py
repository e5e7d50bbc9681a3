"""The tables of the history are those that its migrations make."""

from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from sqlalchemy import Connection

from app.db import Database, history_tables


def test_the_migration_makes_the_tables_that_the_program_knows(history: Database) -> None:
    def differences(connection: Connection) -> list[object]:
        return list(compare_metadata(MigrationContext.configure(connection), history_tables))

    assert history.run(differences) == []
