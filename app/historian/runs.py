"""Runs of sequences: what each run did, step by step, made of the events of the device that runs it.

How events are kept is told in events.py. Codes are those of a device that runs a sequence (app/sim/sequence/program.py):

| subject | rule |
| --- | --- |
| begin | STARTED; another event of a run while none is known: its start was not seen |
| end | DONE, TIMED_OUT, ABORTED; a device that was switched on aborts what ran: cause power-up, run time not known |
| STARTED while one is under way | the end of that one is not known |
| lost events | counted in the run that was under way; a step entered that it had behind it already is another run |
| first-out | the permissive that the end names; it fell when it was last told as lost in this run, else before it mattered: no time |
| forces | those that were active at any time of the run; without a telling end one ends when the time asked for it is over |
| definition | kept as it was: a plant file that changes does not change what happened |
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from hashlib import sha256
from json import dumps
from typing import Any

from sqlalchemy import Connection

from app.blocks.sequence import Cause
from app.blocks.sequence import SequenceEvent as Code
from app.historian.events import Fold
from app.plant.definitions import Equipment, SequenceDefinition, SequencePermissive
from app.records.event import Event
from app.registers.plc_map import real_of

POWER_UP = 18
NO_BIT = 0xFFFF
BITS = 16
ABORT_KEY = "abort"
"""In place of the key of a step: the abort conditions."""


class Outcome(StrEnum):
    """How a run ended."""

    OPEN = "open"
    """It is under way, suspended or not."""
    DONE = "done"
    TIMED_OUT = "timed_out"
    ABORTED = "aborted"
    UNKNOWN = "unknown"
    """Its end was not seen: events were lost."""


class StepState(StrEnum):
    """How a step of a run ended."""

    ACTIVE = "active"
    DONE = "done"
    TIMED_OUT = "timed_out"
    ABORTED = "aborted"
    UNKNOWN = "unknown"


ENDS: Mapping[int, Outcome] = {
    Code.DONE: Outcome.DONE,
    Code.TIMED_OUT: Outcome.TIMED_OUT,
    Code.ABORTED: Outcome.ABORTED,
}
RUNNING = frozenset(
    (
        Code.STEP_ENTERED,
        Code.STEP_ENDED,
        Code.SUSPENDED,
        Code.RESUMED,
        Code.STALLED,
        Code.STALL_OVER,
        Code.PERMISSIVE_LOST,
        Code.PERMISSIVE_BACK,
        *ENDS,
    )
)
"""What only a sequence that runs tells: without a run, one is under way whose start was not seen."""
FORCE_ENDS: Mapping[int, str] = {0: "released", 1: "over", 2: "restart"}
"""Value of RELEASED → why; `renewed` is one that was forced again meanwhile."""


def runs_sequence(item: Equipment) -> bool:
    """Whether a machine tells of runs: it runs a sequence of the plant and has an event ring."""
    plc = item.type.device.plc
    return item.type.sequence and item.sequence is not None and plc is not None and plc.events


@dataclass(frozen=True, slots=True)
class Kept:
    """A definition as the history keeps it."""

    id: str
    """Of exactly this text."""
    text: str
    """JSON."""
    steps: tuple[str, ...]
    """Keys."""
    permissives: Mapping[tuple[int, int], str]
    """(step, bit) → `<step>.<permissive>`, `abort.<permissive>`."""

    def step(self, number: int) -> str:
        """Key of a step; its number when the definition has no such step."""
        return self.steps[number - 1] if 1 <= number <= len(self.steps) else str(number)

    def permissive(self, step: int, bit: int) -> str:
        """Key of a permissive within its sequence, the same for all definitions that name it so."""
        word = self.step(step) if step else ABORT_KEY
        return self.permissives.get((step, bit), f"{word}.bit_{bit}")


def kept(definition: SequenceDefinition) -> Kept:
    """A definition with what a reader of the history needs: keys, labels, the point behind each permissive."""

    def words(permissives: Iterable[SequencePermissive]) -> list[dict[str, Any]]:
        return [
            {"bit": each.bit, "key": each.key, "label": dict(each.label), "value": each.value} for each in permissives
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
        },
        ensure_ascii=False,
        sort_keys=True,
    )
    names = {(0, each.bit): f"{ABORT_KEY}.{each.key}" for each in definition.abort}
    for number, step in enumerate(definition.steps, 1):
        names |= {(number, each.bit): f"{step.key}.{each.key}" for each in step.permissives}
    steps = tuple(step.key for step in definition.steps)
    return Kept(sha256(text.encode()).hexdigest()[:16], text, steps, names)


UNKNOWN = Kept("", "{}", (), {})
"""Of a machine whose definition nobody knows."""


class Runs(Fold):
    """What the events of machines that run a sequence mean."""

    def __init__(self) -> None:
        self._definitions: Mapping[str, Kept] = {}

    def configure(self, machines: Iterable[Equipment]) -> None:
        """Take the machines of a plant: those that run a sequence, with its definition."""
        running = [item for item in machines if runs_sequence(item)]
        self._definitions = {item.id: kept(item.sequence) for item in running if item.sequence}
        self.machines = frozenset(self._definitions)

    def put(self, connection: Connection, equipment: str, event: Event) -> None:
        _put(connection, equipment, event, self._definitions.get(equipment, UNKNOWN))

    def lose(self, connection: Connection, equipment: str, lost: int) -> None:
        connection.exec_driver_sql(
            "UPDATE sequence_run SET missed = missed + ? WHERE equipment = ? AND outcome = 'open'", (lost, equipment)
        )

    def begin_again(self, connection: Connection, equipment: str, event: Event) -> None:
        if event.code != POWER_UP and (run := _latest(connection, event.equipment)) and run.open:
            _forget(connection, run, event.time)

    def attributed(self, connection: Connection, equipment: str, event: Event) -> None:
        who, key = (event.person, event.reason), (event.boot, event.sequence)
        connection.exec_driver_sql(
            "UPDATE sequence_force SET person = ?, reason = ? WHERE equipment = ? AND boot = ? AND sequence = ? AND since = ?",
            (*who, event.equipment, *key, event.time),
        )
        row = connection.exec_driver_sql(
            "SELECT e.run FROM sequence_event e JOIN sequence_run r ON r.id = e.run "
            "WHERE r.equipment = ? AND e.boot = ? AND e.sequence = ? AND e.time = ? ORDER BY e.run DESC LIMIT 1",
            (event.equipment, *key, event.time),
        ).first()
        if row is None:
            return
        connection.exec_driver_sql(
            "UPDATE sequence_event SET person = ?, reason = ? WHERE run = ? AND boot = ? AND sequence = ?",
            (*who, row[0], *key),
        )
        column = {Code.STARTED.value: "person", Code.ACKNOWLEDGED.value: "acknowledged_by"}.get(event.code)
        if column:
            connection.exec_driver_sql(f"UPDATE sequence_run SET {column} = ? WHERE id = ?", (event.person, row[0]))


# ---- what is stored ---------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Run:
    id: int
    outcome: str
    cause: int
    started: int
    step: int
    suspended_at: int | None
    missed: int
    acknowledged: int | None

    @property
    def open(self) -> bool:
        return self.outcome == Outcome.OPEN


@dataclass(frozen=True, slots=True)
class _Said:
    """What the snapshot of an event says."""

    bit: int | None
    together: int
    abort_word: int
    step_word: int
    signal: float | None


def _said(event: Event) -> _Said:
    words = [*event.words, 0, 0, 0, 0, 0, 0]
    return _Said(
        words[0] if words[0] < BITS else None,
        words[1],
        words[2],
        words[3],
        _finite(real_of(words[4] << 16 | words[5])),
    )


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _latest(connection: Connection, equipment: str) -> _Run | None:
    row = connection.exec_driver_sql(
        "SELECT id, outcome, cause, started, step, suspended_at, missed, acknowledged FROM sequence_run "
        "WHERE equipment = ? ORDER BY started DESC, id DESC LIMIT 1",
        (equipment,),
    ).first()
    return None if row is None else _Run(*row)


def _put(connection: Connection, equipment: str, event: Event, definition: Kept) -> None:
    said = _said(event)
    if event.code == Code.FORCED and said.bit is not None:
        _force(connection, equipment, event, said.bit, definition)
    elif event.code == Code.RELEASED and said.bit is not None:
        _release(connection, equipment, event, said.bit)
    run = _run(connection, equipment, event, definition)
    if run is None:
        return
    _note(connection, run.id, event, said)
    match event.code:
        case Code.STEP_ENTERED:
            _enter(connection, run, event, definition)
        case Code.STEP_ENDED:
            _leave(connection, run, event, definition)
        case Code.SUSPENDED:
            connection.exec_driver_sql(
                "UPDATE sequence_run SET suspensions = suspensions + 1, suspended_at = ? WHERE id = ?",
                (event.time, run.id),
            )
        case Code.RESUMED:
            _resume(connection, run, event.time)
        case Code.STALLED:
            connection.exec_driver_sql("UPDATE sequence_run SET stalls = stalls + 1 WHERE id = ?", (run.id,))
        case Code.PERMISSIVE_LOST:
            connection.exec_driver_sql("UPDATE sequence_run SET losses = losses + 1 WHERE id = ?", (run.id,))
        case Code.ACKNOWLEDGED:
            connection.exec_driver_sql(
                "UPDATE sequence_run SET acknowledged = ? WHERE id = ? AND acknowledged IS NULL", (event.time, run.id)
            )
        case Code.DONE | Code.TIMED_OUT | Code.ABORTED:
            _end(connection, run, event, said, definition)
        case 18:
            _interrupt(connection, run, event.time)


def _run(connection: Connection, equipment: str, event: Event, definition: Kept) -> _Run | None:
    """The run that an event belongs to, a new one where there is none; None: it is of no run."""
    run = _latest(connection, equipment)
    if event.code == Code.STARTED:
        if run is not None and run.open:
            _forget(connection, run, event.time)
        return _begin(connection, equipment, event, definition, seen=True)
    if run is not None and run.open:
        behind = (event.code == Code.STEP_ENTERED and event.source <= run.step) or (
            event.code == Code.STEP_ENDED and event.source < run.step
        )
        if not (run.missed and behind):
            return run
        _forget(connection, run, event.time)
        return _begin(connection, equipment, event, definition, seen=False)
    if run is not None and run.cause == Cause.POWER_UP and event.code == Code.ABORTED and event.value == Cause.POWER_UP:
        return run  # what the device says of what its start has ended
    if event.code == Code.ACKNOWLEDGED:
        stopped = run is not None and run.outcome in (Outcome.ABORTED, Outcome.TIMED_OUT)
        return run if stopped and run is not None and run.acknowledged is None else None
    return _begin(connection, equipment, event, definition, seen=False) if event.code in RUNNING else None


def _begin(connection: Connection, equipment: str, event: Event, definition: Kept, *, seen: bool) -> _Run:
    connection.exec_driver_sql(
        "INSERT OR IGNORE INTO sequence_definition (id, text) VALUES (?, ?)", (definition.id, definition.text)
    )
    forces = connection.exec_driver_sql(
        "SELECT count(*) FROM sequence_force WHERE equipment = ? AND until > ? AND since <= ?",
        (equipment, event.time, event.time),
    ).scalar_one()
    number = connection.exec_driver_sql(
        "INSERT INTO sequence_run (equipment, boot, sequence, definition, started, seen, outcome, step, suspensions, suspended, stalls, "
        "losses, forces, cause, first_out, first_together, acknowledged_by, person, missed) "
        "VALUES (?, ?, ?, ?, ?, ?, 'open', 0, 0, 0, 0, 0, ?, 0, '', 0, '', '', 0) RETURNING id",
        (equipment, event.boot, event.sequence, definition.id, event.time, int(seen), forces),
    ).scalar_one()
    return _Run(int(number), Outcome.OPEN, 0, event.time, 0, None, 0, None)


def _note(connection: Connection, run: int, event: Event, said: _Said) -> None:
    connection.exec_driver_sql(
        "INSERT OR IGNORE INTO sequence_event (run, boot, sequence, time, code, step, bit, value, signal, together, abort_word, step_word, "
        "person, reason) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, '', '')",
        (
            run,
            event.boot,
            event.sequence,
            event.time,
            event.code,
            event.source,
            said.bit,
            event.value,
            said.signal,
            said.together,
            said.abort_word,
            said.step_word,
        ),
    )


def _enter(connection: Connection, run: _Run, event: Event, definition: Kept) -> None:
    connection.exec_driver_sql(  # its end was among the lost events
        "UPDATE sequence_step SET state = 'unknown' WHERE run = ? AND state = 'active'", (run.id,)
    )
    connection.exec_driver_sql(
        "INSERT OR REPLACE INTO sequence_step (run, step, key, state, entered, suspended) VALUES (?, ?, ?, 'active', ?, 0)",
        (run.id, event.source, definition.step(event.source), event.time),
    )
    connection.exec_driver_sql("UPDATE sequence_run SET step = ? WHERE id = ?", (event.source, run.id))


def _leave(connection: Connection, run: _Run, event: Event, definition: Kept) -> None:
    _resume(connection, run, event.time)
    connection.exec_driver_sql(
        "UPDATE sequence_step SET state = 'unknown' WHERE run = ? AND state = 'active' AND step <> ?",
        (run.id, event.source),
    )
    connection.exec_driver_sql(
        "INSERT INTO sequence_step (run, step, key, state, ended, seconds, suspended) VALUES (?, ?, ?, 'done', ?, ?, 0) "
        "ON CONFLICT (run, step) DO UPDATE SET state = 'done', ended = excluded.ended, seconds = excluded.seconds",
        (run.id, event.source, definition.step(event.source), event.time, event.value),
    )
    connection.exec_driver_sql("UPDATE sequence_run SET step = max(step, ?) WHERE id = ?", (event.source, run.id))


def _resume(connection: Connection, run: _Run, time: int) -> None:
    """The suspension, if there is one, is over."""
    if run.suspended_at is None:
        return
    passed = max(0, time - run.suspended_at)
    connection.exec_driver_sql(
        "UPDATE sequence_run SET suspended = suspended + ?, suspended_at = NULL WHERE id = ?", (passed, run.id)
    )
    connection.exec_driver_sql(
        "UPDATE sequence_step SET suspended = suspended + ? WHERE run = ? AND state = 'active'", (passed, run.id)
    )


def _end(connection: Connection, run: _Run, event: Event, said: _Said, definition: Kept) -> None:
    _resume(connection, run, event.time)
    outcome = ENDS[event.code]
    cause = Cause.NONE if outcome is Outcome.DONE else _cause(event.value)
    if cause is Cause.POWER_UP:
        _interrupt(connection, run, event.time)
        return
    state = StepState.UNKNOWN if outcome is Outcome.DONE else StepState(outcome.value)
    connection.exec_driver_sql(
        "UPDATE sequence_step SET state = ?, ended = ?, seconds = (? - entered - suspended) / 1e6 WHERE run = ? AND state = 'active'",
        (state, event.time, event.time, run.id),
    )
    seconds = event.value if outcome is Outcome.DONE else (event.time - run.started) / 1e6
    connection.exec_driver_sql(
        "UPDATE sequence_run SET outcome = ?, ended = ?, seconds = ?, cause = ? WHERE id = ?",
        (outcome, event.time, seconds, cause, run.id),
    )
    if said.bit is not None and outcome is not Outcome.DONE:
        _first_out(connection, run, event.source, said, definition)


def _cause(value: float | None) -> Cause:
    return Cause(int(value)) if value is not None and int(value) in {each.value for each in Cause} else Cause.NONE


def _first_out(connection: Connection, run: _Run, step: int, said: _Said, definition: Kept) -> None:
    assert said.bit is not None
    fell = connection.exec_driver_sql(
        "SELECT code, time, signal FROM sequence_event WHERE run = ? AND code IN (?, ?) AND step = ? AND bit = ? "
        "ORDER BY time DESC, boot DESC, sequence DESC LIMIT 1",
        (run.id, Code.PERMISSIVE_LOST, Code.PERMISSIVE_BACK, step, said.bit),
    ).first()
    time, signal = (fell[1], fell[2]) if fell is not None and fell[0] == Code.PERMISSIVE_LOST else (None, said.signal)
    connection.exec_driver_sql(
        "UPDATE sequence_run SET first_out = ?, first_step = ?, first_bit = ?, first_time = ?, first_value = ?, first_together = ? "
        "WHERE id = ?",
        (definition.permissive(step, said.bit), step, said.bit, time, signal, said.together, run.id),
    )


def _interrupt(connection: Connection, run: _Run, time: int) -> None:
    """The device was switched on: when it was switched off nobody knows."""
    connection.exec_driver_sql(
        "UPDATE sequence_step SET state = 'aborted', ended = ? WHERE run = ? AND state = 'active'", (time, run.id)
    )
    connection.exec_driver_sql(
        "UPDATE sequence_run SET outcome = 'aborted', ended = ?, cause = ?, suspended_at = NULL WHERE id = ? AND outcome = 'open'",
        (time, Cause.POWER_UP, run.id),
    )


def _forget(connection: Connection, run: _Run, time: int) -> None:
    """The end of a run was not seen."""
    connection.exec_driver_sql(
        "UPDATE sequence_step SET state = 'unknown' WHERE run = ? AND state = 'active'", (run.id,)
    )
    connection.exec_driver_sql(
        "UPDATE sequence_run SET outcome = 'unknown', ended = ?, suspended_at = NULL WHERE id = ?", (time, run.id)
    )


def _force(connection: Connection, equipment: str, event: Event, bit: int, definition: Kept) -> None:
    asked = max(0.0, event.value or 0.0)
    renewed = connection.exec_driver_sql(
        "UPDATE sequence_force SET until = ?, ending = 'renewed' WHERE equipment = ? AND step = ? AND bit = ? AND until > ?",
        (event.time, equipment, event.source, bit, event.time),
    ).rowcount
    connection.exec_driver_sql(
        "INSERT OR IGNORE INTO sequence_definition (id, text) VALUES (?, ?)", (definition.id, definition.text)
    )
    connection.exec_driver_sql(
        "INSERT OR IGNORE INTO sequence_force (equipment, boot, sequence, definition, step, bit, since, asked, until, ending, "
        "person, reason) "
        "VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, '', '', '')",
        (
            equipment,
            event.boot,
            event.sequence,
            definition.id,
            event.source,
            bit,
            event.time,
            asked,
            event.time + round(asked * 1e6),
        ),
    )
    if not renewed:
        connection.exec_driver_sql(
            "UPDATE sequence_run SET forces = forces + 1 WHERE equipment = ? AND outcome = 'open'", (equipment,)
        )


def _release(connection: Connection, equipment: str, event: Event, bit: int) -> None:
    end = FORCE_ENDS.get(-1 if event.value is None else int(event.value), "released")
    connection.exec_driver_sql(
        "UPDATE sequence_force SET until = max(since, ?), ending = ? WHERE equipment = ? AND step = ? AND bit = ? AND ending = ''",
        (event.time, end, equipment, event.source, bit),
    )


def oldest(connection: Connection) -> int | None:
    """When the oldest run began [µs UTC]."""
    time: int | None = connection.exec_driver_sql("SELECT min(started) FROM sequence_run").scalar()
    return time


def cut(connection: Connection, before: int, at_once: int) -> tuple[int, bool]:
    """Remove runs that began before `before` [µs UTC], at most `at_once`; how many, and whether all are removed."""
    numbers = [
        (row[0],)
        for row in connection.exec_driver_sql(
            "SELECT id FROM sequence_run WHERE started < ? ORDER BY started LIMIT ?", (before, at_once)
        )
    ]
    if numbers:
        connection.exec_driver_sql("DELETE FROM sequence_event WHERE run = ?", numbers)
        connection.exec_driver_sql("DELETE FROM sequence_step WHERE run = ?", numbers)
        connection.exec_driver_sql("DELETE FROM sequence_run WHERE id = ?", numbers)
    connection.exec_driver_sql("DELETE FROM sequence_force WHERE until < ?", (before,))
    return len(numbers), len(numbers) < at_once
