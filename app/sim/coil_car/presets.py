"""States that a test of a sequence puts the coil car's line into (`given` and `set`)."""

from collections.abc import Mapping

from app.sim.coil_car.interlock import InterlockedCar
from app.sim.coil_car.machine import Hit
from app.sim.coil_car.register_map import PRESETS, Fault, Mode


def put(car: InterlockedCar, values: Mapping[str, float]) -> None:
    """Put the line into a state, as `given` and `set` of a test do (`PRESETS`); all of them or none.

    Raises:
        ValueError: no such preset, a value out of its range, or values that would have the car touch something.
    """
    for name, value in values.items():
        if name not in PRESETS:
            raise ValueError(f"preset {name}: expected one of {', '.join(PRESETS)}")
        low, high = PRESETS[name]
        if not low <= value <= high:
            raise ValueError(f"preset {name} = {value:g}: expected {low:g} to {high:g}")
    before = _picture(car)
    for name in sorted(values, key=list(PRESETS).index):
        _put(car, name, values[name])
    machine = car.machine
    machine.look_for_a_hit()
    if machine.hit is not before[0]:
        kind = machine.hit.name.lower().replace("_", " ")
        machine.hit, machine.x, machine.v, machine.coil, machine.load, machine.expansion = before[:6]
        machine.saddles, machine.finished, machine.winding = before[6], before[7], before[8]
        said = ", ".join(f"{name} = {value:g}" for name, value in values.items())
        raise ValueError(f"preset {said}: there the car touches the {kind}")
    car.choose_target()
    car.interlock.renew()


def _picture(car: InterlockedCar) -> tuple[Hit, float, float, float, float, float, list[float], bool, bool]:
    m = car.machine
    return m.hit, m.x, m.v, m.coil, m.load, m.expansion, list(m.saddles), m.finished, m.winding


def _put(car: InterlockedCar, name: str, value: float) -> None:
    machine = car.machine
    if name == "mode":
        car.mode, car.fault = Mode(int(value)), Fault.NONE
    elif name == "horizontal":
        machine.x, machine.speed_x = value, 0.0
        car.horizontal.ramp.reset()
    elif name == "vertical":
        machine.v, machine.speed_v = value, 0.0
        car.vertical.ramp.reset()
    elif name == "mandrel":
        machine.expansion = value / 2
    elif name == "diameter":
        car.preset_diameter = value
    elif name == "coil":
        machine.coil, machine.finished, machine.winding = car.preset_diameter * value, value > 0, False
    elif name == "winding":
        machine.winding, machine.finished = value > 0, False
        if value and not machine.coil:
            machine.coil = car.geometry.coil_smallest
    elif name == "coil_on_car":
        machine.load = car.preset_diameter * value
    elif name.startswith("saddle_"):
        machine.saddles[int(name[-1]) - 1] = car.preset_diameter * value
    elif name == "target_saddle":
        car.target_selected = int(value)
    elif name == "automatic_winding":
        machine.strip = value > 0
    elif name == "crane":
        machine.crane = value
    elif name in ("pressure", "oil_temperature") and value < 0:
        machine.held.pop(name, None)
    else:
        machine.held[name] = value
        if name == "pressure":
            machine.pressure = value
        elif name == "oil_temperature":
            machine.oil = value
