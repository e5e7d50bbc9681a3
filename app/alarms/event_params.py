"""What an alarm says of the event that raised it: source, value, and what the words of its snapshot mean by the layout of its type."""

from collections.abc import Mapping

from app.plant.events import RingEvent
from app.records.snapshot import Layout, decode

UNKNOWN = "–"
NAMED = 4
"""Values that an alarm lists at most; of more the newest."""
Params = Mapping[str, object]


def untold(layout: Layout) -> dict[str, object]:
    """Parameters of an alarm whose event was lost."""
    lists = [field.all for field in layout.values() if field.all]
    return {**dict.fromkeys((*layout, *lists, "source", "value"), UNKNOWN), "event": 0}


def of_event(layout: Layout, event: RingEvent, before: Params) -> dict[str, object]:
    """Parameters of an alarm that `event` raised. `before`: those of its former occurrences that nobody has acknowledged, else empty."""
    params: dict[str, object] = {"source": event.source, "event": event.sequence}
    said = decode(layout, event.snapshot, event.code)
    for name, value in {**dict.fromkeys(layout), **said}.items():
        params[name] = UNKNOWN if value is None else round(value, 3)
        if every := layout[name].all:
            params[every] = _listed(before.get(every, UNKNOWN), value)
    return params


def completed(layout: Layout, params: Params) -> Params:
    """`params` with its lists: what was written down before alarms listed all values names one."""
    lists = {field.all: params[name] for name, field in layout.items() if field.all and name in params}
    return {**lists, **params}


def _listed(before: object, value: float | None) -> str:
    """All values that an alarm is about since it was acknowledged last, oldest first."""
    new = [] if value is None else [str(value)]
    values = [one for one in str(before).split(", ") if one not in (UNKNOWN, *new)] + new
    return ", ".join(["…", *values[1 - NAMED :]] if len(values) > NAMED else values) or UNKNOWN
