"""Finding out what a unit refuses: which registers it does not have, or what size of telegram it does not take.

Each question is a telegram of its own in the schedule, so a write never waits for more than the one on the wire.
"""

import asyncio
import logging
from dataclasses import replace

from app.errors import GATEWAY, BadAnswer, DeviceException, HungUp, LinkError, NoAnswer
from app.links.bus_access import BusAccess
from app.links.contract import Block
from app.links.scan_block import ScanBlock
from app.links.station import Finding, Station, spans_of
from app.registers.pdu import BITS, READ_COILS, READ_HOLDING, most_read

log = logging.getLogger(__name__)

NO_REGISTER = (2, 3)
"""Refusals that may be about the registers, or about how many there are."""
SILENT = 2
"""Requests without a right answer that count as a refusal, where silence is examined."""
WITNESSES = 3
"""Registers of a unit that never answered one that are asked for before it counts as silent."""
FIRST_LOOK, LAST_LOOK = 1.0, 60.0
"""Pauses between two looks at a refused register [s], doubling."""
KNOWN_LOOK = 1.4
"""Longest pause while one is refused that the unit did answer [s]: what comes back is seen within two seconds."""
BUSY_PAUSE = 0.05
"""Before a block is scanned that was refused and is taken now [s]."""


class Examiner:
    """Looks at units of one link."""

    def __init__(self, bus: BusAccess) -> None:
        self._bus = bus

    async def try_smaller(self, station: Station, block: ScanBlock, error: LinkError) -> None:
        """Silence at a size that the device never answered: is it the size, or is nobody there?"""
        async with station.attention:
            if await self._answers_otherwise(station, block, error):
                station.learned.limit = station.device.fallback_read
                self._tell_limit(station, error)
                self._bus.replan(station)
                self.start_recheck(station)

    async def examine(self, station: Station, block: ScanBlock) -> None:
        """Cut a refused block in halves until it is known which registers, or what size, the device refuses."""
        async with station.attention:
            await self._examine_alone(station, block)

    async def examine_silence(self, station: Station, block: ScanBlock, error: LinkError) -> None:
        """Silence, or too short an answer, where the unit never answered as it should: is anybody there, and for what is it silent?"""
        async with station.attention:
            if await self._answers_otherwise(station, block, error):
                await self._examine_alone(station, block, Finding(silence=True))

    async def _answers_otherwise(self, station: Station, block: ScanBlock, error: LinkError) -> bool:
        """Whether a unit that is silent for `block` answers for something else; if not, it is silent as a whole, for `error`."""
        if not block.alive:
            return False
        self._bus.drop(block)
        try:
            await self._hear(station)
        except LinkError:
            self._bus.later(station, error)
            return False
        return True

    async def examine_refusal(self, station: Station, block: ScanBlock, code: int) -> None:
        """A block is refused again and again with a code that says nothing of registers: is it for some of them?"""
        async with station.attention:
            if not block.alive:
                return
            self._bus.drop(block)
            spans, finding = spans_of(block.points), Finding(code=code)
            try:
                ends = [
                    await self._refusal(station, _block(one, block.block.function), finding) > 0
                    for one in (spans[0], spans[-1])
                ]
            except DeviceException:
                ends = [True]
            except LinkError as error:
                self._bus.later(station, error)
                return
            if all(ends):
                self._bus.schedule(block, _now() + 1.0)
            else:
                await self._examine_alone(station, block, finding)

    async def _examine_alone(self, station: Station, block: ScanBlock, finding: Finding | None = None) -> None:
        if not block.alive:
            return
        self._bus.drop(block)
        finding, function = finding or Finding(), block.block.function
        # a look at what it is silent for takes the line a whole time-out: there, what it once answered has no shorter pause
        known = set(spans_of(block.points)) if block.answered and not finding.silence else set()
        try:
            await self._halve(station, function, spans_of(block.points), finding)
        except DeviceException:
            self._bus.schedule(block, _now() + 1.0)
            return
        except LinkError as error:
            self._bus.later(station, error)
            return
        learned = station.learned
        if finding.limit is not None:
            fallback = 0 if function in BITS else station.device.fallback_read
            smaller = fallback if 0 < fallback < block.block.count else max(finding.limit, finding.taken)
            learned.take_at_most(function, smaller)
            what = f"{block.block.count} {'bits' if function in BITS else 'registers'} from {block.block.address:#06x}"
            self._tell_limit(station, LinkError(f"{what} {'not answered' if finding.silence else 'refused'}"), function)
        learned.gaps.update((function, first, last) for first, last in finding.gaps)
        learned.bad.update((function, first, last) for first, last in finding.bad)
        learned.known.update((function, first, last) for first, last in known.intersection(finding.bad))
        learned.hang_up = learned.hang_up and bool(learned.bad)
        if finding.bad or finding.limit is not None:
            station.look_pause = FIRST_LOOK
        for first, last in finding.bad:
            log.warning(
                "%s link=%s unit=%d first=%#06x last=%#06x",
                finding.what,
                station.link.name,
                station.number,
                first,
                last,
            )
        if finding.limit is None and not finding.gaps and not finding.bad:
            self._bus.schedule(block, _now() + BUSY_PAUSE)  # it takes the block now
        self._bus.replan(station)
        self.start_recheck(station)

    async def _halve(self, station: Station, function: int, spans: list[tuple[int, int]], finding: Finding) -> bool:
        """Whether the device answers the registers from the first to the last of `spans` in one read."""
        first, last = spans[0][0], max(end for _, end in spans)
        code = await self._refusal(station, _block((first, last), function), finding)
        if not code:
            return True
        if len(spans) == 1:
            finding.bad.append(spans[0])
            return False
        middle = len(spans) // 2
        left, right = spans[:middle], spans[middle:]
        alone = [await self._halve(station, function, half, finding) for half in (left, right)]
        if all(alone):
            end, begin = max(end for _, end in left), right[0][0]
            if code == 2 and begin > end + 1:
                finding.gaps.append((end + 1, begin - 1))
            else:
                larger = max(end - first, last - begin) + 1
                finding.limit = larger if finding.limit is None else min(finding.limit, larger)
        return False

    async def _refusal(self, station: Station, block: Block, finding: Finding) -> int:
        """The code with which the unit refuses `block`, one that may be about its registers; 0 when it answers.

        Where silence is examined, no right answer, twice, from a unit that answers for others means the same: not all refuse in words.

        Raises:
            DeviceException: it has no time.
            LinkError: it does not answer at all.
        """
        for _ in range(SILENT):
            try:
                await self._bus.read(station, replace(block, again=True))  # whether it answers, whatever it says
                finding.taken = max(finding.taken, block.count)
                return 0
            except DeviceException as error:
                if error.code not in (*NO_REGISTER, finding.code):
                    raise
                return error.code or NO_REGISTER[0]
            except (NoAnswer, BadAnswer) as error:
                if not finding.silence:
                    raise
                finding.hang_up = finding.hang_up or isinstance(error, HungUp)
            await self._hear(station)
        return NO_REGISTER[0]

    async def _hear(self, station: Station) -> None:
        """Have it answer for something that it did answer.

        Raises:
            LinkError: it does not.
        """
        silence = NoAnswer(f"unit {station.number}: nothing is read")
        most = WITNESSES if station.learned.hang_up else min(WITNESSES, len(station.blocks))
        for turn in range(most if not station.answered else 1):
            try:
                await self._bus.read(station, replace(station.probe(turn), again=True))
                return
            except DeviceException as error:
                if error.code not in GATEWAY:
                    return
                silence = NoAnswer(str(error))
            except (NoAnswer, BadAnswer) as error:
                silence = NoAnswer(str(error))
        raise silence

    def start_recheck(self, station: Station) -> None:
        """Look now and then whether it takes after all what it refuses."""
        if _refused(station)[0] and station.recheck is None:
            station.recheck = self._bus.attend(station, self._recheck(station))

    async def _recheck(self, station: Station) -> None:
        """Look now and then at what is refused; when it is taken after all, everything is tried again."""
        learned, turn = station.learned, 0
        while _refused(station)[0]:
            pause = min(station.look_pause, LAST_LOOK)
            await asyncio.sleep(min(pause, KNOWN_LOOK) if _refused(station)[1] else pause)
            station.look_pause = 2 * pause  # not before: a look that a lost line prevented was none
            wanted, known = _refused(station)
            if not wanted:
                break
            block = wanted[turn % len(wanted)]
            turn += 1
            try:
                await self._bus.read(station, block)
            except LinkError:
                continue
            learned.bad.clear()
            learned.gaps.clear()
            learned.known.clear()
            learned.hang_up = False
            for function in (READ_HOLDING, READ_COILS) if known else ():
                if learned.most(function) < station.proven(function):
                    learned.take_at_most(function, most_read(function))
            self._bus.replan(station)
        station.recheck = None

    def _tell_limit(self, station: Station, error: LinkError, function: int = READ_HOLDING) -> None:
        log.warning(
            "unit takes fewer %s per read link=%s unit=%d limit=%d reason=%s",
            "bits" if function in BITS else "registers",
            station.link.name,
            station.number,
            station.learned.most(function),
            error,
        )


def _refused(station: Station) -> tuple[list[Block], bool]:
    """Reads that the unit refuses and had answered before, or else all that it refuses; whether it had answered them.

    A spell of exceptions looks as if it took fewer registers at once, and then values of several registers could not be read for ever.
    """
    learned = station.learned
    known = [Block(first, last - first + 1, function) for function, first, last in sorted(learned.known & learned.bad)]
    for largest in (station.largest, station.largest_of_bits):
        if largest is not None and largest.count > learned.most(largest.function):
            known.append(largest)
    if known:
        return known, True
    return [Block(first, last - first + 1, function) for function, first, last in sorted(learned.bad)], False


def _block(span: tuple[int, int], function: int) -> Block:
    return Block(span[0], span[1] - span[0] + 1, function)


def _now() -> float:
    return asyncio.get_running_loop().time()
