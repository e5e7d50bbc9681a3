"""Every size of the series: its values are good, nothing stands as an alarm, and its motor is the one of its circuit."""

import asyncio
import re
import tomllib
from math import pi, sqrt
from pathlib import Path

import pytest

from app import bundled
from app.commands.interlocks import met
from app.plant.loader import read_plant
from app.sim.eura_e800.drive import VirtualE800
from app.sim.induction_motor import MOTOR_SETS
from tests.reloading import DEMO, running
from tests.sim.eura_e800.stand import FORWARD, command

SIZES = tomllib.loads((Path(__file__).parents[3] / "app/equipment/eura_e800/device.toml").read_text("utf-8"))["presets"]
HEAD = DEMO[: DEMO.index("# Keeps running")]
CLOSE = 0.02
VALUES = ("frequency", "voltage", "current", "bus_voltage", "power", "speed", "torque", "heatsink_temperature")


def plant_of(*machines: str) -> str:
    return HEAD + "".join(
        f'\n[equipment.d{unit}]\ntype = "eura_e800"\nlink = "hall"\nunit = {unit}\n{machine}\n'
        f'label = {{ hr = "D{unit}", en = "D{unit}", de = "D{unit}", cs = "D{unit}" }}\n'
        for unit, machine in enumerate(machines, 1)
    )


def test_there_are_sizes_from_the_smallest_to_the_biggest() -> None:
    powers = sorted(size["rated_power"] for size in SIZES.values())
    assert len(SIZES) >= 5 and powers[0] == 0.4 and powers[-1] == 22
    assert {size.get("rated_voltage", 230) for size in SIZES.values()} == {230, 400}


@pytest.mark.sweep(8)
async def test_a_running_drive_of_any_size_shows_nothing_doubtful_and_has_no_alarm(tmp_path: Path) -> None:
    start = 'simulation = { start = "forward", F113 = 45.0 }'
    async with running(tmp_path, plant_of(*(f'preset = "{name}"\n{start}' for name in SIZES))) as plant:
        assert not plant.runtime.problems
        tags = plant.runtime.tags
        await plant.until(lambda: all(plant.good(f"d{unit}.power") for unit in range(1, len(SIZES) + 1)), 60)
        await asyncio.sleep(20)
        for unit, (name, size) in enumerate(SIZES.items(), 1):
            for key in VALUES:
                assert plant.good(f"d{unit}.{key}"), (name, key, tags.sample(f"d{unit}.{key}"))
            voltage = size.get("rated_voltage", 230)
            value = tags.sample(f"d{unit}.bus_voltage").value
            assert value == pytest.approx(voltage * sqrt(2), rel=0.05), name
        machines = {f"d{unit}" for unit in range(1, len(SIZES) + 1)}
        assert [one.key for one in plant.runtime.alarms.list.active() if one.equipment in machines] == []


@pytest.mark.sweep(8)
@pytest.mark.parametrize("name", SIZES)
@pytest.mark.parametrize("frequency", [25.0, 50.0])
def test_its_motor_is_that_of_the_circuit(name: str, frequency: float) -> None:
    """Current, power and speed against the T-circuit, solved here, at the slip that the drive itself shows."""
    size = SIZES[name]
    current, voltage = size["rated_current"], size.get("rated_voltage", 230)
    drive = VirtualE800(
        rated_current=current, rated_voltage=voltage, drive_current=size["drive_current"],
        parameters={"F905": 0.0, "F113": frequency, "F106": 2.0, "F114": 5.0}, disturbance=0,
        load=40, quadratic_load=0, inertia_ratio=2,
    )  # fmt: skip
    command(drive, FORWARD, 25)
    base = MOTOR_SETS["A"]
    scale = (voltage / 230) / (current / (base.rated_current * sqrt(3)))
    w = 2 * pi * frequency
    slip = 1 - drive.shaft_speed * base.pole_pairs / 60 / frequency
    rotor = (base.rr / slip + 1j * w * base.lr) * scale
    iron = 1 / (1 / (base.r_fe * scale) + 1 / (1j * w * base.lm * scale))
    stator = (base.rs + 1j * w * base.ls) * scale
    phase = drive.voltage / (stator + 1 / (1 / rotor + 1 / iron))
    point = drive.motor.point
    assert point.current == pytest.approx(abs(phase) * sqrt(3), rel=CLOSE)
    assert point.power_in == pytest.approx(3 * drive.voltage * phase.real, rel=CLOSE)
    e2 = abs(phase / (1 / rotor + 1 / iron)) ** 2
    torque = (
        3
        * base.pole_pairs
        * e2
        * slip
        * base.rr
        * scale
        / ((base.rr * scale) ** 2 + (slip * w * base.lr * scale) ** 2)
        / w
    )
    assert point.torque == pytest.approx(torque, rel=CLOSE)
    power = voltage * current * sqrt(3) * base.cos_phi * base.efficiency
    assert drive.motor_data.rated_power == pytest.approx(power, rel=CLOSE)
    assert drive.read(3, 0x1002, 1)[0] / 100 == pytest.approx(abs(phase) * sqrt(3), rel=CLOSE, abs=0.006)


@pytest.mark.parametrize(
    ("machine", "expected"),
    [
        ("rated_current = 12.6", "at most the rated output of the drive, drive_current = 4.5 A"),
        ('preset = "e800_0022t3"\nrated_current = 6.6', "drive_current = 6.5 A"),
        ("rated_voltage = 300", "200 to 240 V or 380 to 440 V"),
        ('preset = "e800_0900t3"', "e800_0220t3"),
    ],
)
def test_what_no_drive_of_the_series_is_is_refused(tmp_path: Path, machine: str, expected: str) -> None:
    folder = tmp_path / "plant"
    folder.mkdir()
    for path in bundled("plants/demo").iterdir():
        if path.is_dir():
            (folder / path.name).symlink_to(path)
    (folder / "plant.toml").write_text(plant_of(machine), "utf-8")
    _, problems = read_plant(folder)
    assert re.search(re.escape(expected), " ".join(str(problem) for problem in problems)), problems


MOTORS = [(1, 50.0), (2, 60.0), (3, 50.0), (4, 87.0)]


@pytest.mark.parametrize(("pole_pairs", "frequency"), MOTORS)
def test_other_pole_pairs_and_frequencies_keep_the_rated_point(pole_pairs: int, frequency: float) -> None:
    plain = MOTOR_SETS["A"].sized(4.5)
    motor = plain.wound(pole_pairs, frequency)
    slip = 1 - plain.rated_speed * plain.pole_pairs / 60 / 50
    assert 1 - motor.rated_speed * pole_pairs / 60 / frequency == pytest.approx(slip)
    assert motor.rated_torque * motor.rated_speed == pytest.approx(plain.rated_torque * plain.rated_speed)
    assert motor.lm * frequency == pytest.approx(plain.lm * 50)
    drive = VirtualE800(pole_pairs=pole_pairs, rated_frequency=frequency, load=100, quadratic_load=0, disturbance=0)
    command(drive, FORWARD)
    for _ in range(2500):
        drive.step()
    assert drive.shaft_speed == pytest.approx(motor.rated_speed, rel=CLOSE)
    assert drive.motor.point.current == pytest.approx(motor.rated_current_delta, rel=3 * CLOSE)
    parameters = [drive.parameter(code) for code in ("F804", "F810", "F118", "F805")]
    assert parameters == [2 * pole_pairs, frequency, frequency, round(motor.rated_speed)]


RATED = [
    ("", {}, set()),
    ("pole_pairs = 1\nrated_frequency = 60", {}, set()),
    ("", {"F803": 3.2}, {"motor_current"}),
    ("", {"F802": 400}, {"motor_voltage"}),
    ("", {"F804": 6}, {"motor_poles"}),
    ("", {"F810": 60}, {"motor_frequency"}),
    ("", {"F805": 2900}, {"motor_speed"}),
    ("", {"F801": 22.0}, {"motor_power"}),
    ("", {"F801": 7.5}, set()),  # read as 0.75 kW where the raw value is kW x 10: nobody knows
]


async def test_what_the_drive_says_of_its_motor_is_compared_with_the_plant_file(tmp_path: Path) -> None:
    machines = []
    for options, values, _ in RATED:
        given = ", ".join(f"{code} = {value}" for code, value in values.items())
        machines.append(f"{options}\nsimulation = {{ {given} }}")
    async with running(tmp_path, plant_of(*machines)) as plant:
        assert not plant.runtime.problems
        await plant.until(lambda: all(plant.good(f"d{unit}.f810") for unit in range(1, len(RATED) + 1)), 60)
        assert plant.runtime.plant is not None
        for unit, (_, _, expected) in enumerate(RATED, 1):
            kind = plant.runtime.plant.equipment[f"d{unit}"].type

            def look(key: str, unit: int = unit) -> tuple[object, int]:
                sample = plant.runtime.tags.sample(f"d{unit}.{key}")
                return sample.value, sample.quality

            assert {one.key for one in kind.ratings if met(one, look) is False} == expected, unit  # type: ignore[arg-type]


WOUND = [
    ("", 50, 1500),
    ("pole_pairs = 1", 50, 3000),
    ("pole_pairs = 3\nrated_frequency = 60", 60, 1200),
    ("rated_frequency = 87", 87, 2610),
    ("pole_pairs = 1\nrated_speed = 2850", 50, 2850),
]


@pytest.mark.parametrize(("options", "frequency", "speed"), WOUND)
def test_scales_and_normal_bands_are_those_of_its_motor(
    tmp_path: Path, options: str, frequency: float, speed: float
) -> None:
    folder = tmp_path / "plant"
    folder.mkdir()
    (folder / "plant.toml").write_text(
        '[plant]\nname = "Hall"\ntimezone = "UTC"\n[links.hall]\ntransport = "memory"\n'
        f'[equipment.d1]\ntype = "eura_e800"\nlink = "hall"\nunit = 1\n{options}\n',
        "utf-8",
    )
    plant, problems = read_plant(folder)
    assert plant is not None, problems
    points = plant.equipment["d1"].points
    for key in ("frequency", "frequency_setpoint"):
        assert (points[key].scale_low, points[key].scale_high) == (0, frequency)
        assert points[key].normal == pytest.approx((0.6 * frequency, 0.9 * frequency))
    assert (points["speed"].scale_low, points["speed"].scale_high) == (-speed, speed)
    assert points["speed"].normal == pytest.approx((0.6 * speed, 5 * speed / 6))
