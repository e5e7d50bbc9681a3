"""Training registers: how an instructor breaks a virtual device and loads it, by the telegrams that every client has.

On every virtual device, holding registers from 0xE000; a real device answers exception 02 there.

| address | access | content |
| --- | --- | --- |
| 0xE000 | r | magic 0x5047 |
| 0xE001 | r | flags: bit 0 simulated |
| 0xE002 | r | version of this map: 1 |
| 0xE003 | r | type code, different for every type |
| 0xE010 | rw | machine fault to cause = the device's own status code; the cause stays until 0 is written |
| 0xE011 | rw | line fault (`LINE_FAULT_MODES`): 0 none, 1 cable pulled, 2 slow answer, 3 silent, 4 wrong unit, 5 wrong length, 6 garbage, 7 exception |
| 0xE012 | rw | delay of a slow answer [ms] |
| 0xE013 | rw | argument: exception code of mode 7 |
| 0xE014 | rw | number of requests the line fault hits, 0 = until cleared |
| 0xE020–0xE02E | | the device's own: sim/<type>/training.py |
| 0xE100–0xE1C8 | | more of its own |
| 0xE02F | – | reserved (time factor), reads 0 |
| 0xE030 | w | 1 = back to the initial state, after all other writes of that step; reads 0 |

Of a PLC: 0xE031 w, 1 = power off and on, the retained area is kept.

The rest of 0xE000–0xE03F reads 0, so that one telegram fetches the area. Function 03 reads, 06 and 16 write, whatever the
device itself knows. Line faults are only kept here; write the mode last, it acts from the next step on.
"""  # noqa: E501

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from app.errors import DeviceException

BASE = 0xE000
END = 0xE040
"""First address after the area."""
MAGIC = 0x5047
SIMULATED = 0x0001
VERSION = 1

REG_MAGIC = 0xE000
REG_FLAGS = 0xE001
REG_VERSION = 0xE002
REG_TYPE = 0xE003
REG_MACHINE_FAULT = 0xE010
REG_LINE_FAULT = 0xE011
REG_LINE_DELAY = 0xE012
REG_LINE_ARGUMENT = 0xE013
REG_LINE_COUNT = 0xE014
REG_TIME_FACTOR = 0xE02F
REG_RESET = 0xE030
REG_POWER = 0xE031

MORE = 0xE100
MORE_END = MORE + 201
"""A device that has many words has them here: first address, and the first one after them."""

LINE_FAULT_MODES: Mapping[int, str] = {
    0: "none",
    1: "cable pulled",
    2: "slow answer",
    3: "silent",
    4: "wrong unit",
    5: "wrong length",
    6: "garbage",
    7: "exception",
}

COMMON_LIMITS: Mapping[int, tuple[int, int]] = {
    REG_LINE_FAULT: (0, max(LINE_FAULT_MODES)),
    REG_LINE_DELAY: (0, 60000),
    REG_LINE_ARGUMENT: (0, 255),
    REG_LINE_COUNT: (0, 65535),
    REG_RESET: (1, 1),
}
"""Lowest and highest word of the registers that every virtual device has, 0xE010 aside; a fault code must be one of the device's."""
COMMON = frozenset(COMMON_LIMITS)
"""Registers that act alike on every virtual device."""

_LINE = (REG_LINE_FAULT, REG_LINE_DELAY, REG_LINE_ARGUMENT, REG_LINE_COUNT)


def is_training(address: int) -> bool:
    """Whether a telegram to `address` is the instructor's and so is no sign of life of a master."""
    return BASE <= address < END or MORE <= address < MORE_END


@dataclass(slots=True)
class LineFault:
    """What was done to the line of one unit. The bus reads it, counts it down and clears it."""

    mode: int = 0
    """Key of `LINE_FAULT_MODES`."""
    delay_ms: int = 0
    """Delay of a slow answer [ms]."""
    argument: int = 0
    """Exception code of mode 7."""
    count: int = 0
    """Requests that it still hits, 0 = until cleared."""


class TrainingRegisters:
    """The training area of one device: identity, line fault and the words the device reads its world from."""

    def __init__(
        self,
        type_code: int,
        faults: Collection[int],
        initial: Mapping[int, int],
        *,
        limits: Mapping[int, tuple[int, int]],
        triggers: Collection[int] = (),
    ) -> None:
        """`faults`: status codes that 0xE010 takes besides 0; `initial`: words from 0xE020 at the start; `limits`: lowest and highest
        word of what is written; `triggers`: registers that act once and always read 0."""
        self.faults = frozenset(faults)
        self._limits = limits
        self._triggers = frozenset(triggers)
        self.line_fault = LineFault()
        self._initial = {
            REG_MAGIC: MAGIC,
            REG_FLAGS: SIMULATED,
            REG_VERSION: VERSION,
            REG_TYPE: type_code,
            REG_MACHINE_FAULT: 0,
            **initial,
        }
        self._words = dict(self._initial)

    def __getitem__(self, address: int) -> int:
        """The word at `address`, 0 where nothing is mapped."""
        return self._words.get(address, 0)

    def read(self, function: int, address: int, count: int) -> list[int]:
        """`count` words from `address`.

        Raises:
            DeviceException: 01 not function 03, 02 outside the area, 03 no count.
        """
        if function != 3:
            raise DeviceException(1, f"training registers: function {function:02d}, expected 03")
        if count < 1:
            raise DeviceException(3, f"training registers: count {count}, expected at least 1")
        if address < MORE:
            known = address >= BASE and address + count <= END
        else:
            known = all(at in self._limits for at in range(address, address + count))
        if not known:
            raise DeviceException(
                2, f"training registers: 0x{address:04X} + {count}, expected 0x{BASE:04X}–0x{END - 1:04X}"
            )
        fault = self.line_fault
        line = dict(zip(_LINE, (fault.mode, fault.delay_ms, fault.argument, fault.count), strict=True))
        return [line.get(at, self[at]) for at in range(address, address + count)]

    def check(self, function: int, address: int, words: Sequence[int]) -> None:
        """Whether `words` could be written.

        Raises:
            DeviceException: 01 not function 06 or 16, 02 not a register that is written, 03 value or number of words.
        """
        if function not in (6, 16):
            raise DeviceException(1, f"training registers: function {function:02d}, expected 06 or 16")
        if not words or (function == 6 and len(words) != 1):
            raise DeviceException(3, f"training registers: {len(words)} words with function {function:02d}")
        for at, word in enumerate(words, address):
            if at == REG_MACHINE_FAULT:
                if word and word not in self.faults:
                    raise DeviceException(3, f"machine fault {word}, expected 0 or one of {sorted(self.faults)}")
            elif at not in self._limits:
                raise DeviceException(2, f"training register 0x{at:04X} is not written")
            elif not self._limits[at][0] <= word <= self._limits[at][1]:
                raise DeviceException(3, f"training register 0x{at:04X} takes {self._limits[at]}, not {word}")

    def act(self, address: int, word: int) -> bool:
        """Take a checked word; True when it asks for the initial state."""
        if address == REG_RESET:
            return True
        if address in _LINE:
            setattr(self.line_fault, ("mode", "delay_ms", "argument", "count")[_LINE.index(address)], word)
        elif address not in self._triggers:
            self._words[address] = word
        return False

    def reset(self) -> None:
        """Back to the initial state, the line included."""
        self._words = dict(self._initial)
        fault = self.line_fault
        fault.mode = fault.delay_ms = fault.argument = fault.count = 0
