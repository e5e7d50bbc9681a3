"""Hold-to-run by request bits: the device watches the counter itself, so that nothing that dies on the way keeps the machine moving."""

from itertools import pairwise

import pytest

from app.commands.lifecycle import ProgressState
from app.errors import DeviceException, LinkError, NoAnswer
from tests.commands.plc_stand import STOP, PlcStand
from tests.commands.stand import ANA

BEAT = 0.1
"""Between two keep-alives of a browser [s]."""


class Pressed:
    """A person at the button."""

    def __init__(self, stand: PlcStand) -> None:
        self.stand = stand
        self.lease = ""
        self.counter = 0

    async def arm(self) -> "Pressed":
        gate = self.stand.gate
        gate.control.take(ANA, "k1")
        self.lease = await gate.hold.arm(ANA, "k1", "jog", nonce=gate.nonces.issue(ANA.session))
        return self

    async def hold(self, seconds: float, beat: float = BEAT) -> None:
        for _ in range(max(1, round(seconds / beat))):
            self.counter += 1
            self.stand.gate.hold.keep_alive(self.lease, self.counter, ANA.session)
            await self.stand.pass_time(beat)

    def release(self) -> None:
        self.stand.gate.hold.release(self.lease, ANA.session)


def moving(stand: PlcStand) -> bool:
    return bool(stand.line.values["moving"])


def counters(stand: PlcStand) -> list[int]:
    return [counter for _, counter, _ in stand.plc.held]


async def test_the_machine_moves_while_keep_alives_go_through_and_stops_with_the_release() -> None:
    stand = PlcStand()
    pressed = await Pressed(stand).arm()
    assert stand.plc.held == []  # arming moves nothing
    await pressed.hold(2.0)
    assert moving(stand)
    assert stand.state("k1") == "confirmed"
    assert {bits for bits, _, _ in stand.plc.held} == {1}
    assert 10 <= len(stand.plc.held) <= 20
    pressed.release()
    await stand.pass_time(0.1)
    assert not moving(stand)
    await stand.pass_time(3)
    cleared = [(bits, urgent) for bits, _, urgent in stand.plc.held if not bits]
    assert 8 <= len(cleared) <= 12  # for 2 s
    assert set(cleared) == {(0, True)}
    assert (stand.link.writes, stand.plc.orders) == ([], [])
    (line,) = stand.commands
    assert (line.object, line.result, line.reason) == ("k1.jog", "confirmed", "hold.cause.released")


async def test_the_counter_changes_with_every_telegram() -> None:
    stand = PlcStand()
    for _ in range(2):
        pressed = await Pressed(stand).arm()
        await pressed.hold(0.6)
        pressed.release()
        await stand.pass_time(3)
    found = counters(stand)
    assert all(after == before % 0xFFFF + 1 for before, after in pairwise(found))


async def test_a_browser_in_a_hurry_does_not_flood_the_line() -> None:
    stand = PlcStand()
    pressed = await Pressed(stand).arm()
    for _ in range(20):
        for _ in range(10):
            pressed.counter += 1
            stand.gate.hold.keep_alive(pressed.lease, pressed.counter, ANA.session)
        await stand.pass_time(0.05)
    assert len(stand.plc.held) <= 11
    assert moving(stand)


async def test_a_server_that_dies_stops_the_machine_by_the_device_s_own_watchdog() -> None:
    stand = PlcStand()
    pressed = await Pressed(stand).arm()
    await pressed.hold(1.0)
    sent = len(stand.plc.held)
    for _ in range(5):  # nothing of the server runs any more
        stand.clock.advance(0.05)
        stand.line.watch(stand.clock.monotonic())
    assert moving(stand)
    stand.clock.advance(0.3)
    stand.line.watch(stand.clock.monotonic())
    assert not moving(stand)
    assert len(stand.plc.held) == sent


async def test_a_browser_that_dies_stops_the_machine() -> None:
    stand = PlcStand()
    pressed = await Pressed(stand).arm()
    await pressed.hold(1.0)
    await stand.pass_time(0.7)
    assert not moving(stand)
    await stand.pass_time(3)
    assert stand.commands[0].reason == "hold.cause.lost"


async def test_one_lost_telegram_does_not_stop_the_machine() -> None:
    stand = PlcStand()
    pressed = await Pressed(stand).arm()
    await pressed.hold(0.5)
    stand.plc.spoil_hold = lambda bits: NoAnswer("noise")
    await pressed.hold(0.2)
    stand.plc.spoil_hold = lambda bits: None
    await pressed.hold(1.0)
    assert moving(stand)
    assert stand.state("k1") == "confirmed"


@pytest.mark.parametrize("error", [NoAnswer("silence"), LinkError("not arrived"), DeviceException(4)])
async def test_a_line_on_which_nothing_goes_through_ends_the_hold(error: LinkError) -> None:
    stand = PlcStand()
    pressed = await Pressed(stand).arm()
    await pressed.hold(0.5)
    stand.plc.spoil_hold = lambda bits: error
    for _ in range(8):
        if stand.gate.hold.active("k1") is None:
            break
        await pressed.hold(BEAT)
    assert stand.gate.hold.active("k1") is None
    await stand.pass_time(1)
    assert not moving(stand)  # by its own watchdog
    assert stand.state("k1") == "confirmed"
    stand.plc.spoil_hold = lambda bits: None
    await stand.pass_time(5)
    assert (stand.commands[0].result, stand.commands[0].reason) == ("failed", "hold.cause.write")


async def test_a_first_telegram_without_answer_ends_the_hold_at_once() -> None:
    stand = PlcStand()
    stand.plc.spoil_hold = lambda bits: NoAnswer("lost") if bits else None
    stand.link.acts_although_spoiled = True
    pressed = await Pressed(stand).arm()
    await pressed.hold(BEAT)
    assert stand.gate.hold.active("k1") is None
    await stand.pass_time(0.2)
    assert not moving(stand)
    await stand.pass_time(3)
    assert stand.commands[0].result == "failed"


async def test_a_telegram_that_was_on_its_way_does_not_move_the_machine_after_the_release() -> None:
    stand = PlcStand()
    pressed = await Pressed(stand).arm()
    await pressed.hold(0.5)
    stand.link.door.clear()
    await pressed.hold(0.2)  # one waits on the wire
    pressed.release()
    await stand.pass_time(0.1)
    await stand.open_door()
    await stand.pass_time(0.15)
    assert not moving(stand)
    await stand.pass_time(3)
    assert stand.plc.held[-1][0] == 0
    assert stand.commands[0].result == "confirmed"


async def test_a_stop_over_a_hold_sends_the_code_and_clears_the_bits() -> None:
    stand = PlcStand()
    pressed = await Pressed(stand).arm()
    await pressed.hold(0.5)
    found = await stand.gate.ask(ANA, "k1", "stop")
    assert found.state is ProgressState.ACCEPTED
    assert stand.plc.orders == [(STOP, (), 0, True)]
    assert stand.plc.held[-1][0] == 0
    await stand.pass_time(1)
    assert not moving(stand)
    assert [(line.object, line.result) for line in stand.commands] == [
        ("k1.jog", "superseded"),
        ("k1.stop", "confirmed"),
    ]


async def test_bits_are_cleared_even_when_the_code_of_the_stop_is_lost() -> None:
    stand = PlcStand()
    pressed = await Pressed(stand).arm()
    await pressed.hold(0.5)
    stand.plc.reply = "none"
    await stand.gate.ask(ANA, "k1", "stop")
    assert stand.plc.held[-1][0] == 0
    await stand.pass_time(0.1)
    assert not moving(stand)


async def test_a_machine_that_does_not_stand_after_the_release_raises_the_alarm() -> None:
    stand = PlcStand()
    pressed = await Pressed(stand).arm()
    await pressed.hold(0.5)
    stand.line.request = lambda bits, counter, now: None  # type: ignore[method-assign]
    stand.line.watch = lambda now: None  # type: ignore[method-assign]
    pressed.release()
    await stand.pass_time(11)
    assert stand.alarms == ["k1"]
    assert stand.commands[0].reason == "why.stop_not_confirmed"
