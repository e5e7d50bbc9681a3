"""A restore that is killed, or whose disk is full, at each of its steps in turn: a process of its own that forks once per step.

    python -m tests.restore_kills kill|full ARCHIVE OLD_DATA FOLDER      → one line of JSON

The steps are what the interpreter tells of renames, removals, folders and files opened for writing (audit hooks).
"""

import errno
import json
import os
import shutil
import sqlite3
import sys
from contextlib import closing
from pathlib import Path
from typing import Any

from app.access.access import prepare
from app.access.restoring import JOURNAL
from app.backup import Opening, restore
from app.errors import ConfigurationError

STEPS = ("os.rename", "os.remove", "os.mkdir", "os.rmdir", "os.chmod", "shutil.copyfile", "sqlite3.connect")
NEEDS_ROOM = ("os.mkdir", "shutil.copyfile", "sqlite3.connect")
WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT
KEY = bytes(range(32))


class Fault:
    """Ends the process at step `at`, or from there on lets nothing be written."""

    def __init__(self, kind: str, at: int) -> None:
        self.kind = kind
        self.at = at
        self.step = 0

    def __call__(self, event: str, arguments: tuple[Any, ...]) -> None:
        writes = event == "open" and isinstance(arguments[2], int) and bool(arguments[2] & WRITING)
        if not writes and event not in STEPS:
            return
        self.step += 1
        if self.step < self.at:
            return
        if self.kind == "kill":
            os._exit(9)
        if writes or event in NEEDS_ROOM:
            raise OSError(errno.ENOSPC, "No space left on device")


def state(data: Path, place: Path) -> list[Any]:
    """What counts of a data folder and its plant."""
    found: list[Any] = []
    for name, table in (("pogon.db", "person"), ("history.db", "sample")):
        with closing(sqlite3.connect(f"file:{data / name}?mode=ro", uri=True)) as connection:
            found.append(connection.execute(f"SELECT count(*) FROM {table}").fetchone()[0])
    for name in ("audit.head", "audit.buffer"):
        found.append((data / name).read_text() if (data / name).exists() else None)
    found.append(sorted(str(path.relative_to(place)) for path in place.rglob("*")) if place.exists() else [])
    return found


def left(folder: Path) -> list[str]:
    """What an interrupted restore must not leave once the next start has been."""
    names = [path.name for path in folder.rglob("*")]
    return sorted(name for name in names if name.startswith((".restore", ".pogon")) or name == JOURNAL)


def run(kind: str, archive: Path, old: Path, folder: Path) -> dict[str, Any]:
    states: list[Any] = []
    for step in range(100_000):
        work = folder / f"{kind}{step}"
        data, place = work / "data", work / "elsewhere" / "plant"
        shutil.copytree(old, data)
        before = state(data, place)
        child = os.fork()
        if not child:
            code = 1
            try:
                sys.addaudithook(Fault(kind, step))
                restore(archive, data, place, opening=Opening(KEY))
                code = 0
            except ConfigurationError:
                code = 2
            finally:
                os._exit(code)
        code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        journal = data / JOURNAL
        ended = json.loads(journal.read_text())["state"] if journal.exists() else ""
        prepare(data)
        after = state(data, place)
        states.append([code, ended, "old" if after == before else after, left(work)])
        shutil.rmtree(work)
        if code == 0:
            break
    return {"steps": len(states), "states": states}


if __name__ == "__main__":
    print(json.dumps(run(sys.argv[1], *map(Path, sys.argv[2:]))))
