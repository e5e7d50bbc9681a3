"""Setpoints of a virtual PLC: staged, then valid by one command, all or none."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from struct import Struct, pack, unpack
from zlib import crc32

from app.plant.said import any_of, not_as, said
from app.registers.plc_map import Request
from app.sim.plc.verdict import REASON_COUNT, REASON_CRC, REASON_VALUE, Verdict, rejected

Fault = Callable[[Mapping[str, float]], int]
"""Number (from 1) of a setting that does not go with the others, 0 = none."""


@dataclass(frozen=True, slots=True)
class Setting:
    """A setpoint of the device, a float32."""

    name: str
    default: float
    low: float
    high: float


def check_given(given: Mapping[str, float], settings: Sequence[Setting]) -> None:
    """Refuse initial values by name, other than of these `settings` and within their limits.

    Raises:
        ValueError: no such setting, or a value outside its limits.
    """
    known = {setting.name: setting for setting in settings}
    for name, value in given.items():
        if name not in known:
            raise ValueError(not_as(said("mistake.setting", name=name), any_of(known)))
        low, high = known[name].low, known[name].high
        if not low <= value <= high:
            raise ValueError(said("mistake.takes", what=name, low=f"{low:g}", high=f"{high:g}", value=f"{value:g}"))


class Settings:
    """The values in effect, and those that wait for the command `COMMIT_SETTINGS`."""

    def __init__(self, settings: Sequence[Setting]) -> None:
        self.words = 2 * len(settings)
        """Registers of the values."""
        self._settings = tuple(settings)
        self._packed = Struct(f">{len(self._settings)}f")
        self.clear()

    def clear(self) -> None:
        """As never switched on before."""
        self.values: dict[str, float] = {setting.name: _single(setting.default) for setting in self._settings}
        """In effect, by name. Not to be changed."""
        self.generation = 0
        """Even; another one after every change."""
        self.start_up()

    def start_up(self) -> None:
        """What was staged is gone; what is in effect stands there instead."""
        self.staged = list(self._value_words())

    def stage(self, at: int, words: Sequence[int]) -> None:
        """Take `words` at the offset `at`."""
        self.staged[at : at + len(words)] = words

    def commit(self, request: Request, fault: Fault) -> Verdict:
        """Let what is staged take effect; reasons 20 count, 22 check sum, 21 value (detail: number from 1)."""
        staged = pack(f">{self.words}H", *self.staged)
        if request.arguments[0] != self.words:
            return rejected(REASON_COUNT, self.words)
        if request.arguments[1] != crc32(staged):
            return rejected(REASON_CRC)
        values = self._packed.unpack(staged)
        for number, (setting, value) in enumerate(zip(self._settings, values, strict=True), 1):
            if not _single(setting.low) <= value <= _single(setting.high):
                return rejected(REASON_VALUE, number)
        taken = {setting.name: value for setting, value in zip(self._settings, values, strict=True)}
        if number := fault(taken):
            return rejected(REASON_VALUE, number)
        self.values = taken
        self.generation = self.generation + 2 & 0xFFFE
        return Verdict()

    @property
    def image(self) -> Sequence[int]:
        """Their number, the values and a spare word."""
        return (len(self._settings), *self._value_words(), 0)

    def _value_words(self) -> Sequence[int]:
        return unpack(f">{self.words}H", self._packed.pack(*self.values.values()))


def _single(value: float) -> float:
    """`value` as a float32 holds it."""
    return float(unpack(">f", pack(">f", value))[0])
