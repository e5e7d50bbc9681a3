"""A PLC whose program stands while its server answers is found out, and no other one is accused."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest

from app import bundled
from app.clock import ManualClock
from app.errors import DeviceException, Refused
from app.links.pulse import FIRST, LAST, STANDS, Pulse
from app.links.register_link import RegisterLink
from app.plant.definitions import Link
from app.registers import plc_map
from app.sim.bus import Bus
from app.sim.plant import SimPlant, read_simulated
from app.sim.server import TcpServer
from app.tags.database import Tag, TagDatabase
from app.tags.quality import HALTED, QualityReason, is_good, reason
from tests.links.devices import on_bus, until
from tests.links.plc_devices import KINDS, START, STATUS, STOP, SmallPlc, plant
from tests.virtual import loop_clock
from tests.wires import serve_line

MACHINES = ("c1", "cc1", "seq1")


class Program:
    """A PLC as a link sees it, in its own time; `until` when its program goes round, `again` from when on."""

    def __init__(self, scan: float, *, first: int = 0, moving: bool = True, step: bool = True) -> None:
        self.scan, self.first, self.moving, self.step = scan, first, moving, step
        self.stops: list[tuple[float, float]] = []
        self.restarted = float("inf")

    def scans(self, now: float) -> int:
        lost = sum(max(0.0, min(now, end) - begin) for begin, end in self.stops)
        return int((now - lost + 1e-9) / self.scan)

    def header(self, now: float) -> list[int]:
        scans = self.scans(now)
        heartbeat = scans - self.scans(self.restarted) if now >= self.restarted else self.first + scans
        words = [0] * (LAST - FIRST + 1)
        words[0] = heartbeat & 0xFFFF
        if self.step:
            words[plc_map.AT_STEP - FIRST : plc_map.AT_STEP - FIRST + 4] = plc_map.time_words(scans)
        return words

    def image(self, now: float) -> list[int]:
        mark = self.scans(now) << 1 & 0xFFFE if self.moving else 4
        return [mark, 0, mark]


def watch(program: Program, until: float, *, period: float = 0.1, answer: float = 0.01) -> list[tuple[float, bool]]:
    """The times at which a pulse that is looked at as a link does changes its mind, until `until` [s]."""
    pulse, now, told = Pulse(), 0.0, list[tuple[float, bool]]()
    pulse.begin(now)
    next_image = 0.0
    while now < until:
        if now >= next_image:
            pulse.image(STATUS, program.image(now + answer / 2), now)
            next_image += period
        if now >= pulse.due:
            pulse.header(program.header(now + answer / 2), now, now + answer)
            now += answer
        now += 0.01
        if pulse.halted != (told[-1][1] if told else False):
            told.append((now, pulse.halted))
    return told


@pytest.mark.sweep(8)
@pytest.mark.parametrize("moving", [True, False])
@pytest.mark.parametrize("first", [0, 65_500])
@pytest.mark.parametrize("scan", [0.001, 0.01, 0.05, 0.2, 0.5, 0.6])
@pytest.mark.parametrize("answer", [0.001, 0.09, 0.4])
def test_a_program_that_goes_round_is_never_accused(scan: float, first: int, moving: bool, answer: float) -> None:
    for step in (True, False):
        assert watch(Program(scan, first=first, moving=moving, step=step), 60.0, answer=answer) == []


@pytest.mark.parametrize("period", [0.1, 0.5, 2.0])
@pytest.mark.parametrize("moving", [True, False])
@pytest.mark.parametrize("scan", [0.01, 0.1, 0.3, 0.5])
def test_one_that_stands_is_found_in_time_and_cleared_when_it_goes_on(scan: float, moving: bool, period: float) -> None:
    for begin in (10.0, 13.37):
        program = Program(scan, moving=moving)
        program.stops.append((begin, begin + 30.0))
        (found, first), (gone, last) = watch(program, 60.0, period=period)
        limit = max(STANDS, 3 * scan)
        assert first and begin + limit - scan - 0.1 <= found <= begin + 2.2 * limit + 0.5
        assert not last and begin + 30.0 <= gone <= begin + 30.0 + scan + 0.7


@pytest.mark.parametrize("stop", [0.3, 0.6, 0.9])
def test_a_scan_that_takes_long_for_once_is_none(stop: float) -> None:
    program = Program(0.01)
    program.stops = [(begin, begin + stop) for begin in (5.0, 9.0, 13.0, 17.0, 40.0)]
    assert watch(program, 60.0) == []


def test_a_restart_is_none_and_what_was_learnt_of_the_scan_stays() -> None:
    for scan in (0.01, 0.5):
        program = Program(scan)
        program.restarted = 20.0
        assert watch(program, 40.0) == []


def test_time_in_which_nobody_looked_accuses_nobody() -> None:
    pulse, program = Pulse(), Program(0.01)
    pulse.begin(0.0)
    for now in (0.0, 0.1, 0.2, 0.3):
        pulse.header(program.header(now), now, now)
    program.stops.append((0.3, 30.0))  # both were suspended
    pulse.header(program.header(30.0), 30.0, 30.0)
    assert not pulse.halted
    pulse.header(program.header(30.1), 30.1, 30.1)
    assert not pulse.halted and pulse.due > 30.1


@pytest.mark.parametrize("kind", KINDS)
async def test_its_values_are_uncertain_with_the_reason_and_only_a_stop_is_sent(
    kind: str, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level("INFO")
    device = SmallPlc()
    device.put(11, value=2.5)
    names = ("p.counter", "p.level", "p.size", "p.boots", "p.a", "p.thing_1_value", "p.thing_count")
    async with plant(device, kind) as (line, _):
        await until(lambda: all(is_good(line.quality(name)) for name in names))
        step, device.step = device.step, lambda: None  # type: ignore[method-assign]
        assert await until(lambda: line.link.halted("p"), 10) < 5
        assert {line.quality(name) & 0xFF for name in names} == {HALTED}
        assert line.value("p.thing_1_value") == 2.5, "the last value stays to be seen"
        for refused in (line.link.order("p", START), line.link.write("p", "a", 2.0), line.link.hold("p", 1, 1)):
            with pytest.raises(Refused, match="program_halted"):
                await refused
        stop = asyncio.create_task(line.link.order("p", STOP, urgent=True))
        await until(lambda: any(words[0] == STOP for _, words in device._pending), 5)
        await line.link.hold("p", 0, 2)
        device.step = step  # type: ignore[method-assign]
        assert await until(lambda: all(is_good(line.quality(name)) for name in names), 10) < 5
        await asyncio.gather(stop, return_exceptions=True)
        assert [code for code, _ in device.executed] == [STOP]
        await line.link.order("p", START)
        assert not line.link.halted("p")
    assert caplog.text.count("program stands still") == caplog.text.count("program goes on") == 1
    assert "link down" not in caplog.text and "restarted" not in caplog.text


@pytest.mark.parametrize("kind", KINDS)
async def test_one_that_stands_from_the_beginning_never_looks_good(kind: str) -> None:
    device = SmallPlc()
    step, device.step = device.step, lambda: None  # type: ignore[method-assign]
    async with plant(device, kind) as (line, _):
        await until(lambda: line.value("p.level") == 1.5)
        assert not [b for b in line.batches if b.source == "link.hall" and b.handles and is_good(b.quality)]
        assert reason(line.quality("p.level")) is QualityReason.HALTED
        device.step = step  # type: ignore[method-assign]
        await until(lambda: is_good(line.quality("p.level")), 10)


async def test_one_that_answers_no_part_of_its_header_is_asked_for_all_of_it() -> None:
    device = SmallPlc()
    read = device.read

    def whole_header_only(function: int, address: int, count: int) -> list[int]:
        if 0 < address < plc_map.HEADER_WORDS:
            device.reads.append((address, count))
            raise DeviceException(2)
        return read(function, address, count)

    device.read = whole_header_only  # type: ignore[method-assign]
    async with plant(device) as (line, _):
        await until(lambda: is_good(line.quality("p.level")))
        device.step = lambda: None  # type: ignore[method-assign]
        await until(lambda: line.link.halted("p"), 10)


@pytest.mark.parametrize("wrong", [1, 2, 3, 7])
@pytest.mark.parametrize("refused", [False, True])
async def test_a_wrong_answer_at_the_first_look_ends_no_link(wrong: int, refused: bool) -> None:
    """Neither one of another length nor a refusal, however many: the unit is asked again."""
    device = SmallPlc()
    read, left = device.read, [wrong]

    def first_wrong(function: int, address: int, count: int) -> list[int]:
        words = read(function, address, count)
        if 0 < address + count - LAST <= 1 and left[0] > 0:
            left[0] -= 1
            if refused:
                raise DeviceException(4)
            return words[:-1]
        return words

    device.read = first_wrong  # type: ignore[method-assign]
    async with plant(device) as (line, _):
        await until(lambda: is_good(line.quality("p.level")), 30)
        assert left[0] < wrong


@asynccontextmanager
async def machine(name: str, kind: str) -> AsyncIterator[tuple[RegisterLink, TagDatabase, asyncio.Event]]:
    """A machine of the demo plant on a road of its own, and an event that lets its program stand while it is set."""
    demo, problems = read_simulated(bundled("plants/demo"))
    assert demo is not None, problems
    sim = SimPlant(demo, ManualClock(), links=list(demo.links))
    item = demo.equipment[name]
    bus = Bus({item.unit: sim.devices[name]})
    server, tty, standing = TcpServer(bus), None, asyncio.Event()
    link = Link(item.link, "memory", writes=True)
    if kind == "tcp":
        await server.start("127.0.0.1", 0)
        link = Link(item.link, "tcp", host="127.0.0.1", tcp_port=server.address[1], writes=True)
    elif kind == "rtu":
        tty = await serve_line(bus, 115200)
        link = Link(item.link, "rtu", port=tty.path, baud=115200, parity="none", stop_bits=2, writes=True)

    async def scans() -> None:
        while True:
            if not standing.is_set():
                for device in sim.devices.values():
                    device.step()
            await asyncio.sleep(0.01)

    tags = TagDatabase(loop_clock())
    tags.configure([Tag(p.name, p.id, f"link.{item.link}") for p in item.points.values()])
    made = RegisterLink(link, [item], tags, loop_clock(), exchange=on_bus(bus) if kind == "memory" else None)
    tasks = [asyncio.create_task(scans()), asyncio.create_task(made.run())]
    try:
        yield made, tags, standing
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        await server.close()
        if tty is not None:
            await tty.close()


@pytest.mark.sweep(8)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", MACHINES)
async def test_every_machine_with_our_map_is_found_out_on_every_road(name: str, kind: str) -> None:
    async with machine(name, kind) as (link, tags, standing):
        state = next(handle for handle, tag in enumerate(tags.tags) if tag.name == f"{name}.state")
        await until(lambda: is_good(tags.quality(state)))
        standing.set()
        assert await until(lambda: reason(tags.quality(state)) is QualityReason.HALTED, 10) < 5
        assert link.halted(name)
        standing.clear()
        assert await until(lambda: is_good(tags.quality(state)), 10) < 5
        assert not link.halted(name)
