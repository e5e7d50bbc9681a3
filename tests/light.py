"""What makes a house cheap in a process of tests and is no test's subject: hashes, waiting for the disk, what is read again.

For tests the fixtures in conftest.py see to it; a process without pytest says `with light():`.
"""

import os
import sqlite3
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Literal

import pytest

from app import db
from app.access import passwords
from app.access.passwords import Cost
from app.db import Database
from app.plant import types
from app.plant.problems import Problem
from tests.virtual import inline

CHEAP = Cost(passes=1, memory=64, lanes=1)
"""A thousandth of what a hash of the product costs: for tests that are not about the cost."""
NAMES: tuple[Literal["pogon", "history"], ...] = ("pogon", "history")
"""The databases."""
EQUIPMENT = types.EQUIPMENT
"""Where the product's own types are, whatever a test puts in its place."""


@contextmanager
def light() -> Iterator[None]:
    """Inside, this process is light; other processes are as they are."""
    with pytest.MonkeyPatch.context() as patch:
        _wait_for_nothing(patch)
        patch.setattr(Database, "migrate", _copying())
        patch.setattr(types, "read_type", read_once)
        yield


def _wait_for_nothing(patch: pytest.MonkeyPatch) -> None:
    """A hash is cheap, and what a database writes need not outlive the machine."""
    connect = db._connect

    def without_waiting(path: Path) -> sqlite3.Connection:
        connection = connect(path)
        with db.closed_if_refused(connection):
            connection.execute("PRAGMA synchronous=OFF")
        return connection

    patch.setattr(db, "_connect", without_waiting)
    for name, pragmas in db.PRAGMAS.items():
        patch.setitem(db.PRAGMAS, name, tuple(text for text in pragmas if not text.startswith("synchronous")))
    patch.setattr(os, "fsync", lambda _file: None)
    patch.setattr(passwords, "Cost", lambda: CHEAP)


def _copying() -> Callable[[Database], None]:
    """Of each database one is migrated; every new one of this process begins as its copy, with an id of its own."""
    migrate = Database.migrate
    templates: dict[str, bytes] = {}
    with tempfile.TemporaryDirectory(prefix="light-") as folder:
        for name in NAMES:
            database = Database(Path(folder) / f"{name}.db", name, inline)
            database.migrate()
            database.close()
            templates[name] = database.path.read_bytes()

    def copy(database: Database) -> None:
        if database.path.parent.is_dir() and (not database.path.exists() or not database.path.stat().st_size):
            file = bytearray(templates[database.name])
            file[68:72] = db._new_id().to_bytes(4, "big")  # application_id: sqlite.org/fileformat.html, 1.3
            with suppress(OSError):
                database.path.write_bytes(file)
        migrate(database)

    return copy


_read_type = types.read_type
_types: dict[tuple[object, ...], tuple[types.TypeData, list[Problem]]] = {}


def read_once(
    name: str,
    languages: Sequence[str],
    folder: Path = EQUIPMENT,
    *,
    spoken: Sequence[str] | None = None,
    given: Mapping[str, float] | None = None,
) -> tuple[types.TypeData, list[Problem]]:
    """In place of `types.read_type`: the product's own types are read once per process, types in folders of tests each time."""
    if folder != EQUIPMENT:
        return _read_type(name, languages, folder, spoken=spoken, given=given)
    asked = (name, tuple(languages), spoken if spoken is None else tuple(spoken), frozenset((given or {}).items()))
    if asked not in _types:
        _types[asked] = _read_type(name, languages, folder, spoken=spoken, given=given)
    data, problems = _types[asked]
    return data, [*problems]
