"""Drives of five sizes behind every transport: speed, current and power that the house shows are those of a motor circuit solved here."""

import asyncio
from math import pi, sqrt
from pathlib import Path

import pytest

from app.runtime import Runtime
from app.sim.eura_e800 import training
from app.sim.eura_e800.drive import VirtualE800
from app.sim.induction_motor import MOTOR_SETS
from app.sim.plant import SimPlant
from app.tags.quality import is_good
from tests.far import far
from tests.running.test_random_layouts import HEAD, house

SIZES = {
    "e800_0004s2": (230, 2.5),
    "e800_0022s2": (230, 10),
    "e800_0040t3": (400, 9),
    "e800_0110t3": (400, 23),
    "e800_0220t3": (400, 44),
}
"""Preset → voltage [V] and current [A] of its motor."""
LOADS = (0.0, 0.5, 1.0, 1.3)
"""Torque at the shaft [1 = rated]."""
CLOSE = 0.02
FREQUENCY = 45.0
BASE = MOTOR_SETS["A"]


def drives(link: str) -> str:
    """V/f without compensation, so that frequency and voltage at the terminals are the ones that the drive shows."""
    start = f'simulation = {{ start = "forward", F106 = 2, F113 = {FREQUENCY} }}'
    return "".join(
        f'[equipment.d{unit}]\ntype = "eura_e800"\nlink = "{link}"\nunit = {unit}\npreset = "{name}"\n{start}\n'
        for unit, name in enumerate(SIZES, 1)
    )


def at_the_shaft(volts: float, amps: float, line: float, frequency: float, load: float) -> tuple[float, float, float]:
    """Speed [rpm], line current [A] and power [kW] of the motor in delta at `line` [V], which turns `load` [1 = rated torque]."""
    scale = (volts / 230) / (amps / (BASE.rated_current * sqrt(3)))
    bigger = (volts / 230) * (amps / (BASE.rated_current * sqrt(3)))
    w = 2 * pi * frequency
    wanted = (load * BASE.rated_torque + BASE.friction_power / BASE.rated_angular_speed) * bigger
    stator = scale * (BASE.rs + 1j * w * BASE.ls)
    cross = 1 / (1 / (scale * BASE.r_fe) + 1 / (1j * w * scale * BASE.lm))

    def solved(slip: float) -> tuple[complex, float]:
        rotor = scale * (BASE.rr / slip + 1j * w * BASE.lr)
        both = 1 / (1 / rotor + 1 / cross)
        current = line / (stator + both)
        through = abs(current * both / rotor)
        return current, 3 * through * through * scale * BASE.rr / slip / (w / BASE.pole_pairs)

    low, high = 1e-6, 0.3
    for _ in range(60):
        slip = (low + high) / 2
        low, high = (slip, high) if solved(slip)[1] < wanted else (low, slip)
    current, _ = solved(low)
    return 60 * frequency / BASE.pole_pairs * (1 - low), abs(current) * sqrt(3), 3 * line * current.real / 1000


async def compared(runtime: Runtime, sim: SimPlant) -> None:
    def value(name: str) -> float:
        sample = runtime.tags.sample(name)
        assert is_good(sample.quality) and isinstance(sample.value, int | float), (name, sample)
        return sample.value

    found = [sim.devices[f"d{unit}"] for unit in range(1, len(SIZES) + 1)]
    for load in LOADS:
        for device in found:
            assert isinstance(device, VirtualE800)
            for register, percent in (
                (training.REG_LOAD, load),
                (training.REG_LOAD_QUADRATIC, 0),
                (training.REG_DISTURBANCE, 0),
            ):
                device.write(6, register, [round(100 * percent)])
        await asyncio.sleep(8)
        for unit, (name, (volts, amps)) in enumerate(SIZES.items(), 1):
            line, frequency = value(f"d{unit}.voltage"), value(f"d{unit}.frequency")
            speed, current, power = at_the_shaft(volts, amps, line, frequency, load)
            assert frequency == FREQUENCY
            assert value(f"d{unit}.speed") == pytest.approx(speed, rel=CLOSE, abs=0.5), (name, load)
            assert value(f"d{unit}.current") == pytest.approx(current, rel=CLOSE, abs=0.005), (name, load)
            assert abs(value(f"d{unit}.power") - power) <= CLOSE * power + 0.05, (name, load)


@pytest.mark.sweep(8)
@pytest.mark.parametrize("transport", ["memory", "tcp", "rtu"])
async def test_what_is_shown_is_what_the_circuit_says(tmp_path: Path, transport: str) -> None:
    if transport == "memory":
        async with house(tmp_path, f'{HEAD}[links.near]\ntransport = "memory"\n{drives("near")}') as runtime:
            assert runtime.sim
            await asyncio.sleep(5)
            await compared(runtime, runtime.sim)
        return
    line = drives("far")
    async with (
        far(tmp_path / "far", transport, HEAD, line) as (link, sim),
        house(tmp_path, HEAD + link + line) as runtime,
    ):
        await asyncio.sleep(10)
        await compared(runtime, sim)
