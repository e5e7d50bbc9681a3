"""Modes: automatic latched, manual only while held, stop wins."""

from hypothesis import given
from hypothesis import strategies as st

from app.blocks.mode_control import Mode, ModeControl, ModeInputs

NOTHING = ModeInputs()
START = ModeInputs(start_automatic=True)
MANUAL = ModeInputs(select_manual=True)
STOP = ModeInputs(stop=True)
FORWARD, REVERSE = ModeInputs(forward=True), ModeInputs(reverse=True)
BOTH = ModeInputs(forward=True, reverse=True)


def after(*cycles: ModeInputs) -> tuple[Mode, bool, bool, bool]:
    control = ModeControl()
    control.step(NOTHING)
    for inputs in cycles:
        out = control.step(inputs)
    return out


def test_automatic_is_latched() -> None:
    assert after(START, NOTHING, NOTHING) == (Mode.AUTOMATIC, True, False, False)


def test_stop_wins_over_everything_and_ends_automatic() -> None:
    assert after(START, STOP) == (Mode.OFF, False, False, False)
    assert after(ModeInputs(start_automatic=True, stop=True)) == (Mode.OFF, False, False, False)
    assert after(START, STOP, NOTHING).automatic is False
    assert after(MANUAL, NOTHING, FORWARD, ModeInputs(forward=True, stop=True)) == (Mode.MANUAL, False, False, False)


def test_automatic_needs_a_new_request_after_stop() -> None:
    held = ModeInputs(start_automatic=True)
    assert after(held, ModeInputs(start_automatic=True, stop=True), held) == (Mode.OFF, False, False, False)
    assert after(held, STOP, NOTHING, held).automatic


def test_a_request_that_is_there_at_power_up_is_not_new() -> None:
    control = ModeControl()
    assert not control.step(START).automatic
    control = ModeControl()
    assert control.step(MANUAL).mode is Mode.OFF


def test_manual_runs_only_while_held() -> None:
    assert after(MANUAL, NOTHING, FORWARD) == (Mode.MANUAL, False, True, False)
    assert after(MANUAL, NOTHING, FORWARD, NOTHING) == (Mode.MANUAL, False, False, False)
    assert after(MANUAL, NOTHING, REVERSE) == (Mode.MANUAL, False, False, True)


def test_manual_moves_in_manual_only() -> None:
    assert after(NOTHING, FORWARD) == (Mode.OFF, False, False, False)
    assert after(START, NOTHING, FORWARD) == (Mode.AUTOMATIC, True, False, False)


def test_both_directions_are_none_and_letting_one_go_starts_nothing() -> None:
    assert after(MANUAL, NOTHING, BOTH) == (Mode.MANUAL, False, False, False)
    assert after(MANUAL, NOTHING, FORWARD, BOTH, FORWARD) == (Mode.MANUAL, False, False, False)
    assert after(MANUAL, NOTHING, FORWARD, BOTH, NOTHING, FORWARD).forward


def test_straight_change_of_direction_needs_a_release() -> None:
    assert after(MANUAL, NOTHING, FORWARD, REVERSE) == (Mode.MANUAL, False, False, False)
    assert after(MANUAL, NOTHING, FORWARD, NOTHING, REVERSE).reverse


def test_a_direction_held_since_automatic_starts_nothing() -> None:
    held = ModeInputs(forward=True, select_manual=True)
    assert after(START, FORWARD, held, FORWARD) == (Mode.MANUAL, False, False, False)
    assert after(START, FORWARD, held, NOTHING, FORWARD).forward


def test_a_direction_held_through_a_stop_starts_nothing() -> None:
    assert not after(MANUAL, NOTHING, FORWARD, ModeInputs(forward=True, stop=True), FORWARD, FORWARD).forward


def test_selecting_manual_ends_automatic() -> None:
    assert after(START, MANUAL) == (Mode.MANUAL, False, False, False)


def test_automatic_does_not_start_while_a_direction_is_held() -> None:
    control = ModeControl()
    for inputs in (NOTHING, MANUAL, NOTHING, FORWARD):
        control.step(inputs)
    out = control.step(ModeInputs(forward=True, start_automatic=True))
    assert out == (Mode.MANUAL, False, True, False)
    control.step(NOTHING)
    assert control.step(START).automatic


@given(st.lists(st.builds(ModeInputs, *[st.booleans()] * 5), max_size=60))
def test_nothing_moves_without_a_reason(cycles: list[ModeInputs]) -> None:
    control = ModeControl()
    before = control.step(NOTHING)
    last = NOTHING
    for inputs in cycles:
        out = control.step(inputs)
        assert out.forward + out.reverse + out.automatic <= 1
        assert not (inputs.stop and (out.forward or out.reverse or out.automatic))
        if out.forward or out.reverse:
            assert out.mode is Mode.MANUAL and inputs.forward != inputs.reverse
            assert (out.forward, out.reverse) == (inputs.forward, inputs.reverse)
            same = (before.forward, before.reverse) == (out.forward, out.reverse)
            assert same or not (last.forward or last.reverse)
        if out.automatic and not before.automatic:
            assert inputs.start_automatic and not last.start_automatic
        before, last = out, inputs
