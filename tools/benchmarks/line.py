"""A serial line of 9600 baud that is polled as fast as it goes: 25 registers per poll."""

import asyncio
import time
from dataclasses import replace

from pymodbus.client import AsyncModbusSerialClient

from app.clock import SystemClock
from app.links.register_link import RegisterLink, statistic_names
from app.plant.definitions import Link, Scan
from app.plant.loader import read_plant
from app.registers.rtu import read_time
from app.tags.database import Tag, TagDatabase
from benchmarks.common import ROOT, Row, helper

BAUD = 9600
COUNT = 25
SECONDS = 12.0


async def _ours(path: str) -> float:
    """Polls per second of a link that scans one block of 25 registers."""
    plant, problems = read_plant(ROOT / "plants" / "demo")
    assert plant is not None, problems
    item = plant.equipment["m1"]
    points = {
        key: point
        for key, point in item.points.items()
        if point.scan is Scan.FAST and point.register is not None and point.register.readable
    }
    kind = replace(item.type, device=replace(item.type.device, fast=0.01, turnaround=0.0))
    item = replace(item, type=kind, link="line", points=points)
    link = Link("line", "rtu", port=path, baud=BAUD, parity="none")
    tags = TagDatabase(SystemClock())
    tags.configure(
        [Tag(p.name, p.id, "link.line") for p in points.values()]
        + [Tag(n, n, "sys") for n in statistic_names(link, [1])]
    )
    road = RegisterLink(link, [item], tags, SystemClock())
    running = asyncio.create_task(road.run())
    while not road.up:  # noqa: ASYNC110
        await asyncio.sleep(0.1)
    assert [block.block.count for block in road.stations[1].blocks] == [COUNT]
    await asyncio.sleep(1.0)
    telegrams, began = road.statistics.telegrams, time.perf_counter()
    await asyncio.sleep(SECONDS)
    polls = (road.statistics.telegrams - telegrams) / (time.perf_counter() - began)
    running.cancel()
    await asyncio.gather(running, return_exceptions=True)
    return polls


async def _bare(path: str) -> float:
    client = AsyncModbusSerialClient(path, baudrate=BAUD, parity="N", timeout=1, retries=0)
    await client.connect()
    polls, began = 0, time.perf_counter()
    while time.perf_counter() - began < SECONDS / 2:
        answer = await client.read_holding_registers(0x1000, count=COUNT, device_id=1)
        assert len(answer.registers) == COUNT
        polls += 1
    rate = polls / (time.perf_counter() - began)
    client.close()
    return rate


async def measure() -> list[Row]:
    async with helper("serial_line", BAUD) as line:
        path = str(await line.ask())
        bare = await _bare(path)
        ours = await _ours(path)
    arithmetic = 1 / read_time(BAUD, COUNT)
    return [
        Row(
            "RTU line, 9600 baud, 25 registers per poll",
            f"{ours:.2f} polls/s, {100 * ours / arithmetic:.1f} % of the arithmetic {arithmetic:.1f}",
            "95 %",
            f"{bare:.2f} polls/s, pymodbus in a loop",
            ours / bare,
            ours / arithmetic >= 0.95,
            "a pseudo-terminal paced to 11 bits per character and 3.5 characters of silence; a real UART is not measured here",
        )
    ]
