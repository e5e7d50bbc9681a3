"""`[alarm_classes.<class>]`: what may be done with the alarms of a class in this plant."""

from collections.abc import Collection

from app.plant.alarm_class import CLASSES, HOUR, AlarmClass, usual
from app.plant.said import said
from app.plant.tables import Table

SHORTEST, MOST = 1, 24 * 60
"""Limits of the longest shelving [min]."""


def read_alarm_classes(root: Table, used: Collection[str]) -> dict[str, AlarmClass]:
    """Classes that the plant file speaks of; `used`: classes that its alarms have."""
    known = sorted({*CLASSES, *used})
    found: dict[str, AlarmClass] = {}
    for name, table in root.tables("alarm_classes"):
        if name not in known:
            table.note("", name, said("mistake.alarm_class", known=", ".join(known)))
        before = usual(name)
        shelving = table.flag("shelving", before.longest > 0)
        minutes = table.number("longest", before.longest / 60 or 12 * 60, low=SHORTEST, high=MOST)
        if shelving and not before.longest:
            table.note("shelving", True, said("mistake.never_shelved", name=name))
        if not shelving and table.has("longest"):
            table.note("longest", table.raw("longest"), said("mistake.no_longest"))
        out, reason = table.flag("out_of_service", before.out_of_service), table.flag("reason", before.reason)
        table.done()
        found[name] = AlarmClass(minutes * HOUR / 60 if shelving else 0.0, out, reason)
    return found
