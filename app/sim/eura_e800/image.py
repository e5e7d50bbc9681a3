"""The words 0x1000–0x1018 of an E800, encoded from what the drive is doing."""

from collections.abc import Mapping
from dataclasses import dataclass

from app.sim.eura_e800.registers import AO1, AO2, DO1, DO2, REGISTERS, RELAY
from app.sim.induction_motor import OperatingPoint


@dataclass(frozen=True, slots=True)
class Readings:
    """What the registers show."""

    status: int
    """Status code."""
    faulted: bool
    on: bool
    """Whether the inverter feeds the motor."""
    frequency: float
    """[Hz], negative in reverse."""
    voltage: float
    """Output, line to line [V rms]."""
    bus_voltage: float
    """[V DC]"""
    heat_sink: float
    """[°C]"""
    shaft_speed: float
    """[rpm], negative in reverse."""
    point: OperatingPoint
    rated_torque: float
    """Of the motor [Nm]."""
    pole_pairs: int
    drive_current: float
    """Rated output current of the drive [A]."""


def encode(it: Readings, values: Mapping[str, float], outputs: Mapping[int, int]) -> list[int]:
    """All words from 0x1000 on. `values`: parameters by code; `outputs`: words last written by register."""
    power = max(0.0, it.point.power_in) / 1000
    # Without encoder and output the drive sees no speed; F804 is what it takes for the motor's poles.
    speed = abs(it.shaft_speed) * 2 * it.pole_pairs / values["F804"] if it.on else 0.0
    words = dict.fromkeys(REGISTERS, 0)
    words |= {
        0x1000: round(abs(it.frequency) * 100),
        0x1001: round(it.voltage),
        0x1002: round(it.point.current * 100),
        0x1003: int(values["F804"]) << 8 | int(values["F200"]),
        0x1004: round(it.bus_voltage),
        0x1005: 0x0100 | it.status,
        0x1006: round(abs(it.point.torque) / it.rated_torque * 100),
        0x1007: round(it.heat_sink),
        0x100A: int(power),
        0x100C: _digital_outputs(it, outputs),
        0x1015: _analog_output(it, values["F431"], values, outputs[AO1]),
        0x1016: _analog_output(it, values["F432"], values, outputs[AO2]),
        0x1017: round(speed),
        0x1018: round(power * 10),
    }
    return [min(max(word, 0), 0xFFFF) for word in words.values()]


def _digital_outputs(it: Readings, outputs: Mapping[int, int]) -> int:
    """Bit 0: running, bit 2: fault; each output also shows what the PLC wrote. Assumed: no source says with which function it does."""
    return (int(it.on) | outputs[DO1]) | outputs[DO2] << 1 | (int(it.faulted) | outputs[RELAY]) << 2


def _analog_output(it: Readings, chosen: float, values: Mapping[str, float], token: int) -> int:
    """0–10000: 0 output frequency, 1 output current (200 % of the drive), 7 what the PLC wrote, other functions 0."""
    if chosen == 0:
        return min(10000, round(abs(it.frequency) / max(values["F111"], 1.0) * 10000))
    if chosen == 1:
        return min(10000, round(it.point.current / (2 * it.drive_current) * 10000))
    return token * 10 if chosen == 7 else 0
