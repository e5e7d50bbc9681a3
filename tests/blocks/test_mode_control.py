"""Modes: automatic latched, manual only while held, stop wins."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.blocks.mode_control import Mode, ModeControl, ModeInputs

NOTHING = ModeInputs()
AUTO, START = ModeInputs(select_automatic=True), ModeInputs(start=True)
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


def test_a_mode_is_chosen_and_starts_nothing() -> None:
    assert after(AUTO, NOTHING, NOTHING) == (Mode.AUTOMATIC, False, False, False)
    assert after(MANUAL, AUTO, NOTHING) == (Mode.AUTOMATIC, False, False, False)


def test_automatic_is_latched_from_its_start_on() -> None:
    assert after(AUTO, START, NOTHING, NOTHING) == (Mode.AUTOMATIC, True, False, False)
    assert after(ModeInputs(select_automatic=True, start=True)) == (Mode.AUTOMATIC, True, False, False)
    assert after(AUTO, START, AUTO).automatic, "it is that mode already"


def test_a_start_counts_in_automatic_only() -> None:
    assert after(START, NOTHING) == (Mode.OFF, False, False, False)
    assert after(MANUAL, START, NOTHING) == (Mode.MANUAL, False, False, False)
    assert not after(START, AUTO, NOTHING).automatic, "an earlier request is over"


def test_stop_wins_over_everything_and_ends_automatic() -> None:
    assert after(AUTO, START, STOP) == (Mode.AUTOMATIC, False, False, False)
    assert after(AUTO, ModeInputs(start=True, stop=True)) == (Mode.AUTOMATIC, False, False, False)
    assert after(ModeInputs(select_automatic=True, select_manual=True, stop=True)) == (Mode.OFF, False, False, False)
    assert after(AUTO, START, STOP, NOTHING).automatic is False
    assert after(MANUAL, NOTHING, FORWARD, ModeInputs(forward=True, stop=True)) == (Mode.MANUAL, False, False, False)


def test_automatic_needs_a_new_request_after_stop() -> None:
    held = ModeInputs(start=True)
    assert after(AUTO, held, ModeInputs(start=True, stop=True), held) == (Mode.AUTOMATIC, False, False, False)
    assert after(AUTO, held, STOP, NOTHING, held).automatic


def test_a_request_that_is_there_at_power_up_is_not_new() -> None:
    control = ModeControl()
    control.step(ModeInputs(select_automatic=True, start=True))
    assert (control.mode, control.running) == (Mode.OFF, False)
    control = ModeControl()
    assert control.step(MANUAL).mode is Mode.OFF


def test_manual_runs_only_while_held() -> None:
    assert after(MANUAL, NOTHING, FORWARD) == (Mode.MANUAL, False, True, False)
    assert after(MANUAL, NOTHING, FORWARD, NOTHING) == (Mode.MANUAL, False, False, False)
    assert after(MANUAL, NOTHING, REVERSE) == (Mode.MANUAL, False, False, True)


def test_manual_moves_in_manual_only() -> None:
    assert after(NOTHING, FORWARD) == (Mode.OFF, False, False, False)
    assert after(AUTO, START, NOTHING, FORWARD) == (Mode.AUTOMATIC, True, False, False)


def test_both_directions_are_none_and_letting_one_go_starts_nothing() -> None:
    assert after(MANUAL, NOTHING, BOTH) == (Mode.MANUAL, False, False, False)
    assert after(MANUAL, NOTHING, FORWARD, BOTH, FORWARD) == (Mode.MANUAL, False, False, False)
    assert after(MANUAL, NOTHING, FORWARD, BOTH, NOTHING, FORWARD).forward


def test_straight_change_of_direction_needs_a_release() -> None:
    assert after(MANUAL, NOTHING, FORWARD, REVERSE) == (Mode.MANUAL, False, False, False)
    assert after(MANUAL, NOTHING, FORWARD, NOTHING, REVERSE).reverse


def test_a_direction_held_since_automatic_starts_nothing() -> None:
    held = ModeInputs(forward=True, select_manual=True)
    assert after(AUTO, START, FORWARD, held, FORWARD) == (Mode.MANUAL, False, False, False)
    assert after(AUTO, START, FORWARD, held, NOTHING, FORWARD).forward


def test_a_direction_held_through_a_stop_starts_nothing() -> None:
    assert not after(MANUAL, NOTHING, FORWARD, ModeInputs(forward=True, stop=True), FORWARD, FORWARD).forward


def test_selecting_manual_ends_automatic() -> None:
    assert after(AUTO, START, MANUAL) == (Mode.MANUAL, False, False, False)


def test_automatic_does_not_start_while_a_direction_is_held() -> None:
    control = ModeControl()
    for inputs in (NOTHING, MANUAL, NOTHING, FORWARD):
        control.step(inputs)
    out = control.step(ModeInputs(forward=True, select_automatic=True, start=True))
    assert out == (Mode.MANUAL, False, True, False)
    control.step(NOTHING)
    control.step(AUTO)
    assert not control.step(ModeInputs(forward=True, start=True)).automatic
    control.step(NOTHING)
    assert control.step(START).automatic


@pytest.mark.sweep(8)
@given(st.lists(st.builds(ModeInputs, *[st.booleans()] * 6), max_size=60))
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
            assert inputs.start and not last.start and out.mode is Mode.AUTOMATIC
        before, last = out, inputs
