"""Which tags a kind of page is sent."""

from collections.abc import Collection

from app.alarms.definitions import frame_names
from app.plant.definitions import Equipment, Plant
from app.plant.sequence_plant import commanding
from app.plant.system import CLASS, COMMANDS, EVENTS, FRAME, HISTORY, LESSONS, SYSTEM

MOST_NAMED = 200
"""Tags that a page may name itself."""


def page_tags(kind: str, plant: Plant | None, known: Collection[str]) -> list[str]:
    """Tags of a kind of page: `overview`, `equipment/<id>`, `faceplate/<id>`, `records/<kind>`, `forces`, `screens/<name>`,
    `tags/<name>,…`; the frame's in each. The overview has what its tiles draw (`tile` of device.toml). Cells of tables are on the page of
    their machine only; the page of a sequence has the points of its machine, too, and that of a machine those of sequences that command it.

    `known`: every tag that there is.

    Raises:
        KeyError: no page is of this kind.
    """
    frame = [*(f"{SYSTEM}.{key}" for key, *_ in FRAME), *frame_names(), *force_names(plant)]
    names = [] if plant is None else _names(kind, plant, known)
    return list(dict.fromkeys(names + frame))


def force_names(plant: Plant | None) -> list[str]:
    """Tags that say how many interventions stand in each machine that can have some."""
    items = plant.equipment.values() if plant else ()
    return [item.points[of.count].name for item in items for of in item.type.interventions.values()]


def _names(kind: str, plant: Plant, known: Collection[str]) -> list[str]:
    head, _, rest = kind.partition("/")
    match head:
        case "overview":
            machines = plant.equipment.values()
            return [item.points[key].name for item in machines for key in item.points if key in item.type.tile]
        case "equipment" | "faceplate" | "parameters":
            return _of_machine(plant.equipment[rest], plant, whole=head == "equipment")
        case "tags":
            return [name for name in rest.split(",") if name in known][:MOST_NAMED]
        case "frame":
            return []
        case "screens":
            return list(plant.screens[rest].tags)
        case "forces":
            items = [item for item in plant.equipment.values() if item.type.interventions]
            names = [
                point.name for item in items for point in item.points.values() if point.table in item.type.interventions
            ]
            names += [f"{SYSTEM}.{COMMANDS}.{item.id}" for item in items]
            return names + [name for item in items if (name := f"{SYSTEM}.{EVENTS}.{item.id}") in known]
        case "communication":
            return [name for name in known if name.startswith(f"{SYSTEM}.")]
        case "events" | "records":
            return [name for key in plant.equipment if (name := f"{SYSTEM}.{EVENTS}.{key}") in known]
        case "lessons":
            return [f"{SYSTEM}.{LESSONS}.{CLASS}"]
        case "storage":
            return [f"{SYSTEM}.{key}" for key, *_ in HISTORY]
    raise KeyError(kind)


def _of_machine(item: Equipment, plant: Plant, *, whole: bool) -> list[str]:
    """Of one machine; `whole`: with the cells of its tables, and the points of the machine that its sequence uses."""
    names = [point.name for point in item.points.values() if whole or not point.table]
    names.append(f"{SYSTEM}.{COMMANDS}.{item.id}")
    names.append(f"{SYSTEM}.link.{item.link}.unit{item.unit}.answer_time")
    names.append(f"{SYSTEM}.{LESSONS}.{CLASS}")
    for other in commanding(plant, item.id) if whole else ():
        names += [
            f"{SYSTEM}.{COMMANDS}.{other.id}",
            *(point.name for point in other.points.values() if not point.table),
        ]
    if whole and item.machine in plant.equipment:
        names += [point.name for point in plant.equipment[item.machine].points.values() if not point.table]
    return names
