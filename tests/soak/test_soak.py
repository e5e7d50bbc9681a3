"""An hour in the life of a plant, at any length: faults at random, commands all the time, pages that come and go.

`POGON_SOAK_SECONDS` says how long (600 when it does not); `make soak` runs it, and with `-s` it tells what it has seen.
"""

import asyncio
import os
import shutil
from collections import Counter
from collections.abc import AsyncIterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from random import Random

import pytest

from app import bundled
from app.access.roles import Person
from app.commands.gate import Question
from app.errors import LinkError, Refused
from app.plant.definitions import Scan
from app.plant.loader import read_plant
from app.registers.codec import decode
from app.running.page_tags import page_tags
from app.runtime import Runtime
from app.settings import Settings
from app.sim import training
from app.sim.eura_e800 import training as own
from app.sim.eura_e800.faults import FAULTS
from app.sim.plant import SimPlant
from app.sim.server import serve_tcp
from app.tags.quality import is_good
from tests.commands.stand import person
from tests.commands.test_ten_thousand import command_faulty_lines

SECONDS = float(os.environ.get("POGON_SOAK_SECONDS", "600"))
GROWTH = 15.0
"""What the memory may grow by between the first fifth and the end [MB]; alarms, history and sessions keep a day of things."""


class Shift:
    """One plant, its instructor, its operator and its browsers."""

    def __init__(self, runtime: Runtime, seed: int) -> None:
        self.runtime = runtime
        self.chance = Random(seed)
        self.done: Counter[str] = Counter()
        self.most_lag = 0.0

    async def instruct(self) -> None:
        """Break the line, the drive or its load, and repair it again."""
        registers = {
            own.REG_LOAD: lambda: self.chance.randint(0, 160),
            own.REG_AMBIENT: lambda: self.chance.randint(5, 55),
            own.REG_SUPPLY: lambda: self.chance.choice((0, 160, 230, 230, 265)),
            training.REG_MACHINE_FAULT: lambda: self.chance.choice((0, *FAULTS)),
        }
        while True:
            await asyncio.sleep(self.chance.uniform(0.3, 2.0))
            item = self.chance.choice(list(self.plant.equipment.values()))
            link = self.runtime.links[item.link]
            with suppress(LinkError):
                if self.chance.random() < 0.5:
                    await link.raw_write(item.unit, training.REG_LINE_DELAY, [self.chance.randint(0, 900)])
                    await link.raw_write(item.unit, training.REG_LINE_ARGUMENT, [self.chance.choice((1, 2, 4, 6, 11))])
                    await link.raw_write(item.unit, training.REG_LINE_COUNT, [self.chance.choice((0, 1, 3, 30))])
                    mode = self.chance.choice(list(training.LINE_FAULT_MODES))
                    await link.raw_write(item.unit, training.REG_LINE_FAULT, [mode])
                    self.done[f"line: {training.LINE_FAULT_MODES[mode]}"] += 1
                else:
                    register = self.chance.choice(list(registers))
                    await link.raw_write(item.unit, register, [registers[register]()])
                    self.done["machine"] += 1
                if self.chance.random() < 0.3:
                    await link.raw_write(item.unit, training.REG_LINE_FAULT, [0])
                    await link.raw_write(item.unit, training.REG_MACHINE_FAULT, [0])

    async def operate(self, who: Person) -> None:
        """Give every command that there is, whether it is possible or not."""
        gate = self.runtime.gate
        assert gate is not None
        while True:
            await asyncio.sleep(self.chance.uniform(0.2, 1.0))
            item = self.chance.choice(list(self.plant.equipment.values()))
            with suppress(Refused):
                gate.control.take(who, item.id)
            command = self.chance.choice([c for c in item.type.commands.values() if not c.hold])
            argument = round(self.chance.uniform(5, 50), 2) if command.argument else None
            try:
                nonce = gate.nonces.issue(who.session)
                await gate.ask(who, item.id, command.key, argument=argument, nonce=nonce, confirmed=True)
                self.done["command sent"] += 1
            except (Refused, Question) as refusal:
                self.done[f"command refused: {refusal.reason}"] += 1
            if self.chance.random() < 0.2:
                gate.control.release(who, item.id)

    async def browse(self) -> None:
        """A page is opened, watched for a while and left."""
        while True:
            kind = self.chance.choice(["overview", *(f"equipment/{name}" for name in self.plant.equipment)])
            watcher = self.runtime.live.join(kind, page_tags(kind, self.runtime.plant, self.runtime.points))
            try:
                async with asyncio.timeout(self.chance.uniform(0.5, 5.0)):
                    while True:
                        await watcher.next()
                        self.done["frame"] += 1
            except TimeoutError:
                pass
            finally:
                self.runtime.live.leave(watcher)

    async def watch(self) -> None:
        """Whoever asks for health finds it."""
        while True:
            await asyncio.sleep(0.25)
            self.most_lag = max(self.most_lag, self.runtime.sweep.loop_lag)
            dead = [(task.name, task.error) for task in self.runtime.supervisor.tasks.values() if task.failures]
            assert not dead, dead

    @property
    def plant(self):  # type: ignore[no-untyped-def]
        assert self.runtime.plant is not None
        return self.runtime.plant

    async def repair(self) -> None:
        """Everything as it was at the start: the training registers of each drive say so."""
        for item in self.plant.equipment.values():
            link = self.runtime.links[item.link]
            async with asyncio.timeout(30):
                while True:
                    with suppress(LinkError):
                        await link.raw_write(item.unit, training.REG_LINE_FAULT, [0])
                        await link.raw_write(item.unit, training.REG_RESET, [1])
                        break
                    await asyncio.sleep(0.2)


def memory() -> float:
    """[MB]"""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmRSS:"):
            return int(line.split()[1]) / 1000
    raise LookupError("VmRSS")


@pytest.fixture(params=["memory", "tcp"])
async def runtime(request: pytest.FixtureRequest, tmp_path: Path) -> AsyncIterator[Runtime]:
    """The demo plant, its drives in this process or behind a socket."""
    folder = bundled("plants/demo")
    if request.param == "tcp":
        plant, problems = read_plant(folder)
        assert plant is not None, problems
        sim = SimPlant(plant, Runtime(Settings(data=tmp_path / "unused")).clock)
        server = await serve_tcp(sim.merged(), "127.0.0.1", 0)
        moving = asyncio.create_task(sim.run())
        text = (folder / "plant.toml").read_text("utf-8")
        text = text.replace(
            'transport = "memory"', f'transport = "tcp"\nhost = "127.0.0.1"\nport = {server.address[1]}'
        )
        folder = tmp_path / "plant"
        folder.mkdir()
        (folder / "plant.toml").write_text(text, "utf-8")
        shutil.copytree(bundled("plants/demo") / "sequences", folder / "sequences")
    runtime = Runtime(Settings(plant=folder, data=tmp_path / "data"))
    await runtime.start()
    yield runtime
    await runtime.stop()
    if request.param == "tcp":
        moving.cancel()
        await asyncio.gather(moving, return_exceptions=True)
        await server.close()


async def differing(runtime: Runtime) -> list[str]:
    """Points that do not show what the device holds; what changes all the time is only asked to be good."""
    assert runtime.plant is not None
    wrong = []
    for item in runtime.plant.equipment.values():
        link = runtime.links[item.link]
        for point in item.points.values():
            register = point.register
            if register is None or not register.readable:
                continue
            sample = runtime.tags.sample(point.name)
            if not is_good(sample.quality):
                wrong.append(f"{point.name}: quality {sample.quality:#x}")
            elif point.scan is not Scan.FAST:
                words = await link.raw_read(item.unit, register.address, register.words)
                if sample.value != decode(register, words):
                    wrong.append(f"{point.name}: {sample.value} and {decode(register, words)}")
    return wrong


@pytest.mark.soak
@pytest.mark.timeout(0)
async def test_a_shift_of_faults_kills_nothing_costs_no_memory_and_ends_in_the_truth(runtime: Runtime) -> None:
    shift = Shift(runtime, seed=5)
    who = replace(person("ana", "operator", "engineer"), id=77)
    work = [shift.instruct(), shift.operate(who), shift.watch(), *(shift.browse() for _ in range(3))]
    tasks = [asyncio.create_task(each) for each in work]
    done, _ = await asyncio.wait(tasks, timeout=SECONDS / 5, return_when=asyncio.FIRST_EXCEPTION)
    before = memory()
    if not done:
        done, _ = await asyncio.wait(tasks, timeout=SECONDS * 4 / 5, return_when=asyncio.FIRST_EXCEPTION)
    after = memory()
    for task in done:
        task.result()
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)
    print(f"\n{SECONDS:.0f} s: {dict(sorted(shift.done.items()))}")
    print(
        f"memory {before:.1f} → {after:.1f} MB, longest loop lag {1000 * shift.most_lag:.0f} ms, alarms {runtime.alarms.list.revision}"
    )
    assert after - before < GROWTH
    await shift.repair()
    until = asyncio.get_running_loop().time() + 90  # a unit that was silent for long is asked once a minute
    while wrong := await differing_or_silent(runtime):
        assert asyncio.get_running_loop().time() < until, wrong
        await asyncio.sleep(1)
    assert all(task.alive for task in runtime.supervisor.tasks.values())
    assert runtime.access.audit.healthy and runtime.access.audit.intact
    assert not runtime.recorder.full and runtime.recorder.dropped == 0


async def differing_or_silent(runtime: Runtime) -> list[str]:
    try:
        return await differing(runtime)
    except LinkError as error:
        return [str(error)]


@pytest.mark.soak
@pytest.mark.timeout(0)
@pytest.mark.parametrize("transport", ["tcp", "rtu"])
async def test_writes_over_bad_lines_for_as_long_as_it_takes(transport: str) -> None:
    await command_faulty_lines(transport, max(1000, round(SECONDS * 150)), seed=11)
