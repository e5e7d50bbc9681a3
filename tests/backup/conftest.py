"""Fixtures that these tests share."""

import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from app.access.access import prepare
from app.access.roles import SYSTEM
from app.backup import BACKUP_KEY
from app.db import Database
from app.historian import store
from tests.backup.shelf import BEGIN, KEY, _access
from tests.historian.conftest import point
from tests.virtual import inline


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """The data folder of a plant with two people, a session, an audit and some history."""
    folder = tmp_path / "data"
    prepare(folder)
    with _access(folder) as access:
        access.people.add_now(SYSTEM, [("ana", "Ana", ("operator",)), ("ivo", "Ivo", ("engineer",))])
    with closing(sqlite3.connect(folder / "pogon.db")) as connection, connection:
        connection.execute("INSERT INTO session VALUES ('5ec2e7', 1, 1, 1, 1, 'here', 'me')")
    connection.close()
    history = Database(folder / "history.db", "history", inline)
    history.migrate()
    history.run(lambda c: store.register(c, [point()]))
    history.run(lambda c: store.append(c, [(1, BEGIN + i, float(i), None, 0) for i in range(500)], BEGIN, BEGIN))
    history.close()
    (folder / BACKUP_KEY).write_text(KEY.hex() + "\n")
    (folder / BACKUP_KEY).chmod(0o600)
    return folder


@pytest.fixture
def plant(tmp_path: Path) -> Path:
    folder = tmp_path / "plant"
    (folder / "extra").mkdir(parents=True)
    (folder / "plant.toml").write_text('[links.hall]\ntransport = "tcp"\nwrites = true  # since March\n')
    (folder / "extra" / "note.txt").write_text("x")
    (folder / ".secret").write_text("x")
    (folder / "link").symlink_to("/etc/passwd")
    return folder
