"""Rows of a table as they are scanned: only counted ones, whole ones, and an empty one is empty."""

import asyncio

from app.tags.quality import CONFIGURATION as BAD_CONFIGURATION
from app.tags.quality import GOOD, is_good
from tests.links.devices import SIMULATED, until
from tests.links.plc_devices import (
    TABLE,
    SmallPlc,
    plant,
)

WRONG = BAD_CONFIGURATION | SIMULATED


async def test_rows_that_are_not_counted_are_not_read_and_are_read_at_once_when_they_are() -> None:
    device = SmallPlc()
    second = (TABLE + 4 + 15 * 8, 15 * 8)
    async with plant(device) as (line, _):
        await until(lambda: line.value("p.thing_40_id") == 0)
        assert line.quality("p.thing_40_state") == GOOD | SIMULATED
        await asyncio.sleep(0.2)
        assert second not in device.reads
        device.put(77, slot=20, value=4.0)
        took = await until(lambda: line.value("p.thing_21_id") == 77)
        assert took < 0.2 and line.value("p.thing_21_value") == 4.0
        assert (line.value("p.thing_21_state"), line.value("p.thing_22_state")) == (3, 0)
        device.table.ids[20] = 0
        await until(lambda: line.value("p.thing_21_id") == 0)
        assert (line.value("p.thing_21_value"), line.quality("p.thing_21_value")) == (None, GOOD | SIMULATED)
        await asyncio.sleep(0.1)
        device.reads = []
        await asyncio.sleep(0.2)
        assert second not in device.reads
        await line.link.refresh("p", ["thing_21_id"])
        assert second not in device.reads and line.value("p.thing_21_id") == 0


async def test_cells_that_are_not_read_do_not_grow_old() -> None:
    async with plant(SmallPlc()) as (line, _):
        await until(lambda: line.value("p.thing_40_id") == 0)
        handle = line.tags.handle("p.thing_40_value")
        for _ in range(20):
            await asyncio.sleep(0.1)
            assert line.tags.age(handle) < 1.5


async def test_a_torn_row_keeps_what_it_was_while_the_others_go_on() -> None:
    device = SmallPlc()
    for id in (1, 2, 3):
        device.put(id, value=1.0)
    async with plant(device) as (line, _):
        await until(lambda: line.value("p.thing_3_value") == 1.0)
        device.torn_rows.add(1)
        await asyncio.sleep(0.05)
        device.things.update({0: 5.0, 1: 5.0, 2: 5.0})
        await until(lambda: line.value("p.thing_3_value") == 5.0)
        assert (line.value("p.thing_1_value"), line.value("p.thing_2_value")) == (5.0, 1.0)
        assert line.link.statistics.torn >= 3
        device.torn_rows.clear()
        await until(lambda: line.value("p.thing_2_value") == 5.0)


async def test_a_table_with_other_rows_than_the_plant_file_says_is_bad_and_the_rest_lives() -> None:
    device = SmallPlc()
    device.put(1)
    device.row_size = 9
    async with plant(device) as (line, _):
        await until(lambda: line.quality("p.thing_1_id") == WRONG)
        await until(lambda: line.quality("p.thing_40_id") == WRONG)
        assert is_good(line.quality("p.counter"))
