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
| time | scans x dt since the device was first switched on: equal to the bit for the same writes; paused or faster, it is real time |
| scan time | read from `stopwatch`, 0 without one: what was measured never enters the program |
| host | its heartbeat must change within the host time-out once that is above 0 |
| training | 0xE030 = initial state, retained area included; 0xE031 = power off and on, retained area kept |
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence

from app.errors import DeviceException
from app.registers import plc_map
from app.registers.plc_map import AnswerState, Request
from app.sim import training
from app.sim.device import check_room
from app.sim.plc.areas import Image, Table
from app.sim.plc.command_area import CommandArea
from app.sim.plc.header import Header
from app.sim.plc.hold import HoldRequest
from app.sim.plc.host import HostWatch
from app.sim.plc.real_time import RealTime
from app.sim.plc.register_map import RegisterMap
from app.sim.plc.ring import EventRing
from app.sim.plc.scan_time import ScanTime
from app.sim.plc.settings import Setting, Settings
from app.sim.plc.verdict import REASON_WRONG_STATE, Verdict, rejected
from app.sim.plc.writes import check_write
from app.sim.training import LineFault, TrainingRegisters, is_training

MAX_READ = 125
HEARTBEAT_AT = plc_map.HEADER + plc_map.AT_HOST_HEARTBEAT
READING, WRITING = (3, 23), (6, 16, 23)


class VirtualPlc(RealTime, ABC):
    """A Pogon PLC. A machine gives images, settings, commands and its program; it must call `_start_up` when it is built."""

    type: str
    TYPE_CODE: int
    """Word 3 of the header and of the training registers."""

    boots: int
    """Starts, the first one counted."""
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
        self.scan_time = ScanTime()
        self.training = TrainingRegisters(
            self.TYPE_CODE,
            faults,
            words or {},
            limits={**training.COMMON_LIMITS, training.REG_POWER: (1, 1), **(limits or {})},
            triggers=(training.REG_POWER, *triggers),
        )
        self._settings = Settings(settings)
        self._command_area = CommandArea(self._judged)
        self._ring = EventRing()
        self._hold = HoldRequest()
        self._host_watch = HostWatch()
        self._header = Header(self.TYPE_CODE, capacities, self.scan_time, self._host_watch)
        self._staging_at = staging_at
        self._tables = tables
        self._map = RegisterMap(
            lambda: self.generation,
            header=self._header_words,
            images=images,
            configuration=configuration,
            tables=tables,
            settings=(settings_at, staging_at, self._settings),
            commands=self._command_area,
            hold=self._hold,
            ring=self._ring,
        )
        self._pending: list[tuple[int, tuple[int, ...]]] = []
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

    def _settings_changed(self) -> None:
        """New settings are in effect."""

    def _trained(self, address: int, word: int) -> None:
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

    def telegram_seen(self) -> None:
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
        words = self._map.read(address, count)
        if len(words) < count:
            raise DeviceException(2, f"{self.type}: register 0x{address + len(words):04X} is not read")
        return words

    def write(self, function: int, address: int, words: Sequence[int]) -> None:
        """Check `words` now; they act at the begin of the next scan.

        Raises:
            DeviceException: 01 not function 06, 16 or 23, 02 an address that is not written, 03 a value or a number of words that
                its place does not take, 06 too many writes wait.
        """
        check_room(self.type, len(self._pending))
        if is_training(address):
            self.training.check(function, address, words)
            self._pending.append((address, tuple(words)))
            return
        if function not in WRITING:
            raise DeviceException(1, f"{self.type}: function {function:02d}, expected 06, 16 or 23")
        if not words or (function == 6 and len(words) != 1) or not all(0 <= word <= 0xFFFF for word in words):
            raise DeviceException(3, f"{self.type}: {list(words)} with function {function:02d}")
        staging = range(self._staging_at, self._staging_at + self._settings.words)
        check_write(self.type, address, words, newest=self.newest, staging=staging)
        if address == HEARTBEAT_AT and self._pending and self._pending[-1][0] == address:
            self._pending.pop()  # a device that stands still hears of it for hours
        self._pending.append((address, tuple(words)))

    # ---- what a machine uses

    @property
    def host_silent(self) -> bool:
        """Whether the host's heartbeat stood still for longer than the host time-out."""
        return self._host_watch.silent

    @property
    def hold(self) -> int:
        """Request bits of hold-to-run that count now; 0 once the counter stood still for 500 ms."""
        return self._hold.bits

    @property
    def hold_argument(self) -> float:
        """The number that came with hold-to-run."""
        return self._hold.argument

    @property
    def newest(self) -> int:
        """Sequence of the last event."""
        return self._ring.newest

    @property
    def settings(self) -> dict[str, float]:
        """Setpoints in effect, by name. Not to be changed."""
        return self._settings.values

    def event(self, code: int, source: int = 0, value: float = 0.0, snapshot: Sequence[int] = ()) -> None:
        """Put an event into the ring, with the time of this scan; those of one scan stand in the order of their calls."""
        self._ring.add(self.time, code, source, value, snapshot, self._command_area.cause_of(code))

    def causes(self, *codes: int) -> None:
        """Events with these codes in this scan come from the command that is being executed, though it has been answered by then."""
        self._command_area.causes(codes)

    def power_cycle(self) -> None:
        """Supply off and on: the retained area stays, commands that ran have failed, writes not yet taken are gone."""
        self._pending = [write for write in self._pending if is_training(write[0])]
        self._command_area.fail(self.time)
        self._start_up()

    # ---- one scan

    def step(self) -> None:
        """One scan: writes act, watchdogs, program and physics, then the images are new."""
        self.scan_time.begin()
        passed = self._scanned()
        self._hold.step(passed)
        self._host_watch.step(passed)
        if self._pending:
            self._take_writes()
        self._host_watch.judge(self.host_timeout)
        self._scan()
        self._command_area.end_scan(self.time)
        self._map.forget()
        self.scan_time.end(self.dt)

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
                self._command_area.take(words, self.time)
            elif address == plc_map.HOLD:
                self._hold.take(words)
            elif address == HEARTBEAT_AT:
                if not self._host_deaf():
                    self._host_watch.take(words[0])
            elif address == plc_map.EVENTS + plc_map.AT_ACKNOWLEDGED:
                self._ring.acknowledged = words[0] << 16 | words[1]
            else:
                self._settings.stage(address - self._staging_at, words)
        if initial:
            self._forget_all()
            self._start_up()
            self.steps = 1
        elif cycle:
            self.power_cycle()

    def _judged(self, request: Request) -> Verdict:
        if request.expected and request.expected != self.state:
            return rejected(REASON_WRONG_STATE, self.state)
        if request.code == plc_map.COMMIT_SETTINGS:
            verdict = self._settings.commit(request, self._settings_fault)
            if verdict.state is AnswerState.DONE:
                self._settings_changed()
            return verdict
        return self._execute(request)

    def _host_deaf(self) -> bool:
        """Whether the host's heartbeat does not arrive (a fault of the instructor)."""
        return False

    # ---- states to begin with

    def _forget_all(self) -> None:
        """As never switched on before."""
        self.steps = 0
        self._beside = 0.0
        self.boots = 0
        self.training.reset()
        self._pending = []
        self._command_area.clear()
        self._settings.clear()
        self._ring.clear()
        for table in self._tables:
            table.clear()
            table.generation = 0
        self._initial = True

    def _start_up(self) -> None:
        """What every power-up does, the machine's part last."""
        if self._initial:
            self._initial = False
            self._forget()
        self.boots += 1
        self._host_watch.start_up()
        self._hold.start_up()
        self._command_area.start_up()
        self._settings.start_up()
        self.scan_time.start_up()
        self._header.start_up(self.steps)
        self._power_up()
        self._map.forget()

    @property
    def generation(self) -> int:
        """Of everything that a scan may change: even, another after every scan."""
        return self.steps << 1 & 0xFFFE

    def _header_words(self) -> Sequence[int]:
        return self._header.words(
            configuration=self._configuration_crc(),
            boots=self.boots,
            scans=self.steps,
            time=self.time,
            host_timeout=self.host_timeout,
        )

    def _configuration_crc(self) -> int:
        """What the host compares to notice another configuration."""
        return self._map.configuration_crc()
