"""A small register device with training registers: what the bus needs of a virtual device, without any physics."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from app.errors import DeviceException
from app.sim.training import BASE, LineFault


@dataclass(slots=True)
class FakeDevice:
    """Words at 0x1000–0x1018 to read, 0x0100–0x01FF to read and write, functions 03, 06 and 16; step by step as a real one."""

    seed: int = 0
    type: str = "fake"
    dt: float = 0.01
    steps: int = 0
    telegrams: int = 0
    line_fault: LineFault = field(default_factory=LineFault)
    words: dict[int, int] = field(
        default_factory=lambda: {
            **{address: 0 for address in range(0x100, 0x200)},
            **{0x1000 + n: 100 + n for n in range(25)},
            BASE: 0x5047,
        }
    )
    pending: list[tuple[int, int]] = field(default_factory=list)

    def step(self) -> None:
        for address, word in self.pending:
            self.words[address] = word
        self.pending.clear()
        self.steps += 1

    def read(self, function: int, address: int, count: int) -> list[int]:
        if function not in (3, 23):
            raise DeviceException(1)
        wanted = range(address, address + count)
        if any(one not in self.words for one in wanted):
            raise DeviceException(2)
        return [self.words[one] for one in wanted]

    def write(self, function: int, address: int, words: Sequence[int]) -> None:
        if any(not 0x100 <= one < 0x200 and one < BASE for one in range(address, address + len(words))):
            raise DeviceException(2)
        if max(words) > 65000:
            raise DeviceException(3)
        if address == 0x1FF:
            raise DeviceException(4)
        self.pending += [(address + n, word) for n, word in enumerate(words)]

    def telegram_seen(self) -> None:
        self.telegrams += 1
