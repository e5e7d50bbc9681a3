"""A plant is taken anew while a sequence of this server has a machine run that another process simulates."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from app.blocks.sequence import SequenceState
from app.registers import plc_map
from app.registers.plc_map import Request
from tests.far import far
from tests.running.test_sequence_machines import file, step
from tests.running.test_sequence_orders import Hall, hall

ABORT = 4
HEAD = '[plant]\nname = "Yard"\ntimezone = "UTC"\n'
OWN = '[links.own]\ntransport = "memory"\n'
SEQUENCE = '[equipment.{id}]\n{was}type = "sequence"\nlink = "own"\nunit = 21\ndefinition = "work"\n'
DRIVE = '[equipment.m1]\ntype = "eura_e800"\nlink = "far"\nunit = 5\n'
WORK = file(step("out", "m1.run_forward(frequency = 30)", minimum=30), step("back", "m1.run_reverse(frequency = 20)"))


@asynccontextmanager
async def running(folder: Path) -> AsyncIterator[tuple[Hall, str]]:
    """A plant whose sequence has the fan run at 30 Hz, and its file without the sequence."""
    own = OWN + SEQUENCE.format(id="seq1", was="")
    async with (
        far(folder / "far", "tcp", HEAD, DRIVE) as (link, _),
        hall(folder, WORK, HEAD + link + DRIVE + own) as plant,
    ):
        await plant.started()
        await plant.until(lambda: plant.value("m1.frequency") == 30)
        yield plant, HEAD + link + DRIVE


async def take(plant: Hall, folder: Path, text: str) -> None:
    """The plant as `text` has it."""
    (folder / "plant" / "plant.toml").write_text(text, "utf-8")
    files = plant.runtime.plant_files
    reading = await files.reload(None, (await files.look()).digest)
    assert reading.done, (reading.refused, reading.problems)


def holder(plant: Hall) -> str:
    gate = plant.runtime.gate
    assert gate
    found = gate.control.holder("m1")
    return found.session if found else ""


@pytest.mark.sweep(8)
async def test_a_sequence_that_goes_with_the_last_link_in_memory_stops_what_it_ran(tmp_path: Path) -> None:
    async with running(tmp_path) as (plant, rest):
        await take(plant, tmp_path, rest)
        await plant.until(lambda: plant.value("m1.frequency") == 0)
        await plant.until(lambda: ("stop", "confirmed", "Work") in plant.outcomes("m1"))
        await plant.until(lambda: not holder(plant))


@pytest.mark.sweep(8)
async def test_a_sequence_that_is_renamed_goes_on_with_its_machines(tmp_path: Path) -> None:
    async with running(tmp_path) as (plant, rest):
        await take(plant, tmp_path, rest + OWN + SEQUENCE.format(id="seq7", was='was = "seq1"\n'))
        assert plant.runtime.sim
        run = plant.runtime.sim.devices["seq7"].block  # type: ignore[attr-defined]
        assert run.state is SequenceState.RUNNING
        await plant.until(lambda: run.state is SequenceState.DONE)
        await plant.until(lambda: plant.value("m1.frequency") == 20)
        assert plant.outcomes("m1")[-1][:2] == ("reverse", "confirmed")
        await plant.until(lambda: not holder(plant))


@pytest.mark.sweep(8)
async def test_a_sequence_that_is_renamed_still_stops_what_it_ran(tmp_path: Path) -> None:
    async with running(tmp_path) as (plant, rest):
        await take(plant, tmp_path, rest + OWN + SEQUENCE.format(id="seq7", was='was = "seq1"\n'))
        assert plant.runtime.sim
        abort = plc_map.request_words(Request(ABORT, id=99))
        plant.runtime.sim.devices["seq7"].write(16, plc_map.COMMAND, abort)
        await plant.until(lambda: plant.value("m1.frequency") == 0)
        await asyncio.sleep(1)
        assert not holder(plant)


@pytest.mark.sweep(8)
async def test_a_machine_that_is_renamed_with_its_sequence_is_stopped_by_its_new_name(tmp_path: Path) -> None:
    """The run is broken off, as its steps name another machine; its link has not heard yet that this one is simulated."""
    async with running(tmp_path) as (plant, rest):
        (tmp_path / "plant" / "sequences" / "work.toml").write_text(WORK.replace('"m1"', '"m9"'), "utf-8")
        fan = rest.replace("[equipment.m1]\n", '[equipment.m9]\nwas = "m1"\n')
        await take(plant, tmp_path, fan + OWN + SEQUENCE.format(id="seq1", was=""))
        await plant.until(lambda: plant.value("m9.frequency") == 0)
        await plant.until(lambda: ("stop", "confirmed", "Work") in plant.outcomes("m9"))
