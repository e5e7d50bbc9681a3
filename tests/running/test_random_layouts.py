"""Lines of any build behind every transport: what the house shows, counts, records and stores of products is what became of them.

The PLC of the line is in the house (memory) or in a simulated plant behind a wire (TCP, RTU). What tests/sim/conveyor ask of the PLC
alone is asked here of what comes to the other end of the wire.
"""

import asyncio
import sqlite3
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager, closing
from pathlib import Path
from typing import Any

import pytest

from app.blocks.product_tracking import Code
from app.records.event import packed
from app.registers import plc_map
from app.registers.plc_map import Request
from app.runtime import Runtime
from app.settings import Settings
from app.sim.conveyor import training
from app.sim.conveyor.machine import Geometry
from app.sim.conveyor.program import VirtualConveyor
from app.sim.conveyor.register_map import ConveyorCommand
from app.sim.plant import SimPlant
from app.tags.quality import is_good
from tests.far import far
from tests.sim.conveyor.bench import QUICK
from tests.sim.conveyor.layouts import LONGEST, SHORTEST, check, layout_with_gates, options
from tests.virtual import VirtualLoop, inline, loop_clock

HEAD = '[plant]\nname = "Yard"\ntimezone = "UTC"\n'
SLOTS = 40
OUTCOMES = {Code.UNLOADED: "unloaded", Code.DIVERTED: "diverted"}
COUNTERS = ("entered", "unloaded", "lost", "unexpected", "corrections")
Told = tuple[int, int, float, bytes]
"""Code, source, value and words of an event."""


def machine(geometry: Geometry, link: str) -> str:
    text = f'[equipment.c1]\ntype = "conveyor"\nlink = "{link}"\nunit = 11\n'
    text += options(geometry, product_slots=SLOTS, scanner=1 if geometry.gates else 0)
    text += '[equipment.c1.simulation]\nstart = "automatic"\n'
    world = {**QUICK, "interval": 3.0, "shortest": SHORTEST, "longest": LONGEST, "not_read": 2}
    return text + "".join(f"{key} = {value}\n" for key, value in world.items())


class Yard:
    """A house with one line, and the PLC of it."""

    def __init__(self, runtime: Runtime, sim: SimPlant) -> None:
        self.runtime = runtime
        device = sim.devices["c1"]
        assert isinstance(device, VirtualConveyor)
        self.device = device
        self.told: dict[int, Told] = {}
        """By sequence: what the PLC told from now on."""
        tell = device.event

        def told(code: int, source: int = 0, value: float = 0.0, snapshot: Sequence[int] = ()) -> None:
            tell(code, source, value, snapshot)
            words = (*snapshot, *(0,) * (6 - len(snapshot)))
            self.told[device._ring.newest] = (code, source, value, packed(words))

        device.event = told  # type: ignore[method-assign]

    def value(self, key: str) -> Any:
        name = f"c1.{key}"
        found = self.runtime.tags.sample(name) if name in self.runtime.tags else None
        return found.value if found and is_good(found.quality) else None

    def rows(self) -> dict[int, tuple[float, ...]]:
        """The table of products as a page shows it: slot → id, state, head, tail, length, area, sensor of the last correction."""
        columns = ("id", "state", "head", "tail", "length", "area", "corrected_at")
        found = {
            slot: tuple(self.value(f"product_{slot}_{column}") for column in columns) for slot in range(1, SLOTS + 1)
        }
        return {slot: row for slot, row in found.items() if row[0]}

    def true_rows(self) -> dict[int, tuple[float, ...]]:
        return {
            one.slot + 1: (one.id, one.state, one.head, one.tail, one.whole, one.area, one.corrected_at)
            for one in self.device.tracking.slots
            if one
        }

    async def until(self, true: Callable[[], object], limit: float) -> None:
        loop = asyncio.get_running_loop()
        end = loop.time() + limit
        while not true():
            assert loop.time() < end, (self.device.state, self.device.first_out.first, self.device.tracking.products)
            await asyncio.sleep(0.05)

    def order(self, code: ConveyorCommand, id: int) -> None:
        """As another master would, beside the house."""
        self.device.write(16, plc_map.COMMAND, plc_map.request_words(Request(code, id=id)))


@asynccontextmanager
async def yard(folder: Path, geometry: Geometry, transport: str) -> AsyncIterator[Yard]:
    if transport == "memory":
        text = f'{HEAD}[links.near]\ntransport = "memory"\n{machine(geometry, "near")}'
        async with house(folder, text) as runtime:
            assert runtime.sim
            yield Yard(runtime, runtime.sim)
        return
    line = machine(geometry, "far")
    async with far(folder / "far", transport, HEAD, line) as (link, sim), house(folder, HEAD + link + line) as runtime:
        yield Yard(runtime, sim)


@asynccontextmanager
async def house(folder: Path, plant: str) -> AsyncIterator[Runtime]:
    (folder / "plant").mkdir(parents=True)
    (folder / "plant" / "plant.toml").write_text(plant, "utf-8")
    runtime = Runtime(Settings(plant=folder / "plant", data=folder / "data"), loop_clock(), inline)
    await runtime.start()
    try:
        assert runtime.plant is not None, runtime.problems
        yield runtime
    finally:
        await runtime.stop()


async def story(folder: Path, geometry: Geometry, transport: str, seconds: float) -> None:
    """Products run for so long; the line is stopped and looked at, goes on without arrivals until it is empty, and is looked at again."""
    async with yard(folder, geometry, transport) as here:
        device, follow = here.device, here.device.tracking
        loop = asyncio.get_running_loop()
        end = loop.time() + seconds
        await here.until(lambda: here.value("state") is not None, 20)
        while loop.time() < end:
            await asyncio.sleep(0.5)
            check(device)
        entered = follow.entered
        await here.until(lambda: follow.entered > entered, 300)
        here.order(ConveyorCommand.STOP, 0x7001)
        await here.until(lambda: not device.moving and not device.stopping, 20)
        await asyncio.sleep(2.5)
        assert follow.products, "it stopped with products on it"
        shown = here.rows()
        assert shown.keys() == here.true_rows().keys()
        for slot, row in here.true_rows().items():
            assert shown[slot] == pytest.approx(row, abs=1e-3), slot
        heads = [row[2] for row in sorted(shown.values())]
        assert heads == sorted(heads, reverse=True), "who came first is in front"
        counted(here)
        device.write(6, training.REG_ARRIVALS, [0])
        await asyncio.sleep(0.1)
        here.order(ConveyorCommand.START, 0x7002)
        await here.until(lambda: not any(follow.slots) and not device.machine.products, 900)
        await asyncio.sleep(3)
        assert here.rows() == {}
        counted(here)
        assert (follow.lost, follow.found, follow.refused, follow.withdrawn) == (0, 0, 0, 0)
        thing = device.machine
        assert (thing.fallen, thing.backed_out, thing.collisions) == (0, 0, 0)
        assert thing.entered == follow.entered == follow.unloaded + sum(follow.diverted)
        assert (thing.unloaded, thing.blades.diverted) == (follow.unloaded, sum(follow.diverted))
        assert thing.entered > 3
        told = here.told
    stored(folder / "data", told, follow.entered)


def counted(here: Yard) -> None:
    """The counters on the page are the PLC's."""
    follow, gates = here.device.tracking, here.device.gates.all
    assert [here.value(key) for key in COUNTERS] == [getattr(follow, key) for key in COUNTERS]
    assert [here.value(f"diverted_{n}") for n in range(1, len(gates) + 1)] == follow.diverted
    assert [here.value(f"misrouted_{n}") for n in range(1, len(gates) + 1)] == [gate.misrouted for gate in gates]


def stored(data: Path, told: dict[int, Told], entered: int) -> None:
    """Each event of the ring is in the history once, in order; each product has one record, which ended as the PLC told."""
    with closing(sqlite3.connect(data / "history.db")) as found:
        events = found.execute("SELECT sequence, code, source, value, words FROM event ORDER BY id").fetchall()
        records = found.execute("SELECT number, outcome, missed FROM record WHERE kind = 'passage'").fetchall()
    sequences = [sequence for sequence, *_ in events]
    assert sequences == list(range(1, len(events) + 1)), "none lost, none twice, none before its time"
    kept = {sequence: tuple(rest) for sequence, *rest in events if sequence in told}
    assert kept.keys() == told.keys()
    for sequence, (code, source, value, words) in told.items():
        assert kept[sequence] == (code, source, pytest.approx(value, rel=1e-6, abs=1e-6), words), sequence
    ends = {
        int.from_bytes(words[:4].ljust(4, b"\0"), "big"): OUTCOMES[Code(code)]
        for code, _, _, words in told.values()
        if code in OUTCOMES
    }
    assert len(ends) == entered == len(records)
    assert {number: outcome for number, outcome, _ in records} == ends
    assert not any(missed for *_, missed in records)


@pytest.mark.sweep(8)
@pytest.mark.parametrize(("seed", "transport"), [(1, "memory"), (2, "tcp"), (3, "rtu")])
async def test_what_the_house_knows_of_products_is_what_became_of_them(
    tmp_path: Path, seed: int, transport: str
) -> None:
    await story(tmp_path, layout_with_gates(seed), transport, 30)


@pytest.mark.soak
@pytest.mark.parametrize("transport", ["memory", "tcp", "rtu"])
@pytest.mark.parametrize("seed", range(100, 120))
def test_and_that_of_twenty_lines_over_each_transport(tmp_path: Path, seed: int, transport: str) -> None:
    with asyncio.Runner(loop_factory=VirtualLoop) as runner:
        runner.run(story(tmp_path, layout_with_gates(seed), transport, 300))


@pytest.mark.soak
@pytest.mark.parametrize(("seed", "transport"), [(1, "tcp"), (1, "rtu")])
async def test_and_over_a_real_socket_and_a_pseudo_terminal(tmp_path: Path, seed: int, transport: str) -> None:
    """In real time, as every test of the soak."""
    await story(tmp_path, layout_with_gates(seed), transport, 60)
