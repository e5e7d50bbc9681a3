"""What the parts of a link's loop share: what is asked waits, is overtaken or withdrawn; what is lost is told once."""

import asyncio
import logging

import pytest

from app.errors import NotConnected, Overtaken
from app.links.statistics import LinkState
from app.plant.definitions import Device, Link
from app.sim.bus import Bus
from app.tags.quality import (
    COMM_FAILURE,
)
from tests.links.devices import (
    QUICK,
    RegisterDevice,
    machine,
    on_bus,
    point,
    row,
    running,
    until,
    writable,
)


async def test_no_server_at_all_is_told_once(caplog: pytest.LogCaptureFixture, free_port: int) -> None:
    caplog.set_level(logging.INFO)
    link = Link("hall", "tcp", host="127.0.0.1", tcp_port=free_port)
    async with running([row("m", 1, 1, QUICK)], link=link) as line:
        await asyncio.sleep(1.5)
        assert line.quality("m.v0") == COMM_FAILURE
        assert line.link.statistics.state is LinkState.DOWN
        assert not line.link.simulated
    assert [m for m in caplog.messages if m.startswith("link ")] == [
        f"link down link=hall reason=127.0.0.1:{free_port}: no connection, "
        "refused; is its Modbus server on, and the port right? (ECONNREFUSED)"
    ]


async def test_stop_goes_before_everything_and_what_it_overtakes_is_never_sent() -> None:
    device = RegisterDevice({0: 0, 0x20: 0})
    points = [point("m", "speed", 0), point("m", "command", 0x20, readable=False, writable=True)]
    equipment = machine("m", 1, points, Device(timeout=0.3, fast=0.02))
    async with running([equipment], exchange=on_bus(Bus({1: device}, turnaround=0.05))) as line:
        await until(lambda: line.value("m.speed") == 0)
        asked = [asyncio.create_task(line.link.write("m", "command", n)) for n in (1, 2, 8)]
        await asyncio.sleep(0)
        await line.link.write("m", "command", 3, urgent=True)
        results = await asyncio.gather(*asked, return_exceptions=True)
        sent = [words[0] for _, words in device.writes]
        assert sent[-1] == 3
        assert sum(isinstance(r, Overtaken) for r in results) == 3 - (len(sent) - 1)
        assert any(isinstance(r, Overtaken) for r in results)


async def test_a_write_whose_caller_gave_up_is_not_sent() -> None:
    device = RegisterDevice({0: 0, 0x20: 0})
    points = [point("m", "speed", 0), point("m", "command", 0x20, readable=False, writable=True)]
    async with running(
        [machine("m", 1, points, Device(timeout=0.3, fast=0.01))], exchange=on_bus(Bus({1: device}, turnaround=0.05))
    ) as line:
        await until(lambda: line.value("m.speed") == 0)
        first = asyncio.create_task(line.link.write("m", "command", 1))
        second = asyncio.create_task(line.link.write("m", "command", 2))
        await asyncio.sleep(0.001)
        second.cancel()
        await first
        await asyncio.sleep(0.2)
        assert [words[0] for _, words in device.writes] == [1]


async def test_a_link_that_does_not_run_refuses_at_once() -> None:
    device = RegisterDevice({0: 0, 1: 0, 2: 0, 0x20: 0})
    equipment = machine("m", 1, writable(), QUICK)  # type: ignore[arg-type]
    async with running([equipment], exchange=on_bus(Bus({1: device})), start=False) as line:
        for attempt in (line.link.write("m", "command", 1, urgent=True), line.link.raw_read(1, 0, 1)):
            with pytest.raises(NotConnected):
                await asyncio.wait_for(attempt, 0.1)
