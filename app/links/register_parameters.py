"""The parameters of a drive that are registers, as a service of its unit: the same two calls as a mailbox (links/mailbox.py).

- Neighbours are read together, as many as the device gives at once; where it refuses, each is asked by itself, so one that it does not
  have hides no other. What a refusal says is kept as its exception code.
- Each telegram is followed by a pause as long as it took: at most half of the line's time goes into parameters, and scans never starve.
- A change is one telegram per parameter and is never sent again once it may have arrived. Before the first one the device is told to keep
  what follows (`permanent`), which somebody may have switched off.
"""

import asyncio
import logging
from collections.abc import Iterator, Sequence
from itertools import islice

from app.errors import GATEWAY, MAY_HAVE_ACTED, BadAnswer, DeviceException, LinkError, NoAnswer, Overtaken, Refused
from app.links.bus_access import BusAccess
from app.links.contract import Block, LateAnswerDue
from app.links.mailbox import Missed, Outcome, Progress
from app.links.parameter_service import ParameterService
from app.links.schedule import Priority
from app.links.services import Service
from app.links.station import Station
from app.links.statistics import LinkState
from app.plant.definitions import ParameterMap
from app.profidrive.parameter_access.error_numbers import EXCEPTION
from app.profidrive.parameter_access.formats import Format
from app.profidrive.parameter_access.messages import Address, Failed, Values, Written
from app.registers.pdu import WRITE_SINGLE

log = logging.getLogger(__name__)

READ_TRIES = 2
"""Of a read without an answer."""
BUSY, BUSY_TRIES, BUSY_PAUSE = 6, 10, 0.1
"""Exception code, and how often and after what pause a device that is busy is asked again [s]."""
SHORTEST_PAUSE = 0.02
"""After each telegram [s]."""
SETTLE = 0.25
"""What the drive is given to act on what it has echoed, before anybody reads it back [s]; how long a real one takes nobody says."""


class RegisterParameters(ParameterService):
    """The parameters of one drive."""

    def __init__(self, bus: BusAccess, station: Station, map: ParameterMap) -> None:
        super().__init__(bus, station)
        self.map = map

    def adopt(self, before: Service) -> None:
        """The plant file has changed around the same drive: what waits goes on in the same queue."""
        if isinstance(before, RegisterParameters):
            self._turn = before._turn

    # parameters

    async def read(
        self,
        drive_object: int,
        addresses: Sequence[Address],
        formats: Sequence[Format | None] = (),
        progress: Progress | None = None,
    ) -> list[Outcome]:
        """What the drive says of each of `addresses`, of which only the number counts: one raw word, or why not.

        To cancel it, cancel the task that waits for it. When the line fails, what was read before is kept, the rest is `Missed`.
        """
        found: dict[int, Outcome] = {}
        failure: LinkError | None = None
        for first, count in _runs(sorted({address.number for address in addresses}), self.map.most):
            if failure is None:
                try:
                    found |= await self._asked(first, count)
                except LinkError as error:
                    failure = error
            if failure is not None:
                found |= {number: Missed(failure, sent=False) for number in range(first, first + count)}
            if progress is not None:
                progress(sum(address.number in found for address in addresses), len(addresses))
        return [found[address.number] for address in addresses]

    async def change(
        self, drive_object: int, changes: Sequence[tuple[Address, Values]], progress: Progress | None = None
    ) -> list[Outcome]:
        """Write `changes` in their order, none after one that failed; what became of each. Written is what the drive took, not what was
        read back.

        Whoever calls it has asked the command gate.

        Raises:
            Refused: `command.writes_off`.
        """
        if not self._station.may_write:
            raise Refused("command.writes_off", link=self._station.link.name)
        told: list[Outcome] = []
        stops = self._station.stops
        async with self._turn:
            failure = await self._kept_from_now_on(stops)
            for address, block in changes:
                outcome = failure or await self._written(address.number, int(block.values[0]), stops)
                told.append(outcome)
                if isinstance(outcome, Missed):
                    failure = Missed(outcome.error, sent=False)
                elif isinstance(outcome, Failed):
                    failure = Missed(LinkError(f"register {address.number:#06x} was refused before"), sent=False)
                if progress is not None:
                    progress(len(told), len(changes))
            await asyncio.sleep(SETTLE)
        return told

    # details

    async def _asked(self, first: int, count: int) -> dict[int, Outcome]:
        """The registers from `first`.

        Raises:
            LinkError: no answer.
        """
        try:
            words = await self._read(first, count)
        except DeviceException as error:
            if error.code in GATEWAY:
                raise
            if count == 1:
                return {first: Failed(EXCEPTION + error.code)}
            half = count // 2
            return await self._asked(first, half) | await self._asked(first + half, count - half)
        return {first + place: Values(Format.UNSIGNED16, (word,)) for place, word in enumerate(words)}

    async def _read(self, first: int, count: int) -> list[int]:
        loop, tries, busy = asyncio.get_running_loop(), 0, 0
        while True:
            self._check_up()
            began = loop.time()
            job = self._bus.job(self._station.number, Block(first, count))
            job.quiet = True
            try:
                return await self._bus.ask(job, Priority.REFRESH)
            except LateAnswerDue as due:
                await asyncio.sleep(due.wait)
            except (NoAnswer, BadAnswer):
                tries += 1
                if tries >= READ_TRIES:
                    raise
            except DeviceException as error:
                busy += 1
                if error.code != BUSY or busy >= BUSY_TRIES:
                    raise
                await asyncio.sleep(BUSY_PAUSE)
            finally:
                await asyncio.sleep(max(SHORTEST_PAUSE, loop.time() - began))

    async def _kept_from_now_on(self, stops: int) -> Missed | None:
        """Tell the device to keep what follows; why it could not be told."""
        if self.map.permanent is None:
            return None
        outcome = await self._written(*self.map.permanent, stops)
        if isinstance(outcome, Missed):
            return Missed(outcome.error, sent=False)
        if isinstance(outcome, Failed):
            refused = DeviceException((outcome.number or EXCEPTION) - EXCEPTION, "permanent memory")
            return Missed(refused, sent=False)
        return None

    async def _written(self, address: int, word: int, stops: int) -> Outcome:
        """One telegram; `stops`: what the unit had been stopped when the change began."""
        while True:
            try:
                self._check_up()
                if stops != self._station.stops:
                    raise Overtaken(f"unit {self._station.number}: parameter not sent, a Stop came first")
                job = self._bus.job(self._station.number)
                job.address, job.words, job.function = address, (word,), WRITE_SINGLE
            except LinkError as error:
                return Missed(error, sent=False)
            try:
                await self._bus.ask(job, Priority.WRITE)
            except LateAnswerDue as due:
                await asyncio.sleep(due.wait)
                continue
            except DeviceException as error:
                if error.code in (*GATEWAY, *MAY_HAVE_ACTED):
                    return Missed(error, sent=error.code in MAY_HAVE_ACTED)
                return Failed(EXCEPTION + error.code)
            except LinkError as error:
                return Missed(error, sent=job.sent)
            finally:
                self._bus.written(self._station, address, 1)
            return Written()

    def _check_up(self) -> None:
        """Raises:
        LinkError: the unit is silent, or is not the device of the plant file.
        """
        station = self._station
        if station.state is LinkState.CONFIGURATION:
            raise LinkError(f"unit {station.number} is not the device of the plant file")
        if station.state is not LinkState.UP:
            raise NoAnswer(f"unit {station.number} is silent")


def _runs(numbers: Sequence[int], most: int) -> Iterator[tuple[int, int]]:
    """(first, count) of neighbours among `numbers`, which rise, at most so many together."""
    at = 0
    while at < len(numbers):
        count = 1 + sum(
            1 for place, number in enumerate(islice(numbers, at + 1, at + most), 1) if number == numbers[at] + place
        )
        yield numbers[at], count
        at += count
