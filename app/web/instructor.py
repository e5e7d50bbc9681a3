"""The instructor's page: breaks and loads simulated machines through their training registers; what is active is read back from them.

A machine counts as simulated only when its link says so (the header at 0xE000 was found when it connected) and when the header is there
again right before each write. A live device has no such registers; nothing is ever written to it from here.
"""

import asyncio
from collections.abc import Callable, Collection, Mapping
from typing import Any

from fastapi import APIRouter, Request
from fastapi.responses import RedirectResponse, Response
from starlette.exceptions import HTTPException

from app import bundled
from app.access.audit.kinds import Kind
from app.errors import Refused
from app.links.register_link import RegisterLink
from app.plant.definitions import Equipment, TrainingWord
from app.plant.training import text_of_code
from app.running.instruction import Trainee, Words, look, says_simulated, write
from app.sim import training
from app.sim.plant import SPEEDS
from app.web import format as fmt
from app.web.commands import wants_fragment
from app.web.guard import address_of, allow, fields, people_access, person_of
from app.web.language import language_of
from app.web.pages import plant_of, view_of

router = APIRouter()

TENTHS = "× 0.1 "
"""How the unit of a training register begins that counts tenths."""
LINE_FIELDS: Mapping[str, TrainingWord] = {
    name: TrainingWord(register, *training.COMMON_LIMITS[register], unit)
    for name, register, unit in (
        ("delay", training.REG_LINE_DELAY, "ms"),
        ("argument", training.REG_LINE_ARGUMENT, ""),
        ("count", training.REG_LINE_COUNT, ""),
    )
}
DONE = ("fault", "line", "world", "reset", "speed")


@router.get("/instructor", dependencies=[allow("instruct")])
async def instructor(request: Request) -> Response:
    """All simulated machines, and what is active on each."""
    return await _all(request)


@router.get("/simulation", dependencies=[allow("view")])
async def simulation(request: Request) -> Response:
    """What the top line says of the simulation."""
    runtime = view_of(request).runtime(request)
    return view_of(request).fragment(request, "fragments/simulation.html", simulated=runtime.simulated, sim=runtime.sim)


@router.post("/simulation/speed", dependencies=[allow("instruct")])
async def set_speed(request: Request) -> Response:
    """Have the simulated plant of this server pause, or run as fast as real time or faster. Nothing live is behind it."""
    given = await fields(request, ["speed"], ["back"])
    sim, text = view_of(request).runtime(request).sim, given["speed"].strip()
    old = str(sim.speed) if sim else ""
    refused: Refused | None = None
    if sim is None:
        refused = Refused("instructor.no_speed", 409)
    elif text not in map(str, SPEEDS):
        choice = ", ".join(map(str, SPEEDS))
        refused = Refused("instructor.wrong_speed", 422, value=text[:20] or "–", choice=choice)
    else:
        sim.set_speed(int(text))
    await people_access(request).audit.record(
        "instructor.speed",
        person_of(request),
        "simulation",
        old=old,
        new=text[:20],
        result="refused" if refused else "ok",
        reason=refused.reason if refused else "",
        address=address_of(request.scope),
        **(refused.params if refused else {}),
    )
    back = given["back"] if given["back"] in plant_of(request).equipment else ""
    if refused:
        return await (_page(request, back, refused) if back else _all(request, refused))
    return RedirectResponse(f"/instructor{'/' if back else ''}{back}?done=speed", 303)


def _speeds(request: Request) -> tuple[int, ...]:
    """Speeds that the simulated plant of this server can be given; none while it simulates nothing."""
    return SPEEDS if view_of(request).runtime(request).sim else ()


async def _all(request: Request, refused: Refused | None = None) -> Response:
    runtime = view_of(request).runtime(request)
    items = [item for item in plant_of(request).equipment.values() if says_simulated(runtime.links[item.link], item)]
    rows = [_row(request, one) for one in await asyncio.gather(*(look(link_of(request, item), item) for item in items))]
    view = view_of(request)
    title = view.text(request, "instructor.title")
    return view.page(
        request,
        "pages/instructor.html",
        title=title,
        kind="frame",
        status=refused.status if refused else 200,
        rows=rows,
        chosen=None,
        speeds=_speeds(request),
        error=_said(request, refused),
        done=_done(request, refused, ("speed",)),
    )


@router.get("/instructor/{key}", dependencies=[allow("instruct")])
async def machine(request: Request, key: str) -> Response:
    """One machine: what is active, and what can be done to it."""
    return await _page(request, key)


@router.get("/instructor/{key}/active", dependencies=[allow("instruct")])
async def active(request: Request, key: str) -> Response:
    """What is active on a machine, alone."""
    item = _item(request, key)
    one = await look(link_of(request, item), item)
    return view_of(request).fragment(request, "fragments/instructor_active.html", chosen=_row(request, one))


@router.post("/instructor/{key}/fault", dependencies=[allow("instruct")])
async def set_fault(request: Request, key: str) -> Response:
    """Cause a machine fault, or clear the cause (code 0)."""
    given = await fields(request, ["code"])

    def words(item: Equipment) -> dict[int, int]:
        code = _whole(request, given["code"], "instructor.fault", (0, 0xFFFF))
        if code and code not in item.type.training.faults.values():
            raise Refused("access.form_field", 422, field="code")
        return {training.REG_MACHINE_FAULT: code}

    return await _do(request, key, "instructor.fault", words)


@router.post("/instructor/{key}/line", dependencies=[allow("instruct")])
async def set_line(request: Request, key: str) -> Response:
    """Break the line of one machine, or mend it (mode 0)."""
    given = await fields(request, ["mode"], LINE_FIELDS)

    def words(item: Equipment) -> dict[int, int]:
        mode = training.REG_LINE_FAULT
        return {mode: _whole(request, given["mode"], "instructor.line", training.COMMON_LIMITS[mode])} | {
            word.register: _whole(request, given[name] or "0", f"instructor.{name}", (word.low, word.high))
            for name, word in LINE_FIELDS.items()
        }

    return await _do(request, key, "instructor.line", words)


@router.post("/instructor/{key}/world", dependencies=[allow("instruct")])
async def set_world(request: Request, key: str) -> Response:
    """What its type calls its world: loads, temperatures, what arrives and how long it is."""
    world = _item(request, key).type.training.world
    if not world:
        raise HTTPException(404)
    given = await fields(request, world)

    def words(item: Equipment) -> dict[int, int]:
        return {
            word.register: _whole(request, given[name], f"{item.type.name}.training.{name}", (word.low, word.high))
            for name, word in world.items()
        }

    return await _do(request, key, "instructor.world", words)


@router.get("/instructor/{key}/train", dependencies=[allow("instruct")])
async def train(request: Request, key: str) -> Response:
    """What a screen offers beside the machine itself: deeds of the hand."""
    return await _hands(request, _item(request, key))


@router.post("/instructor/{key}/act", dependencies=[allow("instruct")])
async def act(request: Request, key: str) -> Response:
    """Do something with the hand: what its type lists as acts and switches."""
    given = await fields(request, ["act"], ["value"])
    item = _item(request, key)
    trained, what = item.type.training, given["act"]
    word = trained.acts.get(what) or trained.switches.get(what)
    if word is None:
        raise Refused("access.form_field", 422, field="act")

    def words(item: Equipment) -> dict[int, int]:
        low, high = (word.low, word.high) if what in trained.acts else (1, word.high.bit_length())
        label = f"{item.type.name}.training.{what}"
        return {word.register: low if low == high else _whole(request, given["value"], label, (low, high))}

    return await _do(request, key, "instructor.act", words, act=what)


@router.post("/instructor/{key}/reset", dependencies=[allow("instruct")])
async def reset(request: Request, key: str) -> Response:
    """The device as it was built."""
    await fields(request, [])
    return await _do(request, key, "instructor.reset", lambda item: {training.REG_RESET: 1})


async def _do(
    request: Request, key: str, kind: Kind, words: Callable[[Equipment], Mapping[int, int]], *, act: str = ""
) -> Response:
    """Write, read back, note; the page again when any of it did not happen. A screen gets its own part back instead."""
    item = _item(request, key)
    old = new = ""
    refused: Refused | None = None
    try:
        wanted = words(item)
        new = _told(wanted)
        old = _told(await write(link_of(request, item), item, wanted, act))
    except Refused as error:
        refused = error
    await people_access(request).audit.record(
        kind,
        person_of(request),
        item.id,
        old=old,
        new=new,
        result="refused" if refused else "ok",
        reason=refused.reason if refused else "",
        address=address_of(request.scope),
        **(refused.params if refused else {}),
    )
    if act and wants_fragment(request):
        return await _hands(request, item, act, refused)
    if refused:
        return await _page(request, key, refused)
    return RedirectResponse(f"/instructor/{item.id}?done={act or kind.removeprefix('instructor.')}", 303)


def _whole(request: Request, text: str, label: str, limits: tuple[int, int]) -> int:
    """A whole number within `limits`.

    Raises:
        Refused: 422, it is none.
    """
    low, high = limits
    plain = text.strip()
    if not plain.isascii() or not plain.isdigit() or len(plain) > 6 or not low <= int(plain) <= high:
        what = view_of(request).text(request, label)
        raise Refused("instructor.range", 422, what=what, value=plain[:20] or "–", low=low, high=high)
    return int(plain)


def _told(words: Words) -> str:
    return ", ".join(f"0x{address:04X} = {word}" for address, word in sorted(words.items()))


def link_of(request: Request, item: Equipment) -> RegisterLink:
    """The link of a machine."""
    return view_of(request).runtime(request).links[item.link]


def _item(request: Request, key: str) -> Equipment:
    item = plant_of(request).equipment.get(key)
    if item is None:
        raise HTTPException(404)
    return item


async def _page(request: Request, key: str, refused: Refused | None = None) -> Response:
    view, item = view_of(request), _item(request, key)
    one = await look(link_of(request, item), item)
    drawn = view.machine(request, item)
    return view.page(
        request,
        "pages/instructor.html",
        status=refused.status if refused else 200,
        title=view.text(request, "instructor.title"),
        kind=f"faceplate/{item.id}",
        chip=item.id,
        up="/instructor",
        rows=[],
        chosen=_row(request, one),
        equipment=drawn,
        live=drawn.points(item.type.training.live),
        faults=_faults(request, item),
        modes=[
            (mode, view.text(request, f"instructor.mode.{mode}"), view.text(request, f"instructor.line_sees.{mode}"))
            for mode in training.LINE_FAULT_MODES
            if mode
        ],
        line_fields=_entries(request, LINE_FIELDS, one.words, "instructor"),
        world=_entries(request, item.type.training.world, one.words, f"{item.type.name}.training"),
        hands=_hands_template(item) if one.words else "",
        said="",
        speeds=_speeds(request) if link_of(request, item).link.simulated else (),
        error=_said(request, refused),
        done=_done(request, refused, _deeds(item), item),
    )


def _said(request: Request, refused: Refused | None) -> str:
    return view_of(request).refusal(request, refused) if refused else ""


def _done(request: Request, refused: Refused | None, deeds: Collection[str], item: Equipment | None = None) -> str:
    """What was just done, in words."""
    done = request.query_params.get("done", "")
    if done not in deeds or refused:
        return ""
    told = (
        "instructor.chosen" if done == "speed" else "instructor.confirmed"
    )  # nothing is read back of the server itself
    return view_of(request).text(request, told, what=_deed(request, item, done))


async def _hands(request: Request, item: Equipment, act: str = "", refused: Refused | None = None) -> Response:
    """The deeds of the hand with what is pressed now, and a line of what was just done."""
    view, template = view_of(request), _hands_template(item)
    if not template:
        raise HTTPException(404)
    said = view.text(request, "instructor.confirmed", what=_deed(request, item, act)) if act else ""
    if refused:
        said = view.refusal(request, refused)
    one = await look(link_of(request, item), item)
    return view.fragment(
        request,
        template,
        status=refused.status if refused else 200,
        chosen=_row(request, one),
        equipment=view.machine(request, item),
        said=said,
    )


def _hands_template(item: Equipment) -> str:
    """Template of the deeds of the hand; empty when the type has none."""
    template = f"screens/{item.type.name}/hands.html"
    return template if (bundled("templates") / template).is_file() else ""


def _deeds(item: Equipment) -> frozenset[str]:
    return frozenset((*DONE, *item.type.training.acts, *item.type.training.switches))


def _deed(request: Request, item: Equipment | None, deed: str) -> str:
    """What was done, in words."""
    key = f"instructor.{deed}" if item is None or deed in DONE else f"{item.type.name}.training.{deed}"
    return view_of(request).text(request, key)


def _entries(
    request: Request, table: Mapping[str, TrainingWord], words: Words | None, texts: str
) -> list[tuple[str, str, str, int, int, int]]:
    """(field, its label, unit, now, lowest, highest)."""
    return [
        (
            name,
            view_of(request).text(request, f"{texts}.{name}"),
            word.unit.replace(TENTHS, f"× {fmt.number(0.1, 1, language_of(request))} "),
            words[word.register] if words else 0,
            word.low,
            word.high,
        )
        for name, word in table.items()
    ]


def _amount(raw: int, unit: str, lang: str) -> str:
    """What a training register says, in its unit: of one that counts tenths the number itself."""
    if unit.startswith(TENTHS):
        return f"{fmt.number(raw / 10, 1, lang)}\u00a0{unit.removeprefix(TENTHS)}"
    return f"{raw}\u00a0{unit}"


def _faults(request: Request, item: Equipment) -> list[tuple[int, str, str]]:
    """(code, what the machine calls it, what the trainee sees)."""
    return [
        (code, _code_text(request, item, code), _machine_sees(request, item, code))
        for code in item.type.training.faults.values()
    ]


def _code_text(request: Request, item: Equipment, code: int) -> str:
    names = item.type.training.names
    if not names:
        return _coded(request, item, "training.fault", code) or f"{code}"
    key = item.points[names].texts.get(code, "")
    return view_of(request).runtime(request).texts.of_type(language_of(request), item.type, key) if key else f"{code}"


def _machine_sees(request: Request, item: Equipment, code: int) -> str:
    return _coded(request, item, "training.sees", code)


def _coded(request: Request, item: Equipment, table: str, code: int) -> str:
    """Text of a code, else of its tens or hundreds with {n} for what is behind them, else of any; empty when there is none."""
    key = text_of_code(item.type.texts, table, code)
    texts = view_of(request).runtime(request).texts
    return texts.of_type(language_of(request), item.type, key, n=code % (10 if code < 100 else 100)) if key else ""


def _row(request: Request, one: Trainee) -> dict[str, Any]:
    """A machine with what is active on it, in words."""
    view, words, item = view_of(request), one.words, one.item
    text = view.text
    row: dict[str, Any] = {
        "id": item.id,
        "label": view.machine(request, item).label,
        "problem": text(request, one.problem, machine=item.id, because=one.reason and text(request, one.reason))
        if one.problem
        else "",
        "active": [],
        "fault": 0,
        "mode": 0,
        "world": [],
        "pressed": {},
    }
    if words is None:
        return row
    fault, mode = words[training.REG_MACHINE_FAULT], words[training.REG_LINE_FAULT]
    row |= {"fault": fault, "mode": mode}
    if fault:
        row["active"].append((_code_text(request, item, fault), _machine_sees(request, item, fault)))
    if mode:
        row["active"].append((_line_text(request, words), text(request, f"instructor.line_sees.{mode}")))
    trained = item.type.training
    row["world"] = [
        (
            text(request, f"{item.type.name}.training.{name}"),
            text(request, f"instructor.{'on' if words[word.register] else 'off'}")
            if (word.low, word.high) == (0, 1)
            else _amount(words[word.register], word.unit, language_of(request)),
        )
        for name, word in trained.world.items()
    ]
    row["pressed"] = {
        name: [bool(words[word.register] >> bit & 1) for bit in range(word.high.bit_length())]
        for name, word in trained.switches.items()
    }
    return row


def _line_text(request: Request, words: Words) -> str:
    text = view_of(request).text
    mode, count = words[training.REG_LINE_FAULT], words[training.REG_LINE_COUNT]
    parts = [text(request, f"instructor.mode.{mode}")]
    if mode == 2:
        parts.append(f"{words[training.REG_LINE_DELAY]}\u00a0ms")
    if mode == 7:
        parts.append(f"{words[training.REG_LINE_ARGUMENT]:02d}")
    parts.append(text(request, "instructor.left", n=count) if count else text(request, "instructor.until"))
    return " · ".join(parts)
