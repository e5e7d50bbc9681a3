"""What every virtual PLC has in common: the map of `registers/plc_map.py`, served around a program that a machine adds.

One `step` is one scan: the writes heard since the last one act in their order, the program runs, and from then on every read sees this
scan as a whole. Between two scans nothing changes, so an image is encoded when it is first asked for and kept until the next scan.

| subject | rule here |
| --- | --- |
| functions | 03, 06, 16, 23; 1–125 registers per read; what no one mapped is exception 02, what is no value for its place 03 |
| commands | one function 16 of 16 words with an id; a known id is not executed again, its answer stays; the last 8 answers are retained |
| hold-to-run | request bits count until the counter stood still for 500 ms |
| setpoints | staged, then valid by `COMMIT_SETTINGS`: all or none; reasons 20 count, 22 check sum, 21 value (detail: number from 1) |
| events | the ring keeps the last 59 with their time; retained, so that a power cycle loses none; row = sequence % 59 |
| causes | an event that a command causes carries its id: one of the same scan, told while it is executed or named by `causes` |
| time | scans x dt since the device was first switched on: two runs with the same writes are equal to the bit |
| scan time | read from `stopwatch`, 0 without one: what was measured never enters the program |
| host | its heartbeat must change within the host time-out once that is above 0 |
| training | 0xE030 = initial state, retained area included; 0xE031 = power off and on, retained area kept |
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from struct import Struct, pack, unpack
from zlib import crc32

from app.errors import DeviceException
from app.registers import plc_map
from app.registers.plc_map import Answer, AnswerState, DeviceEvent, Request
from app.sim import training
from app.sim.device import DT
from app.sim.training import LineFault, TrainingRegisters, is_training

MAX_READ = 125
EVENT_CAPACITY = (0x0800 - plc_map.EVENT_ROWS) // plc_map.EVENT_WORDS
"""Rows that fit between 0x0410 and the tables at 0x0800."""

REASON_UNKNOWN, REASON_WRONG_STATE = 1, 2
REASON_COUNT, REASON_VALUE, REASON_CRC = 20, 21, 22
"""Reasons that this base gives; a machine has its own beside them."""

READING, WRITING = (3, 23), (6, 16, 23)

_HEADER = Struct(">4HI5HQ4HQ9H")


@dataclass(frozen=True, slots=True)
class Setting:
    """A setpoint of the device, a float32."""

    name: str
    default: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Image:
    """Registers that are swapped as one: generation, what `encode` gives (big-endian bytes), generation."""

    address: int
    words: int
    encode: Callable[[], bytes]


@dataclass(frozen=True, slots=True)
class Verdict:
    """What becomes of a command when it is taken."""

    state: AnswerState = AnswerState.DONE
    reason: int = 0
    detail: int = 0
    until: Callable[[], AnswerState] | None = None
    """Of a running command: asked after every scan what has become of it."""


def rejected(reason: int, detail: int = 0) -> Verdict:
    """The command does nothing, because of `reason`."""
    return Verdict(AnswerState.REJECTED, reason, detail)


@dataclass(slots=True)
class Table:
    """Rows in fixed slots: a thing keeps its slot as long as it is there; a new one takes the lowest free one."""

    address: int
    row_words: int
    capacity: int
    encode: Callable[[int], bytes]
    """Slot (from 0) → the whole row, big-endian bytes."""
    ids: list[int] = field(default_factory=list)
    """Id by slot, 0 = empty; retained."""
    generation: int = 0
    """Changes (by 2) whenever a slot is taken or freed."""

    def __post_init__(self) -> None:
        if not self.ids:
            self.ids = [0] * self.capacity

    @property
    def count(self) -> int:
        """Rows that a reader must take: the highest used slot, 0 = none."""
        return next((slot + 1 for slot in range(self.capacity - 1, -1, -1) if self.ids[slot]), 0)

    @property
    def words(self) -> int:
        return plc_map.TABLE_HEAD + self.capacity * self.row_words

    def take(self, id: int) -> int | None:
        """The slot that `id` has from now on, None when all are taken."""
        try:
            slot = self.ids.index(0)
        except ValueError:
            return None
        self.ids[slot] = id
        self.generation = self.generation + 2 & 0xFFFE
        return slot

    def free(self, slot: int) -> None:
        """Nothing is in `slot` any more."""
        self.ids[slot] = 0
        self.generation = self.generation + 2 & 0xFFFE

    def clear(self) -> None:
        """Nothing is in any slot."""
        self.ids = [0] * self.capacity
        self.generation = self.generation + 2 & 0xFFFE


class VirtualPlc(ABC):
    """A Pogon PLC. A machine gives images, settings, commands and its program; it must call `_start_up` when it is built."""

    type: str
    dt: float = DT
    TYPE_CODE: int
    """Word 3 of the header and of the training registers."""

    steps: int
    """Scans since the device was first switched on."""
    boots: int
    """Starts, the first one counted."""
    host_silent: bool
    _values: dict[str, float]
    _settings_generation: int
    _staged: list[int]
    _answers: list[Answer]
    _sequence: int
    _events_kept: int
    _acknowledged: int
    _ring: list[int]
    _hold: tuple[int, ...]
    _hold_counter: int
    _hold_age: float
    _host_heartbeat: int
    _host_age: float
    _heartbeat_from: int
    _command: tuple[int, ...]
    _scan_last: int
    _scan_max: int
    _overruns: int
    _initial: bool

    def __init__(
        self,
        *,
        settings: Sequence[Setting],
        settings_at: int,
        staging_at: int,
        images: Sequence[Image],
        configuration: int,
        tables: Sequence[Table] = (),
        capacities: Sequence[int] = (),
        faults: Sequence[int] = (),
        words: Mapping[int, int] | None = None,
        limits: Mapping[int, tuple[int, int]] | None = None,
        triggers: Sequence[int] = (),
    ) -> None:
        """`configuration`: address of the image whose check sum stands in the header; `capacities`: words 23–31 of the header;
        `faults`: codes of 0xE010; `words`, `limits`, `triggers`: the machine's own training registers, see `TrainingRegisters`."""
        self.stopwatch: Callable[[], float] | None = None
        """Seconds that rise, to measure a scan; never used by the program."""
        self.training = TrainingRegisters(
            self.TYPE_CODE,
            faults,
            words or {},
            limits={**training.COMMON_LIMITS, training.REG_POWER: (1, 1), **(limits or {})},
            triggers=(training.REG_POWER, *triggers),
        )
        self._settings = tuple(settings)
        self._pack_settings = Struct(f">{len(self._settings)}f")
        self._settings_at, self._staging_at = settings_at, staging_at
        self._settings_words = 2 * len(self._settings)
        self._images = {image.address: image for image in images}
        self._configuration_at = configuration
        self._tables = {table.address: table for table in tables}
        self._capacities = [*capacities, *(0,) * 9][:9]
        self._areas: list[tuple[int, int, Callable[[int, int], Sequence[int]]]] = []
        self._map_areas()
        self._cached: dict[int, Sequence[int]] = {}
        self._pending: list[tuple[int, tuple[int, ...]]] = []
        self._running: dict[int, Callable[[], AnswerState]] = {}
        self._executing = 0
        self._causing: dict[int, int] = {}
        self._forget_all()

    # ---- what a machine gives

    @property
    @abstractmethod
    def state(self) -> int:
        """Its state now, which a command may expect (`Request.expected`)."""

    @abstractmethod
    def _scan(self) -> None:
        """Program and physics of one scan."""

    @abstractmethod
    def _execute(self, request: Request) -> Verdict:
        """Do what a new command asks, or say why not."""

    @abstractmethod
    def _power_up(self) -> None:
        """Forget what is not retained; the base has done so with its part and counted the start in `boots`."""

    @abstractmethod
    def _forget(self) -> None:
        """Forget what is retained, too, and put the machine itself back to the beginning; `_power_up` follows."""

    def _settings_fault(self, values: Mapping[str, float]) -> int:
        """Number (from 1) of a setting that does not go with the others, 0 = none."""
        return 0

    def _settings_changed(self) -> None:  # noqa: B027
        """New settings are in effect."""

    def _trained(self, address: int, word: int) -> None:  # noqa: B027
        """The instructor wrote a training register that is the machine's own."""

    @property
    def host_timeout(self) -> float:
        """Within this time the host's heartbeat must change [s], 0 = not watched."""
        return 0.0

    # ---- the bus side

    @property
    def line_fault(self) -> LineFault:
        """What the instructor did to the line of this unit; only kept here."""
        return self.training.line_fault

    def telegram_seen(self) -> None:  # noqa: B027
        """A host that only reads is not alive to this device: its heartbeat is a register."""

    def read(self, function: int, address: int, count: int) -> list[int]:
        """Registers as of the last scan.

        Raises:
            DeviceException: 01 not function 03 or 23, 02 an address that is not mapped, 03 not 1–125 registers.
        """
        if is_training(address):
            return self.training.read(function, address, count)
        if function not in READING:
            raise DeviceException(1, f"{self.type}: function {function:02d}, expected 03 or 23")
        if not 1 <= count <= MAX_READ:
            raise DeviceException(3, f"{self.type}: {count} registers, expected 1 to {MAX_READ}")
        words: list[int] = []
        at, end = address, address + count
        for begin, after, give in self._areas:
            if begin <= at < after:
                part = min(end, after)
                words += give(at - begin, part - begin)
                at = part
                if at == end:
                    return words
        raise DeviceException(2, f"{self.type}: register 0x{at:04X} is not read")

    def write(self, function: int, address: int, words: Sequence[int]) -> None:
        """Check `words` now; they act at the begin of the next scan.

        Raises:
            DeviceException: 01 not function 06, 16 or 23, 02 an address that is not written, 03 a value or a number of words that
                its place does not take.
        """
        if is_training(address):
            self.training.check(function, address, words)
            self._pending.append((address, tuple(words)))
            return
        if function not in WRITING:
            raise DeviceException(1, f"{self.type}: function {function:02d}, expected 06, 16 or 23")
        if not words or (function == 6 and len(words) != 1) or not all(0 <= word <= 0xFFFF for word in words):
            raise DeviceException(3, f"{self.type}: {list(words)} with function {function:02d}")
        self._check(address, words)
        self._pending.append((address, tuple(words)))

    def _check(self, address: int, words: Sequence[int]) -> None:
        end = address + len(words)
        if plc_map.COMMAND <= address < plc_map.COMMAND + plc_map.COMMAND_WORDS:
            if address != plc_map.COMMAND or len(words) != plc_map.COMMAND_WORDS or not words[-1]:
                raise DeviceException(
                    3, f"{self.type}: a command is one write of 16 words that ends with an id above 0"
                )
        elif plc_map.HOLD <= address < plc_map.HOLD + plc_map.HOLD_WORDS:
            if address != plc_map.HOLD or len(words) != plc_map.HOLD_WORDS:
                raise DeviceException(3, f"{self.type}: hold-to-run is one write of 4 words")
        elif address == plc_map.EVENTS + plc_map.AT_ACKNOWLEDGED:
            if len(words) != 2 or words[0] << 16 | words[1] > self.newest:
                raise DeviceException(3, f"{self.type}: acknowledged is one write of 2 words, at most {self.newest}")
        elif address == plc_map.HEADER + plc_map.AT_HOST_HEARTBEAT:
            if len(words) != 1:
                raise DeviceException(2, f"{self.type}: register 0x{address + 1:04X} is not written")
        elif not self._staging_at <= address < end <= self._staging_at + self._settings_words:
            raise DeviceException(2, f"{self.type}: 0x{address:04X} + {len(words)} is not written")

    # ---- what a machine uses

    @property
    def time(self) -> int:
        """Device time [µs]: scans since the device was first switched on."""
        return round(self.steps * self.dt * 1_000_000)

    @property
    def hold(self) -> int:
        """Request bits of hold-to-run that count now; 0 once the counter stood still for 500 ms."""
        return self._hold[0] if self._hold_age <= plc_map.HOLD_TIMEOUT + 1e-9 else 0

    @property
    def hold_argument(self) -> float:
        """The number that came with hold-to-run."""
        return plc_map.real_of(self._hold[2] << 16 | self._hold[3])

    @property
    def newest(self) -> int:
        """Sequence of the last event."""
        return self._sequence

    @property
    def settings(self) -> dict[str, float]:
        """Setpoints in effect, by name. Not to be changed."""
        return self._values

    def event(self, code: int, source: int = 0, value: float = 0.0, snapshot: Sequence[int] = ()) -> None:
        """Put an event into the ring, with the time of this scan; those of one scan stand in the order of their calls."""
        self._sequence = self._sequence % 0xFFFFFFFF + 1
        request = self._executing or self._causing.get(code, 0)
        event = DeviceEvent(self._sequence, self.time, code, source, value, tuple(snapshot), request)
        row = self._sequence % EVENT_CAPACITY * plc_map.EVENT_WORDS
        self._ring[row : row + plc_map.EVENT_WORDS] = plc_map.event_words(event)
        self._events_kept = min(self._events_kept + 1, EVENT_CAPACITY)

    def causes(self, *codes: int) -> None:
        """Events with these codes in this scan come from the command that is being executed, though it has been answered by then."""
        self._causing |= dict.fromkeys(codes, self._executing)

    def power_cycle(self) -> None:
        """Supply off and on: the retained area stays, commands that ran have failed, writes not yet taken are gone."""
        self._pending = [write for write in self._pending if is_training(write[0])]
        for id in list(self._running):
            self._answer(id, AnswerState.FAILED)
        self._start_up()

    # ---- one scan

    def step(self) -> None:
        """One scan: writes act, watchdogs, program and physics, then the images are new."""
        watch = self.stopwatch
        began = watch() if watch else 0.0
        self.steps += 1
        self._hold_age += self.dt
        self._host_age += self.dt
        if self._pending:
            self._take_writes()
        self._watch_host()
        self._scan()
        if self._running:
            self._watch_running()
        self._causing.clear()
        self._cached.clear()
        if watch:
            self._scan_last = min(round((watch() - began) * 1_000_000), 0xFFFF)
            self._scan_max = max(self._scan_max, self._scan_last)
            self._overruns += self._scan_last > self.dt * 1_000_000

    def _take_writes(self) -> None:
        writes, self._pending = self._pending, []
        initial = cycle = False
        for address, words in writes:
            if is_training(address):
                for at, word in enumerate(words, address):
                    initial |= self.training.act(at, word)
                    cycle |= at == training.REG_POWER
                    if at not in training.COMMON and at != training.REG_POWER:
                        self._trained(at, word)
            elif address == plc_map.COMMAND:
                self._command = words
                self._take(plc_map.request_of(words))
            elif address == plc_map.HOLD:
                if words[1] != self._hold_counter:
                    self._hold_age, self._hold_counter = 0.0, words[1]
                self._hold = words
            elif address == plc_map.HEADER + plc_map.AT_HOST_HEARTBEAT:
                if words[0] != self._host_heartbeat and not self._host_deaf():
                    self._host_age, self._host_heartbeat = 0.0, words[0]
            elif address == plc_map.EVENTS + plc_map.AT_ACKNOWLEDGED:
                self._acknowledged = words[0] << 16 | words[1]
            else:
                at = address - self._staging_at
                self._staged[at : at + len(words)] = words
        if initial:
            self._forget_all()
            self._start_up()
            self.steps = 1
        elif cycle:
            self.power_cycle()

    def _take(self, request: Request) -> None:
        if any(answer.id == request.id for answer in self._answers):
            return
        self._executing = request.id
        verdict = self._judged(request)
        self._executing = 0
        answer = Answer(request.id, verdict.state, verdict.reason, verdict.detail & 0xFFFF, self.time)
        self._answers = [answer, *self._answers][: plc_map.ANSWERS_KEPT]
        if verdict.until:
            self._running[request.id] = verdict.until

    def _judged(self, request: Request) -> Verdict:
        if request.expected and request.expected != self.state:
            return rejected(REASON_WRONG_STATE, self.state)
        if request.code == plc_map.COMMIT_SETTINGS:
            return self._commit(request)
        return self._execute(request)

    def _commit(self, request: Request) -> Verdict:
        staged = pack(f">{self._settings_words}H", *self._staged)
        if request.arguments[0] != self._settings_words:
            return rejected(REASON_COUNT, self._settings_words)
        if request.arguments[1] != crc32(staged):
            return rejected(REASON_CRC)
        values = self._pack_settings.unpack(staged)
        for number, (setting, value) in enumerate(zip(self._settings, values, strict=True), 1):
            if not _single(setting.low) <= value <= _single(setting.high):
                return rejected(REASON_VALUE, number)
        taken = {setting.name: value for setting, value in zip(self._settings, values, strict=True)}
        if number := self._settings_fault(taken):
            return rejected(REASON_VALUE, number)
        self._values = taken
        self._settings_generation = self._settings_generation + 2 & 0xFFFE
        self._settings_changed()
        return Verdict()

    def _watch_host(self) -> None:
        limit = self.host_timeout
        self.host_silent = limit > 0 and self._host_age > limit + 1e-9

    def _host_deaf(self) -> bool:
        """Whether the host's heartbeat does not arrive (a fault of the instructor)."""
        return False

    def _watch_running(self) -> None:
        for id, until in list(self._running.items()):
            if (state := until()) is not AnswerState.RUNNING:
                self._answer(id, state)

    def _answer(self, id: int, state: AnswerState) -> None:
        """A command that ran has ended with `state`."""
        self._running.pop(id, None)
        self._answers = [
            Answer(id, state, answer.reason, answer.detail, self.time) if answer.id == id else answer
            for answer in self._answers
        ]

    # ---- states to begin with

    def _forget_all(self) -> None:
        """As never switched on before."""
        self.steps = 0
        self.boots = 0
        self.training.reset()
        self._pending = []
        self._running = {}
        self._answers = []
        self._values = {setting.name: _single(setting.default) for setting in self._settings}
        self._settings_generation = 0
        self._sequence = 0
        self._events_kept = 0
        self._acknowledged = 0
        self._ring = [0] * (EVENT_CAPACITY * plc_map.EVENT_WORDS)
        for table in self._tables.values():
            table.clear()
            table.generation = 0
        self._initial = True

    def _start_up(self) -> None:
        """What every power-up does, the machine's part last."""
        if self._initial:
            self._initial = False
            self._forget()
        self.boots += 1
        self.host_silent = False
        self._host_heartbeat, self._host_age = 0, 0.0
        self._hold = (0,) * plc_map.HOLD_WORDS
        self._hold_counter, self._hold_age = -1, 1.0
        self._command = (0,) * plc_map.COMMAND_WORDS
        self._staged = list(unpack(f">{self._settings_words}H", self._settings_bytes()))
        self._scan_last = self._scan_max = self._overruns = 0
        self._heartbeat_from = self.steps
        self._power_up()
        self._cached.clear()

    # ---- the register images

    def _map_areas(self) -> None:
        def area(address: int, words: int, give: Callable[[int, int], Sequence[int]]) -> None:
            self._areas.append((address, address + words, give))

        def kept(address: int, words: int, encode: Callable[[], Sequence[int]]) -> None:
            def give(first: int, after: int) -> Sequence[int]:
                image = self._cached.get(address)
                if image is None:
                    image = self._cached[address] = encode()
                return image[first:after]

            area(address, words, give)

        def image(it: Image) -> None:
            layout = Struct(f">{it.words - 2}H")
            kept(it.address, it.words, lambda: self._whole(layout.unpack(it.encode())))

        def table(it: Table) -> None:
            area(it.address, it.words, lambda first, after: self._table_words(it, first, after))

        kept(plc_map.HEADER, plc_map.HEADER_WORDS, self._header)
        for it in self._images.values():
            image(it)
        kept(self._settings_at, self._settings_words + 4, self._settings_image)
        area(self._staging_at, self._settings_words, lambda first, after: self._staged[first:after])
        area(plc_map.COMMAND, plc_map.COMMAND_WORDS, lambda first, after: self._command[first:after])
        kept(plc_map.ANSWERS, plc_map.ANSWERS_WORDS, self._answers_image)
        area(plc_map.HOLD, plc_map.HOLD_WORDS, lambda first, after: self._hold[first:after])
        kept(plc_map.EVENTS, plc_map.EVENTS_WORDS, self._events_image)
        ring = EVENT_CAPACITY * plc_map.EVENT_WORDS
        area(plc_map.EVENT_ROWS, ring, lambda first, after: self._ring[first:after])
        for each in self._tables.values():
            table(each)
        self._areas.sort(key=lambda one: one[0])
        for (_, after, _), (begin, _, _) in zip(self._areas, self._areas[1:], strict=False):
            assert after <= begin, f"registers overlap at 0x{begin:04X}"

    @property
    def generation(self) -> int:
        """Of everything that a scan may change: even, another after every scan."""
        return self.steps << 1 & 0xFFFE

    def _whole(self, payload: Sequence[int], generation: int | None = None) -> list[int]:
        mark = self.generation if generation is None else generation
        return [mark, *payload, mark]

    def _header(self) -> Sequence[int]:
        packed = _HEADER.pack(
            plc_map.MAGIC,
            plc_map.MAJOR,
            plc_map.MINOR,
            self.TYPE_CODE,
            self._configuration_crc(),
            plc_map.SIMULATED | plc_map.WRITABLE,
            self.boots & 0xFFFF,
            self.steps - self._heartbeat_from & 0xFFFF,
            self._host_heartbeat,
            min(round(self.host_timeout * 1000), 0xFFFF),
            self.time,
            plc_map.TimeQuality.FREE,
            self._scan_last,
            self._scan_max,
            self._overruns & 0xFFFF,
            self.steps,
            *self._capacities,
        )
        return unpack(f">{plc_map.HEADER_WORDS}H", packed)

    def _configuration_crc(self) -> int:
        """What the host compares to notice another configuration."""
        return crc32(self._images[self._configuration_at].encode())

    def _settings_bytes(self) -> bytes:
        return self._pack_settings.pack(*self._values.values())

    def _settings_image(self) -> Sequence[int]:
        values = unpack(f">{self._settings_words}H", self._settings_bytes())
        return self._whole((len(self._settings), *values, 0), self._settings_generation)

    def _answers_image(self) -> Sequence[int]:
        rows = [word for answer in self._answers for word in plc_map.answer_words(answer)]
        rows += [0] * (plc_map.ANSWERS_KEPT * plc_map.ANSWER_WORDS - len(rows))
        return self._whole(rows)

    def _events_image(self) -> Sequence[int]:
        oldest = self._sequence - self._events_kept + 1
        return self._whole(
            (
                EVENT_CAPACITY,
                plc_map.EVENT_WORDS,
                *plc_map.long_words(oldest),
                *plc_map.long_words(self._sequence),
                *plc_map.long_words(self._acknowledged),
            )
        )

    def _table_words(self, table: Table, first: int, after: int) -> Sequence[int]:
        """Only the rows that were asked for are encoded."""
        words: list[int] = []
        size = table.row_words
        if first < plc_map.TABLE_HEAD:
            words += [table.generation, table.capacity, table.count, size]
            begin = 0
        else:
            begin = first - (first - plc_map.TABLE_HEAD) % size
        row, last = max(0, begin - plc_map.TABLE_HEAD) // size, (after - plc_map.TABLE_HEAD - 1) // size
        for slot in range(row, last + 1):
            key = table.address + plc_map.TABLE_HEAD + slot * size
            encoded = self._cached.get(key)
            if encoded is None:
                encoded = self._cached[key] = unpack(f">{size}H", table.encode(slot))
            words += encoded
        return words[first - begin : after - begin]


def _single(value: float) -> float:
    """`value` as a float32 holds it."""
    return float(unpack(">f", pack(">f", value))[0])
