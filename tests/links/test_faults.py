"""What is wrong with a device is one line in the log for each thing, however often it comes and goes."""

import asyncio

import pytest

from app.links.faults import Faults
from app.links.restarts import MANY, QUIET
from app.registers import plc_map
from app.sim.bus import Bus
from app.tags.quality import CONFIGURATION, is_good
from tests.links.devices import QUICK, RegisterDevice, row, running, serving, tcp_link, until
from tests.links.plc_devices import KINDS, SmallPlc, plant


def test_each_fault_is_told_once_in_a_spell_and_those_without_end_are_not() -> None:
    faults = Faults()
    assert [faults.new("a", 0.0), faults.new("b", 1.0), faults.new("a", 2.0)] == [True, True, False]
    assert [faults.new(f"word {n}", 3.0 + n) for n in range(20)] == [True] * (MANY - 2) + [False] * (22 - MANY)
    assert not faults.new("a", 22.0 + QUIET)
    assert faults.new("a", 22.1 + 2 * QUIET)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("word", [plc_map.AT_MAGIC, plc_map.AT_TYPE])
async def test_a_header_that_is_right_and_wrong_by_turns_is_told_once(
    kind: str, word: int, caplog: pytest.LogCaptureFixture
) -> None:
    device = SmallPlc()
    async with plant(device, kind) as (line, _):
        await until(lambda: is_good(line.quality("p.counter")))
        for turn in range(20):
            device.header = {} if turn % 2 else {word: 0x1234}
            await asyncio.sleep(2)
        assert caplog.text.count("device is not that of the plant file") == 1
        device.header = {word: 0x4321}
        await asyncio.sleep(3)
        assert caplog.text.count("device is not that of the plant file") == 2, "another fault is told"
        device.header = {}
        await until(lambda: is_good(line.quality("p.counter")))


async def test_training_registers_of_another_version_are_told_once(caplog: pytest.LogCaptureFixture) -> None:
    head = dict(enumerate((0x5047, 1, 9, 1), 0xE000))
    server = await serving(Bus({1: RegisterDevice({0: 7, **head})}))
    async with running([row("m", 1, 1, QUICK)], link=tcp_link(server)) as line:
        await until(lambda: line.quality("m.v0") == CONFIGURATION)
        await asyncio.sleep(10)
    await server.close()
    assert caplog.text.count("training registers not understood") == 1
