"""What the registers show: of the drive, its terminals, its faults and its alarms."""

from dataclasses import replace

import pytest

from app.sim.induction_motor import MOTOR_SETS
from app.sim.sinamics import training as own
from app.sim.sinamics.image import Readings, reading
from app.sim.sinamics.power import PowerUnit
from app.sim.sinamics.registers import ACCESS_ERROR, REGISTERS
from app.sim.training import TrainingRegisters

FAULTS = [7860, 30021, 0, 0, 0, 0, 0, 0]


def shown() -> Readings:
    area = TrainingRegisters(2, (), {own.REG_AMBIENT: 25, own.REG_EMERGENCY: 1, own.REG_LOCAL: 1}, limits=own.LIMITS)
    power = PowerUnit(area, MOTOR_SETS["B"].sized(20.0), 15.0, inertia=0.1, seed=1)
    it = power.shaft
    it.speed, it.frequency, it.voltage, it.current, it.torque, it.power = 50.0, 17.0, 140.0, 9.0, -3.0, 1500.0
    power.energy, power.bus_voltage = 12.7, 540.0
    return Readings(power, 480.0, area, FAULTS, [7910, 7903], 2)


@pytest.mark.parametrize(
    ("number", "value"),
    [
        (40240, 1.0),
        (40241, 0.0),
        (40340, 480.0),
        (40341, pytest.approx(477.46, abs=0.01)),
        (40342, 17.0),
        (40343, 140.0),
        (40344, 540.0),
        (40345, 9.0),
        (40346, -3.0),
        (40347, 1.5),
        (40348, 12.7),
        (40349, 0.0),
        (40400, 7860),
        (40401, 30021),
        (40402, 0),
        (40407, 0),
        (40408, 7910),
        (40409, 7903),
        (ACCESS_ERROR, 2),
        (40520, 0.0),
    ],
)
def test_each_number_shows_what_it_is(number: int, value: float) -> None:
    assert number in REGISTERS
    assert reading(shown(), number) == value


def test_what_is_fed_back_is_no_power_and_no_alarm_is_0() -> None:
    it = replace(shown(), alarms=[])
    it.power.shaft.power = -500.0
    assert [reading(it, number) for number in (40347, 40408, 40409)] == [0, 0, 0]
