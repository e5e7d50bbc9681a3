"""Hydraulics, table, mandrel, saddles and crane of the line."""

import pytest

from app.sim.coil_car import register_map as coil_car
from app.sim.coil_car.machine import Geometry
from app.sim.coil_car.register_map import (
    Block,
    CoilCarEvent,
    Mode,
)
from tests.sim.coil_car.bench import line, run, value
from tests.sim.coil_car.line import act


def test_the_crane_takes_a_coil_but_not_from_above_the_car() -> None:
    car, talker = line(start="automatic", coil=True)
    car.preset({"saddle_1": 1, "saddle_2": 1, "horizontal": 9000, "vertical": 690, "crane": 2})
    run(car, 3)
    assert [value(car, f"saddle_{n}") for n in (1, 2)] == [1, 0]
    assert (CoilCarEvent.COIL_REMOVED, 2) in talker.codes()


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("code", "low", "back", "block"),
    [
        (31, CoilCarEvent.PRESSURE_LOW, CoilCarEvent.PRESSURE_BACK, Block.PRESSURE),
        (32, CoilCarEvent.PRESSURE_LOW, CoilCarEvent.PRESSURE_BACK, Block.PRESSURE),
        (33, CoilCarEvent.OIL_COLD, CoilCarEvent.OIL_WARM, Block.OIL),
    ],
)
def test_hydraulics_block_table_and_mandrel_and_come_back(
    code: int, low: CoilCarEvent, back: CoilCarEvent, block: Block
) -> None:
    car, talker = line(start="automatic", coil=True)
    talker.fault(code)
    run(car, 10)
    assert low in [each for each, _ in talker.codes()]
    for name in ("up", "down", "expand", "collapse"):
        assert value(car, f"block_{name}") == block and value(car, f"interlock_{name}") == 1
    assert value(car, "block_back") == Block.FREE and value(car, "mode") == Mode.AUTOMATIC
    assert value(car, "pump") == (code != 32)
    for _ in range(100):
        car.ask(["lift_over_saddle"])
        car.step()
    assert car.machine.v == 0 and value(car, "action_state") == coil_car.ActionState.BLOCKED
    talker.fault(0)
    run(car, 10)
    assert back in [each for each, _ in talker.codes()]
    act(car, "lift_over_saddle")


def test_the_table_stays_where_it_is_when_the_pressure_goes() -> None:
    car, talker = line(start="automatic")
    for _ in range(400):
        car.ask(["lift_over_saddle"])
        car.step()
    talker.fault(32)
    run(car, 3)
    height = car.machine.v
    run(car, 10)
    assert height > 100 and car.machine.v == height


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("mandrel_position", -1.0),
        ("mandrel_reach", 900.0),
        ("out_position", 2000.0),
        ("saddle_3_position", 3000.0),
        ("saddle_2_position", 5000.0),
        ("travel", 8000.0),
        ("clearance", 20.0),
        ("lift", 700.0),
        ("coil_largest", 2400.0),
        ("position_tolerance", 40.0),
        ("saddle_height", 100.0),
        ("eye_diameter", 400.0),
    ],
)
def test_measures_that_contradict_each_other_are_told(name: str, wrong: float) -> None:
    with pytest.raises(ValueError, match="expected"):
        Geometry(**{name: wrong})
