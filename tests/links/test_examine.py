"""Registers that a device refuses are found one by one, the rest lives, and they are looked for again."""

import asyncio
import logging

import pytest

from app.plant.definitions import Device
from app.sim.bus import Bus, LineFaultMode
from app.tags.quality import (
    GOOD,
    NOT_CONNECTED,
    is_good,
)
from tests.links.devices import (
    QUICK,
    SIMULATED,
    RegisterDevice,
    machine,
    on_bus,
    point,
    row,
    running,
    until,
)


async def test_registers_that_do_not_exist_are_found_and_the_rest_lives(caplog: pytest.LogCaptureFixture) -> None:
    device = RegisterDevice({n: n for n in range(30) if n not in (7, 21)})
    async with running([row("m", 1, 30, QUICK)], exchange=on_bus(Bus({1: device}))) as line:
        with caplog.at_level(logging.WARNING):
            await until(lambda: is_good(line.quality("m.v0")) and is_good(line.quality("m.v29")))
            await until(lambda: line.quality("m.v7") == NOT_CONNECTED | SIMULATED)
        for n in range(30):
            expected = (None, NOT_CONNECTED | SIMULATED) if n in (7, 21) else (n, GOOD | SIMULATED)
            assert (line.value(f"m.v{n}"), line.quality(f"m.v{n}")) == expected
        device.requests.clear()
        await asyncio.sleep(0.2)
        assert set(device.reads) == {(0, 7), (8, 13), (22, 8)}
    assert sum("no such register" in message for message in caplog.messages) == 2


async def test_a_gap_that_the_device_refuses_is_not_a_missing_point() -> None:
    device = RegisterDevice({n: n for n in (0, 1, 2, 10, 11, 12)})
    points = [point("m", f"v{n}", n) for n in (0, 1, 2, 10, 11, 12)]
    async with running([machine("m", 1, points, QUICK)], exchange=on_bus(Bus({1: device}))) as line:
        await until(lambda: all(is_good(line.quality(p.name)) for p in points))
        device.requests.clear()
        await asyncio.sleep(0.2)
        assert set(device.reads) == {(0, 3), (10, 3)}


@pytest.mark.parametrize("kind", ["exception", "silence"])
async def test_a_device_that_takes_nine_registers_is_read_with_nine(kind: str) -> None:
    class Small(RegisterDevice):
        def read(self, function: int, address: int, count: int) -> list[int]:
            self.line_fault.mode = LineFaultMode.NONE
            return super().read(function, address, count)

    device = Small({n: n for n in range(25)}, limit=9 if kind == "exception" else 125)
    bus = Bus({1: device})

    async def exchange(unit: int, pdu: bytes) -> bytes | None:
        if kind == "silence" and int.from_bytes(pdu[3:5], "big") > 9:
            return None
        return await on_bus(bus)(unit, pdu)

    equipment = row("m", 1, 25, Device(max_read=25, fallback_read=9, timeout=0.1, fast=0.02))
    async with running([equipment], exchange=exchange) as line:
        await until(lambda: all(is_good(line.quality(f"m.v{n}")) for n in range(25)))
        device.requests.clear()
        await asyncio.sleep(0.3)
        assert max(count for _, count in device.reads) <= 9
        assert len(set(device.reads)) == 3
        assert line.link.stations[1].learned.limit == 9
        assert not line.link.stations[1].learned.bad


async def test_registers_that_appear_later_are_found_again() -> None:
    device = RegisterDevice({})
    async with running([row("m", 1, 3, QUICK)], exchange=on_bus(Bus({1: device}))) as line:
        await until(lambda: line.quality("m.v0") == NOT_CONNECTED | SIMULATED)
        device.words = {0: 1, 1: 2, 2: 3}
        await until(lambda: line.value("m.v2") == 3)
