"""The registers of a drive's mailbox: each request and each look is one telegram that cannot be taken for another one."""

import asyncio
from contextlib import suppress

from app.errors import MAY_HAVE_ACTED, BadAnswer, DeviceException, LinkError, NoAnswer, NotConnected, TelegramError
from app.links.bus_access import BusAccess
from app.links.contract import Block, LateAnswerDue
from app.links.schedule import Priority
from app.links.station import Station
from app.plant.definitions import MailboxMap
from app.profidrive.parameter_access import mailbox
from app.registers.pdu import SERVER_FAILURE, WRITE_MULTIPLE

FIRST_LOOK, LAST_LOOK = 0.02, 0.16
"""Pauses between looks whether the answer is there [s], doubling."""
CHEAP_LOOK, CHEAP_LOOKS = 0.01, 10
"""Where a look costs the line nothing, the first ones follow each other so [s]: a drive that takes 30 ms is not asked only after 60."""
SHORT = 10
"""Words that are looked at in one telegram on a serial line, if the answer is no longer."""


class NoResult(Exception):
    """The drive said nothing of a request; `sent`: it may have taken it."""

    def __init__(self, error: LinkError, sent: bool) -> None:
        super().__init__(str(error))
        self.error = error
        self.sent = sent


class MailboxRegisters:
    """Writes and reads the mailbox of one drive."""

    def __init__(self, bus: BusAccess, station: Station, map: MailboxMap) -> None:
        self._bus, self._station, self._map = bus, station, map
        self.open = False
        """A request was sent whose answer did not come: the drive may still be at it."""
        self._cheap = station.link.transport != "rtu"

    async def write(self, data: bytes) -> bool:
        """Write the request into the mailbox; True when it may have arrived.

        Raises:
            LinkError: it did not.
        """
        words = list(mailbox.request_words(data))
        while True:
            job = self._bus.job(self._station.number)
            job.address, job.words, job.function = self._map.address, tuple(words), WRITE_MULTIPLE
            try:
                await self._bus.ask(job, Priority.WRITE)
            except LateAnswerDue as due:  # a longer telegram cannot be taken for the earlier one
                if len(words) < mailbox.WORDS:
                    words.append(0)
                else:
                    await asyncio.sleep(due.wait)
                continue
            except DeviceException as error:
                if error.code not in MAY_HAVE_ACTED:
                    raise await self._explained(error) from error
            except (NoAnswer, BadAnswer):
                if not job.sent:
                    raise
            except NotConnected as error:
                self.open = self.open or job.sent
                raise NoResult(error, job.sent) from error
            self.open = True
            return True

    def pause(self, looks: int) -> float:
        """Before the next look, after so many [s]."""
        if self._cheap:
            if looks < CHEAP_LOOKS:
                return CHEAP_LOOK
            looks -= CHEAP_LOOKS - 1
        return min(FIRST_LOOK * 2.0**looks, LAST_LOOK)

    async def look(self, bound: int) -> tuple[list[int], mailbox.Look]:
        """How far the request is; with it as much of the answer as is worth it."""
        count = mailbox.WORDS
        if self._station.link.transport == "rtu":
            count = mailbox.HEAD + bound // 2 if mailbox.HEAD + bound // 2 <= SHORT else mailbox.LOOK
        words = await self._read(self._map.address, count)
        return words, mailbox.look(words)

    async def whole(self, words: list[int], said: mailbox.Look) -> list[int]:
        """`words` with the rest of the answer.

        Raises:
            TelegramError: meanwhile something else lies there.
        """
        count = mailbox.HEAD + said.length // 2
        if len(words) >= count:
            return words
        whole = await self._read(self._map.address, count)
        again = mailbox.look(whole)
        if again != said:
            raise TelegramError("mailbox", f"{again}", f"{said} as a moment before")
        return whole

    async def until_free(self, ended: float) -> None:
        """Wait until the drive is no longer at the request whose answer nobody waits for; at most until `ended` [s]."""
        loop, pause = asyncio.get_running_loop(), FIRST_LOOK
        while loop.time() < ended:
            with suppress(NoAnswer, BadAnswer, TelegramError, DeviceException):
                words = await self._read(self._map.address, mailbox.LOOK)
                if words[0] != mailbox.Control.ACTIVE:
                    return
            await asyncio.sleep(pause)
            pause = min(2 * pause, LAST_LOOK)

    async def _explained(self, error: DeviceException) -> DeviceException:
        """The refusal with the number that the drive keeps for it."""
        if error.code != SERVER_FAILURE or not self._map.error:
            return error
        with suppress(LinkError):
            number = (await self._read(self._map.error, 1))[0]
            return DeviceException(
                error.code, f"unit {self._station.number}: mailbox refused, last access error {number}"
            )
        return error

    async def _read(self, address: int, count: int) -> list[int]:
        """So many registers at least; more where a shorter telegram could be taken for an earlier one."""
        while True:
            job = self._bus.job(self._station.number, Block(address, count))
            try:
                return await self._bus.ask(job, Priority.REFRESH)
            except LateAnswerDue as due:
                if address == self._map.address and count < mailbox.WORDS:
                    count += 1
                else:
                    await asyncio.sleep(due.wait)
