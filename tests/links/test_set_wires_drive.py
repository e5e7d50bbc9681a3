"""Sets of setpoints of a device that takes one register at a time, over memory, TCP and a serial line, spoiled at each telegram."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import replace
from typing import Any

import pytest

from app.commands import set_follow_up, sets
from app.commands.gate import Gate
from app.commands.lifecycle import Progress, ProgressState
from app.commands.orders import AuditLine
from app.commands.value_set import Stands
from app.errors import DeviceException
from app.plant.definitions import Command, Device, Plant, Scan, Setpoint, Write
from tests.commands.stand import EVA
from tests.links.devices import Line, RegisterDevice, machine, point, until
from tests.links.plc_devices import KINDS, FaultyBus, plant
from tests.virtual import loop_clock

FORMER = {"v0": 1.0, "v1": 2.0, "v2": 3.0}
NEW = {"v0": 4.0, "v1": 5.0, "v2": 6.0}
STATE = 10


class Registers(RegisterDevice):
    """Three parameters and a state; `refuse` names (register, word) that it does not take, `hold` what it makes of one."""

    def __init__(self) -> None:
        super().__init__({0: 1, 1: 2, 2: 3, STATE: 1})
        self.refuse: set[tuple[int, int]] = set()
        self.hold: dict[tuple[int, int], int] = {}

    def write(self, function: int, address: int, words: Any) -> None:
        if (address, words[0]) in self.refuse:
            raise DeviceException(4)
        super().write(function, address, [self.hold.get((address, words[0]), words[0])])

    def step(self) -> None:
        """A drive has no scan that a host sees."""

    @property
    def values(self) -> dict[str, float]:
        return {f"v{at}": float(self.words[at]) for at in range(3)}


@asynccontextmanager
async def bench(kind: str) -> AsyncIterator[tuple[Registers, FaultyBus, Callable[[], Any], list[Progress], Line]]:
    device = Registers()
    points = [point("p", f"v{at}", at, Scan.ONCE, writable=True) for at in range(3)] + [point("p", "state", STATE)]
    item = machine("p", 1, points, Device(timeout=0.15, fast=0.05, slow=0.2))
    stop = Command("stop", "stop", (Write("v0", "0"),), "state == 1", "5", stop=True, moves=False)
    setpoints = {key: Setpoint(key, "0", "100", role="operator") for key in FORMER}
    item = replace(item, type=replace(item.type, commands={"stop": stop}, setpoints=setpoints))
    async with plant(device, kind, equipment=[item]) as (line, bus):  # type: ignore[arg-type]
        await until(lambda: line.value("p.v2") == 3 and line.value("p.state") == 1)

        def audit(one: AuditLine) -> None:
            pass

        gate = Gate(line.tags, loop_clock(), writers={"hall": line.link}, audit=audit)
        gate.configure(Plant(item.type.folder, {}, "UTC", (), {}, {"hall": line.link.link}, {"p": item}, {}))
        gate.control.take(EVA, "p")
        running = asyncio.create_task(gate.run())
        ended: list[Progress] = []
        gate.subscribe_ends(ended.append)

        def ask() -> Any:
            nonce = gate.nonces.issue(EVA.session)
            return asyncio.wait_for(gate.set_values(EVA, "p", NEW, nonce=nonce, confirmed=True), 200)

        try:
            yield device, bus, ask, ended, line
        finally:
            await gate.close()
            running.cancel()
            await asyncio.gather(running, return_exceptions=True)


def is_true(device: Registers, progress: Progress) -> None:
    for change in progress.changes:
        told = {Stands.NEW: change.new, Stands.OLD: change.old, Stands.OTHER: change.found}
        held = device.values[change.key]
        assert change.stands is Stands.UNKNOWN or held == told[change.stands], (change, held)
    one = {ProgressState.CONFIRMED: {Stands.NEW}, ProgressState.FAILED: {Stands.OLD}}.get(progress.state)
    assert one is None or {change.stands for change in progress.changes} == one, progress


def parameter(pdu: bytes) -> str:
    """`w0` … `w2`: a write of a parameter, `r`: a read of some; empty = another telegram."""
    address = int.from_bytes(pdu[1:3], "big")
    if pdu[0] in (6, 16) and address < 3:
        return f"w{address}"
    return "r" if pdu[0] == 3 and address < 3 else ""


def spoiled(which: str, number: int, how: str, seconds: float = 0.0) -> Callable[[bytes], str]:
    """Spoils the `number`th telegram of a kind; with `seconds` nothing arrives for so long after it."""
    seen, out = 0, float("-inf")

    def fault(pdu: bytes) -> str:
        nonlocal seen, out
        now = asyncio.get_running_loop().time()
        if now < out:
            return "request"
        if parameter(pdu) == which:
            seen += 1
            if seen == number:
                out = now + seconds
                return how
        return ""

    return fault


@pytest.mark.parametrize("kind", KINDS)
async def test_a_set_is_written_in_order_and_read_back(kind: str) -> None:
    async with bench(kind) as (device, _, ask, _, _):
        done = await ask()
        assert (done.state, device.values) == (ProgressState.CONFIRMED, NEW)
        assert [address for address, _ in device.writes] == [0, 1, 2]
        is_true(device, done)


@pytest.mark.sweep(8)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("how", ["request", "answer", "late"])
@pytest.mark.parametrize(("which", "number"), [("w0", 1), ("w1", 1), ("w2", 1), ("r", 1), ("r", 2), ("r", 3)])
async def test_one_spoiled_telegram_leaves_all_or_none(kind: str, how: str, which: str, number: int) -> None:
    async with bench(kind) as (device, bus, ask, _, _):
        bus.fault = spoiled(which, number, how)
        done = await ask()
        assert done.state in (ProgressState.CONFIRMED, ProgressState.FAILED), done
        assert device.values in (FORMER, NEW)
        is_true(device, done)
        await asyncio.sleep(5)
        is_true(device, done)


@pytest.mark.sweep(8)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seconds", [2.0, 60.0])
@pytest.mark.parametrize("how", ["request", "answer"])
@pytest.mark.parametrize("which", ["w0", "w1", "w2"])
async def test_a_cable_out_at_any_write(kind: str, seconds: float, how: str, which: str) -> None:
    async with bench(kind) as (device, bus, ask, ended, _):
        bus.fault = spoiled(which, 1, how, seconds)
        done = await ask()
        is_true(device, done)
        if seconds < 10:
            assert (done.state, device.values) in ((ProgressState.FAILED, FORMER), (ProgressState.CONFIRMED, NEW))
            return
        assert (done.state, done.reason) == (ProgressState.UNCONFIRMED, set_follow_up.UNREAD)
        writes = len(device.writes)
        await until(lambda: len(ended) == 2, 200)
        assert len(device.writes) == writes, "nothing is written when the device is back"
        is_true(device, ended[1])
        assert Stands.UNKNOWN not in {change.stands for change in ended[1].changes}


@pytest.mark.sweep(8)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("at", range(3))
async def test_a_refusal_and_a_wrong_value_put_all_back(kind: str, at: int) -> None:
    async with bench(kind) as (device, _, ask, _, _):
        device.refuse = {(at, int(NEW[f"v{at}"]))}
        done = await ask()
        assert (done.state, device.values) == (ProgressState.FAILED, FORMER)
        is_true(device, done)
    async with bench(kind) as (device, _, ask, _, _):
        device.hold = {(at, int(NEW[f"v{at}"])): 77}
        done = await ask()
        assert (done.state, device.values) == (ProgressState.FAILED, FORMER)
        is_true(device, done)


@pytest.mark.sweep(8)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("failing", range(2))
async def test_what_cannot_be_put_back_is_named(kind: str, failing: int) -> None:
    async with bench(kind) as (device, _, ask, _, _):
        device.refuse = {(2, 6), (failing, int(FORMER[f"v{failing}"]))}
        done = await ask()
        assert (done.state, done.reason) == (ProgressState.UNCONFIRMED, sets.MIXED)
        assert [change.key for change in done.changes if change.stands is Stands.NEW] == [f"v{failing}"]
        is_true(device, done)
