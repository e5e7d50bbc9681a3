"""A draft of a sequence tried out before it is taken: begun with a button, and its outcome in words on the page of the review."""

import asyncio
import logging
from dataclasses import dataclass
from threading import Event
from typing import Any

from fastapi import APIRouter, FastAPI, Request
from fastapi.responses import RedirectResponse, Response

from app.errors import Refused
from app.plant.definitions import Plant
from app.plant.sequence_definition import SequenceDefinition
from app.running.sequence_trial import Trial, try_out
from app.web import format as fmt
from app.web.guard import allow, fields
from app.web.language import language_of
from app.web.pages import view_of
from app.web.sequence_editor import Editing, editing

log = logging.getLogger(__name__)
router = APIRouter()

MOST_KEPT = 50
"""Trials whose outcome is remembered."""
MOST_NAMED = 4


@dataclass(slots=True)
class Trying:
    """A trial, under way or over."""

    text: str
    """The draft that is tried."""
    definition: SequenceDefinition
    task: "asyncio.Task[Trial]"
    over: Event
    """Set when nobody waits for it any more."""

    @property
    def trial(self) -> Trial | None:
        """What came of it; None while it is under way."""
        if not self.task.done():
            return None
        error = self.task.exception() if not self.task.cancelled() else None
        return Trial("failed", error=type(error).__name__) if self.task.cancelled() or error else self.task.result()


@dataclass(frozen=True, slots=True)
class Told:
    """An outcome in words."""

    text: str
    good: bool
    steps: list[tuple[int, str, str, bool]]
    """Number, name, since the start, whether it was left."""
    tests: list[tuple[str, bool, str]]
    """Name, whether it passed, what happened."""
    untested: int


@router.post("/equipment/{key}/definition/try", dependencies=[allow("configure")])
async def begin(request: Request, key: str) -> Response:
    """Try the draft out."""
    given = await fields(request, [], ["test"])
    at = await editing(request, key)
    plant = await view_of(request).runtime(request).plant_files.drawn_up({at.name: at.draft.text})
    definition = plant.equipment[at.item.id].sequence if plant and at.item.id in plant.equipment else None
    if plant is None or definition is None:
        raise Refused("editor.trial.mistakes", 409)
    trials = _trials(request.app)
    if any(one.trial is None for one in trials.values()):
        raise Refused("editor.trial.busy", 409)
    while len(trials) >= MOST_KEPT:
        trials.pop(next(iter(trials)))
    over = Event()
    task = asyncio.ensure_future(_tried(plant, at.item.id, definition, given["test"], over))
    trials[_key(at)] = Trying(at.draft.text, definition, task, over)
    if request.headers.get("hx-request") == "true":
        return await shown(request, key)
    return RedirectResponse(f"{at.url}/review#ed-trial", 303)


@router.get("/equipment/{key}/definition/try", dependencies=[allow("configure")])
async def shown(request: Request, key: str) -> Response:
    """How far it is."""
    at = await editing(request, key)
    return view_of(request).fragment(request, "fragments/editor_trial.html", url=at.url, **trial_of(request, at))


def end(app: FastAPI) -> None:
    """Give up what is tried at present: the server stops, and a thread that computes would keep it."""
    for one in _trials(app).values():
        one.over.set()


def trial_of(request: Request, at: Editing) -> dict[str, Any]:
    """What the page shows of the trial of a draft: `trying`, `told`, the names of its tests, whether it was of an older draft."""
    found = _trials(request.app).get(_key(at))
    trial = found.trial if found else None
    data = at.data or {}
    rows = data.get("tests", [])
    tests = [str(row.get("name", "")) for row in rows if isinstance(row, dict)] if isinstance(rows, list) else []
    return {
        "trying": found is not None and trial is None,
        "told": _told(request, at, found.definition, trial) if found and trial else None,
        "older": found is not None and found.text != at.draft.text,
        "tests": tests,
    }


async def _tried(plant: Plant, id: str, definition: SequenceDefinition, test: str, over: Event) -> Trial:
    given = next((one for one in definition.tests if one.name == test), None)
    try:
        return await asyncio.to_thread(try_out, plant, id, given, over.is_set)
    except Exception:
        log.exception("trial failed sequence=%s", id)
        raise


def _told(request: Request, at: Editing, definition: SequenceDefinition, trial: Trial) -> Told:
    view, lang = view_of(request), language_of(request)

    def seconds(value: float) -> str:
        return fmt.quantity(value, 1, "s", lang) if value < 100 else fmt.duration(value, lang)

    def name(step: int, bit: int) -> str:
        found = definition.permissive(step, bit)
        label = at.equipment.words(found.label) if found else view.text(request, "editor.bit_n", n=bit)
        return f"{label} ({found.when})" if found and found.when else label

    label = at.equipment.words(definition.steps[trial.step - 1].label) if trial.step else ""
    missing = [name(*one) for one in trial.missing]
    shown = " · ".join(missing[:MOST_NAMED]) + (f" … +{len(missing) - MOST_NAMED}" if len(missing) > MOST_NAMED else "")
    text = view.text(
        request,
        f"editor.trial.{trial.outcome}",
        n=trial.step,
        label=label,
        time=seconds(trial.seconds),
        names=shown or "–",
        why=trial.error,
    )
    said = [text]
    if trial.outcome in ("aborted", "timed_out") and trial.first_out is not None:
        said.append(view.text(request, "editor.trial.first", name=name(*trial.first_out)))
    if trial.order and trial.step:
        orders = definition.steps[trial.step - 1].orders
        one = orders[trial.order - 1] if trial.order <= len(orders) else None
        order = str(one or trial.order)
        machine, about = at.equipment.other(one.machine) if one else None, str(trial.params.get("label", ""))
        filled = fmt.parameters(trial.params, lang, at.equipment.text)
        filled["label"] = machine.told(about, trial.params) if machine and about else order
        said.append(
            view.text(
                request, "editor.trial.order", order=order, why=view.text(request, trial.reason, **filled).rstrip()
            )
        )
    elif trial.outcome in ("waits", "timed_out") and not missing:
        said.append(view.text(request, "editor.trial.nothing_missing"))
    steps = [
        (
            one.number,
            at.equipment.words(definition.steps[one.number - 1].label),
            seconds(one.entered),
            one.left is not None,
        )
        for one in trial.steps
    ]
    return Told(
        " ".join(said),
        trial.outcome == "done" and all(one.ok for one in trial.tests),
        steps,
        [(one.name, one.ok, one.happened) for one in trial.tests],
        trial.untested,
    )


def _key(at: Editing) -> tuple[int, str]:
    return at.person.id, at.item.id


def _trials(app: FastAPI) -> dict[tuple[int, str], Trying]:
    found: dict[tuple[int, str], Trying] = app.state.__dict__.setdefault("trials", {})
    return found
