"""A device with all four tables, each with functions of its own, for the tests of links."""

from collections.abc import Mapping, Sequence

from app.errors import DeviceException
from app.registers.pdu import Request, masked
from tests.links.devices import RegisterDevice

READ = {1: "coil", 2: "discrete", 3: "holding", 4: "input"}
WRITTEN = {5: "coil", 15: "coil", 6: "holding", 16: "holding", 22: "holding"}


class TableDevice(RegisterDevice):
    """Words, or bits, by table and address; what is not in `functions` it refuses with 01."""

    def __init__(self, tables: Mapping[str, Mapping[int, int]], functions: Sequence[int] = (*READ, *WRITTEN)) -> None:
        super().__init__({})
        self.tables = {name: dict(tables.get(name, {})) for name in READ.values()}
        self.functions = functions
        self.bit_limit = 2000

    def read(self, function: int, address: int, count: int) -> list[int]:
        self.requests.append(Request(function, address, count))
        if function not in self.functions:
            raise DeviceException(1)
        cells = self.tables[READ[function]]
        if count > (self.bit_limit if function in (1, 2) else self.limit):
            raise DeviceException(3)
        if any(at not in cells for at in range(address, address + count)):
            raise DeviceException(2)
        return [cells[at] for at in range(address, address + count)]

    def write(self, function: int, address: int, words: Sequence[int]) -> None:
        self.requests.append(Request(function, write_address=address, words=tuple(words)))
        if function not in self.functions:
            raise DeviceException(1)
        cells = self.tables[WRITTEN[function]]
        if function == 22 and address in cells:
            words = [masked(cells[address], words)]
        for at, word in enumerate(words, address):
            if at not in cells:
                raise DeviceException(2)
            cells[at] = word
