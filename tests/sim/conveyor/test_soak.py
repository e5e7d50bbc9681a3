"""Thousands of products with every fault in turn, each put right as an operator would: none is lost unnoticed.

What is counted at the end, of products (things) and of records (what the PLC knows):

- things: fed + put by hand = unloaded + taken off + fallen over the end + still there;
- records: entered + found + inserted = unloaded + empty grips + deleted + withdrawn + left backwards + still in the table;
- thing by thing: unloaded as the record that it was known as, or told before that identities are in doubt, at least by its row, which
  said uncertain or lost; taken off by a hand from a running line and its own record told as lost; fallen over the end, or taken off by
  the operator, and told: lost (11), unexpected (12), length differs (14) of it or of what touches it, jam (24)
  or encoder (26) of its belt, or the sensor that did not see it suspected (28); what the operator took off, at least its row said
  uncertain, or it was where its row said (one half in the beam of S1 that he does not edit: his deed, nothing is lost).
"""

import random
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

import pytest

from app.blocks.product_tracking import Code, ProductState
from app.sim import training
from app.sim.conveyor import training as own
from app.sim.conveyor.machine import FAULTS, Geometry
from app.sim.conveyor.program import VirtualConveyor
from app.sim.conveyor.register_map import ConveyorEvent, ConveyorState
from tests.sim.conveyor.line import Life, Operator, TestLine, Witness, tcp_port

QUICK = {
    "automatic_speed": 80.0,
    "unload_dwell": 0.1,
    "restart_delay": 0.1,
    "acceleration": 300.0,
    "jerk": 2000.0,
    "host_timeout": 2.0,
    "slip_warning": 10.0,
}
TOLERANCE = 5.0
EXPECTED = {
    **{belt: (ConveyorEvent.JAM, belt) for belt in (1, 2, 3)},
    **{10 + belt: (10, None) for belt in (1, 2, 3)},
    21: (12, 2),
    **{20 + sensor: (11, sensor) for sensor in (2, 3, 4)},
    **{30 + sensor: (28, sensor) for sensor in (1, 2, 3, 4)},
    **{40 + belt: (ConveyorEvent.ENCODER, belt) for belt in (1, 2, 3)},
    50: (ConveyorEvent.EMERGENCY_STOP, 0),
    60: (ConveyorEvent.HOST_SILENT, 0),
}
"""What the PLC must tell of each fault: event and source."""
DOUBTED = (ProductState.UNCERTAIN, ProductState.LOST)
"""States of a row that say: who it is must be looked at."""
DOUBTFUL = (ProductState.UNCERTAIN, ProductState.OUTSIDE, ProductState.LOST)
HELD = 10
"""So long the gap supervision may hold a line before somebody looks [s]."""
REMOVED, PUT = -1, -2
"""Deeds by hand, among the faults."""


@dataclass
class Soak:
    """One run until so many products were unloaded."""

    line: TestLine
    seed: int
    goal: int
    happens: Sequence[int] = (*FAULTS, REMOVED, PUT)
    """Faults and deeds by hand, each in turn."""
    told: dict[int, int] = field(default_factory=dict)
    """Fault → how often it was caused and told."""
    taken_silently: set[int] = field(default_factory=set)
    """Products that a hand took off a running line."""
    missed_at_stop: set[int] = field(default_factory=set)
    """Of these: found missing while the gap supervision held the line."""
    worst: float = 0.0
    beat: int = 0

    async def run(self) -> None:
        line = self.line
        self.chance = random.Random(self.seed)
        self.witness = Witness(line)
        self.operator = Operator(line)
        self.counts = {code: 0 for code in (5, 11, 12)}
        await line.start()
        faults = list(self.happens)
        while line.device.machine.unloaded < self.goal:
            self.chance.shuffle(faults)
            for fault in faults:
                await self.quiet(self.chance.uniform(3, 9))
                self.witness.during = fault
                self.witness.lately.clear()
                if fault == REMOVED:
                    await self.remove()
                elif fault == PUT:
                    await self.put()
                else:
                    await self.cause(fault)
                await self.recover()
                self.witness.during = 0
                if line.device.machine.unloaded >= self.goal:
                    break
        await self.quiet(20)

    async def pass_time(self, seconds: float) -> list[tuple[int, int]]:
        """Let it run with a living host; what the ring told."""
        told = []
        for _ in range(max(1, round(seconds))):
            self.beat = self.beat % 65535 + 1
            await self.line.port.write(9, [self.beat], 6)
            self.line.go(1)
            await self.operator.attend()
            for event in await self.line.fetch():
                told.append((int(event.code), event.source))
        # the whole of 10 000 products is not kept
        del self.line.events[:-1]
        return told

    async def quiet(self, seconds: float) -> None:
        """Normal running: whatever position counts is right."""
        self.witness.worst = self.witness.worst_place = 0.0
        await self.pass_time(seconds)
        self.worst = max(self.worst, self.witness.worst)
        assert self.witness.worst <= TOLERANCE, f"step {self.line.device.steps}"

    async def cause(self, fault: int) -> None:
        line = self.line
        code, source = EXPECTED[fault]
        self.witness.worst = self.witness.worst_place = 0.0
        await line.train(training.REG_MACHINE_FAULT, fault)
        for _ in range(60):
            if any(c == code and source in (None, s) for c, s in await self.pass_time(1)):
                break
            if line.device.state in (ConveyorState.STOPPED, ConveyorState.FAULT):
                raise AssertionError(f"fault {fault}: the line stands, event {code} from {source} not told")
        else:
            raise AssertionError(f"fault {fault}: event {code} from {source} not told within 60 s")
        self.told[fault] = self.told.get(fault, 0) + 1
        await self.pass_time(self.chance.uniform(0, 4))
        if fault not in (31, 32, 33, 34):  # a stuck sensor shows a product where there is none, until it is suspected
            assert self.witness.worst_place <= TOLERANCE, (
                f"fault {fault}: {self.witness.worst_place:.1f} mm, not flagged"
            )
        if fault in (1, 2, 3, 11, 12, 13, 24, 41, 42, 43, 50, 60):
            assert self.witness.worst <= TOLERANCE, f"fault {fault}: {self.witness.worst:.1f} mm, not flagged"
        await line.train(training.REG_MACHINE_FAULT, 0)

    async def remove(self) -> None:
        """Somebody takes a product away; the next sensor, or the empty grip, tells it."""
        line = self.line
        first = line.device.geometry.sensors[0]
        for _ in range(60):
            if known := [n for n, product in enumerate(line.true(), 1) if product.tail > first + 5]:
                break
            await self.pass_time(1)
        await self.let_go()
        known = [n for n, product in enumerate(line.true(), 1) if product.tail > first + 5] or known
        number = self.chance.choice(known)
        gone = line.true()[number - 1].number
        id = self.witness.record[gone]
        await line.train(own.REG_REMOVE, number)
        self.taken_silently.add(gone)
        held = 0
        for _ in range(60):
            self.line.go(1)
            held = held + 1 if line.device.state == ConveyorState.GAP else 0
            if held > HELD:
                # its record is still there, and somebody comes too near to that: the line stands, and tells which two
                self.missed_at_stop.add(gone)
                self.told[REMOVED] = self.told.get(REMOVED, 0) + 1
                return
            for event in await line.fetch():
                missed = event.snapshot[0] << 16 | event.snapshot[1] == id
                if event.code == ConveyorEvent.LOST and missed:
                    self.told[REMOVED] = self.told.get(REMOVED, 0) + 1
                    return
            self.beat += 1
            await line.port.write(9, [self.beat & 0xFFFF or 1], 6)
        raise AssertionError(f"product {gone}, record {id}: taken away and never missed")

    async def put(self) -> None:
        """Somebody puts a product between two sensors; the next sensor tells it."""
        line = self.line
        first, *others = (round(place) for place in line.device.geometry.sensors)
        ends = [*others, *line.device.geometry.belt_ends[:-1]]
        between = range(first + 30, min(others[-1] - 40, own.LIMITS[own.REG_PUT][1] + 1), 5)
        await self.let_go()
        for _ in range(60):
            spots = [x for x in between if not any(end - 10 < x < end + 35 for end in ends)]
            room = [x for x in spots if all(x + 25 < other.tail or x - 45 > other.head for other in line.true())]
            if room:
                break
            await self.pass_time(1)
        else:
            raise AssertionError("no room to put a product for 60 s: the line stands")
        before = line.device.machine.put
        number = before + 1 + line.device.machine.entered
        await line.train(own.REG_PUT, self.chance.choice(room))
        assert line.device.machine.put == before + 1
        life = self.witness.lives[number]
        assert life.thing.by_hand
        for _ in range(60):
            await self.pass_time(1)
            if any(code == Code.UNEXPECTED for code, _ in life.told):
                self.told[PUT] = self.told.get(PUT, 0) + 1
                await self.pass_time(self.chance.uniform(0, 8))
                return
            assert not life.fate, f"put by hand and {life.fate}, told {life.told}"
        raise AssertionError(f"a product was put by hand and never told: {life}")

    async def let_go(self) -> None:
        """A line that the gap supervision does not let go by itself has somebody who puts it right."""
        for _ in range(HELD):
            if self.line.device.state != ConveyorState.GAP:
                return
            await self.pass_time(1)
        await self.recover()

    async def recover(self) -> None:
        """The operator; first let a host that was silent be back."""
        self.beat = self.beat % 65535 + 1
        await self.line.port.write(9, [self.beat], 6)
        await self.operator.recover()
        self.witness.rematch()

    def is_accounted(self, number: int, life: Life) -> bool:
        """It is still there, it was unloaded, or it was told that something is wrong with it."""
        match life.fate:
            case "":
                return number in self.witness.here
            case "unloaded":
                return life.unloaded_as in life.ids or bool(life.told) or life.state in DOUBTED
            case "removed" if number in self.taken_silently:
                return number in self.missed_at_stop or any(code == Code.LOST for code, _ in life.told)
            case "removed":
                # the operator's own deed: nothing is lost when the PLC knew where it was until then
                return bool(life.told) or life.state in DOUBTFUL or (bool(life.state) and life.apart <= TOLERANCE)
            case "fallen":
                return bool(life.told)
        return False

    def settle(self) -> None:
        """The books must balance."""
        device, witness = self.line.device, self.witness
        machine, tracking = device.machine, device.tracking
        fates = witness.fates
        assert machine.entered + machine.put == sum(fates.values()) + len(machine.products)
        assert fates["unloaded"] == machine.unloaded and fates["removed"] == machine.removed
        assert machine.removed == len(self.taken_silently) + self.operator.taken_off
        records = sum(1 for slot in tracking.slots if slot)
        left = tracking.entered + tracking.found + tracking.inserted - records
        assert left == tracking.unloaded + witness.empty_grips + tracking.deleted + tracking.withdrawn + tracking.left
        assert tracking.unloaded == machine.unloaded, "what the PLC says was unloaded, was"
        assert witness.gripped == machine.unloaded + witness.empty_grips
        unnoticed = {number: life for number, life in witness.lives.items() if not self.is_accounted(number, life)}
        assert not unnoticed
        assert Counter(life.fate for life in witness.lives.values() if life.fate) == fates
        assert fates["backed out"] == 0
        assert tracking.refused == 0
        assert machine.collisions == 0 or tracking.lost + tracking.unexpected > 0
        assert set(self.told) >= set(self.happens), "every fault came and was told"


def device(seed: int, geometry: Geometry | None = None) -> VirtualConveyor:
    return VirtualConveyor(geometry, seed=seed, interval=2.0, settings=QUICK)


@pytest.mark.sweep(8)
@pytest.mark.parametrize("road", ["memory", "tcp"])
async def test_three_hundred_products_with_every_fault(road: str) -> None:
    line = TestLine(device(11))
    soak = Soak(line, seed=5, goal=300)
    if road == "tcp":
        async with tcp_port(line.device) as port:
            line.port = port
            await soak.run()
    else:
        await soak.run()
    soak.settle()
    assert soak.worst < TOLERANCE


@pytest.mark.soak
@pytest.mark.parametrize("preset", ["model", "simulation"])
async def test_ten_thousand_products_with_every_fault_again_and_again(preset: str) -> None:
    simulation = Geometry(sensors=(150.0, 215.0, 445.0, 560.0), rated_speed=60.0, resolution=1024, intact_is_one=False)
    line = TestLine(device(21, simulation if preset == "simulation" else None))
    soak = Soak(line, seed=8, goal=10_000)
    await soak.run()
    soak.settle()
    tracking, machine = line.device.tracking, line.device.machine
    print(
        f"\n{preset}: {machine.entered} fed, {machine.put} put, {dict(soak.witness.fates)}; worst position error "
        f"{soak.worst:.2f} mm in normal running, {soak.witness.worst_flagged:.1f} mm where the row said uncertain; "
        f"greatest correction {tracking.greatest_correction:.2f} mm; lost {tracking.lost}, unexpected {tracking.unexpected}; "
        f"each fault at least {min(soak.told.values())} times; {line.device.steps * 0.01 / 3600:.1f} h of the line"
    )
