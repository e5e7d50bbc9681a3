"""What a conveyor costs: one scan of its PLC with machine and tracking, and fifty of them in one plant."""

import time
from collections.abc import Callable
from dataclasses import replace

from app import bundled
from app.clock import SystemClock
from app.plant.definitions import Link
from app.plant.loader import read_plant
from app.sim.conveyor.machine import Geometry
from app.sim.conveyor.program import VirtualConveyor
from app.sim.plant import SimPlant
from benchmarks.common import Row, median

PRODUCTS = 20
LINES = 50
RATE = 100
"""Scans a second."""
READS = 10
"""A line's status, table and events are read so often in a second."""
SCANS = 3000
LONG = Geometry((645.0, 1335.0, 1980.0), (300.0, 645.0, 1335.0, 1680.0))
"""Three times the model's line: twenty products have room on it."""
QUICK = {"automatic_speed": 60.0, "acceleration": 200.0, "jerk": 1000.0, "unload_dwell": 0.2, "restart_delay": 0.2}


def _of(times: int, work: Callable[[], object]) -> float:
    """CPU time of `work` [s], the best of three rounds."""
    best = float("inf")
    for _ in range(3):
        began = time.process_time()
        for _ in range(times):
            work()
        best = min(best, (time.process_time() - began) / times)
    return best


def _bare(products: int) -> float:
    """Move so many numbers by three belts and compare them with four sensors."""
    ends, sensors, heads = (645.0, 1335.0), LONG.sensors, [1980.0 / products * n for n in range(products)]

    def loop() -> None:
        for n, head in enumerate(heads):
            head += 0.3 if head <= ends[0] else 0.2 if head <= ends[1] else 0.1
            heads[n] = head if head < 1980.0 else 0.0
            for sensor in sensors:
                if head - 20.0 < sensor <= head:
                    break

    return _of(SCANS, loop)


def _scan() -> list[Row]:
    line = VirtualConveyor(
        LONG, seed=3, start="automatic", slots=60, interval=2.0, shortest=20.0, longest=40.0, settings=QUICK
    )
    counts = []
    while len(line.tracking.products) < PRODUCTS:
        line.step()

    def scan() -> None:
        line.step()
        counts.append(len(line.tracking.products))
        line.machine.arrivals = counts[-1] < PRODUCTS

    each = _of(SCANS, scan)
    bare = _bare(PRODUCTS)

    def read() -> None:
        line.step()
        line.read(3, 0x0100, 96)
        line.read(3, 0x0400, 10)
        for first in (0x0800, 0x087C, 0x08F4, 0x096C):
            line.read(3, first, 120)

    reading = _of(SCANS, read) - each
    return [
        Row(
            f"one scan of a conveyor's PLC, machine and tracking of {PRODUCTS} products",
            f"{1e6 * each:.0f} µs",
            target="< 120 µs",
            bare=f"{1e6 * bare:.1f} µs, {PRODUCTS} numbers moved by three belts and compared with four sensors",
            ratio=each / bare,
            met=each < 120e-6,
            note=f"{median(counts):.0f} products on the line in the median, all belts running",
        ),
        Row(
            f"encode its status, events and {PRODUCTS} rows of the table for a reader",
            f"{1e6 * reading:.0f} µs",
            note="only what is read is encoded, at most once a scan",
        ),
    ]


def _plant() -> list[Row]:
    plant, problems = read_plant(bundled("plants/demo"))
    assert plant is not None, problems
    line = next(item for item in plant.equipment.values() if item.type.name == "conveyor")
    options = {**line.options, "simulation": {"start": "automatic", "interval": 3.0, **QUICK}}
    equipment = {f"c{n}": replace(line, link="l", id=f"c{n}", unit=n, options=options) for n in range(1, LINES + 1)}
    plant = replace(plant, links={"l": Link("l", "memory")}, equipment=equipment)
    sim = SimPlant(plant, SystemClock())
    lines = [line for line in sim.devices.values() if isinstance(line, VirtualConveyor)]
    for _ in range(1500):
        sim.step()
    products = median([len(line.tracking.products) for line in lines])

    def second() -> None:
        for scan in range(RATE):
            sim.step()
            for line in lines[scan % (RATE // READS) :: RATE // READS]:
                line.read(3, 0x0100, 96)
                line.read(3, 0x0400, 10)
                line.read(3, 0x0800, 124)

    share = _of(2, second)
    bare = LINES * RATE * _bare(max(1, round(products)))
    return [
        Row(
            f"{LINES} conveyors in one plant, {RATE} scans a second, each read {READS} times a second",
            f"{100 * share:.0f} % of a core",
            target="< 60 %",
            bare=f"{100 * bare:.1f} %, the same products moved and compared in a list",
            ratio=share / bare,
            met=share < 0.6,
            note=f"{products:.0f} products on each line in the median; lines in automatic, unloading and gap stops included",
        )
    ]


async def measure() -> list[Row]:
    return _scan() + _plant()
