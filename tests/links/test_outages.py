"""After a fault is over the values are good again within two seconds, on every road, however long it lasted."""

import asyncio
from collections.abc import AsyncIterator, Mapping, Sequence
from contextlib import asynccontextmanager
from dataclasses import replace
from random import Random

import pytest

from app.errors import DeviceException
from app.links.statistics import LinkState
from app.links.training_head import MAGIC
from app.plant.definitions import Device, Equipment, Link, Scan
from app.registers.register import Type
from app.sim.bus import Answer, Bus, LineFaultMode
from app.sim.server import TcpServer
from app.sim.training import LineFault
from app.tags.quality import is_bad, is_good
from tests.links.devices import (
    QUICK,
    SIMULATED,
    Gateway,
    Line,
    RegisterDevice,
    machine,
    on_bus,
    point,
    row,
    running,
    serving,
    tcp_link,
    until,
)
from tests.links.plc_devices import SmallPlc, plant
from tests.virtual import loop_clock
from tests.wires import serve_line

KINDS = ("memory", "tcp", "rtu")
BACK = 2.0
DRIVE = Device(timeout=0.25, fast=0.1)
MODES = [mode for mode in LineFaultMode if mode not in (LineFaultMode.NONE, LineFaultMode.SLOW)]
LENGTHS = (1.0, 4.0, 12.0)


@asynccontextmanager
async def line(kind: str, bus: Bus, *units: int, equipment: Sequence[Equipment] | None = None) -> AsyncIterator[Line]:
    server, tty = TcpServer(bus), None
    link = Link("hall", "memory")
    if kind == "tcp":
        await server.start("127.0.0.1", 0)
        link = Link("hall", "tcp", host="127.0.0.1", tcp_port=server.address[1])
    elif kind == "rtu":
        tty = await serve_line(bus, 38400)
        link = Link("hall", "rtu", port=tty.path, baud=38400, parity="none", stop_bits=2)
    machines = equipment or [row(f"m{unit}", unit, 25, DRIVE) for unit in units]
    try:
        async with running(machines, exchange=on_bus(bus) if kind == "memory" else None, link=link) as made:
            yield made
    finally:
        await server.close()
        if tty is not None:
            await tty.close()


async def back_after(
    kind: str, mode: LineFaultMode, seconds: float, *, beside: bool, equipment: Sequence[Equipment] | None = None
) -> float:
    """How long it takes from the end of a fault of unit 1 until its values are good [s]."""
    devices = {unit: RegisterDevice({n: 0 for n in range(25)}) for unit in ((1, 2) if beside else (1,))}
    async with line(kind, Bus(devices), *devices, equipment=equipment) as made:
        await until(lambda: all(is_good(made.quality(f"m{unit}.v0")) for unit in devices))
        await asyncio.sleep(0.5)
        devices[1].line_fault = replace(LineFault(), mode=mode, argument=4 if mode is LineFaultMode.EXCEPTION else 0)
        devices[1].words = {n: 7 for n in range(25)}
        await until(lambda: is_bad(made.quality("m1.v0")))
        await asyncio.sleep(seconds)
        assert not beside or is_good(made.quality("m2.v0"))
        assert not is_good(made.quality("m1.v0"))
        devices[1].line_fault = LineFault()
        devices[1].words = {n: 9 for n in range(25)}
        return await until(lambda: is_good(made.quality("m1.v0")) and made.value("m1.v0") == 9)


@pytest.mark.sweep(8)
@pytest.mark.parametrize("beside", [False, True])
@pytest.mark.parametrize("kind", KINDS)
async def test_a_unit_is_back_within_two_seconds_whatever_was_wrong_and_however_long(kind: str, beside: bool) -> None:
    cases = [(mode, seconds) for mode in MODES for seconds in LENGTHS]
    took = await asyncio.gather(*(back_after(kind, *case, beside=beside) for case in cases))
    late = {(mode.name, seconds): round(found, 2) for (mode, seconds), found in zip(cases, took, strict=True)}
    assert not {case: found for case, found in late.items() if found > BACK}, late


@pytest.mark.sweep(4)
async def test_a_drive_that_is_looked_at_for_a_plc_in_its_place_is_back_as_soon() -> None:
    drive = [row("m1", 1, 3, replace(DRIVE, makers_map=True))]
    cases = [(mode, seconds) for mode in MODES for seconds in (2.0, 3.0, *LENGTHS)]
    took = await asyncio.gather(*(back_after("rtu", *case, beside=False, equipment=drive) for case in cases))
    late = {(mode.name, seconds): round(found, 2) for (mode, seconds), found in zip(cases, took, strict=True)}
    assert not {case: found for case, found in late.items() if found > BACK}, late


REFUSALS = (1, 2, 3, 4, 6, 7, 10, 11)
PARTS = (range(25), range(12, 25), (0,), (3, 17))
"""Registers that are refused for a while."""


@pytest.mark.sweep(8)
@pytest.mark.parametrize("kind", KINDS)
async def test_registers_that_were_refused_for_a_while_are_back_within_two_seconds(kind: str) -> None:
    took = await asyncio.gather(
        *(back_after_refusals(kind, code, part, seconds) for code in REFUSALS for part in PARTS for seconds in LENGTHS)
    )
    assert not {case: round(found, 2) for case, found in took if found > BACK}


async def back_after_refusals(
    kind: str, code: int, part: Sequence[int], seconds: float
) -> tuple[tuple[int, Sequence[int], float], float]:
    """From the end of the refusals until every value is good and new [s]."""
    device = Refusing({n: 0 for n in range(25)})
    names = [f"m1.v{n}" for n in range(25)]
    async with line(kind, Bus({1: device}), 1) as made:
        await until(lambda: all(is_good(made.quality(name)) for name in names))
        device.code, device.part = code, frozenset(part)
        await asyncio.sleep(seconds)
        assert not is_good(made.quality(f"m1.v{part[0]}"))
        device.words, device.part = {n: 9 for n in range(25)}, frozenset()
        return (code, part, seconds), await until(
            lambda: all(is_good(made.quality(name)) and made.value(name) == 9 for name in names)
        )


@pytest.mark.sweep(8)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("code", [2, 3])
async def test_a_device_that_refused_at_random_for_a_while_is_read_in_large_pieces_again(kind: str, code: int) -> None:
    """It looks as if it took fewer registers at once; values of two registers could then not be read for ever."""
    took = await asyncio.gather(*(back_after_a_spell(kind, Random(seed), code) for seed in range(6)))
    assert max(took) <= BACK, took


async def back_after_a_spell(kind: str, random: Random, code: int) -> float:
    """From the end of ten seconds of refusals until every value is good and new [s]."""
    device = Moody({n: 0 for n in range(40)}, random, code)
    points = [point("m1", f"v{n}", 2 * n, words=2, type=Type.U32) for n in range(12)] + [point("m1", "w", 30)]
    async with line(kind, Bus({1: device}), 1, equipment=[machine("m1", 1, points, QUICK)]) as made:
        names = [item.name for item in points]
        await until(lambda: all(is_good(made.quality(name)) for name in names))
        usual = max(count for _, count in device.reads)
        device.part = 0.4
        await asyncio.sleep(10)
        device.words, device.part = {n: 9 for n in range(40)}, 0.0
        took = await until(lambda: all(is_good(made.quality(name)) and made.value(name) for name in names))
        await asyncio.sleep(1)
        assert usual in {count for _, count in device.reads[-8:]}, "in large pieces again"
        return took


class Moody(RegisterDevice):
    """A device that refuses a part of all reads at random."""

    part = 0.0

    def __init__(self, words: Mapping[int, int], random: Random, code: int) -> None:
        super().__init__(words)
        self.random, self.code = random, code

    def read(self, function: int, address: int, count: int) -> list[int]:
        if self.random.random() < self.part:
            raise DeviceException(self.code)
        return super().read(function, address, count)


class Refusing(RegisterDevice):
    """A device that refuses some registers for a while."""

    code = 0
    part: frozenset[int] = frozenset()

    def read(self, function: int, address: int, count: int) -> list[int]:
        if self.part & set(range(address, address + count)):
            raise DeviceException(self.code)
        return super().read(function, address, count)


async def test_all_units_of_a_line_whose_cable_was_out_are_back_at_once() -> None:
    devices = {unit: RegisterDevice({n: 0 for n in range(25)}) for unit in range(1, 7)}
    async with line("rtu", Bus(devices), *devices) as made:
        await until(lambda: all(is_good(made.quality(f"m{unit}.v0")) for unit in devices))
        for device in devices.values():
            device.line_fault = replace(LineFault(), mode=MODES[0])
        await until(lambda: all(is_bad(made.quality(f"m{unit}.v0")) for unit in devices))
        await asyncio.sleep(6.0)
        for device in devices.values():
            device.line_fault = LineFault()
        assert await until(lambda: all(is_good(made.quality(f"m{unit}.v0")) for unit in devices)) < BACK + 1.0


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("lost", [1, 2, 3])
async def test_answers_lost_at_the_first_look_at_a_plc_keep_nobody_waiting(kind: str, lost: int) -> None:
    left = [lost]

    def fault(pdu: bytes) -> str:
        if pdu[:3] == b"\x03\x00\x00" and left[0]:
            left[0] -= 1
            return "answer"
        return ""

    device = SmallPlc()
    async with plant(device, kind, start=False) as (line, bus):
        bus.fault = fault
        began = loop_clock().monotonic()
        task = asyncio.create_task(line.link.run())
        try:
            await until(lambda: line.value("p.state") == 1, 20)
            assert left == [0]
            assert loop_clock().monotonic() - began < 2.0 + lost * 0.5
        finally:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)


class Closing(asyncio.Protocol):
    """A gateway that closes each connection after so many `answers`; below 0 it does not."""

    open: "Closing"
    opened = 0

    def __init__(self, bus: Bus, hard: bool) -> None:
        self.bus, self.hard = bus, hard

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self.transport, self.left = transport, self.answers
        Closing.open, Closing.opened = self, Closing.opened + 1
        if not self.left:
            transport.abort()

    answers = -1

    def data_received(self, data: bytes) -> None:
        while data and not self.transport.is_closing():
            length = 6 + int.from_bytes(data[4:6], "big")
            head, unit, pdu, data = data[:4], data[6], data[7:length], data[length:]
            answer = self.bus.answer(unit, pdu).pdu
            if answer is not None:
                self.transport.write(head + (len(answer) + 1).to_bytes(2, "big") + bytes((unit,)) + answer)
                self.left -= 1
            if not self.left:
                (self.transport.abort if self.hard else self.transport.close)()


@pytest.mark.parametrize("hard", [False, True])
@pytest.mark.parametrize("answers", [0, 1, 2, 3, 5, 11])
async def test_a_gateway_that_closes_after_each_answer_is_not_called_without_end(
    answers: int, hard: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    bus, loop = Bus({1: RegisterDevice({n: 0 for n in range(25)})}), asyncio.get_running_loop()
    server = await loop.create_server(lambda: Closing(bus, hard), "127.0.0.1", 0)
    link = Link("hall", "tcp", host="127.0.0.1", tcp_port=server.sockets[0].getsockname()[1])
    async with running([row("m1", 1, 25, DRIVE)], link=link) as made:
        await until(lambda: is_good(made.quality("m1.v0")))
        await asyncio.sleep(5)
        monkeypatch.setattr(Closing, "opened", 0)
        Closing.open.transport.abort()  # lost after a long time it is opened again at once
        assert await until(lambda: is_good(made.quality("m1.v0"))) < 0.3
        monkeypatch.setattr(Closing, "answers", answers)
        Closing.open.transport.abort()
        await asyncio.sleep(10)
        assert 5 <= Closing.opened <= 40
        monkeypatch.setattr(Closing, "answers", -1)
        assert await until(lambda: is_good(made.quality("m1.v0"))) <= BACK
    server.close()


@pytest.mark.parametrize("kind", ["memory", "rtu"])
async def test_a_unit_that_is_back_later_than_others_after_a_long_silence_of_all_is_good_within_two_seconds(
    kind: str,
) -> None:
    """Power comes back, and drives start one after the other."""
    devices = {unit: RegisterDevice({n: 0 for n in range(25)}) for unit in (1, 2)}
    async with line(kind, Bus(devices), 1, 2, 3) as made:
        await until(lambda: all(is_good(made.quality(f"m{unit}.v0")) for unit in devices))
        for device in devices.values():
            device.line_fault = replace(LineFault(), mode=LineFaultMode.SILENT)
        await asyncio.sleep(20.0)
        devices[1].line_fault = LineFault()
        await until(lambda: is_good(made.quality("m1.v0")))
        await asyncio.sleep(3.0)
        devices[2].line_fault = LineFault()
        assert await until(lambda: is_good(made.quality("m2.v0"))) < BACK


async def test_a_unit_does_not_wait_for_one_that_was_never_there() -> None:
    devices = {unit: RegisterDevice({n: 0 for n in range(25)}) for unit in (1, 2)}
    async with line("memory", Bus(devices), 1, 2, 3) as made:
        await until(lambda: all(is_good(made.quality(f"m{unit}.v0")) for unit in devices))
        for moment in range(12):
            devices[1].line_fault = replace(LineFault(), mode=LineFaultMode.SILENT)
            await until(lambda: is_bad(made.quality("m1.v0")))
            await asyncio.sleep(0.1 * moment)
            devices[1].line_fault = LineFault()
            assert await until(lambda: is_good(made.quality("m1.v0"))) < BACK


@pytest.mark.parametrize("code", [0, 10, 11])
async def test_a_silent_unit_is_not_up_for_a_moment_whenever_its_connection_is_opened_again(code: int) -> None:
    """It was, every 5 s for a time-out or two, and with it the link: nobody had answered, and the alarm began anew."""
    gateway = Gateway({unit: RegisterDevice({n: n for n in range(5)}) for unit in (1, 2)}, code)
    gateway.unreached, gateway.answered = {1, 2}, lambda: bool(code)
    server = await serving(gateway)
    seen: set[LinkState] = set()
    async with running([row("m1", 1, 5, DRIVE), row("m2", 2, 5, DRIVE)], link=tcp_link(server)) as made:

        def note(_: object) -> None:
            seen.update((made.link.statistics.state, *(unit.state for unit in made.link.stations.values())))

        made.tags.subscribe(note)
        await asyncio.sleep(20)
        assert seen == {LinkState.CONNECTING, LinkState.DOWN}
        gateway.unreached = {2}
        assert await until(lambda: is_good(made.quality("m1.v0"))) <= BACK
        assert made.link.statistics.state is LinkState.SOME_SILENT
    await server.close()


@pytest.mark.parametrize("code", [5, 6, 10, 11])
async def test_a_simulated_device_whose_first_look_is_refused_for_a_moment_is_not_taken_for_a_real_one(
    code: int,
) -> None:
    head = dict(enumerate((MAGIC, 1, 1, 1), DRIVE.training))
    gateway = Gateway({1: RegisterDevice({0: 7, **head})}, code)
    gateway.unreached = {1}
    server = await serving(gateway)
    async with running([row("m", 1, 1, DRIVE)], link=tcp_link(server)) as made:
        await asyncio.sleep(0.02)
        gateway.unreached = set()
        await until(lambda: is_good(made.quality("m.v0")))
        assert made.quality("m.v0") & SIMULATED
    await server.close()


@pytest.mark.parametrize("lost", [2, 4])
async def test_a_simulated_device_whose_first_looks_are_lost_is_marked_when_it_says_so(lost: int) -> None:
    """It stayed without its mark until it was silent the next time: what it says once and never again as well."""

    class Deaf(Bus):
        def answer(self, unit: int, pdu: bytes) -> Answer:
            nonlocal lost
            if int.from_bytes(pdu[1:3], "big") == DRIVE.training and lost:
                lost -= 1
                return Answer(unit, None)
            return super().answer(unit, pdu)

    head = dict(enumerate((MAGIC, 1, 1, 1), DRIVE.training))
    server = await serving(Deaf({1: RegisterDevice({0: 7, 1: 8, **head})}))
    points = [point("m", "v0", 0), point("m", "once", 1, Scan.ONCE), point("m", "missing", 5)]
    link = replace(tcp_link(server), believe_simulated=True)
    async with running([machine("m", 1, points, DRIVE)], link=link) as made:
        await until(lambda: is_good(made.quality("m.v0")), BACK)
        assert not made.quality("m.v0") & SIMULATED
        assert not made.link.simulated
        await until(lambda: made.link.simulated, 9.0)
        await until(lambda: all(made.quality(one.name) & SIMULATED for one in points), BACK)
        assert is_good(made.quality("m.once"))
    await server.close()


@pytest.mark.sweep(8)
async def test_a_device_that_says_nothing_of_these_registers_is_not_asked_for_ever() -> None:
    device, asked = RegisterDevice({0: 7}), list[float]()

    class Silent(Bus):
        def answer(self, unit: int, pdu: bytes) -> Answer:
            if int.from_bytes(pdu[1:3], "big") == DRIVE.training:
                asked.append(asyncio.get_running_loop().time())
                return Answer(unit, None)
            return super().answer(unit, pdu)

    server = await serving(Silent({1: device}))
    async with running([row("m", 1, 1, DRIVE)], link=tcp_link(server)) as made:
        await until(lambda: is_good(made.quality("m.v0")), BACK)
        await asyncio.sleep(300)
        assert is_good(made.quality("m.v0"))
        assert len(asked) == 8
        assert asked[-1] - asked[0] < 70
    await server.close()


async def test_a_device_that_is_silent_where_it_has_no_registers_is_read_behind_a_gateway() -> None:
    class Terse(RegisterDevice):
        def read(self, function: int, address: int, count: int) -> list[int]:
            if address not in self.words:
                raise DeviceException(11)
            return super().read(function, address, count)

    server = await serving(Bus({1: Terse({0: 7})}))
    async with running([row("m", 1, 1, DRIVE)], link=tcp_link(server)) as made:
        await until(lambda: is_good(made.quality("m.v0")), BACK)
    await server.close()


async def test_a_device_that_hangs_up_where_it_has_no_registers_is_read() -> None:
    bus, loop, lost = Bus({1: RegisterDevice({0: 7})}), asyncio.get_running_loop(), list[float]()

    class Abrupt(Closing):
        def data_received(self, data: bytes) -> None:
            if int.from_bytes(data[8:10], "big") == DRIVE.training:
                lost.append(loop.time())
                self.transport.abort()
            else:
                super().data_received(data)

    server = await loop.create_server(lambda: Abrupt(bus, hard=True), "127.0.0.1", 0)
    link = Link("hall", "tcp", host="127.0.0.1", tcp_port=server.sockets[0].getsockname()[1])
    async with running([row("m", 1, 1, DRIVE)], link=link) as made:
        await until(lambda: is_good(made.quality("m.v0")), BACK)
        await asyncio.sleep(300)
        assert is_good(made.quality("m.v0"))
        assert len(lost) == 2
    server.close()


class Unhurried(Bus):
    """A device that takes 0.9 s for each answer, and now and then has an exception in its place, or none."""

    instead: tuple[int, ...] = ()
    """Codes in the place of the next answers; 0: none comes."""

    def answer(self, unit: int, pdu: bytes) -> Answer:
        code, self.instead = (self.instead or (-1,))[0], self.instead[1:]
        if code < 0:
            return replace(super().answer(unit, pdu), delay=0.9)
        return Answer(unit, bytes([pdu[0] | 0x80, code]) if code else None, 0.0)


@pytest.mark.parametrize("code", [6, 0])
async def test_a_device_that_takes_its_time_is_given_it_when_it_is_asked_again_too(code: int) -> None:
    """It was given 0.8 s then, whatever the plant file said: one telegram that was lost, or a busy device, and it counted as silent."""
    bus = Unhurried({1: RegisterDevice({n: 7 for n in range(4)})})
    slow = Device(timeout=1.5, fast=1.0)
    async with line("memory", bus, equipment=[row("m1", 1, 4, slow)]) as made:
        await until(lambda: is_good(made.quality("m1.v0")), 10)
        await asyncio.sleep(10)
        made.batches.clear()
        for _ in range(5):
            bus.instead = (code,)
            await asyncio.sleep(10)
        assert is_good(made.quality("m1.v0")) and made.value("sys.link.hall.retries") == 5
        lost = [batch for batch in made.batches if batch.source == "link.hall" and is_bad(batch.quality)]
        assert not lost, "it never was silent"
