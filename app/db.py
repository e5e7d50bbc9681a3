"""Two databases, each with one writer thread: `pogon.db` (people, audit, alarms, retained) and `history.db`.

A sign-in or an alarm never waits behind a history commit, nor dies with a full history. Tables and queries live in the package that
owns the data; they hang on the `MetaData` of their database here.
"""

import asyncio
import logging
import os
import re
import runpy
import shutil
import sqlite3
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import closing, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar

from sqlalchemy import Connection, Engine, MetaData, create_engine, event
from sqlalchemy.exc import DatabaseError
from sqlalchemy.pool import QueuePool

from app import bundled, chance
from app.db_file import Incident, Loss, Mended, OpenFile, starts_well
from app.errors import StorageError
from app.threads import Threads, Turns, threads
from app.trouble import Trouble

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
    # many points share few pages for long: these reach the file by `checkpoint`, or once per 32 MB, not with every second commit
    "history": ("synchronous=NORMAL", "wal_autocheckpoint=32000", "cache_size=-8000"),
}
PAGE_SIZE = {"pogon": 4096, "history": 1024}
"""Of a new file [bytes]. A commit writes every page that it touches as a whole, and samples lie by point: two rows a second on each of a
thousand points touch a thousand pages."""
READERS = 2
LONG_READERS = 2
"""For what may take seconds: every request waits for its session to be read, a Stop too."""
BUSY_TIMEOUT = 5.0
"""How long a statement waits for another process that holds the file [s]."""
MENDING_TIMEOUT = 10.0
"""How long a lost file waits for those who read it, and they for it to be mended [s]."""


class HeldFile(ABC):
    """The file of a database, held open so that it can be mended when it is lost. Nobody else uses it meanwhile."""

    def __init__(self, path: Path, name: Literal["pogon", "history"], engine: Engine) -> None:
        self.path = path
        self.name = name
        self.engine = engine
        self._file: OpenFile | None = None
        self._held: sqlite3.Connection | None = None
        self._anchor: sqlite3.Connection | None = None
        """May only read: who closes it last leaves the journal as it lies."""

    @property
    def id(self) -> int:
        """What tells this database from any other, also after it was moved or copied; 0 = not open."""
        return self._file.id if self._file else 0

    @abstractmethod
    def migrate(self) -> None:
        """Bring the schema to the newest revision; makes the file when it is missing.

        Raises:
            StorageError: the file cannot be opened, or is newer than this program.
        """

    def _mended(self, loss: Loss) -> tuple[Mended, str]:
        mine = self.name == "pogon"
        if self._file is None and not mine and loss in (Loss.OVERWRITTEN, Loss.TRUNCATED):
            return self._taken_over()  # found so when it was to be opened
        if self._file is None:  # an attempt before came no further
            self.migrate()
            return (Mended.RESTORED if mine else Mended.FRESH), ""
        match loss:
            case Loss.JOURNAL:
                assert self._held is not None
                self._held.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchall()
                self._let_go()
                self.migrate()
                return Mended.RESTORED, ""
            case Loss.JOURNAL_DAMAGED:
                return self._salvaged()
            case Loss.REMOVED:
                return self._restored("")
            case Loss.REPLACED if mine:
                return self._restored(self._put_aside("other"))
            case _ if mine:  # its pages are gone: nothing to write it anew from
                raise StorageError(f"{self.path}: {loss}")
            case Loss.REPLACED:
                return self._adopted()
            case _:
                return self._begun_anew()

    def _salvaged(self) -> tuple[Mended, str]:
        """Open the file anew with what is whole of its journal; the index is built anew from that."""
        assert self._file is not None
        journal = self._file.journal.salvage()
        self._let_go(checkpoint=False)
        for path in self._journals():
            if path.name.endswith("-shm") or not journal.usable:
                path.unlink()
        self.migrate()
        if journal.doubtful and not self._is_sound():
            log.error("database damaged file=%s: a checkpoint was not through when its journal was lost", self.path)
            if self.name == "history":
                self._let_go()
                aside = self._put_aside("damaged")
                self.migrate()
                return Mended.FRESH, aside
        return (Mended.SHORTENED if journal.lost else Mended.RESTORED), ""

    def _is_sound(self) -> bool:
        assert self._held is not None
        try:
            return bool(self._held.execute("PRAGMA quick_check(1)").fetchone() == ("ok",))
        except sqlite3.DatabaseError:
            return False

    def _restored(self, aside: str) -> tuple[Mended, str]:
        """Write the file anew from the one that is still open; complete under its name before the old one is let go."""
        assert self._held is not None
        spare = self.path.with_name(f"{self.path.name}.rescued")
        spare.unlink(missing_ok=True)
        spare.touch(0o600)
        with closing(sqlite3.connect(spare)) as new:
            self._held.backup(new)
        with spare.open("rb") as file:
            os.fsync(file.fileno())
        spare.replace(self.path)
        self._let_go()
        self.migrate()
        return Mended.RESTORED, aside

    def _adopted(self) -> tuple[Mended, str]:
        """Use the file that was put in place of ours, together with its own journal when it has one."""
        assert self._file is not None
        theirs = self._file.journals(foreign=True)
        for journal in theirs:
            journal.replace(journal.with_name(f"{journal.name}.theirs"))
        self._let_go()
        self._remove_journals()
        for journal in theirs:
            journal.with_name(f"{journal.name}.theirs").replace(journal)
        return self._taken_over()

    def _begun_anew(self) -> tuple[Mended, str]:
        """The file was written over: keep what is there now, before closing ours writes into it once more."""
        spare = self.path.with_name(f"{self.path.name}.found")
        shutil.copyfile(self.path, spare)
        self._let_go()
        self._remove_journals()
        spare.replace(self.path)
        return self._taken_over()

    def _taken_over(self) -> tuple[Mended, str]:
        """Use what lies under the name if it is a database of ours, else put it aside and begin a new one."""
        if self.path.stat().st_size:
            try:
                self.migrate()
                if self._file is not None and self._file.whole:
                    return Mended.ADOPTED, ""
                log.error("database cut short file=%s", self.path)
            except StorageError as error:
                log.error("%s", error)
            self._let_go()
        aside = self._put_aside("damaged") if self.path.stat().st_size else ""
        self._remove_journals()
        self.path.unlink(missing_ok=True)
        self.migrate()
        return Mended.FRESH, aside

    def _put_aside(self, why: str) -> str:
        """Give the file under our name another one, and its own journal too; returns it."""
        number = 1
        while (aside := self.path.with_name(f"{self.path.name}.{why}-{number}")).exists():
            number += 1
        for journal in self._file.journals(foreign=True) if self._file else self._journals():
            journal.replace(aside.with_name(journal.name.replace(self.path.name, aside.name)))
        self.path.replace(aside)
        return aside.name

    def _remove_journals(self) -> None:
        for journal in self._journals():
            journal.unlink()

    def _journals(self) -> list[Path]:
        names = (self.path.with_name(self.path.name + tail) for tail in ("-wal", "-shm"))
        return [name for name in names if name.exists()]

    def _create(self) -> None:
        """Make the file when there is none, with pages of our size and an id."""
        if self.path.exists() and self.path.stat().st_size:
            return
        with closing(sqlite3.connect(self.path)) as connection:
            connection.execute(f"PRAGMA page_size={PAGE_SIZE[self.name]}")
            connection.execute(f"PRAGMA application_id={_new_id()}")

    def _hold(self) -> None:
        """Keep a connection of our own: through it a file that was removed can still be read."""
        if self._held is not None:
            return
        connection = _connect(self.path)
        with closed_if_refused(connection):
            connection.execute("PRAGMA journal_mode=WAL").fetchall()
            if not connection.execute("PRAGMA application_id").fetchone()[0]:  # made by an earlier version
                connection.execute(f"PRAGMA application_id={_new_id()}")
                connection.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchall()
            connection.execute("SELECT count(*) FROM sqlite_master").fetchall()
        anchor = open_to_read(self.path)
        with closed_if_refused(anchor):
            anchor.execute("SELECT count(*) FROM sqlite_master").fetchall()
        self._held, self._anchor, self._file = connection, anchor, OpenFile(self.path)

    def _let_go(self, *, checkpoint: bool = True) -> None:
        """Close every connection, then what watches the file.

        The last one to be closed carries the journal into the file and removes it, unless it may only read.
        """
        self.engine.dispose()
        for connection in (self._anchor, self._held) if checkpoint else (self._held, self._anchor):
            if connection is not None:
                connection.close()
        if self._file is not None:
            self._file.close()
        self._held = self._anchor = self._file = None


class Database(HeldFile):
    """One database file: writes go one after the other on its own thread, reads run beside them."""

    def __init__(
        self, path: Path, name: Literal["pogon", "history"], threads: Threads = threads, *, only_read: bool = False
    ) -> None:
        """`only_read`: also in a folder that cannot be written to, such as a copy on a medium that is read only."""
        as_it_lies = only_read and not os.access(path.absolute().parent, os.W_OK)
        super().__init__(path, name, _engine(path, PRAGMAS[name], open_to_read if as_it_lies else _connect))
        self.writer = Turns(threads(1, f"{name}-writer"))
        self._readers = threads(READERS, f"{name}-reader")
        self._long_readers = threads(LONG_READERS, f"{name}-long-reader")
        self._lost: Loss | None = None
        self._trouble = Trouble()
        self._incidents: list[Incident] = []
        """What was mended before something was written, and `check` has not told."""
        self._checkpointing = False
        self._using = 0
        self._turn = threading.Condition()
        self._mender: int | None = None
        self.edition = 0
        """Counts up when what is stored is not any more what was written: another file, or an older state of it."""

    def migrate(self) -> None:
        """Bring the schema to the newest revision; makes the file when it is missing.

        Raises:
            StorageError: the file cannot be opened, or is newer than this program.
        """
        try:
            if self._file is None and self.path.exists() and self.path.stat().st_size and not starts_well(self.path):
                raise _rubbish()  # before SQLite sees it, which removes a journal beside it that is none of its own
            if not self._is_newest():
                self.path.parent.mkdir(parents=True, exist_ok=True)
                self._create()
                if not _fill(self.path, self.name):
                    from alembic import command  # takes time and 12 MB for good, and is rarely needed

                    command.upgrade(alembic_config(self.name, f"sqlite:///{self.path}"), "head")
            self._hold()
        except Exception as error:
            if self.name == "history" and self._file is None and _is_rubbish(error):
                self._lost = Loss.TRUNCATED if starts_well(self.path) else Loss.OVERWRITTEN
            said = getattr(error, "orig", None) or error  # without SQLAlchemy's link to its manual
            raise StorageError(f"{self.path} cannot be used as the {self.name} database: {said}") from error

    def is_newest(self) -> bool:
        """Whether the file can be read and is at the newest revision; makes none."""
        try:
            return self._is_newest()
        except (DatabaseError, OSError):
            return False

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
        return self.writer.submit(self._write, work)

    async def read(self, work: Callable[[Connection], T]) -> T:
        """Run `work` on a reader thread, twice when its journal was damaged meanwhile.

        Raises:
            StorageError: the database cannot be read.
        """
        return await asyncio.get_running_loop().run_in_executor(self._readers, self._read, work)

    async def read_long(self, work: Callable[[Connection], T]) -> T:
        """As `read`, for a `work` that reads much of a table, once: nobody whose `read` is short waits for it."""
        return await asyncio.get_running_loop().run_in_executor(self._long_readers, self._run, work)

    def run(self, work: Callable[[Connection], T]) -> T:
        """As `write`, on the caller's thread: for the command line and for tests."""
        return self._run(work)

    def close(self, *, checkpoint: bool = True) -> None:
        """Finish what is queued and close the file; without a `checkpoint` the next start finds the journal beside it."""
        self.writer.shutdown(wait=True)
        self._readers.shutdown(wait=True)
        self._long_readers.shutdown(wait=True)
        self._let_go(checkpoint=checkpoint)

    def _run(self, work: Callable[[Connection], T]) -> T:
        if self._file is None and self._lost is not None:
            raise StorageError(f"{self.path.name}: the file is lost, {self._lost}")
        try:
            with self._in_use(), self.engine.begin() as connection:
                before = self._bus_errors
                result = work(connection)
                if self._bus_errors != before:  # what it read may be from before what the journal holds
                    raise OSError("the index of its journal was cut meanwhile")
                return result
        except (DatabaseError, sqlite3.Error, OSError) as error:
            raise StorageError(f"{self.path.name}: {getattr(error, 'orig', None) or error}") from error

    def _write(self, work: Callable[[Connection], T]) -> T:
        self._mend_journal()  # or it would go on behind the damage
        return self._run(work)

    def _read(self, work: Callable[[Connection], T]) -> T:
        try:
            return self._run(work)
        except StorageError:
            if self._file is None or not self._file.journal.damaged():
                raise
        try:
            self.writer.submit(self._mend_journal).result(MENDING_TIMEOUT)
        except TimeoutError as error:
            raise StorageError(f"{self.path.name}: its journal is damaged, and it is being written") from error
        return self._run(work)

    def _mend_journal(self) -> None:
        if self._file is None or not self._file.journal.damaged():
            return
        incident = self._mend()
        if incident is not None and incident.mended is Mended.NOTHING:
            raise StorageError(f"{self.path.name}: {incident.reason}")
        self._incidents += [incident] if incident else []

    @property
    def _bus_errors(self) -> int:
        return self._file.journal.bus_errors if self._file else 0

    def checkpoint(self) -> None:
        """Have what the journal holds carried into the file, behind what is to be written: a journal that is lost takes only the rest."""
        if not self._checkpointing:
            self._checkpointing = True
            self.writer.submit(self._checkpoint)

    def _checkpoint(self) -> None:
        self._checkpointing = False
        if self._file is None or self._held is None or self._file.look() is not None:
            return  # what is damaged would be carried into the file
        try:
            with self._in_use():
                self._held.execute("PRAGMA wal_checkpoint(PASSIVE)").fetchall()
        except (sqlite3.Error, OSError) as error:
            log.warning("no checkpoint file=%s reason=%s", self.path.name, error)

    # ---- the file is lost -----------------------------------------------------------------------------

    async def check(self) -> Incident | None:
        """Whether the file is still the one that was opened; one that is lost is mended as far as that goes. None: all is well.

        A file that was removed, or whose journal was, is written anew from what is open, so nothing of it is lost. Another history is
        used from then on, a damaged one put aside and a new one begun; another `pogon.db` is put aside: people, sessions and the audit
        are those of the running server. Of a journal that was cut or written over, what is whole is kept. What cannot be mended is told at
        every call, and tried again.
        """
        if self._incidents:
            return self._incidents.pop(0)
        if await asyncio.to_thread(self._look) is None:
            return None
        return await asyncio.wrap_future(self.writer.submit(self._mend))

    def _look(self) -> Loss | None:
        if self._file is None:
            return self._lost
        try:
            found = self._file.look()
        except OSError as error:
            if self._trouble.is_news(reason := error.strerror or str(error)):
                log.error("database not found file=%s reason=%s", self.path, reason)
            return Loss.REMOVED
        self._trouble.is_over()
        return found

    def _mend(self) -> Incident | None:
        loss = self._look()
        if loss is None:
            return None
        try:
            with self._alone():
                mended, aside = self._mended(loss)
        except (OSError, sqlite3.Error, DatabaseError, StorageError) as error:
            self._lost = loss
            return Incident(self.path.name, loss, Mended.NOTHING, reason=str(error))
        self._lost = None
        self.edition += mended is not Mended.RESTORED
        return Incident(self.path.name, loss, mended, aside)

    @contextmanager
    def _in_use(self) -> Iterator[None]:
        """Nobody mends the file meanwhile."""
        me = threading.get_ident()
        with self._turn:
            if not self._turn.wait_for(lambda: self._mender in (None, me), MENDING_TIMEOUT):
                raise OSError("the file was lost and is being mended")
            self._using += 1
        try:
            yield
        finally:
            with self._turn:
                self._using -= 1
                self._turn.notify_all()

    @contextmanager
    def _alone(self) -> Iterator[None]:
        """Nobody else uses the file meanwhile."""
        with self._turn:
            self._mender = threading.get_ident()
            alone = self._turn.wait_for(lambda: not self._using, MENDING_TIMEOUT)
        try:
            if not alone:
                raise OSError("it is being read")
            yield
        finally:
            with self._turn:
                self._mender = None
                self._turn.notify_all()


def _is_rubbish(error: BaseException) -> bool:
    """Whether SQLite says of a file that it is none of its own, or damaged; a full disk or another program is no such thing."""
    said = getattr(error, "orig", None) or error
    code = getattr(said, "sqlite_errorcode", 0) & 0xFF
    return code in (sqlite3.SQLITE_NOTADB, sqlite3.SQLITE_CORRUPT)


def _rubbish() -> sqlite3.DatabaseError:
    """What SQLite raises for a file that is not one of its own."""
    error = sqlite3.DatabaseError("file is not a database")
    error.sqlite_errorcode = sqlite3.SQLITE_NOTADB
    return error


@contextmanager
def closed_if_refused(connection: sqlite3.Connection) -> Iterator[None]:
    """A connection that its first statements fail on is closed at once.

    Closed any later it removes the journal that lies under the name by then: that of the file which took this one's place.
    """
    try:
        yield
    except BaseException:
        connection.close()
        raise


def _new_id() -> int:
    return chance.randrange(1, 2**31)


def _connect(path: Path) -> sqlite3.Connection:
    """A connection to a file that is there: SQLite by itself would make an empty one."""
    return sqlite3.connect(
        f"{path.absolute().as_uri()}?mode=rw", uri=True, timeout=BUSY_TIMEOUT, check_same_thread=False
    )


def open_to_read(path: Path) -> sqlite3.Connection:
    """A connection to the database at `path`, whatever its folder is called, that makes and changes nothing.

    SQLite reads ours only where it may put a journal beside it; a copy in a folder that cannot be written to is read as it lies there,
    when no journal lies beside it.

    Raises:
        sqlite3.OperationalError: it is not there, or cannot be opened.
    """
    whole, beside = path.absolute(), [path.with_name(path.name + tail).exists() for tail in ("-wal", "-shm")]
    as_it_lies = ""
    if path.exists() and not os.access(whole.parent, os.W_OK):
        if beside == [True, False]:
            raise sqlite3.OperationalError(
                f"its newest rows are in {path.name}-wal, and {whole.parent} cannot be written to: copy both to a folder that can"
            )
        as_it_lies = "" if any(beside) else "&immutable=1"
    # readers of a pool give connections to one another
    uri = f"{whole.as_uri()}?mode=ro{as_it_lies}"
    return sqlite3.connect(uri, uri=True, timeout=BUSY_TIMEOUT, check_same_thread=False)


def _heads(name: str) -> set[str]:
    """Revisions that no other one follows, read from the migrations without Alembic."""
    texts = [file.read_text("utf-8") for file in (bundled("migrations") / name / "versions").glob("*.py")]
    revisions = [re.search(r'^revision\b[^=]*= *"([^"]+)"', text, re.M) for text in texts]
    followed = [re.search(r'^down_revision\b[^=]*= *"([^"]+)"', text, re.M) for text in texts]
    return {found[1] for found in revisions if found} - {found[1] for found in followed if found}


@contextmanager
def in_one(url: str) -> Iterator[Connection]:
    """A connection whose statements happen together or not at all, those that make tables, too: for migrations.

    Killed in the middle it leaves the schema as it was, and the next start begins anew. The driver by itself commits every such statement
    at once, and a table that is there already could not be made again.
    """
    engine = create_engine(url)
    try:
        with engine.begin() as connection:
            driver = connection.connection.dbapi_connection
            assert isinstance(driver, sqlite3.Connection)
            driver.isolation_level = None
            connection.exec_driver_sql("BEGIN IMMEDIATE")
            yield connection
    finally:
        engine.dispose()


def _fill(path: Path, name: str) -> bool:
    """Make all tables of the newest revision at once, if the file has none; tests compare them with what the migrations make."""
    runpy.run_path(str(bundled("migrations") / name / "tables.py"))
    with in_one(f"sqlite:///{path}") as connection:
        if connection.exec_driver_sql("SELECT count(*) FROM sqlite_master").scalar():
            return False
        (pogon_tables if name == "pogon" else history_tables).create_all(connection)
        connection.exec_driver_sql(
            "CREATE TABLE alembic_version (version_num VARCHAR(32) NOT NULL, CONSTRAINT alembic_version_pkc PRIMARY KEY (version_num))"
        )
        for revision in _heads(name):
            connection.exec_driver_sql("INSERT INTO alembic_version (version_num) VALUES (?)", (revision,))
    return True


def alembic_config(name: str, url: str) -> "Config":
    """Alembic's configuration for the database `name` at `url`."""
    from alembic.config import Config

    config = Config()
    config.set_main_option("script_location", str(bundled("migrations") / name))
    config.attributes["url"] = url
    return config


def _engine(path: Path, pragmas: Sequence[str], connect: Callable[[Path], sqlite3.Connection]) -> Engine:
    engine = create_engine("sqlite://", creator=lambda: connect(path), poolclass=QueuePool)

    @event.listens_for(engine, "connect")
    def _connected(connection: Any, _record: Any) -> None:
        with closed_if_refused(connection):
            for pragma in ("journal_mode=WAL", "foreign_keys=ON", "temp_store=MEMORY", *pragmas):
                connection.execute(f"PRAGMA {pragma}")

    return engine
