"""The motor model against the catalogue values of the reference sheet, and against its own energy."""

from math import pi

import pytest

from app.sim.induction_motor import MOTOR_SETS, InductionMotor, MotorData, operating_point, rated_point

SETS = list(MOTOR_SETS.items())
BOTH = pytest.mark.parametrize("data", MOTOR_SETS.values(), ids=MOTOR_SETS)


def ran_up(data: MotorData, load: float, *, dt: float = 0.01, seconds: float = 4.0) -> InductionMotor:
    """`data` started by a ramp of 1 s and left to settle under `load` [Nm]."""
    motor = InductionMotor(data)
    for step in range(round(seconds / dt)):
        frequency = min(50.0, 50.0 * (step + 1) * dt)
        motor.step(12 + 218 * frequency / 50, frequency, load, 0.0, dt)
    return motor


@pytest.mark.parametrize(("connection", "volts"), [("star", 400.0), ("delta", 230.0)])
@pytest.mark.parametrize(
    ("name", "slip", "star_current", "cos_phi", "efficiency", "torque"),
    [("A", 0.070, 1.94, 0.755, 0.738, 5.13), ("B", 0.0407, 1.71, 0.766, 0.824, 4.98)],
)
def test_rated_point_is_the_nameplate(
    name: str,
    slip: float,
    star_current: float,
    cos_phi: float,
    efficiency: float,
    torque: float,
    connection: str,
    volts: float,
) -> None:
    data = MOTOR_SETS[name]
    point = rated_point(data, volts, "star" if connection == "star" else "delta")
    assert point.slip == pytest.approx(slip, abs=0.001)
    assert point.current == pytest.approx(star_current * (1 if connection == "star" else 3**0.5), rel=0.01)
    assert point.cos_phi == pytest.approx(cos_phi, abs=0.005)
    assert point.power_shaft / point.power_in == pytest.approx(efficiency, abs=0.005)
    assert point.power_shaft / data.rated_angular_speed == pytest.approx(torque, rel=0.01)


@pytest.mark.parametrize(("name", "no_load"), [("A", 1.32), ("B", 1.09)])
def test_no_load_current(name: str, no_load: float) -> None:
    data = MOTOR_SETS[name]
    assert operating_point(data, 400.0, 50.0, 0.0005, "star").current == pytest.approx(no_load, rel=0.01)
    motor = ran_up(data, load=0.0)
    assert motor.point.current == pytest.approx(no_load * 3**0.5, rel=0.02)
    assert 0 < motor.point.slip < 0.005


@pytest.mark.parametrize(
    ("name", "start_current", "start_torque", "pull_out", "at_slip"),
    [("A", 4.2, 2.1, 2.6, 0.47), ("B", 6.1, 2.6, 3.5, 0.37)],
)
def test_locked_rotor_and_pull_out(
    name: str, start_current: float, start_torque: float, pull_out: float, at_slip: float
) -> None:
    data = MOTOR_SETS[name]
    locked = operating_point(data, 400.0, 50.0, 1.0, "star")
    assert locked.current / data.rated_current == pytest.approx(start_current, rel=0.02)
    assert locked.torque / data.rated_torque == pytest.approx(start_torque, rel=0.05)
    slips = [step / 1000 for step in range(1, 1001)]
    best = max(slips, key=lambda slip: operating_point(data, 400.0, 50.0, slip, "star").torque)
    assert best == pytest.approx(at_slip, abs=0.06)
    peak = operating_point(data, 400.0, 50.0, best, "star").torque
    assert peak / data.rated_torque == pytest.approx(pull_out, rel=0.03)
    assert InductionMotor(data, connection="star").pull_out_torque(400.0, 50.0) == pytest.approx(peak, rel=1e-4)


@BOTH
def test_rated_load_settles_at_rated_speed(data: MotorData) -> None:
    motor = ran_up(data, load=data.rated_torque)
    assert motor.speed * 30 / pi == pytest.approx(data.rated_speed, abs=4)
    assert motor.point.current == pytest.approx(data.rated_current_delta, rel=0.02)


@BOTH
def test_more_load_more_slip_more_current(data: MotorData) -> None:
    points = [ran_up(data, load=part * data.rated_torque).point for part in (0.0, 0.5, 1.0, 1.5)]
    assert [p.slip for p in points] == sorted(p.slip for p in points)
    assert [p.current for p in points] == sorted(p.current for p in points)
    assert points[3].slip > 1.4 * points[2].slip


@BOTH
@pytest.mark.parametrize("volts", [60.0, 150.0, 230.0])
@pytest.mark.parametrize("frequency", [0.5, 5.0, 25.0, 50.0, 70.0])
@pytest.mark.parametrize("slip", [-0.3, -0.02, 0.0, 0.03, 0.3, 1.0, 1.8])
def test_what_goes_in_comes_out_or_is_lost(data: MotorData, volts: float, frequency: float, slip: float) -> None:
    point = operating_point(data, volts, frequency, slip)
    assert point.power_in == pytest.approx(point.power_shaft + point.losses, rel=1e-9, abs=1e-9)
    assert min(point.stator_loss, point.iron_loss, point.rotor_loss, point.friction_loss) >= 0


@BOTH
def test_kinetic_energy_is_the_work_of_the_shaft(data: MotorData) -> None:
    dt = 0.001
    motor = InductionMotor(data, load_inertia=0.01)
    work = 0.0
    for step in range(1000):
        frequency = max(0.05, 50.0 * step * dt)
        point = motor.step(12 + 218 * frequency / 50, frequency, 0.0, 0.0, dt)
        work += point.power_shaft * dt
    assert work == pytest.approx(0.5 * motor.inertia * motor.speed**2, rel=0.01)


@BOTH
def test_overload_beyond_pull_out_stalls_with_the_locked_current(data: MotorData) -> None:
    motor = ran_up(data, load=0.5 * data.rated_torque)
    for _ in range(200):
        motor.step(230.0, 50.0, 4 * data.rated_torque, 0.0, 0.01)
    assert motor.speed == 0.0
    assert motor.point.slip == 1.0
    assert motor.point.current == pytest.approx(operating_point(data, 230.0, 50.0, 1.0).current)


def test_breakaway_holds_the_shaft_until_the_torque_suffices() -> None:
    motor = InductionMotor(MOTOR_SETS["A"])
    weak = [motor.step(6.0, 1.0, 2.0, 0.0, 0.01, breakaway=2.5) for _ in range(50)]
    assert motor.speed == 0.0
    assert weak[-1].torque < 2.5
    for _ in range(50):
        motor.step(40.0, 3.0, 2.0, 0.0, 0.01, breakaway=2.5)
    assert motor.speed > 0


@BOTH
def test_coasts_to_a_stop_and_stays(data: MotorData) -> None:
    motor = ran_up(data, load=1.0)
    speeds = []
    for _ in range(200):
        motor.step(0.0, 1.0, 1.0, 0.0, 0.01)
        speeds.append(motor.speed)
    assert speeds == sorted(speeds, reverse=True)
    assert speeds[-1] == 0.0
    assert motor.point.current == 0.0


@BOTH
@pytest.mark.parametrize("load", [0.0, 2.0, 5.0])
def test_10_ms_is_stable_and_agrees_with_1_ms(data: MotorData, load: float) -> None:
    coarse, fine = ran_up(data, load, dt=0.01), ran_up(data, load, dt=0.001)
    assert coarse.speed == pytest.approx(fine.speed, rel=1e-4)
    tail = [coarse.step(230.0, 50.0, load, 0.0, 0.01).torque for _ in range(100)]
    assert max(tail) - min(tail) < 1e-3


def test_scan_period_does_not_move_the_run_up() -> None:
    for seconds in (0.3, 0.6, 0.9):
        data = MOTOR_SETS["B"]
        coarse = ran_up(data, 2.0, dt=0.01, seconds=seconds).speed
        fine = ran_up(data, 2.0, dt=0.002, seconds=seconds).speed
        assert coarse == pytest.approx(fine, abs=1.0)


@BOTH
def test_reverse_mirrors_forward(data: MotorData) -> None:
    forward, reverse = InductionMotor(data), InductionMotor(data)
    for step in range(300):
        frequency = max(0.05, min(50.0, step * 0.5))
        a = forward.step(12 + 4.36 * frequency, frequency, 2.0, 0.0, 0.01)
        b = reverse.step(12 + 4.36 * frequency, -frequency, 2.0, 0.0, 0.01)
        assert a == b
        assert forward.speed == -reverse.speed
    assert forward.speed > 100


@BOTH
def test_braking_by_the_field_gives_power_back(data: MotorData) -> None:
    motor = InductionMotor(data, load_inertia=0.05)
    motor.settle(230.0, 50.0, 0.0, 0.0)
    point = motor.step(180.0, 40.0, 0.0, 0.0, 0.01)
    assert point.power_in < 0
    assert point.torque < 0


@pytest.mark.parametrize("current", [0.8, 2.5, 4.5, 20.0])
@BOTH
def test_another_size_keeps_slip_cos_phi_and_efficiency(data: MotorData, current: float) -> None:
    sized, table = rated_point(data.sized(current), 230.0), rated_point(data, 230.0)
    assert sized.current == pytest.approx(current, rel=0.005)
    assert (sized.slip, sized.cos_phi) == pytest.approx((table.slip, table.cos_phi))
    assert sized.power_shaft / sized.power_in == pytest.approx(table.power_shaft / table.power_in)


def test_star_on_230_v_has_a_third_of_the_torque() -> None:
    data = MOTOR_SETS["A"]
    delta, star = InductionMotor(data), InductionMotor(data, connection="star")
    assert star.pull_out_torque(230.0, 50.0) == pytest.approx(delta.pull_out_torque(230.0, 50.0) / 3)


@BOTH
def test_settled_start_does_not_move(data: MotorData) -> None:
    motor = InductionMotor(data, load_inertia=0.02)
    point = motor.settle(200.0, -40.0, 1.0, 1e-4)
    assert -126 < motor.speed < -115
    assert motor.step(200.0, -40.0, 1.0, 1e-4, 0.01).torque == pytest.approx(point.torque, abs=1e-4)
