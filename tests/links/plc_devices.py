"""A small virtual Pogon PLC, a bus that loses chosen telegrams, and the three roads to it."""

import asyncio
from collections.abc import AsyncIterator, Callable, Iterable, Sequence
from contextlib import asynccontextmanager
from pathlib import Path
from struct import pack

from app.plant.definitions import (
    Device,
    Equipment,
    EquipmentType,
    Image,
    Link,
    PlcMap,
    Point,
    Scan,
    TableMap,
    Type,
)
from app.registers import plc_map
from app.registers.pdu import exception_answer
from app.registers.plc_map import AnswerState, Request, real_of
from app.sim import plc
from app.sim.bus import Answer, Bus
from app.sim.plc import Setting, Table, Verdict, VirtualPlc
from app.sim.server import TcpServer
from tests.links.devices import Line, on_bus, point, running
from tests.wires import serve_line

STATUS, CONFIGURATION, SETTINGS, STAGING, TABLE = 0x0100, 0x0180, 0x0200, 0x0240, 0x0800
STATUS_WORDS, CONFIGURATION_WORDS, SETTINGS_WORDS, ROW_WORDS = 8, 6, 12, 8
TYPE_CODE = 77
KINDS = ("memory", "tcp", "rtu")

START, STOP, LONG, NOT_NOW = 1, 2, 3, 4
REASON_NOT_NOW = 12


class SmallPlc(VirtualPlc):
    """Counts scans, keeps things in a table, and remembers every command that it executed."""

    type = "small"
    TYPE_CODE = TYPE_CODE

    def __init__(self, slots: int = 40) -> None:
        self.executed: list[tuple[int, tuple[int, ...]]] = []
        self.counter = 0
        self.size = 5
        self.things: dict[int, float] = {}
        self.row_generation = 0
        self.torn: set[int] = set()
        """Images by address whose last word does not match."""
        self.torn_rows: set[int] = set()
        self.header: dict[int, int] = {}
        """Words of the header that are other than they should be."""
        self.heartbeats: list[int] = []
        self.holds: list[tuple[int, ...]] = []
        self.reads: list[tuple[int, int]] = []
        self.row_size = ROW_WORDS
        self.acknowledgements: list[int] = []
        self.commits = 0
        self._state = 1
        self.table = Table(TABLE, ROW_WORDS, slots, self._row)
        super().__init__(
            settings=[
                Setting("a", 1.0, 0.0, 10.0),
                Setting("b", 2.0, 0.0, 10.0),
                Setting("c", 3.0, 0.0, 10.0),
                Setting("d", 0.0, 0.0, 1.0),
            ],
            settings_at=SETTINGS,
            staging_at=STAGING,
            images=[
                plc.Image(STATUS, STATUS_WORDS, lambda: pack(">HIfH", self._state, self.counter, 1.5, 0)),
                plc.Image(CONFIGURATION, CONFIGURATION_WORDS, lambda: pack(">HHHH", self.size, 0, 0, 0)),
            ],
            configuration=CONFIGURATION,
            tables=[self.table],
        )
        self._start_up()

    @property
    def state(self) -> int:
        return self._state

    def _row(self, slot: int) -> bytes:
        id = self.table.ids[slot]
        first = self.row_generation
        last = first + 2 if slot in self.torn_rows else first
        return pack(">IHHfHH", id, first, 3 if id else 0, self.things.get(slot, 0.0), 0, last)

    def put(self, id: int, slot: int | None = None, value: float = 1.0) -> None:
        taken = self.table.take(id) if slot is None else slot
        assert taken is not None
        self.table.ids[taken] = id
        self.things[taken] = value

    def _scan(self) -> None:
        self.counter += 1

    def _execute(self, request: Request) -> Verdict:
        if request.code == NOT_NOW:
            return plc.rejected(REASON_NOT_NOW, 7)
        self.executed.append((request.code, tuple(request.arguments)))
        if request.code == LONG:
            until = self.steps + 30
            return Verdict(
                AnswerState.RUNNING,
                until=lambda: AnswerState.DONE if self.steps >= until else AnswerState.RUNNING,
            )
        self._state = 1 if request.code == STOP else 2
        return Verdict()

    def _settings_changed(self) -> None:
        self.commits += 1

    def _power_up(self) -> None:
        pass

    def _forget(self) -> None:
        self.things.clear()

    def read(self, function: int, address: int, count: int) -> list[int]:
        self.reads.append((address, count))
        words = super().read(function, address, count)
        if address in self.torn:
            words[-1] = words[-1] + 2 & 0xFFFF
        if address == plc_map.HEADER:
            for at, word in self.header.items():
                if at < count:
                    words[at] = word
        if address == TABLE:
            words[3] = self.row_size
        return words

    def write(self, function: int, address: int, words: Sequence[int]) -> None:
        super().write(function, address, words)
        if address == plc_map.AT_HOST_HEARTBEAT:
            self.heartbeats.append(words[0])
        elif address == plc_map.HOLD:
            self.holds.append(tuple(words))
        elif address == plc_map.EVENTS + plc_map.AT_ACKNOWLEDGED:
            self.acknowledgements.append(words[0] << 16 | words[1])

    def starts(self) -> list[float]:
        """First argument of every start that was executed."""
        return [real_of(arguments[0]) for code, arguments in self.executed if code == START]


Fault = Callable[[bytes], str]


class FaultyBus(Bus):
    """Spoils the telegrams that `fault` names.

    `request` is lost, or `answer`, or comes `late`; a `gateway` says that it did not come; the device is `busy`.
    """

    def __init__(self, device: SmallPlc) -> None:
        super().__init__({1: device})
        self.fault: Fault = lambda pdu: ""
        self.spoiled = 0
        self.late = 0.4
        """How late a late answer is [s]."""

    def answer(self, unit: int, pdu: bytes) -> Answer:
        kind = self.fault(pdu)
        if not kind:
            return super().answer(unit, pdu)
        self.spoiled += 1
        if kind == "request":
            return Answer(unit, None)
        if kind == "busy":
            return Answer(unit, exception_answer(pdu[0], 6))
        said = super().answer(unit, pdu)
        if kind == "answer":
            return Answer(unit, None)
        if kind == "gateway":
            return Answer(unit, exception_answer(pdu[0], 11))
        return Answer(unit, said.pdu, self.late)


def command_of(pdu: bytes) -> int:
    """Code of the command in a request; 0 = it is something else."""
    return int.from_bytes(pdu[6:8], "big") if pdu[0] == 16 and pdu[1:3] == bytes((3, 0)) else 0


def once(kind: str, which: Callable[[bytes], object], times: int = 1) -> Fault:
    """The first `times` requests of `which` meet `kind`."""
    left = times

    def fault(pdu: bytes) -> str:
        nonlocal left
        if left and which(pdu):
            left -= 1
            return kind
        return ""

    return fault


MAP = PlcMap(
    type_code=TYPE_CODE,
    images=(Image(STATUS, STATUS_WORDS), Image(CONFIGURATION, CONFIGURATION_WORDS)),
    settings=Image(SETTINGS, SETTINGS_WORDS),
    staging=STAGING,
    status="state",
    events=True,
)
ROWS = TableMap("thing", TABLE, ROW_WORDS, "40", ("id", "state", "value"))
DEVICE = Device(
    timeout=0.15,
    fast=0.03,
    slow=0.2,
    max_write=123,
    write_functions=(6, 16),
    services=(MAP,),
)


def small_points(name: str = "p", slots: int = 40) -> list[Point]:
    points = [
        point(name, "boots", plc_map.AT_BOOTS, Scan.SLOW),
        point(name, "crc", plc_map.AT_CRC, Scan.SLOW, type=Type.U32, words=2),
        point(name, "state", STATUS + 1),
        point(name, "counter", STATUS + 2, type=Type.U32, words=2),
        point(name, "level", STATUS + 4, type=Type.F32, words=2),
        point(name, "size", CONFIGURATION + 1, Scan.ONCE),
        point(name, "thing_generation", TABLE),
        point(name, "thing_count", TABLE + 2),
    ]
    points += [
        point(name, key, SETTINGS + 2 + 2 * n, Scan.SLOW, type=Type.F32, words=2, writable=True)
        for n, key in enumerate("abc")
    ]
    for slot in range(slots):
        row = TABLE + plc_map.TABLE_HEAD + slot * ROW_WORDS
        points += [
            point(name, f"thing_{slot + 1}_id", row, type=Type.U32, words=2),
            point(name, f"thing_{slot + 1}_state", row + 3),
            point(name, f"thing_{slot + 1}_value", row + 4, type=Type.F32, words=2),
        ]
    return points


def small(name: str = "p", unit: int = 1, slots: int = 40, device: Device = DEVICE) -> Equipment:
    by_key = {item.key: item for item in small_points(name, slots)}
    kind = EquipmentType("small", Path("small"), "type", device, by_key, {}, (), (), {}, (), {}, tables={"thing": ROWS})
    return Equipment(name, kind, "hall", unit, {}, "", by_key, (), tables={"thing": slots})


async def scan_for_ever(device: SmallPlc) -> None:
    """A scan every 10 ms, as a PLC has it."""
    loop = asyncio.get_running_loop()
    due = loop.time()
    while True:
        device.step()
        due += 0.01
        await asyncio.sleep(max(0.0, due - loop.time()))


@asynccontextmanager
async def plant(
    device: SmallPlc,
    kind: str = "memory",
    *,
    equipment: Iterable[Equipment] = (),
    start: bool = True,
    writes: bool = True,
) -> AsyncIterator[tuple[Line, FaultyBus]]:
    """A running link to the running device, over memory, TCP or a serial line."""
    bus = FaultyBus(device)
    server, tty = TcpServer(bus), None
    scans = asyncio.create_task(scan_for_ever(device))
    link = Link("hall", "memory", writes=writes)
    if kind == "tcp":
        await server.start("127.0.0.1", 0)
        link = Link("hall", "tcp", host="127.0.0.1", tcp_port=server.address[1], writes=writes)
    elif kind == "rtu":
        tty = await serve_line(bus, 115200)
        link = Link("hall", "rtu", port=tty.path, baud=115200, parity="none", stop_bits=2, writes=writes)
    machines = list(equipment) or [small()]
    try:
        async with running(
            machines, exchange=on_bus(bus) if kind == "memory" else None, link=link, start=start
        ) as line:
            yield line, bus
    finally:
        scans.cancel()
        await asyncio.gather(scans, return_exceptions=True)
        await server.close()
        if tty is not None:
            await tty.close()
