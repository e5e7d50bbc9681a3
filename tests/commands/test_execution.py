"""An order is carried out once, however often its button was pressed, and an unknown one leaves a line."""

import asyncio

import pytest

from app.commands.lifecycle import ProgressState
from app.errors import Refused
from tests.commands.stand import ANA, Stand, refusal


async def test_a_double_click_on_stop_is_one_stop() -> None:
    stand = Stand()
    stand.set_drive(status=1, frequency=40.0)
    await asyncio.gather(stand.ask(ANA, "stop", id="s"), stand.ask(ANA, "stop", id="s"))
    await stand.pass_time(0.2)
    assert stand.link.sent() == [("command", 3.0)]
    assert [line.result for line in stand.commands] == ["confirmed"]
    assert (await stand.ask(ANA, "stop", id="s")).state is ProgressState.ACCEPTED  # and it may always be asked again


async def test_an_unknown_machine_or_command_is_refused_and_leaves_a_line() -> None:
    stand = Stand()
    for equipment, command in (("m9", "forward"), ("m1", "explode")):
        with pytest.raises(Refused) as refused:
            await stand.gate.ask(ANA, equipment, command)
        assert refused.value.status == 404
    assert (await refusal(stand, ANA, "jog_forward")).reason == "why.hold_only"
    assert [line.object for line in stand.commands] == ["m9.forward", "m1.explode", "m1.jog_forward"]
