"""The basic positioner: every task, its way and its end, and what it does not take."""

from math import copysign
from random import Random

import pytest

from app.profidrive import position_words as words
from app.profidrive.position_words import word_of
from app.sim.epos.positioner import ABOVE, BELOW, NOT_ADJUSTED, BasicPositioner, Block, Limits, Task, Wanted

DT = 0.01
GO = word_of(words.STW1, ["do_not_reject_task", "no_intermediate_stop"])
ACTIVATE = GO | word_of(words.STW1, ["activate_task"])
JOG_1, JOG_2 = (GO | word_of(words.STW1, [name]) for name in ("jog_1", "jog_2"))
RELATIVE, ABSOLUTE = word_of(words.POS_STW1, ["mdi"]), word_of(words.POS_STW1, ["mdi", "absolute"])
BOUNDED = word_of(words.POS_STW2, ["software_limits"])
LIMITS = Limits(200_000, 1_000_000, 500_000, 0, 800_000, (-50_000, 50_000), (1000, 2000))
BLOCKS = (Block(100_000, 200_000, 0.5), Block(700_000, 100_000, 0.0))


def wanted(stw1: int, pos: int = 0, target: float = 0.0, **given: float) -> Wanted:
    values = {
        "override": 1.0,
        "velocity": 100_000.0,
        "acceleration": 1.0,
        "deceleration": 1.0,
        "pos_stw2": BOUNDED,
    } | given
    return Wanted(stw1, pos, int(values.pop("pos_stw2")), target=target, **values)


def standing(position: float = 400_000.0) -> BasicPositioner:
    it = BasicPositioner(blocks=BLOCKS)
    it.follow(position, GO)
    return it


def run(it: BasicPositioner, what: Wanted, seconds: float, *, adjusted: bool = True, limits: Limits = LIMITS) -> None:
    """Steps, in each of which nothing is faster than it may be."""
    for _ in range(round(seconds / DT)):
        before = it.speed
        it.step(what, limits, adjusted, DT)
        assert abs(it.speed) <= limits.velocity + 1
        rise = abs(it.speed) - abs(before)
        ramps = rise <= limits.acceleration * DT + 1 and -rise <= limits.deceleration * DT + 1
        assert ramps or it.position == it.target


@pytest.mark.sweep(8)
@pytest.mark.parametrize("target", [0.0, 100_000.0, 399_999.0, 400_003.0, 800_000.0])
@pytest.mark.parametrize("velocity", [1_000.0, 90_000.0, 400_000.0])
def test_an_absolute_move_ends_at_its_target_without_passing_it(target: float, velocity: float) -> None:
    it = standing()
    it.step(wanted(ACTIVATE, ABSOLUTE, target, velocity=velocity), LIMITS, True, DT)
    assert it.acknowledged and it.task is Task.MDI
    way = target - 400_000
    for _ in range(round((abs(way) / min(velocity, 200_000) + 2) / DT)):
        it.step(wanted(ACTIVATE, ABSOLUTE, target, velocity=velocity), LIMITS, True, DT)
        assert (target - it.position) * copysign(1, way) >= -1e-6, "not beyond"
    assert it.arrived and it.position == target and it.limited is False


def test_a_relative_move_begins_where_the_axis_is_and_a_second_edge_begins_the_next() -> None:
    it = standing()
    for n in (1, 2):
        run(it, wanted(GO, RELATIVE, 30_000), 0.02)
        run(it, wanted(ACTIVATE, RELATIVE, 30_000), 2)
        assert it.position == 400_000 + n * 30_000


def test_a_target_that_changes_counts_with_the_next_edge_or_at_once_when_taken_continuously() -> None:
    it = standing()
    run(it, wanted(ACTIVATE, ABSOLUTE, 500_000), 0.1)
    run(it, wanted(ACTIVATE, ABSOLUTE, 300_000), 3)
    assert it.position == 500_000
    always = ABSOLUTE | word_of(words.POS_STW1, ["continuous_acceptance"])
    run(it, wanted(ACTIVATE, always, 300_000), 4)
    assert it.position == 300_000


@pytest.mark.parametrize(
    ("target", "adjusted", "alarm"), [(-1.0, True, BELOW), (800_001.0, True, ABOVE), (1.0, False, NOT_ADJUSTED)]
)
def test_what_leads_out_of_the_travel_or_needs_an_adjusted_axis_is_not_taken(
    target: float, adjusted: bool, alarm: int
) -> None:
    it = standing()
    run(it, wanted(ACTIVATE, ABSOLUTE, target), 1, adjusted=adjusted)
    assert (it.acknowledged, it.refused, it.position, it.task) == (False, alarm, 400_000, Task.NONE)


@pytest.mark.parametrize(("word", "way", "end"), [(JOG_1, -1, 0.0), (JOG_2, 1, 800_000.0)])
def test_a_jog_moves_while_it_is_held_and_ends_at_the_software_limit(word: int, way: int, end: float) -> None:
    it = standing()
    run(it, wanted(word), 1)
    assert it.task is Task.JOG and it.speed == way * 50_000
    run(it, wanted(GO), 1)
    assert it.task is Task.NONE and not it.speed
    run(it, wanted(word), 12)
    assert it.position == pytest.approx(end, abs=1) and not it.speed
    run(it, wanted(GO), 0.1)
    run(it, wanted(JOG_1 if word == JOG_2 else JOG_2), 0.5)
    assert it.speed == -way * 50_000, "back"


def test_while_mdi_is_selected_no_jog_is_taken_and_one_under_way_ends() -> None:
    it = standing()
    run(it, wanted(JOG_2, ABSOLUTE), 1)
    assert (it.task, it.position) == (Task.NONE, 400_000)
    run(it, wanted(JOG_2), 1)
    assert it.task is Task.NONE, "the button has to be pressed anew"
    run(it, wanted(GO), 0.1)
    run(it, wanted(JOG_2), 1)
    assert it.task is Task.JOG
    run(it, wanted(JOG_2, RELATIVE), 1)
    assert it.task is Task.NONE and not it.speed


def test_without_limits_a_jog_goes_on_and_both_at_once_stop() -> None:
    it = standing(799_000)
    run(it, wanted(JOG_2, pos_stw2=0), 2)
    assert it.position > 850_000
    run(it, wanted(JOG_1 | JOG_2, pos_stw2=0), 1)
    assert it.task is Task.NONE and not it.speed


def test_an_incremental_jog_ends_after_its_distance() -> None:
    it = standing()
    both = BOUNDED | word_of(words.POS_STW2, ["incremental_jog"])
    run(it, wanted(JOG_2, pos_stw2=both), 2)
    assert it.position == pytest.approx(402_000, abs=1)


def test_an_intermediate_stop_keeps_the_task_and_a_rejected_one_is_gone() -> None:
    it = standing()
    run(it, wanted(ACTIVATE, ABSOLUTE, 700_000), 1)
    hold = ACTIVATE & ~word_of(words.STW1, ["no_intermediate_stop"])
    run(it, wanted(hold, ABSOLUTE, 700_000), 1)
    assert it.task is Task.MDI and not it.speed and it.position < 600_000
    run(it, wanted(ACTIVATE, ABSOLUTE, 700_000), 5)
    assert it.position == 700_000
    run(it, wanted(GO, ABSOLUTE, 0), 0.1)
    run(it, wanted(ACTIVATE, ABSOLUTE, 0), 1)
    run(it, wanted(ACTIVATE & ~word_of(words.STW1, ["do_not_reject_task"]), ABSOLUTE, 0), 1)
    assert it.task is Task.NONE and not it.speed and it.position > 500_000


def test_traversing_blocks_follow_one_another_from_the_one_that_is_picked() -> None:
    it = standing()
    run(it, wanted(ACTIVATE, 1), 4.5)
    assert (it.task, it.block) == (Task.BLOCKS, 0) and it.speed < 0, "from 700 on to the first one again"
    run(it, wanted(ACTIVATE, 1), 5)
    assert it.block == 1 and it.speed > 0


def test_the_override_slows_down_and_stops() -> None:
    it = standing()
    run(it, wanted(ACTIVATE, ABSOLUTE, 800_000), 1)
    run(it, wanted(ACTIVATE, ABSOLUTE, 800_000, override=0.5), 1)
    assert it.speed == 50_000
    run(it, wanted(ACTIVATE, ABSOLUTE, 800_000, override=0.0), 1)
    assert not it.speed and it.task is Task.MDI


@pytest.mark.parametrize("seed", range(20))
def test_in_whatever_order_words_come_the_axis_stays_in_its_travel(seed: int) -> None:
    random, it = Random(f"epos {seed}"), standing()
    for _ in range(60):
        what = wanted(
            random.choice((GO, ACTIVATE, JOG_1, JOG_2, JOG_1 | JOG_2, 0, random.randrange(0x1000) | GO)),
            random.choice((0, 1, RELATIVE, ABSOLUTE, random.randrange(0x10000))),
            random.uniform(-900_000, 900_000),
            velocity=random.choice((0.0, 1_000.0, 150_000.0, 5e6)),
            override=random.choice((0.0, 0.3, 1.0)),
        )
        for _ in range(random.randrange(1, 120)):
            it.step(what, LIMITS, True, DT)
            assert -1 <= it.position <= 800_001, (what, it)


def test_without_operation_the_set_point_is_where_the_axis_is() -> None:
    it = standing()
    run(it, wanted(ACTIVATE, ABSOLUTE, 700_000), 1)
    it.follow(123.0, GO)
    assert (it.position, it.speed, it.task, it.acknowledged) == (123.0, 0.0, Task.NONE, False)
