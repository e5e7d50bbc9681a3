"""What a machine is configured to do, as the history keeps it with its records: the definition of its sequence, keys and labels.

A plant file that changes does not change what happened: a record names the text by which it was made.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from hashlib import sha256
from json import dumps, loads
from typing import Any

from app.plant.sequence_definition import PREFIX, SequenceDefinition, SequencePermissive

ABORT = "abort"
"""In place of the key of a step: the abort conditions."""


@dataclass(frozen=True, slots=True)
class Kept:
    """A definition as the history keeps it, and the names that it gives."""

    id: str = ""
    """Of exactly this text."""
    text: str = "{}"
    """JSON."""
    steps: tuple[str, ...] = ()
    """Keys."""
    permissives: Mapping[tuple[int, int], str] = field(default_factory=dict)
    """(step, bit) → `<step>.<permissive>`, `abort.<permissive>`."""
    values: tuple[str, ...] = ()
    """Keys of the values of a run, `recipe.<key>`."""

    def part(self, number: int) -> str:
        """Key of a step; its number when the definition has no such step."""
        return self.steps[number - 1] if 1 <= number <= len(self.steps) else str(number)

    def bit(self, part: int, bit: int) -> str:
        """Key of a permissive within its sequence, the same for all definitions that name it so."""
        word = self.part(part) if part else ABORT
        return self.permissives.get((part, bit), f"{word}.bit_{bit}")

    def value(self, number: int) -> str:
        """Key of a value that is given at Start, from 1; empty when the definition has no such value."""
        return self.values[number - 1] if 1 <= number <= len(self.values) else ""


def kept(definition: SequenceDefinition) -> Kept:
    """A definition with what a reader of the history needs: keys, labels, the point behind each permissive."""

    def words(permissives: Iterable[SequencePermissive]) -> list[dict[str, Any]]:
        return [
            {"bit": each.bit, "key": each.key, "label": dict(each.label), "value": each.value} for each in permissives
        ]

    recipe = [
        {"key": one.key, "label": dict(one.label), "unit": one.unit, "decimals": one.decimals}
        for one in definition.recipe
    ]
    text = dumps(
        {
            "name": definition.name,
            "label": dict(definition.label),
            "steps": [
                {"key": step.key, "label": dict(step.label), "permissives": words(step.permissives)}
                for step in definition.steps
            ],
            "abort": words(definition.abort),
            **({"recipe": recipe} if recipe else {}),
        },
        ensure_ascii=False,
        sort_keys=True,
    )
    names = {(0, each.bit): f"{ABORT}.{each.key}" for each in definition.abort}
    for number, step in enumerate(definition.steps, 1):
        names |= {(number, each.bit): f"{step.key}.{each.key}" for each in step.permissives}
    steps = tuple(step.key for step in definition.steps)
    return Kept(
        sha256(text.encode()).hexdigest()[:16], text, steps, names, tuple(PREFIX + one.key for one in definition.recipe)
    )


class Definition:
    """A definition as it was when a record was made."""

    def __init__(self, text: str = "{}") -> None:
        content: dict[str, Any] = loads(text)
        self.name: str = content.get("name", "")
        self.label: Mapping[str, str] = content.get("label", {})
        steps = content.get("steps", [])
        self.parts: Mapping[str, Mapping[str, str]] = {step["key"]: step["label"] for step in steps}
        """Key → label of each part, in their order."""
        words = [(ABORT, content.get("abort", [])), *((step["key"], step["permissives"]) for step in steps)]
        bits = [(f"{key}.{each['key']}", step, each) for step, (key, word) in enumerate(words) for each in word]
        self.recipe: Mapping[str, Mapping[str, Any]] = {PREFIX + one["key"]: one for one in content.get("recipe", [])}
        """Key of a value of the run → its label, unit and decimals."""
        values = {key: one["label"] for key, one in self.recipe.items()}
        self.labels: Mapping[str, Mapping[str, str]] = (
            {key: each["label"] for key, _, each in bits} | self.parts | values
        )
        """Key of a part, of a bit or of a value of the run → its label."""
        self._keys = {(step, each["bit"]): key for key, step, each in bits}
        self._values = {(step, each["bit"]): str(each.get("value", "")) for _, step, each in bits}
        self._steps = [key for key, _ in words]

    def part(self, number: int) -> Mapping[str, str]:
        """The label of a part; empty when it has none."""
        return self.parts[self._steps[number]] if 1 <= number < len(self._steps) else {}

    def key(self, part: int, bit: int) -> str:
        """Key of a bit of a part (0: of all)."""
        word = self._steps[part] if part < len(self._steps) else str(part)
        return self._keys.get((part, bit), f"{word}.bit_{bit}")

    def bit(self, part: int, bit: int) -> Mapping[str, str]:
        """The label of a bit of a part (0: of all); empty when it has none."""
        return self.labels.get(self._keys.get((part, bit), ""), {})

    def value(self, part: int, bit: int) -> str:
        """The point of the machine whose value is kept with a bit; empty = none."""
        return self._values.get((part, bit), "")
