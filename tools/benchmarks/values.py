"""Registers and changed values on their way from the wire to alarms, recorder and pages."""

import asyncio
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from struct import Struct
from tempfile import TemporaryDirectory

from pymodbus.client import AsyncModbusTcpClient

from app.alarms.engine import AlarmEngine
from app.clock import SystemClock
from app.db import Database
from app.historian.recorder import Recorder
from app.links.register_link import RegisterLink, statistic_names
from app.live.frames import Live
from app.plant.definitions import Alarm, Device, Equipment, EquipmentType, Link, Plant, Point, Register
from app.plant.texts import Texts
from app.tags.database import Tag, TagDatabase
from benchmarks.common import Row, helper, thousands
from benchmarks.devices import Devices

BLOCK = 125
BLOCKS = 8
TAGS = BLOCK * BLOCKS
ALARM_EVERY = 10
SECONDS = 4.0


class Road:
    """Link, tags, alarms, recorder and one watched page over 1 000 registers."""

    def __init__(
        self, link: Link, data: Path, exchange: Callable[[int, bytes], Awaitable[bytes | None]] | None
    ) -> None:
        self.clock = SystemClock()
        self.tags = TagDatabase(self.clock)
        device = Device(max_read=BLOCK, fast=0.0001, turnaround=0.0)
        machines = {}
        for number in range(1, BLOCKS + 1):
            name = f"d{number}"
            points = {
                f"v{n}": Point(
                    f"{name}.v{n}", f"{name}.v{n}", name, f"v{n}", f"v{n}", register=Register(n), dead_band=5.0
                )
                for n in range(BLOCK)
            }
            alarms = tuple(
                Alarm(f"high{n}", "alarm.high", f"v{n} > 60000", 3, value=f"v{n}") for n in range(0, BLOCK, ALARM_EVERY)
            )
            kind = EquipmentType("bench", Path(), "type", device, points, {}, (), (), {}, alarms, {})
            machines[name] = Equipment(name, kind, link.name, number, {}, "", points, alarms)
        self.plant = Plant(Path(), {}, "UTC", ("en",), {}, {link.name: link}, machines, {})
        self.points = list(self.plant.points.values())
        tags = [Tag(point.name, point.id, f"link.{link.name}") for point in self.points]
        tags += [Tag(name, name, "sys") for name in statistic_names(link, list(range(1, BLOCKS + 1)))]
        self.tags.configure(tags)
        self.pogon = Database(data / "pogon.db", "pogon")
        self.pogon.migrate()
        self.history = Database(data / "history.db", "history")
        self.alarms = AlarmEngine(self.tags, self.clock, self.pogon, Texts.read(), b"k" * 32)
        self.recorder = Recorder(self.tags, self.history, self.clock, keep_days=1, quota=10**10)
        self.live = Live(self.tags, self.clock)
        self.link = RegisterLink(link, list(machines.values()), self.tags, self.clock, exchange=exchange)
        self.changed = 0

    @asynccontextmanager
    async def running(self) -> AsyncIterator[None]:
        self.alarms.configure(self.plant, Texts.read())
        await self.recorder.configure(self.points)
        watcher = self.live.join("page", [point.name for point in self.points[:BLOCK]])

        async def watch() -> None:
            while True:
                await watcher.next()

        work = (self.link.run, self.recorder.run, self.alarms.run, watch)
        tasks = [asyncio.create_task(each()) for each in work]
        try:
            await asyncio.sleep(1.0)
            yield
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            self.live.close()
            await self.alarms.close()
            await self.recorder.close()
            await asyncio.to_thread(self.history.close)
            await asyncio.to_thread(self.pogon.close)

    async def measure(self, seconds: float) -> tuple[float, float, float]:
        """Registers per second, CPU share of this process, rows stored per second."""
        statistics, stored = self.link.statistics, self.recorder.rows_stored
        telegrams, cpu, began = statistics.telegrams, time.process_time(), time.perf_counter()
        await asyncio.sleep(seconds)
        took = time.perf_counter() - began
        return (
            (statistics.telegrams - telegrams) * BLOCK / took,
            (time.process_time() - cpu) / took,
            (self.recorder.rows_stored - stored) / took,
        )


async def _bare(port: int, seconds: float) -> float:
    """Registers per second that pymodbus reads in a loop, and does nothing with."""
    client = AsyncModbusTcpClient("127.0.0.1", port=port)
    await client.connect()
    reads, began = 0, time.perf_counter()
    while time.perf_counter() - began < seconds:
        answer = await client.read_holding_registers(0, count=BLOCK, device_id=1 + reads % BLOCKS)
        assert len(answer.registers) == BLOCK
        reads += 1
    took = time.perf_counter() - began
    client.close()
    return reads * BLOCK / took


async def over_tcp() -> list[Row]:
    """Registers through everything, against pymodbus alone, to the same server in another process."""
    rows = []
    for share, words in ((0.1, "every tenth changes"), (1.0, "all change")):
        async with helper("devices", "flat", share) as devices:
            port = int(str(await devices.ask()))
            with TemporaryDirectory() as folder:
                before = await _bare(port, 2.0)
                road = Road(Link("l", "tcp", host="127.0.0.1", tcp_port=port), Path(folder), None)
                async with road.running():
                    registers, cpu, stored = await road.measure(SECONDS)
                bare = (before + await _bare(port, 2.0)) / 2
        rows.append(
            Row(
                f"registers through link, tags, alarms, recorder over TCP, blocks of 125, {words}",
                f"{thousands(registers)} /s",
                "at least half of bare pymodbus" if share < 1 else "",
                f"{thousands(bare)} /s, pymodbus in a loop",
                registers / bare,
                registers / bare >= 0.5 if share < 1 else None,
                f"1 000 registers, 104 alarms, {thousands(stored)} rows/s stored; own process {100 * cpu:.0f} % of a core",
            )
        )
    return rows


async def end_to_end() -> list[Row]:
    """Every register changes with every read; the device is a function in this process that costs next to nothing."""
    devices = Devices("flat", 1.0)
    packed = [bytes((3, 2 * BLOCK)) + Struct(f">{BLOCK}H").pack(*words) for words in devices.walk]
    at = dict.fromkeys(range(1, BLOCKS + 1), 0)

    async def exchange(unit: int, pdu: bytes) -> bytes | None:
        step = at[unit] = (at[unit] + 1) % len(packed)
        await asyncio.sleep(0)
        return packed[step]

    with TemporaryDirectory() as folder:
        road = Road(Link("l", "memory"), Path(folder), exchange)
        async with road.running():
            registers, cpu, stored = await road.measure(SECONDS)
    unpack, kept, steps = Struct(f">{BLOCK}H").unpack_from, [0] * TAGS, 0
    began = time.process_time()
    while time.process_time() - began < 1.0:
        for block in range(BLOCKS):
            words = unpack(packed[steps % len(packed)], 2)
            for n, word in enumerate(words, block * BLOCK):
                if word != kept[n]:
                    kept[n] = word
            steps += 1
    bare = steps * BLOCK / (time.process_time() - began)
    changed = registers / cpu
    return [
        Row(
            "changed values end to end on one core",
            f"{thousands(changed)} /s",
            "100 000 /s",
            f"{thousands(bare)} /s, unpack and compare",
            changed / bare,
            changed >= 100_000,
            f"per second of CPU of all threads; {thousands(stored)} rows/s leave the dead-band of 5 (walk of ±1)",
        )
    ]


async def measure() -> list[Row]:
    return await over_tcp() + await end_to_end()
