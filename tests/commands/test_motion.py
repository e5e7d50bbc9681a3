"""A motion that is held ends whatever happens."""

import asyncio

import pytest

from app.errors import NoAnswer, Refused
from app.plant.definitions import Scan
from tests.commands.hold_rig import Pressed, moving
from tests.commands.stand import ANA, SETTINGS, FakeLink, Stand, settle


async def test_a_stalled_loop_stops_what_is_held() -> None:
    stand = Stand()
    pressed = await Pressed(stand).arm()
    await pressed.hold(0.6)
    stand.clock.advance(0.35)  # nobody looked for so long
    with pytest.raises(Refused) as refused:
        stand.gate.hold.keep_alive(pressed.lease, 50, ANA.session)
    assert refused.value.params["cause"] == "stall"
    await stand.pass_time(0.1)
    assert not moving(stand)


@pytest.mark.parametrize(
    ("trouble", "cause"),
    [
        ({"status": 9, "frequency": 0.0}, "permissive"),
        ({"f905": 0.0}, "permissive"),
        ({"frequency": 20.0}, "permissive"),
    ],
)
async def test_a_condition_that_is_lost_stops_it(trouble: dict[str, float], cause: str) -> None:
    stand = Stand()
    pressed = await Pressed(stand).arm()
    await pressed.hold(0.6)
    stand.set_drive(**trouble)
    await stand.pass_time(0.1)
    assert stand.link.sent()[-1] == ("command", 3.0)
    await stand.pass_time(3)
    assert stand.commands[0].reason == f"hold.cause.{cause}"


async def test_values_that_stop_coming_stop_it() -> None:
    stand = Stand()
    pressed = await Pressed(stand).arm()
    await pressed.hold(0.6)
    stand.bad = {"m1"}
    with pytest.raises(Refused):
        await pressed.hold(1)
    assert ("command", 3.0) in stand.link.sent()


async def test_a_silent_device_is_stopped_for_ten_seconds_and_then_there_is_an_alarm() -> None:
    stand = Stand()
    pressed = await Pressed(stand).arm()
    await pressed.hold(0.6)
    stand.link.spoil = lambda *telegram: NoAnswer("silence")
    stand.bad = {"m1"}
    pressed.release()
    await stand.pass_time(9.8)
    assert stand.alarms == []
    await stand.pass_time(0.4)
    assert stand.alarms == ["m1"]
    assert stand.state() == "unconfirmed"
    assert ("frequency_setpoint", 40.0) not in stand.link.sent()  # never faster while nobody knows whether it stands


async def test_a_start_telegram_that_comes_home_after_the_release_is_stopped_again() -> None:
    stand = Stand()
    pressed = await Pressed(stand).arm()
    stand.link.door.clear()
    stand.gate.hold.keep_alive(pressed.lease, 1, ANA.session)
    await stand.pass_time(0.1)
    pressed.release()
    await stand.pass_time(5)
    stand.drive().update(status=1, frequency=5.0)  # what was on the wire arrived late
    stand.link.door.set()
    await stand.pass_time(4)
    assert not moving(stand)
    assert ("command", 1.0) not in stand.link.sent()


async def test_a_telegram_that_fails_ends_it_and_a_drive_that_does_not_move_too() -> None:
    stand = Stand()
    stand.link.spoil = lambda equipment, point, value: NoAnswer("silence") if value == 1 else None
    pressed = await Pressed(stand).arm()
    with pytest.raises(Refused):
        await pressed.hold(0.6)
    await stand.pass_time(3)
    assert (stand.commands[0].result, stand.commands[0].reason) == ("failed", "hold.cause.write")
    stand = Stand()
    stand.drives["m1"].deaf = True
    pressed = await Pressed(stand).arm()
    with pytest.raises(Refused):
        await pressed.hold(8)
    await stand.pass_time(3)
    assert (stand.commands[0].result, stand.commands[0].reason) == ("unconfirmed", "hold.cause.unconfirmed")
    assert stand.drive()["frequency_setpoint"] == SETTINGS["frequency_setpoint"]


async def test_a_former_value_that_cannot_be_restored_is_told() -> None:
    stand = Stand()
    pressed = await Pressed(stand).arm()
    await pressed.hold(0.6)
    stand.link.spoil = lambda equipment, point, value: NoAnswer("silence") if value == 40.0 else None
    pressed.release()
    await stand.pass_time(4)
    assert [(line.object, line.reason) for line in stand.commands] == [
        ("m1.jog_forward", "hold.cause.released"),
        ("m1.frequency_setpoint", "hold.not_restored"),
    ]
    assert [telegram for telegram in stand.link.sent() if telegram[1] == 40.0] == [("frequency_setpoint", 40.0)]
    assert ("lock", 3.0) not in stand.link.sent(), "what comes later would write the jog frequency into the EEPROM"
    assert stand.gate.left("m1") == {"frequency_setpoint": 40.0}
    assert stand.drive()["frequency_setpoint"] == 5.0


@pytest.mark.parametrize("silent_for", [0.0, 4.0])
async def test_what_was_left_changed_keeps_everything_from_starting_until_it_is_put_back(silent_for: float) -> None:
    stand = Stand()
    pressed = await Pressed(stand).arm()
    await pressed.hold(0.6)
    stand.link.spoil = lambda equipment, point, value: NoAnswer("silence") if value == 40.0 else None
    pressed.release()
    await stand.pass_time(4 + silent_for)
    for command, more in (("forward", {}), ("set_frequency", {"argument": 30}), ("jog_forward", {})):
        assert [why.key for why in stand.gate.why_not(ANA, "m1", command)][:1] == ["why.left_changed"], more
    assert not stand.gate.why_not(ANA, "m1", "stop") and not stand.gate.why_not(ANA, "m1", "coast")
    stand.link.spoil = lambda *telegram: None
    await stand.gate.ask(ANA, "m1", "put_back", nonce=stand.gate.nonces.issue(ANA.session))
    await stand.pass_time(2)
    assert (stand.commands[-1].object, stand.commands[-1].result) == ("m1.put_back", "confirmed")
    assert stand.drive()["frequency_setpoint"] == 40.0 and stand.link.sent()[-1] == ("lock", 3.0)
    assert stand.gate.left("m1") == {} and not stand.gate.why_not(ANA, "m1", "forward")


async def test_what_stays_changed_because_nobody_knows_whether_it_stands_is_put_back_later() -> None:
    stand = Stand()
    pressed = await Pressed(stand).arm()
    await pressed.hold(0.6)
    stand.link.spoil = lambda *telegram: NoAnswer("silence")
    stand.bad = {"m1"}
    pressed.release()
    await stand.pass_time(11)
    assert stand.alarms == ["m1"] and stand.gate.left("m1") == {"frequency_setpoint": 40.0}
    stand.bad = set()
    stand.link.spoil = lambda *telegram: None
    await stand.pass_time(1)
    why = [reason.key for reason in stand.gate.why_not(ANA, "m1", "put_back")]
    assert why == ["why.condition"], "it still turns: the former frequency would speed it up"
    stand.set_drive(status=0, frequency=0.0)
    await stand.pass_time(1)
    await stand.gate.ask(ANA, "m1", "put_back", nonce=stand.gate.nonces.issue(ANA.session))
    await stand.pass_time(2)
    assert stand.drive()["frequency_setpoint"] == 40.0 and stand.gate.left("m1") == {}


async def test_a_short_tap_stops_again_and_is_not_called_done() -> None:
    stand = Stand()
    stand.scanning = False
    pressed = await Pressed(stand).arm()
    stand.gate.hold.keep_alive(pressed.lease, 1, ANA.session)
    pressed.release()
    stand.scanning = True
    await stand.pass_time(4)
    assert not moving(stand)
    assert stand.commands[0].result == "unconfirmed"


class SlowEcho(FakeLink):
    """A telegram acts at once; the echo of the one that starts a motion waits for `home`."""

    def __init__(self, stand: Stand) -> None:
        super().__init__(stand)
        self.home = asyncio.Event()

    async def write(self, equipment: str, point: str, value: float, *, urgent: bool = False) -> None:
        await super().write(equipment, point, value, urgent=urgent)
        if (point, value) == ("command", 1.0):
            await self.home.wait()


class SlowStand(Stand):
    link_class = SlowEcho
    link: SlowEcho


@pytest.mark.parametrize("echoed", [True, False])
async def test_a_tap_that_was_seen_to_move_is_confirmed_though_it_was_let_go_before_the_next_look(echoed: bool) -> None:
    """The screen shows a value as soon as it is read: a person may let go between that and the next look at the command, or its echo."""
    stand = SlowStand()
    stand.scanning = False
    pressed = await Pressed(stand).arm()
    if echoed:
        stand.link.home.set()
    stand.gate.hold.keep_alive(pressed.lease, 1, ANA.session)
    await settle()
    assert moving(stand) and stand.state() == ("accepted" if echoed else "requested")
    stand.clock.advance(0.01)
    stand.publish("m1", Scan.FAST)
    stand.clock.advance(0.01)
    pressed.release()
    stand.link.home.set()
    stand.scanning = True
    await stand.pass_time(4)
    assert not moving(stand)
    assert (stand.commands[0].result, stand.commands[0].reason) == ("confirmed", "hold.cause.released")
