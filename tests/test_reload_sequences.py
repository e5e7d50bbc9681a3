"""Definition files of sequences taken anew while they run: what only a person reads interrupts nothing, the rest is told beforehand."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest

from app.plant.changes import Change
from app.registers import plc_map
from app.registers.plc_map import Request
from app.runtime import Runtime
from app.settings import Settings
from app.sim.sequence.program import VirtualSequence
from app.tags.quality import is_good
from tests.virtual import inline, loop_clock

PLANT = """
[plant]
name = "Hall"
timezone = "UTC"
[links.hall]
transport = "memory"
writes = true
"""
MACHINE = """
[equipment.seq{n}]
type = "sequence"
link = "hall"
unit = {n}
definition = "{definition}"
"""
BLINK = """
[sequence]
label = "Blink"
[[steps]]
key = "bright"
label = { hr = "Svijetlo", en = "Bright" }
[[steps]]
key = "dark"
label = "Dark"
[steps.permissives.2]
key = "allowed"
label = "Allowed"
"""


class Plant:
    """A running plant of two sequences that do not share a definition."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.runtime: Runtime

    def write(self, one: str = BLINK, other: str = BLINK) -> None:
        (self.folder / "sequences").mkdir(parents=True, exist_ok=True)
        machines = MACHINE.format(n=1, definition="one") + MACHINE.format(n=2, definition="other")
        (self.folder / "plant.toml").write_text(PLANT + machines, "utf-8")
        for name, text in (("one", one), ("other", other)):
            (self.folder / "sequences" / f"{name}.toml").write_text(text, "utf-8")

    def device(self, id: str) -> VirtualSequence:
        found = self.runtime.sim.devices[id] if self.runtime.sim else None
        assert isinstance(found, VirtualSequence)
        return found

    def start(self, id: str) -> None:
        self.device(id).write(16, plc_map.COMMAND, plc_map.request_words(Request(1, id=7)))

    def value(self, name: str) -> Any:
        tags = self.runtime.tags
        return tags.sample(name).value if name in tags and is_good(tags.sample(name).quality) else None

    async def until(self, true: Callable[[], bool]) -> None:
        end = asyncio.get_running_loop().time() + 30
        while not true():
            assert asyncio.get_running_loop().time() < end, "not in time"
            await asyncio.sleep(0.02)

    async def change(self, **text: str) -> tuple[Change, bool]:
        """Write the files, read what differs and take it."""
        self.write(**text)
        seen = await self.runtime.plant_files.look()
        (change,) = seen.changes
        return change, (await self.runtime.plant_files.reload(None, seen.digest)).done


@asynccontextmanager
async def running(tmp_path: Path) -> AsyncIterator[Plant]:
    plant = Plant(tmp_path / "plant")
    plant.write()
    plant.runtime = Runtime(Settings(plant=plant.folder, data=tmp_path / "data"), loop_clock(), inline)
    await plant.runtime.start()
    try:
        assert plant.runtime.plant is not None, plant.runtime.problems
        # in its first scan a PLC does not know yet that it may start
        await plant.until(lambda: min(plant.device(f"seq{n}").steps for n in (1, 2)) > 1)
        for id in ("seq1", "seq2"):
            plant.device(id).preset({"word_2": 0xFFFB})  # both stay in their first step
            plant.start(id)
        await plant.until(lambda: [plant.value(f"seq{n}.state") for n in (1, 2)] == [1, 1])
        yield plant
    finally:
        await plant.runtime.stop()


def keys(change: Change) -> list[str]:
    return [effect.key for effect in change.effects]


async def test_another_label_leaves_a_sequence_running(tmp_path: Path) -> None:
    async with running(tmp_path) as plant:
        device = plant.device("seq1")
        change, done = await plant.change(one=BLINK.replace('en = "Bright"', 'en = "On"'))
        assert done and keys(change) == ["texts"]
        assert plant.device("seq1") is device and plant.value("seq1.state") == 1
        assert plant.runtime.plant
        item = plant.runtime.plant.equipment["seq1"]
        assert [plant.runtime.texts.step(lang, item, 1) for lang in ("hr", "en")] == ["Svijetlo", "On"]


async def test_other_steps_break_off_this_sequence_only_and_are_told_beforehand(tmp_path: Path) -> None:
    async with running(tmp_path) as plant:
        device, other = plant.device("seq1"), plant.device("seq2")
        longer = BLINK + '[[steps]]\nkey = "grey"\nlabel = "Grey"\n'
        change, done = await plant.change(one=longer)
        assert done and keys(change) == ["sequence_runs", "sequence"]
        assert change.details[0] == "steps: bright, dark → bright, dark, grey"
        assert plant.device("seq1") is not device and plant.device("seq2") is other
        await plant.until(lambda: plant.value("seq1.state") == 0 and plant.value("seq1.step_3_maximum") == 0)
        assert plant.value("seq2.state") == 1


async def test_a_sequence_that_stands_is_not_said_to_run(tmp_path: Path) -> None:
    async with running(tmp_path) as plant:
        plant.device("seq1").write(16, plc_map.COMMAND, plc_map.request_words(Request(4, id=8)))
        await plant.until(lambda: plant.value("seq1.state") == 5)
        change, done = await plant.change(one=BLINK.replace('key = "dark"', 'key = "dark"\nmaximum = 9'))
        assert done and keys(change) == ["sequence"]


@pytest.mark.sweep(8)
async def test_what_was_read_can_be_taken_although_a_sequence_ended_meanwhile(tmp_path: Path) -> None:
    async with running(tmp_path) as plant:
        plant.write(one=BLINK.replace('key = "dark"', 'key = "dark"\nmaximum = 9'))
        seen = await plant.runtime.plant_files.look()
        assert keys(seen.changes[0]) == ["sequence_runs", "sequence"]
        plant.device("seq1").write(16, plc_map.COMMAND, plc_map.request_words(Request(4, id=8)))
        await plant.until(lambda: plant.value("seq1.state") == 5)
        assert (await plant.runtime.plant_files.reload(None, seen.digest)).done


async def test_a_mistake_in_a_definition_changes_nothing(tmp_path: Path) -> None:
    async with running(tmp_path) as plant:
        plant.write(one=BLINK.replace('key = "dark"', 'key = "bright"'))
        seen = await plant.runtime.plant_files.look()
        assert [problem.file for problem in seen.problems] == ["sequences/one.toml"]
        assert not (await plant.runtime.plant_files.reload(None, seen.digest)).done
        assert plant.value("seq1.state") == 1
