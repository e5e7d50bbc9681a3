"""The gate: who may, what is possible, what happened. Every machine here is fake; test_gate_e800.py has the virtual drive."""

import asyncio
from dataclasses import replace

import pytest

from app.access.roles import Person
from app.commands.gate import Question
from app.commands.lifecycle import ProgressState
from app.errors import BadAnswer, DeviceException, LinkError, NoAnswer, Overtaken, Refused
from app.plant.definitions import Scan
from app.tags.batch import Batch
from app.tags.quality import GOOD
from tests.commands.stand import ANA, EVA, IVO, VIT, Stand, demo_plant, person, settle

COMMANDS = ("forward", "reverse", "stop", "coast", "reset", "set_frequency")
FAULTS = tuple(range(4, 27))


async def refusal(stand: Stand, who: object, command: str, **asked: object) -> Refused:
    with pytest.raises(Refused) as refused:
        await stand.ask(who, command, **asked)  # type: ignore[arg-type]
    return refused.value


# the life of a command


async def test_a_start_is_accepted_by_its_echo_and_confirmed_by_what_is_read_afterwards() -> None:
    stand = Stand()
    progress = await stand.ask(ANA, "forward")
    assert (progress.state, progress.person, progress.telegrams) == (ProgressState.ACCEPTED, "Ana", (("command", 1.0),))
    assert stand.state() == "accepted"
    await stand.pass_time(0.1)
    done = stand.gate.progress("m1")
    assert done is not None
    assert (done.state, done.over) == (ProgressState.CONFIRMED, True)
    assert done.requested <= done.accepted < done.ended
    assert [(line.object, line.result, line.person) for line in stand.commands] == [("m1.forward", "confirmed", "ana")]


async def test_values_read_before_the_echo_confirm_nothing() -> None:
    stand = Stand()
    stand.set_drive(status=1, frequency=40.0)
    stand.scanning = False
    await stand.ask(ANA, "forward")
    await settle()
    stand.gate.tick()
    assert stand.state() == "accepted"  # the old values satisfy the feedback, but they are old
    stand.clock.advance(0.05)
    stand.publish("m1", Scan.FAST)
    stand.gate.tick()
    assert stand.state() == "confirmed"


async def test_a_start_that_the_drive_ignores_is_unconfirmed_after_its_time() -> None:
    stand = Stand()
    stand.drives["m1"].deaf = True
    progress = await stand.ask(ANA, "forward")
    limit = 5.0 * 0.5 / 50 + 5  # F114 * F112 / 50 + 5
    assert progress.limit == pytest.approx(limit)
    await stand.pass_time(limit - 0.1)
    assert stand.state() == "accepted"
    await stand.pass_time(0.2)
    assert stand.state() == "unconfirmed"
    assert stand.link.sent() == [("command", 1.0)]
    assert [(line.result, line.reason) for line in stand.commands] == [("unconfirmed", "why.not_confirmed")]


async def test_a_fault_that_appears_makes_it_failed_and_is_named() -> None:
    stand = Stand()
    stand.drives["m1"].deaf = True
    await stand.ask(ANA, "forward")
    stand.drive()["status"] = 9
    await stand.pass_time(0.2)
    last = stand.gate.progress("m1")
    assert last is not None
    assert (last.state, last.reason, last.params["label"]) == (
        ProgressState.FAILED,
        "why.fault_appeared",
        "alarm.overheat.label",
    )


@pytest.mark.parametrize("error", [NoAnswer("silence"), BadAnswer("noise")])
async def test_a_lost_telegram_is_unknown_is_read_again_and_never_sent_again(error: LinkError) -> None:
    stand = Stand()
    stand.link.spoil = lambda *telegram: error
    progress = await stand.ask(ANA, "forward")
    assert progress.state is ProgressState.UNKNOWN
    assert progress.params["cause"] == f"link.error.{error.kind}"
    await settle()
    assert stand.link.refreshed
    await stand.pass_time(20)
    assert stand.state() == "unconfirmed"  # it was read, and it stands
    assert stand.link.sent() == [("command", 1.0)]


async def test_a_telegram_that_arrived_although_its_answer_was_lost_is_confirmed_by_the_change() -> None:
    stand = Stand()
    stand.link.spoil = lambda *telegram: NoAnswer("silence")
    stand.link.acts_although_spoiled = True
    await stand.ask(ANA, "forward")
    await stand.pass_time(0.2)
    assert stand.state() == "confirmed"


async def test_a_lost_telegram_stays_unknown_when_the_machine_already_was_as_asked() -> None:
    stand = Stand()
    stand.set_drive(status=1, frequency=40.0)
    stand.link.spoil = lambda *telegram: NoAnswer("silence")
    await stand.ask(ANA, "forward")
    await stand.pass_time(20)
    last = stand.gate.progress("m1")
    assert last is not None
    assert (last.state, last.over, last.reason) == (ProgressState.UNKNOWN, True, "why.unknown_as_asked")


async def test_a_cable_pulled_during_a_start_leaves_it_unknown_and_nothing_is_sent_on_return() -> None:
    stand = Stand()
    stand.link.spoil = lambda *telegram: NoAnswer("silence")
    stand.link.refresh_error = NoAnswer("silence")
    stand.bad = {"m1"}
    stand.scanning = False
    await stand.ask(ANA, "forward")
    stand.scanning = True
    await stand.pass_time(30)
    assert stand.state() == "unknown"
    stand.bad, stand.link.refresh_error = set(), None
    stand.link.spoil = lambda *telegram: None
    await stand.pass_time(30)
    assert stand.link.sent() == [("command", 1.0)]
    assert stand.drive()["status"] == 0


async def test_a_reset_that_the_drive_refuses_with_exception_04_failed() -> None:
    stand = Stand()
    stand.set_drive(status=9)
    stand.link.spoil = lambda *telegram: DeviceException(4)
    progress = await stand.ask(ANA, "reset")
    assert (progress.state, progress.reason, progress.params["code"]) == (ProgressState.FAILED, "why.device_refused", 4)
    stand.link.spoil = lambda *telegram: None
    assert (await refusal(stand, ANA, "reset")).reason == "why.too_soon"
    await stand.pass_time(5.1)
    await stand.ask(ANA, "reset")
    await stand.pass_time(0.2)
    assert stand.state() == "confirmed"


async def test_a_write_overtaken_by_a_stop_was_never_sent() -> None:
    stand = Stand()
    stand.link.spoil = lambda *telegram: Overtaken("stop came first")
    assert (await stand.ask(ANA, "forward")).state is ProgressState.SUPERSEDED


async def test_a_newer_command_supersedes_the_pending_one() -> None:
    stand = Stand()
    stand.drives["m1"].deaf = True
    await stand.ask(ANA, "forward")
    await stand.ask(ANA, "reverse")
    assert [(line.object, line.result) for line in stand.commands] == [("m1.forward", "superseded")]
    assert stand.gate.progress("m1").command == "reverse"  # type: ignore[union-attr]


async def test_one_command_at_a_time_is_written() -> None:
    stand = Stand()
    stand.link.door.clear()
    first = asyncio.create_task(stand.ask(ANA, "forward"))
    await settle()
    assert (await refusal(stand, ANA, "reverse")).reason == "why.busy"
    stand.link.door.set()
    assert (await first).state is ProgressState.ACCEPTED


# who may


@pytest.mark.parametrize("status", [0, 1, 2, *FAULTS])
async def test_every_command_in_every_state_for_every_person(status: int) -> None:
    """The sweep: what must never be written is not, whoever asks; what is refused names a reason that why_not named before."""
    roles = {"viewer": VIT, "operator": ANA, "engineer": person("eng", "engineer"), "admin": person("adm", "admin")}
    for role, who in roles.items():
        for command in COMMANDS:
            stand = Stand()
            stand.set_drive(status=status, frequency=30.0 if status in (1, 2) else 0.0)
            if role in ("operator", "engineer"):
                stand.gate.control.take(who, "m1")
            why = [reason.key for reason in stand.gate.why_not(who, "m1", command)]
            argument = 41.0 if command == "set_frequency" else None
            try:
                await stand.gate.ask(
                    who, "m1", command, argument=argument, nonce=stand.gate.nonces.issue(who.session), confirmed=True
                )
                outcome = "sent"
            except Refused as refused:
                outcome = refused.reason
            if role in ("viewer", "admin"):
                assert outcome == "why.role", (role, command)
            elif role == "engineer" and command != "stop":
                assert outcome == "sent" or outcome in why
            moves = command in ("forward", "reverse")
            allowed = role in ("operator", "engineer") and not (moves and status >= 4)
            assert (outcome == "sent") is allowed, (role, command, status, outcome)
            assert bool(stand.link.writes) is allowed
            assert (not why) is allowed
            assert len(stand.commands) == (0 if allowed else 1)


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


# late, twice, too often


async def test_a_double_click_acts_once_and_leaves_one_line() -> None:
    stand = Stand()
    nonce = stand.gate.nonces.issue(ANA.session)
    results = await asyncio.gather(
        stand.ask(ANA, "forward", id="click", nonce=nonce), stand.ask(ANA, "forward", id="click", nonce=nonce)
    )
    assert {result.state for result in results} == {ProgressState.ACCEPTED}
    await stand.pass_time(0.2)
    assert (await stand.ask(ANA, "forward", id="click", nonce=nonce)).state is ProgressState.ACCEPTED
    assert stand.link.sent() == [("command", 1.0)]
    assert len(stand.commands) == 1


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


# what is possible


async def test_why_not_names_every_reason_and_the_first_missing_one_first() -> None:
    stand = Stand()
    stand.set_drive(status=9, f203=3)
    reasons = stand.gate.why_not(VIT, "m1", "forward")
    assert [reason.key for reason in reasons[:2]] == ["why.role", "why.no_token"]
    assert [reason.label for reason in reasons[2:]] == [
        "permissive.no_fault",
        "permissive.frequency_source",
        "interlock.overheat",
    ]
    assert next(r.key for r in stand.gate.why_not(None, "m1", "forward")) == "why.signed_out"
    stand.gate.control.take(ANA, "m1")
    refused = await refusal(stand, ANA, "forward")
    assert refused.params["label"] == "permissive.no_fault"
    assert "interlock.overheat" in refused.params["missing"]  # type: ignore[operator]


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


async def test_a_live_link_sends_nothing_until_the_plant_file_says_so() -> None:
    stand = Stand(plant=demo_plant(transport="tcp", writes=False))
    for command in ("forward", "stop"):
        assert (await refusal(stand, ANA, command)).reason == "why.writes_off"
    assert stand.link.writes == []
    stand = Stand(plant=demo_plant(transport="tcp", writes=True))
    assert (await stand.ask(ANA, "forward")).state is ProgressState.ACCEPTED


async def test_a_dry_run_computes_shows_and_logs_and_confirms_nothing() -> None:
    stand = Stand(dry_run=True)
    for command in ("forward", "stop"):
        progress = await stand.ask(ANA, command)
        assert (progress.state, progress.reason) == (ProgressState.DRY_RUN, "why.dry_run")
        assert progress.telegrams
    stand.set_drive(status=1, frequency=40)
    await stand.pass_time(15)
    assert stand.link.writes == []
    assert [line.result for line in stand.commands] == ["dry_run", "dry_run"]


async def test_an_unknown_machine_or_command_is_refused_and_leaves_a_line() -> None:
    stand = Stand()
    for equipment, command in (("m9", "forward"), ("m1", "explode")):
        with pytest.raises(Refused) as refused:
            await stand.gate.ask(ANA, equipment, command)
        assert refused.value.status == 404
    assert (await refusal(stand, ANA, "jog_forward")).reason == "why.hold_only"
    assert [line.object for line in stand.commands] == ["m9.forward", "m1.explode", "m1.jog_forward"]


# confirmation


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


# values


async def test_a_setpoint_is_parsed_checked_written_and_read_back() -> None:
    stand = Stand()
    progress = await stand.ask(ANA, "set_frequency", argument="41,25", language="hr", expected=40.0)
    assert (progress.state, progress.argument, progress.old) == (ProgressState.ACCEPTED, 41.25, 40.0)
    await stand.pass_time(0.3)
    assert stand.state() == "confirmed"
    line = stand.commands[0]
    assert (line.old, line.new, line.result) == (40.0, 41.25, "confirmed")


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


async def test_a_parameter_asks_shows_its_warning_and_is_read_back() -> None:
    stand = Stand()
    with pytest.raises(Question) as question:
        await stand.set(EVA, "f905", "2,5", language="cs")
    assert question.value.params["warning"] == "warning.watchdog"
    await stand.set(EVA, "f905", 2.5, confirmed=True)
    await stand.pass_time(0.2)
    assert stand.state() == "confirmed"
    assert any("f905" in points for _, points in stand.link.refreshed)


async def test_a_parameter_that_the_device_changes_on_its_own_is_not_confirmed_and_says_what_it_holds() -> None:
    stand = Stand()
    stand.drives["m1"].deaf = True
    await stand.set(EVA, "f114", 8.0, confirmed=True)
    await stand.pass_time(6)
    last = stand.gate.progress("m1")
    assert last is not None
    assert (last.state, last.reason, last.params["value"]) == (ProgressState.UNCONFIRMED, "why.value_differs", 5.0)


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


# stop


async def test_stop_is_repeated_until_it_is_read_back() -> None:
    stand = Stand()
    stand.set_drive(status=1, frequency=40.0)
    stand.drives["m1"].deaf = True
    await stand.ask(ANA, "stop")
    await stand.pass_time(2)
    assert 4 <= len(stand.link.writes) <= 5
    assert all(urgent for *_, urgent in stand.link.writes)
    stand.drives["m1"].deaf = False
    await stand.pass_time(1)
    assert stand.state() == "confirmed"
    count = len(stand.link.writes)
    await stand.pass_time(5)
    assert len(stand.link.writes) == count
    assert stand.alarms == []


async def test_a_stop_that_is_not_read_back_in_ten_seconds_raises_the_alarm_and_ends() -> None:
    stand = Stand()
    stand.set_drive(status=1, frequency=40.0)
    stand.link.spoil = lambda *telegram: NoAnswer("silence")
    assert (await stand.ask(ANA, "stop")).state is ProgressState.REQUESTED
    await stand.pass_time(9.9)
    assert stand.alarms == []
    await stand.pass_time(0.2)
    assert (stand.state(), stand.alarms) == ("unconfirmed", ["m1"])
    count = len(stand.link.writes)
    assert 18 <= count <= 21
    await stand.pass_time(10)
    assert len(stand.link.writes) == count
    assert len(stand.commands) == 1


async def test_a_double_click_on_stop_is_one_stop() -> None:
    stand = Stand()
    stand.set_drive(status=1, frequency=40.0)
    await asyncio.gather(stand.ask(ANA, "stop", id="s"), stand.ask(ANA, "stop", id="s"))
    await stand.pass_time(0.2)
    assert stand.link.sent() == [("command", 3.0)]
    assert [line.result for line in stand.commands] == ["confirmed"]
    assert (await stand.ask(ANA, "stop", id="s")).state is ProgressState.ACCEPTED  # and it may always be asked again


async def test_pressing_stop_again_does_not_put_the_alarm_off() -> None:
    stand = Stand()
    stand.set_drive(status=1, frequency=40.0)
    stand.link.spoil = lambda *telegram: NoAnswer("silence")
    for _ in range(4):
        await stand.ask(ANA, "stop")
        await stand.pass_time(3, until=lambda: stand.alarms)
    assert stand.alarms == ["m1"]


async def test_a_long_ramp_has_its_own_time() -> None:
    stand = Stand()
    stand.set_drive(status=1, frequency=40.0, f115=60.0)
    stand.drives["m1"].deaf = True  # it ramps
    progress = await stand.ask(ANA, "stop")
    assert progress.limit == pytest.approx(60 * 40 / 50 + 3)
    await stand.pass_time(30)
    assert (stand.state(), stand.alarms) == ("accepted", [])
    assert len(stand.link.writes) <= 21
    stand.drive().update(status=0, frequency=0.0)
    await stand.pass_time(0.2)
    assert stand.state() == "confirmed"


async def test_stop_overtakes_a_start_on_the_wire_and_is_only_done_after_it() -> None:
    stand = Stand()
    stand.link.door.clear()
    start = asyncio.create_task(stand.ask(ANA, "forward"))
    await settle()
    await stand.ask(IVO, "stop")
    await stand.pass_time(1)
    assert stand.state() == "accepted"  # it stands, but the start may still come
    stand.link.door.set()
    await settle()
    assert stand.drive()["status"] == 1  # and it did
    await stand.pass_time(1)
    assert (stand.drive()["status"], stand.state()) == (0, "confirmed")
    assert (await start).state is ProgressState.SUPERSEDED


async def test_stop_breaks_off_a_command_of_several_telegrams() -> None:
    plant = demo_plant()
    kind = plant.types["eura_e800"]
    two = replace(
        kind.commands["forward"], writes=(*kind.commands["jog_forward"].writes[:1], *kind.commands["forward"].writes)
    )
    strict = replace(kind, commands={**kind.commands, "forward": two})
    items = {name: replace(item, type=strict) for name, item in plant.equipment.items()}
    stand = Stand(plant=replace(plant, equipment=items))
    stand.link.door.clear()
    start = asyncio.create_task(stand.ask(ANA, "forward"))
    await settle()
    await stand.ask(ANA, "stop")
    stand.link.door.set()
    await start
    await stand.pass_time(1)
    assert ("command", 1.0) not in stand.link.sent()
    assert stand.state() == "confirmed"


async def test_coasting_may_be_asked_again_at_once() -> None:
    stand = Stand()
    stand.set_drive(status=1, frequency=40.0)
    for _ in range(3):
        assert (await stand.ask(ANA, "coast")).state is ProgressState.ACCEPTED
        await stand.pass_time(0.2)


# what others see


async def test_conditions_come_with_how_they_stand_and_since_when() -> None:
    stand = Stand()
    await stand.pass_time(0.3)
    before = {condition.key: (met, since) for condition, met, since in stand.gate.permissives("m1")}
    assert before["no_fault"][0] is True
    await stand.pass_time(5)
    stand.drive()["status"] = 9
    await stand.pass_time(0.3)
    lines = {condition.key: (met, since) for condition, met, since in stand.gate.permissives("m1")}
    assert lines["no_fault"][0] is False
    assert lines["no_fault"][1] > before["no_fault"][1] + 4_000_000
    assert lines["start_source"] == before["start_source"]
    assert {c.key: met for c, met, _ in stand.gate.interlocks("m1")}["overheat"] is False


async def test_subscribers_hear_of_progress_and_reasons_at_most_ten_times_a_second() -> None:
    stand = Stand()
    await stand.pass_time(1)
    told: list[str] = []
    ends: list[str] = []
    end = stand.gate.subscribe(told.append)
    stand.gate.subscribe_ends(lambda progress: ends.append(progress.command))
    await stand.pass_time(3)
    assert told == []
    stand.set_drive(status=9)
    await stand.pass_time(0.5)
    assert told == ["m1"]
    told.clear()
    stand.set_drive(status=0)
    await stand.ask(ANA, "forward")
    await stand.pass_time(1)
    assert 1 <= len(told) <= 10
    assert ends == ["forward"]
    end()
    told.clear()
    await stand.ask(ANA, "stop")
    await stand.pass_time(1)
    assert told == []


async def test_a_reload_keeps_what_is_pending_and_ends_what_is_gone() -> None:
    stand = Stand()
    stand.drives["m1"].deaf = stand.drives["m2"].deaf = True
    await stand.ask(ANA, "forward", "m1")
    await stand.ask(ANA, "forward", "m2")
    left = replace(stand.plant, equipment={"m1": stand.plant.equipment["m1"]})
    stand.gate.configure(left)
    assert [(line.object, line.reason) for line in stand.commands] == [("m2.forward", "why.reloaded")]
    stand.drive().update(status=1, frequency=40.0)
    await stand.pass_time(0.2)
    assert stand.state() == "confirmed"
    assert stand.gate.control.holder("m2") is None


async def test_a_broken_audit_or_subscriber_does_not_keep_the_gate_from_working() -> None:
    stand = Stand()

    def breaks(*anything: object, **more: object) -> None:
        raise RuntimeError("full")

    stand.gate._state.audit_lines._audit = breaks
    stand.gate.subscribe(breaks)
    stand.gate.subscribe_ends(breaks)
    await stand.ask(ANA, "forward")
    await stand.pass_time(0.2)
    assert stand.state() == "confirmed"


async def test_a_start_over_a_table_of_bad_values_never_writes() -> None:
    """Any one value that a start uses, bad: nothing is written (the capture of the line proves it)."""
    stand = Stand()
    used = stand.gate._state.machines["m1"].commands["forward"].used
    assert {"status", "frequency", "f200", "f203", "frequency_setpoint", "f111", "f112", "f114"} <= set(used)
    for key in used:
        stand = Stand()
        stand.tags.publish(Batch("link.hall", 99, 1, 1, [stand.tags.handle(f"m1.{key}")], [None], GOOD | 2))
        assert (await refusal(stand, ANA, "forward")).reason == "why.bad_value"
        assert stand.link.writes == []


@pytest.mark.parametrize("machine", ["m1", "gone"])
async def test_refused_stops_of_a_second_are_one_line_with_their_number(machine: str) -> None:
    stand = Stand()
    nobody = person("vit", "viewer")

    async def stops(count: int) -> None:
        for _ in range(count):
            with pytest.raises(Refused):
                await stand.gate.ask(nobody, machine, "stop")

    await stops(300)
    assert len(stand.commands) <= 2, "one for each reason"
    await stand.pass_time(1.1)
    assert len(stand.commands) <= 4
    assert sum(line.params.get("reason_count", 1) for line in stand.commands) == 300
    await stops(1)
    await stand.pass_time(2.2)
    await stops(7)
    await stand.gate.close()
    assert sum(line.params.get("reason_count", 1) for line in stand.commands) == 308, "none is left out"
    assert len(stand.commands) <= 8


async def test_refusals_of_a_second_are_one_line_with_their_number() -> None:
    stand = Stand()
    stand.gate._admission.rate.take = lambda _person: True  # type: ignore[method-assign]

    async def refused(command: str, who: Person = ANA) -> None:
        with pytest.raises(Refused):
            await stand.gate.ask(who, "m1", command)

    for number in range(50):
        await refused(f"unknown{number}")
    await refused("forward")  # another reason: a line of its own
    await refused("unknown", IVO)  # another person, too
    told = [line.reason for line in stand.commands]
    assert told == [*["why.no_such_command"] * 6, "why.no_token", "why.no_such_command"]
    await stand.pass_time(1.1)
    assert len(stand.commands) == 9
    assert stand.commands[-1].params["reason_count"] == 44
    await stand.pass_time(3)
    assert len(stand.commands) == 9
    await refused("unknown")
    assert len(stand.commands) == 10


@pytest.mark.parametrize("pressed", [("a", "a"), ("a", "b", "a"), ("a", "a", "b", "c", "a"), ("a", "b", "b", "a")])
async def test_a_press_that_comes_again_has_one_line_although_it_was_refused(pressed: tuple[str, ...]) -> None:
    stand = Stand()
    for id in pressed:
        with pytest.raises(Refused):
            await stand.gate.ask(ANA, "m1", "nothing", id=id)
    await stand.pass_time(1.1)
    told = [line.params["id"] for line in stand.commands]
    assert len(told) == len(set(told)) and told[0] == "a"


async def test_the_rest_of_a_burst_is_written_when_the_plant_stops() -> None:
    stand = Stand()
    for _ in range(3):
        with pytest.raises(Refused):
            await stand.gate.ask(ANA, "m1", "nothing")
    await stand.gate.close()
    assert [line.params.get("reason_count") for line in stand.commands] == [None, 2]


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
