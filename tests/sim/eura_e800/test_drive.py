"""The virtual drive as a master and an operator meet it: registers, commands, ramps, parameters, faults."""

import json
from collections.abc import Callable
from contextlib import suppress
from itertools import pairwise
from random import Random

import pytest

from app.errors import ConfigurationError, DeviceException
from app.sim.device import VirtualDevice
from app.sim.eura_e800.drive import VirtualE800
from app.sim.eura_e800.faults import CE, FAULTS, OC, OE, OH, OL1, OL2, PATIENCE
from app.sim.eura_e800.parameters import COMMISSIONED, PARAMETERS, parameter_address
from app.sim.eura_e800.registers import REGISTERS
from app.sim.eura_e800.training import LIMITS

QUIET = {"F905": 0.0}
FORWARD, REVERSE, STOP, COAST, JOG, JOG_STOP, RUN, RESET = 1, 2, 3, 4, 5, 6, 8, 9


def drive(**parameters: float) -> VirtualE800:
    """A drive without watchdog and disturbance."""
    return VirtualE800(parameters=QUIET | parameters, disturbance=0)


def go(device: VirtualE800, seconds: float) -> VirtualE800:
    for _ in range(round(seconds / device.dt)):
        device.step()
    return device


def command(device: VirtualE800, code: int, seconds: float = 0.01) -> VirtualE800:
    device.write(6, 0x2000, [code])
    return go(device, seconds)


def put(device: VirtualE800, code: str, value: float) -> None:
    device.write(6, PARAMETERS[code].address, [PARAMETERS[code].encode(value)])


def inject(device: VirtualE800, code: int) -> None:
    device.write(6, 0xE010, [code])


def refusal(call: Callable[[], object]) -> int:
    """Exception code with which `call` is refused."""
    with pytest.raises(DeviceException) as error:
        call()
    return error.value.code


def image(device: VirtualE800) -> list[int]:
    return device.read(3, 0x1000, 25)


def until(device: VirtualE800, holds: Callable[[], bool], limit: float = 30.0) -> float:
    """Simulated time until `holds` [s]."""
    for count in range(round(limit / device.dt)):
        if holds():
            return count * device.dt
        device.step()
    raise AssertionError(f"not within {limit} s")


# ---- registers


def test_it_is_a_virtual_device() -> None:
    device: VirtualDevice = VirtualE800()
    assert (device.type, device.dt) == ("eura_e800", 0.01)


def test_standstill_shows_temperature_bus_and_identity_only() -> None:
    words = image(go(drive(), 5))
    assert {index for index, word in enumerate(words) if word} == {0x03, 0x04, 0x05, 0x07}
    assert 318 <= words[4] <= 330
    assert words[5] & 0xFF == 0
    assert words[7] == 26


def test_status_has_to_be_masked() -> None:
    word = image(command(drive(), FORWARD))[5]
    assert word & 0xFF == 1
    assert word >> 8


def test_poles_and_start_source_share_a_word() -> None:
    assert image(drive(F804=6))[3] == 0x0604


def test_running_values_belong_together() -> None:
    device = command(drive(), FORWARD, 10)
    words = image(device)
    assert words[0x00] == 5000
    assert 215 <= words[0x01] <= 230
    assert 300 < words[0x02] < 450
    assert words[0x04] < 320
    assert 55 < words[0x06] < 80
    assert 1395 < words[0x17] < 1500
    point = device.motor.point
    assert words[0x18] == round(point.power_in / 100)
    assert point.power_in == pytest.approx(3**0.5 * device.voltage * point.current * point.cos_phi, rel=1e-9)
    assert words[0x17] == round(device.shaft_speed)
    assert point.power_in == pytest.approx(point.power_shaft + point.losses)
    assert words[0x0C] == 1
    assert words[0x15] == 10000


def test_reverse_shows_the_same_positive_numbers() -> None:
    forward, reverse = command(drive(), FORWARD, 10), command(drive(), REVERSE, 10)
    a, b = image(forward), image(reverse)
    assert a[5] & 0xFF == 1
    assert b[5] & 0xFF == 2
    assert a[:5] + a[6:] == b[:5] + b[6:]
    assert forward.shaft_speed == -reverse.shaft_speed


def test_rated_load_draws_rated_current() -> None:
    device = VirtualE800(rated_current=2.5, parameters=QUIET, load=100, quadratic_load=0, disturbance=0)
    command(device, FORWARD, 10)
    assert image(device)[2] == pytest.approx(250, rel=0.03)
    assert image(device)[0x17] == pytest.approx(1395, rel=0.01)
    assert device.parameter("F803") == 2.5


def test_values_stay_alive_at_a_steady_setpoint() -> None:
    device = VirtualE800(parameters=QUIET, start="forward")
    seen = {image(go(device, 1))[2] for _ in range(60)}
    assert len(seen) > 15


def test_every_table_row_is_readable() -> None:
    device = drive()
    assert list(REGISTERS) == list(range(0x1000, 0x1019))
    assert image(device) == [device.read(3, address, 1)[0] for address in REGISTERS]
    for parameter in PARAMETERS.values():
        raw = device.read(3, parameter.address, 1)[0]
        assert parameter.decode(raw) == device.parameter(parameter.code)


def test_more_than_a_word_is_shown_as_the_largest_word() -> None:
    device = command(VirtualE800(rated_current=640, parameters=QUIET), FORWARD, 6)
    assert image(device)[2] == pytest.approx(53000, rel=0.1)
    assert max(image(device)) <= 0xFFFF


# ---- addressing, functions, limits


@pytest.mark.parametrize(
    ("code", "address"),
    [
        ("F111", 267),
        ("F113", 269),
        ("F114", 0x010E),
        ("F203", 0x0203),
        ("F277", 0x024D),
        ("F280", 0x0250),
        ("F810", 0x080A),
        ("F905", 0x0905),
        ("FA00", 0x0A00),
    ],
)
def test_parameter_address_is_group_and_index(code: str, address: int) -> None:
    assert parameter_address(code) == address
    if code in PARAMETERS:
        assert PARAMETERS[code].address == address


@pytest.mark.parametrize("code", ["", "F11", "114", "F1140", "F0AA", "F1A4", "FB00", "F000"])
def test_no_address_for_what_is_no_parameter(code: str) -> None:
    with pytest.raises(ValueError, match="expected F"):
        parameter_address(code)


def test_all_parameters_of_the_order_are_there() -> None:
    wanted = {"F106", "F131", "F137", "F138", "F139", "F209", "F706", "F707", "F810"}
    wanted |= {f"F{n}" for n in (*range(111, 120), *range(200, 204), *range(277, 281), *range(800, 806))}
    wanted |= {f"F{n}" for n in range(900, 906)}
    assert wanted <= set(PARAMETERS)


def test_reading_is_refused_by_code() -> None:
    device = drive()
    for function, address, count, code in (
        (4, 0x1000, 1, 1),
        (1, 0x1000, 1, 1),
        (3, 0x2000, 1, 2),
        (3, 0x0FFF, 1, 2),
        (3, 0x1019, 1, 2),
        (3, 0x1018, 2, 2),
        (3, 0x1000, 26, 3),
        (3, 0x1000, 0, 3),
        (3, 0x010B, 7, 3),
        (3, 0x0116, 6, 2),
        (3, 0x0300, 1, 2),
        (3, 0xE040, 1, 2),
    ):
        assert refusal(lambda f=function, a=address, c=count: device.read(f, a, c)) == code, (function, address, count)


def test_limits_of_the_device_are_settings() -> None:
    device = VirtualE800(block_limit=9, parameter_limit=2, multiple_writes=True)
    assert len(device.read(3, 0x1000, 9)) == 9
    assert refusal(lambda: device.read(3, 0x1000, 10)) == 3
    assert refusal(lambda: device.read(3, 0x010B, 3)) == 3
    device.write(16, 0x010E, [20, 30])
    device.step()
    assert (device.parameter("F114"), device.parameter("F115")) == (2.0, 3.0)


def test_function_16_is_unknown_until_switched_on_and_then_all_or_nothing() -> None:
    assert refusal(lambda: drive().write(16, 0x010E, [20])) == 1
    device = VirtualE800(multiple_writes=True)
    assert refusal(lambda: device.write(16, 0x010E, [20, 0])) == 3
    device.step()
    assert device.parameter("F114") == 5.0


@pytest.mark.parametrize(
    ("address", "word", "code"),
    [
        (0x1000, 1, 2),
        (0x2004, 1, 2),
        (0x2008, 1, 2),
        (0x0300, 1, 2),
        (0x2000, 0, 3),
        (0x2000, 7, 3),
        (0x2000, 12, 3),
        (0x2001, 0, 3),
        (0x2001, 5, 3),
        (0x2002, 1001, 3),
        (0x2003, 1001, 3),
        (0x2005, 2, 3),
        (0x2007, 2, 3),
    ],
)
def test_writing_is_refused_by_code(address: int, word: int, code: int) -> None:
    assert refusal(lambda: drive().write(6, address, [word])) == code


def test_number_of_words_fits_the_function() -> None:
    assert refusal(lambda: drive().write(6, 0x010E, [20, 30])) == 3
    assert refusal(lambda: drive().write(6, 0x010E, [])) == 3
    assert refusal(lambda: drive().write(5, 0x2000, [1])) == 1


# ---- parameters


@pytest.mark.parametrize("code", sorted(set(PARAMETERS) - {"F111", "F112", "F113", "F124"}))
def test_each_range_holds_at_its_edges(code: str) -> None:
    parameter = PARAMETERS[code]
    device = drive()
    for value in (parameter.low, parameter.high):
        put(device, code, value)
        device.step()
        assert device.parameter(code) == value
        assert device.read(3, parameter.address, 1) == [parameter.encode(value)]
    low, high = parameter.encode(parameter.low), parameter.encode(parameter.high)
    for raw in (low - 1, high + 1):
        if 0 <= raw <= 0xFFFF:
            assert refusal(lambda raw=raw: device.write(6, parameter.address, [raw])) == 3


@pytest.mark.parametrize(("code", "hole"), [("F106", 1), ("F106", 4), ("F203", 7), ("F203", 8)])
def test_holes_in_a_range_are_refused(code: str, hole: int) -> None:
    assert refusal(lambda: drive().write(6, PARAMETERS[code].address, [hole])) == 3


def test_frequencies_limit_one_another() -> None:
    device = drive(F111=60.0, F112=5.0, F113=40.0, F124=10.0)
    edges = {"F113": (5.0, 60.0), "F124": (5.0, 60.0), "F112": (0.0, 40.0), "F111": (40.0, 650.0)}
    for code, (low, high) in edges.items():
        parameter = PARAMETERS[code]
        for outside in (parameter.encode(low) - 1, parameter.encode(high) + 1):
            if outside >= 0:
                assert refusal(lambda o=outside, p=parameter: device.write(6, p.address, [o])) == 3, (code, outside)
        start = device.parameter(code)
        for value in (low, high, start):
            put(device, code, value)
            device.step()
            assert device.parameter(code) == value


def test_two_writes_in_one_step_are_judged_together() -> None:
    device = drive(F113=40.0)
    put(device, "F113", 20.0)
    assert refusal(lambda: put(device, "F112", 30.0)) == 3
    device.step()
    assert (device.parameter("F112"), device.parameter("F113")) == (0.5, 20.0)


def test_a_write_acts_at_the_step_border() -> None:
    device = drive()
    put(device, "F114", 9.0)
    assert device.read(3, 0x010E, 1) == [50]
    device.step()
    assert device.read(3, 0x010E, 1) == [90]


def test_ram_only_writes_are_gone_after_power_off() -> None:
    device = drive()
    put(device, "F114", 8.0)
    go(device, 0.02)
    assert device.eeprom_writes == 1
    device.write(6, 0x2001, [4])
    put(device, "F114", 9.0)
    go(device, 0.02)
    assert (device.parameter("F114"), device.eeprom_writes) == (9.0, 1)
    device.power_cycle()
    assert device.parameter("F114") == 8.0
    assert device.eeprom_enabled
    device.write(6, 0x2001, [4])
    device.write(6, 0x2001, [3])
    put(device, "F114", 7.0)
    go(device, 0.02)
    device.power_cycle()
    assert device.parameter("F114") == 7.0


def test_line_settings_wait_for_power_up() -> None:
    device = drive()
    before = device.communication
    assert before == (1, 2, 1, 2, 3)
    put(device, "F900", 17)
    put(device, "F904", 5)
    go(device, 0.1)
    assert device.parameter("F900") == 17
    assert device.communication == before
    device.power_cycle()
    assert device.communication == (17, 2, 1, 2, 5)


def test_commissioned_values_are_told_apart_from_the_makers() -> None:
    assert PARAMETERS["F905"].default == 0.0
    assert VirtualE800().parameter("F905") == COMMISSIONED["F905"] == 1.0


@pytest.mark.parametrize(
    "bad",
    [
        {"motor": "C"},
        {"start": "sideways"},
        {"rated_current": 0.0},
        {"rated_current": float("nan")},
        {"parameters": {"F999": 1.0}},
        {"parameters": {"F114": 0.0}},
        {"parameters": {"F203": 7}},
        {"parameters": {"F113": "40"}},
        {"parameters": {"F113": 51.0}},
        {"parameters": {"F112": 50.01}},
        {"load": -1.0},
        {"inertia_ratio": -1.0},
    ],
)
def test_bad_configuration_is_named(bad: dict[str, object]) -> None:
    with pytest.raises(ConfigurationError, match=r"expected|takes"):
        VirtualE800(**bad)  # type: ignore[arg-type]


# ---- commands


STATES: dict[str, Callable[[], VirtualE800]] = {
    "stopped": lambda: go(drive(), 0.1),
    "forward": lambda: command(drive(), FORWARD, 6),
    "reverse": lambda: command(drive(), REVERSE, 6),
    "stopping": lambda: command(command(drive(), FORWARD, 6), STOP, 1),
    "jogging": lambda: command(drive(), JOG, 2),
    "coasting": lambda: command(command(drive(), FORWARD, 6), COAST, 0.02),
    "fault": lambda: go(faulted(), 0.1),
    "locked": lambda: locked(command(drive(), FORWARD, 6)),
    "deaf": lambda: command(drive(F200=1, F201=1), FORWARD, 0.1),
}


def faulted() -> VirtualE800:
    device = command(drive(), FORWARD, 6)
    inject(device, 0x0D)
    return go(device, 0.02)


def locked(device: VirtualE800) -> VirtualE800:
    device.write(6, 0x2001, [2])
    return go(device, 0.02)


AFTER = {
    # state: status and whole hertz 7 s after each command, in the order 1 2 3 4 5 6 8 9 10 11
    "stopped": "1/50 2/50 0/0 0/0 1/5 0/0 1/50 0/0 0/0 0/0",
    "forward": "1/50 2/20 0/0 0/0 1/50 1/50 1/50 1/50 1/50 1/50",
    "reverse": "1/20 2/50 0/0 0/0 2/50 2/50 1/20 2/50 2/50 2/50",
    "stopping": "1/50 2/30 0/0 0/0 1/5 0/0 1/50 0/0 0/0 0/0",
    "jogging": "1/50 2/50 0/0 0/0 1/5 0/0 1/50 1/5 0/0 1/5",
    # 4 = over-current: there is no flying start, and the motor is as big as the drive.
    "coasting": "4/0 2/50 0/0 0/0 4/0 0/0 4/0 0/0 0/0 0/0",
    "fault": "13/0 13/0 13/0 13/0 13/0 13/0 13/0 ex4 13/0 13/0",
    "locked": "1/50 1/50 1/50 1/50 1/50 1/50 1/50 1/50 1/50 1/50",
    "deaf": "0/0 0/0 0/0 0/0 0/0 0/0 0/0 0/0 0/0 0/0",
}


@pytest.mark.parametrize("state", STATES)
@pytest.mark.parametrize(("position", "code"), list(enumerate((1, 2, 3, 4, 5, 6, 8, 9, 10, 11))))
def test_each_command_in_each_state(state: str, position: int, code: int) -> None:
    device = STATES[state]()
    try:
        # A ramp of 50 Hz takes 5 s, so a reversal from 50 Hz stands at 20 Hz after 7 s.
        command(device, code, 7)
        words = image(device)
        got = f"{words[5] & 0xFF}/{round(words[0] / 100)}"
    except DeviceException as refused:
        got = f"ex{refused.code}"
    assert got == AFTER[state].split()[position]


def test_acceleration_takes_f114_and_deceleration_f115() -> None:
    device = drive(F114=4.0, F115=2.0)
    device.write(6, 0x2000, [FORWARD])
    assert until(device, lambda: image(device)[0] == 5000) == pytest.approx(4.0, abs=0.011)
    device.write(6, 0x2000, [STOP])
    assert until(device, lambda: image(device)[5] & 0xFF == 0) == pytest.approx(2.0, abs=0.035)


def test_ramp_reference_can_be_the_maximum_frequency() -> None:
    device = drive(F111=100.0, F119=1, F114=4.0)
    device.write(6, 0x2000, [FORWARD])
    assert until(device, lambda: image(device)[0] == 5000) == pytest.approx(2.0, abs=0.011)


def test_status_stays_running_until_below_minimum_frequency() -> None:
    device = command(drive(F112=10.0), FORWARD, 6)
    device.write(6, 0x2000, [STOP])
    lowest = 5000
    while image(go(device, 0.01))[5] & 0xFF == 1:
        lowest = image(device)[0]
    assert 1000 <= lowest <= 1010
    assert image(device)[0] == 0


def test_direction_changes_through_zero_by_its_own_ramps() -> None:
    device = command(drive(), FORWARD, 6)
    device.write(6, 0x2000, [REVERSE])
    trace = []
    for _ in range(1100):
        device.step()
        trace.append((device.frequency, device.status, device.shaft_speed))
    steps = [b[0] - a[0] for a, b in pairwise(trace)]
    assert min(steps) >= -0.1001
    assert trace[-1][0] == -50.0
    assert all(status == (1 if frequency > 0 else 2) for frequency, status, _ in trace)
    crossing = next(index for index, row in enumerate(trace) if row[0] <= 0)
    assert crossing == pytest.approx(500, abs=2)
    assert trace[-1][2] < -1395
    speeds = [row[2] for row in trace]
    assert max(abs(b - a) for a, b in pairwise(speeds)) < 30


def test_writing_5_as_the_thesis_does_to_reset_moves_the_motor() -> None:
    device = go(drive(), 0.1)
    inject(device, 0x0D)
    go(device, 0.05)
    inject(device, 0)
    go(device, 0.02)
    assert image(command(device, JOG, 1))[5] & 0xFF == 0x0D
    command(device, RESET)
    assert image(device)[5] & 0xFF == 0
    command(device, JOG, 2)
    assert image(device)[0] == 500
    assert device.shaft_speed > 100
    command(device, JOG_STOP, 2)
    assert image(device)[5] & 0xFF == 0


def test_run_without_direction_follows_f202() -> None:
    assert command(drive(F202=0), RUN, 1).status == 1
    assert command(drive(F202=1), RUN, 1).status == 2


def test_f209_makes_stop_a_coast() -> None:
    device = command(drive(F209=1), FORWARD, 6)
    command(device, STOP)
    assert (device.status, image(device)[0], image(device)[0x17]) == (0, 0, 0)
    assert device.shaft_speed > 1300
    go(device, 10)
    assert device.shaft_speed == 0


def test_start_and_stop_sources_are_separate() -> None:
    assert command(drive(F200=1), FORWARD, 1).status == 0
    device = command(drive(F201=0), FORWARD, 1)
    for code in (STOP, COAST):
        assert command(device, code, 1).status == 1


@pytest.mark.parametrize(("source", "frequency"), [(0, 30), (10, 30), (1, 0.5), (4, 0.5), (9, 0.5)])
def test_f203_decides_whether_the_modbus_setpoint_counts(source: int, frequency: float) -> None:
    device = command(drive(F203=source, F113=30.0), FORWARD, 6)
    assert device.frequency == frequency


def test_setpoint_moves_a_running_drive_by_ramp() -> None:
    device = command(drive(F113=20.0), FORWARD, 3)
    put(device, "F113", 40.0)
    go(device, 1)
    assert device.frequency == pytest.approx(30.0)
    go(device, 2)
    assert device.frequency == 40.0


def test_lock_holds_commands_and_unlock_frees_them() -> None:
    device = locked(drive())
    assert command(device, FORWARD, 1).status == 0
    device.write(6, 0x2001, [1])
    go(device, 0.02)
    assert command(device, FORWARD, 1).status == 1


def test_start_already_running() -> None:
    device = VirtualE800(start="reverse", parameters={"F113": 40.0, "F905": 0.0})
    words = image(device)
    assert (words[0], words[5] & 0xFF) == (4000, 2)
    assert device.shaft_speed < -1100
    speed = device.shaft_speed
    assert go(device, 1).shaft_speed == pytest.approx(speed, rel=0.01)


# ---- V/f


@pytest.mark.parametrize("curve", [0, 1, 2, 3])
@pytest.mark.parametrize("base", [40.0, 50.0, 87.0])
def test_v_over_f_never_falls_and_ends_at_rated_voltage(curve: int, base: float) -> None:
    device = drive(F137=curve, F118=base)
    volts = [device.output_voltage(hertz / 2) for hertz in range(0, 241)]
    assert volts == sorted(volts)
    assert volts[-1] == 230.0
    assert device.output_voltage(base) == 230.0
    assert device.output_voltage(base - 1) < 230.0


def test_boost_lifts_the_low_end_and_square_saves_in_the_middle() -> None:
    assert drive(F138=10).output_voltage(1.0) > drive(F138=2).output_voltage(1.0) + 15
    assert drive(F137=1, F139=4).output_voltage(1.0) > drive(F137=1, F139=1).output_voltage(1.0)
    assert drive(F137=1).output_voltage(25.0) < 0.6 * drive().output_voltage(25.0)


def test_vector_control_holds_the_speed_under_load() -> None:
    slips = {}
    for mode in (2, 0):
        device = VirtualE800(parameters=QUIET | {"F106": mode, "F113": 30.0}, load=80, quadratic_load=0, disturbance=0)
        slips[mode] = 900 - command(device, FORWARD, 8).shaft_speed
    assert 0 < abs(slips[0]) < 0.4 * slips[2]


# ---- faults


@pytest.mark.parametrize("running", [True, False], ids=["running", "standing"])
@pytest.mark.parametrize("code", FAULTS, ids=[name for name, _ in FAULTS.values()])
def test_fault_trips_refuses_the_reset_and_clears_when_its_cause_is_gone(code: int, running: bool) -> None:
    device = command(drive(), FORWARD, 6) if running else go(drive(), 0.1)
    inject(device, code)
    until(device, lambda: device.fault != 0, 70)
    words = image(device)
    assert device.fault == code
    assert words[5] & 0xFF == code
    assert (words[0], words[1], words[2], words[0x17], words[0x18]) == (0, 0, 0, 0, 0)
    assert words[0x0C] == 4
    assert refusal(lambda: device.write(6, 0x2000, [RESET])) == 4
    assert refusal(lambda: device.write(6, 0x2001, [1])) == 4
    command(device, FORWARD, 1)
    assert device.status == code
    inject(device, 0)
    go(device, 30)
    assert device.status == code
    command(device, RESET, 2)
    assert device.status == 0
    assert command(device, FORWARD, 1).status == 1


@pytest.mark.parametrize("code", sorted(PATIENCE))
@pytest.mark.parametrize("hertz", [25.0, 50.0])
def test_physical_causes_trip_by_physics(code: int, hertz: float) -> None:
    device = command(drive(F113=hertz), FORWARD, 6)
    inject(device, code)
    taken = until(device, lambda: device.fault != 0, 70)
    assert device.fault == code
    assert 0 < taken < PATIENCE[code]


def test_stalled_motor_draws_the_current_that_trips() -> None:
    device = command(drive(), FORWARD, 6)
    usual = device.motor.point.current
    inject(device, OC)
    peak = 0.0
    while not device.fault:
        peak = max(peak, device.motor.point.current)
        device.step()
    assert peak > usual
    assert device.fault == OC


def test_braking_too_fast_raises_the_bus_until_it_trips() -> None:
    device = VirtualE800(parameters=QUIET | {"F115": 0.3}, inertia_ratio=40, disturbance=0, load=0, quadratic_load=0)
    command(device, FORWARD, 12)
    assert device.status == 1
    before = device.bus_voltage
    device.write(6, 0x2000, [STOP])
    until(device, lambda: device.fault != 0, 2)
    assert device.fault == OE
    assert device.bus_voltage > before + 60


def test_bus_falls_under_load_and_rises_in_braking() -> None:
    device = go(drive(F115=0.8), 1)
    standing = device.bus_voltage
    command(device, FORWARD, 8)
    running = device.bus_voltage
    assert running < standing - 3
    device.write(6, 0x2000, [STOP])
    highest = 0.0
    for _ in range(80):
        device.step()
        highest = max(highest, device.bus_voltage)
    assert device.fault == 0
    assert highest > standing + 3


def test_supply_too_low_or_too_high_trips() -> None:
    for volts, code in ((120, 0x08), (290, 0x05)):
        device = go(drive(), 0.1)
        device.write(6, 0xE024, [volts])
        until(device, lambda device=device: device.fault != 0, 5)
        assert device.fault == code
        assert refusal(lambda device=device: device.write(6, 0x2000, [RESET])) == 4
        device.write(6, 0xE024, [230])
        go(device, 3)
        assert command(device, RESET).status == 0


def test_motor_overload_at_150_percent_trips_in_a_minute() -> None:
    device = VirtualE800(rated_current=2.5, parameters=QUIET, load=157, quadratic_load=0, disturbance=0)
    command(device, FORWARD, 8)
    ratio = device.motor.point.current / 2.5
    assert 1.35 < ratio < 1.65
    left = (1 - device.motor_overload) * 60 * (2.25 - 1.21) / (ratio**2 - 1.21)
    assert until(device, lambda: device.fault != 0, 120) == pytest.approx(left, rel=0.05)
    assert device.fault == OL2


def test_f707_lowers_and_f803_moves_the_motor_protection() -> None:
    for parameters in ({"F707": 50.0}, {"F803": 2.2}):
        device = command(drive(**parameters), FORWARD, 6)
        until(device, lambda device=device: device.fault != 0, 120)
        assert device.fault == OL2
    assert go(command(drive(), FORWARD, 6), 120).fault == 0


def test_drive_overload_by_its_own_curve() -> None:
    device = command(drive(F706=120, F803=6.0), FORWARD, 6)
    device.write(6, 0xE020, [90])
    until(device, lambda: device.fault != 0, 60)
    assert device.fault == OL1


def test_overheated_drive_has_to_cool_before_the_reset() -> None:
    device = command(drive(), FORWARD, 6)
    inject(device, OH)
    until(device, lambda: device.fault != 0, 70)
    inject(device, 0)
    go(device, 1)
    assert refusal(lambda: device.write(6, 0x2000, [RESET])) == 4
    go(device, 30)
    assert command(device, RESET).status == 0


def test_heat_sink_and_winding_warm_slowly_and_cool_again() -> None:
    device = VirtualE800(parameters=QUIET, load=100, quadratic_load=0, disturbance=0)
    command(device, FORWARD, 1)
    after_a_second = device.heat_sink
    go(device, 240)
    assert after_a_second < 27
    assert 25 + 0.55 * 30 < device.heat_sink < 25 + 0.75 * 30
    assert 50 < device.winding < 85
    hot = device.heat_sink
    command(device, STOP, 120)
    assert device.heat_sink < hot - 5


def test_it_never_restarts_by_itself() -> None:
    device = faulted()
    inject(device, 0)
    go(device, 1)
    command(device, RESET, 10)
    assert device.status == 0
    assert device.shaft_speed == 0


def test_power_cycle_clears_a_fault_unless_its_cause_stays() -> None:
    device = faulted()
    device.power_cycle()
    assert go(device, 0.05).fault == 0x0D
    inject(device, 0)
    go(device, 0.05)
    device.power_cycle()
    assert go(device, 0.05).status == 0


# ---- communication watchdog


def test_silence_longer_than_f905_trips_and_coasts() -> None:
    device = VirtualE800(parameters={"F905": 1.0})
    device.telegram_seen()
    command(device, FORWARD, 0.99)
    assert device.status == 1
    assert until(device, lambda: device.fault != 0, 1) == pytest.approx(0.02, abs=0.011)
    assert device.fault == CE
    assert device.frequency == 0
    device.telegram_seen()
    assert command(device, RESET).status == 0


def test_telegrams_feed_the_watchdog() -> None:
    device = VirtualE800(parameters={"F905": 1.0})
    command(device, FORWARD)
    for _ in range(30):
        device.telegram_seen()
        go(device, 0.9)
    assert device.status == 1


def test_training_registers_do_not_feed_it() -> None:
    device = VirtualE800(parameters={"F905": 1.0})
    device.telegram_seen()
    command(device, FORWARD)
    for _ in range(20):
        device.read(3, 0xE000, 4)
        device.write(6, 0xE020, [20])
        go(device, 0.1)
    assert device.fault == CE


@pytest.mark.parametrize("case", ["switched off", "never heard", "standing"])
def test_silence_that_does_not_trip(case: str) -> None:
    device = VirtualE800(parameters={"F905": 0.0 if case == "switched off" else 1.0})
    if case != "never heard":
        device.telegram_seen()
    if case != "standing":
        device.write(6, 0x2000, [FORWARD])
    go(device, 20)
    assert device.fault == 0


# ---- outputs


def test_analog_outputs_follow_the_plc_when_chosen() -> None:
    device = drive(F431=7, F432=7)
    device.write(6, 0x2002, [250])
    device.write(6, 0x2003, [1000])
    device.write(6, 0x2007, [1])
    go(device, 0.02)
    assert image(device)[0x15:0x17] == [2500, 10000]
    assert device.outputs[0x2007] == 1


# ---- the same again


def test_seed_and_writes_repeat_a_run_bit_for_bit() -> None:
    writes = {
        5: (0x2000, FORWARD),
        300: (0x010D, 3000),
        700: (0xE020, 60),
        900: (0x2000, REVERSE),
        1500: (0xE010, OC),
        1700: (0xE010, 0),
        1750: (0x2000, RESET),
        1760: (0x2000, RUN),
    }

    def run(seed: int) -> str:
        device = VirtualE800(seed=seed)
        trace: list[object] = []
        for step in range(2200):
            if step in writes:
                address, word = writes[step]
                device.write(6, address, [word])
            if step % 7 == 0:
                device.telegram_seen()
            device.step()
            trace.append((device.motor.speed.hex(), device.bus_voltage.hex(), device.heat_sink.hex(), device.status))
            if step % 50 == 0:
                trace.append(image(device))
        return json.dumps(trace)

    assert run(1) == run(1)
    assert run(1) != run(2)


def test_reading_does_not_change_anything() -> None:
    watched, alone = VirtualE800(start="forward"), VirtualE800(start="forward")
    for _ in range(500):
        image(watched)
        watched.read(3, 0x010B, 6)
        watched.step()
        alone.step()
    assert image(watched) == image(alone)
    assert watched.motor.speed == alone.motor.speed


@pytest.mark.parametrize("seed", range(12))
def test_whatever_is_written_the_physics_stays_sound(seed: int) -> None:
    random = Random(seed)
    device = VirtualE800(
        seed=seed,
        rated_current=random.choice([0.1, 0.8, 2.5, 4.5, 30.0]),
        motor=random.choice("AB"),
        start=random.choice(["", "forward", "reverse"]),
    )
    parameters = list(PARAMETERS.values())
    for step in range(2000):
        if random.random() < 0.03:
            parameter = random.choice(parameters)
            low, high = parameter.encode(parameter.low), parameter.encode(parameter.high)
            training = random.choice(sorted(LIMITS))
            address, word = random.choice(
                [
                    (0x2000, random.choice([1, 2, 3, 4, 5, 6, 8, 9, 10, 11])),
                    (parameter.address, random.randint(low, high)),
                    (training, random.randint(*LIMITS[training])),
                    (0xE010, random.choice([0, *FAULTS])),
                ]
            )
            with suppress(DeviceException):
                device.write(6, address, [word])
        device.step()
        if step % 20 == 0:
            point = device.motor.point
            assert all(0 <= word <= 0xFFFF for word in image(device))
            assert point.power_in == pytest.approx(point.power_shaft + point.losses, rel=1e-9, abs=1e-6)
            assert 0 <= device.bus_voltage < 900
            assert abs(device.shaft_speed) < 60 * 650 * 1.2
