"""Between a draft of a sequence and the plant: what it changes in words, its reason, and taking it; and what was taken before.

A revision that was taken is the text of the file as it was. Going back to one makes a draft of it, which is reviewed and taken as any
other.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from fastapi import APIRouter, Request
from fastapi.responses import RedirectResponse, Response
from starlette.exceptions import HTTPException

from app.access.audit.line import printable
from app.errors import Refused
from app.plant.sequence_differences import Difference, differences
from app.plant.toml import TomlRefused, parse
from app.running.plant_files import Reading
from app.running.sequence_drafts import OVERTAKEN, Revision
from app.web.guard import address_of, allow, fields
from app.web.pages import view_of
from app.web.plant import drawn
from app.web.sequence_editor import Editing, editing, read_only, when
from app.web.sequence_trying import trial_of

router = APIRouter()

LEAST_REASON, LONGEST_REASON = 3, 300


@router.get("/equipment/{key}/definition/review", dependencies=[allow("configure")])
async def review(request: Request, key: str) -> Response:
    """What taking the draft would change."""
    at = await editing(request, key)
    return await _review(request, at)


@router.post("/equipment/{key}/definition/take", dependencies=[allow("configure")])
async def take(request: Request, key: str) -> Response:
    """Take the draft as the plant's next revision: what was shown, with a reason."""
    given = await fields(request, ["digest", "version", "reason"], ["read"])
    at = await editing(request, key)
    reason = " ".join(given["reason"].split())
    if not LEAST_REASON <= len(reason) <= LONGEST_REASON:
        return await _review(request, at, 422, "editor.refused.reason", reason=reason)
    if not given["read"]:
        return await _review(request, at, 422, "plant.refused.unread", reason=reason)
    if at.overtaken:
        return await _review(request, at, 409, OVERTAKEN, reason=reason)
    if given["version"] != str(at.draft.version) or not at.changed:
        return await _review(request, at, 409, "plant.refused.other", reason=reason)
    runtime, drafts = view_of(request).runtime(request), view_of(request).runtime(request).drafts
    readings: list[Reading] = []

    async def into() -> bool:
        text, address = at.draft.text, address_of(request.scope)
        path, digest, former = drafts.path(at.name), given["digest"], at.draft.base
        readings.append(
            await runtime.plant_files.take_definition(at.person, path, text, digest, reason, address, former=former)
        )
        return readings[-1].done

    try:
        revision = await drafts.take(at.person, at.name, at.draft, reason, into)
    except Refused as refusal:
        return await _review(request, at, refusal.status, refusal.reason, reason=reason)
    if revision is None:
        return await _review(request, at, 409, readings[-1].refused, reading=readings[-1], reason=reason)
    return RedirectResponse(f"{at.url}/history?done={revision.number}", 303)


@router.get("/equipment/{key}/definition/history", dependencies=[allow("configure")])
async def history(request: Request, key: str, a: str = "", b: str = "", done: str = "") -> Response:
    """The revisions of the definition, and what differs between two of them."""
    at = await editing(request, key)
    view = view_of(request)
    revisions = await view.runtime(request).drafts.revisions(at.name)
    texts = {str(one.number): one.text for one in revisions} | {"file": at.file}
    running = next((str(one.number) for one in revisions if one.text == at.file), "file")
    newer = b if b in texts else running
    older = a if a in texts else _before(revisions, newer)
    compared = older in texts and newer in texts and older != newer
    return view.page(
        request,
        "pages/sequence_history.html",
        title=view.text(request, "editor.history"),
        chip=at.item.id,
        area=at.item.area,
        at=at,
        url=at.url,
        revisions=[(one, when(request, one.taken)) for one in revisions],
        running=running,
        older=older,
        newer=newer,
        numbers=[*(["file"] if running == "file" else []), *(str(one.number) for one in revisions)],
        differences=_words(request, at, texts[older], texts[newer]) if compared else [],
        compared=compared,
        done=done if done.isdecimal() and done in texts else "",
    )


@router.post("/equipment/{key}/definition/restore", dependencies=[allow("configure")])
async def restore(request: Request, key: str) -> Response:
    """A former revision becomes the draft of whoever asks; a draft that says anything else has to be given up knowingly."""
    given = await fields(request, ["number"], ["over"])
    at = await editing(request, key)
    drafts = view_of(request).runtime(request).drafts
    found = next((one for one in await drafts.revisions(at.name) if str(one.number) == given["number"]), None)
    if found is None:
        raise HTTPException(404)
    if at.changed and not given["over"]:
        raise Refused("editor.refused.draft", 409)
    async with drafts.turn:
        await drafts.discard(at.person, at.name)
        fresh = await drafts.draft(at.person, at.name)
        await drafts.save(at.person, at.name, fresh, found.text, tab="restored", seen=0)
    return RedirectResponse(f"{at.url}/review", 303)


async def _review(
    request: Request,
    at: Editing,
    status: int = 200,
    refused: str = "",
    *,
    reading: Reading | None = None,
    reason: str = "",
) -> Response:
    view = view_of(request)
    runtime = view.runtime(request)
    error = reading.error if reading else ""
    if reading is None or not reading.digest:
        reading = await runtime.plant_files.review({at.name: at.draft.text})
    own = [id for id, item in at.plant.equipment.items() if item.sequence and item.sequence.name == at.name]
    return view.page(
        request,
        "pages/sequence_review.html",
        status=status,
        title=view.text(request, "editor.review_title"),
        chip=at.item.id,
        area=at.item.area,
        at=at,
        url=at.url,
        reading=reading,
        differences=_words(request, at, at.file, at.draft.text),
        changes=[drawn(request, change) for change in reading.changes if change.name in own],
        others=[drawn(request, change) for change in reading.changes if change.name not in own],
        runs=runtime.plant_files.who_runs(at.name),
        read_only=read_only(request, at),
        refused=view.text(request, refused, name=printable(error, 200)) if refused else "",
        error=error,
        reason=reason,
        **trial_of(request, at),
    )


def _before(revisions: Sequence[Revision], number: str) -> str:
    older = [one.number for one in revisions if number == "file" or one.number < int(number)]
    return str(max(older)) if older else ""


def _words(request: Request, at: Editing, old: str, new: str) -> list[str]:
    """The differences as sentences."""
    try:
        found = differences(parse(old), parse(new))
    except TomlRefused:
        return [view_of(request).text(request, "editor.no_toml")]
    return [_sentence(request, at, one) for one in found]


def _sentence(request: Request, at: Editing, one: Difference) -> str:
    text = view_of(request).text
    place = ""
    if one.step:
        label = one.label if isinstance(one.label, str) else at.equipment.words(_texts(one.label))
        place = text(request, "editor.diff.step", name=label or one.step)
    if one.part and one.part != "step":
        part = text(request, f"editor.diff.{one.part}", name=one.name)
        place = f"{place} · {part}" if place else part
    if one.kind == "order":
        return text(request, "editor.diff.order", old=one.old, new=one.new)
    if one.kind in ("added", "removed"):
        what = one.new or one.old
        return text(request, f"editor.diff.{one.kind}", place=place) + (f" ({what})" if what else "")
    if not one.key:
        return text(request, "editor.diff.changed", place=place)
    key, _, language = one.key.partition(".")
    known = f"editor.key.{key}"
    named = text(request, known) if view_of(request).runtime(request).texts.has("en", known) else key
    named = f"{named} ({language})" if language else named
    line = text(request, "editor.diff.value", key=named, old=one.old or "–", new=one.new or "–")
    return f"{place}: {line}" if place else line


def _texts(label: object) -> Mapping[str, Any]:
    return {key: item for key, item in label.items() if isinstance(item, str)} if isinstance(label, Mapping) else {}
