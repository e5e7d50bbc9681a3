"""A stand for the gate: the demo plant's machines behind a link that is written by hand, and time that only the test moves."""

import asyncio
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest

from app.access.roles import IDLE, Person, permissions_of
from app.clock import ManualClock
from app.commands.gate import TICK, Gate
from app.commands.lifecycle import Progress
from app.commands.orders import AuditLine
from app.errors import LinkError, Refused, Withdrawn
from app.links.schedule import PERMIT
from app.plant.definitions import Plant, Scan
from app.plant.derive import Derivation
from app.plant.loader import read_plant
from app.tags.batch import Batch
from app.tags.database import Tag, TagDatabase
from app.tags.quality import COMM_FAILURE, GOOD, Origin

ROOT = Path(__file__).resolve().parents[2]
SETTINGS: dict[str, float] = {
    "frequency_setpoint": 40.0, "f106": 2, "f111": 50.0, "f112": 0.5, "f114": 5.0, "f115": 5.0, "f119": 0, "f137": 0,
    "f200": 4, "f201": 4, "f203": 0, "f209": 0, "f905": 1.0, "f901": 2,
}  # fmt: skip


def person(name: str = "ana", *roles: str, session: str = "", idle: bool = False) -> Person:
    held = frozenset(roles or ("operator",))
    allowed = permissions_of(held)
    return Person(
        sum(map(ord, name)),
        name,
        name.capitalize(),
        held,
        allowed & IDLE if idle else allowed,
        session or f"session-{name}",
        idle=idle,
    )


ANA, IVO, EVA, VIT = person(), person("ivo"), person("eva", "operator", "engineer"), person("vit", "viewer")


@cache
def read_demo() -> Plant:
    plant, problems = read_plant(ROOT / "plants" / "demo")
    assert plant is not None, problems
    drives = {name: item for name, item in plant.equipment.items() if item.type.name == "eura_e800"}
    return replace(plant, equipment=drives)


def demo_plant(**link: object) -> Plant:
    plant = read_demo()
    return replace(plant, links={name: replace(item, **link) for name, item in plant.links.items()})  # type: ignore[arg-type]


class Drive:
    """What a drive does with a telegram, at once and without physics."""

    def __init__(self) -> None:
        self.values: dict[str, float] = dict.fromkeys(SETTINGS, 0.0) | SETTINGS | {"status": 0, "frequency": 0.0}
        self.deaf = False
        """Echoes and does nothing."""

    def take(self, point: str, value: float) -> None:
        if self.deaf:
            return
        values = self.values
        if point != "command":
            values[point] = value
            if point == "frequency_setpoint" and values["status"] in (1, 2):
                values["frequency"] = value
        elif value in (1, 2) and values["status"] < 4:
            values |= {"status": value, "frequency": values["frequency_setpoint"]}
        elif value in (3, 4) and values["status"] < 4:
            values |= {"status": 0, "frequency": 0.0}
        elif value == 9:
            values["status"] = 0 if values["status"] >= 4 else values["status"]


class FakeLink:
    """A link whose every write can be spoiled: `spoil` is asked before and may raise; "lost" acts and then raises."""

    def __init__(self, stand: "Stand") -> None:
        self.stand = stand
        self.simulated = True
        self.paused = False
        self.writes: list[tuple[str, str, float, bool]] = []
        self.refreshed: list[tuple[str, tuple[str, ...]]] = []
        self.spoil: Callable[[str, str, float], LinkError | None] = lambda equipment, point, value: None
        self.acts_although_spoiled = False
        self.refresh_error: LinkError | None = None
        self.door = asyncio.Event()
        """Closed: a write that is not urgent waits on the wire."""
        self.door.set()

    async def write(self, equipment: str, point: str, value: float, *, urgent: bool = False) -> None:
        self.writes.append((equipment, point, value, urgent))
        await asyncio.sleep(0)
        if not urgent:
            await self.turn()
        self.stand.clock.advance(0.001)
        error = self.spoil(equipment, point, value)
        if error is None or self.acts_although_spoiled:
            self.stand.drives[equipment].take(point, value)
        if error is not None:
            raise error

    def together(self, equipment: str, points: Sequence[str]) -> list[list[str]]:
        return [[point] for point in points]

    async def write_set(self, equipment: str, values: Mapping[str, float]) -> None:
        for point, value in values.items():
            await self.write(equipment, point, value)

    async def turn(self) -> None:
        """Wait for the wire; what may no more is not sent then, as on a link."""
        await self.door.wait()
        permit = PERMIT.get()
        if permit is not None and not permit():
            raise Withdrawn("not sent")

    async def refresh(self, equipment: str, points: Sequence[str]) -> None:
        self.refreshed.append((equipment, tuple(points)))
        await asyncio.sleep(0)
        self.stand.clock.advance(0.001)
        if self.refresh_error:
            raise self.refresh_error
        self.stand.publish(equipment, Scan.FAST, Scan.SLOW, Scan.ONCE)

    def sent(self, equipment: str = "m1") -> list[tuple[str, float]]:
        return [(point, value) for item, point, value, _ in self.writes if item == equipment]


class Line:
    """One line of the audit trail."""

    def __init__(self, line: AuditLine) -> None:
        self.kind, self.person, self.object = line.kind, line.person.name if line.person else "", line.object
        self.old, self.new, self.result, self.reason = line.old, line.new, line.result, line.reason
        self.params = line.params

    def __repr__(self) -> str:
        return f"{self.person} {self.object} {self.old}→{self.new} {self.result} {self.reason}"


class Stand:
    """Gate, tags, drives and clock together. `pass_time` moves all of them."""

    drive_class = Drive
    link_class = FakeLink

    def __init__(self, *, dry_run: bool = False, plant: Plant | None = None) -> None:
        self.plant = plant or demo_plant()
        self.clock = ManualClock()
        self.tags = TagDatabase(self.clock)
        points = [p for p in self.plant.points.values() if p.register is None or p.register.readable]
        self.tags.configure(Tag(p.name, p.id, "derived" if p.derived else "link.hall") for p in points)
        self.drives = {name: self.drive_class() for name in self.plant.equipment}
        self.link = self.link_class(self)
        self.lines: list[Line] = []
        self.alarms: list[str] = []
        self.sent: list[tuple[str, int]] = []
        """What was written down before it was sent, and how many telegrams had left by then."""
        self.disk = asyncio.Event()
        """Open: lines are kept. Closed: the disk does not answer."""
        self.disk.set()
        self.room = True
        """Whether the disk takes lines."""
        self.people: dict[str, Person | None] = {}
        """By session, who may other things now than when they asked; None: the session is over."""
        self.scanning = True
        self.sleeps = False
        """Whether the time of the loop passes, too: what a set waits for between two reads."""
        self.bad: set[str] = set()
        """Machines that do not answer."""
        self._derivation = Derivation(self.plant)
        self.gate = Gate(
            self.tags,
            self.clock,
            writers={"hall": self.link},
            audit=self._audit,
            dry_run=dry_run,
            on_stop_unconfirmed=self.alarms.append,
            rights=lambda who: self.people.get(who.session, who),
            foretell=self._foretell,
        )
        self.gate.configure(self.plant)
        for name in self.drives:
            self.publish(name, Scan.FAST, Scan.SLOW, Scan.ONCE)
        self._derive()

    def _audit(self, line: AuditLine) -> None:
        self.lines.append(Line(line))

    @property
    def commands(self) -> list[Line]:
        return [line for line in self.lines if line.kind == "command"]

    def publish(self, equipment: str, *scans: Scan) -> None:
        now = self.clock.micros()
        item = self.plant.equipment[equipment]
        bad = equipment in self.bad
        for scan in scans:
            points = [p for p in item.points.values() if p.scan == scan and p.register and p.register.readable]
            known = self.drives[equipment].values
            self.tags.publish(
                Batch(
                    "link.hall",
                    list(Scan).index(scan) + 10 * list(self.drives).index(equipment),
                    now,
                    now,
                    [self.tags.handle(p.name) for p in points],
                    [known.get(p.key, 1.0) for p in points],
                    (COMM_FAILURE if bad else GOOD) | Origin.SIMULATED,
                )
            )

    def _derive(self) -> None:
        names = {n: (self.tags.sample(n).value, self.tags.sample(n).quality) for n in self._derivation.inputs}
        found = self._derivation.update(names, self.clock.micros())
        now = self.clock.micros()
        handles = [self.tags.handle(name) for name, _, _ in found]
        self.tags.publish(
            Batch("derived", 0, now, now, handles, [v for _, v, _ in found], qualities=[q for _, _, q in found])
        )

    async def pass_time(self, seconds: float, until: Callable[[], object] = lambda: False) -> None:
        """Let `seconds` pass in ticks: the link scans, the gate looks, tasks get their turn."""
        for _ in range(round(seconds / TICK)):
            if until():
                return
            self.clock.advance(TICK)
            if self.scanning:
                for name in self.drives:
                    self.publish(name, Scan.FAST, Scan.SLOW)
            self.gate.tick()
            await settle()
            if self.sleeps:
                await asyncio.sleep(TICK)

    async def _foretell(self, line: AuditLine) -> bool:
        assert line.kind == "command.sent"
        await self.disk.wait()
        self.sent.append((line.object, len(self.link.writes)))
        return self.room

    async def ask(self, who: Person, command: str, equipment: str = "m1", **asked: object) -> Progress:
        """A well-behaved person: holds the token, has a fresh nonce."""
        if self.gate.control.holder(equipment) is None:
            self.gate.control.take(who, equipment)
        asked.setdefault("nonce", self.gate.nonces.issue(who.session))
        return await self.gate.ask(who, equipment, command, **asked)  # type: ignore[arg-type]

    async def set(self, who: Person, key: str, value: str | float, equipment: str = "m1", **asked: object) -> Progress:
        if self.gate.control.holder(equipment) is None:
            self.gate.control.take(who, equipment)
        asked.setdefault("nonce", self.gate.nonces.issue(who.session))
        return await self.gate.set_value(who, equipment, key, value, **asked)  # type: ignore[arg-type]

    async def set_all(
        self, who: Person, values: Mapping[str, str | float], equipment: str = "m1", **asked: object
    ) -> Progress:
        """A set, asked by a well-behaved person, to its end."""
        return await self.finish(self.begin_set(who, values, equipment, **asked))

    def begin_set(
        self, who: Person, values: Mapping[str, str | float], equipment: str = "m1", **asked: object
    ) -> "asyncio.Task[Progress]":
        if self.gate.control.holder(equipment) is None:
            self.gate.control.take(who, equipment)
        self.sleeps = True
        asked = {"nonce": self.gate.nonces.issue(who.session), "confirmed": True, **asked}
        return asyncio.create_task(self.gate.set_values(who, equipment, values, **asked))  # type: ignore[arg-type]

    async def finish(self, asked: "asyncio.Task[Progress]", limit: float = 60.0) -> Progress:
        """Let time pass until `asked` is answered."""
        await self.pass_time(limit, asked.done)
        assert asked.done(), "no end"
        return await asked

    def state(self, equipment: str = "m1") -> str:
        progress = self.gate.progress(equipment)
        return str(progress.state) if progress else ""

    def drive(self, equipment: str = "m1") -> dict[str, float]:
        return self.drives[equipment].values

    def set_drive(self, equipment: str = "m1", **values: float) -> None:
        self.drives[equipment].values.update(values)
        self.publish(equipment, Scan.FAST, Scan.SLOW, Scan.ONCE)


async def settle() -> None:
    for _ in range(8):
        await asyncio.sleep(0)


async def refusal(stand: Stand, who: object, command: str, **asked: object) -> Refused:
    with pytest.raises(Refused) as refused:
        await stand.ask(who, command, **asked)  # type: ignore[arg-type]
    return refused.value
