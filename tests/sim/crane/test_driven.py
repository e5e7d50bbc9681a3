"""No order of commands, no fault and no timing moves an axis against its brake, opens a brake without torque, or passes a stop switch."""

from random import Random

import pytest

from app.blocks.drive_control import State, Times
from app.blocks.limit_switches import End, LimitAlarm, SwitchPlaces
from app.profidrive.state_machine import Reaction
from app.profidrive.words import Status
from app.sim.crane.axis import AxisData
from app.sim.crane.driven import DrivenAxis, Faults
from app.sim.crane.figures import HOIST

DT = 0.02
DATA = AxisData.of(HOIST).with_(acceleration=352.0, deceleration=352.0, brake_release=0.2, brake_close=0.1)
"""The hoist with ramps eight times as steep on a way of 400 mm, so that a run of seconds has many movements and gets to its ends."""
PLACES = SwitchPlaces(0.0, 60.0, 340.0, 400.0, 15.0, 20.32)
TIMES = Times(preset_hold=1.0, brake_open=0.6, magnetising=1.2, start=0.6, stop=2.0, brake_close=0.5, quick_stop=0.8)
CREEP = 9.0
"""Farthest beyond a stop switch from the slow speed: a trip there, 0.12 s of falling until the brake holds, and the brake's way [mm]."""
FULL = 50.0
"""The same from the full speed: the slow-down switch is dead, and the drive trips just there [mm]."""
RUNS = 100
"""Of each seed."""
SPEEDS = (0.0, 0.0, 20.32, 50.8, 132.08, 132.08)


class Runs:
    """A random run, and what has to hold in each of its scans."""

    def __init__(self, seed: int) -> None:
        self.random = random = Random(seed)
        self.axis = DrivenAxis(DATA, PLACES, random.uniform(5.0, 395.0), TIMES)
        self.faults = self.axis.faults
        self.speed, self.run, self.acknowledge = 0.0, False, False
        self.moved = self.against = 0.0
        self.way = random.choice((1, -1))
        self.limit = self.dropped = False
        if random.random() < 0.3:
            # the switches are good or bad from the beginning, and one thing is bad at a time
            name = random.choice(["slow_dead", "stop_dead"])
            setattr(self.faults, name, True)
        self.kinds = ["emergency", "no_permissive", "hot", "no_communication", "trip", "feedback", "stuck"]
        if not (self.faults.slow_dead or self.faults.stop_dead):
            self.kinds.append("encoder")

    def go(self, scans: int) -> None:
        for _ in range(scans):
            if self.random.random() < 0.03:
                self.event()
            self.acknowledge = self.acknowledge and self.random.random() < 0.8
            self.scan()

    def event(self) -> None:
        random, faults = self.random, self.faults
        match random.choice(["speed", "speed", "speed", "acknowledge", "fault", "heal", "heal"]):
            case "speed":
                self.speed = random.choice(SPEEDS) * (self.way if random.random() < 0.75 else -self.way)
                self.run = self.speed != 0 or random.random() < 0.1
            case "acknowledge":
                self.acknowledge = True
            case "fault":
                match random.choice(self.kinds):
                    case "trip":
                        self.axis.drive.cause = random.choice(list(Reaction))
                    case "feedback":
                        faults.feedback = False
                    case "stuck":
                        self.axis.axis.stuck = True
                    case name:
                        setattr(faults, name, True)
            case "heal":
                self.axis.drive.cause, self.axis.axis.stuck, faults.feedback = None, False, None
                for name in ("emergency", "no_permissive", "hot", "no_communication", "encoder"):
                    setattr(faults, name, False)

    def scan(self) -> None:
        driven = self.axis
        before, axis = driven.axis.position, driven.axis
        out = driven.step(self.speed, DT, run=self.run, acknowledge=self.acknowledge)
        seen = driven.seen
        torque = seen.status is not None and bool(seen.status & Status.OPERATION_ENABLED)
        if out.open_brakes:
            assert torque, "a brake is commanded open without torque"
        if out.setpoint:
            assert all(seen.brakes_open) and out.open_brakes and torque, "a reference with a closed brake"
            assert seen.emergency_ok and seen.run_permissive and seen.temperature_ok and seen.run
            assert not driven.control.alarms
            assert out.setpoint * driven.allowed.limit(float(out.setpoint)) > 0, "a reference into a limit"
            assert -driven.allowed.low - 0.01 <= out.reference <= driven.allowed.high + 0.01
        talks = not self.faults.no_communication
        self.against = self.against + DT if talks and out.setpoint and not axis.is_open else 0.0
        assert self.against <= DT, "the drive pulls against its brake"
        self.moved += abs(axis.position - before)
        self.limit |= any(driven.limits.alarms.values())
        beyond = max(axis.position - PLACES.high_stop, PLACES.low_stop - axis.position)
        room = FULL if self.faults.slow_dead else PLACES.tolerance + CREEP if self.faults.stop_dead else CREEP
        assert abs(axis.speed) < 1.2 * DATA.max_speed, "falls"
        # a brake stuck open under a drive without torque is two faults: that load is caught by the safety brake alone
        self.dropped |= axis.stuck and not axis.holds and not driven.drive.machine.pulses
        assert beyond <= room or self.dropped, "passes the stop switch"
        if beyond > 0 and not self.faults.stop_dead and not axis.speed and not self.dropped:
            end = End.HIGH if axis.position > PLACES.high_stop else End.LOW
            assert LimitAlarm.STOP_HIT in driven.limits.alarms[end]


@pytest.mark.sweep(8)
@pytest.mark.parametrize("seed", range(6))
def test_no_order_fault_or_timing_moves_it_where_it_must_not(seed: int) -> None:
    moved, limits = 0.0, 0
    for one in range(RUNS):
        run = Runs(1000 * seed + one)
        run.go(400)
        moved += run.moved
        limits += run.limit
    assert moved > RUNS * 50.0 and limits > RUNS / 20, "and it does move, and gets to its limits"


@pytest.mark.soak
@pytest.mark.parametrize("seed", range(100, 140))
def test_thousands_of_runs_move_it_nowhere_it_must_not_be(seed: int) -> None:
    for one in range(100):
        Runs(1000 * seed + one).go(2000)


def test_moves_at_full_speed_into_the_limit_and_back() -> None:
    driven = DrivenAxis(AxisData.of(HOIST), SwitchPlaces(300, 1300, 33080, 34080, 500, 20.32), 32500.0)
    seen = []
    for _ in range(50):
        driven.step(0.0, 0.01)
    for _ in range(9000):
        seen.append((driven.axis.position, driven.axis.speed))
        driven.step(132.08, 0.01)
    assert max(speed for _, speed in seen) == pytest.approx(132.08, abs=0.1)
    assert max(speed for at, speed in seen if at > 33080 + 215) <= 20.4
    assert 34080 <= driven.axis.position < 34080 + 10 and not driven.axis.speed
    assert driven.limits.active == [(End.HIGH, LimitAlarm.STOP_HIT)]
    for _ in range(50):
        driven.step(0.0, 0.01)
    for n in range(3000):
        driven.step(-50.8, 0.01, acknowledge=n % 100 == 0)
    assert driven.axis.position < 33000 and not driven.limits.active
    assert driven.axis.strain == 0.0


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("fault", "alarm", "where"),
    [("slow_dead", LimitAlarm.SLOW_FAILED, 33080 + 500 + 230), ("stop_dead", LimitAlarm.STOP_FAILED, 34080 + 500 + 10)],
)
def test_a_switch_that_does_not_answer_is_found_by_position_and_stops_the_axis(
    fault: str, alarm: LimitAlarm, where: float
) -> None:
    driven = DrivenAxis(
        AxisData.of(HOIST), SwitchPlaces(300, 1300, 33080, 34080, 500, 20.32), 32500.0, faults=Faults(**{fault: True})
    )
    for n in range(9000):
        driven.step(132.08 if n > 50 else 0.0, 0.01)
    assert (End.HIGH, alarm) in driven.limits.active and not driven.allowed.healthy
    assert not driven.axis.speed and driven.axis.position < where


def test_an_encoder_that_fails_leaves_the_lowest_speed() -> None:
    driven = DrivenAxis(AxisData.of(HOIST), SwitchPlaces(300, 1300, 33080, 34080, 500, 20.32), 15000.0)
    driven.faults.encoder = True
    for n in range(1500):
        driven.step(132.08 if n > 50 else 0.0, 0.01)
    assert driven.axis.speed == pytest.approx(20.32, abs=0.1) and driven.out.state is State.RUNNING
