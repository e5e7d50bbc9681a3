"""What differs between two texts of a sequence's definition, place by place, for people to read; also in keys that nobody here knows."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from app.plant.sequence_text import STEPS
from app.plant.sequences import ABORT
from app.plant.toml_text import literal


@dataclass(frozen=True, slots=True)
class Difference:
    """One of them."""

    kind: str
    """added, removed, changed, order."""
    step: str = ""
    """Key of the step; empty = none: of the whole sequence."""
    label: object = ""
    """What the step is called."""
    part: str = ""
    """step, permissives, abort, orders, tests; empty = the step or the sequence itself."""
    name: str = ""
    """Bit of a permissive, number of an order, name of a test."""
    key: str = ""
    """`minimum`, `label.hr`."""
    old: str = ""
    new: str = ""


def differences(old: Mapping[str, Any], new: Mapping[str, Any]) -> list[Difference]:
    """All of them: of the whole sequence, the abort conditions, the steps in their order, the tests."""
    return [*_whole(old, new), *_steps(old, new), *_tests(old, new)]


def _whole(old: Mapping[str, Any], new: Mapping[str, Any]) -> Iterator[Difference]:
    names = [key for key in {**old, **new} if key not in (STEPS, ABORT, "tests")]
    for key in names:
        before, after = _leaves(old.get(key)), _leaves(new.get(key))
        if key != "sequence":
            before, after = (
                {f"{key}.{one}".rstrip("."): text for one, text in each.items()} for each in (before, after)
            )
        yield from (Difference("changed", key=one, old=a, new=b) for one, a, b in _changed(before, after))
    yield from _word(old.get(ABORT), new.get(ABORT), ABORT, "", "")


def _steps(old: Mapping[str, Any], new: Mapping[str, Any]) -> Iterator[Difference]:
    before, after = _by_key(old.get(STEPS)), _by_key(new.get(STEPS))
    for key, step in before.items():
        if key not in after:
            yield Difference("removed", key, step.get("label", ""), "step")
    for key, step in after.items():
        if key not in before:
            yield Difference("added", key, step.get("label", ""), "step")
            continue
        yield from _step(before[key], step, key)
    kept = [[key for key in one if key in both] for one, both in ((before, after), (after, before))]
    if kept[0] != kept[1]:
        yield Difference("order", part="step", old=", ".join(before), new=", ".join(after))


def _step(old: Mapping[str, Any], new: Mapping[str, Any], key: str) -> Iterator[Difference]:
    label = new.get("label", "")
    parts = ("permissives", "orders")
    plain = [{name: item for name, item in one.items() if name not in parts} for one in (old, new)]
    for name, a, b in _changed(_leaves(plain[0]), _leaves(plain[1])):
        yield Difference("changed", key, label, key=name, old=a, new=b)
    yield from _word(old.get("permissives"), new.get("permissives"), "permissives", key, label)
    yield from _word(_numbered(old.get("orders")), _numbered(new.get("orders")), "orders", key, label)


def _word(old: object, new: object, part: str, step: str, label: object) -> Iterator[Difference]:
    before, after = _table(old), _table(new)
    for name in {**before, **after}:
        if name not in after:
            yield Difference("removed", step, label, part, name, old=_said(before[name]))
        elif name not in before:
            yield Difference("added", step, label, part, name, new=_said(after[name]))
        else:
            for key, a, b in _changed(_leaves(before[name]), _leaves(after[name])):
                yield Difference("changed", step, label, part, name, key, a, b)


def _tests(old: Mapping[str, Any], new: Mapping[str, Any]) -> Iterator[Difference]:
    before, after = _by_key(old.get("tests"), "name"), _by_key(new.get("tests"), "name")
    for name in {**before, **after}:
        if before.get(name) != after.get(name):
            kind = "removed" if name not in after else "added" if name not in before else "changed"
            yield Difference(kind, part="tests", name=name)


def _changed(before: Mapping[str, str], after: Mapping[str, str]) -> list[tuple[str, str, str]]:
    return [
        (key, before.get(key, ""), after.get(key, ""))
        for key in {**before, **after}
        if before.get(key) != after.get(key)
    ]


def _leaves(value: object, above: str = "") -> dict[str, str]:
    """Dotted key → what stands there, as TOML writes it; texts as they are."""
    if isinstance(value, Mapping):
        found: dict[str, str] = {}
        for key, item in value.items():
            found |= _leaves(item, f"{above}.{key}" if above else str(key))
        return found
    if value is None:
        return {}
    return {above: value if isinstance(value, str) else _written(value)}


def _written(value: object) -> str:
    if isinstance(value, bool | int | float | list):
        return " ".join(literal(value).split())
    return str(value)


def _said(value: object) -> str:
    """An order or a condition in one line."""
    table = _table(value)
    if "when" in table:
        return str(table["when"])
    values = ", ".join(f"{key} = {_written(item)}" for key, item in _table(table.get("values")).items())
    return f"{table.get('machine', '')}.{table.get('action', '')}({values})"


def _by_key(rows: object, key: str = "key") -> dict[str, Mapping[str, Any]]:
    found: dict[str, Mapping[str, Any]] = {}
    for number, row in enumerate(rows if isinstance(rows, list) else (), 1):
        if isinstance(row, Mapping):
            found[str(row.get(key, number))] = row
    return found


def _numbered(rows: object) -> dict[str, object]:
    return {str(number): row for number, row in enumerate(rows if isinstance(rows, list) else (), 1)}


def _table(value: object) -> Mapping[str, Any]:
    return value if isinstance(value, Mapping) else {}
