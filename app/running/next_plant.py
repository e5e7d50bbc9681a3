"""Another plant in place of the one that runs: what can fail is prepared beside it, so that the exchange itself waits for nothing."""

import asyncio
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

from app.alarms.engine import AlarmEngine, NextAlarms
from app.commands.command_state import machines_of
from app.commands.machine import Machine
from app.links.register_link import RegisterLink
from app.links.station import Station
from app.plant.changes import same_line
from app.plant.definitions import Equipment, Link, Plant, Point
from app.plant.derive import Derivation
from app.plant.texts import Texts
from app.running.tag_list import points_of, tag_of
from app.sim.bus import Bus
from app.sim.device import VirtualDevice
from app.sim.plant import SimPlant, units
from app.tags.database import TagTable

Taken = tuple[dict[str, Equipment], dict[str, VirtualDevice], dict[str, Bus]]
"""Machines, virtual devices and buses of a simulated plant."""


@dataclass(frozen=True, slots=True)
class Parts:
    """What is made of a plant before it is taken, so that taking it holds nobody up."""

    points: Mapping[str, Point]
    table: TagTable
    alarms: NextAlarms
    machines: Mapping[str, Machine]


@dataclass(frozen=True, slots=True)
class NextPlant:
    """A plant with everything that is made of it, running or ready to run."""

    plant: Plant
    texts: Texts
    derivation: Derivation
    parts: Parts | None
    """None: made when it is taken, for what is not expected to be needed."""
    links: Mapping[str, RegisterLink]
    stations: Mapping[str, Mapping[int, Station]]
    """What reads the machines of each link; of one that is not here it is made when the plant is taken."""
    numbers: Mapping[str, int]
    """Of its points in the history."""
    sim: SimPlant | None = None
    taken: Taken | None = None
    """What its simulated plant is to take."""


async def read_words(plant: Plant) -> tuple[Texts, Derivation]:
    """The texts and the derived points of `plant`; with some thousand machines this takes a while."""
    return await asyncio.to_thread(lambda: (Texts.read(plant), Derivation(plant)))


def parts_of(
    plant: Plant | None, texts: Texts | None, links: Iterable[str], alarms: AlarmEngine, former: TagTable
) -> Parts:
    """The parts of `plant` with these `links`, ready to take the place of a plant with the tags `former`; what runs is not touched."""
    points = {point.name: point for point in points_of(plant, links)}
    table = TagTable(tag_of(point, plant) for point in points.values())
    table.look_up(former)
    machines = machines_of(plant) if plant else {}
    return Parts(points, table, alarms.prepare(plant, texts, table.handles), machines)


def next_simulation(
    running: SimPlant | None,
    plant: Plant,
    names: Mapping[str, str],
    start: Callable[[Plant, list[str]], SimPlant],
    *,
    on_one_port: bool,
) -> tuple[SimPlant | None, Taken | None]:
    """The virtual plant and what it is to take; devices of machines that stay are kept.

    `names`: machines that are called otherwise now; `start` makes the first one; `on_one_port`: all units must differ.

    Raises:
        ConfigurationError: a device cannot be built, or two share a unit on the common port.
    """
    memory = simulated_links(plant)
    if not memory:
        return None, None
    sim = running or start(plant, memory)
    taken = sim.renewed(plant, memory, names)
    if on_one_port:
        units(taken[0], taken[1])  # a clash on the common port is told before anything changes
    return sim, taken


def next_links(
    running: Mapping[str, RegisterLink],
    plant: Plant,
    buses: Mapping[str, Bus],
    make: Callable[[Link, list[Equipment], Bus | None], RegisterLink],
) -> dict[str, RegisterLink]:
    """The links of `plant`: those on an unchanged line are the running ones."""
    links: dict[str, RegisterLink] = {}
    for name, link in plant.links.items():
        machines, former = plant.on_link(name), running.get(name)
        fits = former is not None and same_line(former.link, link) and former.fits(machines)
        links[name] = former if former is not None and fits else make(link, machines, buses.get(name))
    return links


def stations_of(plant: Plant, links: Mapping[str, RegisterLink]) -> dict[str, dict[int, Station]]:
    """What reads the machines of `plant`, by link and unit; nothing of what runs is touched."""
    return {name: link.prepare(plant.on_link(name)) for name, link in links.items()}


def simulated_links(plant: Plant) -> list[str]:
    """Links whose machines are simulated here."""
    return [name for name, link in plant.links.items() if link.simulated]
