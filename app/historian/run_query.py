"""Questions to the runs: what a person filters, page by page, newest first; steps, events and forces of one; times per step over many."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from json import loads
from typing import Any

from sqlalchemy import Connection

from app.historian.event_query import belonging, counted, filtered
from app.historian.runs import ABORT_KEY, Outcome

OUTCOMES: Sequence[str] = tuple(outcome.value for outcome in Outcome)
ANY = "any"
"""Filter: whatever fell first."""


@dataclass(frozen=True, slots=True)
class Wanted:
    """Which runs a person wants to see; what is empty does not filter."""

    equipment: str = ""
    begin: int | None = None
    """Started at or after [µs UTC]."""
    end: int | None = None
    """Started before."""
    outcome: str = ""
    first_out: str = ""
    """`any`, or the key of a permissive (`lift.pressure_ok`, `abort.guards_closed`)."""
    longer: float | None = None
    """Run time above this [s]."""
    forced: bool = False
    """Only with a force that was active."""
    before: tuple[int, int] | None = None
    """Only what comes after this one in the list (started, id): the next page."""


@dataclass(frozen=True, slots=True)
class Run:
    """One run of a sequence."""

    id: int
    equipment: str
    boot: int
    definition: str
    started: int
    """[µs UTC]"""
    seen: bool
    """Whether its start was seen."""
    outcome: str
    ended: int | None
    seconds: float | None
    """Run time, suspended time included [s]; None: under way, or not known."""
    step: int
    """The one that it came to."""
    suspensions: int
    suspended: int
    """[µs]"""
    stalls: int
    losses: int
    """Permissives that were lost while it ran."""
    forces: int
    cause: int
    """blocks.sequence.Cause"""
    first_out: str
    """Key of the permissive that fell first; empty = none."""
    first_step: int | None
    first_bit: int | None
    first_time: int | None
    """None: it was missing before it mattered [µs UTC]."""
    first_value: float | None
    first_together: int
    acknowledged: int | None
    acknowledged_by: str
    person: str
    """Who started it; empty: nobody, or nobody knows."""
    missed: int
    """Events lost meanwhile."""


@dataclass(frozen=True, slots=True)
class RunStep:
    """One step of a run."""

    step: int
    key: str
    state: str
    entered: int | None
    """[µs UTC]; None: not seen."""
    ended: int | None
    seconds: float | None
    """How long it was active, suspended time not counted [s]."""
    suspended: int
    """[µs]"""


@dataclass(frozen=True, slots=True)
class RunEvent:
    """One event of a run."""

    boot: int
    sequence: int
    time: int
    code: int
    step: int
    bit: int | None
    value: float | None
    signal: float | None
    """The value behind the permissive."""
    together: int
    abort_word: int
    step_word: int
    person: str
    reason: str


@dataclass(frozen=True, slots=True)
class Forced:
    """A permissive that was forced."""

    definition: str
    step: int
    bit: int
    since: int
    """[µs UTC]"""
    asked: float
    """[s]"""
    until: int
    ending: str
    """`released`, `over`, `restart`, `renewed`; empty: it stands, or its end was not told."""
    person: str
    reason: str


@dataclass(frozen=True, slots=True)
class StepTimes:
    """What a step took in the runs that finished it."""

    step: int
    key: str
    count: int
    least: float
    """[s]"""
    mean: float
    most: float
    last: float
    """In the newest of them."""


@dataclass(frozen=True, slots=True)
class RunTimes:
    """How runs ended, and what the complete ones took."""

    outcomes: Mapping[str, int]
    least: float | None
    """[s]"""
    mean: float | None
    most: float | None
    last: float | None


class Definition:
    """A definition as it was when a run was made."""

    def __init__(self, text: str = "{}") -> None:
        content: dict[str, Any] = loads(text)
        self.name: str = content.get("name", "")
        self.label: Mapping[str, str] = content.get("label", {})
        self.steps: Sequence[Mapping[str, Any]] = content.get("steps", [])
        words = [content.get("abort", []), *(step["permissives"] for step in self.steps)]
        self._permissives = {(step, each["bit"]): each for step, word in enumerate(words) for each in word}

    def step(self, number: int) -> Mapping[str, str]:
        """The label of a step; empty when it has none."""
        label: Mapping[str, str] = self.steps[number - 1]["label"] if 1 <= number <= len(self.steps) else {}
        return label

    def permissive(self, step: int, bit: int) -> Mapping[str, str]:
        """The label of a permissive (step 0 = abort conditions); empty when it has none."""
        label: Mapping[str, str] = self._permissives.get((step, bit), {}).get("label", {})
        return label

    def value(self, step: int, bit: int) -> str:
        """The point of the machine whose value is kept with a permissive; empty = none."""
        return str(self._permissives.get((step, bit), {}).get("value", ""))

    def key(self, step: int, bit: int) -> str:
        """Key of a permissive, as in `Run.first_out`."""
        word = ABORT_KEY if step == 0 else self.steps[step - 1]["key"] if step <= len(self.steps) else str(step)
        return f"{word}.{self._permissives.get((step, bit), {}).get('key', f'bit_{bit}')}"


RUN = (
    "id, equipment, boot, definition, started, seen, outcome, ended, seconds, step, suspensions, suspended, stalls, losses, forces, cause, "
    "first_out, first_step, first_bit, first_time, first_value, first_together, acknowledged, acknowledged_by, person, missed"
)
SEEN = RUN.split(", ").index("seen")
STEP = "step, key, state, entered, ended, seconds, suspended"
EVENT = "boot, sequence, time, code, step, bit, value, signal, together, abort_word, step_word, person, reason"


def find(connection: Connection, wanted: Wanted, limit: int) -> list[Run]:
    """The newest `limit` runs that `wanted` lets through, newest first."""
    where, given = _where(wanted)
    rows = connection.exec_driver_sql(
        f"SELECT {RUN} FROM sequence_run {where} ORDER BY started DESC, id DESC LIMIT ?", (*given, limit)
    )
    return [_run(row) for row in rows]


def count(connection: Connection, wanted: Wanted, most: int) -> int:
    """How many runs `wanted` lets through, counted up to `most`."""
    return counted(connection, "sequence_run", *_where(wanted), most)


def get(connection: Connection, number: int) -> Run | None:
    """The run `number`."""
    row = connection.exec_driver_sql(f"SELECT {RUN} FROM sequence_run WHERE id = ?", (number,)).first()
    return None if row is None else _run(row)


def steps(connection: Connection, numbers: Iterable[int]) -> Mapping[int, list[RunStep]]:
    """Run → its steps in their order."""
    return belonging(connection, f"SELECT run, {STEP} FROM sequence_step", "run", "step", numbers, RunStep)


def events(connection: Connection, numbers: Iterable[int]) -> Mapping[int, list[RunEvent]]:
    """Run → its events in the order of the ring."""
    return belonging(connection, f"SELECT run, {EVENT} FROM sequence_event", "run", "boot, sequence", numbers, RunEvent)


def forces(connection: Connection, run: Run) -> list[Forced]:
    """What was forced at any time of a run, in its order."""
    end = run.ended if run.ended is not None else 2**62
    rows = connection.exec_driver_sql(
        "SELECT definition, step, bit, since, asked, until, ending, person, reason FROM sequence_force "
        "WHERE equipment = ? AND until > ? AND since < ? ORDER BY since, boot, sequence",
        (run.equipment, run.started, end),
    )
    return [Forced(*row) for row in rows]


def definitions(connection: Connection, ids: Iterable[str]) -> dict[str, Definition]:
    """Id → the definition; one that is not there says nothing."""
    wanted = sorted(set(ids))
    rows = connection.exec_driver_sql(
        f"SELECT id, text FROM sequence_definition WHERE id IN ({', '.join('?' * len(wanted))})", tuple(wanted)
    )
    found = {row[0]: Definition(row[1]) for row in rows}
    return {id: found.get(id) or Definition() for id in wanted}


def fallen(connection: Connection, equipment: str) -> list[Run]:
    """For each permissive that ever fell first on a machine the newest run that it stopped: what one can filter by."""
    rows = connection.exec_driver_sql(
        "WITH RECURSIVE key (text) AS (SELECT min(first_out) FROM sequence_run WHERE equipment = ? AND first_out <> '' UNION ALL "
        "SELECT (SELECT min(first_out) FROM sequence_run WHERE equipment = ? AND first_out > text AND first_out <> '') FROM key "
        "WHERE text IS NOT NULL) SELECT (SELECT max(id) FROM sequence_run WHERE equipment = ? AND first_out = text AND first_out <> '') "
        "FROM key WHERE text IS NOT NULL",
        (equipment,) * 3,
    ).all()
    found = [get(connection, int(row[0])) for row in rows]
    return sorted((run for run in found if run), key=lambda run: (run.first_step or 0, run.first_bit or 0))


def step_times(connection: Connection, wanted: Wanted) -> list[StepTimes]:
    """Times of the steps that were finished in the runs that `wanted` lets through, in the order of the sequence."""
    where, given = _where(wanted)
    source = f"(SELECT id, started FROM sequence_run {where}) r CROSS JOIN sequence_step s ON s.run = r.id AND s.state = 'done'"
    rows = connection.exec_driver_sql(
        "SELECT max(s.step), s.key, count(s.seconds), min(s.seconds), avg(s.seconds), max(s.seconds) "
        f"FROM {source} WHERE s.seconds IS NOT NULL GROUP BY s.key",
        tuple(given),
    ).all()
    last = {
        row[0]: row[1]
        for row in connection.exec_driver_sql(
            # the bare column is that of the row with the greatest time (SQLite)
            f"SELECT s.key, s.seconds, max(r.started) FROM {source} WHERE s.seconds IS NOT NULL GROUP BY s.key",
            tuple(given),
        )
    }
    return sorted(
        (StepTimes(row[0], row[1], row[2], row[3], row[4], row[5], last[row[1]]) for row in rows),
        key=lambda one: (one.step, one.key),
    )


def run_times(connection: Connection, wanted: Wanted) -> RunTimes:
    """How the runs that `wanted` lets through ended, and what the complete ones took."""
    where, given = _where(wanted)
    rows = connection.exec_driver_sql(
        f"SELECT outcome, count(*), min(seconds), avg(seconds), max(seconds) FROM sequence_run {where} GROUP BY outcome",
        tuple(given),
    ).all()
    done = next((row for row in rows if row[0] == Outcome.DONE), None)
    last: float | None = None
    if done is not None:
        sentence = f"{where} {'AND' if where else 'WHERE'} outcome = 'done'"
        last = connection.exec_driver_sql(
            f"SELECT seconds FROM sequence_run {sentence} ORDER BY started DESC, id DESC LIMIT 1", tuple(given)
        ).scalar()
    least, mean, most = (done[2], done[3], done[4]) if done is not None else (None, None, None)
    return RunTimes({row[0]: row[1] for row in rows}, least, mean, most, last)


def _run(row: Any) -> Run:
    cells = list(row)
    cells[SEEN] = bool(cells[SEEN])
    return Run(*cells)


def _where(wanted: Wanted) -> tuple[str, list[object]]:
    return filtered(
        (
            ("equipment = ?", wanted.equipment or None),
            ("started >= ?", wanted.begin),
            ("started < ?", wanted.end),
            ("outcome = ?", wanted.outcome or None),
            ("seconds > ?", wanted.longer),
            ("first_out = ?", wanted.first_out if wanted.first_out not in ("", ANY) else None),
            ("(started, id) < (?, ?)", wanted.before),
        ),
        (*(["first_out <> ''"] if wanted.first_out else []), *(["forces > 0"] if wanted.forced else [])),
    )
