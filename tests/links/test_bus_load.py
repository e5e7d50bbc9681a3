"""What a line carries and what more registers cost, against what a paced line is seen to take."""

import asyncio
from math import inf

import pytest

from app.links.bus_load import Reads, arithmetic_limit, cost, load, reads_of, with_more
from app.plant.definitions import Device, Link, Scan
from app.registers.register import Type
from app.sim.bus import Bus
from app.tags.quality import is_good
from tests.links.devices import RegisterDevice, machine, on_bus, point, running, until
from tests.links.serial_slaves import rtu
from tests.links.table_device import TableDevice
from tests.wires import serve_line

LINE = Link("hall", "rtu", baud=9600)
DRIVE = Reads(1, 25, 0.005, [(25, 0.1)], [(4, 1.0)])


def test_the_arithmetic_limit_of_the_sheet() -> None:
    assert round(arithmetic_limit(LINE, 25), 1) == 12.5
    assert arithmetic_limit(Link("hall", "tcp"), 25) == inf


def test_one_drive_fits_at_100_ms_and_eight_do_not() -> None:
    one = load(LINE, [DRIVE])
    assert one.cycle == one.asked == 0.1
    assert one.round == pytest.approx(0.0852, abs=1e-4)
    assert not one.too_short
    eight = load(LINE, [Reads(n, 25, 0.0, [(25, 0.1)]) for n in range(8)])
    assert eight.too_short and eight.cycle == pytest.approx(0.642, abs=0.001)


def test_slow_blocks_take_their_time_from_the_fast_ones_only_when_the_line_is_too_short() -> None:
    both = load(LINE, [Reads(1, 25, 0.0, [(25, 0.05)], [(25, 1.0)])])
    assert both.too_short and both.cycle == pytest.approx(0.0802 / (1 - 0.0802), rel=0.01)
    assert load(LINE, [Reads(1, 25, 0.0, [], [(25, 1.0)])]).cycle == inf


def test_more_registers_cost_two_characters_each_and_a_telegram_where_the_last_is_full() -> None:
    character = 11 / 9600
    roomy = Reads(1, 125, 0.005, [(25, 0.1)])
    assert cost(LINE, roomy, 100) == pytest.approx(200 * character)
    assert cost(LINE, DRIVE, 1) == pytest.approx(13 * character + 7 * character + 2 * character + 0.005)
    assert cost(LINE, DRIVE, 0) == 0
    assert cost(Link("hall", "tcp"), roomy, 100) == 0 and cost(Link("hall", "tcp"), roomy, 101) == pytest.approx(0.005)
    assert with_more(LINE, [DRIVE], 1, 25).round == pytest.approx(load(LINE, [DRIVE]).round + cost(LINE, DRIVE, 25))


async def test_bits_weigh_as_much_as_the_registers_that_take_as_long_and_are_not_filled_up_with_them() -> None:
    points = [point("m", f"c{n}", n, type=Type.BIT, table="coil") for n in range(160)]
    device = Device(fast=0.1, read_functions=(1, 3))
    bus = Bus({1: TableDevice({"coil": dict.fromkeys(range(160), 1), "holding": {0: 1}})})
    for more, blocks in ((0, 1), (1, 2)):
        machines = [machine("m", 1, [*points, *[point("m", "v", 0)][:more]], device)]
        async with running(machines, exchange=on_bus(bus)) as line:
            await until(lambda line=line: is_good(line.quality("m.c159")))
            (station,) = line.link.stations.values()
            (statistics,) = line.link.statistics.units.values()
            reads = reads_of(station, statistics)
        assert [count for count, _ in reads.fast] == [10, 1][:blocks] and reads.of_bits == 1
        first = 1 - more  # what is the first register there needs a telegram of its own
        assert cost(Link("hall", "tcp"), reads, 1) == pytest.approx(first * reads.turnaround)


@pytest.mark.parametrize(("now", "more", "limit"), [(20, 40, 125), (10, 60, 25)])
async def test_the_forecast_is_right_within_ten_percent_of_what_a_line_takes(now: int, more: int, limit: int) -> None:
    device = Device(max_read=limit, fast=0.001, timeout=0.3)
    bus = Bus({1: RegisterDevice({n: n for n in range(200)})}, turnaround=0.004)
    line = await serve_line(bus, 19200)

    async def measured(registers: int) -> tuple[float, Reads]:
        points = [point("m1", f"v{n}", n, Scan.FAST) for n in range(registers)]
        async with running([machine("m1", 1, points, device)], link=rtu(line.path, 19200)) as hall:
            await until(lambda: is_good(hall.quality(f"m1.v{registers - 1}")))
            statistics, station = hall.link.statistics, hall.link.stations[1]
            blocks = len(station.blocks)
            before, count = statistics.fast_time, statistics.fast_scans
            await asyncio.sleep(2.5)
            cycle = (statistics.fast_time - before) / (statistics.fast_scans - count)
            assert blocks == -(-registers // limit)
            return cycle, reads_of(station, statistics.units[1])

    try:
        small, reads = await measured(now)
        large, _ = await measured(now + more)
    finally:
        await line.close()
    link = rtu(line.path, 19200)
    assert cost(link, reads, more) == pytest.approx(large - small, rel=0.1)
    assert with_more(link, [reads], 1, more).cycle == pytest.approx(large, rel=0.1)
    assert load(link, [reads]).cycle == pytest.approx(small, rel=0.1)
