"""The points of the system itself, as tags like any other: loop lag, tasks, links, counts."""

from collections.abc import Iterable, Sequence

from app.plant.definitions import Kind, Plant, Point

SYSTEM = "sys"
"""Source of these points, and the first part of their names."""

COMMANDS = "commands"
"""`sys.commands.<equipment>` counts changes of what the commands of a machine look like: progress, reasons, control token."""

FRAME: Sequence[tuple[str, Kind, str, int]] = (
    ("loop_lag", Kind.ANALOG, "ms", 1),
    ("tasks_failed", Kind.STEP, "", 0),
    ("links_up", Kind.STEP, "", 0),
    ("links_total", Kind.STEP, "", 0),
    ("sim_lag", Kind.ANALOG, "ms", 1),
    ("sim_overruns", Kind.STEP, "", 0),
    ("watchers", Kind.STEP, "", 0),
)
"""Key, kind, unit, decimals of the points that every system has."""

HISTORY: Sequence[tuple[str, Kind, str, int]] = (
    ("history.full", Kind.BOOL, "", 0),
    ("history.fill", Kind.ANALOG, "%", 1),
    ("history.rows_per_second", Kind.ANALOG, "1/s", 1),
    ("history.dropped", Kind.STEP, "", 0),
    ("history.quota_days", Kind.ANALOG, "d", 1),
)
"""The same of the recorder (historian/recorder.py, `statistics`)."""


def system_point(key: str, kind: Kind = Kind.STEP, unit: str = "", decimals: int = 0, label: str = "") -> Point:
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
        history=kind is Kind.ANALOG,
    )


def system_points(plant: Plant | None, statistics: Iterable[str] = ()) -> list[Point]:
    """All points of the system: the frame's, and one for each name in `statistics` (`sys.link.<link>.…`)."""
    points = [system_point(*row) for row in (*FRAME, *HISTORY)]
    points += [system_point(f"{COMMANDS}.{key}", label=COMMANDS) for key in (plant.equipment if plant else ())]
    for name in statistics:
        key = name.removeprefix(f"{SYSTEM}.")
        points.append(system_point(key, label="link." + key.rsplit(".", 1)[-1]))
    return points
