"""A conveyor for tests: its PLC over registers (memory or TCP), the true line beside it, and an operator who works with both."""

import asyncio
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from math import inf
from struct import pack, unpack
from typing import Any, Protocol
from zlib import crc32

from app.blocks.product_tracking import Code
from app.errors import DeviceException
from app.registers import plc_map
from app.registers.plc_map import Answer, AnswerState, DeviceEvent, Request, real
from app.sim.bus import Bus
from app.sim.conveyor import training as own
from app.sim.conveyor.program import VirtualConveyor
from app.sim.conveyor.register_map import (
    REGISTERS,
    ROW,
    SETTINGS,
    STAGING,
    TABLE,
    ConveyorCommand,
    ConveyorEvent,
    ConveyorState,
)
from app.sim.plc import EVENT_CAPACITY, RegisterPlace
from app.sim.server import MBAP, serve_tcp

OF_A_PRODUCT = (Code.LOST, Code.UNEXPECTED, Code.LENGTH_DIFFERS)
OF_A_BELT = (ConveyorEvent.JAM, ConveyorEvent.ENCODER)
"""Events that say of a product, or of all products on a belt, that something is wrong."""
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


def value(place: RegisterPlace, words: Sequence[int], first: int) -> float:
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
        self.hand: int = 0
        """Number of the product that a hand took off last."""

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
        capacity, size, newest = head[1], head[2], head[5] << 16 | head[6]
        last = self.events[-1].sequence if self.events else 0
        assert newest - last <= capacity, "events lost"
        fresh: list[DeviceEvent] = []
        while last < newest:
            row = (last + 1) % capacity
            rows = min(7, newest - last, capacity - row)
            words = await self.port.read(plc_map.EVENT_ROWS + size * row, size * rows)
            fresh += [plc_map.event_of(words[at : at + size]) for at in range(0, len(words), size)]
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

    async def start(self) -> Answer:
        """Choose automatic and start it."""
        await self.done(ConveyorCommand.AUTOMATIC)
        answer = await self.order(ConveyorCommand.START)
        assert answer.state is AnswerState.DONE, answer
        return answer

    async def set(self, **values: float) -> Answer:
        """Stage the settings in effect with `values` changed, and commit them."""
        status = await self.status()
        raw = pack(f">{len(SETTINGS)}f", *(values.get(setting.name, status[setting.name]) for setting in SETTINGS))
        await self.port.write(STAGING, unpack(f">{len(raw) // 2}H", raw))
        return await self.order(plc_map.COMMIT_SETTINGS, len(raw) // 2, crc32(raw))

    async def train(self, register: int, word: int) -> None:
        if register == own.REG_REMOVE and word <= len(self.true()):
            self.hand = self.true()[word - 1].number
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
        raise AssertionError(f"not within {seconds} s; state {ConveyorState(self.device.state).name}")

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
        await self.done(ConveyorCommand.STOP)
        await self.until(lambda: not any(self.device.machine.speeds), 20)
        self.go(0.2)

    # ---- the truth

    def true(self) -> list[Any]:
        return self.device.machine.products


@dataclass(slots=True)
class Life:
    """One product, from the infeed or a hand to its end, and what the PLC told of it."""

    thing: Any
    ids: set[int] = field(default_factory=set)
    """Records that were ever taken for it."""
    told: list[tuple[int, int]] = field(default_factory=list)
    """(code, source) of the notices that were about it."""
    fate: str = ""
    step: int = 0
    """Of its end."""
    unloaded_as: int = 0
    """Record that the PLC said it unloaded then."""
    state: int = 0
    """Last of its record; 0 = it never had one."""
    apart: float = inf
    """Last distance from its record [mm]; inf = it has none."""
    during: int = 0
    """What happened to the line then: a fault, a deed by hand, 0 = nothing."""


class Witness:
    """Knows which product is which record, how far they are apart, what the PLC told of each and what became of it."""

    REACH = 15.0
    """What a sensor tells is about the products so near to it, and about those that touch them [mm]."""

    def __init__(self, line: TestLine) -> None:
        self.line = line
        self.record: dict[int, int] = {}
        """Number of a product → id of its record, once it has one."""
        self.here: dict[int, Any] = {}
        """Number → product, of those on the line."""
        self.lives: dict[int, Life] = {}
        """Every product that ever was on the line, by its number."""
        self.fates: Counter[str] = Counter()
        self.during = 0
        """What happens to the line: a fault, a deed by hand, 0 = nothing."""
        self.lately: set[tuple[int, int]] = set()
        """(code, source) of the events since it began."""
        self.gripped = 0
        """Times the PLC told that a product was unloaded."""
        self.empty_grips = 0
        """Of those, it had to tell that there was none."""
        self.worst = 0.0
        """Greatest distance between a record whose position counts and its product [mm]."""
        self.worst_flagged = 0.0
        self.worst_place = 0.0
        """The same, whichever product is nearest [mm]: identities may change places once something unknown is on the line."""
        machine = line.device.machine
        self._before = (machine.unloaded, machine.removed, machine.fallen, machine.backed_out)
        self.here = {product.number: product for product in machine.products}
        self.lives = {number: Life(thing) for number, thing in self.here.items()}
        self._whose: dict[int, set[int]] = {}
        self._grip = 0
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
            self._count(counters)
        records = {product.id: product for product in device.tracking.products}
        if device.newest != self._newest:
            self._match(records)
            self._listen()
        for number, id in self.record.items():
            product, record = self.here.get(number), records.get(id)
            if product is None:
                continue
            if record is None:
                self.lives[number].apart = inf
                continue
            error = abs(record.right - product.head)
            settled = record.settled if record.state in (2, 6) else record.state
            life = self.lives[number]
            life.state, life.apart = settled, error
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

    def _count(self, counters: tuple[int, int, int, int]) -> None:
        """Who came, who went, and by which way."""
        machine = self.line.device.machine
        now = {product.number: product for product in machine.products}
        left = [number for number in self.here if number not in now]
        for number, product in now.items():
            if number not in self.lives:
                self.lives[number] = Life(product)
        unloaded, removed, fallen, backed_out = (
            after - before for before, after in zip(self._before, counters, strict=True)
        )
        assert unloaded <= 1 and removed <= 1 and len(left) == unloaded + removed + fallen + backed_out
        if removed:
            left.remove(self.line.hand)
            self._end(self.line.hand, "removed")
        for fate, times in (("unloaded", unloaded), ("fallen", fallen), ("backed out", backed_out)):
            for _ in range(times):
                self._end(left.pop(0), fate)
        self._before, self.here = counters, now

    def _end(self, number: int, fate: str) -> None:
        life = self.lives[number]
        life.fate, life.step, life.during = fate, self.line.device.steps, self.during
        self.fates[fate] += 1
        if fate == "removed" and not life.ids:
            # no sensor that works has seen it yet: what it told is that the sensor before is blind or stuck
            passed = sum(x <= life.thing.head for x in self.line.device.geometry.sensors)
            told = {(int(Code.SENSOR_SUSPECTED), passed), (int(Code.UNEXPECTED), passed + 1)} & self.lately
            life.told += sorted(told)
        elif fate == "removed" and not life.told:
            ends = (0.0, 0.0, *self.line.device.geometry.belt_ends)
            for code, belt in sorted(self.lately):
                # on the belt that failed since, or run into what stands there
                if code not in OF_A_BELT:
                    continue
                begin = ends[belt - 1 if life.thing.collided else belt]
                if life.thing.head > begin and life.thing.tail < ends[belt + 1]:
                    life.told.append((code, belt))
        if fate == "unloaded":
            assert self._grip, f"product {number} was taken off and the PLC did not tell"
            life.unloaded_as, self._grip = self._grip, 0

    def _listen(self) -> None:
        """Of whom the new events speak."""
        device = self.line.device
        for sequence in range(self._newest + 1, device.newest + 1):
            row = plc_map.EVENT_ROWS + sequence % EVENT_CAPACITY * plc_map.EVENT_WORDS
            event = plc_map.event_of(device.read(3, row, plc_map.EVENT_WORDS))
            id = event.snapshot[0] << 16 | event.snapshot[1]
            if event.code == Code.UNLOADED:
                assert not self._grip, f"record {self._grip} was unloaded and nothing was taken or missed"
                self._grip = id
                self.gripped += 1
            elif event.code == ConveyorEvent.LOST and not event.source:
                assert id == self._grip
                self._grip = 0
                self.empty_grips += 1
            notice = (event.code, event.source)
            self.lately.add(notice)
            if event.code in OF_A_PRODUCT:
                about = set(self._whose.get(id, ()))
                if event.source and event.code != ConveyorEvent.LOST:
                    about |= self._at(device.geometry.sensors[event.source - 1])
            elif event.code in OF_A_BELT:
                about = self._on_belt(event.source)
            else:
                continue
            for number in about:
                self.lives[number].told.append(notice)
        self._newest = device.newest

    def _on_belt(self, belt: int) -> set[int]:
        """The products on a belt, and those whose records are."""
        ends = (0.0, *self.line.device.geometry.belt_ends)
        begin, end = ends[belt - 1], ends[belt]
        ids = {p.id for p in self.line.device.tracking.products if p.right > begin and p.left < end}
        things = {number for number, thing in self.here.items() if thing.head > begin and thing.tail < end}
        return things | {number for number, id in self.record.items() if id in ids}

    def _at(self, x: float) -> set[int]:
        """The products at `x` and those that touch them, as a light barrier cannot tell them apart."""
        things = list(self.here.values())
        at = {n for n, thing in enumerate(things) if thing.tail - self.REACH <= x <= thing.head + self.REACH}
        for chain in (range(1, len(things)), range(len(things) - 2, -1, -1)):
            for n in chain:
                before = n - 1 if chain.step > 0 else n + 1
                front, rear = sorted((n, before))
                if before in at and things[front].tail - things[rear].head < 1.0:
                    at.add(n)
        return {things[n].number for n in at}

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
                self.lives[near.number].ids.add(id)
                self._whose.setdefault(id, set()).add(near.number)


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
        await line.done(ConveyorCommand.RESET)
        await line.start()

    async def attend(self) -> None:
        """A lost product holds the end of the line until a person has looked: it is there (confirm) or not (delete)."""
        line = self.line
        bits = await line.port.read(0x0103, 2)
        if not (bits[0] >> 5 & 1 and bits[1] >> 7 & 1):
            return
        rows = await line.products()
        for id, row in rows.items():
            if row["state"] != 5 or row["head"] < line.device.geometry.length - self.REACH:
                continue
            if any(self._is_its(product, row, rows) for product in line.true()):
                await line.order(ConveyorCommand.CONFIRM, id)
            else:
                await line.order(ConveyorCommand.DELETE, id)
                self.deleted += 1

    def _is_its(self, product: Any, row: dict[str, float], rows: dict[int, dict[str, float]]) -> bool:
        """It lies there, and is not the product of a row that is nearer."""
        away = abs(product.head - row["head"])
        return away < self.REACH and all(away <= abs(product.head - other["head"]) for other in rows.values())

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
            await line.done(ConveyorCommand.DELETE, id)
            self.deleted += 1
        for product in list(line.true()):
            row = matched.get(product.number)
            if row is None and product.head < sensor:
                continue
            doubtful = row is not None and row["state"] not in (1, 2, 4, 6)
            inside = product.tail >= 0 and product.head <= line.device.geometry.length
            if row is not None and not doubtful and abs(row["head"] - product.head) < 2:
                continue
            if row is not None and inside and product.tail > sensor + 1:
                answer = await line.order(
                    ConveyorCommand.EDIT, int(row["id"]), real(product.head), real(product.length)
                )
                if answer.state is AnswerState.DONE:
                    self.edited += 1
                    continue
            await self._take_off(product.number)
            if row is not None and int(row["id"]) in await line.products():
                await line.done(ConveyorCommand.DELETE, int(row["id"]))
                self.deleted += 1

    async def _take_off(self, number: int) -> None:
        numbers = [product.number for product in self.line.true()]
        await self.line.train(own.REG_REMOVE, numbers.index(number) + 1)
        self.taken_off += 1


def codes_of(events: Iterable[DeviceEvent]) -> Counter[int]:
    return Counter(event.code for event in events)
