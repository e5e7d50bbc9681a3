"""A shift at the crane: the whole house in virtual time, an operator who brings the ladle from stand to stand, and faults by seed.

The operator knows only what the house shows, and acts through the gate; a rigger sets a ladle down by hand when a cycle was given up. After
every cycle the crane has to stand in a state that has a name, and the house has to show just that.
"""

import asyncio
from collections import Counter
from collections.abc import Callable, Coroutine
from contextlib import suppress
from pathlib import Path
from random import Random
from typing import Any

from app.access.roles import Person
from app.errors import PogonError
from app.historian import record_query as query
from app.historian.record_query import RecordFilter
from app.sim.crane import training as own
from app.sim.crane.configuration import STANDS
from app.sim.crane.program import VirtualCrane
from app.sim.crane.register_map import CraneState, Mode, Step, StepState, Suspension
from app.sim.training import REG_MACHINE_FAULT
from app.tags.quality import is_good
from tests.sim.crane.guard import Guard
from tests.storm.line import Trouble
from tests.storm.script import LINE_FAULTS, Script
from tests.storm.trial import Checker
from tests.storm.world import Fell, World, play

MACHINE = "cr1"
CLOSE = """
simulation = { start = "automatic", safe_height = 4600, arc_radius = 1000 }
stand_1_bridge = 8000
stand_2_bridge = 9200
stand_3_bridge = 10400
stand_4_bridge = 11600
""" + "\n".join(f"stand_{n}_trolley = 6000\nstand_{n}_hoist = 3000" for n in range(1, STANDS + 1))  # fmt: skip
"""Stands beside one another: a cycle takes two minutes and has all its steps."""
STEP = 0.5
"""Between two looks of the operator [s]."""
LONGEST = 900.0
"""Of a cycle with all its faults [s]."""
CALMED = 40.0
"""After the last fault everything stands by then, and the house shows it [s]."""
TRIES = 8
"""Of the operator to get on, before he gives the cycle up."""
SHOWN = ("state", "mode", "step", "step_state", "suspension", "ladle_stand", "locked", "loaded", "moving", "held")
"""What the house has to show as it is."""
TROUBLES = ("machine", "machine", "machine", "machine", "power", "line", "stop", "suspend", "jog", "restart")


class Shift(World):
    """So many cycles."""

    def __init__(self, script: Script, folder: Path, cycles: int) -> None:
        self.cycles = cycles
        self.outcomes: Counter[str] = Counter()
        """What became of the cycles."""
        self.why: Counter[str] = Counter()
        """Why cycles were given up."""
        self.made: Counter[str] = Counter()
        """Troubles that there were."""
        self.troubled_by = 0
        """1 while something may still go wrong."""
        self.refused = ""
        """What the house said last to the operator."""
        self.chance = Random(f"shift {script.seed}")
        super().__init__(script, folder)

    def _write_plant(self) -> None:
        super()._write_plant()
        file = self.plant_folder / "plant.toml"
        before, _, after = file.read_text("utf-8").partition("[equipment.cr1]")
        kept = [line for line in after.splitlines() if not line.startswith("simulation")]
        file.write_text(before + "[equipment.cr1]" + "\n".join(kept) + CLOSE, "utf-8")

    @property
    def crane(self) -> VirtualCrane:
        device = self.devices[MACHINE]
        assert isinstance(device, VirtualCrane)
        return device

    def shown(self, key: str) -> float | None:
        """What the house shows; None while it is not good."""
        handle = self.runtime.tags.handle(f"{MACHINE}.{key}")
        value = self.runtime.tags.value(handle)
        return float(value) if is_good(self.runtime.tags.quality(handle)) and value is not None else None

    # ---- the shift

    async def live(self, check: Callable[[World, bool], Coroutine[Any, Any, None]]) -> None:
        if self.wires:
            await self._wire()
        await self.start()
        guard, scan = Guard(self.crane), self.crane._scan

        def guarded() -> None:
            scan()
            guard.look()

        self.crane._scan = guarded  # type: ignore[method-assign]
        try:
            await self._do_enter("ana")
            await asyncio.sleep(3)
            for _ in range(self.cycles):
                await self._cycle()
                await self._stands()
                await check(self, False)
            await asyncio.sleep(CALMED)
            await check(self, True)
            await self._counted()
        finally:
            for task in list(self.tasks):
                task.cancel()
            await asyncio.gather(*self.tasks, return_exceptions=True)
            if not self.down:
                await self.stop()
            for wire in self.wires.values():
                await wire.carrier.close()

    async def _cycle(self) -> None:
        """From a stand to another, with some trouble on the way."""
        random = self.chance
        await self._rig()
        start = int(self.shown("ladle_stand") or 0)
        end = random.choice([n for n in range(1, STANDS + 1) if n != start])
        before = self.crane.cycle.number
        for _ in range(TRIES):
            await self.ask("reset")
            await self.ask("start_automatic")
            if await self.ask("start_cycle", **{"from": start, "to": end, "planned": round(self.crane.load.weight, 1)}):
                break
            await asyncio.sleep(4)
        if self.crane.cycle.number == before:
            raise Fell("cycles_begin", f"refused from {start} to {end}: {self.refused}, {self.crane.start_permissives}")
        self.troubled_by = 1
        self.beside(self._trouble(random.choice((0, 1, 1, 2, 3))))
        began, tries, given_up = self.now, 0, Suspension.NONE
        while self.crane.cycle.open or self.troubled_by:
            if self.now - began > LONGEST:
                raise Fell("cycles_end", f"{self.crane.cycle} after {LONGEST:g} s, state {self.crane.state}")
            await asyncio.sleep(STEP)
            state = None if self.down else self.shown("step_state")
            if state == StepState.WAITING and (load := self.shown("load")) is not None:
                await self.ask("confirm_weight", weight=load)
                await asyncio.sleep(1)
            elif state == StepState.SUSPENDED and not self.troubled_by:
                tries, given_up = tries + 1, self.crane.cycle.suspension
                await self._get_on(tries)
        if self.crane.cycle.number != before + 1:
            raise Fell("cycles_end", f"cycle {self.crane.cycle.number}, {before + 1} was begun")
        self.outcomes[self.crane.cycle.state.name] += 1
        if self.crane.cycle.state is StepState.ABORTED:
            self.why[f"{given_up.name} in {self.crane.cycle.step.name}, {self.crane.travel.fault.value}"] += 1

    async def _get_on(self, tries: int) -> None:
        """A cycle is suspended and nobody knows of a fault any more."""
        await asyncio.sleep(4)
        await self.ask("reset")
        await self.ask("start_automatic")
        await asyncio.sleep(1)
        if tries >= TRIES:
            await self.ask("abort")
        else:
            await self.ask("resume")

    async def _rig(self) -> None:
        """A ladle that hangs on the crane is set down by hand on a stand that is free."""
        crane = self.crane
        if not crane.load.locked and crane.load.stand:
            return
        self.made["rigged"] += 1
        crane.load.stand, crane.load.locked, crane.load.share = crane.load.at or 1, False, 0.0
        lock = crane.stand(crane.load.stand)
        for name, axis in crane.axes.items():
            axis.axis.position = lock[name] if name != "hoist" else crane.settings["safe_height"]
        await asyncio.sleep(2)

    async def _trouble(self, count: int) -> None:
        """What goes wrong, and is mended."""
        random = self.chance
        for _ in range(count):
            await asyncio.sleep(random.uniform(0.5, 90))
            kind = random.choice(TROUBLES)
            self.made[kind] += 1
            await getattr(self, f"_trouble_{kind}")(random)
            self.crane.write(6, REG_MACHINE_FAULT, (0,))
        self.troubled_by = 0

    async def _trouble_machine(self, random: Random) -> None:
        code = random.choice(own.FAULTS)
        self.made[f"fault {code}"] += 1
        self.crane.write(6, REG_MACHINE_FAULT, (code,))
        await asyncio.sleep(random.choice((0.1, 1.0, 5.0, 20.0)))

    async def _trouble_power(self, _random: Random) -> None:
        self.crane.power_cycle()

    async def _trouble_line(self, random: Random) -> None:
        bus = self.bus_of(MACHINE)
        assert bus is not None
        seconds = random.choice((0.5, 3.0, 10.0))
        fault = random.choice(LINE_FAULTS)
        self.line.troubles.append(Trouble(*bus, fault, random.choice((0.3, 1.0)), self.now + seconds))
        await asyncio.sleep(seconds)
        self.line.troubles.clear()

    async def _trouble_stop(self, _random: Random) -> None:
        await self._do_stop("ana", MACHINE)

    async def _trouble_suspend(self, _random: Random) -> None:
        await self.ask("suspend")

    async def _trouble_jog(self, random: Random) -> None:
        with suppress(PogonError):
            await self._do_hold("ana", MACHINE, random.randrange(6), random.choice(("steady", "late", "ends")), 2.0)

    async def _trouble_restart(self, random: Random) -> None:
        await self._do_restart(random.choice((0.5, 4.0)))
        await self._do_enter("ana")

    async def ask(self, command: str, **arguments: float) -> bool:
        """A press of the operator; whether it was taken."""
        person: Person | None = await self.person("ana")
        if not self.down and (person is None or person.idle):  # a quarter of an hour without a page that was opened
            await self._do_enter("ana")
            person = await self.person("ana")
        gate = None if self.down else self.runtime.gate
        if person is None or gate is None:
            return False
        try:
            if gate.control.holder(MACHINE) is None:
                gate.control.take(person, MACHINE)
            progress = await gate.ask(
                person, MACHINE, command, arguments={name: str(value) for name, value in arguments.items()},
                id=self._order("ana", MACHINE, command), nonce=gate.nonces.issue(person.session), confirmed=True, proven=True,
            )  # fmt: skip
        except PogonError as refusal:
            self.trace(f"{self.now:.6f} refused {refusal}")
            self.refused = f"{command}: {refusal}"
            return False
        self.refused = f"{command}: {progress.state} {progress.reason}"
        return str(progress.state) in ("accepted", "confirmed")

    # ---- where it ends

    async def _stands(self) -> None:
        """The crane stands in a state that has a name, its brakes hold, and the house shows just that."""
        crane = self.crane
        for _ in range(round(CALMED / STEP)):
            await asyncio.sleep(STEP)
            if not crane.moving and not any(any(axis.brakes_open) for axis in crane.axes.values()):
                break
        standing = [name for name, axis in crane.axes.items() if axis.axis.speed or not axis.axis.held]
        if standing:
            raise Fell("safe_state", f"{standing} not held in {CraneState(crane.state).name}, {crane.cycle}")
        if crane.cycle.state not in (StepState.DONE, StepState.ABORTED):
            raise Fell("safe_state", f"{crane.cycle}")
        if (crane.cycle.suspension is Suspension.NONE) is (crane.cycle.state is StepState.SUSPENDED):
            raise Fell("safe_state", f"no reason told: {crane.cycle}")
        if crane.mode not in Mode or crane.state not in CraneState:
            raise Fell("safe_state", f"mode {crane.mode}, state {crane.state}")
        await asyncio.sleep(5)
        facts = {**crane.facts, "state": crane.state, "mode": crane.mode, "ladle_stand": crane.load.stand}
        facts |= {"step": crane.cycle.step, "step_state": crane.cycle.state, "suspension": crane.cycle.suspension}
        wrong = {key: (self.shown(key), float(facts[key])) for key in SHOWN if self.shown(key) != float(facts[key])}
        if wrong:
            raise Fell("what_is_shown_is_so", f"(shown, is): {wrong}")

    async def _counted(self) -> None:
        """Every cycle is a record with its outcome, and every step of those that were done has its time."""
        plant = self.runtime.plant
        assert plant is not None
        kind = plant.equipment[MACHINE].type.records["crane_cycle"]
        records = await self.runtime.history.read(
            lambda connection: query.find(connection, kind, RecordFilter(MACHINE), 1000)
        )
        told = Counter(record.outcome.upper() for record in records)
        if told != self.outcomes:
            raise Fell("cycles_are_recorded", f"{told}, {self.outcomes} were carried out")
        parts = await self.runtime.history.read(
            lambda connection: query.part_times(connection, kind, RecordFilter(MACHINE, outcome="done"))
        )
        done = {int(part.key): part.spread.count for part in parts}
        if done != {int(step): self.outcomes["DONE"] for step in Step if step and self.outcomes["DONE"]}:
            raise Fell("cycles_are_recorded", f"steps {done} of {self.outcomes}")


def shift(seed: int, cycles: int, folder: Path, carrier: str = "memory") -> Shift:
    """A shift of so many cycles.

    Raises:
        Fell: something is not as it must be.
    """
    checkers: list[Checker] = []

    async def check(world: World, last: bool) -> None:
        if not checkers:
            checkers.append(Checker(world))
        await checkers[0](world, last)

    script = Script(seed, (MACHINE,), 0.0, (), carrier)
    world = play(script, folder, check, Shift, cycles=cycles)
    assert isinstance(world, Shift)
    return world
