"""The databases: the newest schema is recognised without Alembic, and any other is left to it."""

import sqlite3
import subprocess
import sys
from contextlib import closing
from pathlib import Path
from typing import Literal

import pytest
from alembic.script import ScriptDirectory

from app.db import PAGE_SIZE, Database, _heads, alembic_config
from app.errors import StorageError
from tests.conftest import ROOT
from tests.virtual import inline

NAMES: tuple[Literal["pogon", "history"], ...] = ("pogon", "history")


@pytest.mark.parametrize("name", NAMES)
def test_the_newest_revision_is_the_one_that_alembic_names(name: str) -> None:
    script = ScriptDirectory.from_config(alembic_config(name, "sqlite://"))
    assert _heads(name) == set(script.get_heads())


@pytest.mark.parametrize("name", NAMES)
def test_a_file_of_the_newest_schema_is_opened_without_alembic(
    tmp_path: Path, name: Literal["pogon", "history"]
) -> None:
    file = tmp_path / f"{name}.db"
    database = Database(file, name, inline)
    database.migrate()
    database.close()
    again = (
        "import sys; from pathlib import Path; from app.db import Database; "
        f"Database(Path({str(file)!r}), {name!r}).migrate(); sys.exit('alembic' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", again], cwd=ROOT, check=False).returncode == 0


@pytest.mark.parametrize("version", [None, "9999"])
def test_an_empty_file_is_filled_and_one_of_a_newer_program_is_refused(tmp_path: Path, version: str | None) -> None:
    file = tmp_path / "history.db"
    database = Database(file, "history", inline)
    if version is None:
        file.touch()
        database.migrate()
        assert database.run(lambda connection: connection.exec_driver_sql("SELECT count(*) FROM sample").scalar()) == 0
    else:
        database.migrate()
        database.run(lambda connection: connection.exec_driver_sql("UPDATE alembic_version SET version_num = '9999'"))
        with pytest.raises(StorageError, match="9999"):
            database.migrate()
    database.close()


@pytest.mark.parametrize("name", NAMES)
def test_a_new_file_has_pages_of_its_size_and_an_older_one_goes_on_as_it_is(
    tmp_path: Path, name: Literal["pogon", "history"]
) -> None:
    for file, size in ((tmp_path / "new.db", PAGE_SIZE[name]), (tmp_path / "old.db", 8192)):
        if size == 8192:
            with closing(sqlite3.connect(file)) as connection:
                connection.execute("PRAGMA page_size=8192")
                connection.execute("PRAGMA user_version=1")
        database = Database(file, name)
        database.migrate()
        assert database.run(lambda connection: connection.exec_driver_sql("PRAGMA page_size").scalar()) == size
        assert database.id
        database.close()
