"""What the coil car's PLC tells of its line: every change once, with its source, and nothing while nothing changes."""

from collections.abc import Callable

import pytest

from app.sim.coil_car.machine import Hit
from app.sim.coil_car.program import VirtualCoilCar
from app.sim.coil_car.register_map import CoilCarEvent
from tests.sim.coil_car.bench import line

Change = Callable[[VirtualCoilCar], None]
GUARDS = [({f"guard_{n}": 0.0}, [(CoilCarEvent.GUARD_OPENED, n)], [(CoilCarEvent.GUARD_CLOSED, n)]) for n in (1, 2, 3)]


@pytest.mark.parametrize(
    ("held", "told", "back"),
    [
        *GUARDS,
        ({"pump": 0.0}, [(CoilCarEvent.PUMP_OFF, 0)], [(CoilCarEvent.PUMP_ON, 0)]),
        ({"pump": 0.0, "guard_2": 0.0}, [(7, 2), (33, 0)], [(8, 2), (32, 0)]),
    ],
)
def test_what_is_held_is_told_once_and_told_again_when_it_is_back(
    held: dict[str, float], told: list[tuple[int, int]], back: list[tuple[int, int]]
) -> None:
    car, talker = line()
    talker.codes()
    car.machine.held |= held
    car.edges.look()
    assert talker.codes() == told
    car.edges.look()
    assert talker.codes() == [], "it is no news any more"
    car.machine.held.clear()
    car.edges.look()
    assert talker.codes() == back


def _set(**values: object) -> Change:
    def change(car: VirtualCoilCar) -> None:
        for name, value in values.items():
            setattr(car.machine, name, value)

    return change


@pytest.mark.parametrize(
    ("before", "after", "told"),
    [
        (_set(pressure=160.0), _set(pressure=10.0), [(CoilCarEvent.PRESSURE_LOW, 0, 10.0)]),
        (_set(pressure=10.0), _set(pressure=160.0), [(CoilCarEvent.PRESSURE_BACK, 0, 160.0)]),
        (_set(oil=40.0), _set(oil=1.0), [(CoilCarEvent.OIL_COLD, 0, 1.0)]),
        (_set(expansion=1.0), _set(expansion=0.5), []),
        (_set(expansion=0.5), _set(expansion=0.0), [(CoilCarEvent.COLLAPSED, 0, 0.0)]),
        (_set(expansion=0.5), _set(expansion=1.0), [(CoilCarEvent.EXPANDED, 0, 0.0)]),
        (_set(winding=False), _set(winding=True, coil=600.0), [(CoilCarEvent.WINDING, 0, 600.0)]),
        (_set(winding=True, coil=900.0), _set(winding=False), [(CoilCarEvent.WINDING_STOPPED, 0, 900.0)]),
        (_set(winding=True), _set(winding=False, finished=True, coil=1300.0), [(CoilCarEvent.COIL_READY, 0, 1300.0)]),
        (_set(load=1300.0), _set(load=0.0, coil=1300.0, finished=True), [(CoilCarEvent.COIL_ON_MANDREL, 0, 1300.0)]),
        (_set(coil=1300.0), _set(coil=0.0, load=1300.0), [(CoilCarEvent.COIL_ON_CAR, 0, 1300.0)]),
        (_set(saddles=[0.0, 900.0, 0.0]), _set(saddles=[0.0] * 3, load=900.0), [(CoilCarEvent.COIL_ON_CAR, 2, 900.0)]),
        (_set(load=900.0), _set(load=0.0, saddles=[0.0, 0.0, 900.0]), [(CoilCarEvent.COIL_LAID, 3, 900.0)]),
        (_set(saddles=[900.0, 0.0, 0.0]), _set(saddles=[0.0] * 3), [(CoilCarEvent.COIL_REMOVED, 1, 900.0)]),
        (_set(x=2500.0), _set(hit=Hit.SADDLE), [(CoilCarEvent.COLLISION, Hit.SADDLE, 2500.0)]),
    ],
)
def test_a_change_is_told_with_its_place_and_its_number(
    before: Change, after: Change, told: list[tuple[int, int, float]]
) -> None:
    car, talker = line()
    before(car)
    car.edges.take_stock()
    talker.events()
    after(car)
    car.edges.look()
    assert [(event.code, event.source, event.value) for event in talker.events()] == told


def test_a_coil_is_counted_when_it_is_ready_and_when_it_is_laid() -> None:
    car, _ = line()
    assert (car.coils_wound, car.coils_done) == (0, 0)
    for change in (_set(winding=True), _set(winding=False, finished=True, coil=900.0), _set(coil=0.0, load=900.0)):
        change(car)
        car.edges.look()
    assert (car.coils_wound, car.coils_done) == (1, 0)
    _set(load=0.0, saddles=[900.0, 0.0, 0.0])(car)
    car.edges.look()
    assert (car.coils_wound, car.coils_done) == (1, 1)
