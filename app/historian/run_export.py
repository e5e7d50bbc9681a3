"""Runs of sequences as CSV (event_export.py), newest first: one line each, with how long each step took."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from sqlalchemy import Connection

from app.blocks.sequence import Cause
from app.errors import ConfigurationError
from app.historian import run_query as query
from app.historian.event_export import PAGE, ListExport, ListWish
from app.historian.run_query import Definition, Run, RunStep, Wanted
from app.historian.runs import runs_sequence
from app.plant.definitions import Equipment, Plant
from app.plant.texts import Texts

MOST_STEPS = 200
COLUMNS = (
    "started_utc", "started_local", "equipment", "sequence", "outcome", "ended_utc", "ended_local", "run_time_s", "last_step", "cause",
    "first_out", "first_out_step", "first_out_bit", "first_out_utc", "first_out_value", "suspensions", "suspended_s", "stalls",
    "permissives_lost", "forces", "started_by", "acknowledged_utc", "acknowledged_by", "events_lost",
)  # fmt: skip
STEP_COLUMNS = ("step_s",)
"""Of each step; their headers have `{n}` and `{name}`."""
Label = Callable[[Mapping[str, str]], str]
"""A label of a definition in the reader's language."""


def _english(label: Mapping[str, str]) -> str:
    return label.get("en") or next(iter(label.values()), "")


@dataclass(frozen=True, slots=True)
class RunWish(ListWish):
    """Which runs somebody wants to take home, and how."""

    wanted: Wanted
    steps: Sequence[str] = ()
    """Names of the steps that have columns, in their order."""
    label: Label = _english
    causes: Mapping[int, str] = field(default_factory=dict)

    def check(self) -> None:
        ListWish.check(self)
        if len(self.steps) > MOST_STEPS:
            raise ConfigurationError(f"steps: {len(self.steps)}, expected at most {MOST_STEPS}")


class RunExport(ListExport[RunWish, Run]):
    """One export of runs under way."""

    title = "sequence runs"
    stem = "runs"

    def __init__(self, wish: RunWish) -> None:
        super().__init__(wish)
        self._definitions: dict[str, Definition] = {}
        self._steps: Mapping[int, Sequence[RunStep]] = {}
        """Of the page at hand."""

    def _count(self, connection: Connection, most: int) -> int:
        return query.count(connection, self.wish.wanted, most)

    def _columns(self) -> Iterator[str]:
        headers = self.wish.headers
        yield from (headers.get(name, name) for name in COLUMNS)
        for n, step in enumerate(self.wish.steps, 1):
            for name in STEP_COLUMNS:
                yield headers.get(name, "step_{n}_s").replace("{n}", str(n)).replace("{name}", step)

    def _page(self, connection: Connection, before: tuple[int, int] | None) -> Sequence[Run]:
        found = query.find(connection, replace(self.wish.wanted, before=before), PAGE)
        self._steps = query.steps(connection, [one.id for one in found])
        unknown = {one.definition for one in found} - set(self._definitions)
        if unknown:
            self._definitions |= query.definitions(connection, unknown)
        return found

    def _place(self, one: Run) -> tuple[int, int]:
        return one.started, one.id

    def _line(self, one: Run) -> str:
        wish, nothing, definition = self.wish, self._separator, self._definitions[one.definition]
        fell = ""
        if one.first_bit is not None and one.first_step is not None:
            fell = wish.label(definition.permissive(one.first_step, one.first_bit)) or one.first_out
            if wish.locale == "machine":
                fell = one.first_out
        cells = [
            self._times(one.started),
            self._cell(one.equipment),
            self._cell(definition.name if wish.locale == "machine" else wish.label(definition.label)),
            self._cell(wish.outcomes.get(one.outcome, one.outcome)),
            nothing if one.ended is None else self._times(one.ended),
            self._maybe(one.seconds),
            str(one.step),
            self._cell(wish.causes.get(one.cause, Cause(one.cause).name.lower()) if one.cause else ""),
            self._cell(fell),
            "" if one.first_step is None else str(one.first_step),
            "" if one.first_bit is None else str(one.first_bit),
            self._utc(one.first_time),
            self._maybe(one.first_value),
            str(one.suspensions),
            self._maybe(one.suspended / 1e6),
            str(one.stalls),
            str(one.losses),
            str(one.forces),
            self._cell(one.person),
            self._utc(one.acknowledged),
            self._cell(one.acknowledged_by),
            str(one.missed),
        ]
        taken = {step.step: step.seconds for step in self._steps[one.id]}
        cells += [self._maybe(taken.get(n)) for n in range(1, len(wish.steps) + 1)]
        return self._separator.join(cells) + "\r\n"


def running(plant: Plant | None) -> list[Equipment]:
    """The machines that run a sequence."""
    return [item for item in plant.equipment.values() if runs_sequence(item)] if plant else []


def step_names(plant: Plant | None, equipment: str, label: Label) -> list[str]:
    """Names of the steps that a file has columns for: of the machine; of all machines (empty) only numbers, as many as the longest has."""
    machines = [item.sequence for item in running(plant) if item.sequence and equipment in ("", item.id)]
    if equipment and machines:
        return [label(step.label) for step in machines[0].steps]
    return [""] * max((len(one.steps) for one in machines), default=0)


def words(texts: Texts, locale: str) -> dict[str, Any]:
    """`label`, `headers`, `outcomes` and `causes` of a wish in a language; for programs (`machine`) there are keys."""
    if locale == "machine":
        return {}
    return {
        "label": lambda label: texts.label(locale, label) if label else "",
        "headers": {name: texts.text(locale, f"runs.csv.{name}") for name in (*COLUMNS, *STEP_COLUMNS)},
        "outcomes": {one: texts.text(locale, f"runs.outcome.{one}") for one in query.OUTCOMES},
        "causes": {cause.value: texts.text(locale, f"runs.cause.{cause.name.lower()}") for cause in Cause if cause},
    }
