"""The outputs of an E800 set from here: only when the drive lets them be, and confirmed by what they show."""

import asyncio

import pytest

from app.commands.checks import RENEW_AFTER
from app.commands.gate import Question
from app.commands.lifecycle import ProgressState
from app.errors import Refused
from app.sim.eura_e800.registers import AO1, DO1, DO2, RELAY
from tests.commands.test_gate_e800 import Hall, hall  # noqa: F401  a fixture

F431 = 0x041F


async def test_an_analog_output_is_set_where_its_function_says_so_and_read_back(hall: Hall) -> None:  # noqa: F811
    with pytest.raises(Refused) as refused:
        await hall.ask("set_ao1", argument="40", language="en", confirmed=True)
    assert refused.value.params["label"] == "missing.permissive.ao1_from_host"
    assert AO1 not in [address for address, _ in hall.captured]
    await hall.link.raw_write(2, F431, [7])
    await asyncio.sleep(RENEW_AFTER + 0.1)
    for value, shown, raw in (("40", 40.0, 400), ("33.3", 33.3, 333), ("0", 0.0, 0), ("100", 100.0, 1000)):
        await hall.ask("set_ao1", argument=value, language="en", confirmed=True)
        await hall.ended(ProgressState.CONFIRMED)
        assert (hall.value("ao1"), hall.captured[-1]) == (shown, (AO1, raw))
    for wrong, reason in (("100.1", "why.out_of_limits"), ("-1", "why.out_of_limits"), ("33.33", "why.decimals")):
        with pytest.raises(Refused) as refused:
            await hall.ask("set_ao1", argument=wrong, language="en", confirmed=True)
        assert refused.value.reason == reason
    assert hall.captured[-1] == (AO1, 1000), "nothing else was written"


@pytest.mark.parametrize(("key", "address"), [("output_1", DO1), ("output_2", DO2), ("relay", RELAY)])
async def test_an_output_asks_first_and_is_confirmed_by_itself(hall: Hall, key: str, address: int) -> None:  # noqa: F811
    for way, word in (("on", 1), ("off", 0)):
        with pytest.raises(Question):
            await hall.ask(f"{key}_{way}")
        await hall.ask(f"{key}_{way}", confirmed=True)
        await hall.ended(ProgressState.CONFIRMED)
        assert (hall.value(key), hall.captured[-1]) == (word, (address, word))
    assert hall.lines[-1] == (f"m2.{key}_off", "confirmed")


async def test_an_output_that_shows_something_else_is_not_told_as_switched(hall: Hall) -> None:  # noqa: F811
    await hall.ask("forward")
    await hall.ended(ProgressState.CONFIRMED)
    await hall.ask("output_1_off", confirmed=True)  # it shows that the motor runs
    progress = await hall.ended(ProgressState.UNCONFIRMED)
    assert (progress.command, hall.value("output_1"), hall.value("status")) == ("output_1_off", 1, 1)
