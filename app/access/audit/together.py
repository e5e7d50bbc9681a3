"""Lines that go into the database with one commit: all that come until the thread of the database takes them."""

from collections.abc import Sequence
from threading import Lock

from sqlalchemy import Connection

from app.access.audit.line import Entry


class Together:
    """Lines of one commit."""

    def __init__(self) -> None:
        self._entries: list[Entry] = []
        self._taken = False
        self._lock = Lock()

    def join(self, entries: Sequence[Entry]) -> int | None:
        """Have `entries` written with the others; how many lines there are then, None when they come too late."""
        with self._lock:
            if self._taken:
                return None
            self._entries += entries
            return len(self._entries)

    def take(self, _connection: Connection) -> tuple[None, list[Entry]]:
        """All of them, as the work of a transaction; nobody joins any more."""
        with self._lock:
            self._taken = True
            return None, self._entries

    def after(self, place: int) -> int:
        """How many lines stand behind the one at `place`, counted from 1."""
        return len(self._entries) - place
