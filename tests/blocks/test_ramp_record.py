"""What was recorded of a ramp is the way that it went."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.blocks.ramp_record import Moment, Phase, RampRecord, RampRecorder, RampState, curve, distance
from app.blocks.s_ramp import SRamp

DT = 0.01
LIMITS = st.tuples(st.sampled_from([5.0, 60.0, 500.0]), st.sampled_from([10.0, 240.0, 5000.0]))


class Belt:
    """A ramp with its recorder."""

    def __init__(self, limit: float = 60.0, jerk: float = 240.0) -> None:
        self.ramp, self.recorder, self.now = SRamp(limit, jerk), RampRecorder(), 0
        self.way = 0.0

    def go(self, target: float, cycles: int = 100_000) -> None:
        for _ in range(cycles):
            if self.ramp.speed == target and not self.ramp.acceleration:
                return
            self.recorder.begin(target, self.ramp, self.now)
            before = self.ramp.speed
            self.ramp.step(target, DT)
            self.way += (before + self.ramp.speed) / 2 * DT
            self.recorder.follow(self.ramp)
            self.now += 10_000


def last(record: RampRecord) -> Moment:
    return list(curve(record.speed, record.acceleration, record.phases))[-1]


@pytest.mark.sweep(8)
@given(LIMITS, st.floats(-100, 100).filter(lambda speed: abs(speed) > 0.01))
def test_start_and_stop_are_three_phases_that_end_at_the_target(limits: tuple[float, float], target: float) -> None:
    belt = Belt(*limits)
    belt.go(target)
    way, belt.way = belt.way, 0.0
    belt.go(0.0)
    start, stop = belt.recorder.start, belt.recorder.stop
    assert start and stop
    for record, begin, end in ((start, 0.0, target), (stop, target, 0.0)):
        assert (record.state, record.speed, record.acceleration) == (RampState.COMPLETE, begin, 0.0)
        moment = last(record)
        assert moment.speed == pytest.approx(end, abs=1e-3)
        assert moment.acceleration == pytest.approx(0.0, abs=limits[1] * 1e-5)
        assert {abs(phase.jerk) for phase in record.phases} <= {0.0, limits[1]}
        assert sum(phase.duration for phase in record.phases) == pytest.approx(moment.time)
    rest = abs(target) * DT  # of the cycle in which it arrived
    assert distance(start.speed, start.acceleration, start.phases) == pytest.approx(way, abs=rest + abs(way) * 0.01)


def test_the_example_of_the_thesis_has_25_95_and_25_cycles() -> None:
    belt = Belt(0.25 / DT, 0.01 / DT / DT)
    belt.go(30.0)
    assert belt.recorder.start
    assert [round(phase.duration / DT, 3) for phase in belt.recorder.start.phases] == [25, 95, 25]
    assert [round(phase.jerk * DT * DT, 6) for phase in belt.recorder.start.phases] == [0.01, 0, -0.01]


def test_a_stop_in_mid_start_breaks_it_off_and_begins_with_its_acceleration() -> None:
    belt = Belt()
    belt.go(30.0, 20)
    speed, acceleration = belt.ramp.speed, belt.ramp.acceleration
    assert acceleration > 40
    belt.go(0.0)
    start, stop = belt.recorder.start, belt.recorder.stop
    assert start and stop
    assert (start.state, stop.state) == (RampState.BROKEN_OFF, RampState.COMPLETE)
    assert last(start)[1:] == pytest.approx((speed, acceleration))
    assert (stop.speed, stop.acceleration, stop.began) == (speed, acceleration, 200_000)
    assert last(stop).speed == pytest.approx(0.0, abs=1e-3)


def test_another_speed_is_neither_start_nor_stop() -> None:
    belt = Belt()
    belt.go(30.0)
    first = belt.recorder.start
    belt.go(50.0)
    assert belt.recorder.start is first and belt.recorder.stop is None
    belt.go(0.0)
    assert belt.recorder.stop and belt.recorder.stop.speed == 50.0


def test_a_speed_that_lost_its_supply_is_a_stop_without_a_curve() -> None:
    belt = Belt()
    belt.recorder.cut(belt.ramp, 5)
    assert belt.recorder.stop is None, "it stood"
    belt.go(30.0)
    belt.recorder.cut(belt.ramp, belt.now)
    belt.ramp.reset()
    stop = belt.recorder.stop
    assert stop and (stop.state, stop.speed, stop.phases) == (RampState.CUT_OFF, 30.0, [])
    belt.go(30.0, 10)
    belt.recorder.cut(belt.ramp, belt.now)
    assert belt.recorder.start and belt.recorder.start.state is RampState.CUT_OFF
    assert belt.recorder.stop is stop


def test_limits_that_change_on_the_way_leave_a_record_that_says_so() -> None:
    belt = Belt()
    belt.go(30.0, 10)
    for jerk in (200.0, 100.0, 50.0, 25.0):
        belt.ramp.jerk = jerk
        belt.go(30.0, 3)
    start = belt.recorder.start
    assert start and start.state is RampState.NOT_WHOLE
    assert [phase.jerk for phase in start.phases] == [240.0, 200.0, 100.0]
    belt.go(30.0)
    assert start.state is RampState.NOT_WHOLE


def test_a_curve_has_its_points_and_a_phase_its_end() -> None:
    moments = list(curve(1.0, 2.0, [Phase(2.0, 3.0)], each=2))
    assert moments == [(0.0, 1.0, 2.0), (1.0, 4.5, 5.0), (2.0, 11.0, 8.0)]
    assert distance(1.0, 2.0, [Phase(2.0, 3.0)]) == pytest.approx(2 + 4 + 4)
