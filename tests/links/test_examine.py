"""Registers that a device refuses are found one by one, the rest lives, and they are looked for again."""

import asyncio
import logging
from dataclasses import replace

import pytest

from app.links.station import spread
from app.links.statistics import LinkState
from app.plant.definitions import Device, Link
from app.registers.register import Type
from app.sim.bus import Bus, LineFaultMode
from app.tags.quality import (
    GOOD,
    NOT_CONNECTED,
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
    until,
)


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


@pytest.mark.parametrize("kind", ["silent", "short"])
async def test_a_device_that_does_not_say_what_is_too_much_is_read_with_less(
    kind: str, caplog: pytest.LogCaptureFixture
) -> None:
    """Its type names no size to fall back to: it was up and down once a second, for ever, and not one value of it was good."""
    device = RegisterDevice({n: n for n in range(50)})
    bus = Bus({1: device})

    async def exchange(unit: int, pdu: bytes) -> bytes | None:
        if int.from_bytes(pdu[3:5], "big") > 16:
            return await on_bus(bus)(unit, pdu[:3] + b"\0\x10") if kind == "short" else None
        return await on_bus(bus)(unit, pdu)

    async with running([row("m", 1, 50, QUICK)], exchange=exchange) as line:
        await until(lambda: all(is_good(line.quality(f"m.v{n}")) for n in range(50)), 5.0)
        ups = caplog.messages.count("link up link=hall")
        device.requests.clear()
        await asyncio.sleep(5)
        assert all(is_good(line.quality(f"m.v{n}")) for n in range(50))
        assert len(set(device.reads)) <= 5
        assert caplog.messages.count("link up link=hall") == ups


@pytest.mark.parametrize("later", [False, True])
async def test_a_register_for_which_a_device_is_silent_takes_no_other_with_it(later: bool) -> None:
    """Not every device refuses in words. The unit was up and down once a second, for ever."""
    device = RegisterDevice({n: n for n in range(50)})
    bus, silent = Bus({1: device}), not later

    async def exchange(unit: int, pdu: bytes) -> bytes | None:
        first, count = int.from_bytes(pdu[1:3], "big"), int.from_bytes(pdu[3:5], "big")
        return None if silent and first <= 23 < first + count else await on_bus(bus)(unit, pdu)

    others = [f"m.v{n}" for n in range(50) if n != 23]
    async with running([row("m", 1, 50, QUICK)], exchange=exchange) as line:
        if later:
            await until(lambda: is_good(line.quality("m.v23")))
            silent = True
            await until(lambda: not is_good(line.quality("m.v23")))
        await until(lambda: all(map(is_good, map(line.quality, others))), 5.0)
        for _ in range(50):
            await asyncio.sleep(0.1)
            assert all(map(is_good, map(line.quality, others)))
        assert line.quality("m.v23") == NOT_CONNECTED | SIMULATED
        silent = False
        await until(lambda: line.value("m.v23") == 23)


@pytest.mark.sweep(8)
@pytest.mark.parametrize("code", [0, 1, 4, 7, 8, 99, 255])
async def test_a_register_that_is_refused_with_any_code_takes_no_other_with_it(code: int) -> None:
    """Such as 04 for a sensor that is not fitted: a whole block of values was bad for as long as that lasted."""
    device = RegisterDevice({n: n for n in range(30)})
    bus, refuses = Bus({1: device}), True

    async def exchange(unit: int, pdu: bytes) -> bytes | None:
        first, count = int.from_bytes(pdu[1:3], "big"), int.from_bytes(pdu[3:5], "big")
        return bytes((0x83, code)) if refuses and first <= 7 < first + count else await on_bus(bus)(unit, pdu)

    others = [f"m.v{n}" for n in range(30) if n != 7]
    async with running([row("m", 1, 30, QUICK)], exchange=exchange) as line:
        await until(lambda: all(map(is_good, map(line.quality, others))), 6.0)
        for _ in range(50):
            await asyncio.sleep(0.1)
            assert all(map(is_good, map(line.quality, others)))
        assert line.quality("m.v7") == NOT_CONNECTED | SIMULATED
        refuses = False
        await until(lambda: line.value("m.v7") == 7)


@pytest.mark.sweep(8)
@pytest.mark.parametrize("code", [2, 4])
async def test_registers_that_it_had_answered_are_good_two_seconds_after_they_are_answered_again(code: int) -> None:
    device = RegisterDevice({n: n for n in range(30)})
    bus, refuses = Bus({1: device}), False

    async def exchange(unit: int, pdu: bytes) -> bytes | None:
        first, count = int.from_bytes(pdu[1:3], "big"), int.from_bytes(pdu[3:5], "big")
        return bytes((0x83, code)) if refuses and first <= 7 < first + count else await on_bus(bus)(unit, pdu)

    async with running([row("m", 1, 30, QUICK)], exchange=exchange) as line:
        await until(lambda: is_good(line.quality("m.v29")))
        refuses = True
        await asyncio.sleep(60)
        refuses = False
        await until(lambda: is_good(line.quality("m.v7")), 2.0)


@pytest.mark.parametrize("code", [4, 99])
async def test_a_device_that_refuses_everything_for_a_while_is_not_taken_apart(code: int) -> None:
    device = RegisterDevice({n: n for n in range(30)})
    bus, refuses, asked = Bus({1: device}), False, 0

    async def exchange(unit: int, pdu: bytes) -> bytes | None:
        nonlocal asked
        asked += 1
        return bytes((pdu[0] | 0x80, code)) if refuses else await on_bus(bus)(unit, pdu)

    async with running([row("m", 1, 30, QUICK)], exchange=exchange) as line:
        await until(lambda: is_good(line.quality("m.v29")))
        refuses, asked = True, 0
        await asyncio.sleep(20)
        assert asked < 100
        refuses = False
        await until(lambda: all(is_good(line.quality(f"m.v{n}")) for n in range(30)), 2.0)
        assert not line.link.stations[1].learned.bad


async def test_a_value_as_long_as_the_most_that_a_device_takes_is_read() -> None:
    """The limit was taken for smaller than a read that had just been answered."""
    device = RegisterDevice({n: n for n in range(14)}, limit=4)
    points = [point("m", f"v{n}", n) for n in range(10)] + [point("m", "wide", 10, type=Type.U64, words=4)]
    async with running([machine("m", 1, points, QUICK)], exchange=on_bus(Bus({1: device}))) as line:
        await until(lambda: all(is_good(line.quality(one.name)) for one in points), 5.0)
        assert line.value("m.wide") == 0x000A_000B_000C_000D


@pytest.mark.parametrize("fallback", [0, 9])
async def test_a_unit_that_is_silent_for_the_first_of_its_registers_is_read(fallback: int) -> None:
    """Whether it is there was asked with that register alone."""
    device = RegisterDevice({n: n for n in (*range(10), *range(500, 510))})
    bus = Bus({1: device})

    async def exchange(unit: int, pdu: bytes) -> bytes | None:
        return None if pdu[1:3] == b"\0\0" else await on_bus(bus)(unit, pdu)

    points = [point("m", f"v{n}", n) for n in (*range(10), *range(500, 510))]
    device_data = replace(QUICK, fallback_read=fallback)
    async with running([machine("m", 1, points, device_data)], exchange=exchange, link=Link("hall", "memory")) as line:
        await until(lambda: all(is_good(line.quality(one.name)) for one in points[1:]), 10.0)
        await asyncio.sleep(10)
        assert all(is_good(line.quality(one.name)) for one in points[1:])
        assert line.quality("m.v0") == NOT_CONNECTED | SIMULATED


@pytest.mark.parametrize("fallback", [0, 9])
@pytest.mark.parametrize("silent", [{0}, {0, 29}, set(range(12)), set(range(29))])
async def test_a_unit_that_never_answered_is_found_by_whichever_register_answers(
    silent: set[int], fallback: int
) -> None:
    """All its registers are of one block: it was asked for the first alone, for ever."""
    bus = Bus({1: RegisterDevice({n: n for n in range(30)})})

    async def exchange(unit: int, pdu: bytes) -> bytes | None:
        first, count = int.from_bytes(pdu[1:3], "big"), int.from_bytes(pdu[3:5], "big")
        return None if silent.intersection(range(first, first + count)) else await on_bus(bus)(unit, pdu)

    device = replace(QUICK, fallback_read=fallback)
    async with running([row("m", 1, 30, device)], exchange=exchange, link=Link("hall", "memory")) as line:
        others = [f"m.v{n}" for n in range(30) if n not in silent]
        await until(lambda: all(map(is_good, map(line.quality, others))), 45.0 if len(silent) > 12 else 10.0)
        await until(lambda: all(line.quality(f"m.v{n}") == NOT_CONNECTED | SIMULATED for n in silent))


def test_the_registers_of_a_block_are_asked_for_the_halves_first() -> None:
    spans = [(n, n) for n in range(9)]
    assert [first for first, _ in spread(spans)] == [0, 8, 4, 2, 6, 1, 3, 5, 7]
    assert spread([]) == []


async def test_a_unit_that_falls_silent_while_it_is_examined_is_silent() -> None:
    device = RegisterDevice({n: n for n in range(50)})
    bus, answers = Bus({1: device}), 4

    async def exchange(unit: int, pdu: bytes) -> bytes | None:
        nonlocal answers
        if int.from_bytes(pdu[3:5], "big") > 16:
            return None
        answers -= 1
        return await on_bus(bus)(unit, pdu) if answers >= 0 else None

    async with running([row("m", 1, 50, QUICK)], exchange=exchange) as line:
        await until(lambda: answers < 0)
        await until(lambda: line.link.stations[1].state is LinkState.DOWN, 2.0)
        answers = 1000
        await until(lambda: all(is_good(line.quality(f"m.v{n}")) for n in range(50)), 5.0)
        assert not line.link.stations[1].learned.bad


async def test_registers_that_appear_later_are_found_again() -> None:
    device = RegisterDevice({})
    async with running([row("m", 1, 3, QUICK)], exchange=on_bus(Bus({1: device}))) as line:
        await until(lambda: line.quality("m.v0") == NOT_CONNECTED | SIMULATED)
        device.words = {0: 1, 1: 2, 2: 3}
        await until(lambda: line.value("m.v2") == 3)


async def test_looks_that_a_lost_line_prevented_do_not_put_off_the_next() -> None:
    """A device that starts refuses its registers, and its line is lost and found a few times meanwhile."""
    device, cut = RegisterDevice({0: 1, 2: 3}), False

    async def exchange(unit: int, pdu: bytes) -> bytes | None:
        return None if cut else await on_bus(bus)(unit, pdu)

    bus = Bus({1: device})
    async with running([row("m", 1, 3, replace(QUICK, timeout=0.05))], exchange=exchange) as line:
        await until(lambda: line.quality("m.v1") == NOT_CONNECTED | SIMULATED)
        for _ in range(8):
            cut = True
            await until(lambda: line.link.stations[1].state is LinkState.DOWN)
            cut = False
            await until(lambda: is_good(line.quality("m.v2")))
        device.words[1] = 2
        await until(lambda: line.value("m.v1") == 2, 10.0)
