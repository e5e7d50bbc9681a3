"""What the connections of a link tell about each other."""

import asyncio
import logging
from itertools import cycle

import pytest

from app.links.statistics import LinkState
from app.plant.definitions import Device
from app.tags.quality import is_good
from tests.links.devices import Gateway, RegisterDevice, row, running, serving, tcp_link, until


async def test_a_gateway_that_refuses_in_the_place_of_a_unit_has_not_let_the_unit_be_heard(
    caplog: pytest.LogCaptureFixture,
) -> None:
    """It was said to answer on others, and connections that were well were opened again."""
    gateway = Gateway({unit: RegisterDevice({n: n for n in range(300)}) for unit in (1, 2)}, 11)
    answered = cycle((True, False, False))
    gateway.answered = lambda: next(answered)
    server = await serving(gateway)
    drive = Device(timeout=0.2, fast=0.05, connections=4)
    with caplog.at_level(logging.WARNING, "app.links.lane"):
        async with running([row("m1", 1, 300, drive), row("m2", 2, 300, drive)], link=tcp_link(server)) as line:
            await until(lambda: all(is_good(line.quality(f"m{unit}.v299")) for unit in (1, 2)))
            gateway.unreached = {1, 2}
            await asyncio.sleep(30)
            assert line.link.statistics.state is LinkState.DOWN
    assert not [record for record in caplog.records if record.name == "app.links.lane"]
    await server.close()
