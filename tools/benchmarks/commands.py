"""From a click to the register, over HTTP and TCP while 1 000 tags are scanned and recorded; and behind a telegram on a serial line."""

import asyncio
import time
from collections import Counter
from dataclasses import replace
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

from pymodbus.client import AsyncModbusTcpClient

from app.clock import SystemClock
from app.links.register_link import RegisterLink, statistic_names
from app.plant.definitions import Link
from app.plant.loader import read_plant
from app.registers.rtu import read_time, write_time
from app.tags.database import Tag, TagDatabase
from benchmarks.common import ROOT, Row, free_port, helper, milliseconds, percentile, write_plant

DRIVES = 40
CLICKS = 250
BAUD = 9600
SERIAL_WRITES = 60


async def _over_http() -> list[Row]:
    port = free_port()
    with TemporaryDirectory() as name:
        async with helper("devices", "e800", 1.0) as devices:
            modbus = int(str(await devices.ask()))
            plant = write_plant(Path(name) / "plant", DRIVES, modbus)
            async with helper("server", plant, Path(name) / "data", port) as server:
                told = await server.ask("ready")
                await asyncio.sleep(2)
                clicks = await server.ask(f"clicks {CLICKS}")
                log = await devices.ask("log")
                bare = await _bare_write(modbus)
    assert isinstance(clicks, list) and isinstance(log, dict) and isinstance(told, dict)
    arrived = {(unit, word): moment for moment, unit, _, word in log["writes"]}
    times = Counter((unit, word) for _, unit, _, word in log["writes"])
    delays = [arrived[unit, word] - moment for moment, unit, word, _ in clicks if (unit, word) in arrived]
    lost = len(clicks) - len(delays)
    refused = Counter(status for *_, status in clicks if status >= 300)
    middle, late = percentile(delays, 50), percentile(delays, 99)
    twice = sum(number > 1 for number in times.values())
    return [
        Row(
            "click → register written, TCP, 1 000 tags at 100 ms scanned and recorded: median",
            milliseconds(middle),
            "3 ms",
            f"{milliseconds(bare)}, one write by pymodbus",
            middle / bare,
            middle <= 0.003,
            f"HTTP request with session, nonce and form, {len(clicks)} clicks of 5 people on {DRIVES} drives, {told['tags']} tags; "
            "from the request's first byte to the telegram in the device",
        ),
        Row("the same: 99 %", milliseconds(late), "20 ms", "", None, late <= 0.02),
        Row(
            "the same: lost, or written twice",
            f"{lost} and {twice} of {len(clicks)}",
            "none",
            "",
            None,
            lost == twice == 0,
            f"answers that were no success: {dict(refused) or 'none'}",
        ),
    ]


async def _bare_write(port: int) -> float:
    client = AsyncModbusTcpClient("127.0.0.1", port=port)
    await client.connect()
    taken = []
    for number in range(200):
        began = time.perf_counter()
        answer = await client.write_register(0x010D, number, device_id=99)
        taken.append(time.perf_counter() - began)
        assert not answer.isError()
    client.close()
    return percentile(taken, 50)


async def _behind_a_telegram() -> list[Row]:
    plant, problems = read_plant(ROOT / "plants" / "demo")
    assert plant is not None, problems
    item = plant.equipment["m1"]
    async with helper("serial_line", BAUD) as line:
        path = str(await line.ask())
        link = Link("line", "rtu", port=path, baud=BAUD, parity="none", writes=True)
        clock = SystemClock()
        tags = TagDatabase(clock)
        points = [p for p in item.points.values() if p.register and p.register.readable]
        tags.configure(
            [Tag(p.name, p.id, "link.line") for p in points] + [Tag(n, n, "sys") for n in statistic_names(link, [1])]
        )
        road = RegisterLink(link, [replace(item, link="line")], tags, clock)
        running = asyncio.create_task(road.run())
        while not road.up:  # noqa: ASYNC110
            await asyncio.sleep(0.1)
        await asyncio.sleep(2)
        random, moments = Random(1), []
        for number in range(SERIAL_WRITES):
            await asyncio.sleep(random.uniform(0.05, 0.15))
            began = time.monotonic()
            await road.write("m1", "frequency_setpoint", 20 + number / 100)
            moments.append((began, 2000 + number))
        log = await line.ask("log")
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)
    assert isinstance(log, list)
    arrived = {word: moment for moment, address, word in log if address == 0x010D}
    delays = [arrived[word] - moment for moment, word in moments if word in arrived]
    reads = [moment for moment, address, _ in log if address == -1]
    behind = [sum(began < moment < arrived[word] for moment in reads) for began, word in moments if word in arrived]
    lost = len(moments) - len(delays)
    limit = read_time(BAUD, 25) + write_time(BAUD) / 2
    return [
        Row(
            "click → register written, RTU 9600 baud under full scan: telegrams that go before it",
            f"at most {max(behind)}, {lost} lost",
            "the one on the wire, none lost",
            note=f"{len(delays)} writes at random moments; median {milliseconds(percentile(delays, 50))}, longest "
            f"{milliseconds(max(delays))}, where the wire alone takes up to {milliseconds(limit)}",
            met=lost == 0 and max(behind) <= 1,
        )
    ]


async def measure() -> list[Row]:
    return await _over_http() + await _behind_a_telegram()
