"""An axis of the car follows its ramp, and stops where it must."""

from itertools import pairwise

import pytest

from app.sim.coil_car import register_map as coil_car
from app.sim.coil_car.actions import ARRIVED
from tests.sim.coil_car.bench import line, run, value


def test_an_axis_follows_an_s_ramp_and_ends_at_its_target() -> None:
    car, _ = line(start="automatic", settings={"jerk_horizontal": 300.0})
    speeds = [0.0]
    while car.action_state != coil_car.ActionState.DONE:
        car.ask(["drive_to_mandrel"])
        car.step()
        speeds.append(-car.machine.speed_x)
    changes = [(after - before) / 0.01 for before, after in pairwise(speeds)]
    jerks = [(after - before) / 0.01 for before, after in pairwise(changes)]
    assert max(speeds) == pytest.approx(400, abs=0.1) and min(speeds) >= -0.01
    assert max(map(abs, changes)) <= 200 + 1e-6 and max(map(abs, jerks)) <= 300 + 1e-3
    assert car.machine.x == pytest.approx(1000, abs=ARRIVED)


def test_a_withdrawn_action_stops_on_the_ramp() -> None:
    car, _ = line(start="automatic")
    for _ in range(300):
        car.ask(["drive_to_mandrel"])
        car.step()
    speed = car.machine.speed_x
    car.step()
    assert speed < -300 and abs(car.machine.speed_x - speed) < 5
    run(car, 4)
    assert car.machine.speed_x == 0 and value(car, "action") == 0 and not car.moving
