"""What is checked before a value or a command goes: quality, limits, standstill, what others changed."""

import pytest

from app.commands.gate import Question
from app.commands.lifecycle import ProgressState
from app.errors import Refused
from tests.commands.stand import ANA, EVA, Stand, person, refusal


async def test_bad_values_and_old_values_refuse_every_command_but_stop() -> None:
    for trouble in ("bad", "old"):
        stand = Stand()
        if trouble == "bad":
            stand.bad = {"m1"}
            await stand.pass_time(0.1)
        else:
            stand.scanning = False
            await stand.pass_time(2.1)
        for command in ("forward", "reverse", "reset", "set_frequency"):
            refused = await refusal(stand, ANA, command, argument=41.0 if command == "set_frequency" else None)
            assert refused.reason == ("why.no_communication" if trouble == "bad" else "why.old_value"), command
            assert refused.status == (503 if trouble == "bad" else 409)
        if trouble == "bad":
            keys = [reason.key for reason in stand.gate.why_not(ANA, "m1", "forward")]
            assert keys.count("why.no_communication") == 1 and "why.bad_value" not in keys, (
                "said once, not of each value"
            )
        assert stand.link.writes == []
        await stand.ask(ANA, "stop")
        assert stand.link.sent() == [("command", 3.0)]


async def test_a_value_whose_origin_is_simulated_or_forced_does_not_hinder() -> None:
    stand = Stand()
    assert [reason.key for reason in stand.gate.why_not(person("x"), "m1", "forward")] == ["why.no_token"]


@pytest.mark.parametrize(
    ("argument", "reason", "status"),
    [
        ("50,01", "why.out_of_limits", 422),
        ("0,4", "why.out_of_limits", 422),
        ("-5", "why.out_of_limits", 422),
        (float("nan"), "why.out_of_limits", 422),
        (float("inf"), "why.out_of_limits", 422),
        ("nan", "why.not_a_number", 422),
        ("1.234", "why.ambiguous", 422),
        ("40,005", "why.decimals", 422),
        ("", "why.argument_missing", 422),
        (None, "why.argument_missing", 422),
    ],
)
async def test_a_value_that_cannot_be_is_refused_with_what_was_expected(
    argument: object, reason: str, status: int
) -> None:
    stand = Stand()
    refused = await refusal(stand, ANA, "set_frequency", argument=argument, language="hr")
    assert (refused.reason, refused.status) == (reason, status)
    if reason == "why.out_of_limits":
        assert (refused.params["min"], refused.params["max"], refused.params["unit"]) == (0.5, 50.0, "Hz")
    assert stand.link.writes == []


async def test_the_limits_are_those_of_the_drive_now() -> None:
    stand = Stand()
    stand.set_drive(f111=45.0)
    assert (await refusal(stand, ANA, "set_frequency", argument=46.0)).params["max"] == 45.0
    assert (await stand.ask(ANA, "set_frequency", argument=45.0)).state is ProgressState.ACCEPTED


async def test_a_setpoint_changed_meanwhile_is_not_overwritten() -> None:
    stand = Stand()
    stand.set_drive(frequency_setpoint=35.0)
    refused = await refusal(stand, ANA, "set_frequency", argument=36.0, expected=40.0)
    assert (refused.reason, refused.status, refused.params["current"]) == ("why.changed", 409, 35.0)


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        (40.0, 44.0, ()),
        (40.0, 46.0, ("ask.outside_normal",)),
        (30.0, 40.0, ("ask.jump",)),
        (40.0, 20.0, ("ask.outside_normal", "ask.jump")),
    ],
)
async def test_a_big_jump_or_an_unusual_value_asks(old: float, new: float, why: tuple[str, ...]) -> None:
    stand = Stand()
    stand.set_drive(frequency_setpoint=old)
    if why:
        with pytest.raises(Question) as question:
            await stand.ask(ANA, "set_frequency", argument=new)
        asked = question.value.params
        assert (asked["why"], asked["old"], asked["new"], asked["difference"]) == (why, old, new, new - old)
    assert (await stand.ask(ANA, "set_frequency", argument=new, confirmed=True)).state is ProgressState.ACCEPTED


async def test_some_parameters_only_at_standstill_and_only_one_of_the_choices() -> None:
    stand = Stand()
    with pytest.raises(Refused) as refused:
        await stand.set(EVA, "f203", 7, confirmed=True)
    assert refused.value.reason == "why.no_option"
    stand.set_drive(status=1, frequency=40.0)
    with pytest.raises(Refused) as refused:
        await stand.set(EVA, "f203", 10, confirmed=True)
    assert (refused.value.reason, refused.value.params["label"]) == ("why.condition", "why.machine_stopped")
    assert stand.link.writes == []


async def test_a_parameter_is_read_before_it_is_compared() -> None:
    stand = Stand()
    await stand.pass_time(5)
    stand.drive()["f114"] = 7.0  # turned at the keypad
    with pytest.raises(Refused) as refused:
        await stand.set(EVA, "f114", 8.0, expected=5.0, confirmed=True)
    assert (refused.value.reason, refused.value.params["current"]) == ("why.changed", 7.0)
