"""A chain with lines, and hands that touch it."""

import sqlite3
from collections.abc import Callable
from pathlib import Path

from app.access.access import Access
from app.errors import StorageError
from tests.access.conftest import boss

LINES = 20


async def filled(access: Access, lines: int = LINES) -> Access:
    for number in range(lines):
        await access.audit.record("command", boss(), f"m{number % 3}", old=number, new=number + 1, unit="Hz")
    return access


def tamper(data: Path, *statements: str) -> None:
    db = sqlite3.connect(data / "pogon.db")
    for statement in statements:
        db.execute(statement)
    db.commit()
    db.close()


MARKS = ("audit.head", "audit.anchors", "audit.buffer", "audit.key")


async def older(access: Access, data: Path) -> dict[str, bytes]:
    """A chain of 12 lines whose marks were copied, and 8 lines more."""
    await filled(access, 12)
    copied = {name: (data / name).read_bytes() for name in MARKS if (data / name).exists()}
    await filled(access, 8)
    return copied


def broken_disk(access: Access) -> Callable[[], None]:
    """The database refuses every write until the returned function is called."""
    write = access.audit._db.write

    async def refuse(work: object) -> object:
        raise StorageError("pogon.db: database or disk is full")

    access.audit._db.write = refuse  # type: ignore[method-assign, assignment]

    def mend() -> None:
        access.audit._db.write = write  # type: ignore[method-assign]

    return mend
