"""What the migrations of `pogon.db` make, compared with what the program knows."""

from pathlib import Path

from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from sqlalchemy import Connection, MetaData, Table

from app.db import Database, pogon_tables
from tests.virtual import inline


def differences(folder: Path, *tables: Table) -> list[object]:
    """Between a fresh database and `tables`."""
    wanted = MetaData()
    for table in pogon_tables.sorted_tables:
        table.to_metadata(wanted)
    names = {table.name for table in tables}

    def compare(connection: Connection) -> list[object]:
        def ours(thing: object, name: str | None, kind: str, *_: object) -> bool:
            return kind != "table" or name in names

        context = MigrationContext.configure(connection, opts={"include_object": ours})
        return list(compare_metadata(context, wanted))

    database = Database(folder / "pogon.db", "pogon", inline)
    database.migrate()
    try:
        return database.run(compare)
    finally:
        database.close()
