"""What was sent is followed until the machine shows it."""

import pytest

from app.commands.lifecycle import ProgressState
from app.errors import NoAnswer
from app.plant.definitions import Scan
from tests.commands.stand import ANA, EVA, Stand, settle


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


async def test_a_parameter_that_the_device_changes_on_its_own_is_not_confirmed_and_says_what_it_holds() -> None:
    stand = Stand()
    stand.drives["m1"].deaf = True
    await stand.set(EVA, "f114", 8.0, confirmed=True)
    await stand.pass_time(6)
    last = stand.gate.progress("m1")
    assert last is not None
    assert (last.state, last.reason, last.params["value"]) == (ProgressState.UNCONFIRMED, "why.value_differs", 5.0)


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
