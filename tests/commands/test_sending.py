"""What is sent, once, and what becomes of a telegram of which nobody knows."""

import asyncio
from dataclasses import replace

import pytest

from app.commands.checks import PULSE_PAUSE
from app.commands.lifecycle import ProgressState
from app.errors import BadAnswer, DeviceException, LinkError, NoAnswer, Overtaken
from app.plant.definitions import Scan
from tests.commands.stand import ANA, IVO, Stand, demo_plant, refusal, settle


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


async def test_who_repeats_a_reset_just_too_soon_is_not_asked_to_wait_for_nothing() -> None:
    stand = Stand()
    stand.set_drive(status=9)
    stand.link.spoil = lambda *telegram: DeviceException(4)
    await stand.ask(ANA, "reset")
    stand.clock.advance(PULSE_PAUSE - 0.01)
    stand.publish("m1", Scan.FAST, Scan.SLOW)
    last = await refusal(stand, ANA, "reset")
    assert (last.reason, last.params["seconds"]) == ("why.too_soon", 0.1)


async def test_a_reset_that_the_drive_refuses_with_exception_04_failed() -> None:
    stand = Stand()
    stand.set_drive(status=9)
    stand.link.spoil = lambda *telegram: DeviceException(4)
    progress = await stand.ask(ANA, "reset")
    assert (progress.state, progress.reason) == (ProgressState.FAILED, "why.device_rejected")
    assert (progress.params["code"], progress.params["label"]) == (4, "reason.cause_present"), (
        "in words, not as a number"
    )
    stand.link.spoil = lambda *telegram: None
    assert (await refusal(stand, ANA, "reset")).reason == "why.too_soon"
    await stand.pass_time(3)
    told: list[str] = []
    stand.gate.subscribe(told.append)
    await stand.pass_time(2.1)
    assert told, "who looks on is told that it may be repeated"
    await stand.ask(ANA, "reset")
    await stand.pass_time(0.2)
    assert stand.state() == "confirmed"


async def test_a_write_overtaken_by_a_stop_was_never_sent() -> None:
    stand = Stand()
    stand.link.spoil = lambda *telegram: Overtaken("stop came first")
    assert (await stand.ask(ANA, "forward")).state is ProgressState.SUPERSEDED


async def test_one_command_at_a_time_is_written() -> None:
    stand = Stand()
    stand.link.door.clear()
    first = asyncio.create_task(stand.ask(ANA, "forward"))
    await settle()
    assert (await refusal(stand, ANA, "reverse")).reason == "why.busy"
    stand.link.door.set()
    assert (await first).state is ProgressState.ACCEPTED


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
