"""Bits of a word that has others, too: read, put together and written in one turn; no other write comes between, and a Stop is last."""

import asyncio
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import replace
from typing import cast

import pytest

from app.errors import DeviceException, LinkError, NoAnswer, NotTaken, Overtaken
from app.links.statistics import LinkState
from app.plant.definitions import Scan
from app.registers.pdu import parse_request
from app.sim.bus import Bus, LineFaultMode
from tests.links.devices import QUICK, RegisterDevice, exchange, machine, on_bus, point, running, until
from tests.virtual import VirtualLoop

WORD = 2
ROUTES = replace(QUICK, connections=2)


def control_word() -> list[object]:
    """A word that starts and stops the machine with one bit and chooses its mode with others."""
    return [
        point("m", "speed", 0),
        point("m", "run", WORD, mask=1, writable=True),
        point("m", "mode", WORD, mask=0xF, shift=4, writable=True),
        point("m", "whole", WORD, Scan.FAST),
    ]


def slow_reads_of_the_word(
    bus: Bus, free: asyncio.Event, asked: asyncio.Event
) -> Callable[[int, bytes], Awaitable[bytes | None]]:
    """The first read of the word alone waits for `free` and brings what was there when it was asked."""
    first = True

    async def answer(unit: int, pdu: bytes) -> bytes | None:
        nonlocal first
        request = parse_request(pdu)
        found = await exchange(bus, unit, pdu)
        if first and request.count == 1 and request.address == WORD and armed(bus):
            first = False
            asked.set()
            await free.wait()
        return found

    return answer


def armed(bus: Bus) -> bool:
    return bool(getattr(bus, "armed", False))


@pytest.mark.parametrize("connections", [1, 2])
async def test_a_stop_is_the_last_word_also_while_a_start_looks_at_the_bits_of_others(connections: int) -> None:
    device = RegisterDevice({0: 0, 1: 0, WORD: 0x30})
    bus, free, asked = Bus({1: device}), asyncio.Event(), asyncio.Event()  # type: ignore[arg-type]
    known = replace(QUICK, connections=connections, timeout=1.0)
    async with running(
        [machine("m", 1, control_word(), known)],  # type: ignore[arg-type]
        exchange=slow_reads_of_the_word(bus, free, asked),
    ) as line:
        await until(lambda: line.value("m.mode") == 3)
        bus.armed = True  # type: ignore[attr-defined]
        start = asyncio.create_task(line.link.write("m", "run", 1))
        await asyncio.wait_for(asked.wait(), 5)
        stop = asyncio.create_task(line.link.write("m", "run", 0, urgent=True))
        await asyncio.sleep(0.2)
        free.set()
        with pytest.raises(Overtaken):
            await start
        await stop
        await asyncio.sleep(0.5)
        assert device.words[WORD] == 0x30, "it stands, and its mode is as it was"


async def test_of_two_writes_to_one_word_none_is_lost() -> None:
    device = RegisterDevice({0: 0, 1: 0, WORD: 0xAB00})
    async with running([machine("m", 1, control_word(), ROUTES)], exchange=on_bus(Bus({1: device}))) as line:  # type: ignore[arg-type]
        await until(lambda: line.value("m.whole") == 0xAB00)
        for mode in (5, 9, 0, 15):
            writes = (line.link.write("m", "run", mode & 1), line.link.write("m", "mode", mode))
            await asyncio.gather(*writes)
            assert device.words[WORD] == 0xAB00 | mode << 4 | mode & 1


@pytest.mark.parametrize("mode", [LineFaultMode.SILENT, LineFaultMode.WRONG_LENGTH, LineFaultMode.EXCEPTION])
async def test_a_stop_goes_out_with_the_bits_as_last_seen_where_the_device_does_not_say_them(
    mode: LineFaultMode,
) -> None:
    device = RegisterDevice({0: 0, 1: 0, WORD: 0x71})
    async with running([machine("m", 1, control_word())], exchange=on_bus(Bus({1: device}))) as line:  # type: ignore[arg-type]
        await until(lambda: line.value("m.run") == 1)
        # broken between two scans: nobody has noticed yet
        device.line_fault.argument, device.line_fault.count, device.line_fault.mode = 4, 1, mode
        device.requests.clear()
        await line.link.write("m", "run", 0, urgent=True)
        assert (WORD, (0x70,)) in device.writes
        device.words[WORD] = 0x71
        device.line_fault.count, device.line_fault.mode = 0, LineFaultMode.SILENT
        await until(lambda: line.link.statistics.state is not LinkState.UP)
        device.requests.clear()
        with pytest.raises(NoAnswer):
            await line.link.write("m", "run", 0, urgent=True)
        assert device.words[WORD] == 0x70, "it hears, though nothing comes back"
        assert [written for _, written in device.writes] == [(0x70,)]


async def test_without_having_seen_the_bits_of_others_nothing_is_made_up() -> None:
    device = RegisterDevice({0: 0, 1: 0, WORD: 0x71})
    device.line_fault.count, device.line_fault.mode = 0, LineFaultMode.SILENT
    async with running([machine("m", 1, control_word())], exchange=on_bus(Bus({1: device}))) as line:  # type: ignore[arg-type]
        await asyncio.sleep(1)
        with pytest.raises(LinkError):
            await line.link.write("m", "run", 0, urgent=True)
        assert device.writes == [] and device.words[WORD] == 0x71


@pytest.mark.parametrize(
    ("mode", "error"),
    [
        (LineFaultMode.SILENT, NotTaken),
        (LineFaultMode.WRONG_LENGTH, NotTaken),
        (LineFaultMode.EXCEPTION, DeviceException),
    ],
)
async def test_a_write_whose_bits_of_others_cannot_be_read_was_not_sent_and_that_is_said(
    mode: LineFaultMode, error: type[LinkError]
) -> None:
    device = RegisterDevice({0: 0, 1: 0, WORD: 0x70})
    async with running([machine("m", 1, control_word())], exchange=on_bus(Bus({1: device}))) as line:  # type: ignore[arg-type]
        await until(lambda: line.value("m.mode") == 7)
        device.line_fault.argument, device.line_fault.count, device.line_fault.mode = 4, 1, mode
        with pytest.raises(error) as told:
            await line.link.write("m", "run", 1)
        assert type(told.value) is error and device.writes == []
        if error is NotTaken:
            assert told.value.kind == ("no_answer" if mode is LineFaultMode.SILENT else "bad_answer")
            assert "0x0002" in str(told.value)
        await until(lambda: line.link.statistics.state is LinkState.UP and line.value("m.mode") == 7)
        await line.link.write("m", "run", 1)
        assert device.words[WORD] == 0x71


@pytest.mark.parametrize(
    ("stands", "urgent", "left"),
    [(1, False, 0x91), (2, False, 0x91), (9, False, None), (1, True, 0x90), (9, True, 0x90)],
)
async def test_the_bits_of_others_are_none_from_before_this_program_stood_still(
    stands: int, urgent: bool, left: int | None
) -> None:
    device = RegisterDevice({0: 0, 1: 0, WORD: 0x30})
    bus, loop = Bus({1: device}), cast("VirtualLoop", asyncio.get_running_loop())  # type: ignore[arg-type]
    stood = 0

    async def answer(unit: int, pdu: bytes) -> bytes | None:
        """What was there before this program stood still, read after it; meanwhile somebody else has chosen another mode."""
        nonlocal stood
        request = parse_request(pdu)
        found = await exchange(bus, unit, pdu)
        if armed(bus) and stood < stands and request.count == 1 and request.address == WORD:
            stood += 1
            device.words[WORD] = 0x90
            loop.clock.advance(30)
        return found

    async with running([machine("m", 1, control_word(), replace(QUICK, timeout=40.0))], exchange=answer) as line:  # type: ignore[arg-type]
        await until(lambda: line.value("m.mode") == 3)
        line.tags.sweep()
        bus.armed = True  # type: ignore[attr-defined]
        device.requests.clear()
        write = line.link.write("m", "run", 0 if urgent else 1, urgent=urgent)
        if left is None:
            with pytest.raises(NotTaken, match="stood still"):
                await write
        else:
            await write
        assert [words for address, words in device.writes if address == WORD] == ([] if left is None else [(left,)])


async def test_both_telegrams_are_counted() -> None:
    device = RegisterDevice({0: 0, 1: 0, WORD: 0x70})
    points: Sequence[object] = [point("m", "run", WORD, Scan.ONCE, mask=1, writable=True)]
    async with running(
        [machine("m", 1, points, replace(QUICK, fast=60, slow=60))], exchange=on_bus(Bus({1: device}))
    ) as line:  # type: ignore[arg-type]
        await until(lambda: line.value("m.run") == 0)
        before = line.link.statistics.telegrams
        device.requests.clear()
        await line.link.write("m", "run", 1)
        sent = len(device.requests)
        assert sent >= 2 and line.link.statistics.telegrams - before == sent
