"""What the lines of a plant will have to carry, before anything runs: the plan of the reads against the speed of each serial line."""

from collections.abc import Iterator
from itertools import count
from math import inf

from app.links import bus_load
from app.links.machines import by_unit
from app.links.station import Station
from app.links.statistics import UnitStatistics
from app.plant.definitions import Link, Plant
from app.plant.loader import PLANT_FILE
from app.plant.problems import Problem
from app.plant.said import said

TOO_SLOW = 2.0
"""Values that come so many times later than they are asked for are told; what a telegram takes beside the wire is only known roughly."""


def doubts(plant: Plant) -> Iterator[Problem]:
    """Serial lines that cannot read all they are asked for as often as they are asked: values will be older than the file says."""
    for link in plant.links.values():
        load = load_of(plant, link) if link.transport == "rtu" else None
        if load is not None and load.cycle > TOO_SLOW * load.asked:
            values = {"baud": link.baud, "percent": f"{100 * load.share:.0f}", "asked": f"{load.asked:g}"}
            if load.cycle < inf:
                told = said("mistake.doubt_line", **values, cycle=f"{load.cycle:.2g}")
            else:
                told = said("mistake.doubt_line_slow", **values)
            yield Problem(PLANT_FILE, f"links.{link.name}.baud", f"{link.baud}", told)


def load_of(plant: Plant, link: Link) -> bus_load.Load:
    """What the plan asks of a line, each telegram with the time that its type says a device takes."""
    blocks = count()
    units = by_unit(plant.on_link(link.name)).items()
    stations = [Station(link, unit, items, link.name, blocks.__next__) for unit, items in units]
    for station in stations:
        station.plan()
    return bus_load.load(link, [bus_load.reads_of(station, UnitStatistics()) for station in stations])
