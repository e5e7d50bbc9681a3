"""The circle that a lift follows."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.blocks.arc_positioner.circle import Circle, Point
from app.blocks.arc_positioner.following import ArcFollower, ArcInputs, ArcPhase, Fault
from tests.blocks.arc_positioner.stand import X, Y


def test_no_circle_and_a_place_beside_it_are_refused_by_name() -> None:
    arc, circle = ArcFollower(X, Y), Circle(0.0, 0.0, 3000.0)
    at = ArcInputs(False, circle.at(0), 0, 90, 3000.0, 100.0)
    arc.step(at, 0.01)
    assert arc.step(at._replace(start=True), 0.01).fault is Fault.NO_CIRCLE
    arc.step(at, 0.01)
    arc.step(at._replace(take_zero=True), 0.01)
    assert arc.step(at._replace(start=True, radius=2000.0), 0.01).fault is Fault.NO_CIRCLE
    arc.step(at, 0.01)
    for beside, end in ((101.0, 90), (-101.0, 90), (60.0, 20)):
        place = Point(3000.0 + beside, 0.0)
        out = arc.step(at._replace(start=True, position=place, end_angle=end), 0.01)
        assert (out.phase, out.fault, out.run) == (ArcPhase.FAULT, Fault.OFF_THE_PATH, False)
        arc.step(at, 0.01)
    assert arc.step(at._replace(start=True, position=Point(3060.0, 0.0)), 0.01).fault is Fault.NONE


@given(st.floats(-1e4, 1e4), st.floats(-1e4, 1e4), st.floats(1, 1e4), st.floats(-720, 720), st.floats(-5, 5))
def test_angle_of_a_point_of_the_circle_is_exact_in_every_turn(
    x: float, y: float, radius: float, angle: float, off: float
) -> None:
    circle = Circle(x, y, radius)
    assert circle.angle(circle.at(angle), angle + off) == pytest.approx(angle, abs=1e-6)
    assert Circle.through(circle.at(angle), angle, radius).at(0.0) == pytest.approx(circle.at(0.0), abs=1e-6)
    assert circle.radial_error(Circle(x, y, radius + off).at(angle)) == pytest.approx(
        max(off, -2 * radius - off), abs=1e-6
    )
