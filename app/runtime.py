"""Wiring: builds the parts of a running plant and connects them; the only file that knows them all."""

import asyncio
import logging
from collections.abc import Awaitable, Callable, Collection
from contextlib import suppress

from app import __version__
from app.access.access import Access, prepare
from app.access.keys import read_key
from app.alarms.definitions import alarm_points, frame_names
from app.alarms.engine import AlarmEngine
from app.clock import Clock, SystemClock
from app.commands.gate import Gate
from app.commands.lifecycle import Progress
from app.commands.lifecycle import State as Progressed
from app.db import Database
from app.errors import StorageError
from app.historian.recorder import Recorder
from app.keeper import Keeper, Kept
from app.links.register_link import RegisterLink
from app.links.statistics import State, statistic_names
from app.live.frames import Live
from app.plant.definitions import Equipment, Link, Plant, Point, Problem
from app.plant.derive import Derivation
from app.plant.loader import read_plant
from app.plant.retained import RetainedStates
from app.plant.system import COMMANDS, FRAME, HISTORY, SYSTEM, system_points
from app.plant.texts import Texts
from app.settings import Settings
from app.sim.plant import SimPlant, exchange
from app.sim.server import serve_tcp
from app.tags.batch import Batch, Value
from app.tags.database import Tag, TagDatabase

log = logging.getLogger(__name__)

DERIVED = "derived"
"""Source of the points that are computed from others."""
RETAIN_PERIOD = 10.0
"""How often running hours and the like are kept [s]."""
SIMULATION_LATE = 1.0
"""The virtual plant is behind by more than this [s]: an alarm."""
SWEEP_PERIOD = 0.25
"""How often overdue values are looked for and the loop lag is measured [s]."""


class Runtime:
    """One running plant: read, connected, watched, until `stop`."""

    def __init__(self, settings: Settings, clock: Clock | None = None) -> None:
        self.settings = settings
        self.clock = clock or SystemClock()
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
        self.loop_lag = 0.0
        self._derivation: Derivation | None = None
        self._derivation_inputs: frozenset[int] = frozenset()
        self._retained: RetainedStates
        self._modbus: object | None = None
        self._command_revisions: dict[str, int] = {}

    # ---- start and stop -------------------------------------------------------------------------------

    async def start(self) -> None:
        """Read the plant and set everything in motion. A wrong plant file is not an error: `problems` lists what is wrong.

        Raises:
            ConfigurationError: POGON_DATA may be read or written by others.
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
        self.keeper.keep("audit", self.access.audit.watch)
        self.keeper.keep("alarms", self.alarms.run)
        self.keeper.keep("alarm journal", self.alarms.keep_journal)
        self.plant, self.problems = read_plant(self.settings.plant)
        for problem in self.problems:
            log.error("plant problem %s", problem)
        self.keeper.keep("sweep", self._sweep)
        self.keeper.keep("live", self.live.beat)
        if self.plant:
            await self._start_plant(self.plant)
        else:
            self._configure()
        await self.recorder.configure(self.points.values())
        self.keeper.keep("recorder", self.recorder.run)

    async def stop(self) -> None:
        """Stop what is held to run, end all tasks and close what is open."""
        if self.gate is not None:
            await self.gate.close()
        await self.keeper.close()
        if self._modbus is not None:
            await self._modbus.close()  # type: ignore[attr-defined]
        self.live.close()
        await self.alarms.close()
        with suppress(StorageError):
            await self._retain_now()
        await self.recorder.close()
        await asyncio.to_thread(self.history.close)
        await self.access.stop()
        await asyncio.to_thread(self.db.close)

    def _open_storage(self) -> None:
        prepare(self.settings.data)
        self.db = Database(self.settings.data / "pogon.db", "pogon")
        self.db.migrate()
        self.history = Database(self.settings.data / "history.db", "history")
        self.access = Access(self.db, self.clock, self.settings.data)
        self._retained = RetainedStates(self.db)

    async def _start_plant(self, plant: Plant) -> None:
        self.texts = Texts.read(plant)
        self.access.people.plant_name = " ".join(plant.name.values())
        memory = [name for name, link in plant.links.items() if link.simulated]
        if memory:
            self.sim = SimPlant(plant, self.clock, links=memory)
            self.keeper.keep("simulation", self.sim.run)
        self._derivation = Derivation(plant)
        self._derivation.restore(await self._retained.read())
        self.keeper.keep("retained", self._retain)
        for name, link in plant.links.items():
            self.links[name] = RegisterLink(
                link, self.on_link(name), self.tags, self.clock, exchange=self._exchange(link)
            )
        self._configure()
        self.tags.subscribe(self._derive)
        self.gate = self._make_gate(plant)
        self.keeper.keep("commands", self.gate.run)
        for name, register_link in self.links.items():
            self.keeper.keep(f"link.{name}", register_link.run)
        if self.settings.serve_modbus and self.sim:
            await self._serve_modbus(self.sim)

    def _make_gate(self, plant: Plant) -> Gate:
        gate = Gate(
            self.tags,
            self.clock,
            writers=self.links,
            audit=self.access.audit.record,
            dry_run=self.settings.dry_run,
        )
        gate.configure(plant)
        gate.subscribe(self._operation_changed)
        gate.subscribe_ends(self._command_ended)
        gate.on_stop_unconfirmed = self.alarms.stop_unconfirmed
        self.access.sessions.subscribe(self._sessions_ended)
        return gate

    def _command_ended(self, progress: Progress) -> None:
        """A command that was sent and not seen to work is an alarm; a Stop has its own."""
        if progress.state in (Progressed.UNCONFIRMED, Progressed.UNKNOWN) and self.plant:
            command = self.plant.equipment[progress.equipment].type.commands.get(progress.command)
            if command is None or not command.stop:
                self.alarms.raise_system(
                    "command_unconfirmed", progress.equipment, params={"command": f"@{progress.label}"}
                )

    def _sessions_ended(self, sessions: Collection[str]) -> None:
        for session in sessions:
            if self.gate is not None:
                self.gate.session_ended(session)

    def _operation_changed(self, equipment: str) -> None:
        """Something about the commands of a machine changed: whoever looks at it fetches its command column again."""
        name = f"{SYSTEM}.{COMMANDS}.{equipment}"
        if name not in self.tags:
            return
        count = self._command_revisions[equipment] = self._command_revisions.get(equipment, 0) + 1
        now = self.clock.micros()
        self.tags.publish(Batch(SYSTEM, 1, now, now, [self.tags.handle(name)], [count]))

    def _configure(self) -> None:
        statistics = [
            name
            for link_name, link in self.links.items()
            for name in statistic_names(link.link, sorted({item.unit for item in self.on_link(link_name)}))
        ]
        points = [point for point in (self.plant.points.values() if self.plant else ()) if _has_value(point)]
        points += system_points(self.plant, statistics)
        points += alarm_points(self.plant.equipment if self.plant else ())
        self.points = {point.name: point for point in points}
        self.tags.configure(self._tag(point) for point in points)
        self.alarms.configure(self.plant, self.texts)
        if self._derivation:
            self._derivation_inputs = frozenset(self.tags.handle(name) for name in self._derivation.inputs)
        self.live.renew()

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

    def _exchange(self, link: Link) -> Callable[[int, bytes], Awaitable[bytes | None]] | None:
        if self.sim is None or link.name not in self.sim.buses:
            return None
        bus = self.sim.buses[link.name]
        return lambda unit, pdu: exchange(bus, unit, pdu)

    async def _serve_modbus(self, sim: SimPlant) -> None:
        host, _, port = self.settings.serve_modbus.rpartition(":")
        self._modbus = await serve_tcp(sim.merged(), host, int(port))
        log.info("modbus served address=%s", self.settings.serve_modbus)

    # ---- questions ------------------------------------------------------------------------------------

    @property
    def simulated(self) -> bool:
        """Whether every link of the plant says that it is simulated."""
        return bool(self.links) and all(link.simulated for link in self.links.values())

    def on_link(self, name: str) -> list[Equipment]:
        """The equipment behind the link `name`."""
        return [item for item in self.plant.equipment.values() if item.link == name] if self.plant else []

    def page_names(self, kind: str) -> list[str]:
        """Tags of a kind of page: `overview`, `equipment/<id>`, `faceplate/<id>`, `tags/<name>,…`; the frame's are in each.

        Raises:
            KeyError: no page is of this kind.
        """
        head, _, rest = kind.partition("/")
        frame = [*(f"{SYSTEM}.{key}" for key, *_ in FRAME), *frame_names()]
        if self.plant is None:
            return frame
        match head:
            case "overview":
                names = [
                    point.name
                    for item in self.plant.equipment.values()
                    for point in item.points.values()
                    if point.scan != "once"
                ]
                names += [f"{SYSTEM}.{COMMANDS}.{key}" for key in self.plant.equipment]
            case "equipment" | "faceplate" | "parameters":
                names = [point.name for point in self.plant.equipment[rest].points.values()]
                names.append(f"{SYSTEM}.{COMMANDS}.{rest}")
                item = self.plant.equipment[rest]
                names.append(f"{SYSTEM}.link.{item.link}.unit{item.unit}.answer_time")
            case "tags":
                names = [name for name in rest.split(",") if name in self.points][:200]
            case "frame":
                names = []
            case "communication":
                names = [name for name in self.points if name.startswith(f"{SYSTEM}.")]
            case "storage":
                names = [f"{SYSTEM}.{key}" for key, *_ in HISTORY]
            case _:
                raise KeyError(kind)
        return list(dict.fromkeys(names + frame))

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

    async def _retain(self) -> None:
        """Keep what derived points remember, for ever; a killed server forgets the last seconds."""
        while True:
            await asyncio.sleep(RETAIN_PERIOD)
            await self._retain_now()

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
        """What the server itself has to say: links, clock of the simulation, audit."""
        tell = self.alarms.raise_system
        for name, link in self.links.items():
            tell("link_down", active=link.statistics.state not in (State.UP, State.SOME_SILENT), params={"link": name})
        tell("simulation_late", active=self.sim is not None and self.sim.lag > SIMULATION_LATE)
        audit = self.access.audit
        tell("audit_waiting", active=not audit.healthy)
        tell("audit_broken", active=not audit.intact)

    def _task_changed(self, kept: Kept) -> None:
        if hasattr(self, "alarms"):
            self.alarms.raise_system("task_down", active=not kept.alive, params={"task": kept.name})
        if not kept.alive:
            log.warning("task down task=%s error=%s", kept.name, kept.error)


def _has_value(point: Point) -> bool:
    """False for registers that can only be written: they are no tags."""
    return point.register is None or point.register.readable
