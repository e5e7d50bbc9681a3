"""A sequence is tried out on a plant of its own: through the gate, in virtual time, with the reason when it does not run through."""

import re
from dataclasses import replace
from pathlib import Path

import pytest

from app import bundled
from app.plant.definitions import Plant
from app.running.sequence_trial import Trial, try_out
from app.sim.plant import read_simulated
from tests.demo_plant import plant_folder

FEED = (bundled("plants/feeding") / "sequences" / "feed.toml").read_text("utf-8")


def plant_with(text: str) -> Plant:
    plant, problems = read_simulated(bundled("plants/feeding"), drafts={"feed": text})
    assert plant is not None, problems
    return plant


def feeding(text: str = FEED) -> Trial:
    return try_out(plant_with(text.replace("minimum = 20", "minimum = 2")), "seq1")


@pytest.mark.sweep(8)
def test_a_sequence_with_orders_runs_through_its_machines_and_says_when_each_step_was_entered() -> None:
    trial = feeding()
    assert (trial.outcome, [one.number for one in trial.steps]) == ("done", [1, 2, 3, 4])
    entered = [one.entered for one in trial.steps]
    assert entered == sorted(entered) and entered[2] - entered[1] >= 2 and trial.seconds > 10


@pytest.mark.sweep(8)
def test_where_it_stops_is_told_with_what_is_missing() -> None:
    trial = feeding(
        FEED.replace('"m1.frequency > 29"', '"m1.frequency > 45"').replace("maximum = 60", "maximum = 5", 1)
    )
    assert (trial.outcome, trial.step, trial.missing) == ("timed_out", 1, [(2, 0)])
    trial = feeding(
        FEED.replace('"m1.frequency > 29"', '"m1.frequency > 45"').replace("maximum = 60", "maximum = 0", 1)
    )
    assert (trial.outcome, trial.step, trial.missing) == ("waits", 1, [(2, 0)])


def test_a_start_that_is_not_possible_is_told() -> None:
    trial = feeding(FEED.replace('"c1.automatic == 0 and c1.moving == 0"', '"c1.automatic == 1"'))
    assert (trial.outcome, trial.step, trial.missing) == ("not_started", 0, [(1, 0)])


def test_an_abort_condition_that_falls_is_told() -> None:
    trial = feeding(FEED.replace('"m1.status in (0, 1, 2, 3)"', '"m1.frequency < 12"'))
    assert (trial.outcome, trial.step, trial.first_out) == ("aborted", 1, (0, 0))


def test_an_order_that_the_gate_refuses_is_told_with_its_reason() -> None:
    again = '[[steps.orders]]\nmachine = "c1"\naction = "select_automatic"\n'
    text = FEED.replace(again, '[[steps.orders]]\nmachine = "c1"\naction = "start"\n')
    trial = feeding(text)
    assert (trial.outcome, trial.step, trial.order) == ("aborted", 1, 2) and trial.reason


@pytest.mark.sweep(8)
def test_a_machine_begins_as_a_test_says_and_the_tests_of_the_file_are_run(tmp_path: Path) -> None:
    folder = plant_folder(tmp_path / "plant", "cc1", "seq1")
    file = folder / "sequences" / "coil_transport.toml"
    tests = re.split(r"(?m)^(?=\[\[tests\]\])", file.read_text("utf-8"))
    file.write_text("".join([tests[0], next(one for one in tests if "a guard is opened" in one)]), "utf-8")
    plant, problems = read_simulated(folder)
    assert plant is not None, problems
    sequence = plant.equipment["seq1"].sequence
    assert sequence is not None
    trial = try_out(plant, "seq1", sequence.tests[0])
    assert trial.outcome == "done" and len(trial.steps) == len(sequence.steps)
    assert [(one.name[:17], one.ok) for one in trial.tests] == [("a guard is opened", True)]


@pytest.mark.sweep(8)
def test_in_a_branch_what_follows_as_the_chart_says_is_missing() -> None:
    text = FEED.replace('"m1.frequency > 29"', '"m1.frequency > 45"').replace("maximum = 60", "maximum = 5", 1)
    keys = [step.key for step in plant_with(text).equipment["seq1"].sequence.steps]  # type: ignore[union-attr]
    branch = (
        f'[[branches]]\nafter = "{keys[0]}"\ntake = "first"\npaths = ["{keys[1]}", "{keys[2]}"]\nthen = "{keys[3]}"\n'
    )
    when = '\n[steps.permissives.9]\nkey = "never"\nlabel = "Never"\nwhen = "m1.frequency > 400"\n'
    begin = text.index("[[steps]]", text.index(f'key = "{keys[2]}"'))
    trial = feeding(text[:begin] + when + text[begin:] + "\n" + branch)
    assert trial.outcome == "timed_out" and set(trial.missing) == {(2, 0), (3, 9)}


def test_presets_that_the_machine_does_not_have_fail_the_trial_with_the_reason(tmp_path: Path) -> None:
    plant, problems = read_simulated(plant_folder(tmp_path / "plant", "cc1", "seq1"))
    assert plant is not None, problems
    sequence = plant.equipment["seq1"].sequence
    assert sequence is not None
    trial = try_out(plant, "seq1", replace(sequence.tests[0], given={"no_such_thing": 1.0}))
    assert trial.outcome == "failed" and "no_such_thing" in trial.error


def test_a_trial_that_nobody_waits_for_any_more_ends() -> None:
    """The server stops: a thread that computed on for a minute would keep it."""
    looked = list[int]()

    def given_up() -> bool:
        looked.append(1)
        return len(looked) > 3

    trial = try_out(plant_with(FEED), "seq1", None, given_up)
    assert (trial.outcome, len(looked)) == ("too_long", 4) and trial.seconds < 2
    own = plant_of_tests("seq1")
    found = try_out(own, "seq1", None, lambda: True)
    assert found.tests == [] and found.untested == len(own.equipment["seq1"].sequence.tests) > 0  # type: ignore[union-attr]


def plant_of_tests(machine: str) -> Plant:
    """The demo plant, whose sequence has tests in its file."""
    plant, problems = read_simulated(bundled("plants/demo"))
    assert plant is not None and plant.equipment[machine].sequence, problems
    return plant
