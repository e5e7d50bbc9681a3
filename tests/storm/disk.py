"""Databases on a bad disk: full, locked, failing in the middle of what they write; and a server killed inside a transaction."""

import resource
import shutil
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from random import Random
from typing import Any

from sqlalchemy import Connection, event

from app.db import Database

ALL_PAGES = 0xFFFFFFFE
"""SQLite's own limit."""
PAGE = 4096


class Disks:
    """What is wrong with the files of a server; they are its own from `watch` on."""

    def __init__(self, random: Random) -> None:
        self.random = random
        self.wrong: dict[str, tuple[str, int]] = {}
        """Which database → full, locked or failing, and how many pages it still takes."""
        self.doomed = 0
        """With the so-many-th statement or commit from now on the server is killed; 0: with none."""
        self.die: Callable[[], None] = lambda: None
        """Takes the files as they are at that moment."""
        self._locks: dict[str, sqlite3.Connection] = {}
        self._databases: dict[str, Database] = {}
        self._torn: tuple[Path, Path, int] | None = None

    def watch(self, which: str, database: Database) -> None:
        """`database` lies on this disk."""
        self._databases[which] = database
        run = database._run

        def spoilt(work: Callable[[Connection], Any]) -> Any:
            how, pages = self.wrong.get(which, ("", 0))
            if how == "full":
                return run(lambda connection: self._cramped(connection, work, pages))
            with _longest(_behind(database.path, pages)) if how == "failing" else _fine():
                return run(work)

        database._run = spoilt  # type: ignore[method-assign]

        @event.listens_for(database.engine, "before_cursor_execute")
        def before(*rest: Any) -> None:
            self._count(None)

        @event.listens_for(database.engine, "commit")
        def commit(connection: Any) -> None:
            self._count(database.path)

    def spoil(self, which: str, how: str, pages: int) -> None:
        """From now on `which` is `how`."""
        self.mend(which)
        self.wrong[which] = how, pages
        if how == "locked" and which in self._databases:
            lock = sqlite3.connect(self._databases[which].path, timeout=0, isolation_level=None)
            with suppress(sqlite3.Error):
                lock.execute("BEGIN IMMEDIATE")
            self._locks[which] = lock

    def mend(self, which: str) -> None:
        """Nothing is wrong with `which` any more."""
        self.wrong.pop(which, None)
        if lock := self._locks.pop(which, None):
            lock.close()

    def mend_all(self) -> None:
        """Nothing is wrong any more."""
        for which in ("db", "history"):
            self.mend(which)
        self.doomed = 0

    def tear(self, data: Path, copy: Path) -> None:
        """Have `copy` be `data` as it was when the server died: a commit that it was writing is there in part."""
        with _longest(resource.getrlimit(resource.RLIMIT_FSIZE)[1]):
            shutil.copytree(data, copy, ignore=lambda _folder, names: [n for n in names if n.startswith("lock")])

    def torn(self) -> None:
        """The commit during which the server died is over for the rests of it: so much of it was written."""
        if self._torn is None:
            return
        now, then, before = self._torn
        self._torn = None
        size = now.stat().st_size if now.exists() else 0
        if size > before and then.exists():
            with now.open("rb") as wal, then.open("r+b") as copy:
                wal.seek(before)
                copy.seek(before)
                copy.write(wal.read(self.random.randrange(size - before + 1)))

    def _count(self, commits: Path | None) -> None:
        self.torn()
        if self.doomed <= 0:
            return
        self.doomed -= 1
        if self.doomed == 0:
            self.die()
            if commits is not None:
                wal = commits.with_name(f"{commits.name}-wal")
                copy = self.copy / wal.name
                self._torn = wal, copy, wal.stat().st_size if wal.exists() else 0

    copy: Path = Path()
    """Where `die` puts the files."""

    def _cramped(self, connection: Connection, work: Callable[[Connection], Any], pages: int) -> Any:
        has = connection.exec_driver_sql("PRAGMA page_count").scalar() or 0
        connection.exec_driver_sql(f"PRAGMA max_page_count={has + pages}")
        try:
            return work(connection)
        finally:
            connection.exec_driver_sql(f"PRAGMA max_page_count={ALL_PAGES}")


def _behind(database: Path, pages: int) -> int:
    """Length of a file [bytes] from which on all that is written fails: in the middle of what a journal is given."""
    wal = database.with_name(f"{database.name}-wal")
    return (wal.stat().st_size if wal.exists() else 0) + pages * PAGE // 3


@contextmanager
def _longest(size: int) -> Iterator[None]:
    """No file gets longer: what lies behind is an error of the disk."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@contextmanager
def _fine() -> Iterator[None]:
    yield
