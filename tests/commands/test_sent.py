"""A command is on the disk before its telegram leaves; a Stop waits for no disk."""

import asyncio

import pytest

from app.commands.lifecycle import ProgressState
from app.commands.sending import LINE_LIMIT
from app.errors import Refused
from tests.commands.plc_stand import PlcStand
from tests.commands.stand import ANA, Stand, settle
from tests.commands.test_hold import Pressed, moving


async def test_the_line_comes_before_the_telegram() -> None:
    stand = Stand()
    await stand.set(ANA, "frequency_setpoint", 41.0)
    assert stand.sent == [("m1.frequency_setpoint", 0)]
    assert stand.link.sent() == [("frequency_setpoint", 41.0)]


async def test_the_line_of_a_code_comes_before_it() -> None:
    stand = PlcStand()
    stand.disk.clear()
    asked = asyncio.create_task(stand.ask(ANA, "start", "k1", confirmed=True))
    await stand.pass_time(0.3)
    assert stand.link.orders == []  # type: ignore[attr-defined]
    stand.disk.set()
    await asked
    assert stand.sent == [("k1.start", 0)]
    assert len(stand.link.orders) == 1  # type: ignore[attr-defined]


async def test_while_the_disk_is_asked_the_machine_is_busy_and_a_stop_overtakes() -> None:
    stand = Stand()
    stand.disk.clear()
    asked = asyncio.create_task(stand.set(ANA, "frequency_setpoint", 41.0))
    await stand.pass_time(0.2)
    with pytest.raises(Refused) as refused:
        await stand.set(ANA, "frequency_setpoint", 42.0)
    assert refused.value.reason == "why.busy"
    stop = asyncio.create_task(stand.gate.ask(ANA, "m1", "stop"))
    await stand.pass_time(0.2)
    assert stand.link.sent()[0] == ("command", 3.0)  # its telegram has left, its line not yet
    stand.disk.set()
    assert (await stop).state in (ProgressState.ACCEPTED, ProgressState.CONFIRMED)
    assert (await asked).state is ProgressState.SUPERSEDED
    assert ("frequency_setpoint", 41.0) not in stand.link.sent()


async def test_a_stop_is_answered_although_the_disk_says_nothing() -> None:
    stand = Stand()
    stand.set_drive(status=1, frequency=40.0)
    stand.disk.clear()
    async with asyncio.timeout(LINE_LIMIT + 5):
        await stand.gate.ask(ANA, "m1", "stop")
    assert stand.drive()["status"] == 0
    stand.disk.set()
    await settle()
    assert stand.sent == [("m1.stop", 1)]


async def test_what_can_be_written_nowhere_is_not_sent_but_a_stop_is() -> None:
    stand = Stand()
    stand.room = False
    with pytest.raises(Refused) as refused:
        await stand.set(ANA, "frequency_setpoint", 41.0)
    assert (refused.value.reason, refused.value.status) == ("why.no_audit", 503)
    pressed = await Pressed(stand, "jog_forward").arm()
    stand.gate.hold.keep_alive(pressed.lease, 1, ANA.session)
    await stand.pass_time(0.3)
    assert not moving(stand)
    assert {telegram for telegram in stand.link.sent()} <= {("command", 3.0)}
    await stand.pass_time(12)
    stand.set_drive(status=1, frequency=40.0)
    await stand.gate.ask(ANA, "m1", "stop")
    assert stand.drive()["status"] == 0


async def test_nothing_is_told_of_what_is_refused_or_only_tried() -> None:
    stand = Stand(dry_run=True)
    await stand.set(ANA, "frequency_setpoint", 41.0)
    with pytest.raises(Refused):
        await stand.set(ANA, "frequency_setpoint", 4100.0)
    assert stand.sent == []
