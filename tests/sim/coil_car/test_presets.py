"""Presets put the line into a state, or say why not."""

import pytest

from app.sim.coil_car.register_map import (
    PRESETS,
)
from tests.sim.coil_car.bench import line, run, value


def test_presets_put_the_line_into_a_state_or_say_why_not() -> None:
    car, _ = line()
    car.preset({"horizontal": 1000, "coil": 1, "diameter": 1500, "saddle_3": 1})
    assert value(car, "coil_diameter") == 1500 and value(car, "saddle_3_diameter") == 1500
    for values, said in (
        ({"height": 1.0}, "expected one of"),
        ({"saddle_1": 2.0}, "0 to 1"),
        ({"vertical": 900.0}, "touches the coil on mandrel"),
    ):
        with pytest.raises(ValueError, match=said):
            car.preset(values)
    assert car.machine.v == 0 and value(car, "collision") == 0


def test_every_preset_is_taken() -> None:
    for name, (low, high) in PRESETS.items():
        for wanted in (low, high):
            car, _ = line()
            if name == "vertical" or name == "horizontal":
                wanted = min(wanted, 3000.0) if name == "horizontal" else min(wanted, 900.0)
            if name == "mandrel" or name == "coil_on_car":
                car.preset({"automatic_winding": 0})
            car.preset({name: wanted})
            car.step()
            assert value(car, "collision") == 0, name


def test_held_pressure_stays_until_it_is_given_back() -> None:
    car, _ = line()
    car.preset({"pressure": 20})
    run(car, 5)
    assert value(car, "pressure") == 20 and value(car, "pressure_ok") == 0
    car.preset({"pressure": -1})
    run(car, 10)
    assert value(car, "pressure_ok") == 1
