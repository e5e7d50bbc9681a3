"""The simulated plant on a port: only when it is wanted, and only what is simulated."""

import logging
from types import SimpleNamespace
from typing import Any

import pytest

from app.errors import ConfigurationError
from app.running.modbus_door import ModbusDoor
from app.sim.bus import Bus

SIM: Any = SimpleNamespace(merged=lambda: Bus({}))


@pytest.mark.parametrize("sim", [None, SIM])
async def test_nobody_wants_it_nobody_opens_it(sim: Any) -> None:
    door = ModbusDoor("")
    await door.open(sim)
    assert door.address is None
    await door.close()


async def test_where_nothing_is_simulated_a_line_says_so(caplog: pytest.LogCaptureFixture) -> None:
    door = ModbusDoor("127.0.0.1:5020")
    with caplog.at_level(logging.WARNING):
        await door.open(None)
    assert door.address is None and "no link of the plant is simulated" in caplog.text
    door.follow(None)
    await door.close()


@pytest.mark.parametrize("wanted", ["5020", "127.0.0.1:70000", "127.0.0.1:x"])
async def test_an_address_that_is_none_is_named_with_its_setting(wanted: str) -> None:
    with pytest.raises(ConfigurationError, match=f"POGON_SERVE_MODBUS={wanted}: expected HOST:PORT"):
        await ModbusDoor(wanted).open(SIM)
