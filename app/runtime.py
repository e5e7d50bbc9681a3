"""Wiring: builds the parts of a running plant and connects them; the only file that knows them all."""

import asyncio
import logging
from collections.abc import Awaitable, Callable, Mapping
from contextlib import suppress
from zoneinfo import ZoneInfo

from app import __version__
from app.access.access import Access, prepare
from app.access.audit.anchors import to_file
from app.access.keys import read_key
from app.access.roles import Person
from app.alarms.engine import AlarmEngine
from app.certificate import end_if_known
from app.clock import Clock, SystemClock
from app.commands.gate import Gate
from app.commands.machine import Machine
from app.database_watch import DatabaseWatch
from app.db import Database
from app.errors import ConfigurationError, StorageError
from app.files import remove_unfinished
from app.historian.events import Events
from app.historian.recorder import Recorder
from app.historian.records import RecordFold
from app.historian.saved_views import SavedViews
from app.links.register_link import RegisterLink
from app.live.frames import Live
from app.plant.changes import renamed
from app.plant.definitions import Equipment, Link, Plant, Point
from app.plant.problems import Problem
from app.plant.retained import RetainedStates
from app.plant.sequences import FOLDER as SEQUENCES
from app.plant.system import COMMANDS, EVENTS
from app.plant.texts import Texts
from app.running.classroom import Classroom
from app.running.command_ends import CommandEnds
from app.running.derived import DerivedPoints
from app.running.disk_pace import DiskPace
from app.running.modbus_door import ModbusDoor
from app.running.next_plant import (
    NextPlant,
    Parts,
    next_links,
    next_simulation,
    parts_of,
    read_words,
    stations_of,
)
from app.running.plant_files import PlantFiles
from app.running.plant_tasks import PlantTasks
from app.running.revisions import Revisions
from app.running.ring_events import RingEvents
from app.running.sequence_drafts import SequenceDrafts
from app.running.sequence_orders import SequenceDesks, is_sequence
from app.running.session_watch import SessionWatch
from app.running.simulated_memories import SimulatedMemories
from app.running.sweep import Sweep
from app.running.system_alarms import tell_of_certificate, tell_of_links, tell_of_server, tell_of_task
from app.running.system_values import system_values
from app.settings import Settings
from app.sim.bus import Bus
from app.sim.plant import SimPlant, exchange, read_simulated
from app.supervisor import Supervisor
from app.tags.database import TagDatabase
from app.threads import Threads, threads

log = logging.getLogger(__name__)


class Runtime:
    """One running plant: read, connected, watched, until `stop`."""

    def __init__(self, settings: Settings, clock: Clock | None = None, threads: Threads = threads) -> None:
        self.settings = settings
        self.clock = clock or SystemClock()
        self._certificate = end_if_known(settings.tls_cert)
        self._threads = threads
        self.tags = TagDatabase(self.clock)
        self.live = Live(self.tags, self.clock, settings.push_period)
        self.texts = Texts.read()
        self.supervisor = Supervisor(lambda task: tell_of_task(self.alarms, task))
        self._tasks = PlantTasks(self.supervisor)
        self.plant: Plant | None = None
        self.problems: list[Problem] = []
        """What was wrong with the plant files when they were taken."""
        self.points: Mapping[str, Point] = {}
        self.links: dict[str, RegisterLink] = {}
        self.sim: SimPlant | None = None
        self.gate: Gate | None = None
        """The way of every command, while there is a plant."""
        self.modbus = ModbusDoor(settings.serve_modbus)
        self.plant_files = PlantFiles(
            settings.plant, self.tags, lambda: self.access.audit, running=lambda: self.plant, take=self._take_plant
        )
        self.drafts = SequenceDrafts(settings.plant, lambda: self.db, self.clock)
        self.sweep = Sweep(
            self.tags,
            self.clock,
            values=lambda: system_values(self.supervisor, self.links.values(), self.sim, self.live, self.recorder),
            published=self._tell_alarms,
            second=lambda: self.derived.pass_time(),
        )
        self.desks = SequenceDesks(lambda: self.gate, lambda: self.plant, self.links)
        self._operated = Revisions(self.tags, self.clock, COMMANDS, block=1)
        self._numbers: Mapping[str, int] = {}
        # from `start` on
        self.db: Database
        """`pogon.db`."""
        self.history: Database
        """`history.db`; one that cannot be opened is told by the recorder and does not stop the plant."""
        self.recorder: Recorder
        """What writes it."""
        self.events: Events
        """What machines tell, and what is made of it."""
        self.ring_events: RingEvents
        """How that comes to the alarms and into the history."""
        self.derived: DerivedPoints
        self.disk: DiskPace  # whether the disk is slow
        self.files: DatabaseWatch  # whether the files of both databases are still there
        self.access: Access  # people, sessions and the audit
        self.alarms: AlarmEngine  # all alarms
        self.command_ends: CommandEnds  # what became of commands
        self.classroom: Classroom  # how far everybody is in their lessons

    # ---- start and stop -------------------------------------------------------------------------------

    async def start(self) -> None:
        """Read the plant and set everything in motion. A wrong plant file is not an error: `problems` lists what is wrong.

        Raises:
            ConfigurationError: POGON_DATA may be read or written by others, or the port of POGON_SERVE_MODBUS is not to be had.
            StorageError: `pogon.db` cannot be used.
        """
        await asyncio.to_thread(self._open_storage)
        await self.access.start(__version__)
        with suppress(StorageError):
            await self.drafts.finish(self.access.audit)
        self._build()
        await self.alarms.load()
        await self.recorder.register(())  # the history has the newest schema before a link asks for the last events
        await self.events.load()
        await self.files.load()
        await self.classroom.load()
        self.supervisor.start("databases", self.files.run)
        self.supervisor.start("people", self.access.watch)
        self.supervisor.start("audit", self.access.audit_watch.run)
        self.supervisor.start("alarms", self.alarms.run)
        self.supervisor.start("lessons", self.classroom.run)
        self.supervisor.start("alarm journal", self.alarms.journal.run)
        self.plant, self.problems = read_simulated(self.settings.plant)
        for problem in self.problems:
            log.error("%s: %s", self.settings.plant, problem)
        if self.plant:
            await self._start_plant(self.plant)
        else:
            self._configure()
            self.alarms.look()
        self.supervisor.start("sweep", self.sweep.run)  # not before there are tags that it publishes
        self.supervisor.start("live", self.live.beat)
        await self._record()
        self.supervisor.start("recorder", self.recorder.run)
        self.supervisor.start("events", self.events.run)

    async def stop(self) -> None:
        """Stop what is held to run, end all tasks and close what is open."""
        if self.gate is not None:
            await self.gate.close()
        await self.supervisor.close()
        await self.modbus.close()
        self.live.close()
        await self.events.close()
        await self.recorder.close()
        history = asyncio.create_task(_close(self.history, self.disk), name="history closed")
        await self.alarms.close()
        await self.classroom.write()
        with suppress(StorageError):
            await self.derived.keep()
        await self.access.stop()
        await _close(self.db, self.disk)
        await history

    def _open_storage(self) -> None:
        _prepare(self.settings, self.clock)
        self.db = Database(self.settings.data / "pogon.db", "pogon", self._threads)
        self.db.migrate()
        self.history = Database(self.settings.data / "history.db", "history", self._threads)
        self.access = _access(self.settings, self.db, self.clock, self._threads)

    def _build(self) -> None:
        """Everything that keeps itself in the databases, and who hears of what."""
        key, retained = read_key(self.settings.data / "audit.key"), RetainedStates(self.db)
        self.alarms = AlarmEngine(self.tags, self.clock, self.db, self.texts, key)
        self.disk = DiskPace(self.clock, self.db.writer, self.access.audit.disk)
        self.recorder = _recorder(self.settings, self.tags, self.history, self.clock)
        told = Revisions(self.tags, self.clock, EVENTS, block=3)
        self.events = Events(self.history, self.clock, told.changed, (RecordFold(),))
        self.ring_events = RingEvents(self.alarms, self.events)
        self.command_ends = CommandEnds(self.access, self.alarms, self.events, self.clock, lambda: self.plant)
        self.classroom = Classroom(self.db, self.tags, self.clock, self.alarms, lambda: self.plant)
        self.derived = DerivedPoints(self.tags, self.clock, retained)
        self._memories = SimulatedMemories(retained, lambda: self.sim)
        self.files = _files(self, retained)
        self.tags.subscribe(self.derived.follow)
        self.tags.on_standstill(self.derived.interrupted)
        sessions = SessionWatch(lambda: self.gate)
        self.access.subscribe(sessions.ended, sessions.rights_changed)
        self.access.sessions.subscribe_deeds(sessions.acted)
        self.access.tell = lambda alarm, name: self.alarms.system.report(alarm, params={"account": name})

    async def _start_plant(self, plant: Plant) -> None:
        self.texts, derivation = await read_words(plant)
        self.access.passwords.plant_name = " ".join(plant.name.values())
        self.sim = await self._memories.simulated(plant, self._simulate)
        parts = await asyncio.to_thread(parts_of, plant, self.texts, list(plant.links), self.alarms, self.tags.table)
        await self.derived.restore(derivation)
        self.derived.take(derivation)
        self._tasks.retain(self.derived.run, self._memories.run)
        self.links.update(next_links({}, plant, self.sim.buses if self.sim else {}, self._link))
        self._configure(parts)
        await self.alarms.look_in_turns()
        self.gate = self._make_gate(parts.machines, plant.timezone)
        await self.command_ends.resume(self.gate, plant)
        self._tasks.follow_commands(self.gate.run)
        self._tasks.run(self.sim, self.links)
        await self.modbus.open(self.sim)

    def _make_gate(self, machines: Mapping[str, Machine], timezone: str) -> Gate:
        gate = Gate(
            self.tags,
            self.clock,
            writers=self.links,
            audit=self.command_ends.write,
            dry_run=self.settings.dry_run,
            on_stop_unconfirmed=self.alarms.system.stop_unconfirmed,
            rights=lambda person: person if is_sequence(person) else self.access.current(person),
            foretell=self.command_ends.foretell,
        )
        gate.take(machines, timezone)
        gate.subscribe(self._operated.changed)
        gate.subscribe_ends(self.command_ends.ended)
        gate.subscribe_ends(self.classroom.ended)
        return gate

    def _link(self, link: Link, machines: list[Equipment], bus: Bus | None) -> RegisterLink:
        made = RegisterLink(link, machines, self.tags, self.clock, exchange=_carried_by(bus), paused=_pause_of(bus))
        return self.ring_events.follow(made)

    def _simulate(self, plant: Plant, links: list[str]) -> SimPlant:
        return self.desks.serve(SimPlant(plant, self.clock, links=links, memories=self._memories.found), self.tags)

    def _configure(self, parts: Parts | None = None, person: Person | None = None) -> None:
        """Tags, alarms and pages of the plant as it is now; `person` had it read anew."""
        parts = parts or parts_of(self.plant, self.texts, self.links, self.alarms, self.tags.table)
        self.points = parts.points
        self.tags.take(parts.table)
        self.alarms.take(parts.alarms, person)
        self.events.configure(self.plant.equipment.values() if self.plant else ())
        self.derived.renew()
        self.live.renew()

    async def _record(self) -> None:
        self._numbers = await self.recorder.register(self.points.values())
        self.recorder.follow(self.points.values(), self._numbers)

    # ---- another plant --------------------------------------------------------------------------------

    async def _take_plant(self, plant: Plant, person: Person | None) -> None:
        """Replace the running plant, or start the first one. What can fail comes first; the exchange itself waits for nothing.

        Raises:
            ConfigurationError: a machine or a link cannot be built; the running plant is untouched, as after any other error.
        """
        old = self.plant
        if old is None:
            await self._start_first(plant)
            return
        new = await self._prepare(old, plant)
        await self._tasks.end_links(self.links, new.links)
        if new.sim is not self.sim:
            await self._tasks.end_simulation()
        former = self._as_it_runs(old)
        try:
            self._exchange_plant(new, person)
            await asyncio.sleep(0)
            self.derived.compute_all()
            await self.alarms.look_in_turns()
        except Exception:
            log.exception("plant not exchanged, the former one goes on")
            self._exchange_plant(former, person)
            self.derived.compute_all()
            self.alarms.look()
            raise
        finally:
            self._tasks.run(self.sim, self.links)
        try:
            await self.modbus.open(self.sim)
        except ConfigurationError as error:
            log.error("%s", error)  # the plant is taken already, and runs

    async def _start_first(self, plant: Plant) -> None:
        self.plant = plant
        try:
            await self._start_plant(plant)
        except Exception:
            await self._tasks.end()
            self.plant = self.sim = self.gate = None
            self.derived.take(None)
            self.links.clear()
            self._configure()
            raise
        self.problems = []
        await self._record()

    async def _prepare(self, old: Plant, plant: Plant) -> NextPlant:
        texts, derivation = await read_words(plant)
        sim, taken = next_simulation(
            self.sim, plant, renamed(old, plant), self._simulate, on_one_port=bool(self.modbus.wanted)
        )
        links = await asyncio.to_thread(next_links, self.links, plant, taken[2] if taken else {}, self._link)
        stations = await asyncio.to_thread(stations_of, plant, links)
        parts = await asyncio.to_thread(parts_of, plant, texts, list(links), self.alarms, self.tags.table)
        numbers = await self.recorder.register(parts.points.values())
        with suppress(StorageError):
            await self.derived.keep()
        await self.derived.restore(derivation)  # a machine that comes back goes on where it left
        return NextPlant(plant, texts, derivation, parts, links, stations, numbers, sim, taken)

    def _as_it_runs(self, plant: Plant) -> NextPlant:
        """What to come back to."""
        sim, derivation = self.sim, self.derived.derivation
        assert derivation is not None
        taken = (dict(sim.equipment), dict(sim.devices), dict(sim.buses)) if sim else None
        return NextPlant(plant, self.texts, derivation, None, dict(self.links), {}, self._numbers, sim, taken)

    def _exchange_plant(self, new: NextPlant, person: Person | None) -> None:
        """Everything that knows the plant knows the other one now; no await, so no batch falls between two revisions."""
        self.tags.wake()  # whoever is told of a standstill later would know handles of two revisions
        if (sim := new.sim or self.sim) is not None:  # with no link in memory left its devices stand still
            sim.take(*(new.taken or ({}, {}, {})))
        gone = set(self.links) - set(new.links)
        self.plant, self.problems, self.texts, self.sim = new.plant, [], new.texts, new.sim
        self.access.passwords.plant_name = " ".join(new.plant.name.values())
        self.links.clear()
        self.links.update(new.links)
        self.derived.take(new.derivation)
        parts = new.parts or parts_of(new.plant, new.texts, new.links, self.alarms, self.tags.table)
        self._configure(parts, person)
        for name, link in self.links.items():
            link.renew(new.plant.on_link(name), new.stations.get(name))
        if self.gate is not None:
            self.gate.take(parts.machines, new.plant.timezone)
        self.recorder.follow(self.points.values(), new.numbers)
        self._numbers = new.numbers
        self.modbus.follow(new.sim)
        for name in gone:
            self.alarms.system.report("link_down", active=False, params={"link": name})

    @property
    def simulated(self) -> bool:
        """Whether every link of the plant says that it is simulated."""
        return bool(self.links) and all(link.simulated for link in self.links.values())

    def _tell_alarms(self) -> None:
        tell_of_links(self.alarms, self.plant, self.links)
        tell_of_server(self.alarms, self.sim, self.access.audit, self.recorder, self.events, self.disk)
        tell_of_certificate(self.alarms, self._certificate, self.clock.micros())


def _carried_by(bus: Bus | None) -> Callable[[int, bytes], Awaitable[bytes | None]] | None:
    """How a memory link reaches its virtual devices."""
    if bus is None:
        return None
    return lambda unit, pdu: exchange(bus, unit, pdu)


def _pause_of(bus: Bus | None) -> Callable[[], bool]:
    """Whether the simulation behind a link is paused now."""
    return lambda: bus is not None and bus.paused


def _prepare(settings: Settings, clock: Clock) -> None:
    prepare(settings.data)
    for folder in (settings.data, settings.plant / SEQUENCES):
        for path in remove_unfinished(folder, clock.micros()):
            log.warning("half written file removed file=%s", path)


def _files(runtime: Runtime, retained: RetainedStates) -> DatabaseWatch:
    return DatabaseWatch(
        runtime.db,
        runtime.history,
        runtime.recorder,
        runtime.events,
        runtime.alarms,
        retained,
        runtime.clock,
        lambda: ZoneInfo(runtime.plant.timezone if runtime.plant else "UTC"),
        lambda: runtime.access.audit.newest,
        runtime.disk.is_slow,
    )


async def _close(database: Database, disk: DiskPace) -> None:
    """Close a database; on a slow disk its journal stays beside it, and the next start reads it."""
    await asyncio.to_thread(database.close, checkpoint=not disk.is_slow())


def _access(settings: Settings, database: Database, clock: Clock, threads: Threads) -> Access:
    access = Access(
        database,
        clock,
        settings.data,
        anchors=[to_file(settings.audit_anchors)] if settings.audit_anchors else [],
        threads=threads,
        factor_roles=settings.factor_roles,
    )
    access.people.hand_over = SavedViews(database, access.audit, clock).hand_over
    return access


def _recorder(settings: Settings, tags: TagDatabase, history: Database, clock: Clock) -> Recorder:
    keep, quota = settings.history_keep_days, int(settings.history_quota_mb * 1e6)
    return Recorder(tags, history, clock, keep_days=keep, quota=quota)
