"""A right that ends while something goes on: no armed lease starts, no motion goes on, no telegram that waits is sent. A Stop always is."""

import asyncio
from dataclasses import replace

import pytest

from app.access.roles import IDLE, Person, permissions_of
from app.commands.control_token import ANSWER
from app.commands.lifecycle import ProgressState
from app.errors import Refused
from tests.commands.plc_stand import PlcStand
from tests.commands.stand import ANA, IVO, Stand, settle
from tests.commands.test_hold import Pressed, moving

ENDS: dict[str, Person | None] = {
    "session over": None,
    "role taken": replace(ANA, roles=frozenset({"viewer"}), permissions=permissions_of({"viewer"})),
    "only an administrator now": replace(ANA, roles=frozenset({"admin"}), permissions=permissions_of({"admin"})),
    "idle": replace(ANA, permissions=ANA.permissions & IDLE, idle=True),
    "nothing at all": replace(ANA, permissions=frozenset()),
}


@pytest.fixture(params=ENDS, ids=lambda name: name.replace(" ", "-"))
def end(request: pytest.FixtureRequest) -> Person | None:
    """What is left of the person who asked."""
    return ENDS[request.param]


async def test_an_armed_lease_does_not_start(end: Person | None) -> None:
    stand = Stand()
    pressed = await Pressed(stand).arm()
    stand.people[ANA.session] = end
    with pytest.raises(Refused) as refused:
        stand.gate.hold.keep_alive(pressed.lease, 1, ANA.session)
    assert refused.value.status in (401, 403)
    await stand.pass_time(1)
    assert stand.link.writes == []
    (line,) = stand.commands
    assert line.result == "refused"


async def test_a_motion_ends_at_the_next_look_and_is_not_taken_up_again(end: Person | None) -> None:
    stand = Stand()
    pressed = await Pressed(stand).arm()
    await pressed.hold(0.6)
    assert moving(stand)
    stand.people[ANA.session] = end
    await stand.pass_time(0.05)
    assert not moving(stand)
    stand.people.clear()  # the right comes back: only a new press moves the machine
    with pytest.raises(Refused) as refused:
        stand.gate.hold.keep_alive(pressed.lease, 99, ANA.session)
    assert refused.value.status == 410
    await stand.pass_time(3)
    assert not moving(stand)
    assert stand.commands[0].reason == ("hold.cause.session" if end is None else "hold.cause.token")
    assert stand.drive()["frequency_setpoint"] == 40.0  # what the motion borrowed is given back


async def test_a_motion_ends_with_the_keep_alive_when_nobody_looked_yet(end: Person | None) -> None:
    stand = Stand()
    pressed = await Pressed(stand).arm()
    await pressed.hold(0.6)
    stand.people[ANA.session] = end
    with pytest.raises(Refused) as refused:
        stand.gate.hold.keep_alive(pressed.lease, 99, ANA.session)
    assert refused.value.status == 410
    await settle()
    assert not moving(stand)


async def test_told_of_the_change_the_motion_and_control_end_without_a_tick(end: Person | None) -> None:
    stand = Stand()
    pressed = await Pressed(stand).arm()
    await pressed.hold(0.6)
    stand.people[ANA.session] = end
    stand.gate.rights_changed()
    await settle()
    assert not moving(stand)
    assert stand.gate.control.holder("m1") is None
    with pytest.raises(Refused, match="lease_over") as refused:
        stand.gate.hold.keep_alive(pressed.lease, 99, ANA.session)
    assert refused.value.params["cause"] == ("session" if end is None else "token"), "who still holds the button"


async def test_a_telegram_that_waits_for_the_wire_is_not_sent(end: Person | None) -> None:
    stand = Stand()
    stand.link.door.clear()
    asked = asyncio.create_task(stand.set(ANA, "frequency_setpoint", 25.0, confirmed=True))
    await stand.pass_time(0.2)
    assert stand.link.sent() == [("frequency_setpoint", 25.0)]  # given to the link, which has not had its turn
    stand.people[ANA.session] = end
    stand.link.door.set()
    progress = await asked
    assert stand.drive()["frequency_setpoint"] == 40.0
    assert (progress.state, progress.reason) == (ProgressState.FAILED, "why.right_ended")
    assert stand.commands[-1].reason == "why.right_ended"


async def test_the_telegrams_after_the_first_are_not_sent(end: Person | None) -> None:
    stand = Stand()
    pressed = await Pressed(stand).arm()
    stand.link.spoil = lambda *telegram: stand.people.__setitem__(ANA.session, end)  # type: ignore[func-returns-value]
    stand.gate.hold.keep_alive(pressed.lease, 1, ANA.session)
    await stand.pass_time(0.3)
    sent = [telegram for telegram in stand.link.sent() if telegram != ("command", 3.0)]
    assert len(sent) == 1  # the borrowed frequency, not the start
    assert not moving(stand)


@pytest.mark.parametrize("command", ["start"])
async def test_a_code_that_waits_is_not_sent(command: str, end: Person | None) -> None:
    stand = PlcStand()
    stand.link.door.clear()
    asked = asyncio.create_task(stand.ask(ANA, command, "k1", confirmed=True))
    await stand.pass_time(0.2)
    stand.people[ANA.session] = end
    stand.link.door.set()
    progress = await asked
    assert (progress.state, progress.reason) == (ProgressState.FAILED, "why.right_ended")
    assert stand.drive("k1")["moving"] == 0


async def test_a_command_is_refused_when_the_right_ended_while_the_machine_was_read(end: Person | None) -> None:
    stand = Stand()
    stand.gate.control.take(ANA, "m1")
    nonce = stand.gate.nonces.issue(ANA.session)
    stand.people[ANA.session] = end
    with pytest.raises(Refused) as refused:
        await stand.gate.ask(ANA, "m1", "forward", nonce=nonce, confirmed=True)
    assert refused.value.status in (401, 403)
    assert stand.link.writes == []


async def test_a_stop_is_sent_whatever_became_of_the_right(end: Person | None) -> None:
    stand = Stand()
    stand.set_drive(status=1, frequency=40.0)
    stand.people[ANA.session] = end
    stand.link.door.clear()
    progress = await stand.gate.ask(ANA, "m1", "stop")
    assert progress.state is ProgressState.ACCEPTED
    assert stand.drive()["status"] == 0


async def test_control_is_free_and_nothing_is_handed_to_somebody_without_the_right(end: Person | None) -> None:
    stand = Stand()
    control = stand.gate.control
    control.take(ANA, "m1")
    stand.people[ANA.session] = end
    await stand.pass_time(0.05)
    assert control.holder("m1") is None
    control.take(IVO, "m1")
    stand.people.clear()
    control.request(ANA, "m1")
    stand.people[ANA.session] = end
    await stand.pass_time(ANSWER + 1)
    holder = control.holder("m1")
    assert holder is not None
    assert holder.session == IVO.session
    with pytest.raises(Refused):
        control.take(ANA, "m2")


@pytest.mark.sweep(8)
async def test_orders_that_were_armed_and_never_begun_are_forgotten() -> None:
    stand = Stand()
    for _ in range(5):
        await Pressed(stand).arm()
        await stand.pass_time(61, until=lambda: False)
    assert len(stand.gate._motion._admitted) <= 1
