"""Actions that a sequence asks of the car."""

import pytest

from app.sim.coil_car import register_map as coil_car
from app.sim.coil_car.register_map import (
    ACTIONS,
    Block,
    CoilCarEvent,
)
from tests.sim.coil_car.bench import line, value
from tests.sim.coil_car.line import act


@pytest.mark.sweep(8)
def test_the_transport_by_actions_lays_the_coil_on_the_farthest_saddle() -> None:
    car, talker = line(start="automatic", coil=True)
    talker.events()
    for action in ACTIONS[:8]:
        act(car, action)
    assert [value(car, f"saddle_{n}") for n in (1, 2, 3)] == [1, 0, 0]
    assert value(car, "coils_done") == 1 and value(car, "coil_on_car") == 0
    assert value(car, "horizontal") == pytest.approx(9000, abs=1) and value(car, "vertical") == pytest.approx(
        550, abs=1
    )
    told = [code for code, _ in talker.codes() if code not in (CoilCarEvent.ACTION_BEGUN, CoilCarEvent.ACTION_DONE)]
    assert told == [
        CoilCarEvent.COLLAPSED,
        CoilCarEvent.COIL_ON_CAR,
        CoilCarEvent.EXPANDED,
        CoilCarEvent.WINDING,
        CoilCarEvent.COIL_LAID,
    ]


def test_actions_are_taken_in_automatic_only() -> None:
    for start in ("manual", "stopped"):
        car, _ = line(start=start, coil=True)
        assert not car.takes_actions
        for _ in range(100):
            car.ask(["drive_to_mandrel"])
            car.step()
        assert car.machine.x == 2700 and value(car, "action") == 0


def test_there_is_nothing_to_lift_to_without_a_coil() -> None:
    car, _ = line(start="automatic", settings={"automatic_winding": 0.0})
    car.preset({"horizontal": 1000})
    for _ in range(100):
        car.ask(["lift_to_coil"])
        car.step()
    assert car.machine.v == 0 and value(car, "action_state") == coil_car.ActionState.BLOCKED


def test_one_movement_at_a_time() -> None:
    car, _ = line(start="automatic")
    for _ in range(200):
        car.ask(["drive_to_mandrel"])
        car.step()
    for _ in range(30):
        car.ask(["lift_over_saddle"])
        car.step()
        assert car.machine.speed_v == 0
    assert value(car, "action_state") == coil_car.ActionState.BLOCKED
    assert value(car, "block_up") == Block.OTHER_MOVEMENT
