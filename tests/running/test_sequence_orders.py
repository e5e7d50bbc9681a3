"""A sequence that this server runs commands any machine of the plant the way a person does, and every machine's points decide about it."""

import asyncio
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from pathlib import Path
from types import MappingProxyType
from typing import Any

import pytest

from app.access.roles import Person, permissions_of
from app.blocks.sequence import Cause, SequenceState
from app.registers import plc_map
from app.registers.plc_map import Request
from app.running.sequence_orders import is_sequence
from app.runtime import Runtime
from app.settings import Settings
from app.sim.sequence.program import VirtualSequence
from app.tags.quality import is_good
from tests.virtual import inline, loop_clock

PLANT = """
[plant]
name = "Hall"
timezone = "UTC"
[links.drives]
transport = "memory"
[links.line]
transport = "memory"
[equipment.m1]
type = "eura_e800"
link = "drives"
unit = 1
[equipment.m2]
type = "eura_e800"
link = "drives"
unit = 2
[equipment.c1]
type = "conveyor"
link = "line"
unit = 11
preset = "model"
[equipment.seq1]
type = "sequence"
link = "line"
unit = 21
definition = "work"
"""
FEED = """
[sequence]
label = "Feed"
[[steps]]
key = "run"
label = "Run both"
minimum = 0.5
maximum = 60
[[steps.orders]]
machine = "c1"
action = "select_automatic"
[[steps.orders]]
machine = "c1"
action = "start"
[[steps.orders]]
machine = "m1"
action = "run_forward"
values = { frequency = 30 }
[steps.permissives.0]
key = "no_fault"
label = "No fault"
when = "m1.status != 4 and c1.automatic == 0"
[[steps]]
key = "stop"
label = "Stop both"
minimum = 0.1
maximum = 60
[[steps.orders]]
machine = "m1"
action = "stop"
[[steps.orders]]
machine = "c1"
action = "stop"
[steps.permissives.1]
key = "at_speed"
label = "At speed"
when = "m1.frequency > 29.5 and c1.automatic == 1"
value = "m1.frequency"
[abort.0]
key = "drive_there"
label = "The drive is there"
when = "m1.status in (0, 1, 2, 3)"
"""
NONE: Mapping[str, str] = MappingProxyType({})
ANA = Person(7, "ana", "Ana Kos", frozenset({"operator"}), permissions_of({"operator"}), "session-of-ana")


class Hall:
    """A running plant with one sequence."""

    def __init__(self, runtime: Runtime) -> None:
        self.runtime = runtime
        self._id = 0

    @property
    def device(self) -> VirtualSequence:
        found = self.runtime.sim.devices["seq1"] if self.runtime.sim else None
        assert isinstance(found, VirtualSequence)
        return found

    @property
    def state(self) -> SequenceState:
        return self.device.block.state

    def ask(self, code: int, *given: float) -> None:
        self._id += 1
        arguments = tuple(plc_map.real(one) for one in given)
        self.device.write(16, plc_map.COMMAND, plc_map.request_words(Request(code, arguments=arguments, id=self._id)))

    def value(self, name: str) -> Any:
        tags = self.runtime.tags
        return tags.sample(name).value if name in tags and is_good(tags.sample(name).quality) else None

    @property
    def failure(self) -> tuple[int, str, dict[str, object]] | None:
        found = self.runtime.desks.failure("seq1")
        return (found.refused, found.reason, dict(found.params)) if found else None

    async def until(self, true: Callable[[], object], limit: float = 60.0) -> None:
        end = asyncio.get_running_loop().time() + limit
        while not true():
            assert asyncio.get_running_loop().time() < end, (self.state, self.failure)
            await asyncio.sleep(0.02)

    async def started(self, *given: float) -> "Hall":
        await asyncio.sleep(1)
        await self.until(
            lambda: self.device.permissives.missing(1, 0) < 0 and self.device.permissives.missing(0, 0) < 0
        )
        self.ask(1, *given)
        await self.until(lambda: self.device.block.running or self.state is SequenceState.ABORTED, 2.0)
        return self

    def outcomes(self, machine: str) -> list[tuple[str, str, str]]:
        gate = self.runtime.gate
        assert gate
        return [(one.command, str(one.state), one.person) for one in reversed(gate.history(machine))]


@asynccontextmanager
async def hall(
    folder: Path, work: str = FEED, plant: str = PLANT, others: Mapping[str, str] = NONE, **settings: Any
) -> AsyncIterator[Hall]:
    (folder / "plant" / "sequences").mkdir(parents=True)
    (folder / "plant" / "plant.toml").write_text(plant, "utf-8")
    for name, text in {"work": work, **others}.items():
        (folder / "plant" / "sequences" / f"{name}.toml").write_text(text, "utf-8")
    runtime = Runtime(Settings(plant=folder / "plant", data=folder / "data", **settings), loop_clock(), inline)
    await runtime.start()
    try:
        assert runtime.plant is not None, runtime.problems
        yield Hall(runtime)
    finally:
        await runtime.stop()


@pytest.mark.sweep(8)
async def test_a_drive_and_a_conveyor_run_side_by_side_and_every_command_is_confirmed(tmp_path: Path) -> None:
    async with hall(tmp_path) as plant:
        await plant.started()
        await plant.until(lambda: plant.state is SequenceState.DONE)
        who = "Feed"
        assert plant.outcomes("m1") == [
            ("set_frequency", "confirmed", who), ("forward", "confirmed", who), ("stop", "confirmed", who)
        ]  # fmt: skip
        assert [one[:2] for one in plant.outcomes("c1")] == [
            ("select_automatic", "confirmed"), ("start_automatic", "confirmed"), ("stop", "confirmed")
        ]  # fmt: skip
        assert plant.value("m1.frequency") == 0 and plant.value("c1.automatic") == 0
        assert plant.runtime.gate and plant.runtime.gate.control.holder("m1") is None, "its control is given back"


async def test_a_machine_that_a_person_holds_is_not_taken_and_the_sequence_stops_with_the_reason(
    tmp_path: Path,
) -> None:
    async with hall(tmp_path) as plant:
        gate = plant.runtime.gate
        assert gate
        gate._state.rights = gate.control._rights = lambda person: person  # Ana has no session in this house
        gate.control.take(ANA, "m1")
        await plant.started()
        await plant.until(lambda: plant.state is SequenceState.ABORTED, 5.0)
        out = plant.device.block.first_out
        assert out and (out.cause, out.at_step, out.value) == (Cause.COMMAND, 1, 3.0), "the third command of the step"
        failure = plant.runtime.desks.failure("seq1")
        assert failure and (failure.reason, failure.params["display"]) == ("why.held", "Ana Kos")
        await plant.until(lambda: plant.value("c1.automatic") == 0 and plant.value("c1.moving") == 0)
        assert gate.control.holder("m1").person == "7" and gate.control.holder("c1") is None  # type: ignore[union-attr]


async def test_what_the_gate_refuses_stops_the_sequence_and_what_ran_beside_it(tmp_path: Path) -> None:
    """The drive is asked for more than its F111 allows: known only to the gate, when it runs."""
    async with hall(tmp_path, FEED.replace("frequency = 30", "frequency = 600")) as plant:
        await plant.started()
        await plant.until(lambda: plant.state is SequenceState.ABORTED, 10.0)
        out = plant.device.block.first_out
        assert out and (out.cause, out.value) == (Cause.COMMAND, 3.0)
        assert plant.outcomes("m1")[0][:2] == ("set_frequency", "refused")
        await plant.until(lambda: plant.value("c1.automatic") == 0 and plant.value("c1.moving") == 0)


@pytest.mark.sweep(8)
async def test_a_bad_point_fulfils_nothing_and_an_abort_condition_that_asks_it_stops_what_runs(tmp_path: Path) -> None:
    async with hall(tmp_path, FEED.replace("minimum = 0.5", "minimum = 50")) as plant:
        await plant.started()
        await plant.until(lambda: plant.value("m1.frequency") and plant.value("m1.frequency") > 29)
        plant.runtime.sim.devices["m1"].write(6, 0xE011, [1])  # type: ignore[union-attr]
        await plant.until(lambda: plant.state is SequenceState.ABORTED, 20.0)
        out = plant.device.block.first_out
        assert out and (out.cause, out.step, out.bit) == (Cause.ABORT_CONDITION, 0, 0)
        await plant.until(lambda: plant.value("c1.automatic") == 0)
        progress = plant.runtime.gate.progress("m1") if plant.runtime.gate else None
        assert progress and progress.command == "stop", "asked again and again until it is read back"


@pytest.mark.sweep(8)
async def test_suspended_everything_stands_and_resumed_it_runs_again(tmp_path: Path) -> None:
    async with hall(tmp_path, FEED.replace("minimum = 0.5", "minimum = 30")) as plant:
        await plant.started()
        await plant.until(lambda: plant.value("m1.frequency") and plant.value("m1.frequency") > 29)
        plant.ask(2)
        await plant.until(lambda: plant.value("m1.frequency") == 0 and plant.value("c1.moving") == 0)
        assert plant.state is SequenceState.SUSPENDED
        plant.ask(3)
        await plant.until(lambda: (plant.value("m1.frequency") or 0) > 29 and plant.value("c1.automatic") == 1)
        await plant.until(lambda: plant.state is SequenceState.DONE)


@pytest.mark.sweep(8)
async def test_the_plant_starts_it_suspends_it_and_lets_it_go_on(tmp_path: Path) -> None:
    head = 'label = "Feed"\nstart_when = "m2.status == 1"\nsuspend_when = "m2.frequency > 20"\n'
    work = FEED.replace('label = "Feed"\n', head, 1).replace("minimum = 0.5", "minimum = 5")
    async with hall(tmp_path, work) as plant:
        await plant.until(lambda: plant.device.permissives.missing(1, 0) < 0)
        plant.ask(9)
        await asyncio.sleep(2)
        assert plant.state is SequenceState.IDLE, "automatic alone starts nothing"
        gate = plant.runtime.gate
        assert gate
        gate._state.rights = gate._state.checks._rights = gate.control._rights = lambda person: person
        for key, argument in (("set_frequency", 30.0), ("forward", None)):
            gate.control.take(ANA, "m2")
            nonce = gate.nonces.issue(ANA.session)
            await gate.ask(ANA, "m2", key, argument=argument, nonce=nonce, confirmed=True)
            await asyncio.sleep(1)
        await plant.until(lambda: plant.state is SequenceState.SUSPENDED, 20)
        await gate.ask(ANA, "m2", "stop")
        await plant.until(lambda: plant.state is SequenceState.RUNNING, 20)
        await plant.until(lambda: plant.state is SequenceState.DONE)
        assert not is_sequence(ANA)


async def by_ana(plant: Hall, machine: str, command: str, **asked: Any) -> None:
    """Ana gives a command, and takes control first where she needs it."""
    gate = plant.runtime.gate
    assert gate
    gate._state.rights = gate._state.checks._rights = gate.control._rights = lambda person: person
    if command != "stop":
        gate.control.take(ANA, machine)
    nonce = gate.nonces.issue(ANA.session)
    await gate.ask(ANA, machine, command, nonce=nonce, confirmed=True, **asked)
    await plant.until(lambda: (last := gate.progress(machine)) and last.over)
    last = gate.progress(machine)
    assert last and last.state == "confirmed", last


@pytest.mark.sweep(8)
async def test_a_machine_that_a_person_runs_goes_on_when_a_sequence_does_not_get_it(tmp_path: Path) -> None:
    work = '[sequence]\nlabel = "Work"\n' + "".join(
        f'[[steps]]\nkey = "run_{n}"\nlabel = "Run"\nminimum = 0.5\nmaximum = 60\n'
        f'[[steps.orders]]\nmachine = "{machine}"\naction = "{action}"\n'
        for n, (machine, action) in enumerate((("c1", "start"), ("c1", "stop")), 1)
    )
    async with hall(tmp_path, work) as plant:
        await asyncio.sleep(1)
        await by_ana(plant, "c1", "select_automatic")
        await by_ana(plant, "c1", "start_automatic")
        await plant.started()
        await plant.until(lambda: plant.state is SequenceState.ABORTED, 5.0)
        await asyncio.sleep(5)
        assert plant.failure and plant.failure[:2] == (1, "why.held")
        assert plant.value("c1.automatic") == 1 and plant.value("c1.moving") == 1
        assert [who for *_, who in plant.outcomes("c1")] == ["Ana Kos", "Ana Kos"]


@pytest.mark.sweep(8)
@pytest.mark.parametrize("seconds", [10.0, 19.8, 25.0])
async def test_a_machine_that_a_person_stops_is_not_started_again_and_the_run_is_over(
    tmp_path: Path, seconds: float
) -> None:
    """Long before the next order to it, while it still slows down when that comes, and in a step that has nothing to do with it."""
    steps = (("m1", "run_forward", 20), ("c1", "select_automatic", 20), ("m1", "run_reverse", 20))
    work = '[sequence]\nlabel = "Work"\n' + "".join(
        f'[[steps]]\nkey = "{machine}_{action}"\nlabel = "{action}"\nminimum = {minimum}\nmaximum = 60\n'
        f'[[steps.orders]]\nmachine = "{machine}"\naction = "{action}"\n'
        + ("values = { frequency = 30 }\n" if machine == "m1" else "")
        for machine, action, minimum in (steps if seconds > 20 else (steps[0], steps[2]))
    )
    async with hall(tmp_path, work) as plant:
        await plant.started()
        await asyncio.sleep(seconds)
        assert plant.value("m1.frequency") == 30 and plant.state is SequenceState.RUNNING
        await by_ana(plant, "m1", "stop")
        await asyncio.sleep(45)
        assert plant.value("m1.frequency") == 0 and plant.state is SequenceState.ABORTED
        assert plant.outcomes("m1")[:3] == [
            ("set_frequency", "confirmed", "Work"), ("forward", "confirmed", "Work"), ("stop", "confirmed", "Ana Kos")
        ]  # fmt: skip
        assert not any(command == "reverse" for command, *_ in plant.outcomes("m1"))
        failure = plant.runtime.desks.failure("seq1")
        assert failure and failure.reason == "why.superseded" and failure.params["display"] == "Ana Kos"
        out = plant.device.block.first_out
        assert out and out.cause is Cause.COMMAND and plant.runtime.gate
        assert plant.runtime.gate.control.holder("m1") is None


@pytest.mark.sweep(8)
async def test_a_machine_that_a_person_stops_while_the_run_is_suspended_does_not_start_with_the_resume(
    tmp_path: Path,
) -> None:
    async with hall(tmp_path, FEED.replace("minimum = 0.5", "minimum = 30")) as plant:
        await plant.started()
        await plant.until(lambda: (plant.value("m1.frequency") or 0) > 29)
        plant.ask(2)
        await plant.until(lambda: plant.value("m1.frequency") == 0 and plant.value("c1.moving") == 0)
        await by_ana(plant, "m1", "stop")
        plant.ask(3)
        await asyncio.sleep(10)
        assert plant.state is SequenceState.ABORTED
        assert plant.value("m1.frequency") == 0 and plant.value("c1.moving") == 0
