"""Training registers: how an instructor breaks a virtual device and loads it, by the road every client has.

On every virtual device, holding registers from 0xE000; a real device answers exception 02 there.

| address | access | content |
| --- | --- | --- |
| 0xE000 | r | magic 0x5047 |
| 0xE001 | r | flags: bit 0 simulated |
| 0xE002 | r | version of this map: 1 |
| 0xE003 | r | type code (`TYPE_CODES`) |
| 0xE010 | rw | machine fault to cause = the device's own status code; the cause stays until 0 is written |
| 0xE011 | rw | line fault (`LINE_FAULT_MODES`): 0 none, 1 cable pulled, 2 slow answer, 3 silent, 4 wrong unit, 5 wrong length, 6 garbage, 7 exception |
| 0xE012 | rw | delay of a slow answer [ms] |
| 0xE013 | rw | argument: exception code of mode 7 |
| 0xE014 | rw | number of requests the line fault hits, 0 = until cleared |
| 0xE020–0xE02E | | the device's own, below |
| 0xE100–0xE1C8 | | of a sequence, below |
| 0xE02F | – | reserved (time factor), reads 0 |
| 0xE030 | w | 1 = back to the initial state, after all other writes of that step; reads 0 |

Of a drive (`eura_e800`):

| address | access | content |
| --- | --- | --- |
| 0xE020 | rw | load, constant part [% of rated torque] |
| 0xE021 | rw | load, part that grows with the square of speed [% of rated torque at rated speed] |
| 0xE022 | rw | disturbance of the load [% of rated torque] |
| 0xE023 | rw | ambient temperature [°C] |
| 0xE024 | rw | supply voltage [V rms] |

Of a PLC: 0xE031 w, 1 = power off and on, the retained area is kept. Of a `conveyor` moreover:

| address | access | content |
| --- | --- | --- |
| 0xE020 | rw | products arrive (1) or not (0) |
| 0xE021 | rw | mean interval of arrivals [0.1 s] |
| 0xE022, 0xE023 | rw | shortest and longest product [mm] |
| 0xE024 | rw | sensors pressed by hand: bit n = beam of sensor n+1 interrupted while set |
| 0xE025 | w | k = take the k-th product off the line (1 = front-most) without telling the PLC |
| 0xE026 | w | mm = put a product of 0xE022 mm by hand, its head there, without telling the PLC |

Of a `coil_car`: 0xE020 strip arrives (1) or not (0) · 0xE021 growth of the coil [0.1 mm/s] · 0xE022 the crane takes a coil so many seconds
after it was laid, 0 = never; machine faults in app/sim/coil_car/register_map.py.

Of a `sequence`: machine fault 1 = inputs frozen; without a machine moreover its permissive words, 1 = there:

| address | access | content |
| --- | --- | --- |
| 0xE100 | rw | abort conditions |
| 0xE101–0xE1C8 | rw | words of steps 1 to 200, as many as it has steps; one telegram reads or writes up to 125 or 123 of them |
| 0xE020–0xE02E | rw | the first 15 of these once more |

Machine faults of a conveyor (0xE010, one at a time): 1–3 belt n jammed · 11–13 belt n slips · 21–24 sensor n blind (never interrupted) ·
31–34 sensor n stuck (always interrupted) · 41–43 encoder of belt n dead · 50 emergency stop pressed · 60 the host's heartbeat does not arrive.

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
REG_LOAD = 0xE020
REG_LOAD_QUADRATIC = 0xE021
REG_DISTURBANCE = 0xE022
REG_AMBIENT = 0xE023
REG_SUPPLY = 0xE024
REG_TIME_FACTOR = 0xE02F
REG_RESET = 0xE030
REG_POWER = 0xE031

REG_ARRIVALS = 0xE020
REG_INTERVAL = 0xE021
REG_SHORTEST = 0xE022
REG_LONGEST = 0xE023
REG_SENSORS = 0xE024
REG_REMOVE = 0xE025
REG_PUT = 0xE026

REG_STRIP = 0xE020
REG_GROWTH = 0xE021
REG_CRANE = 0xE022
REG_PERMISSIVES = 0xE020
"""Of a sequence: the first of its permissive words, abort conditions first."""
PERMISSIVE_WORDS = 15
REG_WORDS = 0xE100
"""Of a sequence: the first of all its permissive words."""
WORDS_END = REG_WORDS + 201
"""First address after those of the longest sequence."""

TYPE_CODES: Mapping[str, int] = {"eura_e800": 1, "conveyor": 10, "sequence": 20, "coil_car": 30}
"""Equipment type → 0xE003."""

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

LIMITS: Mapping[int, tuple[int, int]] = {
    **COMMON_LIMITS,
    REG_LOAD: (0, 500),
    REG_LOAD_QUADRATIC: (0, 500),
    REG_DISTURBANCE: (0, 100),
    REG_AMBIENT: (0, 60),
    REG_SUPPLY: (0, 300),
}
"""Of a drive: lowest and highest word per register."""
CONVEYOR_LIMITS: Mapping[int, tuple[int, int]] = {
    **COMMON_LIMITS,
    REG_POWER: (1, 1),
    REG_ARRIVALS: (0, 1),
    REG_INTERVAL: (5, 6000),
    REG_SHORTEST: (10, 400),
    REG_LONGEST: (10, 400),
    REG_SENSORS: (0, 15),
    REG_REMOVE: (1, 250),
    REG_PUT: (0, 5000),
}
"""Of a conveyor: lowest and highest word per register."""
COIL_CAR_LIMITS: Mapping[int, tuple[int, int]] = {
    **COMMON_LIMITS,
    REG_POWER: (1, 1),
    REG_STRIP: (0, 1),
    REG_GROWTH: (1, 60000),
    REG_CRANE: (0, 6000),
}
"""Of a coil car: lowest and highest word per register."""
SEQUENCE_LIMITS: Mapping[int, tuple[int, int]] = {
    **COMMON_LIMITS,
    REG_POWER: (1, 1),
    **{REG_PERMISSIVES + n: (0, 0xFFFF) for n in range(PERMISSIVE_WORDS)},
    **{address: (0, 0xFFFF) for address in range(REG_WORDS, WORDS_END)},
}
"""Of a sequence of 200 steps: lowest and highest word per register."""
LIMITS_OF: Mapping[str, Mapping[int, tuple[int, int]]] = {
    "eura_e800": LIMITS,
    "conveyor": CONVEYOR_LIMITS,
    "coil_car": COIL_CAR_LIMITS,
    "sequence": SEQUENCE_LIMITS,
}
"""Equipment type → lowest and highest word per register."""

_LINE = (REG_LINE_FAULT, REG_LINE_DELAY, REG_LINE_ARGUMENT, REG_LINE_COUNT)


def is_training(address: int) -> bool:
    """Whether a telegram to `address` is the instructor's and so is no sign of life of a master."""
    return BASE <= address < END or REG_WORDS <= address < WORDS_END


def sequence_limits(steps: int) -> Mapping[int, tuple[int, int]]:
    """Lowest and highest word per register of a sequence of so many steps."""
    return {address: span for address, span in SEQUENCE_LIMITS.items() if address <= REG_WORDS + steps}


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
        limits: Mapping[int, tuple[int, int]] = LIMITS,
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
        if address < REG_WORDS:
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
