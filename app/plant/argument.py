"""What is given with a command or an action, by name."""

from dataclasses import dataclass

from app.registers.register import Type


@dataclass(frozen=True, slots=True)
class Argument:
    """One of up to four arguments of a command that is sent as a code, or of an action of a sequence."""

    name: str
    type: Type = Type.F32
    """u32, i32 or f32."""
    low: str = ""
    """Least value: a number or an expression over points; empty = none."""
    high: str = ""
    unit: str = ""
    decimals: int = 0
    label: str = ""
    """Text key."""
