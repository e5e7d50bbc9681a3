"""Commands, hold-to-run and sets of setpoints of a Pogon PLC.

A command is one telegram with an id, sent once and never again by itself. What became of it stands in the answers of the device: when the
echo is lost they are read before anything is said. One command is on its way at a time, for the device has one place for it; an urgent one
(Stop) waits for nobody, and what waited when it came is not sent after it.
"""

import asyncio
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from struct import pack
from zlib import crc32

from app import chance
from app.errors import BadAnswer, DeviceException, LinkError, NoAnswer, NotConnected, NotTaken, Overtaken, Rejected
from app.links.bus_access import BusAccess
from app.links.contract import Block, LateAnswerDue
from app.links.device_clock import DeviceClock
from app.links.schedule import Priority
from app.links.services import SetWrite
from app.links.station import Station
from app.plant.definitions import Image, PlcMap, Register, Scan
from app.registers import plc_map
from app.registers.codec import own_bits, with_own
from app.registers.pdu import MAX_WRITE, WRITE_MULTIPLE
from app.registers.plc_map import Answer, AnswerState, Request

UNTOLD = (5, 10, 11)
"""Refusals that do not say that nothing happened: "accepted, it will take a while", and those of a gateway."""
ANSWER_LIMIT = 1.0
"""Longest wait for the first word of a device about a command [s]."""
ABSENT = 0.3
"""A command whose echo was lost and that the answers do not name so long after has not arrived [s]."""
DONE_LIMIT = 2.0
"""Longest wait until a set of setpoints is in effect [s]."""
FIRST_PAUSE, LAST_PAUSE = 0.01, 0.05
"""Between two looks at the answers [s]."""
TORN_TRIES = 3
TERMINAL = (AnswerState.DONE, AnswerState.REJECTED, AnswerState.FAILED, AnswerState.EXPIRED)
LARGEST_ID = 0xFFFF


class Orders:
    """What is asked of one unit."""

    def __init__(self, bus: BusAccess, station: Station, clock: DeviceClock) -> None:
        self._bus = bus
        self._station = station
        self._clock = clock
        self._next = chance.randrange(1, LARGEST_ID)
        self._known: set[int] = set()
        """Ids that the device still remembers: the same id would give the old answer."""
        self._turn = asyncio.Lock()
        self._setting = asyncio.Lock()
        self._urgent = 0
        self._free = asyncio.Event()
        self._free.set()

    def adopt(self, before: "Orders") -> None:
        """Go on where `before` was; what waits on it still does."""
        self._next, self._known = before._next, before._known
        self._turn, self._setting = before._turn, before._setting

    async def begin(self) -> None:
        """Look at what the device remembers, before anything is asked of it."""
        with suppress(LinkError):
            await self._look(Priority.REFRESH)

    async def order(self, request: Request, *, urgent: bool = False, stops: int | None = None) -> Answer:
        """Send `request` once; returns when the device has said at least whether it takes it. An id of 0 is replaced by the next one.

        `stops`: number of urgent writes (`Station.stops`) when it was prepared, if not now.

        Raises:
            LinkError: it did not arrive (Overtaken: a Stop came first).
            NoAnswer: nobody knows.
        """
        if urgent:
            self._urgent += 1
            self._free.clear()
            try:
                return await self._place(request, urgent=True)
            finally:
                self._urgent -= 1
                if not self._urgent:
                    self._free.set()
        stops = self._station.stops if stops is None else stops
        async with self._turn:
            await self._free.wait()
            self._check_stops(stops)
            return await self._place(request)

    async def answer(self, id: int) -> Answer | None:
        """What the device says about command `id` now; None when it does not know it, or no longer.

        Raises:
            LinkError: it could not be asked.
        """
        return next((answer for answer in await self._answers() if answer.id == id), None)

    async def hold(self, bits: int, counter: int, argument: float = 0.0, *, urgent: bool = False) -> None:
        """Ask for hold-to-run: request bits, a counter that must rise, an argument."""
        words = (bits & 0xFFFF, counter & 0xFFFF, *plc_map.long_words(plc_map.real(argument)))
        await self._write(plc_map.HOLD, words, urgent=urgent)

    async def set(self, map: PlcMap, writes: Sequence[SetWrite]) -> int:
        """Put `writes` into the set of setpoints and have the device take it as a whole. Returns when it is in effect.

        What comes back is the id under which the device knows this. The others are as the device has them at that moment, so of two writes
        one after the other none is lost.

        Raises:
            Rejected: the device takes none of it, with its reason; nothing has changed.
            NotTaken: it did not arrive, nothing has changed.
            LinkError: as `order`; nobody knows (NoAnswer).
        """
        image, name = map.settings, ", ".join(name for name, _, _ in writes)
        assert image is not None
        stops = self._station.stops
        async with self._setting:
            try:
                actual = await self._image(image)
            except (NoAnswer, NotConnected, BadAnswer) as error:
                raise NotTaken(f"{name}: the values in effect cannot be read ({error})") from error
            count = 2 * actual[1]
            values = actual[2 : 2 + count]
            for each, register, words in writes:
                offset = register.address - image.address - 2
                if count + 3 > image.words or not 0 <= offset <= count - len(words):
                    raise LinkError(f"{each}: the device has {actual[1]} setpoints, this one is not among them")
                values[offset : offset + len(words)] = merged(register, values[offset : offset + len(words)], words)
            limit = min(max(2, self._station.device.max_write), MAX_WRITE)
            try:
                for first in range(0, count, limit):
                    self._check_stops(stops)
                    await self._write(map.staging + first, values[first : first + limit])
            except (NoAnswer, NotConnected, BadAnswer) as error:
                raise NotTaken(f"{name}: not staged ({error})") from error
            check = crc32(pack(f">{count}H", *values))
            try:
                answer = await self.order(Request(plc_map.COMMIT_SETTINGS, arguments=(count, check)), stops=stops)
            except LateAnswerDue as error:
                raise NotTaken(f"{name}: not sent ({error})") from error
            except LinkError as error:
                if type(error) is not LinkError:
                    raise
                raise NotTaken(f"{name}: {error}") from error  # proven: the answers of the device do not name it
            answer = await self._until_done(answer, name)
        if answer.state is not AnswerState.DONE:
            raise Rejected(name, answer.reason, answer.detail, answer.state.name.lower())
        return answer.id

    # details

    async def _place(self, request: Request, *, urgent: bool = False) -> Answer:
        priority = Priority.URGENT if urgent else Priority.WRITE
        if not request.id:
            request = replace(request, id=self._next_id())
        boots = self._clock.boots
        unknown: LinkError | None = None
        job = self._bus.job(self._station.number)
        job.address, job.words, job.function = plc_map.COMMAND, plc_map.request_words(request), WRITE_MULTIPLE
        job.urgent = urgent
        try:
            await self._bus.ask(job, priority)
        except DeviceException as error:
            if error.code not in UNTOLD:
                raise
            unknown = error
        except LinkError as error:
            if not job.sent:
                raise
            unknown = error
        finally:
            self._known.add(request.id)
        answer = await self._first_word(request, unknown, boots, priority)
        now = asyncio.get_running_loop().time()
        for block in self._station.blocks:
            if block.part is not None and block.scan is Scan.FAST and block.reading.points:
                self._bus.schedule(block, now)
        return answer

    async def _first_word(
        self, request: Request, unknown: LinkError | None, boots: int | None, priority: Priority
    ) -> Answer:
        loop = asyncio.get_running_loop()
        began, pause = loop.time(), FIRST_PAUSE
        last: LinkError | None = unknown
        while True:
            asked = loop.time()
            try:
                answers = await self._look(priority)
            except LinkError as error:
                answers, last = None, error
            for answer in answers or ():
                if answer.id == request.id and answer.state is not AnswerState.NONE:
                    return answer
            if answers is not None and unknown is not None and asked - began >= ABSENT:
                if await self._same_start(boots):
                    raise LinkError(f"unit {self._station.number}: command {request.code} did not arrive ({unknown})")
                break
            if loop.time() - began >= ANSWER_LIMIT:
                break
            await asyncio.sleep(pause)
            pause = min(2 * pause, LAST_PAUSE)
        silence = NoAnswer(
            f"unit {self._station.number}: command {request.code} with id {request.id}: "
            f"nobody knows what became of it ({last or 'no word about it'})"
        )
        silence.request = request.id
        raise silence

    async def _until_done(self, answer: Answer, name: str) -> Answer:
        loop = asyncio.get_running_loop()
        began = loop.time()
        while answer.state not in TERMINAL:
            if loop.time() - began > DONE_LIMIT:
                raise NoAnswer(f"{name}: taken and not in effect after {DONE_LIMIT:g} s")
            await asyncio.sleep(LAST_PAUSE)
            try:
                answer = next((each for each in await self._look(Priority.WRITE) or () if each.id == answer.id), answer)
            except LinkError:
                continue
        return answer

    async def _answers(self) -> list[Answer]:
        for _ in range(1 + TORN_TRIES):
            answers = await self._look(Priority.REFRESH)
            if answers is not None:
                return answers
        raise BadAnswer(f"unit {self._station.number}: its answers change while they are read")

    async def _look(self, priority: Priority) -> list[Answer] | None:
        """The answers of the device; None when they were being changed.

        On a serial line that still owes an answer of this length fewer of them are read, the newest, by the generation in front alone.
        """
        for missing in range(plc_map.ANSWERS_KEPT):
            count = plc_map.ANSWERS_WORDS - (1 + missing * plc_map.ANSWER_WORDS if missing else 0)
            job = self._bus.job(self._station.number, Block(plc_map.ANSWERS, count))
            try:
                words = await self._bus.ask(job, priority)
            except LateAnswerDue:
                continue
            if missing:
                words = [*words, *(0,) * (plc_map.ANSWERS_WORDS - 1 - count), words[0]]
            answers = plc_map.answers_of(words)
            if answers is None:
                self._bus.statistics.torn += 1
            elif not missing:
                self._known = {answer.id for answer in answers}
            return answers
        raise NoAnswer(f"unit {self._station.number}: earlier answers may still come")

    async def _same_start(self, boots: int | None) -> bool:
        """Whether the device is still in the start that it was asked in: after another one it may have forgotten."""
        block = Block(plc_map.HEADER, plc_map.AT_BOOTS + 1)
        try:
            words = await self._bus.ask(self._bus.job(self._station.number, block), Priority.WRITE)
        except LinkError:
            return False
        return boots is None or words[plc_map.AT_BOOTS] == boots

    async def _image(self, image: Image) -> list[int]:
        for _ in range(1 + TORN_TRIES):
            job = self._bus.job(self._station.number, Block(image.address, image.words))
            words = await self._bus.ask(job, Priority.WRITE)
            if plc_map.is_whole(words):
                return words
            self._bus.statistics.torn += 1
        raise BadAnswer(f"unit {self._station.number}: {image.address:#06x} changes while it is read")

    async def _write(self, address: int, words: Sequence[int], *, urgent: bool = False) -> None:
        job = self._bus.job(self._station.number)
        job.address, job.words, job.function, job.urgent = address, tuple(words), WRITE_MULTIPLE, urgent
        await self._bus.ask(job, Priority.URGENT if urgent else Priority.WRITE)

    def _next_id(self) -> int:
        while True:
            self._next = self._next % LARGEST_ID + 1
            if self._next not in self._known:
                return self._next

    def _check_stops(self, stops: int) -> None:
        if stops != self._station.stops:
            raise Overtaken(f"unit {self._station.number}: not sent, a Stop came first")


def merged(register: Register, now: Sequence[int], words: Sequence[int]) -> list[int]:
    """`words` with the bits of a masked register that belong to others as they are `now`."""
    own = own_bits(register)
    return list(words) if own is None else with_own(now, words, own)
