"""Random sequences over random machines, started, suspended, resumed and aborted at random times: the same seed, the same story.

Whatever happens: a step is entered with its permissives alone, an order is given once, a stop ends every order, a run is recorded once.
"""

import asyncio
import random
import sqlite3
from collections import Counter
from collections.abc import AsyncIterator, Iterable, Sequence
from contextlib import asynccontextmanager, closing
from pathlib import Path
from typing import Any

import pytest

from app.blocks.sequence import Report, SequenceEvent, SequenceState
from app.plant.sequence_definition import SequenceOrder
from app.sim.sequence.program import VirtualSequence
from tests.far import far
from tests.running.test_sequence_machines import AXIS, CHILD, DRIVE, LINKS, SEQUENCE, child, file, step
from tests.running.test_sequence_orders import Hall, hall

FAN = '[equipment.m1]\ntype = "eura_e800"\nlink = "all"\nunit = 1\n'
LINE = '[equipment.c1]\ntype = "conveyor"\nlink = "all"\nunit = 11\npreset = "model"\n'
SECTIONS = {"m1": FAN, "d1": DRIVE, "a1": AXIS, "c1": LINE, "seq2": CHILD}
SENTENCES = ("m1.status != 4", "d1.zsw1_fault == 0", "a1.zsw1_fault == 0", "c1.config_crc >= 0", "seq2.forces == 0")
STORY = 45.0
"""Virtual time of a story [s]."""
ENDS = (SequenceEvent.DONE, SequenceEvent.ABORTED, SequenceEvent.TIMED_OUT)
VALUE = '[[recipe]]\nkey = "hold"\nlabel = "Hold"\nunit = "s"\nminimum = 1\nmaximum = 3\ndefault = 2\n'
OTHER = file(step("a", minimum=2), step("b").replace("minimum = 0.1", 'minimum = "recipe.hold"'), VALUE)


@asynccontextmanager
async def machines(folder: Path, names: Sequence[str], transport: str) -> AsyncIterator[str]:
    """A plant file with these machines; not over memory they are on a wire, the sequences stay in the server."""
    if transport == "memory":
        yield LINKS + "".join(SECTIONS[name] for name in names) + SEQUENCE
        return
    away = [SECTIONS[name].replace('"all"', '"far"') for name in names if name != "seq2"]
    async with far(folder / "far", transport, '[plant]\nname = "Yard"\ntimezone = "UTC"\n', "".join(away)) as (link, _):
        yield LINKS + link + "".join(away) + (CHILD if "seq2" in names else "") + SEQUENCE


class Chances:
    """What one seed says."""

    def __init__(self, seed: int) -> None:
        self._random = random.Random(seed)
        self.choice, self.uniform, self.sample = self._random.choice, self._random.uniform, self._random.sample
        self._values = random.Random(seed)
        self.machines = sorted(self.sample(sorted(SECTIONS), self._random.randint(2, 4)))

    def often(self, part: float) -> bool:
        return self._random.random() < part

    def order(self, machine: str) -> str:
        kinds = {
            "m1": (f"run_forward(frequency = {self.uniform(5, 50):.1f})", f"run_reverse(frequency = {self.uniform(5, 50):.1f})", "stop"),
            "d1": (f"run_forward(setpoint = {self.uniform(5, 90):.1f})", f"run_reverse(setpoint = {self.uniform(5, 90):.1f})", "stop"),
            "a1": (f"move_to(target = {self.uniform(10, 790):.0f}, velocity = {self.uniform(2000, 9000):.0f})",),
            "c1": ("select_automatic", "stop"),
            "seq2": (self.run(),),
        }  # fmt: skip
        return f"{machine}.{self.choice(kinds[machine])}"

    def hold(self) -> float:
        """A value of a run."""
        return round(self._values.uniform(1, 3), 1)

    def run(self) -> str:
        """Start of the other sequence: with a number, with a value of the own run, or as its last run was."""
        given = (f"hold = {self.hold()}", 'hold = "recipe.long"')
        return f"run({self._values.choice(given)})" if self._values.random() < 0.8 else "run"

    def work(self, key: str, machines: Sequence[str]) -> str:
        """A step that commands some of `machines`."""
        chosen = self.sample(list(machines), min(len(machines), self.choice((0, 1, 1, 2))))
        orders = [text for machine in chosen for text in (["a1.enable"] * (machine == "a1") + [self.order(machine)])]
        text = step(key, *orders, minimum=round(self.uniform(0.1, 3), 1), maximum=round(self.uniform(20, 60)))
        if self.often(0.5):
            machine = self.choice(self.machines)
            when = next(sentence for sentence in SENTENCES if sentence.startswith(machine))
            text += f'[steps.permissives.0]\nlabel = "x"\nwhen = "{when}"\n'
        return text

    def file(self) -> str:
        """A sequence with perhaps a branch, a loop and a safe step."""
        together, more, head = self.often(0.5), VALUE.replace("hold", "long"), ""
        half = len(self.machines) // 2
        sides = (self.machines[:half], self.machines[half:]) if together else (self.machines, self.machines)
        steps = [self.work("a", self.machines), self.work("b", self.machines)]
        steps += [self.work("c", sides[0]), self.work("d", sides[0]), self.work("e", sides[1])]
        steps += [self.work("f", self.machines), self.work("g", ())]
        if self.often(0.8):
            take = "all" if together else "first"
            more += f'[[branches]]\nafter = "b"\ntake = "{take}"\npaths = ["c", "e"]\nthen = "f"\n'
        if self.often(0.5):
            more += f'[[loops]]\nfrom = "{self.choice(("a", "b"))}"\nto = "f"\ntimes = 2\n'
        if self.often(0.5):
            head = 'abort_to = "g"\n'
            steps.append(self.work("h", self.machines))
        return file(*steps, more, head=head)


class Watched:
    """What a sequence did, and what was wrong with it."""

    def __init__(self, plant: Hall) -> None:
        self.plant, self.wrong = plant, list[str]()
        self.started = self.ended = self.handed = 0
        self.given: list[tuple[int, int]] = []
        """(step, passage) whose orders were given."""
        self.suspended = False
        self._began = 0
        self.left = set[str]()
        """Machines that the last run which commanded them left as they were, as it was done: what runs then runs on."""
        device = plant.device
        tell, take = device.tell, device.orders._take

        def told(report: Report) -> None:
            self._see(device, report)
            tell(report)

        def taken(number: int) -> None:
            if (place := (number, device.block.passage(number))) in self.given:
                self.wrong.append(f"the orders of step {number} were given twice in one passage")
            self.given.append(place)
            take(number)

        device.tell, device.orders._take = told, taken  # type: ignore[method-assign]
        if plant.runtime.sim and "seq2" in plant.runtime.sim.devices:
            self._watch_other(child(plant))

    def _watch_other(self, other: VirtualSequence) -> None:
        """Whether the other sequence has in each of its runs what the last order to it gives."""
        tell, last = other.tell, other.recipe.values

        def told(report: Report) -> None:
            nonlocal last
            if report.event is SequenceEvent.STARTED:
                steps = self.plant.device.definition.steps
                orders = [one for n, _ in self.given for one in steps[n - 1].orders if one.machine == "seq2"]
                given = orders[-1].given(self.plant.device.recipe.by_key).values if orders else {}
                if other.recipe.values != (given.get("hold", last[0]),):
                    self.wrong.append(f"seq2 runs with {other.recipe.values}, was given {given}, had {last}")
                self.handed += "hold" in given
                last = other.recipe.values
            tell(report)

        other.tell = told  # type: ignore[method-assign]

    def _see(self, device: VirtualSequence, report: Report) -> None:
        if report.event is SequenceEvent.STEP_ENTERED and not device.block.ready(report.step):
            self.wrong.append(f"step {report.step} was entered without its permissives")
        if report.event is SequenceEvent.STARTED:
            self._began = len(self.given)
        if report.event in ENDS:
            steps = device.definition.steps
            used = {order.machine for number, _ in self.given[self._began :] for order in steps[number - 1].orders}
            self.left = self.left | used if report.event is SequenceEvent.DONE else self.left - used
        self.started += report.event is SequenceEvent.STARTED
        self.ended += report.event in ENDS
        self.suspended |= report.event is SequenceEvent.SUSPENDED
        if not 0 <= self.started - self.ended <= 1:
            self.wrong.append(f"{self.started} starts and {self.ended} ends")

    def asked(self, machine: str) -> list[str]:
        """Commands that reached the machine."""
        return [key for key, state, _ in self.plant.outcomes(machine) if state != "refused"]

    def expected(self, machine: str) -> list[str]:
        """Commands of the orders that were given to it, in order."""
        steps = self.plant.device.definition.steps
        orders: list[SequenceOrder] = [
            order for number, _ in self.given for order in steps[number - 1].orders if order.machine == machine
        ]
        found = self.plant.runtime.plant
        assert found
        kind = found.equipment[machine].type
        return [each.command for order in orders for each in kind.orders[order.action].commands]


def stands(plant: Hall, machine: str) -> bool:
    value: dict[str, Any] = {
        "m1": lambda: plant.value("m1.frequency") == 0,
        "d1": lambda: abs(plant.value("d1.speed")) < 31,
        "a1": lambda: plant.value("a1.zsw1_drive_stopped") == 1,
        "c1": lambda: plant.value("c1.moving") == 0,
        "seq2": lambda: not child(plant).block.running or child(plant).state is SequenceState.SUSPENDED,
    }
    return bool(value[machine]())


async def live(plant: Hall, chances: Chances, seen: Watched) -> None:
    """Starts it, and for the time of the story does to it what chance says."""
    loop = asyncio.get_running_loop()
    end = loop.time() + STORY
    await asyncio.sleep(1.5)
    while loop.time() < end:
        if not plant.device.block.running:
            plant.ask(5)
            await asyncio.sleep(0.5)
            plant.ask(1, chances.hold())
        elif plant.state is SequenceState.SUSPENDED:
            plant.ask(3)
        elif chances.often(0.35):
            plant.ask(2 if chances.often(0.6) else 4)
        await asyncio.sleep(chances.uniform(0.3, 8))
    for _ in range(2):  # the second one stops safe steps
        if plant.device.block.running:
            plant.ask(4)
            await asyncio.sleep(1)


def records(data: Path) -> tuple[Counter[str], int]:
    """How many runs are recorded by their outcome, of all sequences, and how many events they lost."""
    with closing(sqlite3.connect(data / "history.db")) as found:
        rows = found.execute("SELECT outcome, missed FROM record WHERE kind = 'run'").fetchall()
    return Counter(outcome for outcome, _ in rows), sum(missed for _, missed in rows)


def counted(devices: Iterable[VirtualSequence]) -> Counter[str]:
    """How many runs the devices say they ended."""
    total = Counter[str]()
    for device in devices:
        total.update(done=device.runs.done, aborted=device.runs.aborted, timed_out=device.runs.timed_out)
    return +total


@pytest.mark.sweep(8)
@pytest.mark.parametrize(("seed", "transport"), [*((seed, "memory") for seed in range(6)), (6, "tcp"), (7, "rtu")])
async def test_whatever_happens_to_a_sequence(tmp_path: Path, seed: int, transport: str) -> None:
    chances = Chances(seed)
    work = chances.file()
    async with (
        machines(tmp_path, chances.machines, transport) as plant_file,
        hall(tmp_path, work, plant_file, {"child": OTHER}) as plant,
    ):
        seen = Watched(plant)
        await live(plant, chances, seen)
        assert seen.wrong == [] and seen.started
        assert seen.started == seen.ended
        gate = plant.runtime.gate
        assert gate
        if plant.state is not SequenceState.DONE:
            touched = [machine for machine in chances.machines if seen.expected(machine) and machine not in seen.left]
            await plant.until(lambda: all(stands(plant, machine) for machine in touched), 40)
        await plant.until(lambda: all(gate.control.holder(machine) is None for machine in chances.machines), 20)
        devices = plant.runtime.sim.devices.values() if plant.runtime.sim else ()
        sequences = [device for device in devices if isinstance(device, VirtualSequence)]
        assert counted([plant.device]).total() == seen.ended
        await plant.until(lambda: not any(device.block.running for device in sequences), 30)
        await asyncio.sleep(2)
    assert records(tmp_path / "data") == (counted(sequences), 0)


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("seed", "transport"), [(20, "memory"), (21, "memory"), (22, "memory"), (23, "tcp"), (37, "rtu")]
)
async def test_undisturbed_every_command_reaches_its_machine_once(tmp_path: Path, seed: int, transport: str) -> None:
    chances = Chances(seed)
    async with (
        machines(tmp_path, chances.machines, transport) as plant_file,
        hall(tmp_path, chances.file(), plant_file, {"child": OTHER}) as plant,
    ):
        await asyncio.sleep(1.5)
        seen = Watched(plant)
        plant.ask(1, chances.hold())
        await asyncio.sleep(0.5)
        await plant.until(lambda: not plant.device.block.running, 300)
        assert seen.wrong == [] and seen.given
        for machine in chances.machines:
            asked, expected = seen.asked(machine), seen.expected(machine)
            assert asked[: len(expected)] == expected or asked == expected[: len(asked)], plant.failure
            if plant.state is SequenceState.DONE:
                assert asked == expected
        if plant.state is SequenceState.DONE:
            orders = [one for n, _ in seen.given for one in plant.device.definition.steps[n - 1].orders]
            assert seen.handed == sum("hold" in one.values for one in orders)


@pytest.mark.sweep(20)
async def test_the_same_seed_is_the_same_story(tmp_path: Path) -> None:
    stories = []
    for name in ("one", "two"):
        chances = Chances(4)
        plant_file = LINKS + "".join(SECTIONS[machine] for machine in chances.machines) + SEQUENCE
        async with hall(tmp_path / name, chances.file(), plant_file, {"child": OTHER}) as plant:
            seen = Watched(plant)
            await live(plant, chances, seen)
            stories.append((seen.given, seen.started, plant.state, [plant.outcomes(one) for one in chances.machines]))
    assert stories[0] == stories[1]


@pytest.mark.soak
@pytest.mark.parametrize("transport", ["memory", "tcp", "rtu"])
@pytest.mark.parametrize("seed", range(100, 120))
async def test_whatever_happens_for_longer(tmp_path: Path, seed: int, transport: str) -> None:
    await test_whatever_happens_to_a_sequence(tmp_path, seed, transport)
