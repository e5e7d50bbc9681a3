"""The points of the system itself, as tags like any other: loop lag, tasks, links, counts."""

from collections.abc import Iterable, Mapping, Sequence

from app.plant.definitions import Kind, Plant, Point

SYSTEM = "sys"
"""Source of these points, and the first part of their names."""

COMMANDS = "commands"
"""`sys.commands.<equipment>` counts changes of what the commands of a machine look like: progress, reasons, control token."""
EVENTS = "events"
"""`sys.events.<equipment>` counts changes of what is kept of its events."""

LESSONS, CLASS = "lessons", "class"
"""`sys.lessons.class` counts changes of how far anybody is in a lesson."""

FRAME: Sequence[tuple[str, Kind, str, int, float]] = (
    ("loop_lag", Kind.ANALOG, "ms", 1, 20.0),
    ("tasks_failed", Kind.STEP, "", 0, 0.0),
    ("links_up", Kind.STEP, "", 0, 0.0),
    ("links_total", Kind.STEP, "", 0, 0.0),
    ("sim_lag", Kind.ANALOG, "ms", 1, 20.0),
    ("sim_speed", Kind.ANALOG, "", 1, 0.5),
    ("sim_pace", Kind.ANALOG, "", 2, 0.2),
    ("sim_overruns", Kind.STEP, "", 0, 0.0),
    ("watchers", Kind.STEP, "", 0, 0.0),
)
"""Key, kind, unit, decimals and dead-band of the points that every system has: what it says of itself changes four times a second."""

HISTORY: Sequence[tuple[str, Kind, str, int, float]] = (
    ("history.full", Kind.BOOL, "", 0, 0.0),
    ("history.fill", Kind.ANALOG, "%", 1, 0.5),
    ("history.rows_per_second", Kind.ANALOG, "1/s", 1, 10.0),
    ("history.dropped", Kind.STEP, "", 0, 0.0),
    ("history.quota_days", Kind.ANALOG, "d", 1, 1.0),
)
"""The same of the recorder (historian/recorder.py, `statistics`)."""

STATISTICS: Mapping[str, tuple[Kind, str, int, float]] = {
    "polls": (Kind.ANALOG, "1/s", 1, 10.0),
    "scan_time": (Kind.ANALOG, "ms", 1, 10.0),
    "bus_share": (Kind.ANALOG, "%", 1, 2.0),
    "answer_time": (Kind.ANALOG, "ms", 1, 10.0),
}
"""Kind, unit, decimals and dead-band of what a link measures of itself (links/statistics.py); all the rest are counters and states."""


def system_point(
    key: str, kind: Kind = Kind.STEP, unit: str = "", decimals: int = 0, dead_band: float = 0.0, label: str = ""
) -> Point:
    """The point `sys.<key>`, labelled by the product text `sys.<label or key>`."""
    return Point(
        name=f"{SYSTEM}.{key}",
        id=f"{SYSTEM}.{key}",
        equipment=SYSTEM,
        key=key,
        label=f"sys.{label or key}",
        kind=kind,
        unit=unit,
        decimals=decimals,
        dead_band=dead_band,
        history=kind is Kind.ANALOG,
    )


def system_points(plant: Plant | None, statistics: Iterable[str] = ()) -> list[Point]:
    """All points of the system: the frame's, and one for each name in `statistics` (`sys.link.<link>.…`)."""
    points = [system_point(*row) for row in (*FRAME, *HISTORY)]
    points += [system_point(f"{COMMANDS}.{key}", label=COMMANDS) for key in (plant.equipment if plant else ())]
    points.append(system_point(f"{LESSONS}.{CLASS}", label=LESSONS))
    for name in statistics:
        key = name.removeprefix(f"{SYSTEM}.")
        last = key.rpartition(".")[2]
        kind, unit, decimals, dead_band = STATISTICS.get(last, (Kind.STEP, "", 0, 0.0))
        points.append(system_point(key, kind, unit, decimals, dead_band, label=f"link.{last}"))
    return points
