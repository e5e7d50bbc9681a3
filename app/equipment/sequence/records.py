"""What the words of records.toml cannot say of forces and runs.

| subject | rule |
| --- | --- |
| force | its number is the place of the permissive: step * 16 + bit |
| lost events | a step entered that a run had behind it already is another run's |
| acknowledged | belongs to a run that was aborted or has timed out, once |
| aborted by power-up | is told again by a device that was switched on; it changes nothing |
| first-out | the permissive that the end names; it fell when it was last told as lost in this run, else before it mattered: no time |
"""

from app.records.kind import Belongs
from app.records.record import Names, Reading, Record

BITS = 16
CAUSES = ("", "abort_condition", "permissive_lost", "operator", "time", "stall", "power_up")
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
        case "permissive_lost" if bit is not None:
            record.memo[place] = [event.time, event.words.get("signal")]
        case "permissive_back":
            record.memo.pop(place, None)
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
