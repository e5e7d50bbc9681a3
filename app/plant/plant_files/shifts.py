"""`shifts` of `[plant]`: at which times of the day its shifts begin."""

import re

from app.plant.said import said
from app.plant.tables import Table

USUAL = (6 * 60, 14 * 60, 22 * 60)
"""Three shifts, as minutes of the day."""
MOST = 12
EXPECTED = said("mistake.times", example='["06:00", "14:00", "22:00"]')


def read_shifts(head: Table) -> tuple[int, ...]:
    """Minutes of the local day, in the order of the file: the first is shift 1."""
    given = head.items("shifts", ["06:00", "14:00", "22:00"], EXPECTED)
    found: list[int] = []
    for index, text in enumerate(given):
        match = re.fullmatch(r"([01]\d|2[0-3]):([0-5]\d)", text) if isinstance(text, str) else None
        minute = int(match[1]) * 60 + int(match[2]) if match else -1
        if match is None:
            head.note(f"shifts.{index}", text, said("mistake.time", example='"06:00"'))
        elif minute in found:
            head.note(f"shifts.{index}", text, said("mistake.time_once"))
        else:
            found.append(minute)
    if not 1 <= len(given) <= MOST:
        head.note("shifts", len(given), said("mistake.times_between", low=1, high=MOST))
    return tuple(found) or USUAL
