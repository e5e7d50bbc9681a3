"""Which virtual devices a sequence can be coupled with."""

from app.sim.coil_car.program import VirtualCoilCar
from app.sim.eura_e800.drive import VirtualE800
from app.sim.sequence.machine import Machine
from tests.sim.sequence.stand import taught


def test_a_machine_is_what_has_signals_and_takes_actions() -> None:
    assert isinstance(VirtualCoilCar(), Machine)
    assert not isinstance(VirtualE800(), Machine)
    assert not isinstance(taught()[0], Machine)


def test_every_signal_has_a_number_and_no_action_is_unknown() -> None:
    car = VirtualCoilCar()
    assert all(isinstance(car.signal(name), int | float) for name in car.signals)
    car.ask(car.actions)
    car.step()
