"""The function parameters of an EURA E800: registers, ranges, defaults, and how a drive is commissioned."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from app.errors import ConfigurationError
from app.plant.said import any_of, not_as, said
from app.sim.induction_motor import MotorData


@dataclass(frozen=True, slots=True)
class Parameter:
    """A function parameter of the drive."""

    code: str
    """`F114`"""
    address: int
    scale: float
    """[unit per raw step]"""
    low: float
    high: float
    default: float
    """By the manual, not as commissioned (`COMMISSIONED`)."""
    unit: str
    choices: tuple[int, ...] = ()
    """Values allowed, where the range has holes."""

    def decode(self, raw: int) -> float:
        """Engineering value of `raw`."""
        return raw / self._steps

    def encode(self, value: float) -> int:
        """Raw word of `value`."""
        return round(value * self._steps)

    def accepts(self, value: float) -> bool:
        """Whether `value` is in range, limits by other parameters aside."""
        return self.low <= value <= self.high and (not self.choices or value in self.choices)

    @property
    def _steps(self) -> int:
        return round(1 / self.scale)


def parameter_address(code: str) -> int:
    """Register of F-parameter `code`: group digit as high byte, two-digit index as low byte (F114 → 0x010E, FA00 → 0x0A00).

    Raises:
        ValueError: `code` is not F, a group digit 1–9 or A, and two decimal digits.
    """
    if len(code) != 4 or code[0] != "F" or code[1] not in "123456789A" or not code[2:].isdecimal():
        raise ValueError(f"parameter {code!r}: expected F, 1–9 or A, and two digits, like F114")
    return int(code[1], 16) << 8 | int(code[2:])


def _parameters() -> Mapping[str, Parameter]:
    whole, tenth, hundredth = 1.0, 0.1, 0.01
    ramp = (tenth, 0.1, 3000.0, 5.0, "s")
    rows: tuple[tuple[str, float, float, float, float, str, tuple[int, ...]], ...] = (
        ("F106", whole, 0, 6, 2, "", (0, 2, 3, 6)),
        ("F111", hundredth, 0, 650, 50, "Hz", ()),
        ("F112", hundredth, 0, 650, 0.5, "Hz", ()),
        ("F113", hundredth, 0, 650, 50, "Hz", ()),
        ("F114", *ramp, ()),
        ("F115", *ramp, ()),
        ("F116", *ramp, ()),
        ("F117", *ramp, ()),
        ("F118", hundredth, 15, 650, 50, "Hz", ()),
        ("F119", whole, 0, 1, 0, "", ()),
        ("F124", hundredth, 0, 650, 5, "Hz", ()),
        ("F125", *ramp, ()),
        ("F126", *ramp, ()),
        ("F131", whole, 0, 8191, 15, "", ()),
        ("F137", whole, 0, 3, 0, "", ()),
        ("F138", whole, 1, 20, 5, "", ()),
        ("F139", whole, 1, 4, 1, "", ()),
        ("F200", whole, 0, 4, 4, "", ()),
        ("F201", whole, 0, 4, 4, "", ()),
        ("F202", whole, 0, 2, 0, "", ()),
        ("F203", whole, 0, 10, 0, "", (0, 1, 2, 3, 4, 5, 6, 9, 10)),
        ("F209", whole, 0, 1, 0, "", ()),
        ("F277", *ramp, ()),
        ("F278", *ramp, ()),
        ("F279", *ramp, ()),
        ("F280", *ramp, ()),
        ("F431", whole, 0, 10, 0, "", ()),
        ("F432", whole, 0, 10, 1, "", ()),
        ("F706", whole, 120, 190, 150, "%", ()),
        ("F707", whole, 20, 100, 100, "%", ()),
        ("F800", whole, 0, 2, 0, "", ()),
        ("F801", hundredth, 0.2, 650, 0.75, "kW", ()),
        ("F802", whole, 1, 440, 230, "V", ()),
        ("F803", hundredth, 0.1, 650, 4.5, "A", ()),
        ("F804", whole, 2, 100, 4, "", ()),
        ("F805", whole, 1, 39000, 1395, "rpm", ()),
        ("F810", hundredth, 1, 650, 50, "Hz", ()),
        ("F900", whole, 1, 255, 1, "", ()),
        ("F901", whole, 1, 2, 1, "", ()),
        ("F902", whole, 1, 2, 2, "", ()),
        ("F903", whole, 0, 2, 0, "", ()),
        ("F904", whole, 0, 6, 3, "", ()),
        ("F905", tenth, 0, 3000, 0, "s", ()),
    )
    return MappingProxyType(
        {
            code: Parameter(code, parameter_address(code), scale, low, high, default, unit, choices)
            for code, scale, low, high, default, unit, choices in rows
        }
    )


PARAMETERS: Mapping[str, Parameter] = _parameters()
"""Code → parameter. Section 6 of the sheet; F111, F112, F113 also limit one another, and F124 when written."""

COMMISSIONED: Mapping[str, float] = MappingProxyType({"F901": 2.0, "F902": 1.0, "F903": 2.0, "F905": 1.0})
"""Where the virtual drive starts away from the maker's defaults: RTU, 8E1, communication time-out 1 s, as our guide sets it up."""

BY_ADDRESS: Mapping[int, Parameter] = {parameter.address: parameter for parameter in PARAMETERS.values()}
"""Register → parameter."""


def limits(parameter: Parameter, values: Mapping[str, float]) -> tuple[float, float]:
    """Range of `parameter` as the others stand: F112 ≤ F113 ≤ F111, and a jog frequency is taken between the two."""
    low, high = parameter.low, parameter.high
    if parameter.code == "F111":
        low = values["F113"]
    elif parameter.code == "F112":
        high = values["F113"]
    elif parameter.code in ("F113", "F124"):
        low, high = values["F112"], values["F111"]
    return low, high


def _named(code: str) -> str:
    return said("mistake.parameter", code=code)


def commissioned(
    motor: MotorData, rated_current: float, rated_voltage: float, given: Mapping[str, float]
) -> dict[str, float]:
    """The parameters of a drive set up for `motor` of `rated_current` [A] at `rated_voltage` [V], with the values `given` by code.

    Raises:
        ConfigurationError: an unknown code, or a value out of its range.
    """
    values = {code: parameter.default for code, parameter in PARAMETERS.items()} | dict(COMMISSIONED)
    values |= {
        "F801": min(max(round(motor.rated_power / 1000, 2), 0.2), 650.0),
        "F802": round(rated_voltage),
        "F803": round(rated_current, 2),
        "F804": 2.0 * motor.pole_pairs,
        "F805": round(motor.rated_speed),
        "F810": motor.rated_frequency,
        "F118": motor.rated_frequency,
    }
    if motor.rated_frequency != PARAMETERS["F810"].default:
        values |= {"F111": motor.rated_frequency, "F113": motor.rated_frequency}
    for code, value in given.items():
        parameter = PARAMETERS.get(code)
        if parameter is None:
            raise ConfigurationError(not_as(_named(code), any_of(PARAMETERS)))
        if isinstance(value, bool) or not isinstance(value, int | float) or not parameter.accepts(value):
            highest = f"{parameter.high:g} {parameter.unit}".rstrip()
            allowed = parameter.choices or said("mistake.from_to", low=f"{parameter.low:g}", high=highest)
            raise ConfigurationError(said("mistake.takes_only", what=_named(code), allowed=allowed, value=repr(value)))
        values[code] = parameter.decode(parameter.encode(value))
    for code in ("F111", "F112", "F113"):
        low, high = limits(PARAMETERS[code], values)
        if not low <= values[code] <= high:
            raise ConfigurationError(
                said("mistake.takes", what=_named(code), low=f"{low:g}", high=f"{high:g} Hz", value=f"{values[code]:g}")
            )
    return values
