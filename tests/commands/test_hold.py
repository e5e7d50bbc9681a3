"""Hold-to-run: what moves a machine while a button is held, and everything that ends it."""

import pytest

from app.commands.hold import TTL
from app.commands.lifecycle import ProgressState
from app.errors import Refused
from tests.commands.hold_rig import Pressed, moving
from tests.commands.stand import ANA, IVO, Stand, demo_plant


async def refusal(pressed: Pressed, **asked: object) -> Refused:
    with pytest.raises(Refused) as refused:
        await pressed.arm(**asked)
    return refused.value


async def test_the_machine_moves_while_the_button_is_held_and_gets_its_frequency_back() -> None:
    stand = Stand()
    pressed = await Pressed(stand).arm()
    assert stand.link.writes == []  # arming moves nothing
    await pressed.hold(1.0)
    assert moving(stand)
    assert stand.drive()["frequency"] == 5.0
    assert stand.state() == "confirmed"
    pressed.release()
    await stand.pass_time(0.1)
    assert not moving(stand)
    assert stand.drive()["frequency_setpoint"] == 5.0  # not before the machine is known to stand
    await stand.pass_time(3)
    assert stand.drive()["frequency_setpoint"] == 40.0
    stops = [telegram for telegram in stand.link.sent() if telegram == ("command", 3.0)]
    assert 8 <= len(stops) <= 11  # for 2 s
    line, back = stand.commands
    assert (line.object, line.result, line.reason) == ("m1.jog_forward", "confirmed", "hold.cause.released")
    assert (back.object, back.result, back.new) == ("m1.put_back", "confirmed", "frequency_setpoint = 40")
    others = [telegram for telegram in stand.link.sent() if telegram[0] != "command"]
    assert others == [("lock", 4.0), ("frequency_setpoint", 5.0), ("frequency_setpoint", 40.0), ("lock", 3.0)]
    assert line.params["reason_seconds"] == pytest.approx(1.05)
    assert {"reason_armed", "reason_started", "reason_stopped", "reason_cause"} <= set(line.params)


async def test_silence_ends_the_motion_after_the_lease() -> None:
    stand = Stand()
    pressed = await Pressed(stand).arm()
    await pressed.hold(1.0)
    await stand.pass_time(TTL)
    assert not moving(stand)
    with pytest.raises(Refused) as refused:
        await pressed.hold(0.15)  # a late keep-alive moves nothing
    assert refused.value.status == 410
    await stand.pass_time(3)
    assert not moving(stand)
    assert stand.commands[0].reason == "hold.cause.lost"


async def test_a_keep_alive_that_comes_after_the_lease_but_before_the_tick_is_too_late() -> None:
    stand = Stand()
    pressed = await Pressed(stand).arm()
    await pressed.hold(0.6)
    for _ in range(6):
        stand.clock.advance(0.1)
        stand.gate.hold._ticked = stand.clock.monotonic()
    with pytest.raises(Refused):
        stand.gate.hold.keep_alive(pressed.lease, 99, ANA.session)
    await stand.pass_time(0.1)
    assert not moving(stand)


async def test_a_replayed_counter_does_not_keep_it_moving() -> None:
    stand = Stand()
    pressed = await Pressed(stand).arm()
    await pressed.hold(0.6)
    for _ in range(4):
        assert not stand.gate.hold.keep_alive(pressed.lease, pressed.counter, ANA.session)
        await stand.pass_time(0.15)
        if not moving(stand):
            break
    assert not moving(stand)


async def test_another_session_cannot_use_the_lease() -> None:
    stand = Stand()
    pressed = await Pressed(stand).arm()
    for work in (
        lambda: stand.gate.hold.keep_alive(pressed.lease, 1, IVO.session),
        lambda: stand.gate.hold.release(pressed.lease, IVO.session),
    ):
        with pytest.raises(Refused) as refused:
            work()
        assert refused.value.status == 403
    assert stand.link.writes == []


async def test_an_armed_lease_is_good_for_ten_seconds_and_one_press() -> None:
    stand = Stand()
    pressed = await Pressed(stand).arm()
    await stand.pass_time(10.2)
    with pytest.raises(Refused):
        stand.gate.hold.keep_alive(pressed.lease, 1, ANA.session)
    again = await Pressed(stand).arm()
    await again.hold(0.3)
    again.release()
    with pytest.raises(Refused) as refused:
        stand.gate.hold.keep_alive(again.lease, 99, ANA.session)
    assert refused.value.reason == "why.lease_over"
    await stand.pass_time(0.2)
    assert not moving(stand)


async def test_a_closed_tab_a_sign_out_and_a_shutdown_stop_it() -> None:
    for end in ("tab", "sign_out", "shutdown"):
        stand = Stand()
        pressed = await Pressed(stand).arm()
        await pressed.hold(0.6)
        if end == "tab":
            stand.gate.hold.release(pressed.lease, ANA.session, "closed")
        elif end == "sign_out":
            stand.gate.session_ended(ANA.session)
        else:
            await stand.gate.close()
        await stand.pass_time(0.1)
        assert not moving(stand), end
        assert len(stand.commands) == (1 if end == "shutdown" else 0)


@pytest.mark.parametrize("cause", ["released", "closed", "left", "hidden", "dialog", "offline", "longest", "both"])
async def test_why_a_page_let_go_is_what_the_trail_says(cause: str) -> None:
    """Also that somebody pressed something else meanwhile, or held for too long by the clock of the page."""
    stand = Stand()
    pressed = await Pressed(stand).arm()
    await pressed.hold(0.6)
    stand.gate.hold.release(pressed.lease, ANA.session, cause)
    await stand.pass_time(4)
    assert stand.commands[0].reason == f"hold.cause.{cause}"


async def test_nobody_holds_longer_than_thirty_seconds() -> None:
    stand = Stand()
    pressed = await Pressed(stand).arm()
    with pytest.raises(Refused):
        await pressed.hold(31)
    await stand.pass_time(0.1)
    assert not moving(stand)
    await stand.pass_time(3)
    assert stand.commands[0].reason == "hold.cause.longest"
    assert stand.commands[0].params["reason_seconds"] == pytest.approx(30, abs=0.3)


async def test_only_a_device_with_a_watchdog_of_its_own_may_be_held() -> None:
    for watchdog, allowed in ((0.0, False), (2.0, True), (2.1, False), (0.1, True)):
        stand = Stand()
        stand.set_drive(f905=watchdog)
        if allowed:
            await (await Pressed(stand).arm()).hold(0.3)
            assert moving(stand)
        else:
            refused = await refusal(Pressed(stand))
            assert refused.params["label"] == "missing.permissive.hold_watchdog"


async def test_the_watchdog_is_read_anew_before_arming() -> None:
    stand = Stand()
    await stand.pass_time(60)
    stand.drive()["f905"] = 0.0
    assert (await refusal(Pressed(stand))).params["label"] == "missing.permissive.hold_watchdog"


async def test_both_buttons_are_a_stop_and_the_other_direction_waits() -> None:
    stand = Stand()
    pressed = await Pressed(stand).arm()
    await pressed.hold(0.6)
    assert (await refusal(Pressed(stand, "jog_reverse"))).reason == "why.both_directions"
    await stand.pass_time(0.1)
    assert not moving(stand)
    assert (await refusal(Pressed(stand, "jog_reverse"))).reason == "why.hold_pause"
    await stand.pass_time(0.3)
    other = await Pressed(stand, "jog_reverse").arm()
    await other.hold(0.6)
    assert stand.drive()["status"] == 2
    other.release()
    await stand.pass_time(3)
    assert stand.drive()["frequency_setpoint"] == 40.0  # not the jog frequency that the second press found


async def test_stop_ends_a_hold_at_once_for_good() -> None:
    stand = Stand()
    pressed = await Pressed(stand).arm()
    await pressed.hold(0.6)
    await stand.gate.ask(IVO, "m1", "stop")
    with pytest.raises(Refused):
        await pressed.hold(0.15)
    await stand.pass_time(3)
    assert not moving(stand)
    assert stand.drive()["frequency_setpoint"] == 40.0
    assert [(line.object, line.result) for line in stand.commands] == [
        ("m1.jog_forward", "superseded"),
        ("m1.stop", "confirmed"),
        ("m1.put_back", "confirmed"),
    ]


async def test_an_armed_button_does_nothing_after_a_stop() -> None:
    stand = Stand()
    pressed = await Pressed(stand).arm()
    await stand.gate.ask(IVO, "m1", "stop")
    await stand.pass_time(0.5)
    with pytest.raises(Refused) as refused:
        await pressed.hold(0.15)
    assert refused.value.reason == "why.lease_over"
    await stand.pass_time(0.5)
    assert stand.link.sent() == [("command", 3.0)]


async def test_nothing_else_starts_while_it_is_held_or_ends() -> None:
    stand = Stand()
    pressed = await Pressed(stand).arm()
    await pressed.hold(0.6)
    for reason in ("why.hold_active", "why.hold_ending"):
        with pytest.raises(Refused) as refused:
            await stand.ask(ANA, "forward")
        assert refused.value.reason == reason
        pressed.release()
        await stand.pass_time(0.1)


async def test_a_dry_run_and_a_live_link_without_writes_arm_nothing() -> None:
    assert (await refusal(Pressed(Stand(dry_run=True)))).reason == "why.dry_run"
    stand = Stand(plant=demo_plant(transport="tcp", writes=False))
    assert (await refusal(Pressed(stand))).reason == "why.writes_off"


async def test_arming_needs_token_nonce_and_role_like_any_command() -> None:
    stand = Stand()
    assert (await refusal(Pressed(stand), nonce="")).status == 410
    with pytest.raises(Refused) as refused:
        await stand.gate.hold.arm(IVO, "m1", "jog_forward", nonce=stand.gate.nonces.issue(IVO.session))
    assert refused.value.status == 423
    with pytest.raises(Refused) as refused:
        await stand.gate.hold.arm(ANA, "m1", "forward", nonce=stand.gate.nonces.issue(ANA.session))
    assert refused.value.status == 404
    assert {line.result for line in stand.commands} == {ProgressState.REFUSED}
