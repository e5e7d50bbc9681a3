"""The parameters of a virtual E800: the values in force, what was written since the last step, and the EEPROM."""

from collections.abc import Mapping
from typing import NamedTuple

from app.errors import DeviceException
from app.sim.eura_e800.parameters import Parameter, limits


class Communication(NamedTuple):
    """The line settings in force since the last power-up (F900, F901, F902, F903, F904)."""

    address: int
    mode: int
    stop_bits: int
    parity: int
    baud: int


class ParameterMemory:
    """Values by code [their unit]. A write is judged with those before it, acts at the step border, and goes to EEPROM where enabled."""

    value: dict[str, float]
    """In force."""
    eeprom_enabled: bool
    """Parameter writes also go to EEPROM (0x2001 = 3; 4 = RAM only)."""
    communication: Communication
    _staged: dict[str, float]
    _eeprom: dict[str, float]

    def __init__(self, factory: Mapping[str, float]) -> None:
        """`factory`: every code, as the drive was commissioned."""
        self._factory = factory
        self.eeprom_writes = 0
        """Wear of the EEPROM since construction: parameter writes that went to it."""
        self.reset()

    def reset(self) -> None:
        """As commissioned, then powered up."""
        self._eeprom = dict(self._factory)
        self.power_up()

    def power_up(self) -> None:
        """What only the RAM held is gone; the line settings act."""
        self.value = dict(self._eeprom)
        self._staged = dict(self._eeprom)
        self.eeprom_enabled = True
        self.communication = Communication(*(int(self.value[f"F90{digit}"]) for digit in range(5)))

    def staged(self) -> dict[str, float]:
        """A copy of the values as they will be at the step border, to judge writes with."""
        return dict(self._staged)

    def stage(self, staged: dict[str, float]) -> None:
        """Keep what `check` filled in: all writes of the request were accepted."""
        self._staged = staged

    @staticmethod
    def check(parameter: Parameter, word: int, staged: dict[str, float]) -> None:
        """Put `word` into `staged`.

        Raises:
            DeviceException: 03, out of the parameter's range or of what the others leave it.
        """
        value = parameter.decode(word)
        low, high = limits(parameter, staged)
        if not (parameter.accepts(value) and low <= value <= high):
            raise DeviceException(3, f"{parameter.code} takes {low:g} to {high:g} {parameter.unit}, not {value:g}")
        staged[parameter.code] = value

    def write(self, parameter: Parameter, word: int) -> None:
        """A checked word acts."""
        self.value[parameter.code] = parameter.decode(word)
        if self.eeprom_enabled:
            self._eeprom[parameter.code] = parameter.decode(word)
            self.eeprom_writes += 1
