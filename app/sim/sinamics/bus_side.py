"""What a virtual drive with a Modbus map and a mailbox is to the bus."""

from collections.abc import Sequence

from app.sim.device import check_room
from app.sim.sinamics.fault_buffer import FaultBuffer
from app.sim.sinamics.gateway import GatewayMailbox
from app.sim.sinamics.mailbox import Mailbox
from app.sim.sinamics.registers import MAILBOX
from app.sim.sinamics.requests import Requests
from app.sim.training import LineFault, TrainingRegisters, is_training


class BusSide:
    """Reads and writes of one drive. Writes wait for its next step; the mailbox takes its own at once."""

    buffer: FaultBuffer
    _requests: Requests
    _training: TrainingRegisters
    _mailbox: Mailbox | GatewayMailbox
    _pending: list[tuple[int, int]]
    """(address, word) that the next step takes."""
    _uptime: float
    """[s]"""

    @property
    def line_fault(self) -> LineFault:
        """What the instructor did to the line of this unit; only kept here."""
        return self._training.line_fault

    def telegram_seen(self) -> None:
        """No sign of life by itself: the drive counts accesses to its process data only (`read`, `write`)."""

    def read(self, function: int, address: int, count: int) -> list[int]:
        """Function 03 of what the map lists, and of training registers.

        Raises:
            DeviceException: 01 other function, 02 a register that is not there, 03 not 1 to 125 registers.
        """
        if is_training(address):
            return self._training.read(function, address, count)
        numbers = self._requests.check_read(function, address, count)
        self._watch(numbers)
        return self._words(numbers)

    def write(self, function: int, address: int, words: Sequence[int]) -> None:
        """Functions 06 and 16 to what the map lists as writable, and to training registers.

        Raises:
            DeviceException: 01 other function, 02 a register that is not there, 03 value, 04 read-only (40499 then tells why), 06 too many
                writes wait. Nothing of a refused request acts.
        """
        check_room("drive", len(self._pending))
        if is_training(address):
            self._training.check(function, address, words)
            self._pending += enumerate(words, address)
            return
        numbers = self._requests.check_write(function, address, words)
        if numbers.start in MAILBOX:
            self._mailbox.write(numbers.start - MAILBOX.start, words)
            return
        self._watch(numbers)
        self._pending += enumerate(words, address)

    def stood(self, seconds: float) -> None:
        """So much real time passed without a step: its clock goes on."""
        self._uptime += seconds
        self.buffer.now = round(1000 * self._uptime)

    def _watch(self, numbers: range) -> None:
        """An access to these: a sign of life where the monitoring counts them."""
        raise NotImplementedError

    def _words(self, numbers: range) -> list[int]:
        """What the registers with these numbers hold."""
        raise NotImplementedError
