"""A virtual PLC that runs one sequence: the block of app/blocks/sequence behind a register table, 10 ms a scan.

Its permissives are sentences over the signals of its machine (another virtual device, `attach`), its steps ask actions of it. Without a machine the
words come from training registers. Type code 20; the definition is `<plant>/sequences/<name>.toml`.

Header words 23–27: steps N · 16 · 59 events · 16 falls · 32 forces; the check sum is of steps, keys and sentences.

| registers | content |
| --- | --- |
| 0x0100, 64 words | status image: generation · +1 state · +2 active step · +3 bits · +4 steps · +5 abort word that counts · +6 its input · +7 forced · +8 forces · +9 abort conditions that may be forced · f32 +10 run time, +12 last run time [s] · u32 +14 runs done, +16 aborted, +18 timed out · f32 +20 shortest, +22 mean, +24 longest completed run [s] · +26 last outcome · +28 first-out: cause, +29 step, +30 bit (0xFFFF none), +31 at step, u64 +32 time [µs], f32 +36 value, +38 fallen together, +39 abort word · u64 +40 start of the run [µs] · +44 falls · +45 active steps · +46 values that a run takes · f32 +47, +49, +51, +53 those of the last start · generation |
| 0x0180, 16 words | configuration image: generation · steps · f32 +2 longest force [s] · +4 forces outlive a restart · generation |
| 0x0200, 8 words | settings image: generation · 2 · f32 stall_after [s] · f32 output_while_suspended · spare · generation; staged at 0x0240 |
| 0x0800, rows of 32 | steps: u32 number · generation · state · +4 word that counts · +5 input · +6 forced · +7 may be forced · f32 +8 minimum, +10 maximum, +12 elapsed [s] · +14 bits 0 loss aborts, 1 output · +15 word of the first-out · u32 +16 runs · f32 +18 least, +20 mean, +22 most, +24 last [s] · +26 bits lost in this run · +27 how often its loop went back · generation |
| 0x3000, 16 rows of 16 | falls of the active step, oldest first: u32 ordinal · generation · state 1 missing 2 back · +4 step · +5 bit · u64 +6 fell, +10 back [µs] · generation |
| 0x4000, 32 rows of 12 | forces: u32 step·16+bit+1 · generation · state 1 · +4 step · +5 bit · f32 +6 remaining [s] · u32 +8 asked [s] · +10 owner · generation |

State: 0 idle 1 running 2 suspended 3 done 4 timed out 5 aborted; of a step moreover 6 stalled (1 active). Bits: 0 stalled 1 needs acknowledge
2 single step 3 automatic 4 start possible 5 forces active 6 output on 7 the machine takes no actions (it is not in automatic)
8 safe steps are done. Active step: the lowest of several.

Commands: 1 start (as many f32 as it takes values of a run) · 2 suspend · 3 resume · 4 abort · 5 acknowledge · 6/7 single step on/off · 8 advance · 9/10 automatic on/off · 11 times (u32 step,
f32 minimum, f32 maximum, u32 override) · 12 force (u32 step, 0 = abort; u32 bit; f32 seconds) · 13 release (step, bit) · 14 release all.
Reasons: 1 unknown 2 wrong state 3 permissives missing (detail step·16+bit) 4 needs acknowledge 5 locked while running 6 no such step 7 no such
bit 8 may not be forced 9 duration 10 not forced 11 times outside limits 12 no free place for a force 13 not suspended 14 not in single step
15 the machine is not in automatic 16 a value of the run outside its limits, or not whole and the count of a loop (detail: its number) 17 a value of the run gives this time 20–22 settings.
Events 1–16, 23: `blocks.sequence.SequenceEvent`; 17 times changed · 18 power up · 19/20 automatic on/off · 21/22 single step on/off
· 24–27 values 1–4 of the run, behind its start. Source: step, of these none. Snapshot:
0 bit (0xFFFF none) · 1 together · 2 abort conditions as input · 3 input word of that step · 4–5 f32 value behind the permissive.

Retained: times, values of the last run, statistics, first-out, settings, events, forces if the definition says so. Training registers: 0xE010 = 1 freezes the inputs;
without a machine 0xE100 is the abort word, 0xE101 + n that of step n + 1; the first 15 of these also stand at 0xE020–0xE02E.

| subject | rule |
| --- | --- |
| unknown | a sentence that cannot be decided counts as missing |
| start_when | in automatic it starts when this becomes true and a start is possible; true all the time starts once |
| suspend_when | it stands still while this is true or cannot be decided, and goes on by itself |
| advance_when | in single step the step is left when this becomes true |
| commands of steps | `orders.py`; one that is refused or not confirmed aborts with cause 7, its number is the value of the first-out |
| suspend | acts whatever the state; of a sequence that does not run it does nothing |
| automatic | starts whenever a start is possible; off after a restart of the device |
| force | ends when its time is over, by the device, whatever host there is |
| falls | the first 16 of the active step have a row |
"""  # noqa: E501

from collections.abc import Mapping, Sequence
from math import nan
from typing import Any

from app.blocks.sequence import (
    ABORT,
    ALL,
    BITS,
    Report,
    SequenceBlock,
    SequenceEvent,
    SequenceSettings,
    StepSettings,
    awaited,
)
from app.errors import ConfigurationError
from app.plant.said import not_as, said
from app.plant.sequence_definition import SequenceDefinition, SequencePermissive
from app.plant.sequences import checksum
from app.registers.plc_map import Request, long_words, real
from app.sim import training
from app.sim.plc import EVENT_CAPACITY, Image, Setting, Table, Verdict, VirtualPlc
from app.sim.sequence import register_map as map
from app.sim.sequence import training as own
from app.sim.sequence.commands import CAUSED, SequenceCommands
from app.sim.sequence.forces import ForceRows
from app.sim.sequence.machine import Machine
from app.sim.sequence.operator import OperatorRequests
from app.sim.sequence.orders import StepOrders
from app.sim.sequence.permissives import Permissives
from app.sim.sequence.recipe import Recipe
from app.sim.sequence.register_map import FALL_ROWS, FORCE_ROWS, MOST_STEPS, NO_BIT, SequenceDeviceEvent
from app.sim.sequence.runs import OUTCOMES, RunCounts

FROZEN = 1
FAULTS = (FROZEN,)
"""Machine faults that the instructor can cause: the inputs stand still."""


def settings_of(definition: SequenceDefinition) -> SequenceSettings:
    """The block's settings of a definition.

    Raises:
        ConfigurationError: it has no step, too many, or times that cannot be.
    """
    if not 1 <= len(definition.steps) <= MOST_STEPS:
        raise ConfigurationError(
            not_as(
                said("mistake.steps_of", name=definition.name, number=len(definition.steps)),
                said("mistake.from_to", low=1, high=MOST_STEPS),
                "but_expected",
            )
        )
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
            chart=definition.chart,
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
    operator: OperatorRequests
    runs: RunCounts
    _commands: SequenceCommands
    _automatic_next: bool
    """Automatic is on after the next power-up: as it was configured, the first time only."""
    _was_on: bool
    """It was on before: what it retained is valid."""

    def __init__(self, definition: SequenceDefinition, *, automatic: bool = False) -> None:
        """A sequence that was never started; `automatic`: on at the first start of the device.

        Raises:
            ConfigurationError: a definition that cannot be run.
        """
        self.definition = definition
        self._settings_of = settings_of(definition)
        self._automatic_first = automatic
        self._count = len(definition.steps)
        self._crc = checksum(definition)
        self.permissives = Permissives(definition)
        self.orders = StepOrders(definition)
        self.recipe = Recipe(definition, self._take_inputs)
        self.permissives.recipe, self.orders.values = self.recipe.value, lambda: self.recipe.by_key
        self._wanted, self._wished = not definition.start_when, False
        self._actions = tuple(tuple(step.actions) for step in definition.steps)
        self._steps_table = Table(map.STEPS, map.STEP_WORDS, self._count, self._step_row)
        self._falls_table = Table(map.FALLS, map.FALL_WORDS, FALL_ROWS, self._fall_row)
        self._forces_table = Table(map.FORCES, map.FORCE_WORDS, FORCE_ROWS, self._force_row)
        self._forces = ForceRows(self._forces_table)
        super().__init__(
            settings=(
                Setting("stall_after", definition.stall_after, 0.1, 600.0),
                Setting("output_while_suspended", float(definition.output_while_suspended), 0.0, 1.0),
            ),
            settings_at=map.SETTINGS_AT,
            staging_at=map.STAGING,
            images=(
                Image(map.STATUS, map.STATUS_WORDS, self._status),
                Image(map.CONFIGURATION, map.CONFIGURATION_WORDS, self._configuration),
            ),
            configuration=map.CONFIGURATION,
            tables=(self._steps_table, self._falls_table, self._forces_table),
            capacities=(self._count, BITS, EVENT_CAPACITY, FALL_ROWS, FORCE_ROWS),
            faults=FAULTS,
            words=dict.fromkeys(_word_registers(self._count), ALL),
            limits=own.limits_of(self._count),
        )
        self._start_up()

    @property
    def machine(self) -> Machine | None:
        """What it is coupled with."""
        return self.permissives.machine

    def fits(self, machine: Machine) -> None:
        """Whether `machine` has what the definition names.

        Raises:
            ConfigurationError: a sentence or a step names what the machine does not have.
        """
        self.permissives.fits(machine)

    def attach(self, machine: Machine | None) -> None:
        """Couple with the device whose signals and actions the definition names; None = with none.

        Raises:
            ConfigurationError: see `fits`.
        """
        self.permissives.attach(machine)
        self._map.forget()

    def awaited(self, stopped: int) -> tuple[int, ...]:
        """Steps that may be entered next; `stopped`: the one in which it ended."""
        return awaited(self.block, stopped)

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

    @property
    def state(self) -> int:
        """State word."""
        return self.block.state

    def _scan(self) -> None:
        run, machine = self.block, self.machine
        self._take_inputs()
        self._take_wishes()
        if self.operator.automatic and self._commands.start_possible and self._wanted:
            self.operator.start_automatically()
            self._wanted = not self.permissives.has_wish("start_when")
        before = run.falls
        count, back = len(before), sum(1 for fall in before if fall.back)
        signals = self.operator.signals(self.permissives.words)
        signals.pending, signals.refused = self.orders.pending, self.orders.refused
        for report in run.scan(signals, self.dt, self.time):
            self.tell(report)
        self.orders.follow(run)
        if not run.running:
            self.operator.suspended = False
        falls = run.falls
        if falls is not before or len(falls) != count or sum(1 for fall in falls if fall.back) != back:
            self._renew_falls()
        self._commands.keep_forces()
        asked = [action for step in run.active if run.output(step) for action in self._actions[step - 1]]
        if machine is not None and asked:
            machine.ask(asked)

    def _take_wishes(self) -> None:
        """What the plant asks: to start (an edge), to stand still (as long as it says so, or nobody knows), to go on."""
        plant = self.permissives
        if plant.has_wish("start_when"):
            started = plant.wish("start_when") is True
            self._wanted = started and (self._wanted or not self._wished)
            self._wished = started
        self.operator.held = plant.has_wish("suspend_when") and plant.wish("suspend_when") is not False
        self.operator.advance = plant.wish("advance_when") is True

    def _take_inputs(self) -> None:
        if self.training[training.REG_MACHINE_FAULT] != FROZEN:
            self.permissives.take()

    def tell(self, report: Report) -> None:
        """Put what the block reports into the ring, and count it."""
        event, step, bit = report.event, report.step, report.bit
        words = self.permissives.words
        snapshot = (
            bit if bit >= 0 else NO_BIT,
            report.together,
            words[ABORT],
            words[step] if step else 0,
            *long_words(real(self.permissives.value(step, bit) if bit >= 0 else nan)),
        )
        self.event(event, step, report.value, snapshot)
        if event is SequenceEvent.STARTED:
            self.runs.begin(self.time)
            self._tell_recipe()
        elif event is SequenceEvent.PERMISSIVE_LOST:
            self.runs.lose(step, bit)
        elif event in OUTCOMES:
            self.runs.end(event, self.block.run_time)

    def _tell_recipe(self) -> None:
        """The values of the run that has just begun, each as an event of its own."""
        for number, value in enumerate(self.recipe.values, 1):
            code = SequenceDeviceEvent(SequenceDeviceEvent.RECIPE_1 + number - 1)
            self.event(code, 0, value, (NO_BIT, 0, 0, 0, *long_words(real(nan))))

    def _renew_falls(self) -> None:
        rows = min(len(self.block.falls), FALL_ROWS)
        self._falls_table.ids = [slot + 1 if slot < rows else 0 for slot in range(FALL_ROWS)]
        self._falls_table.generation = self._falls_table.generation + 2 & 0xFFFE

    def _execute(self, request: Request) -> Verdict:
        self._take_inputs()
        self.causes(*CAUSED.get(request.code, ()))
        return self._commands.execute(request)

    # ---- settings, training, power

    def _trained(self, address: int, word: int) -> None:
        number = address - (own.REG_WORDS if address >= own.REG_WORDS else own.REG_PERMISSIVES)
        if 0 <= number <= self._count:
            self._teach(number, word)

    def _teach(self, number: int, word: int) -> None:
        self.permissives.teach(number, word)
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
            chart=run.settings.chart,
        )

    def _forget(self) -> None:
        self.block = SequenceBlock(self._settings_of, self.permissives.value)
        self.runs = RunCounts()
        self.recipe.forget()
        self._forces.clear()
        self.permissives.forget()
        self._automatic_next = self._automatic_first
        self._was_on = False

    def _power_up(self) -> None:
        kept: Mapping[str, Any] = self.block.retained()
        ran = self.block.run_time
        self.block = SequenceBlock(self._settings_of, self.permissives.value)
        self.operator = OperatorRequests(automatic=self._automatic_next)
        self._automatic_next = False
        self._commands = SequenceCommands(self.block, self.permissives, self.operator, self._forces, self.recipe, self)
        self.permissives.take()
        self.event(SequenceDeviceEvent.POWER_UP, value=self.boots)
        for report in self.block.restore(kept, self.time) if self._was_on else ():
            self.tell(report)
            if report.event in OUTCOMES:
                self.runs.last = ran
        self._was_on = True
        self.orders.follow(self.block)
        self._take_settings()
        self.recipe.apply(self.block)
        if not self._steps_table.ids[0]:
            self._steps_table.ids = list(range(1, self._count + 1))
            self._steps_table.generation = 2
        self._renew_falls()
        self._commands.keep_forces()

    def _configuration_crc(self) -> int:
        return self._crc

    # ---- the register images

    def _status(self) -> bytes:
        return map.status(
            self.block,
            self.permissives.words,
            self.operator,
            self.runs,
            recipe=self.recipe.values,
            start_possible=self._commands.start_possible,
            machine_manual=self.permissives.machine_manual,
        )

    def _configuration(self) -> bytes:
        return map.configuration(self._count, self._settings_of)

    def _step_row(self, slot: int) -> bytes:
        number = slot + 1
        word, lost = self.permissives.words[number], self.runs.lost.get(number, 0)
        return map.step_row(self.block, number, word, lost, self.generation)

    def _fall_row(self, slot: int) -> bytes:
        return map.fall_row(self.block, slot, self.generation)

    def _force_row(self, slot: int) -> bytes:
        return map.force_row(self.block, self._forces, slot, self.time, self.generation)


def _forceable(permissives: Sequence[SequencePermissive]) -> int:
    return sum(1 << one.bit for one in permissives if one.forceable)
