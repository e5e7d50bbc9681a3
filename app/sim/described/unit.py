"""Several described machines behind one unit (`base`): one image on the line, one line to break."""

from collections.abc import Sequence

from app.errors import DeviceException
from app.registers.pdu import BITS
from app.sim.described.device import DescribedDevice
from app.sim.device import DT
from app.sim.training import LineFault, is_training


class SharedUnit:
    """What the line sees of them; each is stepped by itself. What an instructor writes is for all of them: it is one device."""

    type: str = "shared"
    dt: float = DT

    def __init__(self, machines: Sequence[DescribedDevice]) -> None:
        self._machines = tuple(machines)

    @property
    def line_fault(self) -> LineFault:
        """That of the first one, where the bus counts it down."""
        return self._machines[0].line_fault

    def step(self) -> None:
        """Nothing: its machines are stepped themselves."""

    def telegram_seen(self) -> None:
        """None has a watchdog."""

    def read(self, function: int, address: int, count: int) -> list[int]:
        """Of the machine that has the first of these registers; what lies between registers of two machines is nobody's.

        Raises:
            DeviceException: as of that machine; 02: nobody has it.
        """
        if is_training(address) and function not in BITS:
            return self._machines[0].read(function, address, count)
        table = self._machines[0].check_read(function, count)
        return self._of(table, address).read(function, address, count)

    def write(self, function: int, address: int, words: Sequence[int]) -> None:
        """To the machine that has the first of these registers.

        Raises:
            DeviceException: as of that machine; 02: nobody has it.
        """
        if is_training(address) and function not in BITS:
            for machine in self._machines:
                machine.write(function, address, words)
            return
        table = self._machines[0].check_write(function, len(words))
        self._of(table, address).write(function, address, words)

    def _of(self, table: str, address: int) -> DescribedDevice:
        for machine in self._machines:
            if (table, address) in machine.places:
                return machine
        raise DeviceException(2, f"{table} {address}: no machine of this unit has it")
