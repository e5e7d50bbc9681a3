"""What the words of an E800's command register (0x2000) and lock register (0x2001) do."""

from collections.abc import Callable, Mapping

from app.errors import DeviceException
from app.sim.eura_e800.faults import FAULTS
from app.sim.eura_e800.memory import ParameterMemory
from app.sim.eura_e800.power import PowerSection
from app.sim.eura_e800.protection import Protection
from app.sim.eura_e800.ramp import Ramp

RESET = 9
UNLOCK = 1


class RemoteCommands:
    """Commands by Modbus: taken where F200 and F201 let them, and while the drive is not locked.

    What is taken but cannot be done (a start during a fault, a jog while running) is echoed, and nothing happens.
    """

    def __init__(self, memory: ParameterMemory, ramp: Ramp, protection: Protection, power: PowerSection) -> None:
        """Over the parts of the drive that it commands."""
        self._memory, self._ramp, self._protection, self._power = memory, ramp, protection, power
        self.locked = False
        """Remote commands are not valid (0x2001 = 2)."""
        self._table: Mapping[int, Callable[[], None]] = {
            1: lambda: self._run(1),
            2: lambda: self._run(-1),
            3: self._stop,
            4: self._free_stop,
            5: self._jog_forward,
            6: lambda: self._jog_stop(1),
            8: lambda: self._run(-1 if self._memory.value["F202"] == 1 else 1),
            RESET: self._reset,
            10: lambda: self._jog_stop(1),
            11: lambda: self._jog_stop(-1),
        }

    def check(self, word: int) -> None:
        """Whether command `word` is taken.

        Raises:
            DeviceException: 03 no such command, 04 a reset whose cause persists.
        """
        if word not in self._table:
            raise DeviceException(3, f"E800: command {word}, expected one of {sorted(self._table)}")
        if word == RESET and not self.locked and self._listens("F200", "F201"):
            self._check_cause("reset")

    def check_lock(self, word: int) -> None:
        """Whether lock word `word` (1–4) is taken.

        Raises:
            DeviceException: 04 an unlock while the cause of a fault persists.
        """
        if word == UNLOCK:
            self._check_cause("unlock")

    def execute(self, word: int) -> None:
        """Do what a checked `word` asks, unless the drive is locked."""
        if not self.locked:
            self._table[word]()

    def take_lock(self, word: int) -> None:
        """1 unlock, 2 lock, 3 parameters to EEPROM too, 4 to RAM only."""
        if word <= 2:
            self.locked = word == 2
        else:
            self._memory.eeprom_enabled = word == 3

    def trip(self, code: int) -> None:
        """Fault `code` stands and the motor coasts."""
        self._protection.fault = code
        self.output_off()

    def output_off(self) -> None:
        """The motor coasts."""
        self._ramp.off()
        self._power.inverter.off()

    def _check_cause(self, what: str) -> None:
        if self._cause_persists():
            fault = FAULTS[self._protection.fault][0]
            raise DeviceException(4, f"{what} refused: the cause of {fault} persists")

    def _cause_persists(self) -> bool:
        return self._protection.cause_persists(self._power.measured())

    def _listens(self, *codes: str) -> bool:
        """Whether one of F200 (start), F201 (stop) lets Modbus command."""
        return any(self._memory.value[code] in (3, 4) for code in codes)

    def _run(self, direction: int) -> None:
        if self._listens("F200") and not self._protection.fault:
            self._ramp.run(direction)

    def _stop(self) -> None:
        if self._listens("F201") and self._ramp.on:
            if self._memory.value["F209"] == 1:
                self.output_off()
            else:
                self._ramp.stop()

    def _free_stop(self) -> None:
        if self._listens("F201"):
            self.output_off()

    def _jog_forward(self) -> None:
        if self._listens("F200") and not self._protection.fault:
            self._ramp.jog()

    def _jog_stop(self, direction: int) -> None:
        if self._listens("F201"):
            self._ramp.jog_stop(direction)

    def _reset(self) -> None:
        if self._listens("F200", "F201") and not self._cause_persists():
            self._protection.fault = 0
