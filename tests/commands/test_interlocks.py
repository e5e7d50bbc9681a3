"""Why not: every reason by name, with how it stands and since when."""

import pytest

from app.commands.interlocks import amounts, effect
from app.commands.lifecycle import ProgressState
from app.commands.orders import Question
from app.plant.definitions import Command, Effect
from app.tags.quality import GOOD, NO_DATA
from tests.commands.stand import ANA, VIT, Stand, refusal


async def test_why_not_names_every_reason_and_the_first_missing_one_first() -> None:
    stand = Stand()
    stand.set_drive(status=9, f203=3)
    reasons = stand.gate.why_not(VIT, "m1", "forward")
    assert [reason.key for reason in reasons[:2]] == ["why.role", "why.no_token"]
    assert [reason.label for reason in reasons[2:]] == [
        "missing.permissive.no_fault",
        "missing.permissive.frequency_source",
        "missing.interlock.overheat",
    ]
    assert next(r.key for r in stand.gate.why_not(None, "m1", "forward")) == "why.signed_out"
    stand.gate.control.take(ANA, "m1")
    refused = await refusal(stand, ANA, "forward")
    assert refused.params["label"] == "missing.permissive.no_fault"
    assert "missing.interlock.overheat" in refused.params["missing"]  # type: ignore[operator]


def look(**values: float) -> object:
    return lambda key: (values[key], GOOD) if key in values else (None, NO_DATA)


def test_numbers_of_a_sentence_are_rounded_as_people_say_them_and_unknown_ones_stay_unknown() -> None:
    values = {"time": "ramp * speed / 1500", "speed": "abs(speed)", "lost": "nothing"}
    found = amounts(values, look(ramp=5.0, speed=-1219.6))  # type: ignore[arg-type]
    assert found == {"time": -4.1, "speed": 1220.0, "lost": None}


def test_a_command_tells_the_first_effect_that_holds_and_whose_numbers_are_known() -> None:
    turns = Effect("turns", "running == 1", {"speed": "speed"})
    command = Command("go", "go", (), "", "5", effects=(turns, Effect("goes")))
    assert effect(command, look(running=1.0, speed=7.25)) == ("turns", {"speed": 7.2})  # type: ignore[arg-type]
    assert effect(command, look(running=1.0)) == ("goes", {})  # type: ignore[arg-type]
    assert effect(command, look(speed=7.0)) == ("goes", {})  # type: ignore[arg-type]
    assert effect(Command("go", "go", (), "", "5"), look()) == ("", {})  # type: ignore[arg-type]


async def test_a_reset_is_not_possible_before_the_heatsink_is_cool_and_says_so_with_its_temperature() -> None:
    stand = Stand()
    stand.gate.control.take(ANA, "m1")
    stand.set_drive(status=9, heatsink_temperature=85, bus_voltage=310)
    (found,) = stand.gate.why_not(ANA, "m1", "reset")
    assert (found.key, found.label, found.params["temperature"]) == ("why.condition", "missing.permissive.cooled", 85)
    stand.set_drive(heatsink_temperature=79)
    assert stand.gate.why_not(ANA, "m1", "reset") == []


async def test_a_value_that_changes_nothing_is_not_asked_about_and_the_former_one_is_remembered() -> None:
    stand = Stand()
    stand.gate.control.take(ANA, "m1")
    assert stand.gate.former("m1", "set_frequency") is None
    stand.set_drive(frequency_setpoint=10.0)  # outside the normal band
    progress = await stand.ask(ANA, "set_frequency", argument="10", language="en")
    assert progress.state is not ProgressState.REFUSED
    await stand.pass_time(0.3)
    assert stand.gate.former("m1", "set_frequency") is None, "it was not changed"
    with pytest.raises(Question) as question:
        await stand.ask(ANA, "set_frequency", argument="40", language="en")
    assert (question.value.params["low"], question.value.params["high"]) == (0.5, 50.0), "what 20 % are of"
    await stand.ask(ANA, "set_frequency", argument="40", language="en", confirmed=True)
    await stand.pass_time(0.3)
    assert stand.state() == "confirmed"
    assert stand.gate.former("m1", "set_frequency") == 10.0
