"""Runs of sequences: the list with its filter, one run with its steps and what fell, times per step, CSV."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any
from urllib.parse import urlencode

import orjson
from fastapi import APIRouter, Request
from fastapi.responses import Response
from sqlalchemy import Connection
from starlette.exceptions import HTTPException

from app.blocks.sequence import Cause
from app.blocks.sequence import SequenceEvent as Code
from app.errors import Refused
from app.historian import run_query as query
from app.historian.events import lost as events_lost
from app.historian.export import FORMATS
from app.historian.run_export import RunExport, RunWish, running, step_names, words
from app.historian.run_query import (
    ANY,
    OUTCOMES,
    Definition,
    Forced,
    Run,
    RunEvent,
    RunStep,
    RunTimes,
    StepTimes,
    Wanted,
)
from app.historian.runs import Outcome
from app.plant.definitions import Equipment
from app.web import format as fmt
from app.web.event_list import RANGE, amount, fields, place, set_filters, span
from app.web.guard import address_of, allow, person_of, shown_name, shown_words
from app.web.history import Download, check_place, read
from app.web.language import language_of
from app.web.pages import view_of
from app.web.signin import zone_of

router = APIRouter()

PAGE = 50
"""Runs on a page."""
MOST_COUNTED = 100_000
"""More are not counted."""
NAMES = ("equipment", "outcome", "first_out", "since", "until", "longer", "forced", "view", "before")
TIMES = "steps"
"""`view`: times per step in place of the list."""
GLYPHS: Mapping[str, str] = {"done": "i-check", "aborted": "i-cross", "timed_out": "i-clock", "open": "i-right"}
"""Outcome of a run or state of a step → its sign."""


@router.get("/runs", dependencies=[allow("view")], name="runs")
async def runs(request: Request) -> Response:
    """The list of runs, newest first: of all sequences, or of one; or the times of the steps in these runs."""
    typed = _typed(request)
    view, runtime = view_of(request), view_of(request).runtime(request)
    try:
        found = await _main(request, typed, _wanted(request, typed))
    except Refused as refusal:
        if refusal.reason != RANGE:
            raise
        found = {"problem": view.text(request, RANGE), "export_url": ""}
    item = runtime.plant.equipment.get(typed["equipment"]) if runtime.plant else None
    return view.page(
        request,
        "pages/runs.html",
        status=422 if "problem" in found else 200,
        title=view.text(request, "runs.title"),
        kind="runs",
        area=item.area if item else "",
        up=f"/equipment/{item.id}" if item else "/",
        chip=item.id if item else "",
        **(await _tools(request, typed) | found),
    )


@router.get("/runs/list", dependencies=[allow("view")])
async def rows(request: Request) -> Response:
    """The rows, or the times, alone, after a change."""
    typed = _typed(request)
    wanted = _wanted(request, typed)
    template = "fragments/run_times.html" if typed["view"] == TIMES else "fragments/run_rows.html"
    return view_of(request).fragment(request, template, **await _main(request, typed, wanted))


@router.get("/runs/detail/{number}", dependencies=[allow("view")])
async def detail(request: Request, number: int) -> Response:
    """Everything of one run.

    Raises:
        HTTPException: 404, it is not there.
    """
    runtime = view_of(request).runtime(request)

    def work(connection: Connection) -> dict[str, Any] | None:
        one = query.get(connection, number) if 0 < number < 2**63 else None
        if one is None:
            return None
        forces = query.forces(connection, one)
        return {
            "one": one,
            "steps": query.steps(connection, [one.id])[one.id],
            "events": query.events(connection, [one.id])[one.id],
            "forces": forces,
            "known": query.definitions(connection, [one.definition, *(force.definition for force in forces)]),
        }

    found = await read(runtime, work)
    if found is None:
        raise HTTPException(404)
    return view_of(request).fragment(request, "fragments/run_detail.html", detail=_Words(request).detail(**found))


@router.get("/runs/export.csv", dependencies=[allow("export")])
async def export(request: Request) -> Response:
    """What the filter lets through as CSV: `locale` (hr, en, de, cs, machine), `bom` (1)."""
    typed = _typed(request)
    wanted = _wanted(request, typed)
    runtime, person, lang = view_of(request).runtime(request), person_of(request), language_of(request)
    locale = request.query_params.get("locale", "") or lang
    if locale not in FORMATS:
        raise Refused("history.locale", 422, value=locale[:40], expected=", ".join(FORMATS))
    check_place(request)
    await _check_equipment(request, typed["equipment"])
    filters = "; ".join(f"{name}={value}" for name, value in set_filters(typed).items() if name != "view")
    plant = runtime.plant
    said = words(runtime.texts, locale)
    wish = RunWish(
        replace(wanted, before=None),
        zone_of(request),
        locale,
        bom=request.query_params.get("bom", "") in ("1", "on"),
        **said,
        most_rows=runtime.settings.export_rows,
        filters=filters,
        plant=runtime.texts.label(lang, plant.name) if plant else "",
        person=person.name,
        created=runtime.clock.micros(),
        simulated=runtime.simulated,
    )
    made = RunExport(replace(wish, steps=step_names(plant, typed["equipment"], wish.label)))
    await read(runtime, made.open)
    await runtime.access.audit.record(
        "runs.exported", person, typed["equipment"], address=address_of(request.scope), filters=filters
    )
    return Download(request, made)


@router.get("/runs/export/size", dependencies=[allow("export")])
async def size(request: Request) -> Response:
    """How many rows an export would have, and the limit."""
    typed = _typed(request)
    wanted = _wanted(request, typed)
    await _check_equipment(request, typed["equipment"])
    runtime = view_of(request).runtime(request)
    limit = runtime.settings.export_rows
    whole = replace(wanted, before=None)
    found = await read(runtime, lambda connection: query.count(connection, whole, limit or 10**9))
    return Response(orjson.dumps({"rows": found, "limit": limit}), media_type="application/json")


async def _check_equipment(request: Request, id: str) -> None:
    """Refuse to export of a machine that is neither in the plant nor in the history.

    Raises:
        HTTPException: 404.
    """
    runtime = view_of(request).runtime(request)
    if (
        id
        and not (runtime.plant and id in runtime.plant.equipment)
        and not await read(runtime, lambda connection: query.find(connection, Wanted(equipment=id), 1))
    ):
        raise HTTPException(404)


# ---- the filter -------------------------------------------------------------------------------------------


def _typed(request: Request) -> dict[str, str]:
    return fields(request, NAMES, 120)


def _wanted(request: Request, typed: dict[str, str]) -> Wanted:
    """What the address asks for, as understood.

    Raises:
        Refused: 422, a field is none of its choices or cannot be read, or the end is not after the beginning.
    """
    for name, choices in (("outcome", OUTCOMES), ("forced", ("1",)), ("view", (TIMES,))):
        if typed[name] not in ("", *choices):
            raise Refused("access.form_field", 422, field=name)
    longer, before = amount(typed["longer"], "longer", 1e7), place(typed["before"])
    begin, end = span(request, typed)
    return Wanted(
        typed["equipment"], begin, end, typed["outcome"], typed["first_out"], longer, bool(typed["forced"]), before
    )


def _url(chosen: Mapping[str, str], path: str = "/runs") -> str:
    return path + (f"?{urlencode(chosen)}" if chosen else "")


async def _tools(request: Request, typed: dict[str, str]) -> dict[str, Any]:
    draw, view = _Words(request), view_of(request)
    runtime, lang, person = draw.runtime, draw.lang, request.state.person
    machines = running(runtime.plant)
    shown = [item for item in machines if typed["equipment"] in ("", item.id)]

    def work(connection: Connection) -> tuple[list[Run], dict[str, Definition]]:
        found = [run for item in shown for run in query.fallen(connection, item.id)]
        return found, query.definitions(connection, [run.definition for run in found])

    fallen, known = await read(runtime, work)
    keys: dict[str, str] = {run.first_out: draw.permissive(run, known[run.definition], step=True) for run in fallen}
    if typed["first_out"] not in ("", ANY):
        keys.setdefault(typed["first_out"], typed["first_out"])
    chosen = set_filters(typed)
    link = {name: value for name, value in chosen.items() if name != "view"} | {"locale": lang, "bom": "1"}
    others = {name: value for name, value in chosen.items() if name != "view"}
    only = {"equipment": typed["equipment"]} if typed["equipment"] else {}
    kept = {"view": TIMES} if typed["view"] else {}
    return {
        "typed": typed,
        "machine_choices": [(item.id, runtime.texts.label(lang, item.label)) for item in machines],
        "outcome_choices": [(one, view.text(request, f"runs.outcome.{one}")) for one in OUTCOMES],
        "first_out_choices": [(ANY, view.text(request, "runs.any_first_out")), *keys.items()],
        "filtered": bool(set(chosen) - {"equipment", "view"}),
        "all_url": _url(only | kept),
        "views": [
            (_url(others), view.text(request, "runs.list"), not typed["view"]),
            (_url(others | {"view": TIMES}), view.text(request, "runs.times"), bool(typed["view"])),
        ],
        "export_url": _url(link, "/runs/export.csv") if person is not None and person.may("export") else "",
        "changes": [
            (name, runtime.tags.value(runtime.tags.handle(name)) or 0)
            for item in shown
            if (name := f"sys.runs.{item.id}") in runtime.tags
        ],
    }


async def _main(request: Request, typed: dict[str, str], wanted: Wanted) -> dict[str, Any]:
    """The list, or the times per step, as the address asks."""
    draw, runtime = _Words(request), view_of(request).runtime(request)
    whole, chosen = replace(wanted, before=None), set_filters(typed)
    source = _url({name: value for name, value in typed.items() if value}, "/runs/list")
    common = {"list_url": source, "live": not typed["before"], "several": not typed["equipment"]}
    if typed["view"] == TIMES:

        def times(connection: Connection) -> tuple[list[tuple[str, list[StepTimes], RunTimes]], dict[str, Definition]]:
            ids = [wanted.equipment] if wanted.equipment else [item.id for item in running(runtime.plant)]
            found = []
            newest: dict[str, str] = {}
            for id in ids:
                only = replace(whole, equipment=id)
                found.append((id, query.step_times(connection, only), query.run_times(connection, only)))
                for run in query.find(connection, Wanted(equipment=id), 1):
                    newest[id] = run.definition
            known = query.definitions(connection, newest.values())
            return found, {id: known[key] for id, key in newest.items()}

        made, known = await read(runtime, times)
        return common | {"machines": [draw.times(*one, known.get(one[0])) for one in made]}

    def work(connection: Connection) -> tuple[list[Run], int, int, dict[str, Definition]]:
        found = query.find(connection, wanted, PAGE + 1)
        return (
            found,
            query.count(connection, whole, MOST_COUNTED + 1),
            events_lost_of(connection),
            query.definitions(connection, [run.definition for run in found]),
        )

    def events_lost_of(connection: Connection) -> int:
        ids = [wanted.equipment] if wanted.equipment else [item.id for item in running(runtime.plant)]
        return sum(events_lost(connection, id, wanted.begin, wanted.end) for id in ids)

    found, count, lost, definitions = await read(runtime, work)
    last = found[PAGE - 1] if len(found) > PAGE else None
    return common | {
        "runs": [draw.row(one, definitions[one.definition]) for one in found[:PAGE]],
        "found": min(count, MOST_COUNTED),
        "more": count > MOST_COUNTED,
        "lost": lost,
        "older": _url(chosen | {"before": f"{last.started}-{last.id}"}) if last else "",
        "newest": _url(chosen) if typed["before"] else "",
    }


# ---- words ------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Line:
    """One run as a line of the list."""

    id: int
    equipment: str
    machine: str
    """Its name."""
    started: str
    iso: str
    seen: bool
    """Whether its start was seen."""
    outcome: str
    """Key of the outcome."""
    outcome_text: str
    glyph: str
    """Sign of the outcome."""
    seconds: str
    step: str
    """Where it stopped; empty when it went to its end."""
    why: str
    """First-out, else the cause; empty when it went to its end."""
    forces: int
    suspensions: int
    stalls: int
    missed: int
    mark: str
    """Another one when there is more to tell in its detail."""


class _Words:
    """Runs in the language of a request."""

    def __init__(self, request: Request) -> None:
        self.view, self.request = view_of(request), request
        self.runtime = self.view.runtime(request)
        self.lang, self.zone = language_of(request), zone_of(request)
        self.now = self.runtime.clock.micros()

    def text(self, key: str, **values: object) -> str:
        return self.view.text(self.request, f"runs.{key}", **values)

    def named(self, name: str) -> str:
        return shown_name(self.request, name)

    def row(self, one: Run, definition: Definition) -> Line:
        item = self._item(one.equipment)
        stopped = one.outcome in (Outcome.ABORTED, Outcome.TIMED_OUT)
        return Line(
            id=one.id,
            equipment=one.equipment,
            machine=self.runtime.texts.label(self.lang, item.label) if item else one.equipment,
            started=self.moment(one.started),
            iso=fmt.iso(one.started, self.zone),
            seen=one.seen,
            outcome=one.outcome,
            outcome_text=self.text(f"outcome.{one.outcome}"),
            glyph=GLYPHS.get(one.outcome, ""),
            seconds="" if one.seconds is None else self.seconds(one.seconds),
            step="" if one.outcome == Outcome.DONE or not one.step else self.step(definition, one.step),
            why=self.why(one, definition) if stopped else "",
            forces=one.forces,
            suspensions=one.suspensions,
            stalls=one.stalls,
            missed=one.missed,
            mark=f"{one.outcome}-{one.step}-{one.suspensions}-{one.suspended}-{one.losses}-{one.stalls}-{one.forces}-{one.missed}-"
            f"{one.acknowledged}-{self.named(one.acknowledged_by)}-{self.named(one.person)}",
        )

    def why(self, one: Run, definition: Definition) -> str:
        """What fell first; without a permissive the cause."""
        if one.first_bit is not None:
            return self.permissive(one, definition)
        return self.text(f"cause.{Cause(one.cause).name.lower()}") if one.cause else ""

    def permissive(self, one: Run, definition: Definition, *, step: bool = False) -> str:
        """The permissive that fell first of a run, with its step if wanted."""
        assert one.first_step is not None
        assert one.first_bit is not None
        return self.bit(definition, one.first_step, one.first_bit, step=step)

    def bit(self, definition: Definition, number: int, bit: int, *, step: bool = False) -> str:
        label = definition.permissive(number, bit)
        text = self.runtime.texts.label(self.lang, label) if label else self.text("bit", n=bit)
        if not step:
            return text
        return f"{number} · {text}" if number else f"{self.text('abort')} · {text}"

    def step(self, definition: Definition, number: int) -> str:
        label = definition.step(number)
        return f"{number} {self.runtime.texts.label(self.lang, label)}" if label else self.text("step_n", n=number)

    def seconds(self, value: float) -> str:
        """A step or run time, as fine as one compares it: hundredths below ten seconds, tenths below a minute."""
        if value >= 59.95:
            return fmt.duration(value, self.lang)
        return fmt.quantity(value, 2 if value < 9.995 else 1, "s", self.lang)

    def times(self, id: str, steps: list[StepTimes], whole: RunTimes, newest: Definition | None) -> dict[str, Any]:
        item = self._item(id)
        labels = {step["key"]: step["label"] for step in newest.steps} if newest else {}
        order = {key: number for number, key in enumerate(labels, 1)}
        return {
            "equipment": id,
            "machine": self.runtime.texts.label(self.lang, item.label) if item else id,
            "outcomes": [
                (self.text(f"outcome.{one}"), fmt.number(whole.outcomes[one], 0, self.lang), GLYPHS.get(one, ""))
                for one in OUTCOMES
                if one in whole.outcomes
            ],
            "whole": None if whole.mean is None else self._spread(whole.outcomes[Outcome.DONE], whole),
            "steps": [
                {
                    "number": order.get(one.key, "–"),
                    "label": self.runtime.texts.label(self.lang, labels[one.key]) if one.key in labels else one.key,
                    **self._spread(one.count, one),
                }
                for one in sorted(steps, key=lambda one: (order.get(one.key, 1000), one.step))
            ],
        }

    def _spread(self, count: int, one: StepTimes | RunTimes) -> dict[str, str]:
        said = {
            name: "–" if (value := getattr(one, name)) is None else self.seconds(value)
            for name in ("least", "mean", "most", "last")
        }
        return {"count": fmt.number(count, 0, self.lang)} | said

    def detail(
        self,
        one: Run,
        steps: Sequence[RunStep],
        events: Sequence[RunEvent],
        forces: Sequence[Forced],
        known: Mapping[str, Definition],
    ) -> dict[str, Any]:
        item, definition = self._item(one.equipment), known[one.definition]
        row = self.row(one, definition)
        return {
            "row": row,
            "title": self.runtime.texts.label(self.lang, definition.label) if definition.label else row.machine,
            "ended": "" if one.ended is None else self.moment(one.ended),
            "person": self.named(one.person),
            "suspended": self.seconds(one.suspended / 1e6) if one.suspensions else "",
            "cause": self.text(f"cause.{Cause(one.cause).name.lower()}") if one.cause else "",
            "told_by": next(
                (
                    {"person": self.named(event.person), "reason": shown_words(self.request, event.reason)}
                    for event in events
                    if event.code == Code.ABORTED and event.person
                ),
                None,
            ),
            "first": self._first(one, definition, item) if one.first_bit is not None else None,
            "steps": [self._step(step, definition) for step in steps],
            "falls": self._falls(events, definition, item, one),
            "breaks": self._breaks(events, one),
            "forces": [self._force(force, known[force.definition], one) for force in forces],
            "acknowledged": "" if one.acknowledged is None else self.moment(one.acknowledged),
            "acknowledged_by": self.named(one.acknowledged_by),
            "url": f"/equipment/{one.equipment}" if item else "",
            "open": one.outcome == Outcome.OPEN,
        }

    def _first(self, one: Run, definition: Definition, item: Equipment | None) -> dict[str, Any]:
        assert one.first_step is not None
        assert one.first_bit is not None
        return {
            "text": self.permissive(one, definition),
            "place": self._place(definition, one.first_step, one.first_bit),
            "time": ""
            if one.first_time is None
            else fmt.clock_time(one.first_time, self.zone, milliseconds=True, lang=self.lang),
            "iso": "" if one.first_time is None else fmt.iso(one.first_time, self.zone),
            "value": self._value(definition, item, one.first_step, one.first_bit, one.first_value),
            "together": one.first_together,
        }

    def _place(self, definition: Definition, step: int, bit: int) -> str:
        where = self.step(definition, step) if step else self.text("abort")
        return f"{where} · {self.text('bit', n=bit)}"

    def _step(self, step: RunStep, definition: Definition) -> dict[str, Any]:
        return {
            "number": step.step,
            "text": self.runtime.texts.label(self.lang, definition.step(step.step)) or step.key,
            "state": step.state,
            "state_text": self.text(f"step_state.{step.state}"),
            "glyph": GLYPHS.get("open" if step.state == "active" else step.state, ""),
            "entered": ""
            if step.entered is None
            else fmt.clock_time(step.entered, self.zone, milliseconds=True, lang=self.lang),
            "iso": "" if step.entered is None else fmt.iso(step.entered, self.zone),
            "ended": ""
            if step.ended is None
            else fmt.clock_time(step.ended, self.zone, milliseconds=True, lang=self.lang),
            "seconds": "" if step.seconds is None else self.seconds(step.seconds),
            "suspended": self.seconds(step.suspended / 1e6) if step.suspended else "",
        }

    def _falls(
        self, events: Sequence[RunEvent], definition: Definition, item: Equipment | None, one: Run
    ) -> list[dict[str, Any]]:
        """Each permissive that was lost, in the order of the device, and when it came back."""
        falls: list[dict[str, Any]] = []
        missing: dict[tuple[int, int], dict[str, Any]] = {}
        for event in events:
            if event.bit is None:
                continue
            if event.code == Code.PERMISSIVE_LOST:
                fall = {
                    "order": len(falls) + 1,
                    "text": self.bit(definition, event.step, event.bit),
                    "place": self._place(definition, event.step, event.bit),
                    "time": fmt.clock_time(event.time, self.zone, milliseconds=True, lang=self.lang),
                    "iso": fmt.iso(event.time, self.zone),
                    "value": self._value(definition, item, event.step, event.bit, event.signal),
                    "first": (event.step, event.bit, event.time) == (one.first_step, one.first_bit, one.first_time),
                    "together": event.together > 1,
                    "away": "",
                    "fell": event.time,
                }
                missing[event.step, event.bit] = fall
                falls.append(fall)
            elif event.code == Code.PERMISSIVE_BACK and (back := missing.pop((event.step, event.bit), None)):
                away = (event.time - back["fell"]) / 1e6
                back["away"] = fmt.quantity(away, 3, "s", self.lang) if away < 10 else self.seconds(away)
        return falls

    def _breaks(self, events: Sequence[RunEvent], one: Run) -> list[dict[str, Any]]:
        """Suspensions, with who suspended and resumed."""
        found: list[dict[str, Any]] = []
        began: int | None = None
        for event in events:
            if event.code == Code.SUSPENDED:
                began = event.time
                found.append(
                    {
                        "time": fmt.clock_time(event.time, self.zone, milliseconds=True, lang=self.lang),
                        "iso": fmt.iso(event.time, self.zone),
                        "person": self.named(event.person),
                        "reason": shown_words(self.request, event.reason),
                        "length": "",
                    }
                )
            elif began is not None and (event.code == Code.RESUMED or event.time == one.ended):
                found[-1]["length"] = self.seconds((event.time - began) / 1e6)
                began = None
        return found

    def _force(self, force: Forced, definition: Definition, one: Run) -> dict[str, Any]:
        stands = not force.ending and force.until > self.now
        return {
            "text": self.bit(definition, force.step, force.bit),
            "place": self._place(definition, force.step, force.bit),
            "since": self.moment(force.since),
            "before": force.since < one.started,
            "until": self.moment(force.until),
            "ending": self.text("force.stands") if stands else self.text(f"force.{force.ending or 'over'}"),
            "person": self.named(force.person),
            "reason": shown_words(self.request, force.reason),
        }

    def _value(self, definition: Definition, item: Equipment | None, step: int, bit: int, value: float | None) -> str:
        """The value behind a permissive with its unit, while its machine still has the point."""
        key = definition.value(step, bit)
        if value is None or not key:
            return ""
        machine = self._item(item.machine) if item else None
        point = machine.points.get(key) if machine else None
        if point is None:
            return f"{key} {fmt.number(value, 2, self.lang)}"
        unit = fmt.unit_symbol(point.unit, lambda name, **given: self.view.text(self.request, name, **given))
        return fmt.quantity(value, point.decimals, unit, self.lang)

    def moment(self, micros: int) -> str:
        if fmt.date(micros, self.zone, self.lang) == fmt.date(self.now, self.zone, self.lang):
            return fmt.clock_time(micros, self.zone, milliseconds=True, lang=self.lang)
        return fmt.date_time(micros, self.zone, self.lang, self.now)

    def _item(self, equipment: str) -> Equipment | None:
        return self.runtime.plant.equipment.get(equipment) if self.runtime.plant else None
