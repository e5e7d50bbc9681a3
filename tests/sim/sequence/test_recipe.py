"""Values of a run in the virtual PLC: taken and checked at Start, fixed until the next one, told with the run."""

from dataclasses import replace

import pytest

from app.plant.sequence_definition import RecipeValue, SequenceDefinition
from app.registers.plc_map import real
from app.sim.sequence.program import VirtualSequence
from app.sim.sequence.register_map import SequenceCommand, SequenceDeviceEvent, SequenceReason
from tests.sim.coil_car.line import Talker, bit, teaching
from tests.sim.sequence.stand import DONE, REJECTED, f32, number, run, step_row, word

HOLD = RecipeValue("hold", {}, 0.5, 20.0, 2.0, "s")
LEVEL = RecipeValue("level", {}, 0.0, 100.0, 50.0, "%")


def definition() -> SequenceDefinition:
    """Two steps: the first lasts as long as `hold` says, the second may begin when `level` is below 80."""
    base = teaching((2.0, 30.0), (1.0, 30.0))
    first, second = base.steps
    waits = replace(second, permissives=(bit(0, "low", "recipe.level < 80"),))
    free = replace(first, permissives=(), recipe={"minimum": "hold"})
    return replace(base, steps=(free, waits), abort=(), recipe=(HOLD, LEVEL))


def built() -> tuple[VirtualSequence, Talker]:
    plc = VirtualSequence(definition())
    plc.step()
    return plc, Talker(plc)


def start(talker: Talker, hold: float, level: float) -> tuple[object, int, int]:
    answer = talker.ask(SequenceCommand.START, real(hold), real(level))
    return answer.state, answer.reason, answer.detail


def shown(plc: VirtualSequence) -> list[float]:
    return [number(plc, at) for at in (47, 49)]


def test_before_the_first_run_the_defaults_stand_there() -> None:
    plc, _ = built()
    assert word(plc, 46) == 2 and shown(plc) == [2.0, 50.0]


def test_a_start_takes_its_values_and_the_run_keeps_to_them() -> None:
    plc, talker = built()
    assert start(talker, 4.0, 60.0)[0] == DONE
    assert shown(plc) == [4.0, 60.0] and f32(step_row(plc, 1), 8) == 4.0
    run(plc, 3.5)
    assert plc.block.step == 1
    assert start(talker, 1.0, 10.0)[:2] == (REJECTED, SequenceReason.WRONG_STATE) and shown(plc) == [4.0, 60.0]
    run(plc, 1.0)
    assert plc.block.step == 2


@pytest.mark.parametrize(
    ("hold", "level", "which"),
    [(0.4, 50.0, 1), (20.1, 50.0, 1), (float("nan"), 50.0, 1), (2.0, 100.5, 2), (2.0, float("inf"), 2)],
)
def test_a_value_outside_its_limits_starts_nothing_and_is_named(hold: float, level: float, which: int) -> None:
    plc, talker = built()
    assert start(talker, hold, level) == (REJECTED, SequenceReason.RECIPE, which)
    run(plc, 0.1)
    assert not plc.block.running and shown(plc) == [2.0, 50.0]


def test_a_condition_asks_for_the_value_of_this_run() -> None:
    plc, talker = built()
    start(talker, 1.0, 90.0)
    run(plc, 5.0)
    assert plc.block.step == 1 and plc.block.stalled


def test_the_values_are_told_behind_the_start() -> None:
    plc, talker = built()
    start(talker, 4.0, 60.0)
    run(plc, 0.1)
    told = [(event.code, event.value) for event in talker.events()]
    codes = [code for code, _ in told]
    assert codes.index(SequenceDeviceEvent.RECIPE_1) == codes.index(1) + 1
    assert {(24, 4.0), (25, 60.0)} <= set(told)


def test_they_outlive_a_restart_of_the_device() -> None:
    plc, talker = built()
    start(talker, 4.0, 60.0)
    plc.power_cycle()
    plc.step()
    assert shown(plc) == [4.0, 60.0] and f32(step_row(plc, 1), 8) == 4.0


def test_a_time_that_is_a_value_of_the_run_is_not_set_by_itself() -> None:
    plc, talker = built()
    answer = talker.ask(SequenceCommand.SET_TIMES, 1, real(7.0), real(30.0))
    assert (answer.state, answer.reason, answer.detail) == (REJECTED, SequenceReason.OF_RECIPE, 1)
    assert talker.ask(SequenceCommand.SET_TIMES, 1, real(2.0), real(25.0)).state == DONE
    assert f32(step_row(plc, 1), 8) == 2.0 and f32(step_row(plc, 1), 10) == 25.0
