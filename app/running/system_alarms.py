"""What the server itself has to say as alarms: links, programs, the clock of the simulation, audit, history, tasks."""

import logging
from collections.abc import Mapping

from app.access.audit.audit import Audit
from app.alarms.engine import AlarmEngine
from app.clock import to_datetime
from app.historian.events import Events
from app.historian.recorder import Recorder
from app.historian.upkeep import WARN_AT
from app.links.register_link import RegisterLink
from app.links.statistics import LinkState
from app.plant.definitions import Plant
from app.running.disk_pace import DiskPace
from app.sim.plant import SimPlant
from app.supervisor import SupervisedTask

log = logging.getLogger(__name__)

SIMULATION_LATE = 1.0
"""The virtual plant is behind by more than this [s]: an alarm."""
CERTIFICATE_SOON = 14 * 86_400_000_000
"""So long before its end a certificate is an alarm [µs]: a new one may have to be asked for."""
SIMULATION_SLOW = 0.9
"""Slower than this, compared with real time: an alarm."""


def tell_of_links(alarms: AlarmEngine, plant: Plant | None, links: Mapping[str, RegisterLink]) -> None:
    """Links that are down or closed by a device; machines whose events are only here, whose program stands still or restarts."""
    tell = alarms.system.report
    for name, link in links.items():
        tell(
            "link_down",
            active=link.statistics.state not in (LinkState.UP, LinkState.SOME_SILENT),
            params={"link": name},
        )
        closed = any(station.refuses_by_closing for station in link.stations.values())
        tell("connection_closed", active=closed, params={"link": name})
    for item in plant.equipment.values() if plant else ():
        link_of = links.get(item.link)
        count = link_of.only_here(item.id) if link_of else 0
        tell("events_unstored", item.id, active=count > 0, params={"count": count})
        tell("program_halted", item.id, active=link_of is not None and link_of.halted(item.id))
        tell("device_restarts", item.id, active=link_of is not None and link_of.restarts(item.id))


def tell_of_server(
    alarms: AlarmEngine, sim: SimPlant | None, audit: Audit, recorder: Recorder, events: Events, disk: DiskPace
) -> None:
    """A simulation that is late, an audit or a history that is not written, a disk that is slow."""
    tell = alarms.system.report
    tell(
        "simulation_late",
        active=sim is not None and (sim.lag > SIMULATION_LATE or sim.achieved < SIMULATION_SLOW * min(1, sim.speed)),
    )
    tell("audit_waiting", active=not audit.healthy)
    tell("audit_broken", active=not audit.intact)
    tell("history_full", active=recorder.full or events.failed)
    tell("history_quota", active=recorder.upkeep.fill >= WARN_AT, params={"percent": str(round(100 * WARN_AT))})
    tell("disk_low", active=recorder.upkeep.disk_low)
    tell("disk_slow", active=disk.is_slow())
    tell("clock_leapt", active=recorder.upkeep.clock_leapt)


def tell_of_certificate(alarms: AlarmEngine, end: int | None, now: int) -> None:
    """A certificate of this server that ends soon, or has ended; `end` is that of the one that it uses [µs UTC], None = it has none."""
    if end is not None:
        soon = end - now < CERTIFICATE_SOON
        day = {"time": to_datetime(end).date().isoformat()} if soon else {}
        alarms.system.report("certificate_ends", active=soon, params=day)


def tell_of_task(alarms: AlarmEngine, task: SupervisedTask) -> None:
    """A task that failed and is started again."""
    alarms.system.report("task_down", active=not task.alive, params={"task": task.name})
    if not task.alive:
        log.warning("task down task=%s error=%s", task.name, task.error)
