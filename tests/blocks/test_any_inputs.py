"""Whatever a scan brings, in whatever order: a block's commands are finite, within their limits, and 0 unless it says that it moves."""

from collections.abc import Mapping
from math import isfinite
from random import Random

import pytest

from app.blocks.arc_positioner import following
from app.blocks.arc_positioner.circle import Point
from app.blocks.arc_positioner.following import TRAVELS, ArcFollower, AxisLimits
from app.blocks.drive_control import DriveControl, DriveInputs, State, Times
from app.blocks.joystick import Joystick, Lever
from app.blocks.limit_switches import LimitSwitches, Switches, SwitchPlaces
from app.blocks.positioner import positioner
from app.blocks.positioner.positioner import Positioner
from app.blocks.sway_shaper import Shaping, SwayShaper
from app.profidrive.scaling import Scaling
from app.profidrive.words import Control, Status

DT = 0.01
SCANS = 1500


def scans(seed: int) -> tuple[Random, range]:
    return Random(seed), range(SCANS)


@pytest.mark.parametrize("seed", range(10))
def test_positioner(seed: int) -> None:
    random, times = scans(seed)
    block = Positioner(
        660.4, 110.0, 165.0, random.choice((0.0, 50.0)), random.choice((0.0, 200.0)), lag=random.random() / 2
    )
    at = positioner.MoveInputs(False, 0.0, 0.0, 0.0, 100.0)
    for _ in times:
        if random.random() < 0.1:
            name = random.choice(at._fields)
            value: object = random.random() < 0.5
            if name in ("position", "target", "speed", "set_speed", "held"):
                value = random.choice((0.0, random.uniform(-1e4, 1e4), at.target, random.uniform(-5, 5)))
            at = at._replace(**{name: value})  # type: ignore[arg-type]
        out = block.step(at, DT)
        assert abs(out.speed) <= min(660.4, abs(at.set_speed)) and 0 <= out.percent <= 100
        assert (out.forward, out.reverse) == (out.speed > 0, out.speed < 0)
        assert not out.speed or (at.start and out.phase in (positioner.MovePhase.TRAVEL, positioner.MovePhase.SLOW))
        assert not (out.speed > 0 and at.stop_max) and not (out.speed < 0 and at.stop_min)


@pytest.mark.parametrize("seed", range(10))
def test_arc_follower(seed: int) -> None:
    random, times = scans(seed)
    block = ArcFollower(AxisLimits(660.4, 110.0, 220.0, 0.1, 0.3), AxisLimits(132.08, 44.0, 88.0, 0.1, 0.08))
    at = following.ArcInputs(False, Point(3000.0, 0.0), 0.0, 90.0, 3000.0, 100.0)
    new: Mapping[str, object] = {}
    for n in times:
        if random.random() < 0.06 or n < 3:
            new = {
                "start": random.random() < 0.7 and n > 2,
                "take_zero": random.random() < 0.3 or n == 1,
                "hold": random.random() < 0.2,
                "stop_switch": random.random() < 0.05,
                "brakes_open": (random.random() < 0.9, random.random() < 0.9),
                "start_angle": random.choice((0.0, random.uniform(-400, 400))),
                "end_angle": random.choice((0.0, 90.0, random.uniform(-400, 400))),
                "set_speed": random.choice((100.0, random.uniform(0.01, 1000))),
                "radius": random.choice((3000.0, 3000.0, random.uniform(1, 1e5))),
                "rope_strain": random.choice((0.0, 0.002)),
            }
            at = at._replace(**new)  # type: ignore[arg-type]
        out = block.step(at, DT)
        follows = random.random() < 0.98
        at = at._replace(
            position=Point(at.position.x + out.speed.x * DT, at.position.y + out.speed.y * DT)
            if follows
            else Point(at.position.x + random.uniform(-30, 30), at.position.y)
        )
        assert all(map(isfinite, out.speed)) and abs(out.speed.x) <= 660.4 and abs(out.speed.y) <= 132.08
        assert min(out.percent) >= 0 and max(out.percent) <= 100
        moves = out.speed != (0.0, 0.0)
        assert not moves or (out.phase in TRAVELS and out.run)
        assert not moves or (all(at.brakes_open) and not at.stop_switch)
        assert (out.fault is not following.Fault.NONE) == (out.phase is following.ArcPhase.FAULT)


@pytest.mark.parametrize("seed", range(10))
def test_drive_control(seed: int) -> None:
    random, times = scans(seed)
    block = DriveControl(Scaling(132.08), Times(1.0, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5))
    good = Status.READY_TO_SWITCH_ON | Status.NO_COAST_STOP | Status.NO_QUICK_STOP
    at = DriveInputs(good, 0.0, (False, False), False)
    out = block.safe()
    for _ in times:
        if random.random() < 0.1:
            # a drive and brakes that mostly do what they are told
            on = bool(out.control & Control.ON)
            at = DriveInputs(
                random.choice(
                    (None, good, random.randrange(0x10000), *[good | (Status.OPERATION_ENABLED if on else 0)] * 9)
                ),
                random.choice((0.0, out.reference, random.uniform(-200, 200))),
                random.choice(
                    ((out.open_brakes,) * 2, (out.open_brakes,) * 2, (True, False), (False, True), (True, True))
                ),
                random.random() < 0.7,
                random.uniform(-1e6, 1e6),
                emergency_ok=random.random() < 0.95,
                run_permissive=random.random() < 0.95,
                temperature_ok=random.random() < 0.95,
                acknowledge=random.random() < 0.3,
            )
        out = block.step(at, DT)
        torque = at.status is not None and bool(at.status & Status.OPERATION_ENABLED)
        assert abs(out.setpoint) <= 0x4000 and abs(out.reference) <= 132.08
        assert not out.setpoint or (out.state is State.RUNNING and all(at.brakes_open) and torque and out.open_brakes)
        assert not out.setpoint or (at.run and at.emergency_ok and at.run_permissive and at.temperature_ok)
        assert not out.open_brakes or torque
        assert at.emergency_ok or not out.control & Control.NO_QUICK_STOP
        assert out.control & Control.BY_PLC and 0 <= out.control <= 0xFFFF


@pytest.mark.parametrize("seed", range(5))
def test_limit_switches_joystick_and_shaper(seed: int) -> None:
    random, times = scans(seed)
    limits = LimitSwitches(SwitchPlaces(0.0, 1000.0, 9000.0, 10000.0, 100.0, 20.0))
    stick = Joystick({"hoist": (20.0, 50.0, 100.0, 132.0), "trolley": (80.0, 200.0, 400.0, 660.0)})
    shaper = SwayShaper(30000.0, DT)
    for n in times:
        low, high = (Switches(random.random() < 0.2, random.random() < 0.1) for _ in "lh")
        at = random.choice((None, random.uniform(-3000, 13000)))
        allowed = limits.step(low, high, at, acknowledge=random.random() < 0.2)
        assert allowed.low in (0.0, 20.0, float("inf")) and allowed.high in (0.0, 20.0, float("inf"))
        assert not (low.stop and allowed.low) and not (high.stop and allowed.high)
        levers = {name: Lever(random.choice((0, 0, 0, 1, -1)), random.randrange(-1, 7)) for name in stick.steps}
        moved = stick.step(levers, n if random.random() < 0.9 else 0, DT, allowed=random.random() < 0.95)
        held = [name for name, lever in levers.items() if lever.direction]
        assert not moved.speed or (held == [moved.axis] and moved.speed * levers[moved.axis].direction > 0)
        shaped = shaper.step(random.uniform(-700, 700), random.uniform(-10, 1e5), random.choice((None, *Shaping)))
        assert abs(shaped.speed) <= 700 and isfinite(shaped.held) and shaped.delay >= 0
