"""What differs between two readings of a plant, and what that means for what runs. Pure: two plants in, a list of changes out.

Machines are told apart by their id. One whose points kept the lasting ids of a machine that is gone was renamed (`was = "…"`).
"""

from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from hashlib import sha256
from operator import attrgetter
from typing import Any

from app.plant.definitions import Alarm, Equipment, EquipmentType, Link, Plant, Point
from app.plant.sequence_chart import chart_lines
from app.plant.sequence_definition import WISHES, SequenceDefinition, SequenceTest
from app.plant.sequences import ABORT, checksum, program
from app.plant.type_files.options import BY_DEFINITION

MOST_SHOWN = 12
"""Names that one line lists; the rest is a number."""
MOST_LINES = 40
"""Lines that the changes of one sequence take."""
LONGEST_TABLE = 400
"""Of a table that one line shows [characters]."""
PASSING = ("machine_runs", "sequence_runs")
"""Effects that are told of what runs now: they come and go, the change stays the same."""

_plain = attrgetter(*(field.name for field in fields(Point) if field.name not in ("name", "id", "equipment")))
"""Of a point all that a rename of its machine does not change by itself."""


@dataclass(frozen=True, slots=True)
class Effect:
    """A consequence: the product text `plant.effect.<key>` with its placeholders."""

    key: str
    params: Mapping[str, str]


@dataclass(frozen=True, slots=True)
class Change:
    """One thing that is there, gone or other than before."""

    what: str
    """plant, type, link, equipment."""
    kind: str
    """added, removed, changed, renamed."""
    name: str
    details: tuple[str, ...] = ()
    """`unit: 1 → 2`: the keys of the plant file in the words of the plant file."""
    effects: tuple[Effect, ...] = ()


def compare(old: Plant, new: Plant, running: Collection[str] = (), moving: Collection[str] = ()) -> list[Change]:
    """Everything that differs, links before the machines on them; an empty list = nothing.

    `running`: ids of machines of `old` whose sequence runs now; what stops it says so. `moving`: those that run without one: who takes
    away the hold on them says so.
    """
    changes = _plant(old, new)
    changes += _types(old, new)
    changes += _links(old, new)
    former = renamed(old, new)
    broken_off = {id: [id] for id in running}  # machine → sequences that do not outlive it
    for id in running:
        broken_off.setdefault(old.equipment[id].machine, []).append(id)
    for id, item in new.equipment.items():
        if id in old.equipment:
            changes += _machine(old.equipment[id], item, broken_off.get(id, ()), moving=id in moving)
        elif id in former:
            lost = former[id] in moving
            changes += _renamed(old.equipment[former[id]], item, broken_off.get(former[id], ()), moving=lost)
        else:
            numbers = {"points": str(len(item.points)), "alarms": str(len(item.alarms)), "link": item.link}
            kept = _lent(old, item)
            changes.append(_change("equipment", "added", id, (), [("added", numbers), *kept]))
    for id, item in old.equipment.items():
        if id not in new.equipment and id not in former.values():
            told: list[tuple[str, Mapping[str, str]]] = [
                *_runs(broken_off.get(id, ())),
                *([("machine_runs", {"id": id})] if id in moving else []),
                ("history_kept", {"id": _stem(item)}),
                ("alarms_closed", {"count": str(len(item.alarms))}),
            ]
            changes.append(_change("equipment", "removed", id, (), told))
    return changes


def digest(changes: Sequence[Change]) -> str:
    """A short name of exactly these changes: what a person confirms is what they have read, whatever runs at the moment."""
    lasting = [
        replace(one, effects=tuple(effect for effect in one.effects if effect.key not in PASSING)) for one in changes
    ]
    return sha256(repr(lasting).encode()).hexdigest()[:16]


def renamed(old: Plant, new: Plant) -> dict[str, str]:
    """New id → former id of every machine that took over the lasting ids of one that is gone."""
    owners = {point.id: id for id, item in old.equipment.items() for point in item.points.values()}
    found: dict[str, str] = {}
    for id, item in new.equipment.items():
        if id in old.equipment:
            continue
        votes = Counter(owners[point.id] for point in item.points.values() if point.id in owners)
        former = votes.most_common(1)[0][0] if votes else ""
        if former and former not in new.equipment and former not in found.values():
            found[id] = former
    return found


def same_line(one: Link, other: Link) -> bool:
    """Whether two definitions of a link differ in nothing that the line itself notices."""
    return replace(one, label={}) == replace(other, label={})


def _plant(old: Plant, new: Plant) -> list[Change]:
    keys = ("name", "timezone", "languages", "areas", "texts", "shifts", "alarm_classes")
    details = [_detail(key, getattr(old, key), getattr(new, key)) for key in keys if _differs(old, new, key)]
    names = [name for name in {**old.lessons, **new.lessons} if old.lessons.get(name) != new.lessons.get(name)]
    details += [f"lessons: {', '.join(sorted(names))}"] if names else []
    drawn = [name for name in {**old.screens, **new.screens} if old.screens.get(name) != new.screens.get(name)]
    details += [f"screens: {', '.join(sorted(drawn))}"] if drawn else []
    effects: list[tuple[str, Mapping[str, str]]] = [("texts", {})]
    if gone := [name for name in drawn if name not in new.screens]:
        effects.append(("screens_gone", {"names": ", ".join(sorted(gone))}))
    if broken := [name for name in drawn if name in new.screens and new.screens[name].problems]:
        effects.append(("screens_broken", {"names": ", ".join(sorted(broken))}))
    if old.timezone != new.timezone:
        effects.append(("timezone", {}))
    if old.shifts != new.shifts:
        effects.append(("shifts", {}))
    if old.alarm_classes != new.alarm_classes:
        effects.append(("alarm_classes", {}))
    return [_change("plant", "changed", "plant", details, effects)] if details else []


def _types(old: Plant, new: Plant) -> list[Change]:
    changes = []
    for name in sorted(set(old.types) & set(new.types)):
        before, after = old.types[name], new.types[name]
        parts = [field.name for field in fields(EquipmentType) if _differs(before, after, field.name)]
        if parts:
            changes.append(_change("type", "changed", name, parts, [("type", {})]))
    return changes


def _links(old: Plant, new: Plant) -> list[Change]:
    changes = []
    for name, link in new.links.items():
        before = old.links.get(name)
        if before is None:
            changes.append(_change("link", "added", name, (f"transport: {link.transport}",), [("link_added", {})]))
            continue
        details = [
            _detail(field.name, getattr(before, field.name), getattr(link, field.name))
            for field in fields(Link)
            if _differs(before, link, field.name)
        ]
        if details:
            effect = "texts" if same_line(before, link) else "link_restarts"
            changes.append(_change("link", "changed", name, details, [(effect, {"link": name})]))
    changes += [
        _change("link", "removed", name, (), [("link_removed", {})]) for name in old.links if name not in new.links
    ]
    return changes


def _machine(old: Equipment, new: Equipment, running: Sequence[str], *, moving: bool) -> list[Change]:
    details, effects = _differences(old, new, running, moving=moving)
    return [_change("equipment", "changed", new.id, details, effects)] if details else []


def _renamed(old: Equipment, new: Equipment, running: Sequence[str], *, moving: bool) -> list[Change]:
    details, effects = _differences(old, new, running, moving=moving)
    first: list[tuple[str, Mapping[str, str]]] = [
        ("renamed", {"old": old.id, "id": _stem(new)}),
        ("alarms_closed", {"count": str(len(old.alarms))}),
    ]
    return [_change("equipment", "renamed", new.id, [f"id: {old.id} → {new.id}", *details], [*first, *effects])]


def _differences(
    old: Equipment, new: Equipment, running: Sequence[str], *, moving: bool
) -> tuple[list[str], list[tuple[str, Mapping[str, str]]]]:
    details = [
        _detail(key, getattr(old, key), getattr(new, key))
        for key in ("link", "unit", "base", "label", "area")
        if _differs(old, new, key)
    ]
    effects: list[tuple[str, Mapping[str, str]]] = []
    place = old.link, old.unit, old.base
    if moving and (place != (new.link, new.unit, new.base) or old.type.name != new.type.name):
        effects.append(("machine_runs", {"id": old.id}))
    if place != (new.link, new.unit, new.base):
        effects.append(("elsewhere", {"link": new.link, "unit": str(new.unit)}))
    elif details and old.type.name == new.type.name:
        effects.append(("texts", {}))
    if old.type.name != new.type.name:
        effects.append(("other_type", {"id": new.id}))
        details.append(f"type: {old.type.name} → {new.type.name}")
    if _differs(old, new, "preset"):
        details.append(_detail("preset", old.preset, new.preset))
    options = sorted(key for key in {*old.options, *new.options} if old.options.get(key) != new.options.get(key))
    if old.sequence and new.sequence:  # these are named with the sequence
        options = [key for key in options if key not in BY_DEFINITION]
    details += [_detail(key, old.options.get(key), new.options.get(key)) for key in options]
    if options:
        effects.append(("options", {}))
    sequence, follows = _sequence(old, new)
    if old.type.name != new.type.name or any(key in ("sequence", "options") for key, _ in effects + follows):
        follows[:0] = _runs(running)
    points, told = _points(old.points, new.points)
    alarms, closed = _alarms(old.alarms, new.alarms)
    return details + sequence + points + alarms, effects + follows + told + closed


def _runs(sequences: Sequence[str]) -> list[tuple[str, Mapping[str, str]]]:
    return [("sequence_runs", {"id": id}) for id in sequences]


def _sequence(old: Equipment, new: Equipment) -> tuple[list[str], list[tuple[str, Mapping[str, str]]]]:
    """What differs in the sequence it runs, key by key as in the definition file."""
    details = [_detail("machine", old.machine, new.machine)] if old.machine != new.machine else []
    if old.sequence is None or new.sequence is None or old.sequence == new.sequence:
        return details, [("sequence", {"id": new.id})] if details else []
    if old.sequence.name != new.sequence.name:
        details.append(_detail("definition", old.sequence.name, new.sequence.name))
    before, after = _leaves(old.sequence), _leaves(new.sequence)
    steps = [[step.key for step in item.steps] for item in (old.sequence, new.sequence)]
    if steps[0] != steps[1]:
        details.append(f"steps: {_listed(steps[0])} → {_listed(steps[1])}")
    if checksum(old.sequence) != checksum(new.sequence):
        details.append(f"CRC: {checksum(old.sequence):08X} → {checksum(new.sequence):08X}")
    both = {ABORT, *steps[0]} & {ABORT, *steps[1]} | {""}
    keys = [key for key in {**before, **after} if before.get(key) != after.get(key) and key[0] in both]
    lines = [_detail(".".join(filter(None, key)), before.get(key), after.get(key)) for key in keys]
    if len(lines) > MOST_LINES:  # the rest still counts for the digest
        rest = sha256(repr(lines[MOST_LINES:]).encode()).hexdigest()[:8]
        lines = [*lines[:MOST_LINES], f"… +{len(lines) - MOST_LINES} ({rest})"]
    details += lines
    if new.machine != old.machine or program(old.sequence) != program(new.sequence):
        return details, [("sequence", {"id": new.id})]
    return details, [("texts", {})] if details else []


def _leaves(definition: SequenceDefinition) -> dict[tuple[str, str, str], object]:
    """(step, permissive, key) → what stands there; empty for the whole sequence, the whole step."""
    found: dict[tuple[str, str, str], object] = {
        ("", "", key): getattr(definition, key)
        for key in ("label", "output_while_suspended", "stall_after", "keep_forces", "longest_force", *WISHES)
    }
    for value in definition.recipe:
        for key in ("label", "unit", "low", "high", "default", "decimals"):
            found["", value.key, f"recipe.{key}"] = getattr(value, key)
    found["", "", "branches"] = "; ".join(chart_lines(definition.chart))
    for step in definition.steps:
        for key in ("label", "minimum", "maximum", "recipe", "loss_aborts", "actions", "orders"):
            found[step.key, "", key] = getattr(step, key)
    words = {ABORT: definition.abort, **{step.key: step.permissives for step in definition.steps}}
    for name, word in words.items():
        for each in word:
            for key in ("key", "label", "when", "value", "forceable"):
                found[name, str(each.bit), key] = getattr(each, key)
    found |= {("", "tests", test.name): _test(test) for test in definition.tests}
    return found


def _test(test: SequenceTest) -> str:
    """A test in one word: it changes when the test does."""
    return sha256(repr(test).encode()).hexdigest()[:8]


def _points(
    old: Mapping[str, Point], new: Mapping[str, Point]
) -> tuple[list[str], list[tuple[str, Mapping[str, str]]]]:
    details: list[str] = []
    effects: list[tuple[str, Mapping[str, str]]] = []
    added, removed = [key for key in new if key not in old], [key for key in old if key not in new]
    changed = [key for key in new if key in old and _plain(old[key]) != _plain(new[key])]
    for sign, keys in (("+", added), ("−", removed), ("≠", changed)):
        if keys:
            details.append(f"points {sign} {_listed(keys)}")
    if removed:
        effects.append(("history_kept", {"id": _listed(sorted(old[key].id for key in removed))}))
    anew = [new[key].id for key in new if key in old and old[key].id != new[key].id]
    if anew:
        details.append(f"id ≠ {_listed(sorted(anew))}")
        effects.append(("history_anew", {"id": _listed(sorted(anew))}))
    return details, effects


def _alarms(old: Iterable[Alarm], new: Iterable[Alarm]) -> tuple[list[str], list[tuple[str, Mapping[str, str]]]]:
    before, after = {alarm.key: alarm for alarm in old}, {alarm.key: alarm for alarm in new}
    added, removed = [key for key in after if key not in before], [key for key in before if key not in after]
    changed = [key for key in after if key in before and before[key] != after[key]]
    details = [
        f"alarms {sign} {_listed(keys)}" for sign, keys in (("+", added), ("−", removed), ("≠", changed)) if keys
    ]
    return details, [("alarms_closed", {"count": str(len(removed))})] if removed else []


def _lent(old: Plant, item: Equipment) -> list[tuple[str, Mapping[str, str]]]:
    """Lasting ids that were taken over from machines that stay."""
    owners = {point.id for other in old.equipment.values() for point in other.points.values()}
    taken = sorted(point.id for point in item.points.values() if point.id in owners)
    return [("history_taken", {"id": _listed(taken)})] if taken else []


def _stem(item: Equipment) -> str:
    """First part of the lasting ids of its points: `m1`."""
    return ", ".join(sorted({point.id.partition(".")[0] for point in item.points.values()}))


def _differs(one: object, other: object, key: str) -> bool:
    return bool(getattr(one, key) != getattr(other, key))


def _detail(key: str, old: object, new: object) -> str:
    if isinstance(old, Mapping) and isinstance(new, Mapping):  # of a table only what differs
        old, new = (
            {name: one[name] for name in one if name not in other or other[name] != one[name]}
            for one, other in ((old, new), (new, old))
        )
    return f"{key}: {_short(old)} → {_short(new)}"


def _short(value: object) -> str:
    if isinstance(value, Mapping):
        text = ", ".join(f"{key} = {_short(item)}" for key, item in value.items())
        return f"{{ {text} }}" if len(text) <= LONGEST_TABLE else f"{{ … {len(value)} }}"
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, Sequence):
        return "[" + ", ".join(_short(item) for item in value) + "]"
    return "–" if value is None else str(value)


def _listed(names: Sequence[str]) -> str:
    more = len(names) - MOST_SHOWN
    return ", ".join(names[:MOST_SHOWN]) + (f" … +{more}" if more > 0 else "")


def _change(
    what: str, kind: str, name: str, details: Iterable[str], effects: Iterable[tuple[str, Mapping[str, Any]]]
) -> Change:
    unique = {repr(effect): Effect(*effect) for effect in effects}
    return Change(what, kind, name, tuple(details), tuple(unique.values()))
