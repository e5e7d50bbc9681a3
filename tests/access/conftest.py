"""People in a fresh data folder, with hashes that cost little."""

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from app.access.access import Access, prepare
from app.access.passwords import Cost
from app.access.roles import Person, permissions_of
from app.clock import ManualClock
from app.db import Database
from tests.virtual import inline

CHEAP = Cost(passes=1, memory=64, lanes=1)
"""For tests that are not about the cost: 1000 times cheaper."""
PASSWORD = "tri plave ladice u kutu"
AGENT = "Mozilla/5.0 (X11; Linux x86_64) Firefox/140.0"
OpenAccess = Callable[..., Access]


@pytest.fixture(scope="session")
def empty_database(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A `pogon.db` with all its tables, made once."""
    folder = tmp_path_factory.mktemp("empty")
    db = Database(folder / "pogon.db", "pogon", inline)
    db.migrate()
    db.close()
    return folder / "pogon.db"


@pytest.fixture
def clock() -> ManualClock:
    return ManualClock()


@pytest.fixture
def data(tmp_path: Path, empty_database: Path) -> Path:
    """A data folder as after the first migration."""
    folder = tmp_path / "data"
    prepare(folder)
    shutil.copyfile(empty_database, folder / "pogon.db")
    return folder


@pytest.fixture
def open_access(data: Path, clock: ManualClock) -> Iterator[OpenAccess]:
    """`open_access()` is what a server opens; called twice it is a server after a restart, or one beside it."""
    opened: list[tuple[Access, Database]] = []

    def make(folder: Path = data, cost: Cost = CHEAP) -> Access:
        db = Database(folder / "pogon.db", "pogon", inline)
        access = Access(db, clock, folder, cost, threads=inline)
        opened.append((access, db))
        return access

    yield make
    for access, db in opened:
        access.close()
        db.close()


@pytest.fixture
def access(open_access: OpenAccess) -> Access:
    return open_access()


def boss(name: str = "ana") -> Person:
    """Somebody with every right, who has no account."""
    roles = frozenset({"admin", "engineer", "operator"})
    return Person(0, name, name, roles, permissions_of(roles), "", address="10.0.0.1")


async def add(access: Access, name: str, *roles: str, password: str = PASSWORD) -> int:
    """An account with a password of its own."""
    account, _ = await access.people.add(boss(), name, "", roles or ("operator",))
    access.people.set_password_now(boss(), name, password)
    return account.id


async def enter(access: Access, name: str, password: str = PASSWORD, address: str = "10.0.0.9", old: str = "") -> str:
    """Sign in; returns the session id."""
    return (await access.sign_in.with_password(name, password, address, AGENT, old)).sid


async def who(access: Access, sid: str, address: str = "10.0.0.9", agent: str = AGENT) -> Person | None:
    """Whoever holds the session id."""
    return await access.sessions.find(sid, address, agent)
