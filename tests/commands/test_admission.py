"""Who may command: role, token, freshness, nonce, rate and confirmation."""

from dataclasses import replace

import pytest

from app.commands.gate import Question
from app.commands.lifecycle import ProgressState
from app.errors import Refused
from tests.commands.stand import ANA, IVO, Stand, demo_plant, person, refusal


async def test_a_person_without_sign_in_or_after_idling_may_not_start_but_may_stop() -> None:
    stand = Stand()
    with pytest.raises(Refused) as refused:
        await stand.gate.ask(None, "m1", "stop")
    assert (refused.value.reason, refused.value.status) == ("why.signed_out", 401)
    idle = person("ana", idle=True)
    stand.gate.control.take(ANA, "m1")
    assert (await refusal(stand, idle, "forward")).reason == "why.idle"
    assert (await stand.ask(idle, "stop")).state is ProgressState.ACCEPTED


async def test_an_operator_may_not_write_parameters() -> None:
    stand = Stand()
    with pytest.raises(Refused) as refused:
        await stand.set(ANA, "f114", 8.0)
    assert (refused.value.reason, refused.value.params["role"]) == ("why.role", "engineer")
    await stand.set(person("eva", "operator", "engineer"), "f114", 8.0, equipment="m2", confirmed=True)
    assert stand.link.sent("m2") == [("f114", 8.0)]


async def test_two_operators_and_the_token() -> None:
    stand = Stand()
    await stand.ask(ANA, "forward")
    await stand.pass_time(1)
    assert (await refusal(stand, IVO, "reverse", confirmed=True)).status == 423
    stand.gate.control.request(IVO, "m1")
    await stand.pass_time(11)
    await stand.ask(IVO, "reverse", confirmed=True)
    assert (await refusal(stand, ANA, "forward", confirmed=True)).params["display"] == "Ivo"
    assert (await stand.ask(ANA, "stop")).state is ProgressState.ACCEPTED  # Stop needs no token
    await stand.pass_time(0.2)
    assert stand.drive()["status"] == 0
    assert [line.result for line in stand.lines if line.kind == "control"] == ["taken", "taken_over"]


async def test_without_the_token_nothing_but_stop() -> None:
    stand = Stand()
    with pytest.raises(Refused) as refused:
        await stand.gate.ask(ANA, "m1", "forward", nonce=stand.gate.nonces.issue(ANA.session))
    assert (refused.value.reason, refused.value.status) == ("why.no_token", 423)


async def test_a_captured_request_is_not_carried_out_again() -> None:
    stand = Stand()
    nonce = stand.gate.nonces.issue(ANA.session)
    await stand.ask(ANA, "forward", id="first", nonce=nonce)
    await stand.pass_time(0.2)
    assert (await refusal(stand, ANA, "forward", id="second", nonce=nonce)).status == 410
    assert (await refusal(stand, person("ana", session="thief"), "forward", id="first")).reason == "why.replayed"
    assert (await refusal(stand, ANA, "forward", id="third", nonce="")).status == 410
    assert len(stand.link.writes) == 1


async def test_a_command_six_seconds_late_is_refused_and_a_stop_is_not() -> None:
    stand = Stand()
    stand.gate.control.take(ANA, "m1")
    nonce = stand.gate.nonces.issue(ANA.session)
    for _ in range(6):
        await stand.pass_time(1)
        stand.gate.nonces.issue(ANA.session)
    late = await refusal(stand, ANA, "forward", nonce=nonce)
    assert (late.reason, late.status) == ("why.expired", 410)
    assert stand.link.writes == []
    assert (await stand.ask(ANA, "stop", nonce=nonce)).state is ProgressState.ACCEPTED


async def test_what_was_pressed_before_a_stop_is_not_carried_out_after_it() -> None:
    """The start was on its way for longer than the Stop: the motor stays where the Stop has brought it."""
    stand = Stand()
    stand.gate.control.take(ANA, "m1")
    nonce = stand.gate.nonces.issue(ANA.session)
    await stand.pass_time(0.2)
    assert (await stand.ask(IVO, "stop")).state is ProgressState.ACCEPTED
    await stand.pass_time(0.5)
    late = await refusal(stand, ANA, "forward", nonce=nonce)
    assert (late.reason, late.status) == ("why.stopped_since", 409)
    assert ("command", 1.0) not in stand.link.sent()
    assert (await stand.ask(ANA, "forward")).state is ProgressState.ACCEPTED  # a press after it is one


async def test_a_flood_is_cut_and_leaves_few_lines_while_stop_goes_through() -> None:
    stand = Stand()
    stand.gate.control.take(ANA, "m1")
    reasons = [(await refusal(stand, ANA, "reset", nonce="none")).reason for _ in range(300)]
    assert reasons.count("why.expired") == 10
    assert reasons.count("why.rate") == 290
    assert [line.reason for line in stand.commands] == ["why.expired", "why.rate"]
    await stand.pass_time(1.1)
    assert [line.params["reason_count"] for line in stand.commands[2:]] == [9, 289]
    assert (await stand.ask(ANA, "stop")).state is ProgressState.ACCEPTED


async def test_reverse_while_running_asks_before_it_acts_and_a_question_leaves_no_line() -> None:
    stand = Stand()
    stand.set_drive(status=1, frequency=40.0)
    assert stand.gate.level("m1", "reverse") == "C2"
    with pytest.raises(Question) as question:
        await stand.ask(ANA, "reverse", id="r")
    assert (question.value.reason, question.value.params["level"]) == ("why.confirm", "C2")
    assert question.value.params["label"] == "command.reverse"
    assert (stand.commands, stand.link.writes) == ([], [])
    assert (await stand.ask(ANA, "reverse", id="r", confirmed=True)).state is ProgressState.ACCEPTED
    stand = Stand()
    assert stand.gate.level("m1", "reverse") == "C1"


async def test_higher_levels_want_a_reason_and_the_password() -> None:
    plant = demo_plant()
    kind = plant.types["eura_e800"]
    strict = replace(kind, commands={**kind.commands, "reset": replace(kind.commands["reset"], level="C4")})
    items = {name: replace(item, type=strict) for name, item in plant.equipment.items()}
    stand = Stand(plant=replace(plant, equipment=items))
    told = []
    for given in ({}, {"confirmed": True}, {"confirmed": True, "reason": "test"}):
        with pytest.raises(Question) as question:
            await stand.ask(ANA, "reset", **given)
        told.append(question.value.reason)
    assert told == ["why.confirm", "why.reason_needed", "why.password_needed"]
    assert (await stand.ask(ANA, "reset", confirmed=True, reason="test", proven=True)).state is ProgressState.ACCEPTED
    await stand.pass_time(0.2)
    assert stand.commands[0].params["why"] == "test"


async def test_what_does_not_exist_counts_against_the_rate() -> None:
    stand = Stand()
    reasons = []
    for _ in range(30):
        with pytest.raises(Refused) as refused:
            await stand.gate.ask(ANA, "m1", "nothing")
        reasons.append(refused.value.reason)
    assert reasons.count("why.rate") == 20
    await stand.pass_time(1.1)
    assert len(stand.commands) == 4
