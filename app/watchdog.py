"""The watchdog of the event loop: a server that hangs is ended, so that whatever started it starts it again.

Whoever looks after a process (systemd, a container engine) sees that it is there, not that it answers. What hangs it is told by the stacks
of all threads, on standard error.
"""

import asyncio
import faulthandler
import logging
import os
from contextlib import suppress
from tempfile import TemporaryFile
from threading import Event, Thread

import typer

log = logging.getLogger(__name__)

PERIOD = 1.0
"""How often the loop gives a sign of life, and how often one is looked for [s]."""
LIMIT = 30
"""So many looks in a row without a sign end the process. Looks, not seconds: a stopped process (SIGSTOP, Ctrl+Z) does not look."""
END_LIMIT = 12.0
"""A server that is told to end and has not done so by then is ended [s]: whoever told it, such as systemd, waits for 15 s."""
ENDED = 70
"""Exit code of a process that hung: EX_SOFTWARE of sysexits.h. Whatever started it starts it again."""
CUT_SHORT = 75
"""Exit code of one that was told to end and could not in time: EX_TEMPFAIL. Whoever told it does not want it back."""
TELLING = 1.0
"""For the line in the log, which whoever hangs may hold up [s]."""


def end_process() -> None:
    """Tell where every thread is and end the process at once: nothing of it can be trusted to end in order."""
    with TemporaryFile() as file:  # the dump holds all threads up: it must not wait for whoever reads standard error
        faulthandler.dump_traceback(file)
        file.seek(0)
        stacks = file.read().decode(errors="replace")
    telling = Thread(target=_tell, args=(stacks,), daemon=True)
    telling.start()
    telling.join(TELLING)
    os._exit(ENDED)


def cut_short() -> None:
    """Say so and end the process at once, as a kill would.

    A disk that is slow, or stands still, has not taken all that is to be written.
    """
    telling = Thread(target=_tell_cut, daemon=True)
    telling.start()
    telling.join(TELLING)
    os._exit(CUT_SHORT)


def _tell_cut() -> None:
    log.error(
        "the end was cut short after %d s: the disk has not taken what was to be written; the next start finds all but the last of it",
        END_LIMIT,
    )
    logging.shutdown()


def _tell(stacks: str) -> None:
    with suppress(OSError, ValueError):  # no standard error
        typer.echo(stacks, err=True)
    log.critical(
        "the event loop has not turned for %d s: the server ends itself, where each thread was stands above",
        LIMIT * PERIOD,
    )
    logging.shutdown()


class Watchdog:
    """Watches the running loop from a thread of its own, from `start` to `stop`."""

    def __init__(self) -> None:
        self._alive = False
        self._silent = 0
        self._ending: float | None = None
        self._stopped = Event()
        self._next: asyncio.TimerHandle | None = None

    def start(self) -> None:
        """Watch the loop that runs."""
        self._sign(asyncio.get_running_loop())
        Thread(target=self._watch, name="watchdog", daemon=True).start()

    def stop(self) -> None:
        """Watch no more."""
        self._stopped.set()
        if self._next:
            self._next.cancel()

    def end_in_time(self) -> None:
        """From now on the process has `END_LIMIT` to end."""
        self._ending = 0.0

    def look(self) -> bool:
        """Look for a sign since the last look; whether the loop hangs."""
        self._silent = 0 if self._alive else self._silent + 1
        self._alive = False
        return self._silent >= LIMIT

    def _sign(self, loop: asyncio.AbstractEventLoop) -> None:
        self._alive = True
        self._next = loop.call_later(PERIOD, self._sign, loop)

    def _watch(self) -> None:
        while not self._stopped.wait(PERIOD):
            if self.look():
                end_process()
            if self._ending is not None:
                self._ending += PERIOD
                if self._ending >= END_LIMIT:
                    cut_short()
