"""What the registers of a SINAMICS drive show, by number."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from app.sim.sinamics.power import PowerUnit
from app.sim.sinamics.registers import ACCESS_ERROR
from app.sim.sinamics.training import REG_EMERGENCY, REG_INTERLOCK, REG_LOCAL
from app.sim.training import TrainingRegisters

FIRMWARE, POWER_UNIT = 470, 10001
FIRST_FAULT = 40400


@dataclass(frozen=True, slots=True)
class Readings:
    """What the drive knows of itself."""

    power: PowerUnit
    ramp: float
    """Output of the ramp generator [rpm], 0 without pulses."""
    training: TrainingRegisters
    """Terminals, and who has the control."""
    faults: list[int]
    """Places of the present situation."""
    alarms: list[int]
    access_error: int


def reading(it: Readings, number: int) -> float:
    """Value of register `number` [its unit]; what the drive does not know is 0."""
    if FIRST_FAULT <= number < FIRST_FAULT + len(it.faults):
        return it.faults[number - FIRST_FAULT]
    of = _READINGS.get(number)
    return of(it) if of else 0.0


_READINGS: Mapping[int, Callable[[Readings], float]] = MappingProxyType(
    {
        40240: lambda it: float(not it.training[REG_INTERLOCK]),
        40241: lambda it: float(not it.training[REG_EMERGENCY]),
        40300: lambda it: POWER_UNIT,
        40301: lambda it: FIRMWARE * 10000,
        40320: lambda it: it.power.data.rated_power / 1000,
        40340: lambda it: it.ramp,
        40341: lambda it: it.power.speed,
        40342: lambda it: it.power.shaft.frequency,
        40343: lambda it: it.power.shaft.voltage,
        40344: lambda it: it.power.bus_voltage,
        40345: lambda it: it.power.shaft.current,
        40346: lambda it: it.power.shaft.torque,
        40347: lambda it: max(0.0, it.power.shaft.power) / 1000,
        40348: lambda it: it.power.energy,
        40349: lambda it: float(not it.training[REG_LOCAL]),
        40408: lambda it: it.alarms[0] if it.alarms else 0,
        40409: lambda it: it.alarms[-1] if it.alarms else 0,
        ACCESS_ERROR: lambda it: it.access_error,
    }
)
