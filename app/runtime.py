"""Wiring: builds the parts of a running plant and connects them; the only file that knows them all."""

import asyncio
import logging
from collections import Counter
from collections.abc import Awaitable, Callable, Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from zoneinfo import ZoneInfo

from app import __version__
from app.access.access import Access, prepare
from app.access.audit.anchors import to_file
from app.access.audit.search import Filter
from app.access.keys import read_key
from app.access.roles import Person
from app.addresses import host_and_port
from app.alarms.definitions import alarm_points, frame_names
from app.alarms.engine import AlarmEngine
from app.clock import Clock, SystemClock
from app.commands.gate import Gate
from app.commands.interlocks import met, stopped
from app.commands.lifecycle import Progress
from app.commands.lifecycle import State as Progressed
from app.commands.open_commands import NEWEST, open_commands
from app.commands.open_sets import NEWEST as NEWEST_SETS
from app.commands.open_sets import OBJECT, open_sets
from app.commands.orders import AuditLine
from app.commands.sets import FOUND_NEW, FOUND_OLD
from app.commands.value_set import spelt
from app.database_watch import DatabaseWatch
from app.db import Database
from app.errors import ConfigurationError, StorageError
from app.historian.events import Events, Told, has_ring
from app.historian.recorder import WARN_AT, Recorder
from app.historian.records import RecordFold
from app.keeper import Keeper, Kept
from app.links.register_link import RegisterLink
from app.links.statistics import State, statistic_names
from app.live.frames import Live
from app.plant.changes import Change, compare, digest, renamed, same_line
from app.plant.definitions import Equipment, Link, Plant, Point, Problem
from app.plant.derive import Derivation
from app.plant.events import Mark, RingEvent, earlier
from app.plant.retained import RetainedStates
from app.plant.sequences import RUNNING
from app.plant.system import COMMANDS, FRAME, HISTORY, SYSTEM, system_point, system_points
from app.plant.texts import Texts
from app.settings import Settings
from app.sim.bus import Bus
from app.sim.device import VirtualDevice
from app.sim.plant import SimPlant, exchange, read_simulated, units
from app.sim.server import TcpServer, serve_tcp
from app.tags.batch import Batch, Value
from app.tags.database import Standstill, Tag, TagDatabase
from app.tags.quality import NO_DATA
from app.threads import Threads, threads

log = logging.getLogger(__name__)

DERIVED = "derived"
"""Source of the points that are computed from others."""
RETAIN_PERIOD = 60.0
"""How often running hours and the like are kept [s]."""
SIMULATION_LATE = 1.0
"""The virtual plant is behind by more than this [s]: an alarm."""
SIMULATION_SLOW = 0.9
"""Slower than this, compared with real time: an alarm."""
PLANT_TASKS = ("simulation", "retained", "commands")
"""Tasks that there are only while there is a plant; beside them one for each link."""
EVENTS = "events"
"""`sys.events.<equipment>` counts changes of what is kept of its events."""
STORE_LIMIT = 2.0
"""Events of a machine wait this long for the history, then in memory [s]: alarms and communication wait for no disk."""
SWEEP_PERIOD = 0.25
"""How often overdue values are looked for and the loop lag is measured [s]."""


@dataclass(frozen=True, slots=True)
class Reading:
    """The plant files as they are now, beside the plant that runs."""

    problems: tuple[Problem, ...] = ()
    """What is wrong with them; then the running plant stays."""
    changes: tuple[Change, ...] = ()
    digest: str = ""
    """Of the changes: what is given back to confirm them."""
    first: bool = False
    """Nothing runs yet: the plant starts."""
    done: bool = False
    """They were taken."""
    refused: str = ""
    """Text key of why they were not: `plant.refused.…`."""
    error: str = ""
    """What did not take them, for people who configure."""


class Runtime:
    """One running plant: read, connected, watched, until `stop`."""

    def __init__(self, settings: Settings, clock: Clock | None = None, threads: Threads = threads) -> None:
        self.settings = settings
        self.clock = clock or SystemClock()
        self._threads = threads
        self.tags = TagDatabase(self.clock)
        self.live = Live(self.tags, self.clock, settings.push_period)
        self.texts = Texts.read()
        self.keeper = Keeper(self._task_changed)
        self.plant: Plant | None = None
        self.db: Database
        """`pogon.db`, from `start` on."""
        self.history: Database
        """`history.db`, from `start` on; one that cannot be opened is told by the recorder and does not stop the plant."""
        self.recorder: Recorder
        """What writes it, from `start` on."""
        self.events: Events
        """What machines tell, and what is made of it, from `start` on."""
        self.files: DatabaseWatch
        """Whether the files of both are still there, from `start` on."""
        self.access: Access
        """People, sessions and the audit, from `start` on."""
        self.alarms: AlarmEngine
        """All alarms, from `start` on."""
        self.problems: list[Problem] = []
        self.points: dict[str, Point] = {}
        self.links: dict[str, RegisterLink] = {}
        self.gate: Gate | None = None
        """The road of every command, while there is a plant."""
        self.sim: SimPlant | None = None
        self.commands_ended: Counter[str] = Counter()
        """Commands by how they ended, since the start."""
        self.loop_lag = 0.0
        self._derivation: Derivation | None = None
        self._derivation_inputs: frozenset[int] = frozenset()
        self._retained: RetainedStates
        self._modbus: TcpServer | None = None
        self._served: Bus | None = None
        self._reloading = asyncio.Lock()
        self._numbers: Mapping[str, int] = {}
        self._command_revisions: dict[str, int] = {}
        self._event_revisions: dict[str, int] = {}
        self._storing: set[asyncio.Task[None]] = set()

    # ---- start and stop -------------------------------------------------------------------------------

    async def start(self) -> None:
        """Read the plant and set everything in motion. A wrong plant file is not an error: `problems` lists what is wrong.

        Raises:
            ConfigurationError: POGON_DATA may be read or written by others, or the port of POGON_SERVE_MODBUS is not to be had.
            StorageError: `pogon.db` cannot be used.
        """
        await asyncio.to_thread(self._open_storage)
        await self.access.start(__version__)
        self.alarms = AlarmEngine(
            self.tags, self.clock, self.db, self.texts, read_key(self.settings.data / "audit.key")
        )
        await self.alarms.load()
        self.recorder = Recorder(
            self.tags,
            self.history,
            self.clock,
            keep_days=self.settings.history_keep_days,
            quota=int(self.settings.history_quota_mb * 1e6),
        )
        self.events = Events(self.history, self.clock, self._history_changed, (RecordFold(),))
        await self.recorder.register(
            ()
        )  # brings the history to the newest schema, before a link asks for the last events
        await self.events.load()
        self.files = DatabaseWatch(
            self.db, self.history, self.recorder, self.events, self.alarms, self._retained, self.clock, self._zone
        )
        await self.files.load()
        self.keeper.keep("databases", self.files.run)
        self.tags.subscribe(self._derive)
        self.tags.on_standstill(self._stood_still)
        self.access.subscribe(self._sessions_ended, self._rights_changed)
        self.access.sessions.subscribe_deeds(self._people_acted)
        self.access.tell = lambda alarm, name: self.alarms.system.report(alarm, params={"account": name})
        self.keeper.keep("people", self.access.watch)
        self.keeper.keep("audit", self.access.audit_watch.run)
        self.keeper.keep("alarms", self.alarms.run)
        self.keeper.keep("alarm journal", self.alarms.journal.run)
        self.plant, self.problems = read_simulated(self.settings.plant)
        for problem in self.problems:
            log.error("%s: %s", self.settings.plant, problem)
        if self.plant:
            await self._start_plant(self.plant)
        else:
            self._configure()
        self.keeper.keep("sweep", self._sweep)  # not before there are tags that it publishes
        self.keeper.keep("live", self.live.beat)
        await self._record()
        self.keeper.keep("recorder", self.recorder.run)
        self.keeper.keep("events", self.events.run)

    async def stop(self) -> None:
        """Stop what is held to run, end all tasks and close what is open."""
        if self.gate is not None:
            await self.gate.close()
        await self.keeper.close()
        if self._modbus is not None:
            await self._modbus.close()
        self.live.close()
        await self.alarms.close()
        with suppress(StorageError):
            await self._retain_now()
        await self.events.close()
        await self.recorder.close()
        await asyncio.to_thread(self.history.close)
        await self.access.stop()
        await asyncio.to_thread(self.db.close)

    def _open_storage(self) -> None:
        prepare(self.settings.data)
        self.db = Database(self.settings.data / "pogon.db", "pogon", self._threads)
        self.db.migrate()
        self.history = Database(self.settings.data / "history.db", "history", self._threads)
        elsewhere = [to_file(self.settings.audit_anchors)] if self.settings.audit_anchors else []
        self.access = Access(
            self.db,
            self.clock,
            self.settings.data,
            anchors=elsewhere,
            threads=self._threads,
            factor_roles=self.settings.factor_roles,
        )
        self._retained = RetainedStates(self.db)

    async def _start_plant(self, plant: Plant) -> None:
        self.texts = Texts.read(plant)
        self.access.passwords.plant_name = " ".join(plant.name.values())
        memory = [name for name, link in plant.links.items() if link.simulated]
        if memory:
            self.sim = SimPlant(plant, self.clock, links=memory)
            self.keeper.keep("simulation", self.sim.run)
        self._derivation = Derivation(plant)
        self._derivation.restore(await self._retained.read())
        self.keeper.keep("retained", self._retain)
        for name, link in plant.links.items():
            bus = self.sim.buses.get(name) if self.sim else None
            self.links[name] = self._link(link, self.on_link(name), bus)
        self._configure()
        self.gate = self._make_gate(plant)
        await self._tell_what_is_open(self.gate, plant)
        self.keeper.keep("commands", self.gate.run)
        for name, register_link in self.links.items():
            self.keeper.keep(f"link.{name}", register_link.run)
        if self.settings.serve_modbus:
            if self.sim:
                await self._serve_modbus(self.sim)
            else:
                log.warning("POGON_SERVE_MODBUS=%s: no link of the plant is simulated", self.settings.serve_modbus)

    def _make_gate(self, plant: Plant) -> Gate:
        gate = Gate(
            self.tags,
            self.clock,
            writers=self.links,
            audit=self._audited,
            dry_run=self.settings.dry_run,
            rights=self.access.standing,
            foretell=self._foretold,
        )
        gate.configure(plant)
        gate.subscribe(self._operation_changed)
        gate.subscribe_ends(self._command_ended)
        gate.on_stop_unconfirmed = self.alarms.system.stop_unconfirmed
        return gate

    def _command_ended(self, progress: Progress) -> None:
        """A command that was sent and not seen to work is an alarm; a Stop has its own."""
        self.commands_ended[progress.state.value] += 1
        if progress.changes:
            self._set_ended(progress)
        elif progress.state in (Progressed.UNCONFIRMED, Progressed.UNKNOWN) and self.plant:
            command = self.plant.equipment[progress.equipment].type.commands.get(progress.command)
            if command is None or not command.stop:
                self.alarms.system.report(
                    "command_unconfirmed", progress.equipment, params={"command": f"@{progress.label}"}
                )

    def _set_ended(self, progress: Progress) -> None:
        """Values that nobody chose together are an alarm, until all are found to be new or all former ones."""
        mixed = progress.state is Progressed.UNCONFIRMED
        if mixed or progress.reason in (FOUND_NEW, FOUND_OLD):
            params = {"values": spelt(progress.changes)} if mixed else None
            self.alarms.system.report("set_mixed", progress.equipment, mixed, params=params)

    async def _tell_what_is_open(self, gate: Gate, plant: Plant) -> None:
        """Commands and sets of setpoints that a former run of this server has not brought to an end."""
        try:
            of_sets = await self.access.audit.find(Filter(object=OBJECT, kind="command"), NEWEST_SETS)
            lines = await self.access.audit.find(Filter(kind="command"), NEWEST)
        except StorageError as error:
            log.error("open commands not looked for reason=%s", error)
            return
        sets = open_sets(of_sets, plant.equipment)
        gate.take_open_sets(sets)
        gate.take_open_commands(
            open_commands(lines, plant.equipment, self.clock.micros(), {progress.id for progress in sets})
        )

    async def _audited(self, line: AuditLine) -> None:
        """One line of the audit; who gave a command that a device knows by its id is also told to the history of events."""
        person, params = line.person, line.params
        if person is not None and params.get("requests"):
            ended = int(params["ended"]) or self.clock.micros()
            name, why = person.display or person.name, str(params.get("why", ""))
            equipment = line.object.partition(".")[0]
            self.events.told(Told(equipment, tuple(params["requests"]), name, why, int(params["requested"]), ended))
        await self.access.audit.record(*_written(line), **params)

    async def _foretold(self, line: AuditLine) -> bool:
        """One line of the audit that is on the disk when this returns true."""
        return await self.access.audit.foretell(self.access.audit.entry(*_written(line), **line.params))

    def _history_changed(self, equipment: str) -> None:
        """Events of a machine, and what is made of them, are other ones now: whoever looks at them fetches them again."""
        now = self.clock.micros()
        name = f"{SYSTEM}.{EVENTS}.{equipment}"
        if name in self.tags:
            count = self._event_revisions[name] = self._event_revisions.get(name, 0) + 1
            self.tags.publish(Batch(SYSTEM, 3, now, now, [self.tags.handle(name)], [count]))

    # ---- events of machines ---------------------------------------------------------------------------

    def _link(self, link: Link, machines: list[Equipment], bus: Bus | None) -> RegisterLink:
        made = RegisterLink(link, machines, self.tags, self.clock, exchange=_carried_by(bus))
        made.on_events = self._take_events
        made.last_seen = self._last_seen
        made.stored_up_to = self._stored_up_to
        return made

    async def _take_events(self, item: Equipment, events: Sequence[RingEvent], lost: int) -> None:
        """Alarms at once, then what is kept.

        A history that takes nothing, or for long, holds nothing up: the events wait in memory. The device is told only of what is stored
        (`_stored_up_to`), so that they are in its ring still when this server is killed.
        """
        self._log_events(item, events, lost)
        self.alarms.ring.take(item.id, events, lost)
        task = asyncio.create_task(self._store_events(item.id, events, lost))
        self._storing.add(task)
        task.add_done_callback(self._storing.discard)
        await asyncio.wait([task], timeout=STORE_LIMIT)
        if self.alarms.journal.waiting:
            await self.alarms.journal.settle()

    async def _store_events(self, equipment: str, events: Sequence[RingEvent], lost: int) -> None:
        with suppress(StorageError):  # told by the history, which tries again
            await self.events.take(equipment, events, lost)

    def _last_seen(self, item: Equipment) -> Sequence[Mark]:
        """What the alarms and the history have of the ring of a machine."""
        alarms, stored = self.alarms.journal.last_event(item.id), self.events.last(item.id)
        return () if alarms is None or stored is None else (alarms, stored)

    def _stored_up_to(self, item: Equipment) -> Mark | None:
        """The last event of a machine that is in the journal of the alarms and in the history."""
        alarms, stored = self.alarms.journal.stored_event(item.id), self.events.last(item.id)
        return None if alarms is None or stored is None else earlier(alarms, stored)

    @staticmethod
    def _log_events(item: Equipment, events: Sequence[RingEvent], lost: int) -> None:
        if lost:
            log.warning("events lost machine=%s count=%d", item.id, lost)
        alarming = {code for alarm in item.alarms for code in (alarm.event, alarm.event_clear) if code}
        for event in events:
            log.log(
                logging.INFO if event.code in alarming else logging.DEBUG,
                "event machine=%s sequence=%d time=%d event=%s source=%d value=%g",
                item.id,
                event.sequence,
                event.time,
                item.type.events.get(event.code, str(event.code)),
                event.source,
                event.value,
            )

    def _sessions_ended(self, sessions: Collection[str]) -> None:
        for session in sessions:
            if self.gate is not None:
                self.gate.session_ended(session)

    def _people_acted(self, sessions: Collection[str]) -> None:
        if self.gate is not None:
            for session in sessions:
                self.gate.control.session_seen(session)

    def _rights_changed(self, sessions: Collection[str]) -> None:
        if self.gate is not None:
            self.gate.rights_changed()

    def _operation_changed(self, equipment: str) -> None:
        """Something about the commands of a machine changed: whoever looks at it fetches its command column again."""
        name = f"{SYSTEM}.{COMMANDS}.{equipment}"
        if name not in self.tags:
            return
        count = self._command_revisions[equipment] = self._command_revisions.get(equipment, 0) + 1
        now = self.clock.micros()
        self.tags.publish(Batch(SYSTEM, 1, now, now, [self.tags.handle(name)], [count]))

    def _configure(self, person: Person | None = None) -> None:
        """Tags, alarms and pages of the plant as it is now; `person` had it read anew."""
        points = self._points_of(self.plant, self.links)
        self.points = {point.name: point for point in points}
        self.tags.configure(self._tag(point) for point in points)
        self.alarms.configure(self.plant, self.texts, person)
        self.events.configure(self.plant.equipment.values() if self.plant else ())
        inputs = self._derivation.inputs if self._derivation else ()
        self._derivation_inputs = frozenset(self.tags.handle(name) for name in inputs)
        self.live.renew()

    async def _record(self) -> None:
        self._numbers = await self.recorder.register(self.points.values())
        self.recorder.follow(self.points.values(), self._numbers)

    @staticmethod
    def _points_of(plant: Plant | None, links: Iterable[str]) -> list[Point]:
        """Every tag of `plant` and of the system."""
        machines = list(plant.equipment.values()) if plant else []
        statistics = [
            name
            for link in links
            for name in statistic_names(link, {item.unit for item in machines if item.link == link})
        ]
        points = [point for item in machines for point in item.points.values() if _has_value(point)]
        telling = [system_point(f"{EVENTS}.{item.id}", label=EVENTS) for item in machines if has_ring(item)]
        return [
            *points,
            *system_points(plant, statistics),
            *telling,
            *alarm_points(plant.equipment if plant else ()),
        ]

    def _tag(self, point: Point) -> Tag:
        if point.equipment == SYSTEM:
            return Tag(point.name, point.id, SYSTEM)
        if point.derived:
            return Tag(point.name, point.id, DERIVED)
        assert self.plant is not None
        return Tag(
            point.name,
            point.id,
            f"link.{self.plant.equipment[point.equipment].link}",
            stale_after=self._stale_after(point),
        )

    def _stale_after(self, point: Point) -> float:
        """max(2 s, 3 × the scan period), and never for what is read once or on demand (precedence.md)."""
        assert self.plant is not None
        item = self.plant.equipment[point.equipment]
        link, device = self.plant.links[item.link], item.type.device
        match point.scan:
            case "fast":
                return max(2.0, 3 * (link.fast or device.fast))
            case "slow":
                return max(2.0, 3 * (link.slow or device.slow))
            case _:
                return 0.0

    async def _serve_modbus(self, sim: SimPlant) -> None:
        self._served = sim.merged()
        try:
            self._modbus = await serve_tcp(self._served, *host_and_port(self.settings.serve_modbus))
        except ConfigurationError as error:
            raise ConfigurationError(f"POGON_SERVE_MODBUS={self.settings.serve_modbus}: {error}") from error

    @property
    def modbus_address(self) -> tuple[str, int] | None:
        """Where the simulated plant also answers Modbus TCP; None = nowhere."""
        return self._modbus.address if self._modbus else None

    # ---- other plant files ----------------------------------------------------------------------------

    async def look(self) -> Reading:
        """Read the plant files and compare them with what runs; nothing is changed."""
        return (await self._look())[1]

    async def reload(self, person: Person | None, confirm: str, address: str = "") -> Reading:
        """Take the plant files if their changes are still those with the digest `confirm`; a running plant is never taken down.

        What does not change runs on: links, values and their ages, virtual devices, alarms, commands. Files with problems, other
        changes than those confirmed, or an error while taking them leave the plant as it was. Each try is one line of the audit.
        """
        async with self._reloading:
            plant, reading = await self._look()
            if reading.problems:
                reading = replace(reading, refused="plant.refused.problems")
            elif not reading.changes and not reading.first:
                reading = replace(reading, refused="plant.refused.nothing")
            elif reading.digest != confirm:
                reading = replace(reading, refused="plant.refused.other")
            elif plant is not None:
                try:
                    await self._take_plant(plant, person)
                    reading = replace(reading, done=True)
                    log.info("plant reloaded changes=%d by=%s", len(reading.changes), person.name if person else "-")
                except Exception as error:
                    log.exception("plant not reloaded")
                    reading = replace(reading, refused="plant.refused.failed", error=f"{type(error).__name__}: {error}")
            await self.access.audit.record(
                "plant.reloaded",
                person,
                str(self.settings.plant),
                new=" · ".join(f"{change.kind} {change.name}" for change in reading.changes)[:400],
                result="ok" if reading.done else "refused",
                reason=reading.refused,
                address=address,
                changes=len(reading.changes),
                problems=len(reading.problems),
            )
            return reading

    async def _look(self) -> tuple[Plant | None, Reading]:
        plant, problems = await asyncio.to_thread(read_simulated, self.settings.plant)
        if plant is None:
            return None, Reading(tuple(problems))
        if self.plant is None:
            return plant, Reading(digest=digest([]), first=True)
        return plant, await asyncio.to_thread(_compared, self.plant, plant, self._running_sequences(), self._moving())

    def _running_sequences(self) -> list[str]:
        """Equipment whose sequence runs, suspended or not."""
        found: list[str] = []
        for id, item in self.plant.equipment.items() if self.plant else ():
            ring = item.type.device.plc if item.sequence else None
            name = f"{id}.{ring.status}" if ring else ""
            if name in self.tags and self.tags.sample(name).value in RUNNING:
                found.append(id)
        return found

    def _moving(self) -> list[str]:
        """Equipment that is seen not to stand, by what its Stop is confirmed by."""
        found: list[str] = []
        for id, item in self.plant.equipment.items() if self.plant else ():

            def look(key: str, id: str = id) -> tuple[Value, int]:
                name = f"{id}.{key}"
                if name not in self.tags:
                    return None, NO_DATA
                sample = self.tags.sample(name)
                return sample.value, sample.quality

            if not item.sequence and met(stopped(item.type), look) is False:
                found.append(id)
        return found

    async def _take_plant(self, plant: Plant, person: Person | None) -> None:
        """Replace the running plant, or start the first one. What can fail comes first; the exchange itself waits for nothing.

        Raises:
            ConfigurationError: a machine or a link cannot be built; the running plant is untouched, as after any other error.
        """
        old = self.plant
        if old is None:
            await self._start_first(plant)
            return
        texts, derivation = await asyncio.to_thread(lambda: (Texts.read(plant), Derivation(plant)))
        sim, taken = self._next_simulation(old, plant)
        links = self._next_links(plant, sim, taken)
        numbers = await self.recorder.register(self._points_of(plant, links))
        with suppress(StorageError):
            await self._retain_now()
        kept = await self._retained.read()  # a machine that comes back goes on where it left
        derivation.restore(kept)
        for name in [name for name, link in self.links.items() if links.get(name) is not link]:
            await self.keeper.drop(f"link.{name}")
        if sim is not self.sim:
            await self.keeper.drop("simulation")
        before = (self.texts, self._derivation, self.sim, dict(self.links))
        devices = (self.sim.equipment, self.sim.devices, self.sim.buses) if self.sim else None
        try:
            if sim is not None and taken is not None:
                sim.take(*taken)
            self._exchange_plant(plant, texts, derivation, sim, links, numbers, person)
        except Exception:
            log.exception("plant not exchanged, the former one goes on")
            former_texts, former_derivation, former_sim, former_links = before
            if former_sim is not None and devices is not None:
                former_sim.take(*devices)
            assert former_derivation is not None
            self._exchange_plant(old, former_texts, former_derivation, former_sim, former_links, self._numbers, person)
            raise
        finally:
            self._keep_running()
        self._numbers = numbers
        if self.settings.serve_modbus and self.sim and self._modbus is None:
            try:
                await self._serve_modbus(self.sim)
            except ConfigurationError as error:
                log.error("%s", error)  # the plant is taken already, and runs

    async def _start_first(self, plant: Plant) -> None:
        self.plant = plant
        try:
            await self._start_plant(plant)
        except Exception:
            for name in [name for name in self.keeper.kept if name.startswith("link.") or name in PLANT_TASKS]:
                await self.keeper.drop(name)
            self.plant = self.sim = self.gate = self._derivation = None
            self.links.clear()
            self._configure()
            raise
        self.problems = []
        await self._record()

    def _next_simulation(
        self, old: Plant, plant: Plant
    ) -> tuple[SimPlant | None, tuple[dict[str, Equipment], dict[str, VirtualDevice], dict[str, Bus]] | None]:
        """The virtual plant and what it is to take; devices of machines that stay are kept."""
        memory = [name for name, link in plant.links.items() if link.simulated]
        if not memory:
            return None, None
        sim = self.sim or SimPlant(plant, self.clock, links=memory)
        taken = sim.renewed(plant, memory, renamed(old, plant))
        if self.settings.serve_modbus:
            units(taken[0], taken[1])  # a clash on the common port is told before anything changes
        return sim, taken

    def _next_links(
        self,
        plant: Plant,
        sim: SimPlant | None,
        taken: tuple[dict[str, Equipment], dict[str, VirtualDevice], dict[str, Bus]] | None,
    ) -> dict[str, RegisterLink]:
        """The links of `plant`: those on an unchanged line are the running ones."""
        links: dict[str, RegisterLink] = {}
        for name, link in plant.links.items():
            machines = [item for item in plant.equipment.values() if item.link == name]
            running = self.links.get(name)
            if running is not None and same_line(running.link, link) and running.fits(machines):
                links[name] = running
            else:
                bus = taken[2].get(name) if sim is not None and taken is not None else None
                links[name] = self._link(link, machines, bus)
        return links

    def _exchange_plant(
        self,
        plant: Plant,
        texts: Texts,
        derivation: Derivation,
        sim: SimPlant | None,
        links: Mapping[str, RegisterLink],
        numbers: Mapping[str, int],
        person: Person | None,
    ) -> None:
        """Everything that knows the plant knows the other one now; no await, so no batch falls between two revisions."""
        self.tags.wake()  # whoever is told of a standstill later would know handles of two revisions
        gone = set(self.links) - set(links)
        accumulated = self._derivation.retained() if self._derivation and self._derivation is not derivation else {}
        self.plant, self.problems, self.texts, self.sim = plant, [], texts, sim
        self.access.passwords.plant_name = " ".join(plant.name.values())
        self.links.clear()
        self.links.update(links)
        derivation.restore(accumulated)
        self._derivation = derivation
        self._configure(person)
        for name, link in self.links.items():
            link.renew(self.on_link(name))
        if self.gate is not None:
            self.gate.configure(plant)
        self.recorder.follow(self.points.values(), numbers)
        inputs = {name: self.tags.handle(name) for name in derivation.inputs if name in self.tags}
        now = self.clock.micros()
        self._publish_derived(
            {name: (self.tags.value(handle), self.tags.quality(handle)) for name, handle in inputs.items()}, now, now
        )
        if self._served is not None:
            self._served.devices = dict(units(sim.equipment, sim.devices)) if sim else {}
        for name in gone:
            self.alarms.system.report("link_down", active=False, params={"link": name})

    def _keep_running(self) -> None:
        """Every link and the simulation have a task."""
        for name, link in self.links.items():
            if f"link.{name}" not in self.keeper.kept:
                self.keeper.keep(f"link.{name}", link.run)
        if self.sim is not None and "simulation" not in self.keeper.kept:
            self.keeper.keep("simulation", self.sim.run)

    # ---- questions ------------------------------------------------------------------------------------

    @property
    def simulated(self) -> bool:
        """Whether every link of the plant says that it is simulated."""
        return bool(self.links) and all(link.simulated for link in self.links.values())

    def on_link(self, name: str) -> list[Equipment]:
        """The equipment behind the link `name`."""
        return [item for item in self.plant.equipment.values() if item.link == name] if self.plant else []

    @property
    def force_names(self) -> list[str]:
        """Tags that say how many permissives of each sequence are forced."""
        items = self.plant.equipment.values() if self.plant else ()
        return [item.points["forces"].name for item in items if item.sequence and "forces" in item.points]

    def page_names(self, kind: str) -> list[str]:
        """Tags of a kind of page: `overview`, `equipment/<id>`, `faceplate/<id>`, `records/<kind>`, `forces`, `tags/<name>,…`; the
        in each. Cells of tables are on the page of their machine only; the page of a sequence has the points of its machine, too.

        Raises:
            KeyError: no page is of this kind.
        """
        head, _, rest = kind.partition("/")
        frame = [*(f"{SYSTEM}.{key}" for key, *_ in FRAME), *frame_names(), *self.force_names]
        if self.plant is None:
            return frame
        match head:
            case "overview":
                names = [
                    point.name
                    for item in self.plant.equipment.values()
                    for point in item.points.values()
                    if point.scan != "once" and not point.table
                ]
                names += [f"{SYSTEM}.{COMMANDS}.{key}" for key in self.plant.equipment]
            case "equipment" | "faceplate" | "parameters":
                points = self.plant.equipment[rest].points.values()
                names = [point.name for point in points if head == "equipment" or not point.table]
                names.append(f"{SYSTEM}.{COMMANDS}.{rest}")
                item = self.plant.equipment[rest]
                names.append(f"{SYSTEM}.link.{item.link}.unit{item.unit}.answer_time")
                if head == "equipment" and item.machine in self.plant.equipment:
                    machine = self.plant.equipment[item.machine]
                    names += [point.name for point in machine.points.values() if not point.table]
            case "tags":
                names = [name for name in rest.split(",") if name in self.points][:200]
            case "frame":
                names = []
            case "forces":
                items = [item for item in self.plant.equipment.values() if item.sequence]
                names = [point.name for item in items for point in item.points.values() if point.table == "force"]
                names += [f"{SYSTEM}.{COMMANDS}.{item.id}" for item in items]
                names += [f"{SYSTEM}.{EVENTS}.{item.id}" for item in items if has_ring(item)]
            case "communication":
                names = [name for name in self.points if name.startswith(f"{SYSTEM}.")]
            case "events" | "records":
                names = [f"{SYSTEM}.{EVENTS}.{key}" for key in self.plant.equipment]
                names = [name for name in names if name in self.points]
            case "storage":
                names = [f"{SYSTEM}.{key}" for key, *_ in HISTORY]
            case _:
                raise KeyError(kind)
        return list(dict.fromkeys(names + frame))

    def _zone(self) -> ZoneInfo:
        """The zone of the plant."""
        return ZoneInfo(self.plant.timezone if self.plant else "UTC")

    # ---- what runs ------------------------------------------------------------------------------------

    def _derive(self, batch: Batch) -> None:
        inputs, tags = self._derivation_inputs, self.tags
        handles = [handle for handle in batch.handles if handle in inputs] if batch.source != DERIVED else []
        if handles:
            changed = {tags.tags[handle].name: (tags.value(handle), tags.quality(handle)) for handle in handles}
            self._publish_derived(changed, batch.time, batch.seen)

    def _publish_derived(self, changed: dict[str, tuple[Value, int]], time: int, seen: int) -> None:
        if self._derivation is None:
            return
        results = self._derivation.update(changed, time)
        self.tags.publish(
            Batch(
                source=DERIVED,
                block=0,
                time=time,
                seen=seen,
                handles=[self.tags.handle(name) for name, _, _ in results],
                values=[value for _, value, _ in results],
                qualities=[quality for _, _, quality in results],
            )
        )

    def _stood_still(self, still: Standstill) -> None:
        if self._derivation is not None:
            self._derivation.interrupted(still.begin, still.end)

    async def _retain(self) -> None:
        """Keep what derived points remember, for ever; a killed server forgets the last minute of it."""
        while True:
            await asyncio.sleep(RETAIN_PERIOD)
            try:
                await self._retain_now()
            except StorageError as error:
                log.error("running hours and the like not kept reason=%s", error)

    async def _retain_now(self) -> None:
        if self._derivation:
            await self._retained.write(self._derivation.retained())

    async def _sweep(self) -> None:
        """Look for overdue values and publish what the system knows of itself, for ever."""
        loop = asyncio.get_running_loop()
        next_second = loop.time()
        while True:
            before = loop.time()
            await asyncio.sleep(SWEEP_PERIOD)
            self.loop_lag = max(0.0, loop.time() - before - SWEEP_PERIOD)
            self.tags.sweep()
            self._publish_system()
            if loop.time() >= next_second:
                next_second = loop.time() + 1
                now = self.clock.micros()
                self._publish_derived({}, now, now)

    def _publish_system(self) -> None:
        values: dict[str, Value] = {
            "loop_lag": round(self.loop_lag * 1000, 1),
            "tasks_failed": sum(not kept.alive for kept in self.keeper.kept.values()),
            "links_up": sum(link.statistics.state is State.UP for link in self.links.values()),
            "links_total": len(self.links),
            "sim_lag": round(self.sim.lag * 1000, 1) if self.sim else 0.0,
            "sim_overruns": self.sim.overruns if self.sim else 0,
            "watchers": self.live.watchers,
        }
        values |= {f"history.{key}": value for key, value in self.recorder.statistics().items()}
        handles = {key: self.tags.handle(f"{SYSTEM}.{key}") for key in values}
        changed = {handles[key]: value for key, value in values.items() if self.tags.value(handles[key]) != value}
        now = self.clock.micros()
        self.tags.publish(Batch(SYSTEM, 0, now, now, list(changed), list(changed.values())))
        self._tell_alarms()

    def _tell_alarms(self) -> None:
        """What the server itself has to say: links, clock of the simulation, audit, history."""
        tell = self.alarms.system.report
        for name, link in self.links.items():
            tell("link_down", active=link.statistics.state not in (State.UP, State.SOME_SILENT), params={"link": name})
        sim = self.sim
        tell("simulation_late", active=sim is not None and (sim.lag > SIMULATION_LATE or sim.pace < SIMULATION_SLOW))
        audit = self.access.audit
        for item in self.plant.equipment.values() if self.plant else ():
            count = self.links[item.link].only_here(item.id) if item.link in self.links else 0
            tell("events_unstored", item.id, active=count > 0, params={"count": count})
            tell("program_halted", item.id, active=item.link in self.links and self.links[item.link].halted(item.id))
        tell("audit_waiting", active=not audit.healthy)
        tell("audit_broken", active=not audit.intact)
        recorder = self.recorder
        tell("history_full", active=recorder.full or self.events.failed)
        tell("history_quota", active=recorder.fill >= WARN_AT, params={"percent": str(round(100 * WARN_AT))})
        tell("disk_low", active=recorder.disk_low)

    def _task_changed(self, kept: Kept) -> None:
        if hasattr(self, "alarms"):
            self.alarms.system.report("task_down", active=not kept.alive, params={"task": kept.name})
        if not kept.alive:
            log.warning("task down task=%s error=%s", kept.name, kept.error)


def _written(line: AuditLine) -> tuple[str, Person | None, str, Value, Value, str, str, str]:
    """`line` as the audit takes it, but for its parameters."""
    return line.kind, line.person, line.object, line.old, line.new, line.result, line.reason, line.address


def _carried_by(bus: Bus | None) -> Callable[[int, bytes], Awaitable[bytes | None]] | None:
    """The road of a memory link to its virtual devices."""
    if bus is None:
        return None
    return lambda unit, pdu: exchange(bus, unit, pdu)


def _compared(old: Plant, new: Plant, running: Collection[str], moving: Collection[str]) -> Reading:
    """What changes; with some thousand machines this takes a while."""
    told = compare(old, new, running, moving)  # they come and go: what is confirmed is the change
    return Reading((), tuple(told), digest(compare(old, new)))


def _has_value(point: Point) -> bool:
    """False for registers that can only be written: they are no tags."""
    return point.register is None or point.register.readable
