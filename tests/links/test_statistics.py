"""How a link is doing, as tags."""

import pytest

from app.links.statistics import LinkState
from app.sim.bus import Bus, LineFaultMode
from app.tags.quality import COMM_FAILURE, is_good
from tests.links.devices import (
    QUICK,
    RegisterDevice,
    on_bus,
    row,
    running,
    until,
)


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


async def test_a_unit_that_is_silent_has_no_answer_time() -> None:
    device = RegisterDevice({0: 1})
    name = "sys.link.hall.unit1.answer_time"
    async with running([row("m", 1, 1, QUICK)], exchange=on_bus(Bus({1: device}))) as line:
        await until(lambda: is_good(line.quality(name)))
        assert float(str(line.value(name))) >= 0
        device.line_fault.mode = LineFaultMode.CABLE_PULLED
        await until(lambda: line.value("sys.link.hall.unit1.state") == LinkState.DOWN)
        await until(lambda: line.quality(name) == COMM_FAILURE)
        device.line_fault.mode = LineFaultMode.NONE
        await until(lambda: is_good(line.quality(name)))
