"""Writes over a link: scaled, merged, echoed, allowed by the plant file, sent once, and never a success that was none."""

import asyncio
from dataclasses import replace

import pytest

from app.errors import DeviceException, LinkError, NoAnswer, Refused
from app.plant.definitions import Device, Link, Scan
from app.registers.codec import decode, encode
from app.registers.register import Order, Register, Type
from app.sim.bus import Bus, LineFaultMode
from tests.links.devices import (
    QUICK,
    RegisterDevice,
    machine,
    on_bus,
    point,
    running,
    serving,
    tcp_link,
    until,
    writable,
)


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


@pytest.mark.parametrize("order", list(Order))
@pytest.mark.parametrize(
    ("kind", "words", "mask", "shift", "value"),
    [
        (Type.U16, 1, 0x0F, 4, 3), (Type.U16, 1, 0xFF, 8, 0xA5), (Type.I16, 1, 0x03, 14, 2), (Type.U16, 1, None, 4, 0x123),
        (Type.U32, 2, 0xFF, 0, 0x5A), (Type.U32, 2, 0xFFFF, 8, 0x1234), (Type.I32, 2, 0x7, 29, 5), (Type.U32, 2, None, 20, 0x0BC),
        (Type.U64, 4, 0xFFFF, 24, 0xBEEF), (Type.I64, 4, 0x1, 63, 1),
    ],
)  # fmt: skip
async def test_a_part_of_a_value_is_written_and_the_bits_of_others_stay_in_every_order(
    kind: Type, words: int, mask: int | None, shift: int, value: int, order: Order
) -> None:
    whole = Register(1, Type(f"u{16 * words}"), order, words=words)
    before = 0x0123_4567_89AB_CDEF & (1 << 16 * words) - 1
    device = RegisterDevice({0: 0, **dict(enumerate(encode(whole, before), 1))})
    known = replace(QUICK, max_write=4, write_functions=(6, 16))
    part = point("m", "part", 1, type=kind, words=words, order=order, mask=mask, shift=shift, writable=True)
    async with running([machine("m", 1, [part], known)], exchange=on_bus(Bus({1: device}))) as line:
        await until(lambda: line.value("m.part") is not None)
        await line.link.write("m", "part", value)
        await until(lambda: line.value("m.part") == value)
    own = ((1 << 16 * words) - 1 if mask is None else mask) << shift & (1 << 16 * words) - 1
    assert decode(whole, [device.words[at] for at in range(1, 1 + words)]) == before & ~own | value << shift


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
