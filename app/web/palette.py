"""The command palette (Ctrl+K): machines, points, alarms, pages, actions and parameters by a few letters of their names.

It only leads somewhere: an action leads to its button on the page of its machine, which is pressed there with all its questions.
"""

import asyncio
import re
import unicodedata
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from urllib.parse import quote

from fastapi import APIRouter, Request
from fastapi.responses import Response

from app.access.kept import FAVOURITE
from app.access.roles import ROLE_PERMISSION, permitted
from app.plant.definitions import Equipment, EquipmentType, Kind, Plant
from app.plant.register_parameters import has_code, unknown
from app.plant.texts import Texts
from app.profidrive.parameter_access.parameter import DriveParameter
from app.web.guard import allow, people_access
from app.web.language import language_of
from app.web.pages import pages_of, view_of
from app.web.view import ENGINEERING, PAGES, address_of_area, area_label, areas

router = APIRouter()

MOST = 24
"""Hits that are shown."""
LONGEST, MOST_WORDS = 80, 6
"""Of what is looked for [characters, words]."""
KINDS = (FAVOURITE.name, "machine", "page", "action", "alarm", "point", "parameter")
"""Of equally good hits these come first."""
SYMBOLS: Mapping[str, str] = {
    FAVOURITE.name: "i-star",
    "machine": "i-wrench",
    "page": "i-right",
    "action": "i-hand",
    "alarm": "i-bell",
    "point": "i-trend",
    "parameter": "i-edit",
}
OTHER_LETTERS = str.maketrans({"đ": "d", "ß": "ss", "ł": "l", "ø": "o", "\u00ad": ""})
"""Letters that no mark can be taken from, and the hyphen that is only seen where a word is parted."""


@dataclass(frozen=True, slots=True)
class Place:
    """Something to be found."""

    kind: str
    label: str
    detail: str
    url: str
    needs: str = "view"
    """Permission."""
    letters: str = ""
    """Label, id and detail, folded; a blank before every word."""
    name: str = ""
    """The label alone, the same."""


@router.get("/palette/found", dependencies=[allow("view")])
async def hits(request: Request, q: str = "") -> Response:
    """What was found; without a word, pages and machines to begin with."""
    looked = q.strip()[:LONGEST]
    found = await _found(request, looked)
    return view_of(request).fragment(request, "fragments/palette_found.html", places=found, q=looked, symbols=SYMBOLS)


async def points_found(request: Request, looked: str, most: int = MOST) -> list[Place]:
    """Points of the plant that have every word of `looked`, best first; their names are the last part of their details."""
    runtime = view_of(request).runtime(request)
    if runtime.plant is None or not looked.strip():
        return []
    places = await asyncio.to_thread(_places_of, request.app.state, runtime.texts, runtime.plant, language_of(request))
    points = [place for place in places if place.kind == "point"]
    return await asyncio.to_thread(ranked, points, looked.strip()[:LONGEST], most)


def folded(text: str) -> str:
    """`text` in small letters without marks: `Greška` and `greska` are the same."""
    plain = unicodedata.normalize("NFD", text.casefold().translate(OTHER_LETTERS))
    return "".join(sign for sign in plain if not unicodedata.combining(sign))


def ranked(places: Iterable[Place], looked: str, most: int = MOST) -> list[Place]:
    """Those that have every word of `looked`, best first: where a word begins before where it only occurs, names before details."""
    words = list(dict.fromkeys(folded(looked).split()))[:MOST_WORDS]
    if not words:
        return [place for place in places if place.kind in (FAVOURITE.name, "machine", "page")][:most]
    found = [(score, place) for place in places if (score := _score(place, words)) is not None]
    order = {kind: index for index, kind in enumerate(KINDS)}
    found.sort(key=lambda one: (one[0], order[one[1].kind], len(one[1].label), one[1].label))
    return [place for _, place in found[:most]]


def _score(place: Place, words: Sequence[str]) -> int | None:
    """The less the better; None when a word is missing."""
    letters, name = place.letters, place.name
    if not all(word in letters for word in words):
        return None
    return sum(0 if f" {word}" in name else 1 if word in name else 2 if f" {word}" in letters else 3 for word in words)


async def _found(request: Request, looked: str) -> list[Place]:
    view = view_of(request)
    runtime, person = view.runtime(request), request.state.person
    if runtime.plant is None:
        return []
    lang = language_of(request)
    places = await asyncio.to_thread(_places_for, request.app.state, runtime.texts, runtime.plant, lang, looked)
    mine = (place for place in places if permitted(person, place.needs, simulated=runtime.simulated))
    marked = people_access(request).kept.of(person.id, FAVOURITE) if person is not None else {}
    favourites = list(marked)
    return await asyncio.to_thread(lambda: ranked(_marked(mine, favourites), looked))


def _marked(places: Iterable[Place], favourites: Sequence[str]) -> list[Place]:
    """`places` with those that somebody marked as favourites first."""
    order = {url: index for index, url in enumerate(favourites)}
    found = [
        replace(place, kind=FAVOURITE.name) if place.url in order and place.kind in ("machine", "page") else place
        for place in places
    ]
    return sorted(found, key=lambda one: order[one.url] if one.kind == FAVOURITE.name else len(order))


def _places_for(state: object, texts: Texts, plant: Plant, lang: str, looked: str) -> Sequence[Place]:
    """Of a large plant this takes its time, so a thread does it."""
    return [*_places_of(state, texts, plant, lang), *_by_code(texts, plant, lang, looked)]


def _places_of(state: object, texts: Texts, plant: Plant, lang: str) -> Sequence[Place]:
    """All places of a plant in a language, collected once for each reading of the plant."""
    kept: dict[str, tuple[Plant, Sequence[Place]]] = state.__dict__.setdefault("places", {})
    known = kept.get(lang)
    if known is None or known[0] is not plant:
        known = kept[lang] = (plant, [_with_letters(place) for place in _places(texts, plant, lang)])
    return known[1]


def destinations(state: object, texts: Texts, plant: Plant, lang: str) -> Mapping[str, Place]:
    """Machines and pages by address, collected once for each reading of the plant."""
    kept: dict[str, tuple[Plant, Mapping[str, Place]]] = state.__dict__.setdefault("destinations", {})
    known = kept.get(lang)
    if known is None or known[0] is not plant:
        places = list(_pages(texts, plant, lang))
        for item in plant.equipment.values():
            places += _pages_of(texts, plant, lang, item)
        known = kept[lang] = (plant, {place.url: place for place in places})
    return known[1]


def _with_letters(place: Place) -> Place:
    name = " " + re.sub(r"\W+", " ", folded(place.label))
    letters = f"{name} {folded(place.detail)}"
    return Place(place.kind, place.label, place.detail, place.url, place.needs, letters, name)


def _places(texts: Texts, plant: Plant, lang: str) -> Iterator[Place]:
    yield from _pages(texts, plant, lang)
    for item in plant.equipment.values():
        yield from _of_machine(texts, plant, lang, item)


def _pages(texts: Texts, plant: Plant, lang: str) -> Iterator[Place]:
    yield Place("page", texts.text(lang, "nav.overview"), "", "/")
    for key, machines in areas(plant).items():
        if len(machines) > 1:
            yield Place("page", area_label(texts, plant, lang, key), "", address_of_area(key, machines))
    for name, screen in plant.screens.items():
        yield Place("page", texts.label(lang, screen.label), "", f"/screens/{name}")
    for key, url in (*PAGES, ("events.title", "/events")):
        yield Place("page", texts.text(lang, key), "", url)
    if plant.lessons:
        yield Place("page", texts.text(lang, "lessons.title"), "", "/lessons", "operate")
    for key, url, needed in ENGINEERING:
        yield Place("page", texts.text(lang, key), texts.text(lang, "nav.engineering"), url, needed)
    yield Place("page", texts.text(lang, "api.title"), texts.text(lang, "nav.engineering"), "/docs", "configure")
    yield Place("page", texts.text(lang, "access.account"), "", "/account", "account")


def _of_machine(texts: Texts, plant: Plant, lang: str, item: Equipment) -> Iterator[Place]:
    name, kind, url = texts.label(lang, item.label) or item.id, item.type, f"/equipment/{quote(item.id)}"
    machine = f"{name} · {item.id}"

    def text(key: str) -> str:
        return texts.of_type(lang, kind, key)

    yield from _pages_of(texts, plant, lang, item)
    yield from _actions(kind, machine, url, text)
    for alarm in item.alarms:
        label = re.sub(r"\s*\{\w+\}", "", text(alarm.label))
        yield Place("alarm", label, machine, f"/alarms?tab=journal&source={quote(item.id)}&q={quote(label)}")
    for point in item.points.values():
        if not point.table:
            trend = point.history and point.kind in (Kind.ANALOG, Kind.STEP, Kind.BOOL)
            leads = f"/trends?tags={quote(point.name)}" if trend else url
            yield Place("point", text(point.label), f"{machine} · {point.name}", leads)
    for parameter in item.type.drive_parameters.values():
        yield _parameter(texts, plant, lang, item, parameter)


def _parameter(texts: Texts, plant: Plant, lang: str, item: Equipment, parameter: DriveParameter) -> Place:
    """A parameter of a drive: its row on the page of all of them."""
    name = f"{parameter.code} {texts.of_type(lang, item.type, parameter.text_key)}"
    machine = f"{texts.label(lang, item.label) or item.id} · {item.id}"
    url = f"/equipment/{quote(item.id)}/drive-parameters?q={quote(parameter.code)}"
    return Place("parameter", name, machine, url, "configure")


def _by_code(texts: Texts, plant: Plant, lang: str, looked: str) -> Iterator[Place]:
    """Parameters of which nothing is known but their codes: in no list, found by a code that is written out."""
    for code in {word.upper() for word in looked.split()}:
        for item in plant.equipment.values():
            map = item.type.device.parameters
            if map is None or code in item.type.drive_parameters or not has_code(map, code):
                continue
            if (found := unknown(code)) is not None:
                yield _with_letters(_parameter(texts, plant, lang, item, found))


def _pages_of(texts: Texts, plant: Plant, lang: str, item: Equipment) -> Iterator[Place]:
    """A machine and its pages."""
    name, kind, url = texts.label(lang, item.label) or item.id, item.type, f"/equipment/{quote(item.id)}"
    machine = f"{name} · {item.id}"
    yield Place("machine", name, f"{item.id} · {texts.of_type(lang, kind, kind.label)}", url)
    for page in pages_of(kind):
        if page:
            yield Place("page", texts.of_type(lang, kind, f"page.{page}"), machine, f"{url}/page/{page}")
    yield Place("page", texts.text(lang, "par.title"), machine, f"{url}/parameters", "diagnose")
    if item.sequence:
        yield Place("page", texts.text(lang, "editor.title"), machine, f"{url}/definition", "configure")
    if plant.links[item.link].simulated:
        instructor = texts.text(lang, "instructor.title")
        yield Place("page", instructor, machine, f"/instructor/{quote(item.id)}", "instruct")


def _actions(kind: EquipmentType, machine: str, url: str, text: Callable[[str], str]) -> Iterator[Place]:
    for command in kind.commands.values():
        needs = "stop" if command.stop else ROLE_PERMISSION[command.role]
        yield Place("action", text(command.label), machine, f"{url}#do-{command.key}", needs)
