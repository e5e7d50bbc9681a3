"""Automatic moves of single axes through their drives and brakes: where they arrive, and what sway is left of the load."""

import pytest

from app.blocks.positioner.positioner import MovePhase
from app.sim.crane import training
from app.sim.crane.configuration import AXES, SETTINGS, Places
from app.sim.crane.ladle import FULL, Load
from app.sim.crane.plc_axis import Asked, PlcAxis, Surroundings
from app.sim.crane.register_map import CraneCommand, Step, StepState
from app.sim.crane.travel import SWAYING, Travel
from tests.sim.crane.crane_stand import Stand

DT = 0.04
"""Of the program while something moves [s]."""
STAND_AT = {"hoist": 13000.0, "trolley": 5000.0, "bridge": 10000.0}
"""24 m of rope."""
OFF, ZV, ZVD = 0.0, 1.0, 2.0
ENOUGH = 120.0
"""For any of these moves [s]."""


class Trip:
    """The axes of a crane with a ladle on the hook, and their travel."""

    def __init__(self, shaping: float, **places: float) -> None:
        settings = {setting.name: setting.default for setting in SETTINGS} | {"sway_shaping": shaping}
        at = STAND_AT | places
        self.axes = {name: PlcAxis(name, settings, Places(), at[name]) for name in AXES}
        self.travel = Travel(self.axes, settings, DT)
        self.load = Load(Places(), 210.0, 0, locked=True, share=1.0)
        self.load.rope.load = 210.0 / FULL
        self.seconds = 0.0
        self.far = {name: 0.0 for name in AXES}
        """Farthest that an axis came from where it began [mm]."""
        self.start = at
        for _ in range(round(1 / DT)):
            self.step({})

    def step(self, goes: dict[str, float], fault: int = 0, dt: float = DT) -> list[MovePhase]:
        """One scan on the way to these positions."""
        before = {name: axis.speed for name, axis in self.axes.items()}
        self.travel.begin(self.load.hanging / FULL, dt)
        phases = [self.travel.position(name, target, dt) for name, target in goes.items()]
        self.travel.end(dt)
        around = Surroundings(fault != training.EMERGENCY_STOP, True, True, False, fault, self.load.rope.load)
        for name, axis in self.axes.items():
            axis.step(self.travel.asked.get(name, Asked()), around, dt)
            self.far[name] = max(self.far[name], abs(axis.axis.position - self.start[name]))
        at = {name: axis.axis.position for name, axis in self.axes.items()}
        now = {name: axis.speed for name, axis in self.axes.items()}
        self.load.step(at, now, {name: now[name] - before[name] for name in now}, dt)
        self.seconds += dt
        return phases

    def go(self, goes: dict[str, float]) -> float:
        """To these positions; gives how long it took [s]."""
        began = self.seconds
        while set(phases := self.step(goes)) != {MovePhase.DONE}:
            assert MovePhase.MISSED not in phases and self.seconds - began < ENOUGH
        return self.seconds - began

    def sway(self, axis: str) -> float:
        """How far the load swings as the crane stands [mm]."""
        return self.load.swings[axis].amplitude(self.load.rope.top - self.axes["hoist"].axis.position)


@pytest.mark.sweep(8)
@pytest.mark.parametrize("axis", SWAYING)
@pytest.mark.parametrize("way", [7000.0, -2500.0, 600.0])
@pytest.mark.parametrize("height", [13000.0, 26000.0])
def test_the_load_hangs_still_when_a_shaped_move_has_arrived(axis: str, way: float, height: float) -> None:
    left, times = {}, {}
    for shaping in (OFF, ZV, ZVD):
        trip = Trip(shaping, hoist=height, **{axis: 9000.0})
        times[shaping] = trip.go({axis: 9000.0 + way})
        left[shaping] = trip.sway(axis)
        assert abs(trip.axes[axis].axis.position - 9000.0 - way) < 5.5 and trip.far[axis] < abs(way) + 2
    assert left[ZVD] < 6 and left[ZV] < max(20.0, 0.05 * left[OFF])
    assert times[OFF] < times[ZV] < times[ZVD]


@pytest.mark.sweep(8)
def test_both_axes_are_shaped_together_and_the_hoist_never() -> None:
    trips = {shaping: Trip(shaping) for shaping in (OFF, ZVD)}
    for trip in trips.values():
        trip.go({"trolley": 11000.0, "bridge": 18000.0})
    assert all(trips[ZVD].sway(axis) < 6 < 50 < trips[OFF].sway(axis) for axis in SWAYING)
    hoisting = {shaping: Trip(shaping).go({"hoist": 9000.0}) for shaping in (OFF, ZVD)}
    assert hoisting[OFF] == hoisting[ZVD]


@pytest.mark.parametrize("fault", [0, training.EMERGENCY_STOP])
def test_what_stops_a_shaped_move_is_not_shaped_and_nothing_of_it_is_held(fault: int) -> None:
    trip, axis = Trip(ZVD), "trolley"
    while trip.axes[axis].speed < 400:
        trip.step({axis: 14000.0})
    at, data = trip.axes[axis].axis.position, trip.axes[axis].axis.data
    for _ in range(round(8 / DT)):
        trip.step({}, fault)
    ramp = 420.0**2 / (2 * data.deceleration) + 420.0 * 0.4
    assert trip.axes[axis].speed == 0 and trip.axes[axis].axis.position - at < ramp
    stood = trip.axes[axis].axis.position
    for _ in range(50):
        trip.step({})
    assert trip.axes[axis].axis.position == stood
    if not fault:
        trip.go({axis: 14000.0})
        assert abs(trip.axes[axis].axis.position - 14000.0) < 5.5


@pytest.mark.sweep(8)
@pytest.mark.parametrize("periods", [(0.02,), (0.05,), (0.01, 0.04, 0.04, 0.05, 0.03)])
def test_scans_of_another_length_leave_the_load_as_still(periods: tuple[float, ...]) -> None:
    trip, scan = Trip(ZVD), 0
    while trip.step({"trolley": 11000.0}, dt=periods[scan % len(periods)]) != [MovePhase.DONE]:
        scan += 1
        assert trip.seconds < ENOUGH
    assert trip.sway("trolley") < 6 and abs(trip.axes["trolley"].axis.position - 11000.0) < 5.5


def test_an_axis_that_is_there_is_not_moved() -> None:
    trip = Trip(ZVD)
    assert trip.step({"trolley": STAND_AT["trolley"] + 3.0}) == [MovePhase.DONE] and not trip.travel.asked


@pytest.mark.parametrize("shaping", [OFF, ZVD])
def test_the_setting_counts_in_the_cycle_of_the_crane(shaping: float) -> None:
    stand = Stand(settings={"sway_shaping": shaping})
    stand.put("trolley", 13000.0)
    stand.cycle()
    crane = stand.crane
    stand.until(lambda: crane.cycle.step is Step.BELOW_LOCK, 100)
    swing = crane.load.swings["trolley"].amplitude(crane.load.rope.top - crane.axes["hoist"].axis.position)
    assert (swing < 6) if shaping else (swing > 50)
    assert crane.cycle.state is StepState.RUNNING and stand.ask(CraneCommand.SUSPEND)
