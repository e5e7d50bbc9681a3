"""Where the coil car's coil goes: the farthest saddle that is free and can be reached."""

import pytest

from app.sim.coil_car.register_map import (
    ACTIONS,
    CoilCarCommand,
)
from tests.sim.coil_car.bench import DONE, line, value
from tests.sim.coil_car.line import act


def test_the_target_is_the_farthest_saddle_that_can_be_reached() -> None:
    car, talker = line(coil=True)
    for given, target, free in (
        ({"saddle_1": 1.0}, 2, 1),
        ({"saddle_2": 1.0}, 3, 1),
        ({"saddle_3": 1.0}, 1, 0),
    ):
        car.preset(given)
        car.step()
        assert (value(car, "target_saddle"), value(car, "target_free")) == (target, free)
    assert talker.ask(CoilCarCommand.TARGET, 2).state == DONE
    assert (value(car, "target_saddle"), value(car, "target_selected"), value(car, "target_free")) == (2, 2, 0)


@pytest.mark.sweep(8)
def test_the_target_stays_while_the_car_stands_at_it_and_is_the_next_one_once_it_leaves() -> None:
    car, _ = line(start="automatic", coil=True)
    for action in ACTIONS:
        act(car, action)
    act(car, "lower")
    laid = {name: value(car, name) for name in ("target_saddle", "at_target", "coil_laid", "lowered", "saddle_1")}
    assert laid == {"target_saddle": 1, "at_target": 1, "coil_laid": 1, "lowered": 1, "saddle_1": 1}
    assert value(car, "target_free") == 1, "for the next coil there is a saddle"
    act(car, "drive_to_mandrel")
    assert (value(car, "target_saddle"), value(car, "at_target"), value(car, "coil_laid")) == (2, 0, 0)
