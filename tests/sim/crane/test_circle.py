"""The circular move of the crane through its drives and brakes, while the rope takes up its load or gives it back."""

from math import isnan

import pytest

from app.blocks.arc_positioner.circle import Circle, Point
from app.blocks.arc_positioner.following import Fault
from app.sim.crane.configuration import AXES, SETTINGS, Places
from app.sim.crane.ladle import FULL, Load
from app.sim.crane.plc_axis import HOT, Asked, PlcAxis, Surroundings
from app.sim.crane.travel import FASTEST_STRETCH, STRAIN, TOP, Travel

DT = 0.02
"""Of the program on a circle [s]."""
MOST = 2.0
"""Path error that is allowed [mm]."""
PLACES = Places(stand_1_trolley=12000.0, stand_1_hoist=8000.0)
"""Room for six metres."""
LIFT, LOWERING = (0.0, 90.0), (90.0, 0.0)
RADII, SPEEDS, LADLES = (1000.0, 3000.0, 6000.0), (10.0, 60.0, 120.0, 200.0), (60.0, 210.0, 354.0)


class Arc:
    """Trolley and hoist with a ladle that comes off its stand, or is set down on it."""

    def __init__(self, angles: tuple[float, float], radius: float, speed: float, ladle: float) -> None:
        settings = {setting.name: setting.default for setting in SETTINGS}
        settings |= {"arc_radius": radius, "arc_speed": speed}
        lock, lowers = PLACES.stand(1), angles == LOWERING
        start = {**lock, "trolley": lock["trolley"] - radius * lowers, "hoist": lock["hoist"] + radius * lowers}
        self.angles, self.circle = angles, Circle.through(Point(start["trolley"], start["hoist"]), angles[0], radius)
        strain = STRAIN * ladle / FULL * lowers
        start["hoist"] = (start["hoist"] + strain * TOP) / (1 + strain)
        self.axes = {name: PlcAxis(name, settings, PLACES, start[name]) for name in AXES}
        self.travel = Travel(self.axes, settings, 0.04)
        self.load = Load(PLACES, ladle, 0 if lowers else 1, locked=True, at=1, share=float(lowers))
        self.load.rope.load = self.load.hanging / FULL
        self.load.rope.settle(start["hoist"])
        self.radial = self.along = 0.0
        """Greatest errors: of the true load beside the true circle, and from where the plan has it by now [mm]."""
        for _ in range(50):
            self.step(go=False)
        self.travel.lay(self.circle)

    def step(self, *, go: bool = True) -> bool:
        """One scan; whether the load is there."""
        travel, axes = self.travel, self.axes
        before = {name: axis.speed for name, axis in axes.items()}
        travel.begin(self.load.hanging / FULL, DT)
        done = go and travel.circle_to(self.angles, False, DT)
        travel.end(DT)
        for name, axis in axes.items():
            axis.step(
                travel.asked.get(name, Asked()), Surroundings(True, True, True, False, 0, self.load.rope.load), DT
            )
        speed = {name: axis.speed for name, axis in axes.items()}
        at = {name: axis.axis.position for name, axis in axes.items()}
        self.load.step(at, speed, {name: speed[name] - before[name] for name in axes}, DT)
        if go:
            true = Point(at["trolley"], at["hoist"] - self.load.rope.stretch)
            self.radial = max(self.radial, abs(self.circle.radial_error(true)))
            self.along = travel.worst
        return done

    def run(self) -> float:
        """To the end; gives how long it took [s]."""
        scans = 0
        while not self.step():
            scans += 1
            assert self.travel.fault is Fault.NONE and scans * DT < 1200
        return scans * DT


@pytest.mark.sweep(8)
@pytest.mark.parametrize("angles", [LIFT, LOWERING])
@pytest.mark.parametrize(
    ("radius", "speed", "ladle"),
    [
        *((3000.0, 200.0, ladle) for ladle in LADLES),
        *((1000.0, speed, 354.0) for speed in (60.0, 200.0)),
        *(
            pytest.param(radius, speed, ladle, marks=pytest.mark.soak)
            for radius in RADII
            for speed in SPEEDS
            for ladle in LADLES
        ),
    ],
)
def test_the_load_stays_within_two_millimetres_while_the_rope_takes_it_up(
    angles: tuple[float, float], radius: float, speed: float, ladle: float
) -> None:
    arc = Arc(angles, radius, speed, ladle)
    arc.run()
    assert arc.radial <= MOST and arc.along <= MOST, (arc.radial, arc.along)
    assert (arc.load.stand, arc.load.share > 0.99) == ((0, True) if angles == LIFT else (1, False))


def test_after_a_path_fault_the_load_goes_on_from_where_it_stands() -> None:
    arc = Arc(LIFT, 1000.0, 100.0, 210.0)
    for _ in range(400):
        arc.step()
    motor = arc.axes["hoist"].motors[1]
    motor.temperature = HOT + 20
    while arc.travel.fault is Fault.NONE:
        arc.step()
    assert arc.travel.fault is Fault.BRAKE_LOST
    motor.temperature = 40.0
    for _ in range(200):
        arc.step(go=False)
    assert arc.travel.fault is Fault.BRAKE_LOST, "told until it goes on"
    assert not any(axis.speed for axis in arc.axes.values())
    arc.run()
    assert abs(arc.travel.angle - LIFT[1]) < 0.1


@pytest.mark.sweep(8)
@pytest.mark.parametrize("angles", [LIFT, LOWERING])
@pytest.mark.parametrize(("beside", "left"), [(-40.0, 0.5), (15.0, 4.0), (25.0, 30.0)])
def test_a_load_that_stands_beside_the_end_of_the_circle_goes_back_to_it_first(
    angles: tuple[float, float], beside: float, left: float
) -> None:
    arc = Arc(angles, 1000.0, 100.0, 210.0)
    while abs(arc.travel.angle - angles[1]) > left + 5 or isnan(arc.travel.angle):
        arc.step()
    for _ in range(200):
        arc.step(go=False)
    arc.axes["hoist"].axis.position += beside  # by hand
    arc.axes["trolley"].axis.position += beside
    for _ in range(50):
        arc.step(go=False)
    arc.travel.worst = 0.0
    arc.run()
    assert abs(arc.travel.angle - angles[1]) < 0.1
    assert arc.travel.worst <= MOST


def test_a_scale_that_fails_or_leaps_moves_the_load_no_faster_than_a_rope_stretches() -> None:
    arc = Arc(LIFT, 3000.0, 60.0, 210.0)
    while arc.load.share < 0.5:
        arc.step()
    before, travel = arc.travel.load_at, arc.travel
    travel.begin(float("nan"), DT)
    assert travel.load_at == before
    travel.circle_to(LIFT, False, DT)
    known = travel.asked["hoist"].speed
    travel.begin(1.0, DT)  # it is back, and says something else: no rope is stretched so fast
    travel.begin(0.0, DT)
    travel.circle_to(LIFT, False, DT)
    assert abs(travel.asked["hoist"].speed - known) < FASTEST_STRETCH + 15
