"""The gate over every transport to the virtual SINAMICS drive: real telegrams, words, start sequence, faults."""

import asyncio
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from dataclasses import replace
from typing import Any

import pytest

from app.access.roles import Person
from app.commands.gate import Gate, Question
from app.commands.lifecycle import Progress, ProgressState
from app.commands.orders import AuditLine
from app.errors import Refused
from app.links.register_link import RegisterLink, statistic_names
from app.plant.derive import Derivation
from app.plant.loader import read_plant
from app.profidrive.state_machine import State as DriveState
from app.profidrive.words import ENABLES, RUN, Control
from app.settings import bundled
from app.sim import training
from app.sim.plant import SimPlant
from app.sim.server import TcpServer
from app.sim.sinamics import training as own
from app.sim.sinamics.drive import VirtualSinamics
from app.tags.batch import Batch
from app.tags.database import Tag, TagDatabase
from app.tags.quality import is_good
from tests.commands.stand import ANA, EVA, IVO
from tests.links.devices import on_bus
from tests.virtual import loop_clock
from tests.wires import serve_line

TRANSPORTS = ("memory", "tcp", "rtu")


class Pump:
    """Drive d1 of its own plant, standing, behind a link."""

    folder, id, first = "plants/sinamics", "d1", "forward"
    drive: VirtualSinamics
    usual: Mapping[str, object] = {"setpoint": 40, "p1120": 2, "p1121": 2}

    def __init__(self, **simulation: object) -> None:
        plant, problems = read_plant(bundled(self.folder))
        assert plant, problems
        item = plant.equipment[self.id]
        item = replace(item, options={**item.options, "simulation": {**self.usual, **simulation}})
        self.plant = replace(plant, equipment={self.id: item})
        self.clock = loop_clock()
        self.sim = SimPlant(self.plant, self.clock)
        drive = self.drive = self.sim.devices[self.id]  # type: ignore[assignment]
        self.tags = TagDatabase(self.clock)
        self.lines: list[tuple[str, str]] = []
        self.words: list[int] = []
        write = drive.write

        def written(function: int, address: int, words: list[int]) -> None:
            write(function, address, words)
            if address == 99:
                self.words.append(words[0])

        drive.write = written  # type: ignore[method-assign, assignment]

    def connect(self, **link: object) -> None:
        link_of = replace(self.plant.links["drives"], writes=True, **link)  # type: ignore[arg-type]
        item = self.plant.equipment[self.id]
        self.plant = replace(self.plant, links={"drives": link_of})
        self.link = RegisterLink(link_of, [item], self.tags, self.clock, exchange=on_bus(self.sim.buses["drives"]))
        points = [p for p in self.plant.points.values() if p.register is None or p.register.readable]
        tags = [Tag(p.name, p.id, "derived" if p.derived else "link.drives") for p in points]
        self.tags.configure([*tags, *(Tag(name, name, "sys") for name in statistic_names(link_of, [item.unit]))])
        self.derivation = Derivation(self.plant)
        self.tags.subscribe(self._derive)
        self.gate = Gate(
            self.tags, self.clock, writers={"drives": self.link}, audit=self._audit, on_stop_unconfirmed=self.lines_of
        )
        self.gate.configure(self.plant)

    def lines_of(self, equipment: str) -> None:
        self.lines.append((equipment, "stop unconfirmed"))

    async def _audit(self, line: AuditLine) -> None:
        if line.kind == "command":
            self.lines.append((line.object, line.result))

    def _derive(self, batch: Batch) -> None:
        if batch.source != "link.drives":
            return
        names = {n: (self.tags.sample(n).value, self.tags.sample(n).quality) for n in self.derivation.inputs}
        found = self.derivation.update(names, batch.time)
        handles = [self.tags.handle(name) for name, _, _ in found]
        values, qualities = [v for _, v, _ in found], [q for _, _, q in found]
        self.tags.publish(Batch("derived", 0, batch.time, batch.seen, handles, values, qualities=qualities))

    def value(self, key: str) -> float:
        value = self.tags.sample(f"{self.id}.{key}").value
        return float(value) if isinstance(value, int | float) else float("nan")

    async def until(self, true: Callable[[], object], limit: float = 30.0) -> None:
        began = self.clock.monotonic()
        while not true():
            assert self.clock.monotonic() - began < limit, (
                self.gate.progress(self.id),
                self.drive.state,
                self.drive.faults,
            )
            await asyncio.sleep(0.02)

    async def ask(self, command: str, who: Person = ANA, **asked: object) -> Progress:
        nonce = self.gate.nonces.issue(who.session)
        return await self.gate.ask(who, self.id, command, nonce=nonce, **asked)  # type: ignore[arg-type]

    async def done(self, command: str, state: ProgressState = ProgressState.CONFIRMED, **asked: object) -> Progress:
        """Ask, and wait until it is over as expected."""
        await self.ask(command, **asked)  # type: ignore[arg-type]

        def over() -> bool:
            progress = self.gate.progress(self.id)
            return progress is not None and progress.over

        await self.until(over)
        progress = self.gate.progress(self.id)
        assert progress is not None and progress.state is state, progress
        return progress

    async def cause(self, register: int, value: int) -> None:
        await self.link.raw_write(1, register, [value])


@asynccontextmanager
async def pump(transport: str = "memory", kind: Callable[..., Any] = Pump, **simulation: object) -> AsyncIterator[Any]:
    it = kind(**simulation)
    bus = it.sim.buses["drives"]
    server = TcpServer(bus)
    await server.start("127.0.0.1", 0)
    serial = await serve_line(bus, 57600)
    if transport == "tcp":
        it.connect(transport="tcp", host="127.0.0.1", tcp_port=server.address[1])
    elif transport == "rtu":
        it.connect(transport="rtu", port=serial.path, baud=57600, parity="none", stop_bits=2, fast=0.2)
    else:
        it.connect()
    tasks = [asyncio.create_task(work()) for work in (it.sim.run, it.link.run, it.gate.run)]
    try:
        it.gate.control.take(ANA, it.id)
        await it.until(lambda: not it.gate.why_not(ANA, it.id, it.first))
        yield it
    finally:
        await it.gate.close()
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        await server.close()
        await serial.close()


@pytest.mark.sweep(8)
@pytest.mark.parametrize("transport", TRANSPORTS)
async def test_a_day_of_the_drive_over_every_transport(transport: str) -> None:
    async with pump(transport) as it:
        await it.done("forward")
        assert it.words == [ENABLES, RUN] and it.drive.state is DriveState.OPERATION
        await it.until(lambda: it.value("speed") == pytest.approx(600, abs=8))
        await it.done("set_setpoint", argument="50,5", language="hr", confirmed=True)
        await it.until(lambda: it.value("speed") == pytest.approx(757, abs=8))
        with pytest.raises(Question):
            await it.ask("reverse")
        it.words.clear()
        await it.done("reverse", confirmed=True)
        assert it.words == [RUN | Control.INVERT], "a drive that runs is turned round by one word"
        await it.until(lambda: it.value("speed") == pytest.approx(-757, abs=8))
        await it.done("stop", who=IVO)
        assert it.drive.state is DriveState.READY_TO_SWITCH_ON and it.value("running") == 0
        for command in ("quick_stop", "coast"):
            await it.done("forward")
            await it.until(lambda: it.value("speed") > 500)
            await it.done(command)
            assert it.drive.state is DriveState.INHIBITED
        await it.until(lambda: abs(it.value("speed")) < 5)
        await it.done("forward")
        assert it.words[-2:] == [ENABLES, RUN], "out of S1 only over OFF1"
        await it.done("stop")
        await it.until(lambda: len(it.lines) >= 9)
        assert {result for _, result in it.lines} == {"confirmed"}


@pytest.mark.parametrize("transport", TRANSPORTS)
async def test_every_point_is_read_and_good(transport: str) -> None:
    async with pump(transport) as it:
        names = [p.name for s in it.link.stations.values() for block in s.blocks for p in block.points]
        assert not [p.name for s in it.link.stations.values() for p in s.unreadable]
        it.link.demand("page", names)
        await it.until(lambda: all(is_good(it.tags.sample(name).quality) for name in names))
        assert len(names) > 90


@pytest.mark.sweep(8)
@pytest.mark.parametrize("transport", TRANSPORTS)
async def test_a_fault_stops_it_and_is_acknowledged_by_an_edge_once_its_cause_is_gone(transport: str) -> None:
    async with pump(transport) as it:
        await it.done("forward")
        await it.cause(training.REG_MACHINE_FAULT, 30001)
        await it.until(lambda: it.value("zsw1_fault") == 1 and it.value("fault_1") == 30001)
        with pytest.raises(Refused) as refused:
            await it.ask("forward")
        assert refused.value.params["label"] == "missing.interlock.no_fault"
        await it.done("reset", ProgressState.UNCONFIRMED)
        await it.cause(training.REG_MACHINE_FAULT, 0)
        await asyncio.sleep(5.1)
        it.words.clear()
        await it.done("reset")
        assert it.words == [ENABLES, ENABLES | Control.ACKNOWLEDGE, ENABLES]
        assert it.drive.faults == [] and it.drive.state is DriveState.READY_TO_SWITCH_ON
        await it.until(lambda: not it.gate.why_not(ANA, "d1", "forward"))
        await it.done("forward")


@pytest.mark.parametrize(
    ("register", "label"),
    [
        (own.REG_INTERLOCK, "missing.permissive.run_interlock"),
        (own.REG_EMERGENCY, "missing.permissive.emergency_stop"),
        (own.REG_LOCAL, "missing.permissive.control_requested"),
    ],
)
async def test_a_start_is_refused_while_the_machine_forbids_it_and_says_why(register: int, label: str) -> None:
    async with pump() as it:
        await it.done("forward")
        await it.done("stop")
        await it.cause(register, 1)
        await it.until(lambda: it.gate.why_not(ANA, "d1", "forward"))
        with pytest.raises(Refused) as refused:
            await it.ask("forward")
        assert label in (refused.value.params["label"], *refused.value.params["missing"])  # type: ignore[misc]
        await it.cause(register, 0)
        await it.until(lambda: not it.gate.why_not(ANA, "d1", "forward"))
        await it.done("forward")


async def test_a_drive_that_does_not_get_ready_is_not_switched_on() -> None:
    async with pump() as it:
        await it.done("forward")
        await it.done("coast")
        await it.until(lambda: it.value("stw1_no_coast_stop") == 0)
        await it.cause(own.REG_INTERLOCK, 1)
        it.words.clear()
        progress = await it.done("forward", ProgressState.FAILED)
        assert (progress.reason, progress.params["seconds"]) == ("why.not_ready", 3.0)
        assert it.words == [ENABLES], "the second telegram was never sent"
        assert it.drive.state is DriveState.INHIBITED


async def test_a_stop_ends_a_start_that_waits() -> None:
    async with pump() as it:
        await it.done("forward")
        await it.done("coast")
        await it.cause(own.REG_INTERLOCK, 1)
        it.words.clear()
        start = asyncio.create_task(it.ask("forward"))
        await it.until(lambda: it.words == [ENABLES])
        await it.done("stop", who=IVO)
        await it.cause(own.REG_INTERLOCK, 0)
        await asyncio.gather(start, return_exceptions=True)
        await asyncio.sleep(5)
        assert RUN not in it.words and it.drive.state is not DriveState.OPERATION


async def test_whoever_loses_the_right_while_a_start_waits_does_not_start() -> None:
    async with pump() as it:
        await it.done("forward")
        await it.done("coast")
        await it.cause(own.REG_INTERLOCK, 1)
        it.words.clear()
        start = asyncio.create_task(it.ask("forward"))
        await it.until(lambda: it.words == [ENABLES])
        it.gate._state.rights = lambda person: None  # type: ignore[attr-defined]
        await it.cause(own.REG_INTERLOCK, 0)
        progress = await start
        assert progress.state is ProgressState.FAILED and RUN not in it.words


async def test_silence_trips_a_running_drive_by_its_own_watchdog() -> None:
    async with pump(p2040=500) as it:
        await it.done("forward")
        await it.cause(training.REG_LINE_FAULT, 1)
        await it.until(lambda: it.drive.faults == [1910], 5)
        await it.cause(training.REG_LINE_FAULT, 0)
        await it.until(lambda: it.value("fault_1") == 1910)


async def test_parameters_are_written_and_read_back() -> None:
    async with pump() as it:
        it.gate.control.release(ANA, "d1")
        it.gate.control.take(EVA, "d1")

        async def change(key: str, value: str) -> Progress:
            nonce = it.gate.nonces.issue(EVA.session)
            return await it.gate.set_value(EVA, "d1", key, value, nonce=nonce, language="en", confirmed=True)

        await change("ramp_up", "12.5")
        await it.until(lambda: it.value("ramp_up") == 12.5)
        assert it.drive.parameter("p1120") == 12.5
        with pytest.raises(Refused):
            await change("current_limit", "5")
        await it.until(lambda: not it.gate.why_not(EVA, "d1", "forward"))
        await it.done("forward", who=EVA)
        with pytest.raises(Refused) as refused:
            await change("reference_speed", "1000")
        assert refused.value.params["label"] == "why.machine_stopped"
