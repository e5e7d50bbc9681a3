"""A whole house in virtual time, its plant, its people, and everything that can go wrong with them.

The machines live on when the server is killed, as real ones do: the virtual devices belong to the world, not to the server.
"""

import asyncio
import hashlib
import logging
import re
import shutil
from collections import Counter
from collections.abc import Awaitable, Callable, Coroutine, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import partial
from math import inf
from pathlib import Path
from random import Random
from typing import Any, cast

import app.db
import app.runtime
from app import chance
from app.access.passwords import Cost, Passwords
from app.access.roles import Person, permissions_of
from app.access.sessions import hash_of
from app.clock import ManualClock
from app.commands import interlocks
from app.commands.job import Job
from app.commands.lifecycle import Progress
from app.commands.machine import Machine, SetJob
from app.commands.orders import Order
from app.commands.parameter_change import KEY as PARAMETERS
from app.commands.parameter_change import SAVE, ParameterChange
from app.errors import PogonError, StorageError
from app.plant.definitions import Command, Equipment, Plant
from app.plant.events import RingEvent
from app.plant.expression import Reading, parse
from app.plant.loader import read_plant
from app.registers import plc_map
from app.running.page_tags import page_tags
from app.runtime import Runtime
from app.settings import Settings
from app.sim.bus import Bus
from app.sim.device import VirtualDevice
from app.sim.eura_e800.drive import VirtualE800
from app.sim.machines import MACHINE_FAULTS
from app.sim.plant import SimPlant
from app.sim.plc import EVENT_CAPACITY, VirtualPlc
from app.sim.sinamics.drive import VirtualSinamics
from app.sim.sinamics.mailbox import MailboxFault
from app.sim.sinamics.training import REG_MAILBOX
from app.sim.training import REG_MACHINE_FAULT, REG_POWER
from app.tags.quality import NO_DATA, is_good
from tests.demo_plant import DEMO, LINKS, plant_file
from tests.storm.disk import Disks
from tests.storm.line import Line, Trouble, Wire
from tests.storm.rights import Rights
from tests.storm.script import CALM, DRIVE_ACTS, PEOPLE, WEB_ACTS, Action, Script
from tests.virtual import MORNING, VirtualLoop, inline

PASSWORD = "tri plave ladice u kutu"
AGENT, ADDRESS = "Mozilla/5.0 (X11; Linux x86_64; rv:140.0) Gecko/20100101 Firefox/140.0", "127.0.0.1"
BOSS = Person(0, "boss", "boss", frozenset({"admin"}), permissions_of({"admin", "engineer", "operator"}), "")
CHEAP = Cost(1, 64, 1)
STEP = 0.25
"""Between two looks of the checker [s]."""
EXTRA = """
[equipment.m3]
type = "eura_e800"
link = "hall"
unit = 3
label = { hr = "Ventilator 3", en = "Fan 3", de = "Lüfter 3", cs = "Ventilátor 3" }
rated_current = 2.5
"""


DRIVES = """
[links.drives]
{link}
writes = true

[equipment.d1]
type = "sinamics"
link = "drives"
unit = 1
label = {{ hr = "Pumpa 1", en = "Pump 1", de = "Pumpe 1", cs = "Čerpadlo 1" }}
simulation = {{ start = "forward", setpoint = 60, p2040 = 1000 }}

[equipment.d2]
type = "sinamics"
link = "drives"
unit = 2
label = {{ hr = "Pumpa 2", en = "Pump 2", de = "Pumpe 2", cs = "Čerpadlo 2" }}
simulation = {{ setpoint = 60, gateway = 1 }}
"""
"""d1 has its mailbox itself, d2 has that of a PLC between."""


def plant_text(machines: Sequence[str], links: Mapping[str, str]) -> str:
    """As `plant_file`; `extra` is one more drive, d1 and d2 are SINAMICS drives."""
    link, *drives = re.split(r"(?m)^(?=\[equipment)", DRIVES.format(link=links.get("drives", 'transport = "memory"')))
    found = [one for one in drives if one[11:13] in machines]
    return (
        plant_file(machines, links) + (EXTRA if "extra" in machines else "") + "".join([link, *found] if found else ())
    )


class Fell(Exception):
    """Something is not as it must be; `name` of the invariant."""

    def __init__(self, name: str, what: str) -> None:
        super().__init__(f"{name}: {what}")
        self.name = name


@dataclass(frozen=True)
class Done:
    """A command that a PLC took, as the device itself says."""

    at: float
    """[s]"""
    machine: str
    code: int
    id: int
    taken: bool
    """False: it said no."""


@dataclass(frozen=True)
class Told:
    """A device event as it was put into a ring."""

    machine: str
    boot: int
    sequence: int
    code: int
    at: float
    """[s]"""


@dataclass(frozen=True)
class Heard:
    """A device event as the server has it."""

    machine: str
    sequence: int
    code: int
    time: int
    """When it happened, as the server reckons [µs UTC]."""
    at: float
    """When it was handed over [s]."""


@dataclass(frozen=True)
class Begun:
    """An order as it stood when it was about to be sent; a Stop is none."""

    at: float
    """[s]"""
    id: str
    machine: str
    key: str
    session: str
    who: str
    """Whose session it is, as the server says."""
    holder: str
    """Session that held the machine; nothing: none did."""
    silent: float
    """How long ago the machine was heard last [s]."""
    poor: tuple[str, ...]
    """Values that it is judged by and that were not good."""
    unmet: tuple[str, ...]
    """Interlocks and permissives that were not met."""


@dataclass
class World:
    """Everything; `live` plays a script."""

    script: Script
    folder: Path
    keep_trace: bool = False
    clock: ManualClock = field(default_factory=lambda: ManualClock(MORNING))
    runtime: Runtime = field(init=False)
    sim: SimPlant | None = None
    sids: dict[str, str] = field(default_factory=dict)
    """Who is signed in, and with which session."""
    ids: dict[str, int] = field(default_factory=dict)
    removed: set[str] = field(default_factory=set)
    """Machines that were taken out of the plant file at any time: in again, they are others."""
    unplugged: set[str] = field(default_factory=set)
    """Links."""
    ended: list[tuple[float, Progress]] = field(default_factory=list)
    """Commands that are over [s], also those of servers that were killed."""
    done: list[Done] = field(default_factory=list)
    told: list[Told] = field(default_factory=list)
    heard: list[Heard] = field(default_factory=list)
    frozen: dict[tuple[str, float], float] = field(default_factory=dict)
    """A machine whose program stood still, from when → to when [s]; so did its clock."""
    walls: list[tuple[float, int]] = field(default_factory=list)
    """From when on [s] the wall clock was ahead of the monotonic one by how much [µs]."""
    asked: dict[str, tuple[float, str, str]] = field(default_factory=dict)
    """Id of every order → when [s], machine, command."""
    askers: dict[str, str] = field(default_factory=dict)
    """Id of every order → who gave it."""
    nonces: dict[str, str] = field(default_factory=dict)
    """Id of an order → the one-time number that it came with."""
    begun: list[Begun] = field(default_factory=list)
    kept: dict[str, float] = field(default_factory=dict)
    """Lease of a held button → when word of it was last sent [s]."""
    let_go: dict[str, float] = field(default_factory=dict)
    """The same → when it was let go [s]."""
    acknowledged: Counter[int] = field(default_factory=Counter)
    """Occurrence of an alarm → how often somebody was told that his acknowledgement is written down."""
    sets: dict[str, tuple[str, ...]] = field(default_factory=dict)
    """Id of every set of setpoints → what it wanted to write."""
    powered: dict[str, float] = field(default_factory=dict)
    """Machine → when it was last off and on again [s]."""
    hidden: Counter[tuple[str, str]] = field(default_factory=Counter)
    """Alarm and what the journal says of it → how often somebody was told that it is put aside, or back."""
    refused_stops: list[tuple[str, str, int]] = field(default_factory=list)
    lives: int = 0
    """Servers that were started."""
    down: bool = True
    sick: float = 0.0
    """Since when the database of people could not be written, now or last [s]."""
    healed: float = -inf
    """When that was over last [s]."""
    calm: float = inf
    """From then on nothing goes wrong any more [s]."""
    troubled: float = 0.0
    """Until then something was wrong with the server, its disk or its clock [s]."""
    tasks: set["asyncio.Task[None]"] = field(default_factory=set)
    acting: dict["asyncio.Task[None]", None] = field(default_factory=dict)
    silences: list[tuple[int, int]] = field(default_factory=list)
    """When no server saw anything [µs UTC, from and to], as long as the clock was not set back behind that."""
    lived: list[tuple[int, int]] = field(default_factory=list)
    """Until when the clock was set, each with since when it had run there [µs UTC]."""
    lives_since: int = 0
    """What the clock was in the beginning, and when it was last set [µs UTC]."""
    errors: list[str] = field(default_factory=list)
    """What was logged as an error that is none of those we made."""
    lines: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.random = Random(f"world {self.script.seed}")
        self.line = Line(self.clock, Random(f"line {self.script.seed}"), self.trace)
        self.line.name = self.name_of
        self.disks = Disks(Random(f"disk {self.script.seed}"))
        self.disks.die = self._die
        self.rights = Rights(lambda: self.now)
        self._hash = hashlib.sha256()
        self.lives_since = self.clock.micros()
        self.walls.append((self.now, self.clock.micros() - round(self.now * 1e6)))
        self.machines = list(self.script.machines)
        self.wires: dict[str, Wire] = {}
        """Links that are not in memory."""
        if self.script.carrier != "memory":
            serial = self.script.carrier == "rtu"
            self.wires = {
                link: Wire(self.line, link, number, serial, partial(self._bus, link))
                for number, link in enumerate((*LINKS, "drives"))
            }
        self.plant_folder = self.folder / "plant"
        shutil.copytree(DEMO, self.plant_folder)
        self._write_plant()
        self.data = self.folder / "data-0"

    def trace(self, line: str) -> None:
        """What makes two runs the same."""
        self._hash.update(line.encode() + b"\n")
        if self.keep_trace:
            self.lines.append(line)

    @property
    def digest(self) -> str:
        """Of everything that happened."""
        return self._hash.hexdigest()

    @property
    def now(self) -> float:
        return self.clock.monotonic()

    # ---- the server -----------------------------------------------------------------------------------

    async def start(self) -> None:
        """A server from the files as they are."""
        self.lives += 1
        self.line.life = self.lives
        self.runtime = runtime = self._build()
        try:
            await runtime.start()
        except PogonError as error:
            raise Fell("starts_again", f"{type(error).__name__}: {error}") from error
        runtime.access.passwords._hasher = Passwords(CHEAP)._hasher
        runtime.access.throttle.take = lambda _address: True  # type: ignore[method-assign]
        for which in ("db", "history"):
            self.disks.watch(which, getattr(runtime, which))
        if runtime.gate is not None:
            runtime.gate.subscribe_ends(self._ended)
            self._watch_orders(runtime)
        if self.lives == 1:
            for name, roles in PEOPLE.items():
                account, _ = await runtime.access.people.add(BOSS, name, "", roles)
                runtime.access.people.set_password_now(BOSS, name, PASSWORD)
                self.ids[name] = account.id
                self.rights.begin(name, roles)
        self._hear(runtime)
        self._started()
        self.down = False

    def _hear(self, runtime: Runtime) -> None:
        ring = runtime.alarms.ring
        take = ring.take

        def taken(machine: str, events: Sequence[RingEvent], lost: int) -> None:
            self.heard += [Heard(machine, one.sequence, one.code, one.time, self.now) for one in events]
            take(machine, events, lost)

        ring.take = taken  # type: ignore[method-assign]

    def _watch_orders(self, runtime: Runtime) -> None:
        """Have every order seen when it is about to be sent: a plain one with its line in the audit; of a set, which looks whether it may
        go on before each telegram, every telegram with new values."""
        gate = runtime.gate
        assert gate is not None
        lines = gate._state.audit_lines
        sent = lines.sent

        async def telling(order: Order, progress: Progress) -> bool:
            machine = gate._state.machines.get(order.equipment)
            if machine is not None and machine.job is not None and machine.job.order is order:
                self._begun(runtime, machine, machine.job)
            return await sent(order, progress)

        lines.sent = telling  # type: ignore[method-assign]
        self._watch_telegrams(runtime, gate._sets, "_send")
        for work in (gate.parameters._work, gate.encoders._work):
            self._watch_telegrams(runtime, work, "change")

    def _watch_telegrams(self, runtime: Runtime, sets: object, name: str) -> None:
        send = getattr(sets, name)

        def telling(machine: Machine, job: SetJob, *given: Any, new: bool = True) -> Awaitable[Any]:
            if new:
                self._begun(runtime, machine, job)
            return cast(Awaitable[Any], send(machine, job, *given, new=new))

        setattr(sets, name, telling)

    def _begun(self, runtime: Runtime, machine: Machine, at_work: Job | SetJob) -> None:
        """`at_work` is about to be sent."""
        assert runtime.gate is not None
        order = at_work.order
        person = order.person
        if self.down or person is None:
            return
        command = machine.item.type.commands.get(order.key)
        if command is not None and command.stop:  # its line is written beside what is at work by then
            return
        tags, prepared, found = runtime.tags, at_work.prepared, self.bus_of(order.equipment)

        def look(key: str) -> Reading:
            handle = tags.handles.get(f"{order.equipment}.{key}")
            return (None, NO_DATA) if handle is None else (tags.value(handle), tags.quality(handle))

        holder = runtime.gate.control.holder(order.equipment)
        guards = (*machine.item.type.permissives, *machine.item.type.interlocks)
        mine = [one for one in guards if interlocks.guards(one, prepared.command)]
        self.begun.append(
            Begun(
                self.now,
                order.id,
                order.equipment,
                order.key,
                person.session,
                person.name,
                holder.session if holder else "",
                self.now - self.line.heard[id(found[0]), found[1]] if found else 0.0,
                tuple(key for key in prepared.used if not is_good(look(key)[1])),
                tuple(one.key for one in mine if parse(one.expression).true(look) is not True),
            )
        )

    def _build(self) -> Runtime:
        return Runtime(Settings(plant=self.plant_folder, data=self.data), self.clock, inline)

    def _started(self) -> None:
        """Something more that a server needs."""

    def _ended(self, progress: Progress) -> None:
        if self.down:  # of a server that is dead already
            return
        self.trace(f"{self.now:.6f} end {progress.id} {progress.command} {progress.state} {progress.reason}")
        self.ended.append((self.now, progress))
        for listener in self.on_end:
            listener(progress)

    on_end: list[Callable[[Progress], None]] = field(default_factory=list)

    async def stop(self) -> None:
        """As systemd does."""
        self._forget_unwritten()
        self.down = True
        await self.runtime.stop()

    async def kill(self) -> None:
        """Everything that the server did not write is gone: its files are taken as they are now."""
        if not self.down:
            self._die()
        self.disks.torn()
        copy = self.disks.copy
        for task in list(self.acting):  # their browsers have lost the server
            task.cancel()
        await asyncio.gather(*self.acting, return_exceptions=True)
        mine = {asyncio.current_task(), *self.tasks}
        others = [task for task in asyncio.all_tasks() if task not in mine]
        others.sort(key=lambda task: (len(task.get_name()), task.get_name()))  # the same order every time
        for task in others:
            task.cancel()
        await asyncio.gather(*others, return_exceptions=True)
        self.line.dead = False
        for database in (self.runtime.db, self.runtime.history):
            database.close()
        shutil.rmtree(self.data)
        self.data = copy

    def _die(self) -> None:
        """From this moment on nothing that the server does counts."""
        self._forget_unwritten()
        self.down = self.line.dead = True
        self.disks.copy = self.folder / f"data-{self.lives}"
        self.disks.tear(self.data, self.disks.copy)

    def _forget_unwritten(self) -> None:
        """The server ends: what its people were told while it could not be written down may not be so afterwards."""
        if "db" in self.disks.wrong or self.now - self.healed < WRITTEN:
            self.rights.forget(self.sick)

    def simulate(
        self, plant: Plant, clock: ManualClock, *, links: list[str], memories: Mapping[str, Mapping[str, Any]]
    ) -> SimPlant:
        """In place of `SimPlant`: machines that moved before go on."""
        if self.sim is None:
            self.sim = SimPlant(plant, clock, links=links, memories=memories)
        else:
            self.sim.take(*self.sim.renewed(plant, links, {}))
            self.sim._due = self.now
        self.watch_devices()
        return self.sim

    def _bus(self, link: str) -> Bus | None:
        return self.sim.buses.get(link) if self.sim else None

    async def _wire(self) -> None:
        """Machines behind wires: they are none of the server's."""
        plant, problems = read_plant(self.plant_folder)
        assert plant is not None, problems
        self.sim = SimPlant(plant, self.clock, links=list(plant.links))
        self.watch_devices()
        for wire in self.wires.values():
            await wire.carrier.start()
        self.beside(self.sim.run())

    def _rebuild(self) -> None:
        """The machines behind wires are those of the plant file from now on."""
        plant, problems = read_plant(self.plant_folder)
        if self.wires and self.sim and plant is not None and not problems:
            self.sim.take(*self.sim.renewed(plant, list(plant.links), {}))
            self.watch_devices()

    def watch_devices(self) -> None:
        """Have every device tell what it does."""
        for name, device in (self.sim.devices if self.sim else {}).items():
            if isinstance(device, VirtualPlc) and "event" not in vars(device):
                self._watch_plc(name, device)

    def _watch_plc(self, name: str, device: VirtualPlc) -> None:
        area = device._command_area
        take, tell = area.take, device.event
        for sequence in range(
            device.newest - device._ring.kept + 1, device.newest + 1
        ):  # it told them when it was made
            row = sequence % EVENT_CAPACITY * plc_map.EVENT_WORDS
            kept = plc_map.event_of(device._ring.rows[row : row + plc_map.EVENT_WORDS])
            self.told.append(Told(name, device.boots, sequence, kept.code, self.now))

        def taken(words: Sequence[int], time: int) -> None:
            request = plc_map.request_of(words)
            known = area._answers.knows(request.id)
            take(words, time)
            if not known:
                said = area._answers.newest
                self.done.append(Done(self.now, name, request.code, request.id, int(said.state) not in REJECTED))

        def happened(*given: Any, **named: Any) -> None:
            tell(*given, **named)
            self.told.append(Told(name, device.boots, device.newest, int(given[0]), self.now))

        area.take, device.event = taken, happened  # type: ignore[method-assign]

    @property
    def devices(self) -> dict[str, VirtualDevice]:
        return dict(self.sim.devices) if self.sim else {}

    def bus_of(self, machine: str) -> tuple[Bus, int] | None:
        """The line and the unit of a machine."""
        if self.sim is None or machine not in self.sim.equipment:
            return None
        item = self.sim.equipment[machine]
        return self.sim.buses[item.link], item.unit

    @contextmanager
    def standstill(self) -> Iterator[None]:
        """Meanwhile no machine moves; all of them are read as ever."""
        assert self.sim is not None
        self.sim.step = lambda: None  # type: ignore[method-assign]
        try:
            yield
        finally:
            vars(self.sim).pop("step")

    def name_of(self, bus: Bus, unit: int) -> str:
        """The machine of a unit of a line; nothing when there is none."""
        device = bus.devices.get(unit)
        return next((name for name, one in self.devices.items() if one is device), "")

    # ---- life -----------------------------------------------------------------------------------------

    async def live(self, check: Callable[["World", bool], Coroutine[Any, Any, None]]) -> None:
        """Play the script; `check(world, False)` after every step, `check(world, True)` once when all is calm."""
        began = self.now
        if self.wires:
            await self._wire()
        await self.start()
        due, end = list(self.script.actions), self.script.seconds
        try:
            while self.now - began < end or due:
                while due and due[0].at <= self.now - began:
                    action = due.pop(0)
                    self.trace(f"{self.now:.6f} {action}")
                    await self._act(action)
                    await check(self, False)
                    end = max(end, self.now - began + CALM)  # a server that was away often is late with all that is due
                following = min(due[0].at if due else NEVER, self.now - began + STEP)
                await asyncio.sleep(max(1e-6, began + following - self.now))
                await check(self, False)
                if end - (self.now - began) < CALM and not due:
                    await self._calm()
            await check(self, True)
        finally:
            for task in list(self.tasks):
                task.cancel()
            await asyncio.gather(*self.tasks, return_exceptions=True)
            if not self.down:
                await self.stop()
            for wire in self.wires.values():
                await wire.carrier.close()

    async def _calm(self) -> None:
        self.calm = min(self.calm, self.now)
        self.healed = self.now if "db" in self.disks.wrong else self.healed
        self.line.troubles.clear()
        self.disks.mend_all()

    async def _act(self, action: Action) -> None:
        work = getattr(self, f"_do_{action.kind}")
        with suppress(PogonError):
            if action.kind in ALONE:
                await work(**action.given)
            else:
                self.beside(self._quietly(partial(work, **action.given)), acting=action.kind in WEB_ACTS | DRIVE_ACTS)

    async def _quietly(self, work: Callable[[], Coroutine[Any, Any, None]]) -> None:
        with suppress(PogonError):
            await work()

    def beside(self, work: Coroutine[Any, Any, None], *, acting: bool = False) -> None:
        """Do `work` while other things happen; `acting`: at the server, and over with it."""
        task = asyncio.get_running_loop().create_task(work)
        self.tasks.add(task)
        if acting:
            self.acting[task] = None
            task.add_done_callback(lambda done: self.acting.pop(done, None))
        task.add_done_callback(self._finished)

    def _finished(self, task: "asyncio.Task[None]") -> None:
        self.tasks.discard(task)
        if not task.cancelled() and (error := task.exception()) is not None:
            self.errors.append(f"{type(error).__name__}: {error}")

    # ---- people ---------------------------------------------------------------------------------------

    async def person(self, who: str) -> Person | None:
        """Somebody as the server knows this browser now."""
        if self.down or who not in self.sids:
            return None
        return await self.runtime.access.sessions.find(self.sids[who], ADDRESS, AGENT)

    async def _do_enter(self, who: str) -> None:
        if self.down:
            return
        former = self.sids.get(who, "")
        signed = await self.runtime.access.sign_in.with_password(who, PASSWORD, ADDRESS, AGENT, former)
        self.sids[who] = signed.sid
        self._told()
        self.rights.end(who, former)

    async def _do_leave(self, who: str) -> None:
        if person := await self.person(who):
            sid = self.sids[who]
            await self.runtime.access.sessions.end(person, person.session, "signout")
            self._told()
            if person.session == hash_of(sid):
                self.rights.end(who, sid)

    async def _do_look(self, who: str) -> None:
        """Somebody opens a page and closes it after a while."""
        if await self.person(who) is None:
            return
        runtime = self.runtime
        kind = "overview"
        watcher = runtime.live.join(kind, page_tags(kind, runtime.plant, runtime.points))
        try:
            for _ in range(20):
                async with asyncio.timeout(5):
                    frame = await watcher.next()
                self.trace(f"frame {hashlib.sha256(frame).hexdigest()[:12]}")
        except (TimeoutError, ConnectionError, StopAsyncIteration):
            pass
        finally:
            runtime.live.leave(watcher)

    async def _do_take(self, who: str, machine: str) -> None:
        person = await self.person(who)
        if person and self.runtime.gate:
            self.runtime.gate.control.take(person, machine)

    async def _do_give(self, who: str, machine: str) -> None:
        person = await self.person(who)
        if person and self.runtime.gate:
            self.runtime.gate.control.release(person, machine)

    async def _do_want(self, who: str, machine: str) -> None:
        person = await self.person(who)
        if person and self.runtime.gate:
            self.runtime.gate.control.request(person, machine)

    async def _do_stop(self, who: str, machine: str) -> None:
        person, gate, plant = await self.person(who), None if self.down else self.runtime.gate, self.runtime.plant
        if person is None or gate is None or plant is None or machine not in plant.equipment:
            return
        stop = next((c for c in plant.equipment[machine].type.commands.values() if c.stop), None)
        if stop is None:
            return
        id = self._order(who, machine, stop.key)
        may = person.may("stop") or person.may("operate")
        try:
            await gate.ask(person, machine, stop.key, id=id)
        except PogonError as refusal:
            self.trace(f"{self.now:.6f} stop refused {refusal}")
            if may:
                self.refused_stops.append(
                    (machine, getattr(refusal, "reason", str(refusal)), getattr(refusal, "status", 0))
                )

    async def _do_command(self, who: str, machine: str, number: int, part: float, twice: bool) -> None:
        command = self._choose(machine, number, hold=False)
        person = await self.person(who)
        if person is None or command is None or self.runtime.gate is None:
            return
        id, gate = self._order(who, machine, command.key), self.runtime.gate
        if gate.control.holder(machine) is None and number % 4:
            with suppress(PogonError):
                gate.control.take(person, machine)
        arguments = {one.name: str(round(part * 100)) for one in command.arguments}
        argument = f"{part * 60:.2f}" if command.argument else None

        async def press(id: str, nonce: str) -> None:
            self.nonces[id] = nonce
            try:
                await gate.ask(
                    person, machine, command.key, argument=argument, arguments=arguments, id=id,
                    nonce=nonce, confirmed=True, proven=True, reason="storm",
                )  # fmt: skip
            except PogonError as refusal:
                self.trace(f"{self.now:.6f} refused {refusal}")

        nonce = gate.nonces.issue(person.session)
        if twice and number % 3 == 0:  # another order with what the page has used already
            self.beside(self._later(partial(press, self._order(who, machine, command.key), nonce)), acting=True)
        elif twice:  # the same one once more
            self.beside(press(id, gate.nonces.issue(person.session)), acting=True)
        await press(id, nonce)

    @staticmethod
    async def _later(work: Callable[[], Coroutine[Any, Any, None]]) -> None:
        """Somebody has kept what a page sent, and sends it once more."""
        await asyncio.sleep(AGAIN)
        await work()

    async def _do_set(self, who: str, machine: str, number: int, part: float) -> None:
        person = await self.person(who)
        plant = self.runtime.plant
        item = plant.equipment.get(machine) if plant else None
        if person is None or item is None or self.runtime.gate is None or not item.type.setpoints:
            return
        key = list(item.type.setpoints)[number % len(item.type.setpoints)]
        gate = self.runtime.gate
        if gate.control.holder(machine) is None and number % 4:
            with suppress(PogonError):
                gate.control.take(person, machine)
        with suppress(PogonError):
            await gate.set_value(
                person, machine, key, self._typed(item, key, part), id=self._order(who, machine, key),
                nonce=gate.nonces.issue(person.session), confirmed=True, proven=True, reason="storm",
            )  # fmt: skip

    async def _do_sets(self, who: str, machine: str, number: int, parts: list[float]) -> None:
        person = await self.person(who)
        found = self._some_setpoints(machine, number, parts)
        if person is None or not found or self.runtime.gate is None:
            return
        gate = self.runtime.gate
        if gate.control.holder(machine) is None and number % 4:
            with suppress(PogonError):
                gate.control.take(person, machine)
        with suppress(PogonError):
            await gate.set_values(
                person, machine, found, id=self._order_set(who, machine, found), nonce=gate.nonces.issue(person.session), confirmed=True,
                proven=True, reason="storm",
            )  # fmt: skip

    async def _do_change(self, who: str, machine: str, number: int, parts: list[float], cancelled: bool) -> None:
        """Somebody writes parameters of a drive through its mailbox; `cancelled`: and thinks better of it at once."""
        person, gate = await self.person(who), None if self.down else self.runtime.gate
        changes = self._some_parameters(machine, number, parts)
        if person is None or gate is None or not changes:
            return
        with suppress(PogonError):
            gate.control.take(person, machine)
        if cancelled:
            asyncio.get_running_loop().call_later(0.3, gate.parameters.cancel, machine)
        await gate.parameters.change(
            person, machine, changes, id=self._order(who, machine, PARAMETERS), nonce=gate.nonces.issue(person.session),
            confirmed=True, proven=True, reason="storm",
        )  # fmt: skip

    def _some_parameters(self, machine: str, number: int, parts: list[float]) -> list[ParameterChange]:
        """Elements of parameters, a number of them apart in the list of the drive, with values."""
        plant = None if self.down else self.runtime.plant
        item = plant.equipment.get(machine) if plant else None
        if item is None or item.type.device.parameters is not None:
            return []
        known = [one for one in item.type.drive_parameters.values() if one.writable and not one.trigger]
        chosen = {(number + 7 * n) % len(known): part for n, part in enumerate(parts)} if known else {}
        return [
            ParameterChange(
                known[at].objects[-1],
                known[at],
                round(known[at].low + part * (known[at].high - known[at].low), known[at].decimals),
            )
            for at, part in chosen.items()
        ]

    async def _do_save(self, who: str, machine: str) -> None:
        person, gate = await self.person(who), None if self.down else self.runtime.gate
        if person is None or gate is None:
            return
        with suppress(PogonError):
            gate.control.take(person, machine)
        await gate.parameters.save(
            person, machine, id=self._order(who, machine, SAVE), nonce=gate.nonces.issue(person.session), confirmed=True,
            proven=True, reason="storm",
        )  # fmt: skip

    def _some_setpoints(self, machine: str, number: int, parts: list[float]) -> dict[str, str]:
        """Neighbours in the list of a machine's setpoints, with values."""
        plant = None if self.down else self.runtime.plant
        item = plant.equipment.get(machine) if plant else None
        keys = list(item.type.setpoints) if item else []
        if item is None or not keys:
            return {}
        chosen = [keys[(number + n) % len(keys)] for n in range(min(len(parts), len(keys)))]
        return {key: self._typed(item, key, part) for key, part in zip(chosen, parts, strict=False)}

    def _order_set(self, who: str, machine: str, values: Mapping[str, str]) -> str:
        id = self._order(who, machine, "setpoints")
        self.sets[id] = tuple(values)
        return id

    def _typed(self, item: Equipment, key: str, part: float) -> str:
        """A value somewhere in the range of a setpoint, or a little outside."""
        point = item.points[key]
        low, high = point.low if point.low is not None else 0.0, point.high if point.high is not None else 100.0
        return f"{low + part * (high - low):.{point.decimals}f}"

    async def _do_hold(self, who: str, machine: str, number: int, how: str, seconds: float) -> None:
        command = self._choose(machine, number, hold=True)
        person = await self.person(who)
        if person is None or command is None or self.runtime.gate is None:
            return
        hold, nonces = self.runtime.gate.hold, self.runtime.gate.nonces
        id = self._order(who, machine, command.key)
        if self.runtime.gate.control.holder(machine) is None:
            self.runtime.gate.control.take(person, machine)
        token = await hold.arm(
            person, machine, command.key, id=id, nonce=nonces.issue(person.session), confirmed=True, address=ADDRESS
        )
        for counter in range(1, round(seconds / 0.2) + 1):
            if how != "backwards" or counter <= 3:  # what does not rise is no word
                self.kept[token] = self.now
            hold.keep_alive(token, -counter if how == "backwards" and counter > 3 else counter, person.session)
            await asyncio.sleep(0.7 if how == "late" and counter > 3 else 0.2)
            if how == "ends" and counter > 3:
                return
        if how == "gone":
            await self._do_leave(who)
        hold.release(token, person.session)
        self.let_go[token] = self.now

    def _choose(self, machine: str, number: int, hold: bool) -> Command | None:
        plant = self.runtime.plant
        item = plant.equipment.get(machine) if plant and not self.down else None
        found = [c for c in item.type.commands.values() if c.hold is hold and not c.stop] if item else []
        return found[number % len(found)] if found else None

    def _order(self, who: str, machine: str, key: str) -> str:
        id = f"order-{len(self.asked)}"
        self.asked[id], self.askers[id] = (self.now, machine, key), who
        return id

    async def _do_acknowledge(self, who: str, number: int) -> None:
        person = await self.person(who)
        standing = self.runtime.alarms.list.active() if person else []
        if person and standing and person.may("acknowledge"):
            (answer,) = await self.runtime.alarms.acknowledge([standing[number % len(standing)].occurrence], person)
            self.acknowledged[answer.occurrence] += answer.outcome == "done" and answer.stored and not self.down

    async def _do_hide(self, who: str, number: int, how: str, minutes: int) -> None:
        """Somebody puts an alarm aside, or brings one back; what is in the journal then is kept in mind."""
        person, id = await self.person(who), self._hidable(number, how)
        if not id or person is None or not person.may("configure" if how in ("take_out", "put_back") else "shelve"):
            return
        alarms = self.runtime.alarms
        match how:
            case "shelve" | "once":
                alarms.hiding.shelve(id, person, minutes * 60.0, "a storm comes", once=how == "once")
            case "unshelve":
                alarms.hiding.unshelve(id, person)
            case "take_out":
                alarms.hiding.take_out(id, person, "a storm comes")
            case "put_back":
                alarms.hiding.put_back(id, person)
        with suppress(StorageError):
            await alarms.journal.flush()
            if not self.down:  # else a server that had died meanwhile says so, which nobody hears
                self.hidden[id, HIDDEN_AS[how]] += 1

    def _hidable(self, number: int, how: str) -> str:
        """An alarm that can be put aside, more often one that stands, or one that can be brought back; nothing when there is none."""
        if self.down:
            return ""
        alarms = self.runtime.alarms
        listed = alarms.list.hidden() if how in ("unshelve", "put_back") else alarms.list.active()
        found = [one.id for one in listed]
        if how not in ("unshelve", "put_back") and (not found or number % 3 == 0):
            found = [watch.id for watch in alarms._index]
        return found[number % len(found)] if found else ""

    async def _do_program(self, who: str, machine: str, number: int, seconds: float) -> None:
        """A program with a token of somebody; without browsers there is no interface that it could use."""

    async def _do_roles(self, who: str, roles: tuple[str, ...]) -> None:
        if not self.down and who != "ada":
            with self.rights.change(who, "roles", roles):
                await self.runtime.access.people.set_roles(BOSS, self.ids[who], roles)
                self._told()

    async def _do_bar(self, who: str, seconds: float) -> None:
        if self.down or who == "ada":
            return
        sid = self.sids.get(who, "")
        with self.rights.change(who, "barred", True):
            await self.runtime.access.people.disable(BOSS, self.ids[who], True)
            self._told()
        self.rights.end(who, sid)
        await asyncio.sleep(seconds)
        if not self.down:
            with self.rights.change(who, "barred", False):
                await self.runtime.access.people.disable(BOSS, self.ids[who], False)
                self._told()

    def _told(self) -> None:
        """
        Raises:
            StorageError: what the server says was not heard, it is dead already.
        """
        if self.down:
            raise StorageError("nobody heard it")

    # ---- faults ---------------------------------------------------------------------------------------

    async def _do_line(self, machine: str, fault: str, part: float, seconds: float) -> None:
        if found := self.bus_of(machine):
            self.line.troubles.append(Trouble(*found, fault, part, self.now + seconds))

    async def _do_unplug(self, machine: str, seconds: float) -> None:
        """The line is gone with all its units: the port refuses, or there is no such device."""
        item = self.sim.equipment.get(machine) if self.sim else None
        wire = self.wires.get(item.link) if item else None
        if wire is None or wire.link in self.unplugged:
            return
        self.unplugged.add(wire.link)
        await wire.carrier.close()
        await asyncio.sleep(seconds)
        await wire.carrier.start()
        self.unplugged.discard(wire.link)

    async def _do_power(self, machine: str) -> None:
        device = self.devices.get(machine)
        self.powered[machine] = self.now
        if isinstance(device, VirtualPlc | VirtualE800):
            device.power_cycle()
        elif isinstance(device, VirtualSinamics):
            device.write(6, REG_POWER, (1,))

    async def _do_freeze(self, machine: str, number: int, seconds: float) -> None:
        """The program of a PLC stands still; its registers are read all the same."""
        device = self.devices.get(machine)
        if device is None or "step" in vars(device) or not isinstance(device, VirtualPlc):
            return
        device.step = lambda: None  # type: ignore[method-assign]
        began = self.now
        self.frozen[machine, began] = inf
        await asyncio.sleep(seconds)
        vars(device).pop("step", None)
        self.frozen[machine, began] = self.now

    async def _do_fault(self, machine: str, number: int, seconds: float) -> None:
        found, device = self.bus_of(machine), self.devices.get(machine)
        codes = MACHINE_FAULTS.get(device.type, ()) if device else ()
        if found is None or device is None or not codes:
            return
        device.write(6, REG_MACHINE_FAULT, (codes[number % len(codes)],))
        await asyncio.sleep(seconds)
        device.write(6, REG_MACHINE_FAULT, (0,))

    async def _do_mailbox(self, machine: str, number: int, seconds: float) -> None:
        """The mailbox of a drive is late, busy, another master's, wrong or dumb."""
        device = self.devices.get(machine)
        if not isinstance(device, VirtualSinamics):
            return
        device.write(6, REG_MAILBOX, (1 + number % max(MailboxFault),))
        await asyncio.sleep(seconds)
        device.write(6, REG_MAILBOX, (0,))

    async def _do_disk(self, which: str, how: str, seconds: float, after: int) -> None:
        if which == "db" and "db" not in self.disks.wrong and self.now - self.healed >= WRITTEN:
            self.sick = self.now
        self.disks.spoil(which, how, after)
        await asyncio.sleep(seconds)
        self.troubled = max(self.troubled, self.now)
        self.disks.mend(which)
        if which == "db":
            self.healed = self.now

    async def _do_clock(self, seconds: float) -> None:
        self.step_clock(seconds)

    def step_clock(self, seconds: float) -> None:
        """Somebody sets the wall clock; of a time that comes once more nothing can be said afterwards."""
        before = self.clock.micros()
        self.clock.step_wall(seconds)
        now = self.clock.micros()
        self.walls.append((self.now, now - round(self.now * 1e6)))
        self.silences = [(begin, end) for begin, end in self.silences if end < now]
        self.lived.append((self.lives_since, before))
        self.lives_since = now

    @property
    def lived_twice_until(self) -> int:
        """Until when the time that it is now was lived before, by a clock that was set back since [µs UTC]; 0 = it was not."""
        now = self.clock.micros()
        return max((until for since, until in self.lived if since <= now <= until + AHEAD), default=0)

    def _silent(self, begin: int) -> None:
        """No server saw anything from `begin` until now; where the clock was before it was set back, one did."""
        end = self.clock.micros()
        if not any(begin < until and since < end for since, until in self.lived):
            self.silences.append((begin, end))

    async def _do_reload(self, machine: str) -> None:
        """Take a machine out of the plant file, or put it in again."""
        if self.down:
            return
        if machine in self.machines and len(self.machines) == 1:
            return
        if machine == "extra" and not {"m1", "m2"} & set(self.machines):
            return
        before = list(self.machines)
        if machine in self.machines:
            self.machines.remove(machine)
            self.removed.add(machine)
        else:
            self.machines.append(machine)
        if not {"m1", "m2"} & set(self.machines) and "extra" in self.machines:
            self.machines = before
            return
        self._write_plant()
        if not await self._reload(rebuild=machine in self.machines):
            self.machines = before
            self._write_plant()
            self._rebuild()

    async def _do_redefine(self, number: int) -> None:
        """An engineer gives the sequence another least time of its first step: it begins anew with other tables."""
        if self.down or "seq1" not in self.machines:
            return
        file = self.plant_folder / "sequences" / "coil_transport.toml"
        before = file.read_text("utf-8")
        file.write_text(re.sub(r"(?m)^minimum = \d+$", f"minimum = {1 + number % 4}", before, count=1), "utf-8")
        self.removed.add("seq1")
        if not await self._reload(rebuild=True):
            file.write_text(before, "utf-8")
            self._rebuild()

    async def _reload(self, rebuild: bool) -> bool:
        """Have the server take the files of the plant; whether it did. `rebuild`: what stands behind wires is changed first."""
        reading = await self.runtime.plant_files.look()
        if reading.problems:
            return False
        person = await self.person("ada")
        if rebuild:
            self._rebuild()
        reading = await self.runtime.plant_files.reload(person, reading.digest)
        self.watch_devices()
        if reading.refused and reading.refused not in ("plant.refused.other", "plant.refused.nothing"):
            raise Fell("plant_reloads", f"{reading.refused} {reading.error}")
        if reading.done:
            self._rebuild()
        return reading.done

    def _write_plant(self) -> None:
        (self.plant_folder / "plant.toml").write_text(
            plant_text(self.machines, {name: wire.toml for name, wire in self.wires.items()}), "utf-8"
        )

    async def _do_kill(self, seconds: float, point: int, clock: float = 0.0) -> None:
        """Between two steps, or with the so-many-th statement of a database from now on."""
        if point:
            self.disks.doomed = point
            for _ in range(round(PATIENCE / 0.01)):
                if self.down:
                    break
                await asyncio.sleep(0.01)
            self.disks.doomed = 0
        await self.kill()
        await self._back(seconds, clock)

    async def _do_restart(self, seconds: float, clock: float = 0.0) -> None:
        await self.stop()
        await self._back(seconds, clock)

    async def _back(self, seconds: float, clock: float) -> None:
        assert self.sim is not None
        self.disks.mend_all()
        begun = self.clock.micros()
        moving = []
        if not self.wires:
            self.sim._due = self.now
            moving = [asyncio.get_running_loop().create_task(self.sim.run())]
        await asyncio.sleep(seconds)
        for task in moving:
            task.cancel()
        await asyncio.gather(*moving, return_exceptions=True)
        self.troubled = self.now
        self._silent(begun)
        if clock:
            self.step_clock(clock)
        await self.start()

    async def _do_stall(self, seconds: float) -> None:
        """The server stands still; the machines do not."""
        assert self.sim is not None
        begun = self.clock.micros()
        for _ in range(round(seconds / 0.01)):
            self.clock.advance(0.01)
            self.sim.step()
        if seconds > NOTICED and not self.down:
            self._silent(begun)
        self.sim._due = self.now
        await asyncio.sleep(SWEPT)
        self.troubled = self.now


AHEAD = 1_000_000
"""Behind a time that was lived twice the history goes on so much later at most [µs]."""
NOTICED = 2.5
"""A server that stood still for longer has to know it [s]."""
SWEPT = 0.3
"""A server that stood still has looked at all values again [s]."""
HIDDEN_AS = {
    "shelve": "SHELVED",
    "once": "SHELVED",
    "unshelve": "UNSHELVED",
    "take_out": "OOS_ON",
    "put_back": "OOS_OFF",
}
"""How somebody hides an alarm → what the journal calls it."""
ALONE = ("kill", "restart", "stall", "reload", "redefine", "power", "line", "clock")
"""Nothing else happens meanwhile, or it takes no time."""
WRITTEN = 2.0
"""So long after its disk was mended a server has written what waited [s]."""
AGAIN = 1.5
"""So long after a press something comes again with what that page has used already [s]."""
PATIENCE = 2.0
"""Longest wait for a statement at which the server is to be killed [s]."""
REJECTED = (4,)
NEVER = 1e9


class Listener(logging.Handler):
    """Hears what goes wrong inside and was not made by us."""

    def __init__(self, world: World) -> None:
        super().__init__(logging.ERROR)
        self.world = world

    def emit(self, record: logging.LogRecord) -> None:
        error = record.exc_info[1] if record.exc_info else None
        self.world.trace(f"log {record.getMessage()}")
        if error is not None and not isinstance(error, PogonError):
            self.world.errors.append(f"{record.getMessage()}: {type(error).__name__}: {error}")


@contextmanager
def patched(world: World) -> Iterator[None]:
    """The server of `world` is joined to its line and its machines."""
    kept, patience = (app.runtime.exchange, app.runtime.SimPlant), app.db.BUSY_TIMEOUT
    app.db.BUSY_TIMEOUT = 0.0  # nobody waits for a lock in real time
    app.runtime.exchange, app.runtime.SimPlant = world.line.exchange, world.simulate  # type: ignore[assignment, misc]
    root, listener = logging.getLogger("app"), Listener(world)
    propagate, root.propagate = root.propagate, False
    root.addHandler(listener)
    chance.use(Random(f"chance {world.script.seed}"))
    try:
        yield
    finally:
        app.runtime.exchange, app.runtime.SimPlant = kept  # type: ignore[misc]
        app.db.BUSY_TIMEOUT = patience
        root.removeHandler(listener)
        root.propagate = propagate
        chance.use()


def play(
    script: Script,
    folder: Path,
    check: Callable[[World, bool], Coroutine[Any, Any, None]],
    kind: type[World] = World,
    **options: Any,
) -> World:
    """Live through `script` in `folder`, from the first to the last moment.

    Raises:
        Fell: an invariant does not hold.
    """
    world = kind(script, folder, **options)
    loop = VirtualLoop(world.clock)

    def lost(_loop: Any, context: dict[str, Any]) -> None:
        world.errors.append(f"{context.get('message')}: {context.get('exception')!r}")

    loop.set_exception_handler(lost)
    with patched(world):
        try:
            loop.run_until_complete(world.live(check))
        finally:
            rest = asyncio.all_tasks(loop)
            for task in rest:
                task.cancel()
            if rest:
                loop.run_until_complete(asyncio.wait(rest))
            loop.run_until_complete(loop.shutdown_asyncgens())
            loop.close()
    return world
