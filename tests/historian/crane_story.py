"""Cycles of a crane as its event ring tells them."""

from app.sim.crane.register_map import CraneEvent as E
from app.sim.crane.register_map import Step, Suspension
from tests.historian.rings import BEGIN, SECOND, Event, Ring

STEPS = [step for step in Step if step]


def path_error(number: int) -> float:
    """Of the cycle `number` [mm]."""
    return 0.5 + number / 10


def sway(number: int) -> float:
    """[mm]"""
    return 3.0 * number


def seconds(number: int, step: Step) -> float:
    """That a step took [s]."""
    return 2.0 + STEPS.index(step) + number / 10


def cycles(count: int, *, aborted: int = 0, begin: int = BEGIN) -> list[Event]:
    """`count` cycles, numbers from 1; the one with the number `aborted` has a drive that trips, and is given up in its lift."""
    ring = Ring(time=begin)

    def tell(code: E, source: int = 0, value: float = 0.0, after: float = 0.0) -> None:
        ring.tell(code, 0, source=source, value=value, after=after)

    for number in range(1, count + 1):
        tell(E.CYCLE_STARTED, 1 + number % 2, 2 - number % 2, after=20)
        took = 0.0
        for step in STEPS:
            tell(E.STEP_ENTERED, step)
            if number == aborted and step is Step.ARC_LIFT:
                tell(E.DRIVE_TRIPPED, 3, after=4)
                tell(E.SUSPENDED, Suspension.DRIVE, float(step))
                tell(E.CYCLE_ABORTED, step, took + 4, after=10)
                break
            took += seconds(number, step)
            if step in (Step.ARC_LIFT, Step.ARC_LOWERING):
                tell(E.PATH_DONE, step, path_error(number) - (step is Step.ARC_LIFT) * 0.3)
            if step is Step.WEIGHT_CHECK:
                tell(E.WEIGHT_CHECKED, 1, 200.0 + number)
            tell(E.STEP_ENDED, step, seconds(number, step), after=seconds(number, step))
            if step is Step.TO_SET_DOWN:
                tell(E.SWAY_LEFT, step, sway(number))
        else:
            tell(E.CYCLE_DONE, 0, took)
    assert ring.time > begin + count * SECOND
    return ring.events
