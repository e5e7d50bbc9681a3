"""Runs of sequences as CSV, newest first: one line each, with how long each step took.

The file is one like those of the history (historian/export.py): the same separators, comments, number of rows and SHA-256.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any
from zoneinfo import ZoneInfo

from sqlalchemy import Connection

from app import __version__
from app.blocks.sequence import Cause
from app.clock import to_datetime
from app.errors import ConfigurationError
from app.historian import run_query as query
from app.historian.export import BOM, FORMATS, Sheet, iso
from app.historian.run_query import Definition, Run, RunStep, Wanted
from app.historian.runs import runs_sequence
from app.plant.definitions import Equipment, Plant
from app.plant.texts import Texts

PAGE = 500
"""Runs per question to the database."""
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
class RunWish:
    """What somebody wants to take home."""

    wanted: Wanted
    zone: ZoneInfo
    """Of the local times."""
    locale: str = "machine"
    bom: bool = False
    steps: Sequence[str] = ()
    """Names of the steps that have columns, in their order."""
    label: Label = _english
    headers: Mapping[str, str] = field(default_factory=dict)
    """Column → its name in the reader's language; else the column itself."""
    outcomes: Mapping[str, str] = field(default_factory=dict)
    causes: Mapping[int, str] = field(default_factory=dict)
    most_rows: int = 0
    """0 = no limit."""
    filters: str = ""
    """The filter, as it is written into the file."""
    plant: str = ""
    person: str = ""
    created: int = 0
    """[µs UTC]"""
    simulated: bool = False

    def check(self) -> None:
        """Refuse what cannot be.

        Raises:
            ConfigurationError: names the part, its value and what was expected.
        """
        if self.locale not in FORMATS:
            raise ConfigurationError(f"locale: {self.locale}, expected one of {', '.join(FORMATS)}")
        if len(self.steps) > MOST_STEPS:
            raise ConfigurationError(f"steps: {len(self.steps)}, expected at most {MOST_STEPS}")


class RunExport(Sheet):
    """One export of runs under way."""

    def __init__(self, wish: RunWish) -> None:
        """Raises:
        ConfigurationError: `wish` cannot be.
        """
        wish.check()
        self.wish = wish
        self.total = 0
        """Rows that it will have."""
        self._definitions: dict[str, Definition] = {}
        super().__init__(wish.locale, wish.zone)

    @property
    def file_name(self) -> str:
        """A name for the file that says what is in it."""
        created = to_datetime(self.wish.created).astimezone(self.wish.zone)
        return f"pogon-runs{'-' * bool(self.wish.wanted.equipment)}{self.wish.wanted.equipment}-{created:%Y%m%d-%H%M%S}.csv"

    @property
    def progress(self) -> float:
        """How far it has come, 0 to 1."""
        return 1.0 if self.done or not self.total else min(1.0, self.rows / self.total)

    def open(self, connection: Connection) -> None:
        """Count what fits."""
        self.total = query.count(connection, self.wish.wanted, self.wish.most_rows or 10**9)

    def _all(self) -> Iterator[str | None]:
        wish = self.wish
        if wish.bom:
            yield BOM
        yield from map(self._comment, self._head())
        names = [wish.headers.get(name, name) for name in COLUMNS]
        for n, step in enumerate(wish.steps, 1):
            names += [
                wish.headers.get(name, "step_{n}_s").replace("{n}", str(n)).replace("{name}", step)
                for name in STEP_COLUMNS
            ]
        yield self._separator.join(map(self._cell, names)) + "\r\n"
        page = wish.wanted
        while True:
            assert self._connection is not None
            found = query.find(self._connection, page, PAGE)
            steps = query.steps(self._connection, [one.id for one in found])
            unknown = {one.definition for one in found} - set(self._definitions)
            if unknown:
                self._definitions |= query.definitions(self._connection, unknown)
            for one in found:
                if self.rows == wish.most_rows > 0:
                    self.complete = False
                    yield self._comment(f"incomplete: stopped at the limit of {self.rows} rows")
                    break
                self.rows += 1
                yield self._line(one, steps[one.id])
            if len(found) < PAGE or not self.complete:
                break
            page = replace(page, before=(found[-1].started, found[-1].id))
            yield None
        yield self._comment(f"rows: {self.rows}")

    def _head(self) -> Iterator[str]:
        wish, wanted = self.wish, self.wish.wanted
        yield f"Pogon {__version__} sequence runs"
        if wish.plant:
            yield f"plant: {wish.plant}"
        if wish.simulated:
            yield "SIMULATION: no real equipment"
        if wish.person:
            yield f"user: {wish.person}"
        if wish.created:
            yield f"created: {iso(wish.created, wish.zone)}"
        for name, time in (("from", wanted.begin), ("to", wanted.end)):
            if time is not None:
                yield f"{name}: {iso(time, wish.zone)}"
        yield f"time zone: {wish.zone.key}"
        if wish.filters:
            yield f"filter: {wish.filters}"

    def _line(self, one: Run, steps: Sequence[RunStep]) -> str:
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
        taken = {step.step: step.seconds for step in steps}
        cells += [self._maybe(taken.get(n)) for n in range(1, len(wish.steps) + 1)]
        return self._separator.join(cells) + "\r\n"

    def _utc(self, time: int | None) -> str:
        return "" if time is None else self._times(time).partition(self._separator)[0]

    def _maybe(self, value: float | None) -> str:
        return "" if value is None else self._number(round(value, 6))


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
