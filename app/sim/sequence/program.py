"""A virtual PLC that runs one sequence: the block of app/blocks/sequence.py behind a register table, 10 ms a scan.

Its permissives are sentences over the signals of its machine (another virtual device, `attach`), its steps ask actions of it. Without a machine the
words come from training registers. Type code 20; the definition is `<plant>/sequences/<name>.toml`.

Header words 23–27: steps N · 16 · 59 events · 16 falls · 32 forces; the check sum is of steps, keys and sentences.

| registers | content |
| --- | --- |
| 0x0100, 64 words | status image: generation · +1 state · +2 active step · +3 bits · +4 steps · +5 abort word that counts · +6 its input · +7 forced · +8 forces · +9 abort conditions that may be forced · f32 +10 run time, +12 last run time [s] · u32 +14 runs done, +16 aborted, +18 timed out · f32 +20 shortest, +22 mean, +24 longest completed run [s] · +26 last outcome · +28 first-out: cause, +29 step, +30 bit (0xFFFF none), +31 at step, u64 +32 time [µs], f32 +36 value, +38 fallen together, +39 abort word · u64 +40 start of the run [µs] · +44 falls · generation |
| 0x0180, 16 words | configuration image: generation · steps · f32 +2 longest force [s] · +4 forces outlive a restart · generation |
| 0x0200, 8 words | settings image: generation · 2 · f32 stall_after [s] · f32 output_while_suspended · spare · generation; staged at 0x0240 |
| 0x0800, rows of 32 | steps: u32 number · generation · state · +4 word that counts · +5 input · +6 forced · +7 may be forced · f32 +8 minimum, +10 maximum, +12 elapsed [s] · +14 bits 0 loss aborts, 1 output · +15 word of the first-out · u32 +16 runs · f32 +18 least, +20 mean, +22 most, +24 last [s] · +26 bits lost in this run · generation |
| 0x3000, 16 rows of 16 | falls of the active step, oldest first: u32 ordinal · generation · state 1 missing 2 back · +4 step · +5 bit · u64 +6 fell, +10 back [µs] · generation |
| 0x4000, 32 rows of 12 | forces: u32 step·16+bit+1 · generation · state 1 · +4 step · +5 bit · f32 +6 remaining [s] · u32 +8 asked [s] · +10 owner · generation |

State: 0 idle 1 running 2 suspended 3 done 4 timed out 5 aborted; of a step moreover 6 stalled (1 active). Bits: 0 stalled 1 needs acknowledge
2 single step 3 automatic 4 start possible 5 forces active 6 output on 7 the machine takes no actions (it is not in automatic).

Commands: 1 start · 2 suspend · 3 resume · 4 abort · 5 acknowledge · 6/7 single step on/off · 8 advance · 9/10 automatic on/off · 11 times (u32 step,
f32 minimum, f32 maximum, u32 override) · 12 force (u32 step, 0 = abort; u32 bit; f32 seconds) · 13 release (step, bit) · 14 release all.
Reasons: 1 unknown 2 wrong state 3 permissives missing (detail step·16+bit) 4 needs acknowledge 5 locked while running 6 no such step 7 no such
bit 8 may not be forced 9 duration 10 not forced 11 times outside limits 12 no free place for a force 13 not suspended 14 not in single step
15 the machine is not in automatic 20–22 settings.
Events 1–16: `blocks.sequence.SequenceEvent`; 17 times changed · 18 power up · 19/20 automatic on/off · 21/22 single step on/off. Source: step. Snapshot:
0 bit (0xFFFF none) · 1 together · 2 abort conditions as input · 3 input word of that step · 4–5 f32 value behind the permissive.

Retained: times, statistics, first-out, settings, events, forces if the definition says so. Training registers: 0xE010 = 1 freezes the inputs;
without a machine 0xE100 is the abort word, 0xE101 + n that of step n + 1; the first 15 of these also stand at 0xE020–0xE02E.

| subject | rule |
| --- | --- |
| unknown | a sentence that cannot be decided counts as missing |
| suspend | acts whatever the state; of a sequence that does not run it does nothing |
| automatic | starts whenever a start is possible; off after a restart of the device |
| force | ends when its time is over, by the device, whatever host there is |
| falls | the first 16 of the active step have a row |
"""  # noqa: E501

from collections.abc import Callable, Mapping, Sequence
from enum import IntEnum
from math import isfinite, nan
from struct import Struct, pack
from types import MappingProxyType
from typing import Any, Protocol, runtime_checkable

from app.blocks.sequence import (
    ABORT,
    ALL,
    BITS,
    ForceRefused,
    Report,
    SequenceBlock,
    SequenceEvent,
    SequenceSettings,
    SequenceState,
    Signals,
    StepSettings,
)
from app.errors import ConfigurationError
from app.plant.definitions import SequenceDefinition, SequencePermissive
from app.plant.expression import parse
from app.plant.sequences import checksum
from app.registers.plc_map import AnswerState, Request, long_words, real, real_of
from app.sim import training
from app.sim.plc import (
    EVENT_CAPACITY,
    REASON_UNKNOWN,
    REASON_WRONG_STATE,
    Image,
    Setting,
    Table,
    Verdict,
    VirtualPlc,
)
from app.sim.plc import rejected as no
from app.sim.sequence import training as own
from app.tags.quality import GOOD, NO_DATA

STATUS, CONFIGURATION, SETTINGS_AT, STAGING = 0x0100, 0x0180, 0x0200, 0x0240
STATUS_WORDS, CONFIGURATION_WORDS = 64, 16
STEPS, FALLS, FORCES = 0x0800, 0x3000, 0x4000
STEP_WORDS, FALL_WORDS, FORCE_WORDS = 32, 16, 12
FALL_ROWS, FORCE_ROWS = 16, 32
MOST_STEPS = 200
LONGEST = 36000.0
"""Of a step's times [s]."""
FROZEN = 1
FAULTS = (FROZEN,)
"""Machine faults that the instructor can cause: the inputs stand still."""
NO_BIT = 0xFFFF


class SequenceCommand(IntEnum):
    """Command codes."""

    START = 1
    SUSPEND = 2
    RESUME = 3
    ABORT = 4
    ACKNOWLEDGE = 5
    SINGLE_ON, SINGLE_OFF = 6, 7
    ADVANCE = 8
    AUTOMATIC_ON, AUTOMATIC_OFF = 9, 10
    SET_TIMES = 11
    FORCE = 12
    RELEASE = 13
    RELEASE_ALL = 14


class SequenceReason(IntEnum):
    """Why a command is refused; 20–22 come from the base."""

    UNKNOWN = REASON_UNKNOWN
    WRONG_STATE = REASON_WRONG_STATE
    MISSING = 3
    NEEDS_ACKNOWLEDGE = 4
    LOCKED = 5
    NO_SUCH_STEP = 6
    NO_SUCH_BIT = 7
    FORBIDDEN = 8
    DURATION = 9
    NOT_FORCED = 10
    TIMES = 11
    NO_PLACE = 12
    NOT_SUSPENDED = 13
    NOT_SINGLE = 14
    MACHINE = 15


class SequenceDeviceEvent(IntEnum):
    """Codes of the ring beside those of the block (`SequenceEvent`)."""

    TIMES_CHANGED = 17
    POWER_UP = 18
    AUTOMATIC_ON, AUTOMATIC_OFF = 19, 20
    SINGLE_ON, SINGLE_OFF = 21, 22


@runtime_checkable
class Machine(Protocol):
    """What a sequence uses of the device it is coupled with."""

    type: str
    signals: Sequence[str]
    """Names that `signal` knows."""
    actions: Sequence[str]
    """Names that `ask` knows."""

    @property
    def takes_actions(self) -> bool:
        """Whether it does what is asked: it is in automatic."""
        ...

    def signal(self, name: str) -> float:
        """The value of a point now."""
        ...

    def ask(self, actions: Sequence[str]) -> None:
        """Ask for actions in the next scan."""
        ...


REASON_OF: Mapping[str, SequenceReason] = MappingProxyType(
    {"forbidden": SequenceReason.FORBIDDEN, "duration": SequenceReason.DURATION}
)


def settings_of(definition: SequenceDefinition) -> SequenceSettings:
    """The block's settings of a definition.

    Raises:
        ConfigurationError: it has no step, too many, or times that cannot be.
    """
    if not 1 <= len(definition.steps) <= MOST_STEPS:
        raise ConfigurationError(f"{definition.name}: {len(definition.steps)} steps, expected 1 to {MOST_STEPS}")
    try:
        return SequenceSettings(
            tuple(
                StepSettings(step.minimum, step.maximum, step.loss_aborts, _forceable(step.permissives))
                for step in definition.steps
            ),
            abort_forceable=_forceable(definition.abort),
            output_while_suspended=definition.output_while_suspended,
            stall_after=definition.stall_after,
            longest_force=definition.longest_force,
            keep_forces=definition.keep_forces,
        )
    except ValueError as error:
        raise ConfigurationError(f"{definition.name}: {error}") from error


def _word_registers(steps: int) -> list[int]:
    """Training registers of the permissive words."""
    first = range(own.REG_PERMISSIVES, own.REG_PERMISSIVES + own.PERMISSIVE_WORDS)
    return [*first, *range(own.REG_WORDS, own.REG_WORDS + steps + 1)]


class VirtualSequence(VirtualPlc):
    """The PLC of one sequence."""

    type = "sequence"
    TYPE_CODE = own.TYPE_CODE

    block: SequenceBlock
    automatic: bool
    single: bool
    runs_done: int
    runs_aborted: int
    runs_timed_out: int
    shortest: float
    longest: float
    total: float
    """Of all completed runs [s]."""
    last_run: float
    last_outcome: int
    run_start: int
    _pulses: set[str]
    _pulsed: set[str]
    _suspended: bool
    _words: tuple[int, ...]
    _lost: dict[int, int]
    _asked: dict[int, tuple[int, int]]
    _start_automatic: bool
    _was_on: bool
    """It was on before: what it retained is valid."""
    _taught: list[int]
    """Words of a sequence without a machine."""

    def __init__(self, definition: SequenceDefinition, *, automatic: bool = False) -> None:
        """A sequence that was never started; `automatic`: on at the first start of the device.

        Raises:
            ConfigurationError: a definition that cannot be run.
        """
        self.definition = definition
        self._settings_of = settings_of(definition)
        self.machine: Machine | None = None
        self._start_automatic_in = automatic
        self._count = len(definition.steps)
        self._crc = checksum(definition)
        words = tuple(definition.permissives(number) for number in range(self._count + 1))
        sentences: list[str] = []
        for permissives in words:
            sentences += [one.when for one in permissives if one.when]
        sentences = list(dict.fromkeys(sentences))
        self._sentences = tuple(parse(text) for text in sentences)
        self._reads = tuple(
            tuple((one.bit, sentences.index(one.when)) for one in permissives if one.when) for permissives in words
        )
        self._names = tuple(dict.fromkeys(name for sentence in self._sentences for name in sorted(sentence.names)))
        self._unnamed = tuple(ALL & ~sum(1 << one.bit for one in permissives) for permissives in words)
        self._value_of = {
            (number, one.bit): one.value for number, permissives in enumerate(words) for one in permissives if one.value
        }
        self._no_memory()
        self._actions = tuple(tuple(step.actions) for step in definition.steps)
        self._steps_table = Table(STEPS, STEP_WORDS, self._count, self._step_row)
        self._falls_table = Table(FALLS, FALL_WORDS, FALL_ROWS, self._fall_row)
        self._forces_table = Table(FORCES, FORCE_WORDS, FORCE_ROWS, self._force_row)
        super().__init__(
            settings=(
                Setting("stall_after", definition.stall_after, 0.1, 600.0),
                Setting("output_while_suspended", float(definition.output_while_suspended), 0.0, 1.0),
            ),
            settings_at=SETTINGS_AT,
            staging_at=STAGING,
            images=(
                Image(STATUS, STATUS_WORDS, self._status),
                Image(CONFIGURATION, CONFIGURATION_WORDS, self._configuration),
            ),
            configuration=CONFIGURATION,
            tables=(self._steps_table, self._falls_table, self._forces_table),
            capacities=(self._count, BITS, EVENT_CAPACITY, FALL_ROWS, FORCE_ROWS),
            faults=FAULTS,
            words=dict.fromkeys(_word_registers(self._count), ALL),
            limits=own.limits_of(self._count),
        )
        self._start_up()

    def fits(self, machine: Machine) -> None:
        """Whether `machine` has what the definition names.

        Raises:
            ConfigurationError: a sentence or a step names what the machine does not have.
        """
        known, can, name = set(machine.signals), set(machine.actions), self.definition.name
        for sentence in self._sentences:
            if strangers := sorted(sentence.names - known):
                raise ConfigurationError(
                    f'{name}: "{sentence.text}" names {", ".join(strangers)}, expected signals of {machine.type}'
                )
        for number in range(self._count + 1):
            for one in self.definition.permissives(number):
                if not one.when or (one.value and one.value not in known):
                    missing = f"value {one.value}" if one.when else "no sentence"
                    raise ConfigurationError(f"{name}: {one.key} has {missing}, expected signals of {machine.type}")
        for step in self.definition.steps:
            if strangers := sorted(set(step.actions) - can):
                raise ConfigurationError(
                    f"{name}: step {step.key} asks {', '.join(strangers)}, "
                    f"expected of {machine.type}: {', '.join(machine.actions)}"
                )

    def attach(self, machine: Machine | None) -> None:
        """Couple with the device whose signals and actions the definition names; None = with none.

        Raises:
            ConfigurationError: see `fits`.
        """
        if machine is not None:
            self.fits(machine)
        self.machine = machine
        self._no_memory()
        self._words = self._inputs()
        self._areas.forget()

    def _no_memory(self) -> None:
        self._signals: dict[str, float] = {}
        self._true: list[bool] = []
        self._said = self._unnamed

    def preset(self, values: Mapping[str, float]) -> None:
        """Of a sequence without a machine: its permissive words, `word_0` (abort conditions) to `word_<steps>`.

        Raises:
            ValueError: no such word, or not 16 bits.
        """
        for name, value in values.items():
            number = int(name[5:]) if name.startswith("word_") and name[5:].isdecimal() else -1
            if not 0 <= number <= self._count:
                raise ValueError(f"preset {name}: expected word_0 to word_{self._count}")
            if not (0 <= value <= ALL and value == int(value)):
                raise ValueError(f"preset {name} = {value:g}: expected 0 to {ALL}")
            self._teach(number, int(value))

    # ---- one scan

    def _scan(self) -> None:
        run, machine = self.block, self.machine
        if self.training[training.REG_MACHINE_FAULT] != FROZEN:
            self._words = self._inputs()
        if self.automatic and "start" not in self._pulsed and self._start_possible():
            self._pulses.add("start")
        pulses, self._pulses = self._pulses, set()
        self._pulsed = pulses
        signals = Signals(
            self._words[1:],
            self._words[0],
            start="start" in pulses,
            suspend=self._suspended,
            abort_request="abort" in pulses,
            acknowledge="acknowledge" in pulses,
            single=self.single,
            advance="advance" in pulses,
        )
        before = run.falls
        count, back = len(before), sum(1 for fall in before if fall.back)
        for report in run.scan(signals, self.dt, self.time):
            self._tell(report)
        if not run.running:
            self._suspended = False
        falls = run.falls
        if falls is not before or len(falls) != count or sum(1 for fall in falls if fall.back) != back:
            self._renew_falls()
        self._renew_forces()
        if machine is not None and run.running and run.output(run.step) and (actions := self._actions[run.step - 1]):
            machine.ask(actions)

    def _inputs(self) -> tuple[int, ...]:
        """The permissive words as they are, abort conditions first."""
        if self.machine is None:
            return tuple(word | free for word, free in zip(self._taught, self._unnamed, strict=True))
        signal, before = self.machine.signal, self._signals
        now = self._signals = {name: signal(name) for name in self._names}
        if now == before and self._true:
            return self._said
        changed = False
        for n, sentence in enumerate(self._sentences):
            if n < len(self._true) and all(now[name] == before.get(name) for name in sentence.names):
                continue
            holds = sentence.true(lambda name: (now[name], GOOD) if isfinite(now[name]) else (None, NO_DATA)) is True
            if n < len(self._true):
                changed |= self._true[n] is not holds
                self._true[n] = holds
            else:
                changed = True
                self._true.append(holds)
        if not changed:
            return self._said
        self._said = tuple(
            word | sum(1 << bit for bit, n in reads if self._true[n])
            for word, reads in zip(self._unnamed, self._reads, strict=True)
        )
        return self._said

    def _value(self, step: int, bit: int) -> float:
        """What is behind a permissive; NaN = nothing, or not known."""
        name = self._value_of.get((step, bit))
        return self.machine.signal(name) if name and self.machine else nan

    def _tell(self, report: Report) -> None:
        event, step, bit = report.event, report.step, report.bit
        snapshot = (
            bit if bit >= 0 else NO_BIT,
            report.together,
            self._words[ABORT],
            self._words[step] if step else 0,
            *long_words(real(self._value(step, bit) if bit >= 0 else nan)),
        )
        self.event(event, step, report.value, snapshot)
        if event is SequenceEvent.STARTED:
            self.run_start, self._lost = self.time, {}
        elif event is SequenceEvent.PERMISSIVE_LOST:
            self._lost[step] = self._lost.get(step, 0) | 1 << bit
        elif event in _OUTCOMES:
            self._count_run(event)

    def _count_run(self, event: SequenceEvent) -> None:
        seconds = self.block.run_time
        self.last_outcome, self.last_run = _OUTCOMES[event], seconds
        if event is SequenceEvent.ABORTED:
            self.runs_aborted += 1
        elif event is SequenceEvent.TIMED_OUT:
            self.runs_timed_out += 1
        else:
            self.shortest = min(self.shortest, seconds) if self.runs_done else seconds
            self.longest = max(self.longest, seconds)
            self.total += seconds
            self.runs_done += 1

    def _renew_falls(self) -> None:
        rows = min(len(self.block.falls), FALL_ROWS)
        self._falls_table.ids = [slot + 1 if slot < rows else 0 for slot in range(FALL_ROWS)]
        self._falls_table.generation = self._falls_table.generation + 2 & 0xFFFE

    def _renew_forces(self) -> None:
        held = {step * BITS + bit + 1 for step, bit in self.block.forces}
        table = self._forces_table
        for slot, id in enumerate(table.ids):
            if id and id not in held:
                table.free(slot)
                self._asked.pop(id, None)

    # ---- commands

    @property
    def state(self) -> int:
        """State word."""
        return self.block.state

    @property
    def _machine_manual(self) -> bool:
        return self.machine is not None and not self.machine.takes_actions

    def _missing(self, number: int) -> int:
        """Lowest permissive of a step (0 = abort) that is missing now, -1 = none."""
        word = ~(self._words[number] | self.block.forced(number)) & ALL
        return (word & -word).bit_length() - 1

    def _start_possible(self) -> bool:
        run = self.block
        if run.running or run.needs_acknowledge or self._machine_manual:
            return False
        return self._missing(ABORT) < 0 and self._missing(1) < 0

    def _execute(self, request: Request) -> Verdict:
        if self.training[training.REG_MACHINE_FAULT] != FROZEN:
            self._words = self._inputs()
        code = request.code
        if code in _SIMPLE:
            self.causes(*_CAUSED.get(code, ()))
            return _SIMPLE[SequenceCommand(code)](self)
        if code == SequenceCommand.SET_TIMES:
            return self._set_times(request)
        if code == SequenceCommand.FORCE:
            return self._force(request)
        if code == SequenceCommand.RELEASE:
            return self._release(request.arguments[0], request.arguments[1])
        return no(SequenceReason.UNKNOWN)

    def _command_start(self) -> Verdict:
        run = self.block
        if run.running:
            return no(SequenceReason.WRONG_STATE, self.state)
        if run.needs_acknowledge:
            return no(SequenceReason.NEEDS_ACKNOWLEDGE)
        if self._machine_manual:
            return no(SequenceReason.MACHINE)
        for number in (ABORT, 1):
            if (bit := self._missing(number)) >= 0:
                return no(SequenceReason.MISSING, number * BITS + bit)
        self._pulses.add("start")
        return self._proved(lambda: self.block.running)

    def _command_suspend(self) -> Verdict:
        self._suspended = self.block.running or "start" in self._pulses
        return Verdict()

    def _command_resume(self) -> Verdict:
        if self.block.state is not SequenceState.SUSPENDED:
            return no(SequenceReason.NOT_SUSPENDED, self.state)
        self._suspended = False
        return Verdict()

    def _command_abort(self) -> Verdict:
        if not self.block.running:
            return no(SequenceReason.WRONG_STATE, self.state)
        self._pulses.add("abort")
        return self._proved(lambda: not self.block.running)

    def _command_acknowledge(self) -> Verdict:
        if self.block.running:
            return no(SequenceReason.WRONG_STATE, self.state)
        self._pulses.add("acknowledge")
        return self._proved(lambda: not self.block.needs_acknowledge)

    def _command_single(self, on: bool) -> Verdict:
        if self.single is not on:
            self.single = on
            self.event(SequenceDeviceEvent.SINGLE_ON if on else SequenceDeviceEvent.SINGLE_OFF, self.block.step)
        return Verdict()

    def _command_automatic(self, on: bool) -> Verdict:
        if self.automatic is not on:
            self.automatic = on
            self.event(SequenceDeviceEvent.AUTOMATIC_ON if on else SequenceDeviceEvent.AUTOMATIC_OFF)
        return Verdict()

    def _command_advance(self) -> Verdict:
        run = self.block
        if not self.single:
            return no(SequenceReason.NOT_SINGLE)
        if run.state is not SequenceState.RUNNING:
            return no(SequenceReason.WRONG_STATE, self.state)
        step, times = run.step, run.settings.step(run.step)
        if step < self._count and (bit := self._missing(step + 1)) >= 0:
            return no(SequenceReason.MISSING, (step + 1) * BITS + bit)
        if not times.maximum or run.elapsed(step) + self.dt < times.minimum - 1e-6:
            return no(SequenceReason.WRONG_STATE, self.state)
        self._pulses.add("advance")
        return self._proved(lambda: run.step != step or not run.running)

    def _command_release_all(self) -> Verdict:
        places = list(self.block.forces)
        for step, bit in places:
            self._release(step, bit)
        return Verdict(detail=len(places))

    def _proved(self, holds: Callable[[], bool]) -> Verdict:
        """Running until the scan that follows has shown whether it happened."""
        return Verdict(AnswerState.RUNNING, until=lambda: AnswerState.DONE if holds() else AnswerState.FAILED)

    def _set_times(self, request: Request) -> Verdict:
        step, override = request.arguments[0], request.arguments[3]
        minimum, maximum = real_of(request.arguments[1]), real_of(request.arguments[2])
        if not 1 <= step <= self._count:
            return no(SequenceReason.NO_SUCH_STEP, step)
        if not (0 <= minimum <= LONGEST and 0 <= maximum <= LONGEST) or (maximum and maximum < minimum):
            return no(SequenceReason.TIMES, step)
        if self.block.running and override != 1:
            return no(SequenceReason.LOCKED, step)
        self.block.set_times(step, minimum, maximum)
        self.event(SequenceDeviceEvent.TIMES_CHANGED, step, maximum, (NO_BIT, 0, 0, 0, *long_words(real(minimum))))
        return Verdict(detail=step)

    def _force(self, request: Request) -> Verdict:
        step, bit = request.arguments[0], request.arguments[1]
        if not 0 <= step <= self._count:
            return no(SequenceReason.NO_SUCH_STEP, step)
        if not 0 <= bit < BITS or self._unnamed[step] >> bit & 1:
            return no(SequenceReason.NO_SUCH_BIT, bit)
        seconds, id = real_of(request.arguments[2]), step * BITS + bit + 1
        new = (step, bit) not in self.block.forces
        if new and 0 not in self._forces_table.ids:
            return no(SequenceReason.NO_PLACE)
        try:
            report = self.block.force(step, bit, seconds, self.time)
        except ForceRefused as refusal:
            return no(REASON_OF[refusal.reason], id - 1)
        if new:
            self._forces_table.take(id)
        self._asked[id] = (round(seconds), request.owner)
        self._tell(report)
        return Verdict(detail=id - 1)

    def _release(self, step: int, bit: int) -> Verdict:
        if not 0 <= step <= self._count:
            return no(SequenceReason.NO_SUCH_STEP, step)
        if not 0 <= bit < BITS:
            return no(SequenceReason.NO_SUCH_BIT, bit)
        report = self.block.release(step, bit)
        if report is None:
            return no(SequenceReason.NOT_FORCED, step * BITS + bit)
        self._tell(report)
        self._renew_forces()
        return Verdict(detail=step * BITS + bit)

    # ---- settings, training, power

    def _trained(self, address: int, word: int) -> None:
        number = address - (own.REG_WORDS if address >= own.REG_WORDS else own.REG_PERMISSIVES)
        if 0 <= number <= self._count:
            self._teach(number, word)

    def _teach(self, number: int, word: int) -> None:
        self._taught[number] = word
        self.training.act(own.REG_WORDS + number, word)
        if number < own.PERMISSIVE_WORDS:
            self.training.act(own.REG_PERMISSIVES + number, word)

    def _settings_changed(self) -> None:
        self._take_settings()

    def _take_settings(self) -> None:
        run = self.block
        run.settings = SequenceSettings(
            run.settings.steps,
            abort_forceable=run.settings.abort_forceable,
            output_while_suspended=self.settings["output_while_suspended"] >= 0.5,
            stall_after=self.settings["stall_after"],
            longest_force=run.settings.longest_force,
            keep_forces=run.settings.keep_forces,
        )

    def _forget(self) -> None:
        self.block = SequenceBlock(self._settings_of, self._value)
        self.runs_done = self.runs_aborted = self.runs_timed_out = self.last_outcome = self.run_start = 0
        self.shortest = self.longest = self.total = self.last_run = 0.0
        self._asked, self._lost = {}, {}
        self._taught = [ALL] * (self._count + 1)
        self._start_automatic = self._start_automatic_in
        self._was_on = False

    def _power_up(self) -> None:
        kept: Mapping[str, Any] = self.block.retained()
        ran = self.block.run_time
        self.block = SequenceBlock(self._settings_of, self._value)
        self._pulses, self._pulsed = set(), set()
        self._suspended = self.single = False
        self.automatic, self._start_automatic = self._start_automatic, False
        self._words = self._inputs()
        self.event(SequenceDeviceEvent.POWER_UP, value=self.boots)
        for report in self.block.restore(kept, self.time) if self._was_on else ():
            self._tell(report)
            if report.event in _OUTCOMES:
                self.last_run = ran
        self._was_on = True
        self._take_settings()
        if not self._steps_table.ids[0]:
            self._steps_table.ids = list(range(1, self._count + 1))
            self._steps_table.generation = 2
        self._renew_falls()
        self._renew_forces()

    def _configuration_crc(self) -> int:
        return self._crc

    # ---- the register images

    def _status(self) -> bytes:
        run, out = self.block, self.block.first_out
        running = run.running
        bits = (
            run.stalled,
            run.needs_acknowledge,
            self.single,
            self.automatic,
            self._start_possible(),
            bool(run.forces),
            running and run.output(run.step),
            self._machine_manual,
        )
        forced = run.forced(ABORT)
        return _STATUS.pack(
            run.state,
            run.step,
            sum(1 << n for n, bit in enumerate(bits) if bit),
            self._count,
            self._words[ABORT] | forced,
            self._words[ABORT],
            forced,
            len(run.forces),
            run.settings.abort_forceable,
            run.run_time if running else self.last_run,
            self.last_run,
            self.runs_done & 0xFFFFFFFF,
            self.runs_aborted & 0xFFFFFFFF,
            self.runs_timed_out & 0xFFFFFFFF,
            self.shortest,
            self.total / self.runs_done if self.runs_done else 0.0,
            self.longest,
            self.last_outcome,
            0,
            out.cause if out else 0,
            out.step if out else 0,
            out.bit if out and out.bit >= 0 else NO_BIT,
            out.at_step if out else 0,
            out.time if out else 0,
            out.value if out else nan,
            out.together if out else 0,
            self._snapshot(ABORT),
            self.run_start,
            len(run.falls),
        )

    def _snapshot(self, number: int) -> int:
        out = self.block.first_out
        return out.snapshot[number] if out and number < len(out.snapshot) else 0

    def _configuration(self) -> bytes:
        settings = self._settings_of
        packed = pack(">HfH", self._count, settings.longest_force, settings.keep_forces)
        return packed.ljust(2 * (CONFIGURATION_WORDS - 2), b"\0")

    def _step_row(self, slot: int) -> bytes:
        run, number, mark = self.block, slot + 1, self.generation
        settings, times = run.settings.step(number), run.times[slot]
        forced = run.forced(number)
        return _STEP.pack(
            number,
            mark,
            run.step_state(number),
            self._words[number] | forced,
            self._words[number],
            forced,
            settings.forceable,
            settings.minimum,
            settings.maximum,
            run.elapsed(number),
            settings.loss_aborts | run.output(number) << 1,
            self._snapshot(number),
            times.runs,
            times.least,
            times.mean,
            times.most,
            times.last,
            self._lost.get(number, 0),
            mark,
        )

    def _fall_row(self, slot: int) -> bytes:
        mark = self.generation
        if not self._falls_table.ids[slot] or slot >= len(self.block.falls):
            return _FALL.pack(0, mark, 0, 0, 0, 0, 0, mark)
        fall = self.block.falls[slot]
        return _FALL.pack(slot + 1, mark, 2 if fall.back else 1, fall.step, fall.bit, fall.fell, fall.back, mark)

    def _force_row(self, slot: int) -> bytes:
        id, mark = self._forces_table.ids[slot], self.generation
        if not id:
            return _FORCE.pack(0, mark, 0, 0, 0, 0.0, 0, 0, mark)
        step, bit = divmod(id - 1, BITS)
        asked, owner = self._asked.get(id, (0, 0))
        return _FORCE.pack(id, mark, 1, step, bit, self.block.remaining(step, bit, self.time), asked, owner, mark)


_STATUS = Struct(">9H2f3I3f2H4HQf2HQH36x")
_STEP = Struct(">I6H3f2HI4fH8xH")
_FALL = Struct(">I4HQQ2xH")
_FORCE = Struct(">I4HfIHH")
_OUTCOMES: Mapping[SequenceEvent, int] = MappingProxyType(
    {
        SequenceEvent.DONE: int(SequenceState.DONE),
        SequenceEvent.TIMED_OUT: int(SequenceState.TIMED_OUT),
        SequenceEvent.ABORTED: int(SequenceState.ABORTED),
    }
)
_CAUSED: Mapping[int, tuple[SequenceEvent, ...]] = {
    SequenceCommand.START: (SequenceEvent.STARTED, SequenceEvent.START_REFUSED),
    SequenceCommand.SUSPEND: (SequenceEvent.SUSPENDED,),
    SequenceCommand.RESUME: (SequenceEvent.RESUMED,),
    SequenceCommand.ABORT: (SequenceEvent.ABORTED,),
    SequenceCommand.ACKNOWLEDGE: (SequenceEvent.ACKNOWLEDGED,),
    SequenceCommand.ADVANCE: (SequenceEvent.STEP_ENDED,),
}
"""Events of the scan that takes a command and that the block tells after it."""
_SIMPLE: Mapping[SequenceCommand, Callable[[VirtualSequence], Verdict]] = MappingProxyType(
    {
        SequenceCommand.START: VirtualSequence._command_start,
        SequenceCommand.SUSPEND: VirtualSequence._command_suspend,
        SequenceCommand.RESUME: VirtualSequence._command_resume,
        SequenceCommand.ABORT: VirtualSequence._command_abort,
        SequenceCommand.ACKNOWLEDGE: VirtualSequence._command_acknowledge,
        SequenceCommand.SINGLE_ON: lambda plc: plc._command_single(True),
        SequenceCommand.SINGLE_OFF: lambda plc: plc._command_single(False),
        SequenceCommand.ADVANCE: VirtualSequence._command_advance,
        SequenceCommand.AUTOMATIC_ON: lambda plc: plc._command_automatic(True),
        SequenceCommand.AUTOMATIC_OFF: lambda plc: plc._command_automatic(False),
        SequenceCommand.RELEASE_ALL: VirtualSequence._command_release_all,
    }
)


def _forceable(permissives: Sequence[SequencePermissive]) -> int:
    return sum(1 << one.bit for one in permissives if one.forceable)
