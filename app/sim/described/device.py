"""A virtual device by its description: the telegrams of a device as its type says, before the machine that it describes."""

from collections.abc import Mapping, Sequence
from zlib import crc32

from app.errors import ConfigurationError, DeviceException
from app.plant.definitions import Equipment
from app.plant.said import said
from app.plant.simulation import FAULT, Simulation
from app.registers.pdu import BITS, FUNCTIONS, MASK_WRITE, WRITE_COIL, WRITE_COILS, WRITE_SINGLE, masked
from app.registers.register import BIT_TABLES
from app.sim.described.image import Place, joined
from app.sim.described.machine import Machine
from app.sim.device import DT
from app.sim.training import COMMON_LIMITS, REG_MACHINE_FAULT, LineFault, TrainingRegisters, is_training

TABLES = {function: table for table, function in FUNCTIONS.items()}
"""Function that reads → table."""
MOST_COILS = 1968
"""Of one telegram that writes."""


class DescribedDevice:
    """The device of a machine whose type has a simulation.toml."""

    dt: float = DT

    def __init__(self, item: Equipment, simulation: Simulation, seed: int) -> None:
        """
        Raises:
            ConfigurationError: with the options of this machine it would start with what its registers cannot say, or its base
                moves them to where an instructor writes.
        """
        self.type = item.type.name
        self._device, self._base = item.type.device, item.base
        trained = item.type.training
        words = {**trained.world, **trained.acts, **trained.switches}
        self._words = {FAULT: REG_MACHINE_FAULT, **{key: word.register for key, word in words.items()}}
        self._acts = frozenset(word.register for word in trained.acts.values())
        self._pressed: dict[int, int] = {}
        """Acts of this step."""
        starts = {key: simulation.start.get(key, 0) for key in words}
        self._training = TrainingRegisters(
            crc32(self.type.encode()) & 0xFFFF | 0x8000,
            trained.faults.values(),
            {word.register: max(word.low, int(starts[key])) for key, word in words.items()},
            limits={**COMMON_LIMITS, **{word.register: (word.low, word.high) for word in words.values()}},
            triggers=self._acts,
        )
        self._machine = Machine(item, simulation, seed, self._word)
        self._machine.check_start()
        registers = self._machine.registers.values()
        self.places = joined(registers)
        """What it has."""
        taken = next(
            (place for place in sorted(self.places) if place[0] not in BIT_TABLES and is_training(place[1])), None
        )
        if taken:
            raise ConfigurationError(said("mistake.simulation_base", base=item.base, address=f"0x{taken[1]:04X}"))
        self._writable = joined(register for register in registers if register.writable)
        self._spans = {
            table: (min(addresses), max(addresses))
            for table in FUNCTIONS
            if (addresses := [address for of, address in self.places if of == table])
        }
        self._pending: list[tuple[str, Mapping[Place, int]]] = []
        """What was written since the last step, by table; of the instructor, the table is empty."""

    @property
    def line_fault(self) -> LineFault:
        """What the instructor did to the line of this unit; only kept here."""
        return self._training.line_fault

    def telegram_seen(self) -> None:
        """It has no watchdog."""

    def read(self, function: int, address: int, count: int) -> list[int]:
        """As its `[device]` says: functions, lengths, holes; what lies between its registers reads 0.

        Raises:
            DeviceException: 01 function, 02 address, 03 count.
        """
        if is_training(address) and function not in BITS:
            return self._training.read(function, address, count)
        table = self.check_read(function, count)
        first, last = self._spans.get(table, (0, -1))
        if address < first or address + count - 1 > last or self._is_hole(table, address, count):
            raise DeviceException(2, f"{self.type}: {table} {address} + {count}, expected {first} to {last}")
        words = self._machine.words()
        return [words.get((table, at), 0) for at in range(address, address + count)]

    def check_read(self, function: int, count: int) -> str:
        """The table that a read of so many is from.

        Raises:
            DeviceException: 01 function, 03 count.
        """
        table = TABLES.get(function)
        if table is None or function not in self._device.read_functions:
            raise self._unknown(function, self._device.read_functions)
        self._check_count(count, self._device.max_read_bits if function in BITS else self._device.max_read)
        return table

    def write(self, function: int, address: int, words: Sequence[int]) -> None:
        """As its `[device]`, its setpoints and `[[writes]]` say; it acts at the next step border.

        Raises:
            DeviceException: 01 function, 02 nothing is written there, 03 value or number of words, or what a row refuses with.
        """
        if is_training(address) and function not in BITS:
            self.check_training(function, address, words)
            self._pending.append(("", {("", at): word for at, word in enumerate(words, address)}))
            return
        table = self.check_write(function, len(words))
        if function == MASK_WRITE:
            words = (masked(self._now((table, address)), words),)
        wanted = {(table, at): word for at, word in enumerate(words, address)}
        for place in wanted:
            if place not in self._writable:
                raise DeviceException(2, f"{self.type}: {table} {place[1]} is not written")
        if code := self._machine.refusal(wanted):
            raise DeviceException(code, f"{self.type}: {table} {address} does not take {list(words)}")
        self._pending.append((table, wanted))

    def check_training(self, function: int, address: int, words: Sequence[int]) -> None:
        """Whether an instructor may write it.

        Raises:
            DeviceException: 01 function, 02 no such register, 03 value.
        """
        self._training.check(function, address, words)

    def check_write(self, function: int, count: int) -> str:
        """The table that a write of so many is to.

        Raises:
            DeviceException: 01 function, 03 count.
        """
        if function not in self._device.write_functions:
            raise self._unknown(function, self._device.write_functions)
        most = {WRITE_SINGLE: 1, WRITE_COIL: 1, WRITE_COILS: MOST_COILS, MASK_WRITE: 2}
        self._check_count(count, most.get(function, self._device.max_write))
        return "coil" if function in BITS else "holding"

    def step(self) -> None:
        """Advance by 10 ms: what was written acts in its order, then the machine moves."""
        pending, self._pending = self._pending, []
        initial = False
        for table, wanted in pending:
            if table:
                self._machine.take(wanted)
                continue
            for (_, at), word in wanted.items():
                initial |= self._training.act(at, word)
                if at in self._acts:
                    self._pressed[at] = word
        self._machine.step(self.dt)
        self._pressed.clear()
        if initial:
            self._training.reset()
            self._machine.begin()

    def _now(self, place: Place) -> int:
        """What is there, with what was written since the last step."""
        written = (words[place] for _, words in reversed(self._pending) if place in words)
        return next(written, self._machine.words().get(place, 0))

    def _word(self, name: str) -> float | None:
        """What the instructor says by this name; None: nothing has it."""
        at = self._words.get(name)
        return None if at is None else self._pressed.get(at, self._training[at])

    def _is_hole(self, table: str, address: int, count: int) -> bool:
        if table in BIT_TABLES:
            return False
        never = (*self._device.holes, *(self._device.write_only if table == "holding" else ()))
        return any(address <= last + self._base and first + self._base < address + count for first, last in never)

    def _check_count(self, count: int, most: int) -> None:
        if not 1 <= count <= most:
            raise DeviceException(3, f"{self.type}: {count} at once, expected 1 to {most}")

    def _unknown(self, function: int, known: Sequence[int]) -> DeviceException:
        expected = ", ".join(map(str, known)) or "none"
        return DeviceException(1, f"{self.type}: function {function}, expected {expected}")


def describe(item: Equipment, seed: int) -> DescribedDevice:
    """The virtual device of a machine whose type describes one.

    Raises:
        ConfigurationError: its type describes none, or it cannot start with the options of this machine.
    """
    if item.type.simulation is None:
        raise ConfigurationError(said("mistake.no_virtual", type=item.type.name))
    return DescribedDevice(item, item.type.simulation, seed)
