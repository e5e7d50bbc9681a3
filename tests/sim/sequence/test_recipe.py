"""Values of a run in the virtual PLC: taken and checked at Start, fixed until the next one, told with the run."""

from dataclasses import replace

import pytest

from app.blocks.sequence import Chart, Loop
from app.plant.sequence_definition import RecipeValue, SequenceDefinition
from app.registers.plc_map import real
from app.sim.sequence.program import VirtualSequence
from app.sim.sequence.register_map import SequenceCommand, SequenceDeviceEvent, SequenceReason
from tests.sim.coil_car.line import Talker, bit, teaching
from tests.sim.sequence.stand import DONE, REJECTED, f32, number, run, step_row, word

HOLD = RecipeValue("hold", {}, 0.5, 20.0, 2.0, "s")
COUNT = RecipeValue("count", {}, 1.0, 9.0, 2.0, decimals=0)
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


def test_a_value_is_what_was_written_not_what_a_telegram_leaves_of_it() -> None:
    plc, talker = built()
    start(talker, 4.1, 60.3)
    assert plc.recipe.values == (4.1, 60.3), "a step that gives it on is not refused for its decimals"


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


def counting() -> tuple[VirtualSequence, Talker]:
    """Two steps of one second, passed as often as is given."""
    base = teaching((1.0, 30.0), (1.0, 30.0))
    steps = tuple(replace(step, permissives=()) for step in base.steps)
    chart = Chart(loops=(Loop(1, 2, 2, "count"),))
    plc = VirtualSequence(replace(base, steps=steps, abort=(), recipe=(COUNT,), chart=chart))
    plc.step()
    return plc, Talker(plc)


@pytest.mark.parametrize("count", [1, 4])
def test_a_loop_is_passed_as_often_as_the_start_says(count: int) -> None:
    plc, talker = counting()
    assert talker.ask(SequenceCommand.START, real(float(count))).state == DONE
    run(plc, 2.0 * count - 0.5)
    assert plc.block.running and word_of_pass(plc) == count - 1
    run(plc, 1.0)
    assert plc.state == 3 and [one.runs for one in plc.block.times] == [count, count]


def word_of_pass(plc: VirtualSequence) -> int:
    return step_row(plc, 2)[27]


def test_a_count_that_is_not_whole_starts_nothing() -> None:
    plc, talker = counting()
    answer = talker.ask(SequenceCommand.START, real(2.5))
    assert (answer.state, answer.reason, answer.detail) == (REJECTED, SequenceReason.RECIPE, 1)
    assert not plc.block.running and shown(plc)[0] == 2.0


def test_the_next_run_has_its_own_count_and_a_restart_keeps_the_last() -> None:
    plc, talker = counting()
    for count in (3, 1):
        talker.ask(SequenceCommand.START, real(float(count)))
        run(plc, 2.0 * count + 0.5)
        assert plc.state == 3 and plc.block.times[0].runs == (3 if count == 3 else 4)
    talker.ask(SequenceCommand.START, real(5.0))
    plc.power_cycle()
    plc.step()
    assert plc.block.settings.chart.loops[0].times == 5
