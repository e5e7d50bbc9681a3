"""alarms.toml of a type, and `[[alarms]]` of a plant file: the same rows."""

from collections.abc import Iterator, Mapping

from app.plant.definitions import Alarm
from app.plant.said import said
from app.plant.tables import MISSING, Table, one_of
from app.plant.type_files.sentences import Sentences, names_in

ALARM_KINDS = ("expression", "high", "low", "deviation", "rate", "bad_quality")
SENTENCES = ("expression", "clear", "value", "reference")
"""What of a row is an expression over points."""


def read_alarms(file: Table, events: Mapping[int, str], sentences: Sentences) -> Iterator[Alarm]:
    """Each table of `file` is an alarm; `events`: what the ring of the type can say."""
    for key, table in file.tables():
        alarm = read_alarm(key, table, f"alarm.{key}.", events)
        for name, text in sentences_of(alarm):
            sentences.add(table, name, text)
        table.done()
        yield alarm


def sentences_of(alarm: Alarm) -> Iterator[tuple[str, str]]:
    """Key and text of the expressions that its row gives."""
    yield from ((name, text) for name in SENTENCES if (text := getattr(alarm, name)))


def read_alarm(key: str, table: Table, prefix: str, events: Mapping[int, str]) -> Alarm:
    """An alarm row; its texts are the keys `prefix` + label, consequence, cause, response unless the row names others.

    `events`: what the device's ring can say, code → the key by which a row names it.
    """
    event, event_clear = _event(table, "event", events), _event(table, "event_clear", events)
    source = table.whole("source") if table.has("source") else None
    for name in ("event_clear", "source"):
        if table.has(name) and not table.has("event"):
            table.note(name, table.raw(name), said("mistake.of_event"))
    limit = table.number("limit", None)
    kind = table.text("kind", "expression", choices=ALARM_KINDS)
    if kind not in ("expression", "bad_quality") and not table.has("limit"):
        table.note("limit", MISSING, said("mistake.alarm_limit", kind=kind))
    if kind != "expression" and not table.has("value"):
        table.note("value", MISSING, said("mistake.alarm_point", kind=kind))
    if kind != "expression" and event:
        table.note("event", table.raw("event"), said("mistake.alarm_no_event", kind=kind))
    if event and event == event_clear:
        table.note("event_clear", table.raw("event_clear"), said("mistake.another_event"))
    if event and table.has("clear") and not table.has("expression"):
        table.note("clear", table.raw("clear"), said("mistake.clear_of"))
    sentence = table.text("expression", *([""] if table.has("event") else [])) if kind == "expression" else ""
    if sentence and names_in(sentence) == frozenset():
        table.note("expression", sentence, said("mistake.alarm_constant"))
    return Alarm(
        key=key,
        label=table.text("label", f"{prefix}label"),
        expression=sentence,
        kind=kind,
        dead_band=float(table.number("dead_band", 0.0, 0)),
        reference=table.text("reference") if kind == "deviation" else table.text("reference", ""),
        window=float(table.number("window", 1.0, 0.1, 3600)),
        realarm=float(table.number("realarm", 0.0, 0, 86400)),
        priority=table.whole("priority", low=1, high=4),
        clear=table.text("clear", ""),
        on_delay=float(table.number("on_delay", 0.0, 0, 86400)),
        off_delay=float(table.number("off_delay", 0.0, 0, 86400)),
        latching=table.flag("latching"),
        ack_required=table.flag("ack_required", True),
        audible=table.flag("audible", True),
        alarm_class=table.text("class", "process"),
        value=table.text("value", ""),
        limit=None if limit is None else float(limit),
        consequence=table.text("consequence", f"{prefix}consequence"),
        cause=table.text("cause", f"{prefix}cause"),
        response=table.text("response", f"{prefix}response"),
        event=event,
        event_clear=event_clear,
        source=source,
    )


def _event(table: Table, key: str, events: Mapping[int, str]) -> int:
    """Code of the event that a row names by its key; 0 = it names none."""
    if not table.has(key):
        return 0
    name, codes = table.raw(key), {name: code for code, name in events.items()}
    if not isinstance(name, str) or name not in codes:
        numbered = isinstance(name, int) and not isinstance(name, bool) and name in events
        if not codes:
            expected = said("mistake.event_ring")
        elif numbered:
            expected = said("mistake.event_key", key=f'"{events[name]}"')
        else:
            expected = said("mistake.event_known", known=one_of(sorted(codes), str(name)))
        table.note(key, name, expected)
        return 0
    return codes[name]
