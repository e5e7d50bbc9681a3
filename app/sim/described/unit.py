"""Several described machines behind one unit (`base`): one image on the line, one line to break."""

from collections.abc import Sequence

from app.errors import DeviceException
from app.registers.pdu import BITS
from app.sim.described.device import DescribedDevice
from app.sim.device import DT
from app.sim.training import (
    REG_LINE_ARGUMENT,
    REG_LINE_COUNT,
    REG_LINE_DELAY,
    REG_LINE_FAULT,
    LineFault,
    is_training,
)

LINE = frozenset({REG_LINE_FAULT, REG_LINE_DELAY, REG_LINE_ARGUMENT, REG_LINE_COUNT})
"""What an instructor writes of the line itself."""


class SharedUnit:
    """What the line sees of them; each is stepped by itself. What an instructor writes is for all that know it: it is one device."""

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
            first, *others = (machine.read(function, address, count) for machine in self._machines)
            return [
                word if at in LINE else max(word, *(other[at - address] for other in others))
                for at, word in enumerate(first, address)
            ]
        table = self._machines[0].check_read(function, count)
        return self._of(table, address).read(function, address, count)

    def write(self, function: int, address: int, words: Sequence[int]) -> None:
        """To the machine that has the first of these registers.

        Raises:
            DeviceException: as of that machine; 02: nobody has it.
        """
        if is_training(address) and function not in BITS:
            takers = {at: self._takers(function, at, word) for at, word in enumerate(words, address)}
            for at, word in enumerate(words, address):
                for machine in takers[at]:
                    machine.write(function, at, (word,))
            return
        table = self._machines[0].check_write(function, len(words))
        self._of(table, address).write(function, address, words)

    def _takers(self, function: int, at: int, word: int) -> list[DescribedDevice]:
        """Who knows this word of an instructor; what breaks the line is of the first one alone, where the bus counts it down.

        Raises:
            DeviceException: nobody does.
        """
        found, refused = list[DescribedDevice](), None
        for machine in self._machines[:1] if at in LINE else self._machines:
            try:
                machine.check_training(function, at, (word,))
                found.append(machine)
            except DeviceException as error:
                refused = error
        if not found and refused:
            raise refused
        return found

    def _of(self, table: str, address: int) -> DescribedDevice:
        for machine in self._machines:
            if (table, address) in machine.places:
                return machine
        raise DeviceException(2, f"{table} {address}: no machine of this unit has it")
