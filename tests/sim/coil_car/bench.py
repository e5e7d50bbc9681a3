"""The line of a recoiler with its car, as its tests operate it."""

from app.registers import plc_map
from app.registers.plc_map import AnswerState
from app.sim.coil_car.program import VirtualCoilCar
from app.sim.coil_car.register_map import (
    REGISTERS,
)
from tests.sim.coil_car.line import Talker

DONE, REJECTED, RUNNING = AnswerState.DONE, AnswerState.REJECTED, AnswerState.RUNNING


def line(**options: object) -> tuple[VirtualCoilCar, Talker]:
    given: dict[str, object] = {"start": "manual", **options}
    car = VirtualCoilCar(**given)  # type: ignore[arg-type]
    car.step()
    return car, Talker(car)


def run(car: VirtualCoilCar, seconds: float, talker: Talker | None = None, bits: int = 0) -> None:
    for scan in range(round(seconds * 100)):
        if talker and bits and scan % 10 == 0:
            talker.hold(bits)
        car.step()


def value(car: VirtualCoilCar, name: str) -> float:
    """A point as a host reads it."""
    place = REGISTERS[name]
    words = car.read(3, place.address, 1 if place.type == "u16" else 2)
    if place.type == "u16":
        return words[0] >> place.shift & place.mask if place.mask else words[0]
    raw = words[0] << 16 | words[1]
    return plc_map.real_of(raw) if place.type == "f32" else raw
