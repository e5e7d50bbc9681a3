"""A PLC that shows one restart after the other in its header: one line in the log, one alarm, until it has been quiet."""

import asyncio

import pytest

from app.links.restarts import MANY, QUIET, Restarts
from app.registers import plc_map
from app.tags.quality import is_good
from tests.links.devices import Line, until
from tests.links.plc_devices import KINDS, SmallPlc, plant


def restarting(line: Line) -> bool:
    """What the alarm asks."""
    return line.link.restarts("p")


def test_one_spell_is_told_once_and_is_over_when_it_was_quiet() -> None:
    restarts = Restarts()
    assert [restarts.seen(float(second)) for second in range(60)] == [True, *[False] * 59]
    assert restarts.endless(59.0)
    assert restarts.endless(59.0 + QUIET)
    assert not restarts.endless(59.1 + QUIET)
    assert restarts.seen(60.0 + QUIET)
    assert not restarts.endless(60.0 + QUIET)


def test_a_restart_now_and_then_is_told_each_time_and_is_no_alarm() -> None:
    restarts = Restarts()
    for day in range(10):
        assert restarts.seen(day * 86_400.0)
        assert not restarts.endless(day * 86_400.0)
    assert not restarts.seen(9 * 86_400.0 + 5)
    assert not restarts.endless(9 * 86_400.0 + 5), MANY


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("word", [plc_map.AT_BOOTS, plc_map.AT_CRC, plc_map.AT_TIME])
async def test_a_header_that_jumps_each_second_is_one_line_and_one_alarm(
    kind: str, word: int, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level("INFO")
    device = SmallPlc()
    async with plant(device, kind) as (line, _):
        await until(lambda: is_good(line.quality("p.counter")))
        assert not restarting(line)
        for turn in range(12):
            device.header[word] = 1000 + turn % 2
            await asyncio.sleep(1)
        assert restarting(line)
        assert caplog.text.count("was restarted") + caplog.text.count("configuration of the device changed") == 1
        assert is_good(line.quality("p.counter"))
        assert await until(lambda: not restarting(line), 2 * QUIET) <= QUIET + 2
        device.header[word] = 500
        await asyncio.sleep(2)
        assert not restarting(line)
        assert caplog.text.count("was restarted") + caplog.text.count("configuration of the device changed") == 2
