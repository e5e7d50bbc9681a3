"""The register link against real telegrams: what it shows, what it does when the line fails, how writes go."""

import asyncio
import logging
from collections.abc import Sequence
from dataclasses import replace

import pytest

from app.errors import LinkError, NotConnected, Refused
from app.links.statistics import LinkState
from app.plant.definitions import Device, Type
from app.sim.bus import Bus, LineFaultMode
from app.tags.quality import (
    COMM_FAILURE,
    CONFIGURATION,
    DEVICE,
    GOOD,
    NOT_CONNECTED,
    OUT_OF_RANGE,
    is_bad,
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
    serving,
    tcp_link,
    until,
    writable,
)

# values


async def test_values_arrive_scaled_simulated_and_only_when_they_change() -> None:
    device = RegisterDevice({0: 1234, 1: 0xFFFE, 2: 0x0102, 3: 0x4048, 4: 0xF5C3})
    points = [
        point("m", "speed", 0, scale=0.1),
        point("m", "torque", 1, type=Type.I16),
        point("m", "low_byte", 2, mask=0xFF),
        point("m", "high_byte", 2, mask=0xFF, shift=8),
        point("m", "level", 3, type=Type.F32, words=2),
    ]
    async with running([machine("m", 1, points, QUICK)], exchange=on_bus(Bus({1: device}))) as line:
        await until(lambda: line.value("m.speed") is not None)
        assert [line.value(f"m.{p.key}") for p in points] == [123.4, -2, 2, 1, pytest.approx(3.14)]
        assert line.quality("m.speed") == GOOD | SIMULATED
        assert line.link.simulated
        await asyncio.sleep(0.1)
        told = len(line.batches)
        device.words[0] = 1240
        await until(lambda: line.value("m.speed") == 124.0)
        after = [b for b in line.batches[told:] if b.source == "link.hall" and b.handles]
        assert [list(b.handles) for b in after] == [[line.tags.handle("m.speed")]]
        assert line.link.words("m.level") == (0x4048, 0xF5C3)


async def test_a_value_that_does_not_change_stays_fresh() -> None:
    device = RegisterDevice({0: 1})
    async with running([row("m", 1, 1, QUICK)], exchange=on_bus(Bus({1: device}))) as line:
        await until(lambda: line.value("m.v0") == 1)
        first = line.tags.sample("m.v0").time
        await asyncio.sleep(0.3)
        sample = line.tags.sample("m.v0")
        assert sample.time == first
        assert sample.seen > first + 200_000
        assert line.tags.age(line.tags.handle("m.v0")) < 0.2


async def test_a_value_outside_what_the_device_can_measure_is_uncertain_and_alone() -> None:
    device = RegisterDevice({0: 10, 1: 900})
    points = [point("m", "a", 0, low=0, high=100), point("m", "b", 1, low=0, high=100)]
    async with running([machine("m", 1, points, QUICK)], exchange=on_bus(Bus({1: device}))) as line:
        await until(lambda: line.value("m.b") == 900)
        assert (line.quality("m.a"), line.quality("m.b")) == (GOOD | SIMULATED, OUT_OF_RANGE | SIMULATED)
        device.words[1] = 90
        await until(lambda: line.value("m.b") == 90)
        assert line.quality("m.b") == GOOD | SIMULATED


async def test_a_word_that_means_no_value_is_not_a_number() -> None:
    device = RegisterDevice({0: 0x8000})
    points = [point("m", "a", 0, none=0x8000)]
    async with running([machine("m", 1, points, QUICK)], exchange=on_bus(Bus({1: device}))) as line:
        await until(lambda: line.quality("m.a") == NOT_CONNECTED | SIMULATED)
        device.words[0] = 5
        await until(lambda: line.value("m.a") == 5 and is_good(line.quality("m.a")))


async def test_new_handles_after_a_change_of_the_plant_get_their_values() -> None:
    device = RegisterDevice({0: 1, 1: 2})
    async with running([row("m", 1, 2, QUICK)], exchange=on_bus(Bus({1: device}))) as line:
        await until(lambda: line.value("m.v1") == 2)
        line.tags.configure([line.tags.tags[1], line.tags.tags[0]])
        device.words = {0: 10, 1: 20}
        await until(lambda: (line.value("m.v0"), line.value("m.v1")) == (10, 20))


# what the device refuses


@pytest.mark.parametrize(("code", "quality"), [(1, CONFIGURATION), (4, DEVICE), (6, DEVICE)])
async def test_a_device_that_refuses_to_read_shows_it_and_comes_back(code: int, quality: int) -> None:
    device = RegisterDevice({0: 1})
    async with running([row("m", 1, 1, QUICK)], exchange=on_bus(Bus({1: device}))) as line:
        await until(lambda: line.value("m.v0") == 1)
        device.line_fault.argument, device.line_fault.mode = code, LineFaultMode.EXCEPTION
        await until(lambda: line.quality("m.v0") == quality | SIMULATED)
        assert line.value("m.v0") is None
        assert line.link.statistics.exceptions > 0
        device.line_fault.mode = LineFaultMode.NONE
        await line.link.raw_write(1, 0, [2])  # the instructor's hand is noticed at once
        await until(lambda: line.value("m.v0") == 2)


async def test_a_busy_answer_now_and_then_is_repeated_and_not_seen() -> None:
    device = RegisterDevice({0: 1})
    async with running([row("m", 1, 1, QUICK)], exchange=on_bus(Bus({1: device}))) as line:
        await until(lambda: line.value("m.v0") == 1)
        fault = device.line_fault
        fault.argument, fault.count, fault.mode = 6, 1, LineFaultMode.EXCEPTION
        await until(lambda: line.link.statistics.exceptions == 1)
        await asyncio.sleep(0.2)
        assert is_good(line.quality("m.v0"))
        assert not any(b.quality & 3 for b in line.batches if b.source == "link.hall")


# silence


async def test_a_pulled_cable_shows_within_one_time_out_and_a_second_and_heals_by_itself() -> None:
    device = RegisterDevice({n: n for n in range(5)})
    equipment = row("m", 1, 5, Device(timeout=0.3, fast=0.1))
    async with running([equipment], exchange=on_bus(Bus({1: device}))) as line:
        await until(lambda: line.value("m.v4") == 4)
        device.line_fault.mode = LineFaultMode.CABLE_PULLED
        assert await until(lambda: is_bad(line.quality("m.v0"))) < 0.3 + 1.0
        assert [(line.value(f"m.v{n}"), line.quality(f"m.v{n}")) for n in range(5)] == 5 * [
            (None, COMM_FAILURE | SIMULATED)
        ]
        assert line.link.statistics.state is LinkState.DOWN
        told = [b for b in line.batches if b.source == "link.hall" and b.quality & 3]
        assert len(told) == 1
        device.line_fault.mode = LineFaultMode.NONE
        await until(lambda: line.value("m.v4") == 4 and is_good(line.quality("m.v4")))
        assert line.link.statistics.state is LinkState.UP


async def test_one_lost_answer_is_asked_again_and_not_seen() -> None:
    device = RegisterDevice({0: 1})
    async with running([row("m", 1, 1, QUICK)], exchange=on_bus(Bus({1: device}))) as line:
        await until(lambda: line.value("m.v0") == 1)
        device.line_fault.count, device.line_fault.mode = 1, LineFaultMode.SILENT
        await until(lambda: line.link.statistics.retries == 1)
        await asyncio.sleep(0.3)
        assert line.link.statistics.timeouts == 1
        assert not any(b.quality & 3 for b in line.batches if b.source == "link.hall")


async def test_dead_units_do_not_slow_the_others() -> None:
    device = Device(timeout=0.25, fast=0.02)

    async def rate(units: Sequence[int], alive: int) -> tuple[float, str]:
        alive_device = RegisterDevice({0: 1})
        equipment = [row(f"m{unit}", unit, 1, device) for unit in units]
        bus = Bus({alive: alive_device}, turnaround=0.002)
        async with running(equipment, exchange=on_bus(bus)) as line:
            await until(lambda: line.value(f"m{alive}.v0") == 1)
            await asyncio.sleep(2.5)  # the first look at everybody is over
            before, began = len(alive_device.reads), asyncio.get_running_loop().time()
            await asyncio.sleep(3.0)
            return (len(alive_device.reads) - before) / (
                asyncio.get_running_loop().time() - began
            ), line.link.statistics.state.name

    alone, state = await rate([1], 1)
    assert state == "UP"
    with_dead, state = await rate([1, 2, 3, 4], 1)
    assert state == "SOME_SILENT"
    assert with_dead > 0.85 * alone


async def test_a_drive_that_answers_rubbish_never_makes_a_value() -> None:
    for mode in (LineFaultMode.WRONG_UNIT, LineFaultMode.WRONG_LENGTH, LineFaultMode.GARBAGE):
        device = RegisterDevice({0: 1, 1: 2})
        async with running([row("m", 1, 2, QUICK)], exchange=on_bus(Bus({1: device}))) as line:
            await until(lambda line=line: line.value("m.v1") == 2)
            device.line_fault.mode = mode
            await until(lambda line=line: is_bad(line.quality("m.v0")))
            await asyncio.sleep(0.2)
            assert {v for b in line.batches if b.source == "link.hall" for v in b.values} <= {1, 2, None}
            device.line_fault.mode = LineFaultMode.NONE
            await until(lambda line=line: line.value("m.v0") == 1)


# TCP


async def test_a_server_that_is_killed_and_comes_back_is_found_by_itself(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, logger="app.links")
    device = RegisterDevice({0: 5})
    bus = Bus({1: device})
    server = await serving(bus)
    port = server.address[1]
    async with running([row("m", 1, 1, QUICK)], link=tcp_link(server)) as line:
        await until(lambda: line.value("m.v0") == 5)
        assert line.quality("m.v0") == GOOD
        await server.close()
        assert await until(lambda: is_bad(line.quality("m.v0"))) < 1.1
        assert line.value("m.v0") is None
        began = asyncio.get_running_loop().time()
        with pytest.raises(NotConnected):
            await line.link.raw_read(1, 0, 1)
        with pytest.raises(NotConnected):
            await line.link.refresh("m", ["v0"])
        assert asyncio.get_running_loop().time() - began < 0.1
        await asyncio.sleep(1.0)
        assert line.link.statistics.state is LinkState.DOWN
        device.words[0] = 6
        server = await serving(bus, port)
        await until(lambda: line.value("m.v0") == 6 and is_good(line.quality("m.v0")))
    await server.close()
    told = [m.split(" reason")[0] for m in caplog.messages if m.startswith("link ")]
    assert told == ["link up link=hall", "link down link=hall", "link up link=hall"]


async def test_a_server_that_accepts_and_never_answers_is_down_and_told_once(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, logger="app.links")
    device = RegisterDevice({0: 5})
    server = await serving(Bus({1: device}))
    async with running([row("m", 1, 1, QUICK)], link=tcp_link(server)) as line:
        await until(lambda: line.value("m.v0") == 5)
        device.line_fault.mode = LineFaultMode.SILENT
        await until(lambda: is_bad(line.quality("m.v0")))
        await asyncio.sleep(7)
        assert line.link.statistics.state is LinkState.DOWN
        device.line_fault.mode = LineFaultMode.NONE
        await until(lambda: is_good(line.quality("m.v0")))
    await server.close()
    told = [m.split(" reason")[0] for m in caplog.messages if m.startswith("link ")]
    assert told == ["link up link=hall", "link down link=hall", "link up link=hall"]


@pytest.mark.parametrize("writes", [None, False, True])
@pytest.mark.parametrize("believed", [False, True])
async def test_what_a_device_says_of_itself_shows_and_opens_nothing_that_the_plant_file_keeps_shut(
    believed: bool, writes: bool | None
) -> None:
    device = RegisterDevice({0: 0, 1: 0, 2: 0, 0x20: 0, 0xE000: 0x5047, 0xE001: 1, 0xE002: 1, 0xE003: 1})
    server = await serving(Bus({1: device}))
    link = tcp_link(server, writes=writes, believe_simulated=believed)  # type: ignore[arg-type]
    async with running([machine("m", 1, writable(), QUICK)], link=link) as line:
        await until(lambda: line.value("m.speed") == 0)
        assert line.link.simulated is line.link.stations[1].simulated is believed
        assert line.quality("m.speed") == GOOD | SIMULATED
        if writes:
            await line.link.write("m", "command", 1)
        for write in () if writes else (line.link.write("m", "command", 1), line.link.raw_write(1, 0xE010, [4])):
            with pytest.raises(Refused) as refused:
                await write
            assert refused.value.reason == "command.writes_off"
    assert device.writes == [(0x20, (1,))] * bool(writes)
    await server.close()


@pytest.mark.parametrize("holes", [(), ((0x30, 0xFFFF),)])
async def test_our_own_question_to_a_foreign_device_is_no_fault_of_it(holes: tuple[tuple[int, int], ...]) -> None:
    device = RegisterDevice({0: 0, 1: 0, 2: 0, 0x20: 0})
    server = await serving(Bus({1: device}))
    item = machine("m", 1, writable(), replace(QUICK, holes=holes))
    async with running([item], link=tcp_link(server)) as line:  # type: ignore[arg-type]
        await until(lambda: line.value("m.speed") == 0)
        statistics = line.link.statistics
        assert (statistics.last_error_text, statistics.units[1].exceptions) == ("", 0)
        assert any(address >= 0xE000 for address, _ in device.reads) is not bool(holes)
    await server.close()


async def test_training_registers_of_another_make_are_a_configuration_error() -> None:
    device = RegisterDevice({0: 0, 1: 0, 2: 0, 0x20: 0, 0xE000: 0x5047, 0xE001: 1, 0xE002: 9, 0xE003: 1})
    server = await serving(Bus({1: device}))
    async with running([machine("m", 1, writable(), QUICK)], link=tcp_link(server, writes=True)) as line:  # type: ignore[arg-type]
        await until(lambda: line.quality("m.speed") == CONFIGURATION)
        assert line.link.statistics.state is LinkState.CONFIGURATION
        with pytest.raises(LinkError):
            await line.link.write("m", "command", 1)
    await server.close()
