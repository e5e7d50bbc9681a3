"""Tests of a sequence that its definition file holds: given, when, then, on virtual devices, faster than real time.

Each test has a fresh sequence and, if there is one, a fresh machine on a plant of their own; the same files give the same result every
time. Time 0 is after the presets of `given` and one scan; a machine is in automatic then unless `given` says otherwise.

| row | holds when |
| --- | --- |
| `within = t` | what it asks for is seen in any scan up to t |
| `at = t` | it is seen in the scan of t |
| `first_out` without a time | it is seen before the end |
| `never` | the sentence is true in no scan; unknown is not true |

Rows of `when` act before the scan of their time: a command of the sequence as a telegram (`arguments` by name), a fault of the
machine (of the sequence itself without one; 0 ends it), or presets. A test ends when every row with a time is decided and every row of
`when` has acted; without such rows 60 s after the last of `when`. A refused command does not fail a test, but is told with what failed.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import inf, isfinite
from typing import Any

from app.blocks.sequence import BITS, SequenceState, awaited
from app.clock import ManualClock, SystemClock
from app.errors import ConfigurationError, DeviceException
from app.plant.definitions import Command, Equipment, Plant, Type
from app.plant.expression import Expression, Reading, parse
from app.plant.sequence_definition import SequenceDefinition, SequenceTest
from app.registers import plc_map
from app.registers.codec import decode
from app.registers.plc_map import AnswerState, Request
from app.sim import training
from app.sim.device import DT
from app.sim.plant import SimPlant
from app.sim.plc import VirtualPlc
from app.sim.sequence.machine import Machine
from app.sim.sequence.program import VirtualSequence
from app.sim.type_tests import TestResult, begun
from app.tags.quality import GOOD, NO_DATA

IDLE_TIME = 60.0
"""How long a test without timed rows goes on after the last of `when` [s]."""


def run_tests(plant: Plant, equipment: Equipment | str) -> list[TestResult]:
    """Run the tests in the definition of a sequence, in their order.

    Raises:
        ConfigurationError: no such equipment, it has no sequence, or its virtual device cannot be built.
    """
    id = equipment if isinstance(equipment, str) else equipment.id
    item = plant.equipment.get(id)
    if item is None or item.sequence is None:
        raise ConfigurationError(f"{id}: expected an equipment with a sequence")
    return [_Run(plant, item, item.sequence, test).result() for test in item.sequence.tests]


@dataclass(slots=True)
class _Row:
    """A row of `then` while its test runs."""

    text: str
    holds: Callable[[], bool]
    until: float
    """Decided at the latest then [s]; infinite = at the end."""
    exact: bool = False
    never: bool = False
    seen: float | None = None
    """When it held first [s]."""
    failed: str = ""

    def look(self, now: float) -> None:
        """Judge this scan."""
        if self.failed or (self.seen is not None and not self.never):
            return
        if self.never:
            if self.holds():
                self.failed = f"it was at {now:.2f} s"
        elif self.exact:
            if now >= self.until - DT / 2:
                if self.holds():
                    self.seen = now
                else:
                    self.failed = "it was not"
        elif self.holds():
            self.seen = now
        elif now >= self.until - DT / 2:
            self.failed = "it was not"

    @property
    def decided(self) -> bool:
        return bool(self.failed) or self.seen is not None


@dataclass(slots=True)
class _Run:
    """One test on its own plant."""

    plant: Plant
    item: Equipment
    definition: SequenceDefinition
    test: SequenceTest
    said: list[str] = field(default_factory=list)
    sequence: VirtualSequence = field(init=False)
    machine: VirtualPlc | None = field(init=False)
    sim: SimPlant = field(init=False)
    _told: Machine | None = field(init=False)
    """The machine, if it has signals; asked at every step, so it is found out once."""
    _commands: int = 0

    def __post_init__(self) -> None:
        # It waits for the command that the test gives, whatever the plant's simulated one begins with.
        options = {key: value for key, value in self.item.options.items() if key != "simulation"}
        own = {self.item.id: replace(self.item, options=options)}
        if self.item.machine:
            own[self.item.machine] = self.plant.equipment[self.item.machine]
        for name in self.definition.points:
            id = name.partition(".")[0]
            own.setdefault(id, self.plant.equipment[id])
        links = {item.link: self.plant.links[item.link] for item in own.values()}
        self.sim = SimPlant(replace(self.plant, equipment=own, links=links), ManualClock())
        device = self.sim.devices[self.item.id]
        assert isinstance(device, VirtualSequence)
        self.sequence = device
        machine = self.sim.devices.get(self.item.machine)
        self.machine = machine if isinstance(machine, VirtualPlc) else None
        self._told = self.machine if isinstance(self.machine, Machine) else None

    def result(self) -> TestResult:
        """Run it to its end."""
        began, now = SystemClock().monotonic(), 0.0
        try:
            self._preset(begun(self.machine, self.test.given))
        except ValueError as error:
            return TestResult(self.test.name, False, f"given: {error}", 0.0, SystemClock().monotonic() - began)
        self.sim.step()
        rows = [self._row(row) for row in self.test.then]
        orders = list(self.test.when)
        last = max((_seconds(order, "at") for order in orders), default=0.0)
        timed = [row for row in rows if isfinite(row.until)]
        idle_until = 0.0 if timed else last + IDLE_TIME
        scans = 0
        while True:
            now = scans * DT
            due = [order for order in orders if _seconds(order, "at") <= now + DT / 2]
            for order in due:
                orders.remove(order)
                if refused := self._act(order):
                    return TestResult(self.test.name, False, refused, now, SystemClock().monotonic() - began)
            self.sim.step()
            if due:
                self._listen(due, now)
            for row in rows:
                row.look(now)
            if any(row.failed for row in rows):
                break  # what stands now says most about it
            if not orders and all(row.decided for row in timed) and now >= idle_until - DT / 2:
                break
            scans += 1
        finished = not any(row.failed for row in rows)
        for row in rows:
            if finished and not row.never and not row.decided:
                row.failed = "it was not"
        failed = [f"{row.text}: {row.failed}" for row in rows if row.failed]
        happened = "; ".join([*failed, *self.said, self._end(now)] if failed else [self._end(now)])
        return TestResult(self.test.name, not failed, happened, now, SystemClock().monotonic() - began)

    # ---- when

    def _preset(self, values: Mapping[str, float]) -> None:
        target: Any = self.machine or self.sequence
        target.preset(values)

    def _act(self, order: Mapping[str, object]) -> str:
        """Do what a row of `when` says; what was wrong with it."""
        where = f"when at {_seconds(order, 'at'):g} s"
        try:
            if "command" in order:
                command = self.item.type.commands[str(order["command"])]
                self._commands += 1
                arguments = _raw_arguments(command, order)
                request = Request(command.code, arguments=arguments, id=self._commands)
                self.sequence.write(16, plc_map.COMMAND, plc_map.request_words(request))
            elif "fault" in order:
                word = round(_seconds(order, "fault"))
                (self.machine or self.sequence).write(6, training.REG_MACHINE_FAULT, [word])
            elif isinstance(values := order.get("set"), Mapping):
                self._preset(values)
        except (DeviceException, ValueError) as error:
            return f"{where}: {error}"
        return ""

    def _listen(self, orders: Iterable[Mapping[str, object]], now: float) -> None:
        """Note which commands were refused."""
        names = [str(order["command"]) for order in orders if "command" in order]
        words = self.sequence.read(3, plc_map.ANSWERS, plc_map.ANSWERS_WORDS)
        answers = {answer.id: answer for answer in plc_map.answers_of(words) or ()}
        for id, name in enumerate(names, self._commands - len(names) + 1):
            answer = answers.get(id)
            if answer is not None and answer.state in (AnswerState.REJECTED, AnswerState.FAILED):
                reason = self.item.type.reasons.get(answer.reason, str(answer.reason))
                self.said.append(f"{name} at {now:g} s refused: {reason} ({answer.detail})")

    # ---- then

    def _row(self, row: Mapping[str, object]) -> _Row:
        never = "never" in row
        exact = "at" in row
        until = _seconds(row, "at") if exact else _seconds(row, "within") if "within" in row else inf
        when = f" at {until:g} s" if exact else f" within {until:g} s" if isfinite(until) else ""
        if "state" in row:
            state = SequenceState[str(row["state"]).upper()]
            return _Row(f"state {row['state']}{when}", lambda: self.sequence.block.state is state, until, exact)
        if "step" in row:
            number = [step.key for step in self.definition.steps].index(str(row["step"])) + 1
            return _Row(f"step {row['step']}{when}", lambda: self._active() == number, until, exact)
        if "first_out" in row:
            return _Row(
                f"first-out {row['first_out']}{when}", lambda: self._first_out() == row["first_out"], until, exact
            )
        text = str(row["never"] if never else row["expect"])
        sentence = parse(text, machines=True)
        return _Row(
            f'never "{text}"' if never else f'"{text}"{when}', lambda: self._true(sentence), until, exact, never
        )

    def _active(self) -> int:
        run = self.sequence.block
        return run.step if run.running else 0

    def _first_out(self) -> str:
        out = self.sequence.block.first_out
        found = self.definition.permissive(out.step, out.bit) if out and out.bit >= 0 else None
        return found.key if found else ""

    def _true(self, sentence: Expression) -> bool:
        return sentence.true(self._look) is True

    def _look(self, name: str) -> Reading:
        if "." in name:
            value = self.sim.point(name)
            return (value, GOOD) if isfinite(value) else (None, NO_DATA)
        machine = self.machine
        if self._told and name in self._told.signals:
            value = self._told.signal(name)
            return (value, GOOD) if isfinite(value) else (None, NO_DATA)
        item = self.sim.equipment[self.item.machine] if self.item.machine else self.item
        point = item.points.get(name)
        if point is None or point.register is None:
            return None, NO_DATA
        found = decode(point.register, (machine or self.sequence).read(3, point.register.address, point.register.words))
        return (found, GOOD) if isinstance(found, int | float) and isfinite(found) else (None, NO_DATA)

    def _end(self, now: float) -> str:
        """How things stand."""
        run = self.sequence.block
        steps = self.definition.steps
        said = [f"at {now:.2f} s {run.state.name.lower().replace('_', ' ')}"]
        if run.step:
            said.append(f"in step {run.step} {steps[run.step - 1].key}")
        if out := run.first_out:
            found = self._first_out() or ("nothing" if out.bit < 0 else f"bit {out.bit}")
            said.append(f"first-out {found} ({out.cause.name.lower().replace('_', ' ')})")
        following = awaited(run) if run.running or run.state is SequenceState.IDLE else ()
        if missing := self._missing(following):
            said.append(f"missing {', '.join(missing)}")
        return ", ".join(said)

    def _missing(self, steps: Sequence[int]) -> Sequence[str]:
        run = self.sequence.block
        return [
            one.key if (one := self.definition.permissive(step, bit)) else f"{step}.{bit}"
            for step in dict.fromkeys((0, *steps))
            for bit in range(BITS)
            if not run.word(step) >> bit & 1
        ]


def _raw_arguments(command: Command, order: Mapping[str, object]) -> tuple[int, ...]:
    """The four raw words of a command with `arguments` by name."""
    given = order.get("arguments", {})
    assert isinstance(given, Mapping)
    raw = [
        plc_map.real(given[one.name]) if one.type is Type.F32 else int(given[one.name]) & 0xFFFF_FFFF
        for one in command.arguments
    ]
    return (*raw, *[0] * (4 - len(raw)))


def _seconds(row: Mapping[str, object], key: str) -> float:
    value = row[key]
    assert isinstance(value, int | float)
    return float(value)
