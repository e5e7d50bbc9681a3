"""A sequence tried out before it is taken: on a simulated plant of its own, with a gate of its own, in virtual time, on its own thread.

Nothing of the running plant is touched. The sequence and the machines that it names begin as the plant file says; machines behind real
lines are simulated, too. It is started once and watched until it has run through, has stopped, or waits for something that does not come;
beside that the tests of its file are run.
"""

import asyncio
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import Any, Protocol, cast

from app.clock import Clock, ManualClock, SystemClock
from app.commands.gate import Gate
from app.errors import ConfigurationError, PogonError
from app.links.contract import Exchange
from app.links.register_link import RegisterLink
from app.plant.definitions import Equipment, Plant
from app.plant.derive import Derivation
from app.plant.sequence_definition import SequenceTest
from app.plant.sequences import RUNNING
from app.registers import plc_map
from app.registers.plc_map import Request
from app.running.derived import DerivedPoints
from app.running.sequence_orders import GivenOrders, SequenceDesks
from app.running.tag_list import points_of, tag_of
from app.running.virtual_time import VirtualLoop
from app.sim.device import DT
from app.sim.plant import SimPlant, exchange
from app.sim.type_tests import TestResult, begun, tests_of
from app.tags.database import TagDatabase, TagTable

SETTLE = 3.0
"""Before it is started, so that every value has been read [s]."""
LOOK = DT
"""Between two looks at it [s]: a step may last a scan."""
PATIENCE = 60.0
"""A step that has no greatest time and does not go on for so long after its least is said to wait [s]."""
LONGEST = 1800.0
"""Simulated time of a trial [s]."""
WORD = 16
"""Bits of permissives."""
MOST_TIME = 40.0
"""Computing time of one, and of the tests of the file [s]."""


class Tried(Protocol):
    """The virtual device of a sequence, as far as a trial asks it."""

    block: Any
    """Its control block: `state`, `step`, `running`, `first_out`, `word(step)`."""

    def awaited(self, stopped: int) -> Sequence[int]:
        """Steps that may be entered next; `stopped`: the one in which it ended."""
        ...

    def preset(self, values: Mapping[str, float]) -> None:
        """Begin with these presets."""
        ...

    def write(self, function: int, address: int, words: Sequence[int]) -> None:
        """A telegram."""
        ...


@dataclass(frozen=True, slots=True)
class Passed:
    """A step that the trial went through, or stands in."""

    number: int
    entered: float
    """Since the start [s]."""
    left: float | None = None


@dataclass(slots=True)
class Trial:
    """What came of a trial."""

    outcome: str = ""
    """done, aborted, timed_out, waits, not_started, too_long, failed."""
    step: int = 0
    """Where it stands, or stopped; 0 = before the first."""
    missing: list[tuple[int, int]] = field(default_factory=list)
    """(step, bit) of what it lacks; step 0: an abort condition."""
    first_out: tuple[int, int] | None = None
    """(step, bit) that fell first."""
    order: int = 0
    """Number, from 1, of the order of this step that was refused or not confirmed; 0 = none."""
    reason: str = ""
    """Text key of why the gate did not carry it out."""
    params: Mapping[str, object] = field(default_factory=dict)
    seconds: float = 0.0
    """Simulated [s]."""
    steps: list[Passed] = field(default_factory=list)
    tests: list[TestResult] = field(default_factory=list)
    untested: int = 0
    """Tests that the time was not enough for."""
    error: str = ""
    """Of an outcome `failed`."""


def try_out(
    plant: Plant, id: str, given: SequenceTest | None = None, given_up: Callable[[], bool] = lambda: False
) -> Trial:
    """Try the sequence of the equipment `id` of `plant` out; `given`: the test whose presets the machine begins with.

    Takes up to 80 s of computing, less once it is `given_up`; call it on a thread.
    """
    with ThreadPoolExecutor(1, thread_name_prefix="trial") as one:  # a loop may run on the caller's thread
        return one.submit(_tried, plant, id, given, given_up).result()


def _tried(plant: Plant, id: str, given: SequenceTest | None, given_up: Callable[[], bool]) -> Trial:
    clock = ManualClock()
    try:
        small = _excerpt(plant, id)
        with asyncio.Runner(loop_factory=lambda: VirtualLoop(clock)) as runner:
            trial = runner.run(_Trial(small, small.equipment[id], given, clock, given_up).run())
    except PogonError as error:
        return Trial("failed", error=str(error))
    item = plant.equipment[id]
    assert item.sequence is not None
    if not any(step.orders for step in item.sequence.steps):
        _test(plant, item, trial, given_up)
    return trial


def _test(plant: Plant, item: Equipment, trial: Trial, given_up: Callable[[], bool]) -> None:
    """The tests of the file, as far as the time goes."""
    assert item.sequence is not None
    clock = SystemClock()
    end, run = clock.monotonic() + MOST_TIME, tests_of(item.type.name)
    for number, test in enumerate(item.sequence.tests if run else ()):
        if clock.monotonic() > end or given_up():
            trial.untested = len(item.sequence.tests) - number
            break
        alone = replace(item, sequence=replace(item.sequence, tests=(test,)))
        assert run is not None
        trial.tests += run(replace(plant, equipment={**plant.equipment, item.id: alone}), alone)


def _excerpt(plant: Plant, id: str) -> Plant:
    """The machines that the sequence has to do with, on lines in memory; what they say of other sequences comes along."""
    wanted, rest = dict[str, Equipment](), [id]
    while rest:
        name = rest.pop()
        item = plant.equipment.get(name)
        if item is None or name in wanted:
            continue
        wanted[name] = item
        rest += _named(item)
    options = {key: value for key, value in wanted[id].options.items() if key != "simulation"}
    wanted[id] = replace(wanted[id], options=options)  # it waits for its start, whatever the plant's begins with
    machines = {
        name: replace(item, link=f"trial-{item.link}") for name, item in plant.equipment.items() if name in wanted
    }
    lines = {
        f"trial-{name}": replace(link, name=f"trial-{name}", transport="memory", writes=True)
        for name, link in plant.links.items()
    }
    used = {item.link for item in machines.values()}
    return replace(
        plant, equipment=machines, links={name: link for name, link in lines.items() if name in used}, flow=()
    )


def _named(item: Equipment) -> Iterator[str]:
    if item.sequence is None:
        return
    if item.machine:
        yield item.machine
    yield from (name.partition(".")[0] for name in item.sequence.points)
    yield from (order.machine for step in item.sequence.steps for order in step.orders)


class _Trial:
    """One trial on its own plant."""

    def __init__(
        self,
        plant: Plant,
        item: Equipment,
        given: SequenceTest | None,
        clock: ManualClock,
        given_up: Callable[[], bool],
    ) -> None:
        assert item.sequence is not None
        self._given_up = given_up
        self._item, self._definition, self._given, self._clock = item, item.sequence, given, clock
        self._tags = tags = TagDatabase(clock)
        self._sim = SimPlant(plant, clock)
        self._links = {
            name: RegisterLink(link, plant.on_link(name), tags, clock, exchange=_over(self._sim, name))
            for name, link in plant.links.items()
        }
        tags.take(TagTable(tag_of(point, plant) for point in points_of(plant, self._links)))
        self._derived = DerivedPoints(tags, clock, None)
        self._derived.take(Derivation(plant))
        self._derived.renew()
        tags.subscribe(self._derived.follow)
        self._gate = Gate(tags, clock, writers=self._links, audit=_nowhere)
        self._gate.configure(plant)
        self._desks = SequenceDesks(lambda: self._gate, lambda: plant, self._links)
        self._desks.serve(self._sim, tags)
        device = self._sim.devices[item.id]
        self._device = cast(Tried, device)
        self._machine: Any = self._sim.devices.get(item.machine)

    async def run(self) -> Trial:
        """Start it and watch it to its end."""
        self._preset()
        works = [self._sim.run(), self._gate.run(), *(link.run() for link in self._links.values())]
        tasks = [asyncio.ensure_future(work) for work in works]
        try:
            return await self._watched()
        finally:
            await self._gate.close()
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

    def _preset(self) -> None:
        """As `given` says.

        Raises:
            ConfigurationError: the machine does not have what it says.
        """
        values = begun(self._machine, self._given.given if self._given else {})
        target: Any = self._machine or self._device
        try:
            if values:
                target.preset(values)
        except ValueError as error:
            raise ConfigurationError(f"given: {error}") from error

    async def _watched(self) -> Trial:
        real: Clock = SystemClock()
        trial, end = Trial(), real.monotonic() + MOST_TIME
        await asyncio.sleep(SETTLE)
        command = self._item.type.commands["start"]
        given = tuple(plc_map.real(one.default) for one in self._definition.recipe)
        self._device.write(16, plc_map.COMMAND, plc_map.request_words(Request(command.code, arguments=given, id=1)))
        began = since = self._clock.monotonic()
        at = 0
        while True:
            await asyncio.sleep(LOOK)
            now, run = self._clock.monotonic(), self._device.block
            trial.seconds = now - began
            step = run.step if run.running else at
            if step != at and run.running:
                self._enter(trial, step, trial.seconds)
                at, since = step, now
            if run.state not in RUNNING and (at or now - began > 1.0):
                return self._ended(trial, at)
            allowed = self._definition.steps[at - 1] if at else None
            patience = max(allowed.maximum, allowed.minimum) + PATIENCE if allowed else PATIENCE
            if now - since > patience or trial.seconds > LONGEST:
                return self._stopped(trial, "waits" if now - since > patience else "too_long", at)
            if real.monotonic() > end or self._given_up():
                return self._stopped(trial, "too_long", at)

    def _enter(self, trial: Trial, step: int, seconds: float) -> None:
        if not trial.steps and step > 1:  # the first one lasted no scan
            trial.steps.append(Passed(1, seconds))
        if trial.steps:
            trial.steps[-1] = replace(trial.steps[-1], left=seconds)
        trial.steps.append(Passed(step, seconds))

    def _ended(self, trial: Trial, at: int) -> Trial:
        run = self._device.block
        if _said(run) == "done":
            if trial.steps:
                trial.steps[-1] = replace(trial.steps[-1], left=trial.seconds)
            trial.outcome, trial.step = "done", at
            return trial
        if _said(run) == "idle":
            return self._stopped(trial, "not_started", 0)
        at = run.step or at  # of several that were active the one that stopped it
        self._stopped(trial, "timed_out" if _said(run) == "timed_out" else "aborted", at)
        failed: GivenOrders | None = self._desks.failure(self._item.id)
        if failed is not None and trial.outcome == "aborted":
            trial.order, trial.reason, trial.params = failed.refused, failed.reason, failed.params
        return trial

    def _stopped(self, trial: Trial, outcome: str, at: int) -> Trial:
        run = self._device.block
        trial.outcome, trial.step = outcome, at
        out = run.first_out
        if out is not None and out.bit >= 0:
            trial.first_out = (out.step, out.bit)
        for step in dict.fromkeys((0, *self._device.awaited(at))):
            word = run.word(step)
            trial.missing += [(step, bit) for bit in range(WORD) if not word >> bit & 1]
        return trial


def _said(run: Any) -> str:
    return str(run.state.name).lower()


def _over(sim: SimPlant, link: str) -> Exchange:
    return lambda unit, pdu: exchange(sim.buses[link], unit, pdu)


async def _nowhere(*_line: object, **_more: object) -> None:
    """The audit is for what was done to the plant."""
