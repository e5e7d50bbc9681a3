"""Two databases, each with one writer thread: `pogon.db` (people, audit, alarms, retained) and `history.db`.

A sign-in or an alarm never waits behind a history commit, nor dies with a full history. Tables and queries live in the package that
owns the data; they hang on the `MetaData` of their database here.
"""

import asyncio
import logging
import re
import sqlite3
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar

from sqlalchemy import Connection, Engine, MetaData, create_engine, event
from sqlalchemy.exc import DatabaseError

from app import bundled
from app.errors import StorageError

if TYPE_CHECKING:
    from alembic.config import Config

log = logging.getLogger(__name__)

T = TypeVar("T")

NAMES = {"ix": "ix_%(column_0_label)s", "uq": "uq_%(table_name)s_%(column_0_name)s", "pk": "pk_%(table_name)s"}
pogon_tables = MetaData(naming_convention=NAMES)
"""Tables of `pogon.db`."""
history_tables = MetaData(naming_convention=NAMES)
"""Tables of `history.db`."""

PRAGMAS = {
    "pogon": ("synchronous=FULL",),
    # many points share few pages for long: these reach the file once per 32 MB, not with every second commit
    "history": ("synchronous=NORMAL", "wal_autocheckpoint=8000", "cache_size=-8000"),
}
READERS = 2
BUSY_TIMEOUT = 5.0
"""How long a statement waits for another process that holds the file [s]."""


class Database:
    """One database file: writes go one after the other on its own thread, reads run beside them."""

    def __init__(self, path: Path, name: Literal["pogon", "history"]) -> None:
        self.path = path
        self.name = name
        self.engine = _engine(path, PRAGMAS[name])
        self._writer = ThreadPoolExecutor(1, thread_name_prefix=f"{name}-writer")
        self._readers = ThreadPoolExecutor(READERS, thread_name_prefix=f"{name}-reader")

    def migrate(self) -> None:
        """Bring the schema to the newest revision; makes the file when it is missing.

        Raises:
            StorageError: the file cannot be opened, or is newer than this program.
        """
        try:
            if self._is_newest():
                return
            from alembic import command  # a quarter of the time of a start, and rarely needed

            self.path.parent.mkdir(parents=True, exist_ok=True)
            command.upgrade(alembic_config(self.name, f"sqlite:///{self.path}"), "head")
        except Exception as error:
            said = getattr(error, "orig", None) or error  # without SQLAlchemy's link to its manual
            raise StorageError(f"{self.path} cannot be used as the {self.name} database: {said}") from error

    def _is_newest(self) -> bool:
        """Whether the file is there and at the newest revision."""
        if not self.path.exists():
            return False
        with self.engine.connect() as connection:
            if not connection.exec_driver_sql("SELECT 1 FROM sqlite_master WHERE name = 'alembic_version'").scalar():
                return False
            found = connection.exec_driver_sql("SELECT version_num FROM alembic_version").scalars().all()
        return set(found) == _heads(self.name)

    async def write(self, work: Callable[[Connection], T]) -> T:
        """Run `work` in one transaction on the writer thread; what it returns comes back after the commit.

        Raises:
            StorageError: the database did not take it; nothing of it is kept.
        """
        return await asyncio.wrap_future(self.submit(work))

    def submit(self, work: Callable[[Connection], T]) -> Future[T]:
        """As `write`, for callers that do not wait."""
        return self._writer.submit(self._run, work)

    async def read(self, work: Callable[[Connection], T]) -> T:
        """Run `work` on a reader thread.

        Raises:
            StorageError: the database cannot be read.
        """
        return await asyncio.get_running_loop().run_in_executor(self._readers, self._run, work)

    def run(self, work: Callable[[Connection], T]) -> T:
        """As `write`, on the caller's thread: for the command line and for tests."""
        return self._run(work)

    def close(self) -> None:
        """Finish what is queued and close the file."""
        self._writer.shutdown(wait=True)
        self._readers.shutdown(wait=True)
        self.engine.dispose()

    def _run(self, work: Callable[[Connection], T]) -> T:
        try:
            with self.engine.begin() as connection:
                return work(connection)
        except (DatabaseError, sqlite3.Error, OSError) as error:
            raise StorageError(f"{self.path.name}: {getattr(error, 'orig', None) or error}") from error


def _heads(name: str) -> set[str]:
    """Revisions that no other one follows, read from the migrations without Alembic."""
    texts = [file.read_text("utf-8") for file in (bundled("migrations") / name / "versions").glob("*.py")]
    revisions = [re.search(r'^revision\b[^=]*= *"([^"]+)"', text, re.M) for text in texts]
    followed = [re.search(r'^down_revision\b[^=]*= *"([^"]+)"', text, re.M) for text in texts]
    return {found[1] for found in revisions if found} - {found[1] for found in followed if found}


def alembic_config(name: str, url: str) -> "Config":
    """Alembic's configuration for the database `name` at `url`."""
    from alembic.config import Config

    config = Config()
    config.set_main_option("script_location", str(bundled("migrations") / name))
    config.attributes["url"] = url
    config.attributes["tables"] = pogon_tables if name == "pogon" else history_tables
    return config


def _engine(path: Path, pragmas: Sequence[str]) -> Engine:
    engine = create_engine(f"sqlite:///{path}", connect_args={"timeout": BUSY_TIMEOUT, "check_same_thread": False})

    @event.listens_for(engine, "connect")
    def _connected(connection: Any, _record: Any) -> None:
        for pragma in ("journal_mode=WAL", "foreign_keys=ON", "temp_store=MEMORY", *pragmas):
            connection.execute(f"PRAGMA {pragma}")

    return engine
