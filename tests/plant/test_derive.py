"""Derived points: what they count, when they change, how good they are."""

import json
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.clock import to_micros
from app.errors import ConfigurationError
from app.plant.definitions import Plant
from app.plant.derive import Derivation
from app.plant.loader import read_plant
from app.tags.batch import Value
from app.tags.quality import COMM_FAILURE, GOOD, STALE, Origin, is_bad

DEMO = Path(__file__).parents[2] / "plants" / "demo"
START = to_micros(datetime(2026, 3, 9, 6, 5, tzinfo=UTC))
SECOND = 1_000_000
HOUR = 3600 * SECOND
SIM = int(Origin.SIMULATED)
_plant, _ = read_plant(DEMO)


@pytest.fixture
def plant() -> Plant:
    assert _plant is not None
    return _plant


def run(derivation: Derivation, time_us: int, quality: int = GOOD, **values: Value) -> Mapping[str, tuple[Value, int]]:
    changed = {f"m1.{key}": (value, quality) for key, value in values.items()}
    return {
        name.removeprefix("m1."): (value, q)
        for name, value, q in derivation.update(changed, time_us)
        if name.startswith("m1.")
    }


def test_speed_is_negative_in_reverse(plant: Plant) -> None:
    derivation = Derivation(plant)
    assert run(derivation, START, speed_magnitude=1180, status=1)["speed"] == (1180, GOOD)
    assert run(derivation, START + 1, status=2)["speed"] == (-1180, GOOD)
    assert "speed" not in run(derivation, START + 2, status=2)
    assert run(derivation, START + 3, speed_magnitude=0)["speed"] == (0, GOOD)


def test_quality_is_the_worst_of_the_inputs_and_keeps_the_origin(plant: Plant) -> None:
    derivation = Derivation(plant)
    run(derivation, START, speed_magnitude=1180, status=1)
    assert run(derivation, START + 1, SIM, status=1)["speed"] == (1180, GOOD | SIM)
    value, quality = run(derivation, START + 2, COMM_FAILURE, status=1)["speed"]
    assert value is None
    assert is_bad(quality)
    assert run(derivation, START + 3, STALE, status=1)["running"] == (1, STALE)


def test_the_first_update_tells_every_derived_point(plant: Plant) -> None:
    derivation = Derivation(plant)
    told = {name for name, _, _ in derivation.update({}, START)}
    assert told == derivation.names
    assert run(derivation, START + 1, current=1.0)["current_max_today"] == (1.0, GOOD)
    assert derivation.update({}, START + 2) == []


def test_options_are_points(plant: Plant) -> None:
    assert run(Derivation(plant), START)["rated_current"] == (2.5, GOOD)


@pytest.mark.sweep(8)
def test_running_hours_follow_the_times_and_never_the_number_of_calls(plant: Plant) -> None:
    once, often = Derivation(plant), Derivation(plant)
    for derivation in (once, often):
        run(derivation, START, status=1)
    for step in range(1, 7200):
        often.update({}, START + step * SECOND)
    assert run(once, START + 2 * HOUR, status=0)["running_hours"] == (2.0, GOOD)
    run(often, START + 2 * HOUR, status=0)
    assert often.retained()["m1.running_hours"]["value"] == pytest.approx(2.0, abs=1e-9)
    assert "running_hours" not in run(once, START + 5 * HOUR, status=0)


def test_time_without_knowledge_is_not_counted(plant: Plant) -> None:
    derivation = Derivation(plant)
    run(derivation, START, status=1)
    assert run(derivation, START + HOUR, COMM_FAILURE, status=1)["running_hours"] == (1.0, STALE)
    assert run(derivation, START + 3 * HOUR, status=1)["running_hours"] == (1.0, GOOD)
    assert run(derivation, START + 4 * HOUR)["running_hours"] == (2.0, GOOD)


def test_a_clock_set_back_takes_nothing_away(plant: Plant) -> None:
    derivation = Derivation(plant)
    run(derivation, START, status=1)
    run(derivation, START + HOUR)
    run(derivation, START + HOUR // 2)
    assert run(derivation, START + HOUR)["running_hours"] == (1.5, GOOD)


def test_starts_are_rising_edges(plant: Plant) -> None:
    derivation = Derivation(plant)
    assert run(derivation, START, status=1)["starts"] == (0, GOOD)
    run(derivation, START + 1, status=0)
    assert run(derivation, START + 2, status=2)["starts"] == (1, GOOD)
    assert "starts" not in run(derivation, START + 3, status=1)
    run(derivation, START + 4, COMM_FAILURE, status=1)
    assert run(derivation, START + 5, status=1)["starts"] == (1, GOOD)


def test_minimum_and_maximum_begin_again_at_midnight_of_the_plant(plant: Plant) -> None:
    derivation = Derivation(plant)
    evening = to_micros(datetime(2026, 3, 9, 22, 30, tzinfo=UTC))  # 23:30 in Zagreb
    run(derivation, evening, current=2.0)
    assert run(derivation, evening + SECOND, current=3.0)["current_max_today"] == (3.0, GOOD)
    assert run(derivation, evening + 2 * SECOND, current=1.0)["current_min_today"] == (1.0, GOOD)
    assert run(derivation, evening + 31 * 60 * SECOND)["current_max_today"] == (1.0, GOOD)
    night = to_micros(datetime(2026, 3, 10, 0, 30, tzinfo=UTC))
    assert "current_max_today" not in run(derivation, night)


def test_the_day_of_the_clock_change_has_23_hours(plant: Plant) -> None:
    derivation = Derivation(plant)
    begin = to_micros(datetime(2026, 3, 28, 23, 0, tzinfo=UTC))  # 29 March 00:00 in Zagreb
    run(derivation, begin, current=9.0)
    run(derivation, begin + SECOND, current=1.0)
    assert "current_max_today" not in run(derivation, begin + 23 * HOUR - SECOND)
    assert run(derivation, begin + 23 * HOUR)["current_max_today"] == (1.0, GOOD)


@pytest.mark.parametrize("restarted", [False, True])
def test_a_clock_set_back_over_midnight_and_past_it_again_loses_no_extreme(plant: Plant, restarted: bool) -> None:
    derivation = Derivation(plant)

    def went_on() -> Derivation:
        if not restarted:
            return derivation
        after = Derivation(plant)
        after.restore(json.loads(json.dumps(derivation.retained())))
        return after

    midnight = to_micros(datetime(2026, 3, 9, 23, 0, tzinfo=UTC))  # in Zagreb
    run(derivation, midnight - 60 * SECOND, current=9.0)
    run(derivation, midnight - 50 * SECOND, current=2.0)
    assert run(derivation, midnight + SECOND, current=4.0)["current_max_today"] == (4.0, GOOD)
    derivation = went_on()
    assert run(derivation, midnight - 30 * SECOND, current=3.0)["current_max_today"] == (9.0, GOOD)
    derivation = went_on()
    assert run(derivation, midnight + 2 * SECOND, current=1.0)["current_max_today"] == (4.0, GOOD)
    assert run(derivation, midnight + 25 * HOUR, current=1.5)["current_max_today"] == (1.5, GOOD)


def test_an_extreme_lives_through_lost_communication_and_says_so(plant: Plant) -> None:
    derivation = Derivation(plant)
    run(derivation, START, current=2.0)
    assert run(derivation, START + 1, COMM_FAILURE, current=99.0)["current_max_today"] == (2.0, STALE)


def test_a_state_knows_since_when(plant: Plant) -> None:
    derivation = Derivation(plant)
    run(derivation, START, status=0)
    assert run(derivation, START + 5, status=1)["state_since"] == (START + 5, GOOD)
    assert "state_since" not in run(derivation, START + 9, status=1)


def test_a_state_that_broke_off_is_unknown_since_the_break_and_known_again_as_before(plant: Plant) -> None:
    derivation = Derivation(plant)
    run(derivation, START, status=1)
    assert run(derivation, START + 5, COMM_FAILURE, status=1)["state_since"] == (START + 5, STALE)
    assert "state_since" not in run(derivation, START + 9, COMM_FAILURE, status=1), "the break is when it began"
    assert derivation.retained()["m1.state_since"]["value"] == START
    assert run(derivation, START + 20, status=1)["state_since"] == (START, GOOD)
    run(derivation, START + 30, COMM_FAILURE, status=1)
    assert run(derivation, START + 40, status=2)["state_since"] == (START + 40, GOOD)


def test_counters_go_on_after_a_restart(plant: Plant) -> None:
    before = Derivation(plant)
    run(before, START, status=0, current=2.0)
    run(before, START + SECOND, status=1, current=3.0)
    run(before, START + SECOND + HOUR)
    kept = before.retained()
    after = Derivation(plant)
    after.restore(kept)
    told = run(after, START + 3 * HOUR, status=1, current=1.0)
    assert told["running_hours"] == (1.0, GOOD)
    assert told["starts"] == (1, GOOD)
    assert told["current_max_today"] == (3.0, GOOD)
    assert told["state_since"] == (START + SECOND, GOOD)
    next_day = Derivation(plant)
    next_day.restore(kept)
    assert run(next_day, START + 30 * HOUR, current=1.0)["current_max_today"] == (1.0, GOOD)


def test_what_was_kept_and_makes_no_sense_is_left_out(plant: Plant) -> None:
    derivation = Derivation(plant)
    derivation.restore({"m1.running_hours": {"value": "many"}, "m1.starts": {"value": -3}, "m9.starts": {"value": 1}})
    told = run(derivation, START, status=0)
    assert told["running_hours"] == (0.0, GOOD)
    assert told["starts"] == (0, GOOD)


def test_counters_can_be_set_back_and_nothing_else(plant: Plant) -> None:
    derivation = Derivation(plant)
    run(derivation, START, status=1)
    run(derivation, START + HOUR)
    derivation.reset("m1.running_hours")
    assert run(derivation, START + HOUR)["running_hours"] == (0.0, GOOD)
    with pytest.raises(ConfigurationError, match=r"m1\.speed"):
        derivation.reset("m1.speed")


@pytest.mark.sweep(8)
@given(st.lists(st.tuples(st.integers(0, 2 * HOUR), st.sampled_from([0, 1, 2, 9])), max_size=20))
def test_hours_are_the_time_that_was_spent_running(steps: list[tuple[int, int]]) -> None:
    assert _plant is not None
    derivation, now, running, spent = Derivation(_plant), START, False, 0
    for wait, status in steps:
        now += wait
        spent += wait if running else 0
        run(derivation, now, status=status)
        running = status in (1, 2)
    derivation.update({}, now)
    assert derivation.retained()["m1.running_hours"]["value"] == pytest.approx(spent / HOUR)
