"""Sets of setpoints through the gate over memory, TCP and a serial line, spoiled at each of their telegrams: what is told is true."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field, replace
from typing import Any

import pytest

from app.commands import set_follow_up, sets
from app.commands.gate import Gate
from app.commands.lifecycle import Progress, ProgressState
from app.commands.orders import AuditLine
from app.commands.value_set import Stands
from app.plant.definitions import Command, Plant, Setpoint, Write
from app.registers import plc_map
from tests.commands.stand import EVA
from tests.links.devices import Line, until
from tests.links.plc_devices import KINDS, STAGING, STATUS, FaultyBus, SmallPlc, plant, small
from tests.virtual import loop_clock

FORMER = {"a": 1.0, "b": 2.0, "c": 3.0}
NEW = {"a": 4.0, "b": 5.0}


def machine() -> Any:
    """The small PLC with its three setpoints, and a Stop that nobody presses."""
    item = small(slots=2)
    stop = Command("stop", "stop", (Write("size", "0"),), "state == 1", "5", stop=True, moves=False)
    setpoints = {key: Setpoint(key, "0", "10", role="operator") for key in "abc"}
    return replace(item, type=replace(item.type, commands={"stop": stop}, setpoints=setpoints))


@dataclass
class Bench:
    """Gate, link and device; what the audit was told."""

    line: Line
    bus: FaultyBus
    device: SmallPlc
    gate: Gate
    lines: list[tuple[str, str]] = field(default_factory=list)
    ended: list[Progress] = field(default_factory=list)

    def ask(self, values: dict[str, float]) -> "asyncio.Task[Progress]":
        nonce = self.gate.nonces.issue(EVA.session)
        return asyncio.create_task(self.gate.set_values(EVA, "p", values, nonce=nonce, confirmed=True))

    def is_true(self, progress: Progress) -> None:
        """What is told of each value is what the device holds, unless it is told as not known."""
        held = self.device.settings
        for change in progress.changes:
            told = {Stands.NEW: change.new, Stands.OLD: change.old, Stands.OTHER: change.found}
            assert change.stands is Stands.UNKNOWN or held[change.key] == told[change.stands], (change, held)
        one = {ProgressState.CONFIRMED: {Stands.NEW}, ProgressState.FAILED: {Stands.OLD}}.get(progress.state)
        assert one is None or {change.stands for change in progress.changes} == one, progress
        assert held in ({**FORMER, "d": 0.0}, {**FORMER, **NEW, "d": 0.0}), "a staging area gives no mixture"


@asynccontextmanager
async def bench(kind: str = "memory") -> AsyncIterator[Bench]:
    device, item = SmallPlc(slots=2), machine()
    async with plant(device, kind, equipment=[item]) as (line, bus):
        await until(lambda: line.value("p.c") == 3.0 and line.value("p.state") == 1)
        lines: list[tuple[str, str]] = []

        def audit(one: AuditLine) -> None:
            lines.append((one.kind, one.result))

        async def foretell(one: AuditLine) -> bool:
            lines.append((one.kind, one.result))
            return True

        gate = Gate(line.tags, loop_clock(), writers={"hall": line.link}, audit=audit, foretell=foretell)
        whole = Plant(item.type.folder, {}, "UTC", (), {}, {"hall": line.link.link}, {"p": item}, {})
        gate.configure(whole)
        gate.control.take(EVA, "p")
        running = asyncio.create_task(gate.run())
        made = Bench(line, bus, device, gate, lines)
        gate.subscribe_ends(made.ended.append)
        try:
            yield made
        finally:
            await gate.close()
            running.cancel()
            await asyncio.gather(running, return_exceptions=True)


def of_set(pdu: bytes) -> str:
    """Which telegram of a set this is; empty = another."""
    address = int.from_bytes(pdu[1:3], "big")
    if pdu[0] == 16 and address == STAGING:
        return "staging"
    if pdu[0] == 16 and address == plc_map.COMMAND:
        return "commit"
    if pdu[0] == 3 and address == plc_map.ANSWERS:
        return "answers"
    return "settings" if pdu[0] == 3 and 0x0200 <= address < STAGING else ""


def nth(which: str, number: int, kind: str, seconds: float = 0.0) -> Callable[[bytes], str]:
    """Spoils the `number`th telegram of a kind, and with `seconds` every telegram for so long after it: the cable is out."""
    seen = 0
    until_then = float("-inf")

    def fault(pdu: bytes) -> str:
        nonlocal seen, until_then
        now = asyncio.get_running_loop().time()
        if now < until_then:
            return "request"
        if of_set(pdu) == which:
            seen += 1
            if seen == number:
                until_then = now + seconds
                return kind
        return ""

    return fault


@pytest.mark.sweep(8)
@pytest.mark.parametrize("kind", KINDS)
async def test_a_set_is_one_commit_and_two_lines(kind: str) -> None:
    async with bench(kind) as it:
        done = await it.ask(NEW)
        assert (done.state, it.device.commits) == (ProgressState.CONFIRMED, 1)
        it.is_true(done)
        assert it.lines[-2:] == [("command.sent", "sent"), ("command", "confirmed")]


WHICH = [("staging", 1), ("commit", 1), ("answers", 1), ("settings", 1), ("settings", 2), ("staging", 2), ("commit", 2)]


@pytest.mark.sweep(8)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("how", ["request", "answer", "late"])
@pytest.mark.parametrize(("which", "number"), WHICH[:5])
async def test_one_spoiled_telegram_leaves_all_or_none(kind: str, how: str, which: str, number: int) -> None:
    async with bench(kind) as it:
        it.bus.fault = nth(which, number, how)
        done = await asyncio.wait_for(it.ask(NEW), 60)
        assert done.state in (ProgressState.CONFIRMED, ProgressState.FAILED), done
        it.is_true(done)
        await asyncio.sleep(5)
        it.is_true(done)  # nothing comes after it


@pytest.mark.sweep(8)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seconds", [1.5, 4.0, 60.0])
@pytest.mark.parametrize("how", ["request", "answer"])
@pytest.mark.parametrize("which", ["staging", "commit", "answers", "settings"])
async def test_a_cable_out_at_any_telegram(kind: str, seconds: float, how: str, which: str) -> None:
    async with bench(kind) as it:
        it.bus.fault = nth(which, 1, how, seconds)
        done = await asyncio.wait_for(it.ask(NEW), 120)
        it.is_true(done)
        if done.reason == set_follow_up.UNREAD:
            writes = it.device.commits
            await until(lambda: len(it.ended) == 2, 200)
            assert it.ended[1].reason in (set_follow_up.FOUND_OLD, set_follow_up.FOUND_NEW)
            it.is_true(it.ended[1])
            assert it.device.commits == writes, "nothing is written when the device is back"
        assert it.lines[0] != ("command", "confirmed")


@pytest.mark.parametrize("kind", KINDS)
async def test_a_value_that_the_device_refuses_changes_nothing(kind: str) -> None:
    async with bench(kind) as it:
        it.device._settings_fault = lambda values: 2 if values["b"] == 5.0 else 0  # type: ignore[method-assign]
        done = await it.ask(NEW)
        assert (done.state, done.reason, done.params["cause"]) == (
            ProgressState.FAILED,
            sets.RESTORED,
            "why.device_rejected_code",
        )
        assert it.device.commits == 0
        it.is_true(done)


class Frozen:
    """The program of a PLC that stands still from its commit on; its Modbus server answers."""

    def __init__(self, device: SmallPlc) -> None:
        self.device, self.on = device, False
        step, write = device.step, device.write

        def stepped() -> None:
            if not self.on:
                step()

        def heard(function: int, address: int, words: Any) -> None:
            write(function, address, words)
            if address == plc_map.COMMAND:
                self.on = True

        device.step, device.write = stepped, heard  # type: ignore[method-assign, assignment]


@pytest.mark.sweep(8)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seconds", [0.5, 3.0, 8.0, 40.0])
async def test_a_program_that_stands_still_in_the_commit_is_not_believed(kind: str, seconds: float) -> None:
    async with bench(kind) as it:
        frozen = Frozen(it.device)
        asked = it.ask(NEW)
        await until(lambda: frozen.on)
        await asyncio.sleep(seconds)
        heard, it.device.write = it.device.write, type(it.device).write.__get__(it.device)  # type: ignore[method-assign]
        assert heard
        frozen.on = False
        done = await asyncio.wait_for(asked, 60)
        await asyncio.sleep(6)
        it.is_true(done)
        last = it.ended[-1]
        it.is_true(last)
        assert Stands.UNKNOWN not in {change.stands for change in last.changes}


async def test_a_stop_in_the_middle_puts_it_back_and_what_stands_is_told() -> None:
    async with bench("rtu") as it:
        asked = it.ask(NEW)
        await asyncio.sleep(0.01)
        it.gate._state.machines["p"].set.interrupt("why.set_stopped")  # type: ignore[union-attr]
        done = await asyncio.wait_for(asked, 60)
        it.is_true(done)
        assert STATUS and done.state in (ProgressState.FAILED, ProgressState.CONFIRMED)
