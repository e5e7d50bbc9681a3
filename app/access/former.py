"""Whether `pogon.db` is the database that this data folder has had. A plant without it is not taken for a new one.

Whoever starts as new is handed the first account: so a folder that knows of an older plant starts only with its database.
"""

import logging
import sqlite3
from contextlib import closing
from pathlib import Path

from app.access.keys import check_kinds, read_mark, write_mark
from app.access.restoring import finish_restore
from app.clock import SystemClock, to_datetime
from app.db import open_to_read
from app.errors import ConfigurationError

log = logging.getLogger(__name__)

MARKS = ("audit.head", "audit.anchors", "audit.buffer", "audit.foreign")
"""What the audit of a plant leaves beside its database."""
KNOWN = "('person.first', 'person.added', 'signin.ok')"
"""Lines that say that there was an account."""


def check_former(data: Path) -> None:
    """Refuse a folder whose plant has lost its database, or everybody in it; a history alone is no plant, but told.

    Raises:
        ConfigurationError: one line, with what to do.
    """
    what, history = _lost(data), data / "history.db"
    if not what and not (data / "pogon.db").exists() and history.exists() and history.stat().st_size:
        log.warning("a new plant begins beside a history that is there already file=%s missing=pogon.db", history)
    if what:
        raise ConfigurationError(
            f"{data / 'pogon.db'} {what}, but this folder is of a plant that had accounts: put a backup back (pogon restore), "
            "or start a new plant in it (pogon run --begin-anew)"
        )


def begin_anew(data: Path) -> Path | None:
    """Put aside what is left of a plant whose database is lost, so that a new one can start here; returns where it is now.

    Nothing happens, and None comes back, where nothing is lost: a plant that has its accounts is never put aside. The caller holds
    the lock of the folder; a restore that was interrupted is ended first.

    Raises:
        ConfigurationError: that restore cannot be ended, or a pipe or a device is among the files.
    """
    check_kinds(data)
    finish_restore(data, locked=True)
    if not _lost(data):
        return None
    place = data / f"before-{to_datetime(SystemClock().micros()):%Y%m%dT%H%M%S}"
    place.mkdir(mode=0o700, parents=True)
    for name in ("pogon.db", "pogon.db-wal", "pogon.db-shm", *MARKS):
        if (data / name).exists():
            (data / name).rename(place / name)
    if read_mark(data / "audit.key") is not None:
        write_mark(data / "audit.key", None)
    return place


def _lost(data: Path) -> str:
    """What is wrong with the database; empty when nothing is, or when there never was one."""
    began = read_mark(data / "audit.key") is not None or any((data / name).exists() for name in MARKS[:2])
    if not began:
        return ""
    path = data / "pogon.db"
    if not path.exists():
        return "is missing"
    if not path.stat().st_size:
        return "is empty"
    try:
        with closing(open_to_read(path)) as connection:
            tables = {row[0] for row in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
            if not {"person", "audit"} <= tables:
                return "has no accounts"
            if connection.execute("SELECT 1 FROM person LIMIT 1").fetchone():
                return ""
            lines = connection.execute("SELECT 1 FROM audit LIMIT 1").fetchone()
            known = connection.execute(f"SELECT 1 FROM audit WHERE kind IN {KNOWN} LIMIT 1").fetchone()
            return "has no accounts" if known or not lines else ""
    except sqlite3.Error:
        return ""  # told by who opens it
