"""`[picture]`: how material flows through the machines, for the picture of the plant (plant/picture.py)."""

from itertools import pairwise

from app.plant.plant_files.machines import Machines
from app.plant.said import said
from app.plant.tables import Table, one_of


def read_flow(table: Table, machines: Machines) -> tuple[tuple[str, str], ...]:
    """`flow`: ways through the plant, each a list of machines in order (`flow = [["c1", "cc1", "cr1"]]`); the pairs that they make."""
    pairs: dict[tuple[str, str], None] = {}
    for index, way in enumerate(table.items("flow", [], said("mistake.ways"))):
        if not isinstance(way, list) or len(way) < 2:
            table.note(f"flow.{index}", way, said("mistake.way"))
            continue
        known = [id for at, id in enumerate(way) if _known(table, f"flow.{index}.{at}", id, machines)]
        if len(known) == len(way):
            for at, (a, b) in enumerate(pairwise(known)):
                if a == b:
                    table.note(f"flow.{index}.{at + 1}", b, said("mistake.another_machine"))
                pairs[a, b] = None
    table.done()
    return tuple(pairs)


def _known(table: Table, key: str, id: object, machines: Machines) -> bool:
    if isinstance(id, str) and id in machines.found:
        return True
    if not (isinstance(id, str) and machines.is_unread(id)):  # else its own mistakes are told
        table.note(key, id, said("mistake.equipment_known", known=one_of(sorted(machines.found), id)))
    return False
