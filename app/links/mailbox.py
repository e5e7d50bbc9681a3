"""The parameters of a PROFIdrive drive through the mailbox of its Modbus map (DS47), as a service of its unit.

One request is in the mailbox at a time: whoever asks waits in turn, and a long list leaves the mailbox to others between its requests. Each
telegram has a place of its own on the line, so values are scanned while a drive makes up its answer.

- Only the answer that carries the reference of the request is one; what else lies there is an older one, or another master's.
- Busy (0002, Modbus exception 06), an answer too long (0x15) and silence are asked again within limits. A change is never sent
  again once the drive may have taken it: then nobody knows, and that is what is told.
- Nothing is sent, not for a read either, while the link may not write: a request is written into the mailbox.
"""

import asyncio
import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

from app import chance
from app.errors import (
    BadAnswer,
    DeviceException,
    LinkError,
    MailboxRefused,
    NoAnswer,
    Overtaken,
    Refused,
    TelegramError,
)
from app.links.bus_access import BusAccess
from app.links.mailbox_registers import MailboxRegisters, NoResult
from app.links.parameter_service import ParameterService
from app.links.services import Service
from app.links.station import Station
from app.links.statistics import LinkState
from app.plant.definitions import MailboxMap
from app.profidrive.parameter_access import mailbox
from app.profidrive.parameter_access.error_numbers import ErrorNumber, MailboxError
from app.profidrive.parameter_access.formats import Format, size_of
from app.profidrive.parameter_access.messages import (
    HEADER,
    Address,
    Failed,
    Request,
    Result,
    Values,
    block_length,
    decode_answer,
    encode_request,
    results_of,
)
from app.profidrive.parameter_access.split import ERROR_BLOCK, Part, change_parts, halves, joined, read_parts

log = logging.getLogger(__name__)

BUSY_PAUSE, LONGEST_BUSY_PAUSE = 0.05, 0.4
"""Before a drive that is busy is asked again [s], doubling."""
BUSY_TRIES = 20
READ_TRIES = 2
"""Of a read without an answer."""
FREE_LIMIT = 1.0
"""Longest wait for a drive that is still at a request whose answer nobody waits for [s]."""
FOREIGN = 0.5
"""What carries another reference for so long is what another master asked for after us [s]."""
AGAIN = (NoAnswer, BadAnswer, Overtaken)
"""After these a read is asked again, and a change that was never sent; but a Stop ends a change."""
SERVER_BUSY = 6
NOBODY_KNOWS = (MailboxError.INTERNAL, MailboxError.UNANSWERED)
"""Of a request that a mailbox ends so; the other errors say that it was not done."""
LAST_REFERENCE = 255


@dataclass(frozen=True, slots=True)
class Missed:
    """A parameter of which the drive told nothing."""

    error: LinkError
    sent: bool
    """Whether the request was sent: then nobody knows what became of a change."""


Outcome = Result | Missed
Progress = Callable[[int, int], None]
"""(parameters done, of all)."""


class ParameterAccess(Protocol):
    """How the parameters of a drive are read and written: through its mailbox, or as registers (links/register_parameters.py)."""

    async def read(
        self,
        drive_object: int,
        addresses: Sequence[Address],
        formats: Sequence[Format | None] = (),
        progress: Progress | None = None,
    ) -> list[Outcome]:
        """What the drive says of each of `addresses`.

        Raises:
            Refused: nothing may be asked.
        """
        ...

    async def change(
        self, drive_object: int, changes: Sequence[tuple[Address, Values]], progress: Progress | None = None
    ) -> list[Outcome]:
        """Write `changes` in their order; what became of each. Never sent again once the drive may have taken it.

        Raises:
            Refused: nothing may be written.
        """
        ...


class MailboxUnit(ParameterService):
    """The mailbox of one drive."""

    def __init__(self, bus: BusAccess, station: Station, map: MailboxMap) -> None:
        super().__init__(bus, station)
        self.map = map
        self._reference = chance.randrange(0, LAST_REFERENCE)
        self._registers = MailboxRegisters(bus, station, map)
        self.waiting = 0
        """How many wait for their turn, or have it."""

    def adopt(self, before: Service) -> None:
        """The plant file has changed around the same drive: what waits goes on in the same queue."""
        if isinstance(before, MailboxUnit):
            self._turn, self._reference, self._registers.open = before._turn, before._reference, True

    # parameters

    async def read(
        self,
        drive_object: int,
        addresses: Sequence[Address],
        formats: Sequence[Format | None] = (),
        progress: Progress | None = None,
    ) -> list[Outcome]:
        """What the drive says of each of `addresses`; `formats` where they are known: more then go into a request.

        To cancel it, cancel the task that waits for it. When the line fails, what was read before is kept, the rest is `Missed`.

        Raises:
            Refused: `command.writes_off`.
            TelegramError: an address that no request can hold.
        """
        self._check_permitted()
        known = [*formats, *(None,) * (len(addresses) - len(formats))]
        return await self._all(drive_object, read_parts(addresses, known), len(addresses), progress, known)

    async def change(
        self, drive_object: int, changes: Sequence[tuple[Address, Values]], progress: Progress | None = None
    ) -> list[Outcome]:
        """Write `changes` in their order; what became of each. Written is what the drive took, not what was read back.

        Whoever calls it has asked the command gate.

        Raises:
            Refused: `command.writes_off`.
            TelegramError: a value or an address that no request can hold; nothing was sent.
        """
        self._check_permitted()
        requests = change_parts(changes)
        for parts in requests:
            encode_request(self._request(drive_object, parts, 1))
        return await self._all(drive_object, requests, len(changes), progress, ())

    # details

    async def _all(
        self,
        drive_object: int,
        requests: Sequence[list[Part]],
        count: int,
        progress: Progress | None,
        formats: Sequence[Format | None],
    ) -> list[Outcome]:
        found: list[list[Outcome]] = [[] for _ in range(count)]
        failure: LinkError | None = None
        stops = self._station.stops
        for parts in requests:
            results: Sequence[Outcome]
            if failure is None and parts[0].values is not None and stops != self._station.stops:
                failure = Overtaken(f"unit {self._station.number}: parameters not sent, a Stop came first")
            if failure is not None:
                results = [Missed(failure, sent=False)] * len(parts)
            else:
                try:
                    results = await self._asked(drive_object, parts, formats)
                except NoResult as untold:
                    failure = untold.error
                    results = [Missed(failure, sent=untold.sent)] * len(parts)
            for part, result in zip(parts, results, strict=True):
                found[part.place].append(result)
            if progress is not None:
                progress(sum(map(bool, found)), count)
        return [_joined(pieces) for pieces in found]

    async def _asked(
        self, drive_object: int, parts: Sequence[Part], formats: Sequence[Format | None]
    ) -> Sequence[Result]:
        """The results of one request, its parts read again in halves where an answer gets too long."""
        results = list(await self._one(drive_object, parts, formats))
        for place, (part, result) in enumerate(zip(parts, results, strict=True)):
            too_long = isinstance(result, Failed) and result.number == ErrorNumber.ANSWER_TOO_LONG
            if not too_long or part.values is not None:
                continue
            if len(parts) > 1:
                pieces = [part]  # alone it may fit
            elif not (pieces := halves(part)):
                continue
            results[place] = joined([(await self._asked(drive_object, [piece], formats))[0] for piece in pieces])
        return results

    async def _one(
        self, drive_object: int, parts: Sequence[Part], formats: Sequence[Format | None]
    ) -> Sequence[Result]:
        """One request and its answer.

        Raises:
            NoResult: the drive told nothing.
        """
        changes = parts[0].values is not None
        bound = HEADER if changes else HEADER + sum(_bound(part, formats) for part in parts)
        error: LinkError = NoAnswer(f"unit {self._station.number}: no answer in the mailbox")
        sent = False
        self.waiting += 1
        try:
            async with self._turn:
                pause, tries = BUSY_PAUSE, 0
                for _ in range(BUSY_TRIES):
                    request = self._request(drive_object, parts, self._next_reference())
                    try:
                        return await self._transaction(request, bound)
                    except NoResult as untold:
                        error, sent = untold.error, untold.sent
                        if changes and (sent or isinstance(error, Overtaken)):
                            raise
                        busy = isinstance(error, MailboxRefused) and error.number == MailboxError.INVALID_STATE
                        busy |= isinstance(error, DeviceException) and error.code == SERVER_BUSY
                        tries += not busy
                        if tries >= READ_TRIES or not (busy or isinstance(error, AGAIN)):
                            raise
                    await asyncio.sleep(pause)
                    pause = min(2 * pause, LONGEST_BUSY_PAUSE)
        finally:
            self.waiting -= 1
        raise NoResult(error, sent)

    async def _transaction(self, request: Request, bound: int) -> Sequence[Result]:
        """Write the request, look until its answer is there, take it."""
        self._check_up()
        loop = asyncio.get_running_loop()
        if self._registers.open:
            try:
                await self._registers.until_free(loop.time() + self.map.timeout)
            except LinkError as error:
                raise NoResult(error, False) from error
        sent, ended = False, loop.time() + self.map.timeout
        try:
            sent = await self._registers.write(encode_request(request))
            odd, looks = 0.0, 0
            while True:
                await asyncio.sleep(self._registers.pause(looks))
                looks += 1
                wrong: LinkError | None = None
                try:
                    words, said = await self._registers.look(bound)
                    if said.done and not said.error and said.reference == request.reference:
                        words = await self._registers.whole(words, said)
                        results = results_of(request, decode_answer(mailbox.data_of(words, said.length)))
                        self._registers.open = False
                        return results
                    if said.done and said.error:
                        self._registers.open = False
                        sent = said.error in NOBODY_KNOWS
                        raise MailboxRefused(f"unit {self._station.number}", said.error)
                    if said.idle:
                        wrong = BadAnswer(
                            f"unit {self._station.number}: request {request.reference} is gone from the mailbox"
                        )
                    elif said.done:
                        found = f"the answer to request {said.reference} in the mailbox"
                        wrong = BadAnswer(f"unit {self._station.number}: {found}, expected {request.reference}")
                except TelegramError as error:
                    wrong = BadAnswer(f"unit {self._station.number}: {error}")
                except (NoAnswer, BadAnswer, DeviceException) as error:
                    if loop.time() >= ended:
                        raise
                    log.debug("mailbox not read unit=%d: %s", self._station.number, error)
                now = loop.time()
                odd = (odd or now) if wrong else 0.0
                if wrong and now - odd >= FOREIGN:
                    raise wrong
                if now >= ended:
                    what = f"no answer to request {request.reference} in the mailbox in {self.map.timeout:g} s"
                    raise wrong or NoAnswer(f"unit {self._station.number}: {what}")
        except LinkError as error:
            raise NoResult(error, sent) from error

    def _request(self, drive_object: int, parts: Sequence[Part], reference: int) -> Request:
        values = tuple(part.values for part in parts if part.values is not None)
        return Request(reference, drive_object, tuple(part.address for part in parts), values or None)

    def _next_reference(self) -> int:
        self._reference = self._reference % LAST_REFERENCE + 1
        return self._reference

    def _check_permitted(self) -> None:
        if not self._station.may_write:
            raise Refused("command.writes_off", link=self._station.link.name)

    def _check_up(self) -> None:
        """Raises:
        NoResult: the unit is silent, or is not the device of the plant file.
        """
        station = self._station
        if station.state is LinkState.CONFIGURATION:
            raise NoResult(LinkError(f"unit {station.number} is not the device of the plant file"), False)
        if station.state is not LinkState.UP:
            raise NoResult(NoAnswer(f"unit {station.number} is silent"), False)


def _bound(part: Part, formats: Sequence[Format | None]) -> int:
    """Most bytes of the answer of one part."""
    format = formats[part.place] if part.place < len(formats) else None
    return max(ERROR_BLOCK, block_length(size_of(format), part.address.elements))


def _joined(pieces: Sequence[Outcome]) -> Outcome:
    """What became of a parameter from its pieces: a piece of which nobody knows makes all of it unknown."""
    missed = [piece for piece in pieces if isinstance(piece, Missed)]
    if missed:
        done = len(missed) < len(pieces)
        return replace(missed[0], sent=done or any(piece.sent for piece in missed))
    return joined([piece for piece in pieces if not isinstance(piece, Missed)])
