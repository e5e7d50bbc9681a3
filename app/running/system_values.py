"""What the system knows of itself, as values of its own points."""

from collections.abc import Collection

from app.historian.recorder import Recorder
from app.links.register_link import RegisterLink
from app.links.statistics import LinkState
from app.live.frames import Live
from app.sim.plant import SimPlant
from app.supervisor import Supervisor
from app.tags.batch import Value


def system_values(
    supervisor: Supervisor, links: Collection[RegisterLink], sim: SimPlant | None, live: Live, recorder: Recorder
) -> dict[str, Value]:
    """By the key of the point (`sys.<key>`); the lag of the simulation in ms."""
    return {
        "tasks_failed": sum(not task.alive for task in supervisor.tasks.values()),
        "links_up": sum(link.statistics.state is LinkState.UP for link in links),
        "links_total": len(links),
        "sim_lag": round(sim.lag * 1000, 1) if sim else 0.0,
        "sim_speed": sim.speed if sim else 1,
        "sim_pace": _whole(sim.achieved, sim.speed) if sim else 1.0,
        "sim_overruns": sim.overruns if sim else 0,
        "watchers": live.watchers,
        **{f"history.{key}": value for key, value in recorder.statistics().items()},
    }


def _whole(achieved: float, speed: int) -> float:
    """What is achieved, in tenths; all of the speed within 5 % of it."""
    return float(speed) if achieved > 0.95 * speed else round(achieved, 1)
