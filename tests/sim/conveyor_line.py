"""A conveyor for tests: its PLC over registers (memory or TCP), the true line beside it, and an operator who works with both."""

import asyncio
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from contextlib import asynccontextmanager
from struct import pack, unpack
from typing import Any, Protocol
from zlib import crc32

from app.errors import DeviceException
from app.registers import plc_map
from app.registers.plc_map import Answer, AnswerState, DeviceEvent, Request, real
from app.sim.bus import Bus
from app.sim.conveyor import REGISTERS, ROW, SETTINGS, STAGING, TABLE, Command, Place, State, VirtualConveyor
from app.sim.server import MBAP, serve_tcp

CERTAIN = (1, 2, 6)
"""States of a row whose position counts: tracked, entering, unloading."""


class Port(Protocol):
    """The road to the registers of one PLC."""

    async def read(self, address: int, count: int) -> list[int]: ...

    async def write(self, address: int, words: Sequence[int], function: int = 16) -> None: ...


class MemoryPort:
    """Straight to the device."""

    def __init__(self, device: VirtualConveyor) -> None:
        self._device = device

    async def read(self, address: int, count: int) -> list[int]:
        return self._device.read(3, address, count)

    async def write(self, address: int, words: Sequence[int], function: int = 16) -> None:
        self._device.write(function, address, words)


class TcpPort:
    """A Modbus TCP master of few words."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, unit: int) -> None:
        self._reader, self._writer, self._unit = reader, writer, unit

    async def read(self, address: int, count: int) -> list[int]:
        answer = await self._ask(pack(">BHH", 3, address, count))
        return list(unpack(f">{count}H", answer[2:]))

    async def write(self, address: int, words: Sequence[int], function: int = 16) -> None:
        data = pack(f">{len(words)}H", *words)
        head = pack(">BHHB", 16, address, len(words), len(data)) if function == 16 else pack(">BH", function, address)
        await self._ask(head + data)

    async def _ask(self, pdu: bytes) -> bytes:
        self._writer.write(MBAP.pack(1, 0, len(pdu) + 1, self._unit) + pdu)
        length = MBAP.unpack(await self._reader.readexactly(MBAP.size))[2]
        answer = await self._reader.readexactly(length - 1)
        if answer[0] & 0x80:
            raise DeviceException(answer[1], "over TCP")
        return answer


@asynccontextmanager
async def tcp_port(device: VirtualConveyor) -> Any:
    """A port over a real socket of loopback."""
    server = await serve_tcp(Bus({5: device}), "127.0.0.1", 0)
    reader, writer = await asyncio.open_connection(*server.address)
    try:
        yield TcpPort(reader, writer, 5)
    finally:
        writer.close()
        await server.close()


def value(place: Place, words: Sequence[int], first: int) -> float:
    """The value at `place` in `words` that begin at `first`."""
    at = place.address - first
    form = {"u16": ">H", "u32": ">I", "i32": ">i", "f32": ">f", "u64": ">Q"}[place.type]
    length = {"u16": 1, "u64": 4}.get(place.type, 2)
    number = unpack(form, pack(f">{length}H", *words[at : at + length]))[0]
    return number >> place.shift & place.mask if place.mask else number  # type: ignore[no-any-return]


class TestLine:
    """One conveyor, its clock in the hand of the test."""

    __test__ = False

    def __init__(self, device: VirtualConveyor, port: Port | None = None) -> None:
        self.device = device
        self.port: Port = port or MemoryPort(device)
        self.events: list[DeviceEvent] = []
        """All that were fetched from the ring."""
        self._asked = 0
        self.watch: Callable[[], None] | None = None
        """Called after each scan."""

    # ---- time

    def step(self, scans: int = 1) -> None:
        for _ in range(scans):
            self.device.step()
            if self.watch:
                self.watch()

    def go(self, seconds: float) -> None:
        self.step(round(seconds * 100))

    # ---- registers

    async def status(self) -> dict[str, float]:
        """Every value of the header and of the images, by name."""
        blocks = [(0, 32), (0x0100, 96), (0x0180, 64), (0x0200, 34)]
        words = {first: await self.port.read(first, count) for first, count in blocks}
        assert all(plc_map.is_whole(words[first]) for first in words if first)
        found = {}
        for name, place in REGISTERS.items():
            first = max(first for first in words if first <= place.address)
            found[name] = value(place, words[first], first)
        return found

    async def get(self, name: str) -> float:
        place = REGISTERS[name]
        return value(place, await self.port.read(place.address, 4), place.address)

    async def products(self) -> dict[int, dict[str, float]]:
        """The rows of the table by id."""
        count = (await self.port.read(TABLE, 4))[2]
        rows = {}
        for first in range(0, count, 5):
            words = await self.port.read(TABLE + 4 + 24 * first, 24 * min(5, count - first))
            for at in range(0, len(words), 24):
                row = words[at : at + 24]
                assert row[2] == row[23] and row[2] % 2 == 0
                cells = {name: value(place, row, 0) for name, place in ROW.items()}
                if cells["id"]:
                    rows[int(cells["id"])] = cells
        return rows

    async def fetch(self) -> list[DeviceEvent]:
        """Take what is new in the ring and acknowledge it; a gap in the sequence fails."""
        head = await self.port.read(plc_map.EVENTS, plc_map.EVENTS_WORDS)
        capacity, newest = head[1], head[5] << 16 | head[6]
        last = self.events[-1].sequence if self.events else 0
        assert newest - last <= capacity, "events lost"
        fresh: list[DeviceEvent] = []
        while last < newest:
            row = (last + 1) % capacity
            rows = min(7, newest - last, capacity - row)
            words = await self.port.read(plc_map.EVENT_ROWS + 16 * row, 16 * rows)
            fresh += [plc_map.event_of(words[at : at + 16]) for at in range(0, len(words), 16)]
            last += rows
        assert [event.sequence for event in fresh] == list(range(newest - len(fresh) + 1, newest + 1))
        if fresh:
            await self.port.write(plc_map.EVENTS + plc_map.AT_ACKNOWLEDGED, plc_map.long_words(newest))
        self.events += fresh
        return fresh

    async def codes(self) -> list[tuple[int, int]]:
        """(code, source) of what is new in the ring."""
        return [(event.code, event.source) for event in await self.fetch()]

    async def order(self, code: int, *arguments: int, expected: int = 0, id: int = 0) -> Answer:
        """Send a command and give its answer of the next scan."""
        self._asked = self._asked % 65535 + 1
        id = id or self._asked
        await self.port.write(plc_map.COMMAND, plc_map.request_words(Request(code, 1, expected, arguments, id)))
        self.step()
        return await self.answer(id)

    async def answer(self, id: int) -> Answer:
        answers = plc_map.answers_of(await self.port.read(plc_map.ANSWERS, plc_map.ANSWERS_WORDS))
        assert answers is not None
        return next((answer for answer in answers if answer.id == id), Answer(id, AnswerState.NONE))

    async def done(self, code: int, *arguments: int) -> None:
        answer = await self.order(code, *arguments)
        assert answer.state in (AnswerState.DONE, AnswerState.RUNNING), answer

    async def set(self, **values: float) -> Answer:
        """Stage the settings in effect with `values` changed, and commit them."""
        status = await self.status()
        raw = pack(f">{len(SETTINGS)}f", *(values.get(setting.name, status[setting.name]) for setting in SETTINGS))
        await self.port.write(STAGING, unpack(f">{len(raw) // 2}H", raw))
        return await self.order(plc_map.COMMIT_SETTINGS, len(raw) // 2, crc32(raw))

    async def train(self, register: int, word: int) -> None:
        await self.port.write(register, [word], 6)
        self.step()

    async def hold(self, bits: int, seconds: float, speed: float = 0.0) -> None:
        """Hold a button: a rising counter every 100 ms."""
        for beat in range(max(1, round(seconds * 10))):
            await self.port.write(plc_map.HOLD, [bits, beat + 1, *plc_map.long_words(real(speed))])
            self.step(10)
        await self.port.write(plc_map.HOLD, [0, 0, 0, 0])
        self.step()

    async def until(self, condition: Callable[[], bool], seconds: float = 60.0) -> None:
        """Run until it holds."""
        for _ in range(round(seconds * 100)):
            if condition():
                return
            self.step()
        raise AssertionError(f"not within {seconds} s; state {State(self.device.state).name}")

    async def until_event(self, code: int, source: int | None = None, seconds: float = 60.0) -> DeviceEvent:
        """Run until the ring has it; only what is not fetched yet counts."""
        for _ in range(round(seconds * 10)):
            for event in await self.fetch():
                if event.code == code and source in (None, event.source):
                    return event
            self.step(10)
        raise AssertionError(f"no event {code} from {source} within {seconds} s")

    async def stand(self) -> None:
        """Stop, and wait until nothing moves."""
        await self.done(Command.STOP)
        await self.until(lambda: not any(self.device.machine.speeds), 20)
        self.go(0.2)

    # ---- the truth

    def true(self) -> list[Any]:
        return self.device.machine.products


class Witness:
    """Knows which product is which record, how far they are apart, and what became of each."""

    def __init__(self, line: TestLine) -> None:
        self.line = line
        self.record: dict[int, int] = {}
        """Number of a product → id of its record, once it has one."""
        self.here: dict[int, Any] = {}
        """Number → product, of those on the line."""
        self.gone: dict[int, str] = {}
        self.fates: Counter[str] = Counter()
        self.worst = 0.0
        """Greatest distance between a record whose position counts and its product [mm]."""
        self.worst_flagged = 0.0
        self.worst_place = 0.0
        """The same, whichever product is nearest [mm]: identities may change places once something unknown is on the line."""
        machine = line.device.machine
        self._before = (machine.unloaded, machine.removed, machine.fallen, machine.backed_out)
        self.here = {product.number: product for product in machine.products}
        self._newest = line.device.newest
        self.rematch()
        line.watch = self.look

    def rematch(self) -> None:
        """Which record is which product's now, whatever it was: an operator has put the records right."""
        self.record.clear()
        self._match({product.id: product for product in self.line.device.tracking.products})

    def look(self) -> None:
        device = self.line.device
        machine = device.machine
        counters = (machine.unloaded, machine.removed, machine.fallen, machine.backed_out)
        if len(machine.products) != len(self.here) or counters != self._before:
            now = {product.number: product for product in machine.products}
            left = [number for number in self.here if number not in now]
            for fate, before, after in zip(
                ("unloaded", "removed", "fallen", "backed out"), self._before, counters, strict=True
            ):
                for _ in range(after - before):
                    number = left.pop(0)
                    self.gone[number] = fate
                    self.fates[fate] += 1
            self._before, self.here = counters, now
        records = {product.id: product for product in device.tracking.products}
        if device.newest != self._newest:
            self._newest = device.newest
            self._match(records)
        for number, id in self.record.items():
            product, record = self.here.get(number), records.get(id)
            if product is None or record is None:
                continue
            error = abs(record.right - product.head)
            settled = record.settled if record.state in (2, 6) else record.state
            if settled in CERTAIN:
                if error > self.worst:
                    self.worst = error
                if error > self.worst_place:
                    nearest = min(abs(record.right - other.head) for other in machine.products)
                    self.worst_place = max(self.worst_place, nearest)
            elif error > self.worst_flagged:
                self.worst_flagged = error
        if len(self.record) > 60:
            self.record = {number: id for number, id in self.record.items() if number in self.here}

    def _match(self, records: dict[int, Any]) -> None:
        """A new record belongs to the product without one that is nearest, within 12 mm."""
        taken = set(self.record.values())
        for id, record in records.items():
            if id in taken:
                continue
            free = [product for number, product in self.here.items() if self.record.get(number) not in records]
            near = min(free, key=lambda product: abs(product.head - record.right), default=None)
            if near is not None and abs(near.head - record.right) < 12:
                self.record[near.number] = id


class Operator:
    """Puts a line right that stands: with eyes for the products, hands for them, and the commands of the PLC for their records."""

    REACH = 15.0
    """A record further from every product is no product's [mm]."""

    def __init__(self, line: TestLine) -> None:
        self.line = line
        self.taken_off = 0
        self.deleted = 0
        self.edited = 0

    async def recover(self) -> None:
        """Stop, make records and products agree, reset, start."""
        line = self.line
        await line.stand()
        await self.tidy()
        await line.done(Command.RESET)
        answer = await line.order(Command.START)
        assert answer.state is AnswerState.DONE, answer

    async def attend(self) -> None:
        """A lost product holds the end of the line until a person has looked: it is there (confirm) or not (delete)."""
        line = self.line
        bits = await line.port.read(0x0103, 2)
        if not (bits[0] >> 5 & 1 and bits[1] >> 7 & 1):
            return
        for id, row in (await line.products()).items():
            if row["state"] != 5 or row["head"] < line.device.geometry.length - self.REACH:
                continue
            if any(abs(product.head - row["head"]) < self.REACH for product in line.true()):
                await line.order(Command.CONFIRM, id)
            else:
                await line.order(Command.DELETE, id)
                self.deleted += 1

    async def tidy(self) -> None:
        """Delete records without a product, take off products without a record, correct what is between."""
        line = self.line
        sensor = line.device.geometry.sensors[0]
        rows = await line.products()
        matched: dict[int, Any] = {}
        free = dict(rows)
        for product in line.true():
            near = min(free.values(), key=lambda row: abs(row["head"] - product.head), default=None)
            if near is not None and abs(near["head"] - product.head) < self.REACH:
                matched[product.number] = near
                del free[int(near["id"])]
        for id in free:
            await line.done(Command.DELETE, id)
            self.deleted += 1
        for product in list(line.true()):
            row = matched.get(product.number)
            if row is None and product.head < sensor - 1:
                continue
            doubtful = row is not None and row["state"] not in (1, 2, 4, 6)
            inside = product.tail >= 0 and product.head <= line.device.geometry.length
            if row is not None and not doubtful and abs(row["head"] - product.head) < 2:
                continue
            if row is not None and inside and product.tail > sensor + 1:
                answer = await line.order(Command.EDIT, int(row["id"]), real(product.head), real(product.length))
                if answer.state is AnswerState.DONE:
                    self.edited += 1
                    continue
            await self._take_off(product.number)
            if row is not None and int(row["id"]) in await line.products():
                await line.done(Command.DELETE, int(row["id"]))
                self.deleted += 1

    async def _take_off(self, number: int) -> None:
        numbers = [product.number for product in self.line.true()]
        await self.line.train(0xE025, numbers.index(number) + 1)
        self.taken_off += 1


def codes_of(events: Iterable[DeviceEvent]) -> Counter[int]:
    return Counter(event.code for event in events)
