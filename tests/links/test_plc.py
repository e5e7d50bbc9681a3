"""Header, images and tables of a Pogon PLC: what is published is whole, and is of the right device."""

import asyncio
from dataclasses import replace

import pytest

from app.errors import DeviceException, LinkError
from app.links.statistics import LinkState
from app.registers import plc_map
from app.tags.quality import CONFIGURATION as BAD_CONFIGURATION
from app.tags.quality import Origin, is_good
from tests.links.devices import until
from tests.links.plc_devices import (
    CONFIGURATION,
    KINDS,
    ROWS,
    STATUS,
    STATUS_WORDS,
    SmallPlc,
    once,
    plant,
    small,
)

SIMULATED = int(Origin.SIMULATED)
WRONG = BAD_CONFIGURATION | SIMULATED


# the plan


# values


@pytest.mark.parametrize("kind", KINDS)
async def test_values_of_all_parts_arrive(kind: str) -> None:
    device = SmallPlc()
    device.put(11, value=2.5)
    device.put(12)
    async with plant(device, kind) as (line, _):
        await until(lambda: line.value("p.thing_2_id") == 12 and line.value("p.c") == 3.0 and line.value("p.size"))
        assert (line.value("p.boots"), line.value("p.size"), line.value("p.level")) == (1, 5, 1.5)
        assert (line.value("p.thing_1_id"), line.value("p.thing_1_value"), line.value("p.thing_count")) == (11, 2.5, 2)
        assert is_good(line.quality("p.thing_1_value")) and is_good(line.quality("p.thing_40_value"))
        assert (line.value("p.thing_40_id"), line.value("p.thing_40_value")) == (0, None)
        before = line.value("p.counter")
        await until(lambda: line.value("p.counter") > before)  # type: ignore[operator]


async def test_a_torn_image_is_asked_for_again_and_never_published() -> None:
    device = SmallPlc()
    async with plant(device) as (line, _):
        await until(lambda: line.value("p.counter") is not None)
        device.torn.add(STATUS)
        await asyncio.sleep(0.05)
        before = line.value("p.counter")
        published = len([b for b in line.batches if line.tags.handle("p.counter") in b.handles])
        torn, device.reads = line.link.statistics.torn, []
        await asyncio.sleep(0.3)
        reads = device.reads.count((STATUS, STATUS_WORDS))
        assert reads > 2.5 * 0.3 / 0.03, "each scan is tried again at once"
        assert line.link.statistics.torn - torn == pytest.approx(reads, abs=1)
        assert line.value("p.counter") == before and is_good(line.quality("p.counter"))
        assert published == len([b for b in line.batches if line.tags.handle("p.counter") in b.handles])
        assert line.tags.age(line.tags.handle("p.counter")) > 0.25, "it grows old, and is stale some time"
        with pytest.raises(LinkError, match="changed while it was read"):
            await line.link.refresh("p", ["counter"])
        device.torn.clear()
        await until(lambda: line.value("p.counter") != before)


async def test_an_image_that_is_read_once_is_read_until_it_was_whole_once() -> None:
    device = SmallPlc()
    device.torn.add(CONFIGURATION)
    async with plant(device) as (line, _):
        await until(lambda: line.value("p.counter") is not None)
        await asyncio.sleep(0.5)
        assert line.value("p.size") is None and line.link.statistics.torn == 4
        device.torn.clear()
        await until(lambda: line.value("p.size") == 5)
        await asyncio.sleep(0.2)
        device.reads = []
        await asyncio.sleep(1.2)
        assert (CONFIGURATION, 6) not in device.reads


async def test_an_image_that_the_device_does_not_have_is_told_once_and_the_rest_lives(
    caplog: pytest.LogCaptureFixture,
) -> None:
    class Without(SmallPlc):
        def read(self, function: int, address: int, count: int) -> list[int]:
            if address in (CONFIGURATION, plc_map.EVENTS):
                raise DeviceException(2)
            return super().read(function, address, count)

    async with plant(Without()) as (line, _):
        await until(lambda: line.quality("p.size") == WRONG)
        await until(lambda: is_good(line.quality("p.counter")) and is_good(line.quality("p.a")))
        await asyncio.sleep(0.3)
    told = [message for message in caplog.messages if message.startswith("no such registers")]
    assert len(told) == 2


async def test_on_a_serial_line_a_lost_answer_does_not_end_the_scans_of_an_image() -> None:
    device = SmallPlc()
    async with plant(device, "rtu") as (line, bus):
        await until(lambda: line.value("p.counter") is not None)
        bus.fault = once("answer", lambda pdu: pdu[0] == 3 and int.from_bytes(pdu[1:3], "big") == STATUS)
        await until(lambda: bus.spoiled == 1)
        for _ in range(5):
            before = line.value("p.counter")
            await until(lambda before=before: line.value("p.counter") > before)
            shown = line.value("p.counter")
            assert device.counter - shown < 60, "and what is shown is as old as a telegram"  # type: ignore[operator]
        bus.late = 0.22
        for _ in range(3):
            bus.fault = once("late", lambda pdu: pdu[0] == 3 and int.from_bytes(pdu[1:3], "big") == STATUS)
            for _ in range(4):
                before = line.value("p.counter")
                await until(lambda before=before: line.value("p.counter") > before)
        assert {line.value("p.level"), line.value("p.state")} == {1.5, 1}


# tables


# the header


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("word", "value"),
    [(plc_map.AT_MAGIC, 0x1234), (plc_map.AT_MAJOR, 2), (plc_map.AT_TYPE, 78)],
)
async def test_another_device_gives_no_value_and_takes_no_write(kind: str, word: int, value: int) -> None:
    device = SmallPlc()
    device.header[word] = value
    async with plant(device, kind) as (line, _):
        quality = WRONG if kind == "memory" else BAD_CONFIGURATION
        await until(lambda: line.quality("p.counter") & 0xFF == BAD_CONFIGURATION)
        assert line.quality("p.thing_40_id") & 0xFF == quality & 0xFF
        assert line.link.statistics.state is LinkState.CONFIGURATION
        for call in (
            line.link.order("p", 1),
            line.link.order("p", 2, urgent=True),
            line.link.hold("p", 1, 1),
            line.link.write("p", "a", 5.0),
            line.link.answer("p", 1),
        ):
            with pytest.raises(LinkError, match="not the device of the plant file"):
                await call
        assert not device.executed and not device.heartbeats and not device.holds


async def test_a_device_that_is_exchanged_while_running_is_noticed_and_comes_back() -> None:
    device = SmallPlc()
    async with plant(device) as (line, _):
        await until(lambda: is_good(line.quality("p.counter")))
        device.header[plc_map.AT_TYPE] = 78
        await until(lambda: line.quality("p.counter") == WRONG and line.quality("p.thing_40_id") == WRONG)
        assert {line.value("p.counter"), line.value("p.size"), line.value("p.thing_40_id")} == {None}
        device.header.clear()
        await until(lambda: is_good(line.quality("p.counter")) and is_good(line.quality("p.size")))


async def test_a_newer_minor_version_is_fine() -> None:
    device = SmallPlc()
    device.header[plc_map.AT_MINOR] = 9
    async with plant(device) as (line, _):
        await until(lambda: is_good(line.quality("p.counter")))


async def test_a_table_that_is_younger_than_the_map_of_the_device_is_bad_whatever_stands_there() -> None:
    device = SmallPlc()
    device.put(7)
    device.header[plc_map.AT_MINOR] = 1
    machine = small()
    machine = replace(machine, type=replace(machine.type, tables={"thing": replace(ROWS, since=2)}))
    async with plant(device, equipment=[machine]) as (line, _):
        await until(lambda: is_good(line.quality("p.counter")) and line.quality("p.thing_1_id") == WRONG)
        assert line.value("p.thing_1_id") is None and line.value("p.thing_generation") is None
    device.header[plc_map.AT_MINOR] = 2
    async with plant(device, equipment=[machine]) as (line, _):
        await until(lambda: line.value("p.thing_1_id") == 7)


async def test_an_image_that_is_younger_than_the_map_of_the_device_is_bad_whatever_stands_there() -> None:
    device = SmallPlc()
    machine = small()
    map = machine.type.device.plc
    assert map
    younger = replace(map, images=[replace(image, since=3) for image in map.images])
    machine = replace(machine, type=replace(machine.type, device=replace(machine.type.device, services=(younger,))))
    device.header[plc_map.AT_MINOR] = 2
    async with plant(device, equipment=[machine]) as (line, _):
        await until(lambda: line.quality("p.counter") == WRONG)
        assert line.value("p.counter") is None
    device.header[plc_map.AT_MINOR] = 3
    async with plant(device, equipment=[machine]) as (line, _):
        await until(lambda: is_good(line.quality("p.counter")))


async def test_after_a_restart_and_after_another_configuration_what_is_read_once_is_read_again() -> None:
    device = SmallPlc()
    async with plant(device) as (line, _):
        await until(lambda: line.value("p.size") == 5)
        crc = line.value("p.crc")
        device.size = 6
        await until(lambda: line.value("p.size") == 6)
        assert line.value("p.crc") != crc
        await asyncio.sleep(0.3)
        device.reads = []
        device.power_cycle()
        await until(lambda: line.value("p.boots") == 2)
        await until(lambda: (CONFIGURATION, 6) in device.reads)
        assert (plc_map.ANSWERS, plc_map.ANSWERS_WORDS) in device.reads


# the heartbeat of the host


async def test_the_host_shows_every_second_that_it_is_there_when_it_may_write() -> None:
    device = SmallPlc()
    async with plant(device):
        await until(lambda: len(device.heartbeats) == 3)
        first, second, third = device.heartbeats
        assert (second - first & 0xFFFF, third - second & 0xFFFF) == (1, 1)
