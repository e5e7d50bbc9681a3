"""The register link against real telegrams: what it shows, what it does when the line fails, how writes go."""

import asyncio
import logging
from collections.abc import Sequence
from dataclasses import replace

import pytest

from app.errors import DeviceException, LinkError, NoAnswer, NotConnected, Overtaken, Refused
from app.links.statistics import LinkState
from app.plant.definitions import Device, Link, Scan, Type
from app.sim.bus import Bus, LineFaultMode
from app.sim.server import TcpServer
from app.tags.quality import (
    COMM_FAILURE,
    CONFIGURATION,
    DEVICE,
    GOOD,
    NOT_CONNECTED,
    OUT_OF_RANGE,
    Origin,
    is_bad,
    is_good,
)
from tests.links.devices import RegisterDevice, machine, on_bus, point, row, running, until

SIMULATED = int(Origin.SIMULATED)
QUICK = Device(timeout=0.1, fast=0.02, slow=0.1)


def tcp_link(server: TcpServer, **options: object) -> Link:
    return Link("hall", "tcp", host="127.0.0.1", tcp_port=server.address[1], **options)  # type: ignore[arg-type]


async def serving(bus: Bus, port: int = 0) -> TcpServer:
    server = TcpServer(bus)
    await server.start("127.0.0.1", port)
    return server


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


# what is scanned when


async def test_slow_points_are_read_slower_and_once_points_once() -> None:
    device = RegisterDevice({n: n for n in range(400)})
    points = [point("m", "fast", 0), point("m", "slow", 200, Scan.SLOW), point("m", "once", 399, Scan.ONCE)]
    async with running([machine("m", 1, points, QUICK)], exchange=on_bus(Bus({1: device}))) as line:
        await until(lambda: line.value("m.once") == 399)
        await asyncio.sleep(1.0)
        counts = {address: sum(1 for at, _ in device.reads if at == address) for address in (0, 200, 399)}
    assert 40 <= counts[0] <= 55
    assert 8 <= counts[200] <= 13
    assert counts[399] == 1


async def test_a_point_of_a_page_is_read_once_and_then_only_while_somebody_looks() -> None:
    device = RegisterDevice({0: 0, 200: 5})
    points = [point("m", "fast", 0), point("m", "page", 200, Scan.PAGE)]

    def reads() -> int:
        return sum(1 for address, _ in device.reads if address == 200)

    async with running([machine("m", 1, points, QUICK)], exchange=on_bus(Bus({1: device}))) as line:
        await until(lambda: line.value("m.page") == 5)
        await asyncio.sleep(0.3)
        assert reads() == 1
        line.link.demand("page 1", ["m.page"])
        line.link.demand("page 2", ["m.page", "m.fast"])
        await until(lambda: reads() >= 4)
        line.link.release("page 1")
        before = reads()
        await until(lambda: reads() >= before + 2)
        line.link.release("page 2")
        await asyncio.sleep(0.15)
        before = reads()
        await asyncio.sleep(0.4)
        assert reads() == before
        line.link.release("page 2")


async def test_scans_keep_their_period_without_drift() -> None:
    device = RegisterDevice({0: 0})
    equipment = row("m", 1, 1, Device(timeout=0.1, fast=0.05))
    async with running([equipment], exchange=on_bus(Bus({1: device}, turnaround=0.01))) as line:
        await until(lambda: line.value("m.v0") == 0)
        before, began = len(device.reads), asyncio.get_running_loop().time()
        await asyncio.sleep(2.0)
        elapsed = asyncio.get_running_loop().time() - began
        assert len(device.reads) - before == pytest.approx(elapsed / 0.05, abs=1.5)
        assert line.link.statistics.scan_time == pytest.approx(0.05, rel=0.1)
        assert line.link.statistics.bus_share == pytest.approx(0.2, abs=0.1)


async def test_a_line_that_is_too_short_counts_late_scans_and_forgets_nobody() -> None:
    device = RegisterDevice({n: 0 for n in range(400)})
    points = [point("m", "fast", 0), point("m", "slow", 200, Scan.SLOW)]
    equipment = machine("m", 1, points, Device(timeout=0.2, fast=0.01, slow=0.1))
    async with running([equipment], exchange=on_bus(Bus({1: device}, turnaround=0.03))) as line:
        await asyncio.sleep(1.5)
        fast = sum(1 for address, _ in device.reads if address == 0)
        slow = len(device.reads) - fast
        assert len(device.reads) >= 40, "the line is used to the full"
        assert slow >= 5
        assert fast > 2 * slow
        assert line.link.statistics.late_scans > 20


# what the device refuses


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


async def test_no_server_at_all_is_told_once(caplog: pytest.LogCaptureFixture, free_port: int) -> None:
    caplog.set_level(logging.INFO)
    link = Link("hall", "tcp", host="127.0.0.1", tcp_port=free_port)
    async with running([row("m", 1, 1, QUICK)], link=link) as line:
        await asyncio.sleep(1.5)
        assert line.quality("m.v0") == COMM_FAILURE
        assert line.link.statistics.state is LinkState.DOWN
        assert not line.link.simulated
    assert [m for m in caplog.messages if m.startswith("link ")] == [
        f"link down link=hall reason=127.0.0.1:{free_port}: no connection"
    ]


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


async def test_several_connections_give_a_thousand_registers_in_100_ms_from_a_device_that_needs_20() -> None:
    device = RegisterDevice({n: n for n in range(1000)})
    server = await serving(Bus({1: device}, turnaround=0.02))
    equipment = row("m", 1, 1000, Device(timeout=0.3, fast=0.1, connections=4))
    async with running([equipment], link=tcp_link(server)) as line:
        await until(lambda: all(is_good(line.quality(f"m.v{n}")) for n in range(1000)))
        assert line.link.statistics.connections == 4
        before, began = len(device.reads), asyncio.get_running_loop().time()
        await asyncio.sleep(2.0)
        rounds = (len(device.reads) - before) / 8 / (asyncio.get_running_loop().time() - began)
        assert rounds > 9.0
    await server.close()


async def test_a_device_that_takes_fewer_connections_is_read_over_those() -> None:
    device = RegisterDevice({n: n for n in range(300)})
    server = TcpServer(Bus({1: device}), max_connections=1)
    await server.start("127.0.0.1", 0)
    equipment = row("m", 1, 300, Device(timeout=0.2, fast=0.05, connections=3))
    async with running([equipment], link=tcp_link(server, writes=True)) as line:
        await until(lambda: all(is_good(line.quality(f"m.v{n}")) for n in range(300)))
        await asyncio.sleep(1.0)
        bad = [b for b in line.batches if b.source == "link.hall" and b.quality & 3]
        assert not bad
    await server.close()


# writes


def writable(device: Device = QUICK, unit: int = 1) -> list[object]:
    return [
        point("m", "speed", 0),
        point("m", "command", 0x20, readable=False, writable=True),
        point("m", "setpoint", 1, Scan.ONCE, writable=True, scale=0.01),
        point("m", "flags", 2, mask=0xF, shift=4, writable=True),
    ]


async def test_a_write_is_scaled_echoed_and_read_back() -> None:
    device = RegisterDevice({0: 0, 1: 0, 2: 0xABCD, 0x20: 0})
    async with running([machine("m", 1, writable(), QUICK)], exchange=on_bus(Bus({1: device}))) as line:  # type: ignore[arg-type]
        await until(lambda: line.value("m.setpoint") == 0)
        await line.link.write("m", "setpoint", 42.5)
        assert device.words[1] == 4250
        await until(lambda: line.value("m.setpoint") == 42.5)
        await line.link.write("m", "flags", 3)
        assert device.words[2] == 0xAB3D, "the other bits of the register are left as they are"
        device.words[1] = 100
        await line.link.refresh("m", ["setpoint"])
        assert line.value("m.setpoint") == 1.0


async def test_what_cannot_be_written_is_refused_with_its_name() -> None:
    device = RegisterDevice({0: 0, 1: 0, 2: 0, 0x20: 0})
    async with running([machine("m", 1, writable(), QUICK)], exchange=on_bus(Bus({1: device}))) as line:  # type: ignore[arg-type]
        await until(lambda: line.value("m.speed") == 0)
        for name, value, message in (
            ("speed", 1, r"m\.speed cannot be written"),
            ("setpoint", 1000, r"m\.setpoint: .*655"),
            ("nothing", 1, "nothing"),
        ):
            with pytest.raises(LinkError, match=message):
                await line.link.write("m", name, value)
        with pytest.raises(LinkError, match=r"m\.command cannot be read"):
            await line.link.refresh("m", ["command"])
        del device.words[0x20]
        with pytest.raises(DeviceException):
            await line.link.write("m", "command", 1)


async def test_a_live_device_is_not_written_to_until_the_plant_file_says_so() -> None:
    device = RegisterDevice({0: 0, 1: 0, 2: 0, 0x20: 0})
    server = await serving(Bus({1: device}))
    for allowed in (False, True):
        async with running([machine("m", 1, writable(), QUICK)], link=tcp_link(server, writes=allowed)) as line:  # type: ignore[arg-type]
            await until(lambda line=line: line.value("m.speed") == 0)
            assert not line.link.simulated
            if allowed:
                await line.link.write("m", "command", 3, urgent=True)
                await line.link.raw_write(1, 1, [5])
                continue
            for urgent in (False, True):
                with pytest.raises(Refused) as refused:
                    await line.link.write("m", "command", 1, urgent=urgent)
                assert refused.value.reason == "command.writes_off"
            with pytest.raises(Refused):
                await line.link.raw_write(1, 1, [5])
            with pytest.raises(Refused):
                await line.link.raw_write(77, 1, [5])
            assert device.writes == []
    assert device.writes == [(0x20, (3,)), (1, (5,))]
    await server.close()


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


async def test_a_simulated_line_of_this_process_whose_writes_are_off_takes_none() -> None:
    device = RegisterDevice({0: 0, 1: 0, 2: 0, 0x20: 0})
    for writes in (False, None):
        link = Link("hall", "memory", writes=writes)
        async with running([machine("m", 1, writable(), QUICK)], exchange=on_bus(Bus({1: device})), link=link) as line:
            await until(lambda line=line: line.value("m.speed") == 0)
            if writes is None:
                await line.link.write("m", "command", 1)
                continue
            with pytest.raises(Refused):
                await line.link.write("m", "command", 1, urgent=True)
    assert device.writes == [(0x20, (1,))]


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


async def test_a_write_waits_for_the_telegram_on_the_wire_and_no_longer() -> None:
    device = RegisterDevice({n: 0 for n in range(600)})
    points = [point("m", f"v{n}", n) for n in range(0, 600, 5)] + [point("m", "command", 599, writable=True)]
    equipment = machine("m", 1, points, Device(timeout=0.3, fast=0.02, max_read=20))
    async with running([equipment], exchange=on_bus(Bus({1: device}, turnaround=0.03))) as line:
        await asyncio.sleep(0.3)
        longest = 0.0
        for n in range(10):
            began = asyncio.get_running_loop().time()
            await line.link.write("m", "command", n)
            longest = max(longest, asyncio.get_running_loop().time() - began)
            await asyncio.sleep(0.013)
        assert longest < 0.03 + 0.03 + 0.02, "one telegram of another, its own, and the loop"


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


async def test_a_write_is_sent_once_whatever_becomes_of_its_answer() -> None:
    device = RegisterDevice({0: 0, 1: 0, 2: 0, 0x20: 0})
    async with running([machine("m", 1, writable(), QUICK)], exchange=on_bus(Bus({1: device}))) as line:  # type: ignore[arg-type]
        await until(lambda: line.value("m.speed") == 0)
        device.line_fault.mode = LineFaultMode.SILENT
        with pytest.raises(NoAnswer):
            await line.link.write("m", "command", 1)
        await asyncio.sleep(0.5)
        assert device.writes == [(0x20, (1,))]
        began = asyncio.get_running_loop().time()
        with pytest.raises(NoAnswer):
            await line.link.write("m", "command", 2)
        assert asyncio.get_running_loop().time() - began < 0.05, "the unit is known to be silent"
        with pytest.raises(NoAnswer):
            await line.link.write("m", "command", 3, urgent=True)
        assert device.writes == [(0x20, (1,)), (0x20, (3,))], "a Stop is tried all the same"


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


@pytest.mark.parametrize(
    "mode",
    [
        LineFaultMode.SILENT,
        LineFaultMode.WRONG_UNIT,
        LineFaultMode.WRONG_LENGTH,
        LineFaultMode.GARBAGE,
        LineFaultMode.EXCEPTION,
    ],
)
async def test_no_write_succeeds_falsely_over_a_bad_line(mode: LineFaultMode) -> None:
    device = RegisterDevice({0: 0, 0x20: 0})
    points = [point("m", "speed", 0, Scan.ONCE), point("m", "command", 0x20, readable=False, writable=True)]
    server = await serving(Bus({1: device}))
    equipment = machine("m", 1, points, Device(timeout=0.02))
    async with running([equipment], link=tcp_link(server, writes=True)) as line:
        await until(lambda: line.value("m.speed") == 0)
        accepted = []
        for n in range(100):
            if n % 3 == 0:
                fault = device.line_fault
                fault.argument, fault.count, fault.mode = 4, 1, mode
            try:
                await line.link.write("m", "command", n)
                accepted.append(n)
            except LinkError:
                assert n % 3 == 0
        assert accepted == [n for n in range(100) if n % 3]
        assert set(accepted) <= {words[0] for _, words in device.writes}
    await server.close()


# statistics


async def test_statistics_are_tags() -> None:
    device = RegisterDevice({0: 1})
    async with running([row("m", 1, 1, QUICK)], exchange=on_bus(Bus({1: device}))) as line:
        await until(lambda: line.value("sys.link.hall.polls") not in (None, 0.0))
        assert line.value("sys.link.hall.state") == LinkState.UP
        assert line.value("sys.link.hall.simulated") == 1
        assert 30 < float(str(line.value("sys.link.hall.polls"))) < 60
        assert float(str(line.value("sys.link.hall.scan_time"))) == pytest.approx(20, abs=4)
        device.line_fault.mode = LineFaultMode.CABLE_PULLED
        await until(lambda: line.value("sys.link.hall.unit1.state") == LinkState.DOWN)
        await until(lambda: line.value("sys.link.hall.last_error") == 2)
        assert float(str(line.value("sys.link.hall.unit1.timeouts"))) >= 2
