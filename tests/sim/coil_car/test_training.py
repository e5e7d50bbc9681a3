"""Every fault of the instructor is in a test."""

from app.sim.coil_car.machine import FAULTS


def test_every_fault_of_the_instructor_is_in_a_test() -> None:
    assert set(FAULTS) == {1, 2, 11, 12, 13, 14, 21, 22, 23, 24, 31, 32, 33, 41, 42, 43, 50, 51, 60}
