"""What the words of records.toml cannot say of forces and runs.

| subject | rule |
| --- | --- |
| force | its number is the place of the permissive: step * 16 + bit |
| lost events | a step entered that a run had behind it already is another run's, unless its steps came back before |
| safe steps | belong to the run: what was active when they began ended there |
| acknowledged | belongs to a run that was aborted or has timed out, once |
| aborted by power-up | is told again by a device that was switched on; it changes nothing |
| values of the run | each by the name that the definition has for it |
| first-out | the permissive that the end names; it fell when it was last told as lost in this run, else before it mattered: no time |
"""

from collections.abc import Mapping, Sequence
from typing import Any

from app.records.fold import ACTIVE
from app.records.kind import Belongs
from app.records.record import Names, Reading, Record

BITS = 16
CAUSES = ("", "abort_condition", "permissive_lost", "operator", "time", "stall", "power_up", "command")
"""By the value of the event that tells the end."""
POWER_UP = 6


def force_number(event: Reading) -> int | None:
    """The place of the permissive; None: the event names none."""
    bit = event.words.get("bit")
    return None if bit is None else event.source * BITS + int(bit)


def force_fold(record: Record, former: Record, event: Reading, names: Names) -> None:
    """The permissive by its name."""
    if "permissive" not in former.fields:
        record.fields["permissive"] = names.bit(*divmod(record.number, BITS))


def run_belongs(latest: Record | None, event: Reading) -> Belongs | None:
    """Where an event belongs that is not what it seems."""
    if latest is None:
        return None
    if latest.open and latest.memo.get("again"):
        return None  # its steps come back: which one comes next says nothing about lost events
    if latest.open:
        step = int(latest.fields.get("step") or 0)
        behind = (event.key == "step_entered" and event.source <= step) or (
            event.key == "step_ended" and event.source < step
        )
        return Belongs.UNSEEN if latest.missed and behind else None
    told_again = event.key == "aborted" and event.value == POWER_UP and latest.fields.get("cause") == CAUSES[POWER_UP]
    waits = latest.outcome in ("aborted", "timed_out") and latest.fields.get("acknowledged") is None
    if told_again or (event.key == "acknowledged" and waits):
        return Belongs.HERE
    return None


def run_fold(record: Record, former: Record, event: Reading, names: Names) -> None:
    """Why a run ended, and what fell first."""
    if not former.open:
        return
    bit, place = event.words.get("bit"), f"{event.source}.{event.words.get('bit')}"
    match event.key:
        case "step_entered" if event.source <= int(former.fields.get("step") or 0):
            record.memo["again"] = [1]
        case "aborting":
            for part in former.parts.values():
                if part.state == ACTIVE:
                    left = record.parts[part.number]
                    left.state = "timed_out" if _cause(event.value) == "time" else "aborted"
                    left.ended = event.time
                    left.seconds = None if part.begun is None else (event.time - part.begun - left.paused) / 1e6
        case "permissive_lost" if bit is not None:
            record.memo[place] = [event.time, event.words.get("signal")]
        case "permissive_back":
            record.memo.pop(place, None)
        case "recipe_1" | "recipe_2" | "recipe_3" | "recipe_4":
            record.fields[f"{event.key}_name"] = names.value(int(event.key[-1])) or None
        case "power_up":
            record.fields["cause"] = CAUSES[POWER_UP]
        case "aborted" | "timed_out":
            cause = _cause(event.value)
            record.fields["cause"] = cause or None
            if bit is not None and cause != CAUSES[POWER_UP]:
                time, value = record.memo.get(place, [None, event.words.get("signal")])
                record.fields |= {
                    "first_out": names.bit(event.source, int(bit)),
                    "first_step": event.source,
                    "first_bit": bit,
                    "first_time": time,
                    "first_value": value,
                    "first_together": event.words.get("together"),
                }


def _cause(value: float | None) -> str:
    return CAUSES[int(value)] if value is not None and 0 <= value < len(CAUSES) else ""


def run_detail(record: Record, events: Sequence[Reading]) -> Mapping[str, Any]:
    """What fell, in the order of the device, and the suspensions of a run."""
    return {"falls": _falls(record, events), "breaks": _breaks(record, events), "stopped": _stopped(events)}


def _falls(record: Record, events: Sequence[Reading]) -> list[dict[str, Any]]:
    first = tuple(record.fields.get(f"first_{name}") for name in ("step", "bit", "time"))
    falls: list[dict[str, Any]] = []
    missing: dict[tuple[int, object], dict[str, Any]] = {}
    for event in events:
        bit = event.words.get("bit")
        if bit is None:
            continue
        if event.key == "permissive_lost":
            fall = {
                "order": len(falls) + 1,
                "step": event.source,
                "bit": bit,
                "time": event.time,
                "value": event.words.get("signal"),
                "first": (event.source, bit, event.time) == first,
                "together": (event.words.get("together") or 0) > 1,
                "away": None,
            }
            missing[event.source, bit] = fall
            falls.append(fall)
        elif event.key == "permissive_back" and (back := missing.pop((event.source, bit), None)):
            back["away"] = (event.time - back["time"]) / 1e6
    return falls


def _breaks(record: Record, events: Sequence[Reading]) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = []
    began: int | None = None
    for event in events:
        if event.key == "suspended":
            began = event.time
            found.append({"event": event.id, "time": event.time, "length": None})
        elif began is not None and (event.key == "resumed" or event.time == record.ended):
            found[-1]["length"] = (event.time - began) / 1e6
            began = None
    return found


def _stopped(events: Sequence[Reading]) -> int | None:
    """The event with which it was aborted."""
    return next((event.id for event in events if event.key == "aborted"), None)
