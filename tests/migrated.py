"""What the migrations make, for a comparison with what the program knows."""

from pathlib import Path
from typing import Literal

from alembic import command
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from sqlalchemy import Connection, MetaData, Table

from app.db import Database, alembic_config, pogon_tables
from tests.virtual import inline


def by_migrations(file: Path, name: Literal["pogon", "history"], revision: str = "head") -> Database:
    """A new database that its migrations brought to `revision`, one by one as those of older programs are."""
    database = Database(file, name, inline)
    database._create()
    command.upgrade(alembic_config(name, f"sqlite:///{file}"), revision)
    return database


def differences(folder: Path, *tables: Table) -> list[object]:
    """Between what the migrations of `pogon.db` make and `tables`."""
    wanted = MetaData()
    for table in pogon_tables.sorted_tables:
        table.to_metadata(wanted)
    names = {table.name for table in tables}

    def compare(connection: Connection) -> list[object]:
        def ours(thing: object, name: str | None, kind: str, *_: object) -> bool:
            return kind != "table" or name in names

        context = MigrationContext.configure(connection, opts={"include_object": ours})
        return list(compare_metadata(context, wanted))

    database = by_migrations(folder / "pogon.db", "pogon")
    try:
        return database.run(compare)
    finally:
        database.close()
