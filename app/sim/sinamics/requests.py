"""Which telegrams a SINAMICS drive refuses by its map: functions, registers, counts and values."""

from collections.abc import Mapping, Sequence

from app.errors import DeviceException
from app.sim.sinamics import registers as map
from app.sim.sinamics.registers import Register


class Requests:
    """Checks of one drive; what it refused last stands in register 40499."""

    def __init__(self, process_words: int, registers: Mapping[int, Register] = map.REGISTERS) -> None:
        """`process_words`: so many words of process data each way; `registers`: what else it has, the mailbox aside."""
        self.process_words = process_words
        self._registers = registers
        self.access_error = 0
        """1 read only, 2 value out of its range, 0 none."""

    def check_read(self, function: int, address: int, count: int) -> range:
        """The numbers of the registers that are read.

        Raises:
            DeviceException: 01 not function 03, 02 a register that is not there, 03 not 1 to 125 registers.
        """
        if function != 3:
            raise DeviceException(1, f"SINAMICS: function {function:02d}, expected 03")
        if not 1 <= count <= 125:
            raise DeviceException(3, f"SINAMICS: {count} registers, expected 1 to 125")
        numbers = range(address + map.FIRST_NUMBER, address + count + map.FIRST_NUMBER)
        missing = next((number for number in numbers if not self.exists(number)), None)
        if missing is not None:
            raise DeviceException(2, f"SINAMICS: register {missing} does not exist")
        return numbers

    def check_write(self, function: int, address: int, words: Sequence[int]) -> range:
        """The numbers of the registers that are written.

        Raises:
            DeviceException: 01 other function, 02 a register that is not there, 03 value, 04 read-only (40499 then tells why).
        """
        if function not in (6, 16):
            raise DeviceException(1, f"SINAMICS: function {function:02d}, expected 06 or 16")
        if not words or len(words) > 123 or (function == 6 and len(words) != 1):
            raise DeviceException(3, f"SINAMICS: {len(words)} words with function {function:02d}")
        numbers = range(address + map.FIRST_NUMBER, address + len(words) + map.FIRST_NUMBER)
        for number, word in zip(numbers, words, strict=True):
            self._check_word(number, word)
        return numbers

    def exists(self, number: int) -> bool:
        """Whether the drive has this register."""
        if number in self._registers or number in map.MAILBOX:
            return True
        return any(first <= number < first + self.process_words for first in (map.CONTROL, map.STATUS))

    def _check_word(self, number: int, word: int) -> None:
        if not self.exists(number):
            raise DeviceException(2, f"SINAMICS: register {number} does not exist")
        if not 0 <= word <= 0xFFFF:
            raise DeviceException(3, f"SINAMICS: {word} is not a word")
        if map.CONTROL <= number < map.PROCESS_OUT_END or number in map.MAILBOX:
            return
        register = self._registers.get(number)
        if register is None or not register.writable:
            self.access_error = 1
            raise DeviceException(4, f"SINAMICS: register {number} is read only")
        value = register.decode(word)
        if not register.low <= value <= register.high:
            self.access_error = 2
            allowed = f"{register.low:g} to {register.high:g} {register.unit}".rstrip()
            raise DeviceException(3, f"{register.parameter} takes {allowed}, not {value:g}")
