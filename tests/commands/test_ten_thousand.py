"""Two thousand writes, in `make soak` ten thousand, by the whole road (gate → link → transport → wire): not one false success.

The slaves do everything wrong. Eighty drives on twenty sockets, or on forty serial lines, are commanded at once by eighty persons.
Every value is asked for once, so the slaves' own log says whether anything was executed twice.
"""

import asyncio
from collections import Counter
from contextlib import AsyncExitStack, suppress
from dataclasses import dataclass, field, replace
from itertools import count
from typing import Any

import pytest

from app.access.roles import Person
from app.commands.admission import BURST
from app.commands.gate import Gate
from app.commands.lifecycle import Progress, ProgressState
from app.commands.orders import AuditLine
from app.errors import LinkError, Refused
from app.links.register_link import RegisterLink, statistic_names
from app.plant.definitions import Command, Equipment, EquipmentType, Link, Plant, Register, Scan, Write
from app.registers.codec import encode
from app.tags.database import Tag, TagDatabase
from app.tags.quality import is_good
from tests.commands.stand import SETTINGS, demo_plant, person
from tests.faulty import FOR_READS, Plan, SerialFaulty, Slave, TcpFaulty, kinder
from tests.virtual import loop_clock

WRITES = [2_000, pytest.param(10_000, marks=pytest.mark.soak)]
LINES = {"tcp": (20, 4, 1.0), "rtu": (40, 2, 0.3)}
"""Lines, drives on each, part of the faults that reads get: a serial line has no transaction numbers and goes on with care."""
PATIENCE = {"tcp": 0.05, "rtu": 0.12}
"""The time-out of the drives for this test [s]; what it takes for a busy computer's delay is a fault more."""
PACE = 0.21
"""A person may give five commands a second [s]."""
POINTS = ("f114", "f115", "f116", "f117")
"""The first two are scanned, the others are read when somebody wants to know."""
END = (ProgressState.CONFIRMED, ProgressState.UNCONFIRMED, ProgressState.UNKNOWN, ProgressState.FAILED)


def hasty(kind: EquipmentType, patience: float) -> EquipmentType:
    """The E800 with time-outs that let ten thousand failures happen in a minute, and a setpoint command for each ramp."""
    commands = {
        key: Command(
            f"set_{key}",
            key,
            (Write(key, "argument"),),
            f"abs({key} - argument) < 0.06",
            "0.7",
            moves=False,
            argument=key,
        )
        for key in POINTS
    }
    device = replace(kind.device, timeout=patience, turnaround=0.0, fast=0.6, slow=2.0)
    return replace(
        kind, device=device, commands={c.key: c for c in commands.values()} | {"stop": kind.commands["stop"]}
    )


def machine(template: Equipment, kind: EquipmentType, name: str, link: str, unit: int) -> Equipment:
    points = {
        key: replace(
            point,
            name=f"{name}.{key}",
            id=f"{name}.{key}",
            equipment=name,
            scan=Scan.FAST if key in POINTS[:2] else point.scan,
        )
        for key, point in template.points.items()
    }
    return replace(template, id=name, type=kind, link=link, unit=unit, points=points)


def image(item: Equipment) -> dict[int, int]:
    """A drive at standstill."""
    words: dict[int, int] = {}
    for key, point in item.points.items():
        if point.register is not None and point.register.readable and point.register.address < 0x1000:
            value = SETTINGS.get(key, point.low or 0.0)
            words[point.register.address] = encode(point.register, value)[0]
    return words | dict.fromkeys(range(0x1000, 0x1019), 0)


@dataclass
class Tally:
    """What became of everything."""

    ends: Counter[ProgressState] = field(default_factory=Counter)
    refusals: Counter[str] = field(default_factory=Counter)
    asked: dict[Slave, set[tuple[int, int, int]]] = field(default_factory=dict)
    """Unit, address and word of everything that anybody wanted written."""
    audited: Counter[str] = field(default_factory=Counter)
    audited_refusals: int = 0
    refused: set[str] = field(default_factory=set)
    ids: list[str] = field(default_factory=list)
    false: list[object] = field(default_factory=list)


class Hall:
    """Faulty lines and everything between them and a person."""

    def __init__(self, transport: str, seed: int) -> None:
        self.transport = transport
        self.clock = loop_clock()
        self.tags = TagDatabase(self.clock)
        self.tally = Tally()
        demo = demo_plant()
        template = demo.equipment["m1"]
        kind = hasty(template.type, PATIENCE[transport])
        lines, units, part = LINES[transport]
        self.equipment = {
            f"d{line}_{unit}": machine(template, kind, f"d{line}_{unit}", f"line{line}", unit)
            for line in range(lines)
            for unit in range(1, units + 1)
        }
        self.slaves = {
            f"line{line}": Slave(
                {item.unit: image(item) for item in self.equipment.values() if item.link == f"line{line}"},
                Plan(seed + line, PATIENCE[transport], reads=kinder(FOR_READS, part)),
            )
            for line in range(lines)
        }
        self.plant: Plant = replace(demo, equipment=self.equipment, links={}, types={kind.name: kind})
        self.links: dict[str, RegisterLink] = {}
        self.gate: Gate
        self.ended: dict[str, asyncio.Future[Progress]] = {}
        self.numbers = {name: number for number, name in enumerate(self.equipment, 1000)}
        self.left = 0
        """Writes that nobody has begun."""

    async def open(self, stack: AsyncExitStack) -> None:
        """Serve the slaves and connect to them."""
        definitions = {}
        for name, slave in self.slaves.items():
            carrier = TcpFaulty(slave) if self.transport == "tcp" else SerialFaulty(slave)
            await carrier.start()
            stack.push_async_callback(carrier.close)
            if isinstance(carrier, TcpFaulty):
                definitions[name] = Link(name, "tcp", host="127.0.0.1", tcp_port=carrier.port, writes=True)
            else:
                definitions[name] = Link(name, "rtu", port=carrier.path, baud=115200, parity="none", writes=True)
        self.plant = replace(self.plant, links=definitions)
        on = {name: [item for item in self.equipment.values() if item.link == name] for name in definitions}
        points = [p for p in self.plant.points.values() if p.register is not None and p.register.readable]
        tags = [Tag(p.name, p.id, f"link.{self.equipment[p.equipment].link}") for p in points]
        for name, definition in definitions.items():
            tags += [Tag(key, key, "sys") for key in statistic_names(definition, [item.unit for item in on[name]])]
        self.tags.configure(tags)
        for name, definition in definitions.items():
            self.links[name] = RegisterLink(definition, on[name], self.tags, self.clock)
        self.gate = Gate(self.tags, self.clock, writers=self.links, audit=self._audit)
        self.gate.configure(self.plant)
        self.gate.subscribe_ends(self._ended)
        tasks = [asyncio.create_task(work()) for work in (self.gate.run, *(link.run for link in self.links.values()))]

        async def end() -> None:
            await self.gate.close()
            for task in tasks:
                task.cancel()
            results = await asyncio.gather(*tasks, return_exceptions=True)
            assert all(isinstance(result, asyncio.CancelledError) for result in results), results

        stack.push_async_callback(end)

    def _audit(self, line: AuditLine) -> None:
        if line.kind != "command":
            return
        if line.result == ProgressState.REFUSED:  # those of a second are one line with their number
            self.tally.audited_refusals += int(line.params.get("reason_count", 1))
        else:
            self.tally.audited[line.params["id"]] += 1

    def _ended(self, progress: Progress) -> None:
        """A command is over, this very moment: is what the gate says of it true?"""
        self.tally.ends[progress.state] += 1
        item = self.equipment[progress.equipment]
        key = progress.command.removeprefix("set_")
        register, slave = self.register(item, key), self.slaves[item.link]
        assert progress.argument is not None
        word = encode(register, progress.argument)[0]
        if progress.state is ProgressState.CONFIRMED:
            age = self.tags.age(self.tags.handle(f"{item.id}.{key}"))
            since = asyncio.get_running_loop().time() - age - PATIENCE[self.transport]
            if not slave.held(item.unit, register.address, word, since):
                self.tally.false.append(progress)
        elif progress.state is ProgressState.FAILED and any(
            (change.unit, change.address, change.asked) == (item.unit, register.address, word)
            for change in slave.changes[-400:]
        ):
            self.tally.false.append(progress)
        self.ended[progress.id].set_result(progress)

    @staticmethod
    def register(item: Equipment, key: str) -> Register:
        register = item.points[key].register
        assert register is not None
        return register

    async def command(self, item: Equipment) -> None:
        """One person who commands one drive until all telegrams were sent."""
        who = replace(person(f"p{item.id}", "operator", session=f"s{item.id}"), id=self.numbers[item.id])
        self.gate.control.take(who, item.id)
        for number in count():
            if self.left == 0:
                return
            self.left -= 1
            began = asyncio.get_running_loop().time()
            key, word = POINTS[number % len(POINTS)], 1000 + number * 2
            asked = self.tally.asked.setdefault(self.slaves[item.link], set())
            asked.add((item.unit, self.register(item, key).address, word))
            while not await self._ask(who, item, key, word / 10, f"{item.id}-{number}-{len(self.tally.ids)}"):
                if asyncio.get_running_loop().time() - began > 5.0:
                    self.left += 1  # it is silent: the others take over
                    break
                await asyncio.sleep(PACE)
            await asyncio.sleep(PACE - (asyncio.get_running_loop().time() - began))

    async def _ask(self, who: Person, item: Equipment, key: str, value: float, id: str) -> bool:
        """Whether it was sent; a refusal is one that says why, and sends nothing."""
        if self.gate.control.holder(item.id) is None:
            self.gate.control.take(who, item.id)
        if self.gate.why_not(who, item.id, f"set_{key}"):
            return False
        future = self.ended[id] = asyncio.get_running_loop().create_future()
        try:
            nonce = self.gate.nonces.issue(who.session)
            await self.gate.ask(who, item.id, f"set_{key}", argument=value, id=id, nonce=nonce, confirmed=True)
        except Refused as refusal:
            self.tally.refusals[refusal.reason] += 1
            self.tally.ids.append(id)
            self.tally.refused.add(id)
            return False
        self.tally.ids.append(id)
        async with asyncio.timeout(30):
            await future
        del self.ended[id]
        return True


async def command_faulty_lines(transport: str, writes: int, seed: int) -> Tally:
    hall = Hall(transport, seed)
    hall.left = writes
    async with AsyncExitStack() as stack:
        await hall.open(stack)
        async with asyncio.TaskGroup() as group:
            for item in hall.equipment.values():
                group.create_task(hall.command(item))
        await recover(hall)
        await asyncio.sleep(2 * BURST)  # the last refusals are summed up
        examine(hall, writes)
    return hall.tally


async def recover(hall: Hall) -> None:
    """Nothing goes wrong any more: every value that is shown as good is the device's, and nearly all are good.

    What was silent for long is only asked once a minute, and that is not waited for.
    """
    for slave in hall.slaves.values():
        slave.plan.honest = True
    until = asyncio.get_running_loop().time() + 30
    while True:
        await asyncio.sleep(0.5)
        good = false = 0
        for item in hall.equipment.values():
            with suppress(LinkError):
                await hall.links[item.link].refresh(item.id, POINTS)
            for key in POINTS:
                sample = hall.tags.sample(f"{item.id}.{key}")
                if is_good(sample.quality):
                    word = hall.slaves[item.link].units[item.unit].words[hall.register(item, key).address]
                    good, false = good + 1, false + (sample.value != word / 10)
        if not false and good > 0.9 * len(POINTS) * len(hall.equipment):
            return
        assert asyncio.get_running_loop().time() < until, (good, false)


def examine(hall: Hall, writes: int) -> None:
    tally = hall.tally
    drawn = sum((slave.plan.drawn for slave in hall.slaves.values()), Counter[Any]())
    print(f"{hall.transport}: {dict(tally.ends)} refused {dict(tally.refusals)} faults {dict(drawn)}")
    assert tally.false == []
    assert set(tally.ends) <= set(END)
    assert sum(tally.ends.values()) == writes
    assert sum(count for (kind, _), count in drawn.items() if kind == "write") <= writes
    assert len(set(tally.ids)) == len(tally.ids)
    assert tally.audited == Counter(id for id in tally.ids if id not in tally.refused)
    assert tally.audited_refusals == len(tally.refused)
    for slave in hall.slaves.values():
        executed = Counter((change.unit, change.address, change.asked) for change in slave.changes)
        assert max(executed.values()) == 1, "executed twice"
        assert set(executed) <= tally.asked[slave], "nobody asked for it"
    assert tally.ends[ProgressState.CONFIRMED] > 0.35 * writes  # what arrived is told as arrived
    assert tally.ends[ProgressState.UNCONFIRMED] > 0.05 * writes
    assert tally.ends[ProgressState.FAILED] > 0
    assert tally.refusals["why.rate"] == 0


@pytest.mark.sweep(20)
@pytest.mark.slow
@pytest.mark.timeout(300)
@pytest.mark.parametrize("writes", WRITES)
@pytest.mark.parametrize("transport", ["tcp", "rtu"])
async def test_thousands_of_writes_by_the_whole_road_without_one_false_success(transport: str, writes: int) -> None:
    await command_faulty_lines(transport, writes, seed=7)
