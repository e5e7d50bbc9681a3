"""What the tests of links talk to: a bare register device on a simulated line, and the words to describe it."""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable, Iterable, Mapping, Sequence
from contextlib import asynccontextmanager
from pathlib import Path

from app.errors import DeviceException
from app.links.contract import Exchange
from app.links.register_link import RegisterLink, statistic_names
from app.plant.definitions import Device, Equipment, EquipmentType, Link, Point, Register, Scan
from app.registers.pdu import Request, exception_answer
from app.sim.bus import Answer as LineAnswer
from app.sim.bus import Bus
from app.sim.plant import exchange
from app.sim.server import TcpServer
from app.sim.training import LineFault
from app.tags.batch import Batch
from app.tags.database import Tag, TagDatabase
from app.tags.quality import Origin
from tests.virtual import loop_clock

SIMULATED = int(Origin.SIMULATED)
QUICK = Device(timeout=0.1, fast=0.02, slow=0.1)


class RegisterDevice:
    """Words by address, with the limits of a real one."""

    def __init__(self, words: Mapping[int, int], *, limit: int = 125, silent_above: int = 125) -> None:
        self.words = dict(words)
        self.limit = limit
        self.silent_above = silent_above
        self.line_fault = LineFault()
        self.requests: list[Request] = []

    def read(self, function: int, address: int, count: int) -> list[int]:
        self.requests.append(Request(function, address, count))
        if function != 3:
            raise DeviceException(1)
        if count > self.limit:
            raise DeviceException(3)
        if any(at not in self.words for at in range(address, address + count)):
            raise DeviceException(2)
        return [self.words[at] for at in range(address, address + count)]

    def write(self, function: int, address: int, words: Sequence[int]) -> None:
        self.requests.append(Request(function, write_address=address, words=tuple(words)))
        for at, word in enumerate(words, address):
            if at not in self.words:
                raise DeviceException(2)
            self.words[at] = word

    def telegram_seen(self) -> None:
        pass

    @property
    def reads(self) -> list[tuple[int, int]]:
        return [(r.address, r.count) for r in self.requests if r.count]

    @property
    def writes(self) -> list[tuple[int, tuple[int, ...]]]:
        return [(r.write_address, r.words) for r in self.requests if r.words]


class Gateway(Bus):
    """A gateway that refuses with `code` in the place of units that it does not reach."""

    def __init__(self, devices: Mapping[int, RegisterDevice], code: int) -> None:
        super().__init__(devices)
        self.code = code
        self.unreached: set[int] = set()
        self.answered: Callable[[], bool] = lambda: True
        """Whether it says so this time."""

    def answer(self, unit: int, pdu: bytes) -> LineAnswer:
        if unit not in self.unreached:
            return super().answer(unit, pdu)
        return LineAnswer(unit, exception_answer(pdu[0], self.code) if self.answered() else None, 0.005)


def point(equipment: str, key: str, address: int, scan: Scan = Scan.FAST, **register: object) -> Point:
    limits = {name: register.pop(name) for name in ("low", "high", "plausible") if name in register}
    return Point(
        name=f"{equipment}.{key}",
        id=f"{equipment}.{key}",
        equipment=equipment,
        key=key,
        label=key,
        scan=scan,
        register=Register(address, **register),  # type: ignore[arg-type]
        **limits,  # type: ignore[arg-type]
    )


def machine(
    name: str, unit: int, points: Iterable[Point], device: Device | None = None, link: str = "hall"
) -> Equipment:
    by_key = {item.key: item for item in points}
    kind = EquipmentType("plc", Path("plc"), "type", device or Device(timeout=0.1), by_key, {}, (), (), {}, (), {})
    return Equipment(name, kind, link, unit, {}, "", by_key, ())


def row(equipment: str, unit: int, count: int, device: Device | None = None, **register: object) -> Equipment:
    """A machine with points v0, v1, … at registers 0, 1, …"""
    return machine(equipment, unit, [point(equipment, f"v{n}", n, **register) for n in range(count)], device)  # type: ignore[arg-type]


def on_bus(bus: Bus) -> Exchange:
    return lambda unit, pdu: exchange(bus, unit, pdu)


class Line:
    """A running link with its tags, and what it published."""

    def __init__(self, link: RegisterLink, tags: TagDatabase) -> None:
        self.link = link
        self.tags = tags
        self.batches: list[Batch] = []
        tags.subscribe(self.batches.append)

    def value(self, name: str) -> object:
        return self.tags.sample(name).value

    def quality(self, name: str) -> int:
        return self.tags.sample(name).quality


@asynccontextmanager
async def running(
    equipment: Sequence[Equipment],
    *,
    exchange: Exchange | None = None,
    link: Link | None = None,
    start: bool = True,
) -> AsyncIterator[Line]:
    """A link over `equipment` that runs until the end of the block."""
    link = link or Link("hall", "memory", writes=True)
    clock = loop_clock()
    tags = TagDatabase(clock)
    names = [(p.name, f"link.{link.name}") for item in equipment for p in item.points.values()]
    names += [(name, "sys") for name in statistic_names(link, [item.unit for item in equipment])]
    tags.configure([Tag(name, name, source) for name, source in names])
    register_link = RegisterLink(link, equipment, tags, clock, exchange=exchange)
    line = Line(register_link, tags)
    task = asyncio.create_task(register_link.run()) if start else None
    try:
        yield line
    finally:
        if task is not None:
            task.cancel()
            results = await asyncio.gather(task, return_exceptions=True)
            if not isinstance(results[0], asyncio.CancelledError):
                raise results[0] or AssertionError("the link ended by itself")


async def until(true: Callable[[], object], limit: float = 30.0) -> float:
    """Wait until `true()`; the seconds that it took."""
    loop = asyncio.get_running_loop()
    began = loop.time()
    while not true():
        if loop.time() - began > limit:
            raise AssertionError(f"not so within {limit} s")
        await asyncio.sleep(0.005)
    return loop.time() - began


Answer = Callable[[int, bytes], Awaitable[bytes | None]]


def tcp_link(server: TcpServer, **options: object) -> Link:
    return Link("hall", "tcp", host="127.0.0.1", tcp_port=server.address[1], **options)  # type: ignore[arg-type]


async def serving(bus: Bus, port: int = 0) -> TcpServer:
    server = TcpServer(bus)
    await server.start("127.0.0.1", port)
    return server


def writable(device: Device = QUICK, unit: int = 1) -> list[object]:
    return [
        point("m", "speed", 0),
        point("m", "command", 0x20, readable=False, writable=True),
        point("m", "setpoint", 1, Scan.ONCE, writable=True, scale=0.01),
        point("m", "flags", 2, mask=0xF, shift=4, writable=True),
    ]
