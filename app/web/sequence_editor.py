"""The page on which an engineer edits a sequence: its sections as forms, and beside each the text of the file that it is.

Both are views of one draft (running/sequence_drafts.py). What is typed is kept and checked as it is typed, with the checks of `pogon
check`; nothing of the plant changes before it is reviewed and taken (app/web/sequence_taking.py).
"""

import re
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any
from urllib.parse import quote
from zoneinfo import ZoneInfo

from fastapi import APIRouter, Request
from fastapi.responses import RedirectResponse, Response
from starlette.datastructures import UploadFile
from starlette.exceptions import HTTPException

from app import chance
from app.access.audit.line import printable
from app.access.roles import Person
from app.errors import Refused, UnusableFile
from app.plant.definitions import Equipment, Kind, Plant, Scan
from app.plant.sequence_recipe import MOST_VALUES
from app.plant.sequence_text import (
    STEPS,
    TESTS,
    above,
    changes,
    free_bit,
    free_key,
    sections,
    table_of,
    with_section,
)
from app.plant.sequences import ABORT, FOLDER, RUNNING
from app.plant.texts import Texts
from app.plant.toml import TomlRefused, parse
from app.plant.toml_text import CannotEdit, Change, Insert, Put, Remove, Swap, edited
from app.running.sequence_drafts import Draft
from app.web import format as fmt
from app.web import palette
from app.web.guard import allow, fields, person_of
from app.web.language import language_of
from app.web.pages import plant_of, view_of
from app.web.points import EquipmentView
from app.web.sequence_form import Forms

router = APIRouter()

FIELD = r"[a-z_][a-z0-9_]{0,40}(\.[A-Za-z0-9_]{1,40}){0,4}"
COMPARISONS = ("==", "!=", ">", ">=", "<", "<=")
POINTS_SHOWN = 12
WRITES = {"csrf", "tab", "seen", "section", "shown", "do", "text", "next"}
"""Fields of a form that are none of the definition."""


@dataclass(frozen=True, slots=True)
class Editing:
    """A person at the definition of a sequence."""

    person: Person
    equipment: EquipmentView
    plant: Plant
    name: str
    """Of the definition."""
    draft: Draft
    file: str
    """What the file says now."""

    @property
    def item(self) -> Equipment:
        return self.equipment.equipment

    @property
    def data(self) -> Mapping[str, Any] | None:
        """The draft as tables; None while it is no TOML."""
        try:
            return parse(self.draft.text)
        except TomlRefused:
            return None

    @property
    def url(self) -> str:
        return f"/equipment/{quote(self.item.id)}/definition"

    @property
    def changed(self) -> bool:
        """Whether the draft says anything else than the file."""
        return self.draft.text != self.file

    @property
    def overtaken(self) -> bool:
        """Whether somebody else's was taken since the draft was begun."""
        return self.draft.begun and self.draft.base != self.file


async def editing(request: Request, key: str) -> Editing:
    """Who edits what.

    Raises:
        HTTPException: 404, there is no such sequence.
        Refused: 409, its file cannot be read.
    """
    plant, person = plant_of(request), person_of(request)
    item = plant.equipment.get(key)
    if item is None or item.sequence is None:
        raise HTTPException(404)
    drafts, name = view_of(request).runtime(request).drafts, item.sequence.name
    try:
        draft = await drafts.draft(person, name)
        file = await drafts.file(name)
    except UnusableFile as error:
        raise Refused("editor.unreadable", 409, file=f"{FOLDER}/{name}.toml", why=error.found) from error
    return Editing(person, view_of(request).machine(request, item), plant, name, draft, file)


@asynccontextmanager
async def changing(request: Request, key: str) -> AsyncIterator[Editing]:
    """As `editing`, and nobody else changes a draft inside."""
    async with view_of(request).runtime(request).drafts.turn:
        yield await editing(request, key)


# ---- the page ------------------------------------------------------------------------------------------------


@router.get("/equipment/{key}/definition", dependencies=[allow("configure")])
async def editor(request: Request, key: str, section: str = "1") -> Response:
    """The draft of whoever asks, one section as a form and as text."""
    at = await editing(request, key)
    return await _page(request, at, section)


async def _page(request: Request, at: Editing, section: str) -> Response:
    view = view_of(request)
    return view.page(
        request,
        "pages/sequence_editor.html",
        title=view.text(request, "editor.title"),
        chip=at.item.id,
        area=at.item.area,
        tab=chance.token_hex(8),
        seen=at.draft.version,
        **await _shown(request, at, section),
    )


async def _shown(request: Request, at: Editing, section: str) -> dict[str, Any]:
    """What page and fragments show of a draft."""
    runtime = view_of(request).runtime(request)
    problems = await runtime.plant_files.check({at.name: at.draft.text})
    parts = sections(at.draft.text)
    part = next((one for one in parts if one.key == section), parts[0])
    forms = Forms(at.equipment, at.plant, at.data, problems)
    return {
        "at": at,
        "url": at.url,
        "part": part,
        "places": forms.places(parts),
        "form": forms.form(part.key, broken=at.data is None),
        "problems": [(one, forms.place(one, parts)) for one in forms.problems],
        "elsewhere": forms.elsewhere,
        "others": await runtime.drafts.others(at.person, at.name),
        "users": [one.id for one in at.plant.equipment.values() if one.sequence and one.sequence.name == at.name],
        "runs": runtime.plant_files.who_runs(at.name),
        "running": ",".join(str(value) for value in RUNNING),
        "read_only": read_only(request, at),
        "file": f"{FOLDER}/{at.name}.toml",
        "steps": sum(part.key not in ("0", TESTS) for part in parts),
        "when": partial(when, request),
    }


def read_only(request: Request, at: Editing) -> str:
    """The folder in which nothing can be taken, since it is not this server's to write in; empty where it is."""
    runtime = view_of(request).runtime(request)
    path = runtime.drafts.path(at.name)
    return str(path.parent) if runtime.plant_files.read_only(path) else ""


def when(request: Request, micros: int) -> str:
    """A moment as the page writes it."""
    runtime = view_of(request).runtime(request)
    zone = ZoneInfo(runtime.plant.timezone if runtime.plant else "UTC")
    return fmt.moment_or_time(micros, zone, language_of(request), runtime.clock.micros())


@router.get("/equipment/{key}/definition/now", dependencies=[allow("configure")])
async def now(request: Request, key: str, section: str = "1", bit: str = "0") -> Response:
    """Whether a permissive or abort condition of the draft holds now; drawn anew when a point that it names says something else.

    Raises:
        HTTPException: 404, the draft has no such condition.
    """
    at = await editing(request, key)
    form = Forms(at.equipment, at.plant, at.data, ()).form(section, broken=at.data is None)
    found = next((one for one in form.bits if one.bit == bit), None)
    if found is None:
        raise HTTPException(404)
    return view_of(request).fragment(request, "fragments/editor_now.html", bit=found)


# ---- what is typed -------------------------------------------------------------------------------------------


@router.post("/equipment/{key}/definition/fields", dependencies=[allow("configure")])
async def typed(request: Request, key: str) -> Response:
    """Take the fields of a form into the draft, and say what is wrong now."""
    given = await _given(request)
    async with changing(request, key) as before:
        at = await _with_fields(request, before, given)
    shown = await _shown(request, at, given["section"])
    moved = at.draft.text != before.draft.text  # else whoever types in the text by now is left alone
    return view_of(request).fragment(request, "fragments/editor_after_fields.html", moved=moved, **shown)


@router.post("/equipment/{key}/definition/text", dependencies=[allow("configure")])
async def written(request: Request, key: str) -> Response:
    """Take the text of a section into the draft, right or wrong, and say what is wrong now."""
    given = await _given(request)
    async with changing(request, key) as before:
        at = await _with_text(request, before, given)
    moved = at.draft.text != before.draft.text  # else whoever types in a field by now is left alone
    shown = await _shown(request, at, given["section"])
    return view_of(request).fragment(
        request,
        "fragments/editor_after_text.html",
        moved=moved,
        tab=printable(given["tab"], 32),
        seen=printable(given["seen"], 9),
        **shown,
    )


@router.post("/equipment/{key}/definition/do", dependencies=[allow("configure")])
async def do(request: Request, key: str) -> Response:
    """Add, remove or move something; what was typed in the form beside it is taken first."""
    given = await _given(request)
    async with changing(request, key) as before:
        at = await (_with_text if "text" in given else _with_fields)(request, before, given)
        what, _, which = given.get("do", "").partition(":")
        texts = view_of(request).runtime(request).texts
        made, section = _asked(at, texts, _tables(at), given["section"], what, which)
        if made:
            await _keep(request, at, given, _edited(at, made))
    return RedirectResponse(f"{at.url}?section={quote(section)}", 303)


@router.post("/equipment/{key}/definition/condition", dependencies=[allow("configure")])
async def condition(request: Request, key: str) -> Response:
    """A new permissive, or abort condition, about a point that was looked for."""
    given = await fields(request, ["tab", "seen", "section", "point", "is", "value"])
    async with changing(request, key) as at:
        bit = await _with_condition(request, at, given)
    return RedirectResponse(f"{at.url}?section={quote(given['section'])}#b-{bit}", 303)


async def _with_condition(request: Request, at: Editing, given: Mapping[str, str]) -> int:
    """The number of the bit that it becomes."""
    data, section = _tables(at), given["section"]
    table = _table_of(data, section)
    bit, point = free_bit(table, section), at.plant.equipment
    id, _, name = given["point"].partition(".")
    found = point[id].points.get(name) if id in point else None
    if found is None or given["is"] not in COMPARISONS:
        raise Refused("access.form_field", 422, field="point")
    if bit is None:
        raise Refused("editor.no_bit", 409)
    own = id == at.item.machine and found.register is not None
    written = name if own else given["point"]
    value = given["value"].strip().replace(",", ".")
    texts = view_of(request).runtime(request).texts
    labels = {
        language: f"{texts.label(language, point[id].label)}: {texts.of_type(language, point[id].type, found.label)}"
        for language in at.plant.languages
    }
    word = _word(table, section)
    taken = [str(one.get("key", "")) for one in word.values() if isinstance(one, Mapping)]
    made: dict[str, Any] = {"key": free_key(taken, name), "label": labels, "when": f"{written} {given['is']} {value}"}
    if found.kind is Kind.ANALOG:
        made["value"] = written
    path = (*above(section), ABORT if section == "0" else "permissives", str(bit))
    await _keep(request, at, given, _edited(at, [Put(path, made)]))
    return bit


@router.get("/equipment/{key}/definition/points", dependencies=[allow("configure")])
async def points(
    request: Request, key: str, q: str = "", section: str = "1", tab: str = "", seen: str = ""
) -> Response:
    """Points of the plant by a few letters, with what they say now."""
    at = await editing(request, key)
    found = []
    for place in await palette.points_found(request, q, POINTS_SHOWN * 3):
        id, _, name = place.detail.rpartition(" · ")[2].partition(".")
        machine = at.equipment.other(id)
        point = machine.equipment.points.get(name) if machine else None
        if machine is None or point is None or point.kind is Kind.TEXT:
            continue
        if point.register is not None and point.scan in (Scan.PAGE, Scan.ONCE):
            continue
        found.append((machine, machine.point(name)))
    view = view_of(request)
    return view.fragment(
        request,
        "fragments/editor_points.html",
        url=at.url,
        found=found[:POINTS_SHOWN],
        q=q.strip(),
        part_key=section,
        tab=printable(tab, 32),
        seen=printable(seen, 9),
        comparisons=COMPARISONS,
    )


@router.post("/equipment/{key}/definition/discard", dependencies=[allow("configure")])
async def discard(request: Request, key: str) -> Response:
    """Forget the draft: the file as it is."""
    at = await editing(request, key)
    await fields(request, [])
    await view_of(request).runtime(request).drafts.discard(at.person, at.name)
    return RedirectResponse(at.url, 303)


@router.post("/equipment/{key}/definition/rebase", dependencies=[allow("configure")])
async def rebase(request: Request, key: str) -> Response:
    """Go on with the draft although another one was taken since: what it differs in is shown before it is taken."""
    at = await editing(request, key)
    await fields(request, [])
    await view_of(request).runtime(request).drafts.rebase(at.person, at.name)
    return RedirectResponse(f"{at.url}/review", 303)


# ---- details -------------------------------------------------------------------------------------------------


async def _given(request: Request) -> dict[str, str]:
    """The fields of a form, each once.

    Raises:
        Refused: 422, one of them is none of ours.
    """
    form = await request.form()
    found: dict[str, str] = {}
    for name, value in form.multi_items():
        plain = name in WRITES or re.fullmatch(FIELD, name)
        if isinstance(value, UploadFile) or not plain or (name in found and name != "shown"):
            raise Refused("access.form_field", 422, field=printable(name, 40))
        found[name] = value
    for name in ("tab", "seen", "section"):
        if name not in found:
            raise Refused("access.form_field", 422, field=name)
    return found


async def _with_fields(request: Request, at: Editing, given: Mapping[str, str]) -> Editing:
    data = at.data
    if data is None or given["section"] == TESTS:
        return at
    typed = {name: value for name, value in given.items() if name not in WRITES}
    if not typed:
        return at
    try:
        made = changes(data, given["section"], typed, given.get("shown", "").split(), at.plant.languages)
    except LookupError as error:
        raise Refused("editor.gone", 409) from error
    return await _keep(request, at, given, _edited(at, made)) if made else at


async def _with_text(request: Request, at: Editing, given: Mapping[str, str]) -> Editing:
    if "text" not in given:
        raise Refused("access.form_field", 422, field="text")
    try:
        text = with_section(at.draft.text, given["section"], given["text"])
    except LookupError as error:
        raise Refused("editor.gone", 409) from error
    return await _keep(request, at, given, text) if text != at.draft.text else at


async def _keep(request: Request, at: Editing, given: Mapping[str, str], text: str) -> Editing:
    seen = int(given["seen"]) if given["seen"].isdecimal() and len(given["seen"]) < 10 else -1
    drafts = view_of(request).runtime(request).drafts
    draft = await drafts.save(at.person, at.name, at.draft, text, tab=given["tab"][:32], seen=seen)
    return Editing(at.person, at.equipment, at.plant, at.name, draft, at.file)


def _edited(at: Editing, made: list[Change]) -> str:
    try:
        return edited(at.draft.text, made)
    except CannotEdit as error:
        raise Refused("editor.by_text", 409, place=error.where) from error
    except (TomlRefused, LookupError) as error:
        raise Refused("editor.gone", 409) from error


def _tables(at: Editing) -> Mapping[str, Any]:
    data = at.data
    if data is None:
        raise Refused("editor.no_toml", 409)
    return data


def _table_of(data: Mapping[str, Any], section: str) -> Mapping[str, Any]:
    try:
        return table_of(data, section)
    except LookupError as error:
        raise Refused("editor.gone", 409) from error


def _word(table: Mapping[str, Any], section: str) -> Mapping[str, Any]:
    found = table.get(ABORT if section == "0" else "permissives", {})
    return found if isinstance(found, Mapping) else {}


def _asked(
    at: Editing, texts: Texts, data: Mapping[str, Any], section: str, what: str, which: str
) -> tuple[list[Change], str]:
    """What a button changes, and the section that is shown then."""
    rows = data.get(STEPS, [])
    rows = rows if isinstance(rows, list) else []
    if what == "add_step":
        place = int(section) if section.isdecimal() and len(section) < 6 else len(rows)
        taken = [str(row.get("key", "")) for row in rows if isinstance(row, Mapping)]
        label = {language: texts.text(language, "editor.new_step") for language in at.plant.languages}
        made: dict[str, Any] = {"key": free_key([*taken, ABORT], "step"), "label": label, "minimum": 1, "maximum": 60}
        return [Insert((STEPS,), place, made)], str(place + 1)
    table = _table_of(data, section)
    path, number = above(section), int(section) - 1
    match what:
        case "remove_step" if section != "0":
            return [Remove((STEPS,), number)], str(max(1, min(number + 1, len(rows) - 1)) if len(rows) > 1 else 0)
        case "up" if number > 0:
            return [Swap((STEPS,), number - 1)], str(number)
        case "down" if 0 <= number < len(rows) - 1:
            return [Swap((STEPS,), number)], str(number + 2)
        case "add_bit":
            bit = free_bit(table, section)
            if bit is None:
                raise Refused("editor.no_bit", 409)
            label = {language: texts.text(language, "editor.new_bit") for language in at.plant.languages}
            taken = [str(one.get("key", "")) for one in _word(table, section).values() if isinstance(one, Mapping)]
            made = {"key": free_key(taken, f"bit_{bit}"), "label": label, "when": ""}
            return [Put((*path, ABORT if section == "0" else "permissives", str(bit)), made)], section
        case "remove_bit" if which in _word(table, section):
            return [Put((*path, ABORT if section == "0" else "permissives", which), None)], section
        case "add_order" if section != "0":
            others = [one for one in at.plant.equipment.values() if one.type.orders and one.id != at.item.id]
            if not others:
                raise Refused("editor.no_orders", 409)
            action = next(iter(others[0].type.orders.values()))
            made = {"machine": others[0].id, "action": action.key}
            if action.values:
                least = {one.name: float(one.low) for one in action.arguments}
                made["values"] = {name: int(least.get(name, 0)) for name in action.values}
            orders = table.get("orders", [])
            return [Insert((*path, "orders"), len(orders) if isinstance(orders, list) else 0, made)], section
        case "add_recipe" | "add_branches" | "add_loops" if section == "0":
            name = what.removeprefix("add_")
            return [Insert((name,), len(_list(data, name)), _new_row(at, texts, data, name))], section
        case "remove_recipe" | "remove_branches" | "remove_loops" if (
            section == "0" and which.isdecimal() and len(which) < 6
        ):
            name = what.removeprefix("remove_")
            return [Remove((name,), int(which))] if int(which) < len(_list(data, name)) else [], section
        case "remove_order" if which.isdecimal() and len(which) < 6 and section != "0":
            return [Remove((*path, "orders"), int(which))], section
    return [], section


def _list(data: Mapping[str, Any], name: str) -> list[Any]:
    found = data.get(name, [])
    return found if isinstance(found, list) else []


def _new_row(at: Editing, texts: Texts, data: Mapping[str, Any], name: str) -> dict[str, Any]:
    """A new value of a run, branch or loop, to be filled in; what does not fit the steps, the check names.

    Raises:
        Refused: 409, no more fit, or there are too few steps.
    """
    keys = [str(row.get("key", "")) for row in _list(data, STEPS) if isinstance(row, Mapping)]
    if name == "recipe":
        rows = _list(data, name)
        if len(rows) >= MOST_VALUES:
            raise Refused("editor.no_value", 409, most=MOST_VALUES)
        taken = [str(row.get("key", "")) for row in rows if isinstance(row, Mapping)]
        label = {language: texts.text(language, "editor.new_value") for language in at.plant.languages}
        return {"key": free_key(taken, "value"), "label": label, "minimum": 0, "maximum": 100, "default": 0}
    if len(keys) < (4 if name == "branches" else 2):
        raise Refused("editor.few_steps", 409)
    if name == "loops":
        return {"from": keys[0], "to": keys[1], "times": 2}
    return {"after": keys[0], "take": "first", "paths": keys[1:3], "then": keys[3]}
