"""Templates and what all of them need: language, theme, person, areas, clock, the addresses of static files.

A language has an environment of its own, so that macros say `_("nav.home")` whether or not they are imported with context. Templates get
`_`, `lang`, `asset`, `screen_assets`, `label`, `type_text`, `fmt` (app/web/format.py), `Scale` (app/web/drawing.py) and what types
bring (app/web/screens) everywhere, and the names of `_surroundings` on a page.
"""

import asyncio
import fnmatch
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from types import CodeType
from typing import TYPE_CHECKING, Any
from urllib.parse import quote
from zoneinfo import ZoneInfo

from fastapi import Request
from fastapi.responses import HTMLResponse
from jinja2 import BytecodeCache, Environment, FileSystemLoader, StrictUndefined, meta, nodes
from jinja2.bccache import Bucket
from starlette.requests import HTTPConnection
from starlette.types import Receive, Scope, Send

from app import bundled
from app.access.roles import Person, permitted
from app.clock import to_datetime
from app.errors import Refused
from app.plant.cldr import conventions
from app.plant.definitions import Equipment, EquipmentType, Plant
from app.plant.said import in_words
from app.plant.texts import Texts
from app.running.page_tags import force_names
from app.tags.quality import is_bad
from app.web import format as fmt
from app.web import tiles, typed_time
from app.web.alarm_view import Drawing, marks_json
from app.web.assets import Assets
from app.web.compiled import FOLDER, OPTIONS, KeptCode
from app.web.drawing import Scale
from app.web.language import HTML, NAMES, YEAR, language_of, place_of
from app.web.plain_screen import PlainScreen
from app.web.points import EquipmentView, live_texts
from app.web.screens import template_names

if TYPE_CHECKING:
    from app.runtime import Runtime

THEMES = ("light", "dark", "auto")
THEME_COOKIE = "pogon_theme"
PROFILES = ("desk", "panel-10", "panel-9", "panel-7", "gloves")
PROFILE_COOKIE = "pogon_profile"
PANEL_COOKIE = "pogon_panel"
"""Panel mode: a screen that is only touched, without the bars of a browser."""
PANEL = ("0", "1")

PIECE = 8192
"""So much of a page is drawn in a turn of the loop [characters]: some 4 ms."""
HTMX = {
    "mode": "same-origin",
    "history": False,
    "includeIndicatorCSS": False,
    "noSwap": [204, 304, "4xx", "5xx"],
    "extensions": "pogon",
    "defaultTimeout": 10000,
    "morphIgnore": ["data-htmx-powered", "aria-selected", "open"],
}
"""htmx 4: requests to this server only, no cache of pages, no style of its own, errors are never swapped in (app.js shows them in the
message line), no extension but ours, which turns evaluation, `hx-on` and scripts in fragments off."""

PAGES: tuple[tuple[str, str], ...] = (
    ("nav.trends", "/trends"),
    ("nav.alarms", "/alarms"),
)
"""Tabs after the areas: text key, address. A page that does not exist has no tab."""

ENGINEERING: tuple[tuple[str, str, str], ...] = (
    ("nav.communication", "/communication", "diagnose"),
    ("storage.title", "/storage", "diagnose"),
    ("plant.title", "/plant", "configure"),
    ("instructor.title", "/instructor", "instruct"),
    ("audit.title", "/audit", "audit.own"),
    ("access.users", "/users", "administer"),
    ("access.tokens", "/tokens", "tokens"),
)
"""Pages under the tab of engineering: text key, address, permission. Who may see none of them has no such tab; it leads to the first."""

COUNTS: tuple[tuple[str, str, tuple[str, ...], str], ...] = (
    ("i-shelve", "frame.hidden_alarms", ("sys.alarms.hidden",), "f-hidden"),
    ("i-link", "frame.links", ("sys.links_up", "sys.links_total"), "f-comm"),
)
"""At the right of the message line: symbol, text key, tags, class."""


@dataclass(frozen=True, slots=True)
class Tab:
    """A place one can go to."""

    label: str
    url: str
    current: bool = False
    area: str = ""
    """Area whose alarms it shows."""


@dataclass(frozen=True, slots=True)
class Message:
    """What the message line says first: the outcome of what was just asked."""

    text: str
    kind: str = "info"
    """info, done or error."""
    time: str = ""


class Compiled(BytecodeCache):
    """What templates were compiled to. A language says nothing about that, so it is done once for all of them, and for later starts."""

    def __init__(self, kept: KeptCode | None = None) -> None:
        """`kept`: also from one start to the next."""
        self._kept = kept
        self._code: dict[tuple[str, str], CodeType | None] = {}
        self.ready: dict[str, Sequence[str]] = {}
        """Templates of which everything that they name is compiled → the values of a page that name one more."""
        self.names: dict[str, list[str]] = {}
        """File of a template → the templates that it names, as `_named` writes them."""

    def load_bytecode(self, bucket: Bucket) -> None:
        bucket.code = self._code.get((bucket.key, bucket.checksum))
        if bucket.code is None and self._kept and (found := self._kept.read(bucket.key, bucket.checksum)):
            names, code = found
            self.names[code.co_filename] = names
            self._code[bucket.key, bucket.checksum] = bucket.code = code

    def dump_bytecode(self, bucket: Bucket) -> None:
        self._code[bucket.key, bucket.checksum] = code = bucket.code
        if self._kept and code is not None and code.co_filename in self.names:
            self._kept.write(bucket.key, bucket.checksum, self.names[code.co_filename], code)


COMPILED = Compiled(KeptCode(FOLDER))
VALUE = "="
"""Before the name of a value that names a template."""


class Drawn(HTMLResponse):
    """A page that is drawn when it is sent, a piece in each turn of the loop: a plant of hundreds of machines holds nobody up."""

    def __init__(self, environment: Environment, template: str, context: Mapping[str, Any], status: int) -> None:
        super().__init__(None, status)
        self._environment = environment
        self._template = template
        self._context = context

    async def draw(self) -> bytes:
        """The whole of it."""
        todo = [self._template]
        for name in todo:
            if name not in COMPILED.ready:
                COMPILED.ready[name] = await asyncio.to_thread(_compile, self._environment, name)
            todo += {self._context[value] for value in COMPILED.ready[name] if self._context.get(value)}.difference(
                todo
            )
        pieces, since = list[str](), 0
        for piece in self._environment.get_template(self._template).generate(self._context):
            pieces.append(piece)
            since += len(piece)
            if since >= PIECE:
                since = 0
                await asyncio.sleep(0)
        return "".join(pieces).replace("\x00", "\ufffd").encode()  # a nul that was typed, as a browser would show it

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        self.body = await self.draw()
        self.headers["content-length"] = str(len(self.body))
        await super().__call__(scope, receive, send)


def _compile(environment: Environment, template: str) -> Sequence[str]:
    """Compile `template` and all that it names; returns the values of a page that name one more."""
    todo, seen, values = [template], set[str](), set[str]()
    while todo:
        name = todo.pop()
        if name in seen or environment.loader is None:
            continue
        seen.add(name)
        if name.startswith(VALUE):
            values.add(name.removeprefix(VALUE))
        elif "*" in name:
            todo += fnmatch.filter(environment.list_templates(extensions=["html"]), name)
        else:
            file = environment.get_template(name).filename
            todo += COMPILED.names[file] if file else []
    return sorted(values)


def _named(source: nodes.Template) -> list[str]:
    """The templates that a template names: as they are called, as a pattern (`screens/*/tile.html`), or as a value of a page (`=body`)."""
    found = [name for name in meta.find_referenced_templates(source) if name]
    for one in source.find_all((nodes.Include, nodes.FromImport, nodes.Import, nodes.Extends)):
        called: nodes.Expr = one.template  # type: ignore[attr-defined]
        choices = called.items if isinstance(called, nodes.List) else [called]
        for choice in choices:
            if isinstance(choice, nodes.Name):
                found.append(f"{VALUE}{choice.name}")
            elif isinstance(choice, nodes.Concat):
                found.append(
                    "".join(str(part.value) if isinstance(part, nodes.Const) else "*" for part in choice.nodes)
                )
            elif isinstance(choice, nodes.Const):
                found.append(choice.value)
    if any(
        isinstance(one.node, nodes.Name) and one.node.name in tiles.FUNCTIONS for one in source.find_all(nodes.Call)
    ):
        found += tiles.TEMPLATES
    return list(dict.fromkeys(found))


class Templates(Environment):
    """Jinja, which also notes what a template names while it compiles it: to parse it for that would take as long again."""

    def _generate(
        self, source: nodes.Template, name: str | None, filename: str | None, defer_init: bool = False
    ) -> str:
        if filename is not None:
            COMPILED.names[filename] = _named(source)
        return super()._generate(source, name, filename, defer_init)


def templates() -> Templates:
    """Our templates, without what a language adds to them."""
    return Templates(
        loader=FileSystemLoader(bundled("templates")),
        undefined=StrictUndefined,
        auto_reload=False,
        cache_size=-1,
        bytecode_cache=COMPILED,
        **OPTIONS,
    )


Around = Callable[[Request, str], Mapping[str, Any]]


class View:
    """Renders pages and fragments."""

    def __init__(self, assets: Assets) -> None:
        self.assets = assets
        self.build = assets.build
        self._environments: dict[str, tuple[Texts, Environment]] = {}
        self._product = Texts.read()
        self.around: list[Around] = []
        """What parts of the house add to every frame: asked with the request and the language."""

    def page(self, request: Request, template: str, *, status: int = 200, title: str, **context: Any) -> HTMLResponse:
        """`template` in the frame. `title` is the one h1; `kind` says which live page it is (running/page_tags.py), `area` which tab."""
        return self._render(request, template, status, {"title": title, **context}, frame=True)

    def fragment(self, request: Request, template: str, *, status: int = 200, **context: Any) -> HTMLResponse:
        """`template` alone, for htmx."""
        return self._render(request, template, status, context, frame=False)

    async def markup(self, request: Request, template: str, **context: Any) -> bytes:
        """`template` alone, to be kept and sent more than once."""
        return await self._render(request, template, 200, context, frame=False).draw()

    def text(self, request: HTTPConnection, key: str, /, **params: object) -> str:
        """The product's text `key` in the language of `request`."""
        return self._texts(request).text(language_of(request), key, **params)

    def refusal(self, request: HTTPConnection, refused: Refused) -> str:
        """Why not, in the language of `request`: what was typed is repeated as it can be read."""
        written = fmt.parameters(refused.params, language_of(request), partial(self.text, request))
        return self.text(request, refused.reason, **written)

    def languages(self, request: HTTPConnection) -> Sequence[str]:
        """Languages that a person may choose here."""
        return self._texts(request).languages

    def runtime(self, request: HTTPConnection) -> "Runtime":
        """The running plant."""
        runtime: Runtime = request.app.state.runtime
        return runtime

    def machine(self, request: HTTPConnection, equipment: Equipment) -> EquipmentView:
        """`equipment` as templates see it."""
        lang = language_of(request)
        return EquipmentView(equipment, self.runtime(request), lang, partial(self._texts(request).text, lang))

    def _texts(self, request: HTTPConnection) -> Texts:
        runtime = self.runtime(request)
        return runtime.texts if runtime.plant else self._product

    def _render(self, request: Request, template: str, status: int, context: dict[str, Any], *, frame: bool) -> "Drawn":
        lang = language_of(request)
        environment = self._environment(self._texts(request), lang)
        if taken := environment.globals.keys() & context.keys():
            raise TypeError(f"{template}: {', '.join(sorted(taken))}, expected names that no template has anyway")
        values: dict[str, Any] = {
            "status": status,
            "csrf": getattr(request.state, "csrf", ""),
            "person": getattr(request.state, "person", None),
        }
        if frame:
            values |= self._surroundings(request, lang, context)
            for around in self.around:
                told = around(request, lang)
                if taken := told.keys() & context.keys():
                    raise TypeError(
                        f"{template}: {', '.join(sorted(taken))}, expected names that the frame does not have"
                    )
                values |= told
            if over := getattr(
                request.state, "over", ""
            ):  # others ended the session: that goes before what became of the last command
                told = {"kind": "error", "time": values["now_time"], "text": self.text(request, f"access.over.{over}")}
                context = context | {"message": told}
        drawn = Drawn(environment, template, values | context, status)
        if frame and (panel := request.query_params.get("panel")) in PANEL:
            secure = request.url.scheme == "https"
            drawn.set_cookie(PANEL_COOKIE, panel, max_age=YEAR, httponly=True, samesite="lax", secure=secure)
        return drawn

    def _environment(self, texts: Texts, lang: str) -> Environment:
        known = self._environments.get(lang)
        if known is not None and known[0] is texts:
            return known[1]
        environment = templates()
        environment.globals |= {
            "_": partial(texts.text, lang),
            "lang": lang,
            "asset": self.assets.url,
            "screen_assets": self.assets.of_screen,
            "label_of": partial(texts.label, lang),
            "in_words": partial(in_words, partial(texts.text, lang), language=lang),
            "type_text": lambda kind, name, **params: texts.of_type(lang, kind, name, **params),
            "fmt": fmt,
            "typed_time": lambda typed: typed_time.shown(typed, lang),
            "TIME_PATTERN": typed_time.PATTERN,
            "Scale": Scale,
            "marks_json": marks_json,
            "plain_screen": PlainScreen,
            **tiles.Tiles(environment).functions,
            **template_names(),
        }
        self._environments[lang] = (texts, environment)
        return environment

    def _surroundings(self, request: Request, lang: str, given: Mapping[str, Any]) -> dict[str, Any]:
        runtime = self.runtime(request)
        texts = self._texts(request)
        text = partial(texts.text, lang)
        plant = runtime.plant
        zone = ZoneInfo(plant.timezone) if plant else ZoneInfo("UTC")
        now = runtime.clock.micros()
        theme = request.cookies.get(THEME_COOKIE, "")
        profile = request.cookies.get(PROFILE_COOKIE, "")
        area = given.get("area", "")
        path = request.url.path
        person: Person | None = getattr(request.state, "person", None)
        head, _, machine = str(given.get("kind", "")).partition("/")
        engineering = [
            Tab(text(key), url, _head(path) == url)
            for key, url, needed in ENGINEERING
            if person is not None and person.may(needed)
        ]
        guest = text("access.role.operator")
        drawing = Drawing(runtime, texts, lang, lambda name: name if person is not None or not name else guest)
        alarms = drawing.banner(
            may_view=permitted(person, "view", simulated=runtime.simulated),
            may_acknowledge=person is not None and person.may("acknowledge"),
        )
        return {
            "kind": "frame",
            "chip": "",
            "engineering": engineering,
            "message": None,
            "pages": engineering if _at(path, engineering) else [],
            "up": "" if path == "/" else "/",
            "crumbs": self._crumbs(texts, plant, lang, path, area),
            "theme": theme if theme in THEMES else THEMES[0],
            "themes": [(name, text(f"theme.{name}"), "") for name in THEMES],
            "profile": profile if profile in PROFILES else PROFILES[0],
            "profiles": [(name, text(f"panel.{name}"), "") for name in PROFILES],
            "kiosk": panel_mode(request),
            "languages": [(code, NAMES.get(code, code), HTML.get(code, code)) for code in texts.languages],
            "html_lang": HTML.get(lang, lang),
            "here": place_of(request) if request.method == "GET" else "/",
            "alarms": alarms,
            "summary": drawing.summary(area) if given.get("kind") == "overview" else None,
            "plant_label": texts.label(lang, plant.name) if plant else "Pogon",
            "nav": self._tabs(texts, plant, lang, path, area)
            + _engineering_tab(text("nav.engineering"), path, engineering),
            "simulated": runtime.simulated,
            "sim": runtime.sim,
            "lesson_here": runtime.classroom.strip(person, machine) if head == "equipment" else None,
            "has_lessons": bool(runtime.classroom.lessons),
            "counts": self._counts(runtime, text, any(tab.url == "/communication" for tab in engineering)),
            "timezone": zone.key,
            "now": now,
            "now_time": fmt.clock_time(now, zone, offset=False),
            "now_date": f"{weekday(now, zone, lang)} {fmt.date(now, zone, lang)}",
            "revision": runtime.tags.revision,
            "build": self.build,
            "htmx_config": json.dumps(HTMX, separators=(",", ":")),
            "live_texts": json.dumps(live_texts(text), ensure_ascii=False, separators=(",", ":")),
        }

    def _tabs(self, texts: Texts, plant: Plant | None, lang: str, path: str, area: str) -> list[Tab]:
        tabs = [Tab(texts.text(lang, "nav.overview"), "/", path == "/")]
        for key, machines in areas(plant).items():
            url = address_of_area(key, machines)
            tabs.append(Tab(area_label(texts, plant, lang, key), url, key == area, key))
        for name, screen in plant.screens.items() if plant else ():
            url = f"/screens/{name}"
            tabs.append(Tab(texts.label(lang, screen.label), url, path == url))
        tabs += [Tab(texts.text(lang, key), url, _head(path) == url) for key, url in PAGES]
        return tabs

    def _crumbs(self, texts: Texts, plant: Plant | None, lang: str, path: str, area: str) -> list[Tab]:
        if path == "/" or plant is None:
            return []
        crumbs = [Tab(texts.label(lang, plant.name), "/")]
        machines = areas(plant).get(area, [])
        if area and path != f"/area/{quote(area)}":
            crumbs.append(Tab(area_label(texts, plant, lang, area), address_of_area(area, machines)))
        return crumbs

    def _counts(self, runtime: "Runtime", text: fmt.Text, diagnose: bool) -> list[dict[str, Any]]:
        tags = runtime.tags
        forces = [name for name in force_names(runtime.plant) if name in tags]
        forced = {
            "symbol": "i-force",
            "label": text("forces.count"),
            "class": "f-force",
            "url": "/forces",
            "sum": " ".join(forces),
            "text": force_count(runtime),
            "parts": [],
        }
        places = {"f-hidden": "/alarms?tab=hidden"} | ({"f-comm": "/communication"} if diagnose else {})
        return ([forced] if forces else []) + [
            {
                "symbol": symbol,
                "label": text(key),
                "class": look,
                "url": places.get(look, ""),
                "sum": "",
                "parts": [
                    (name, "–" if tags.value(tags.handle(name)) is None else tags.value(tags.handle(name)))
                    for name in names
                ],
            }
            for symbol, key, names, look in COUNTS
            if all(name in tags for name in names)
            and (runtime.plant is not None or look != "f-hidden")  # there 0 would be a claim
        ]


def force_count(runtime: "Runtime") -> str:
    """How many interventions stand in the plant as far as is known, with a ? while something is not."""
    samples = [runtime.tags.sample(name) for name in force_names(runtime.plant) if name in runtime.tags]
    known = [int(one.value) for one in samples if isinstance(one.value, int | float) and not is_bad(one.quality)]
    return str(sum(known)) if len(known) == len(samples) else f"{sum(known) or ''}?"


def panel_mode(request: Request) -> bool:
    """Whether this browser is a panel: the address says so now (`?panel=1`), or it was said before."""
    asked = request.query_params.get("panel", "")
    return (asked if asked in PANEL else request.cookies.get(PANEL_COOKIE, "")) == "1"


def _head(path: str) -> str:
    """`/instructor` of `/instructor/m1`."""
    return "/" + path.split("/")[1]


def _at(path: str, tabs: Sequence[Tab]) -> bool:
    return _head(path) in {tab.url for tab in tabs}


def _engineering_tab(label: str, path: str, pages: Sequence[Tab]) -> list[Tab]:
    """The one tab of all engineering pages that somebody may see, or none."""
    return [Tab(label, pages[0].url, _at(path, pages))] if pages else []


def areas(plant: Plant | None) -> dict[str, list[Equipment]]:
    """Area → its machines, in the order of the plant file; an area without machines is left out."""
    found: dict[str, list[Equipment]] = {key: [] for key in plant.areas} if plant else {}
    for equipment in plant.equipment.values() if plant else ():
        found.setdefault(equipment.area, []).append(equipment)
    return {key: machines for key, machines in found.items() if machines}


def address_of_area(key: str, machines: Sequence[Equipment]) -> str:
    """Where the tab of an area leads: to its tiles, or to its only machine at once."""
    return f"/equipment/{quote(machines[0].id)}" if len(machines) == 1 else f"/area/{quote(key)}"


def area_label(texts: Texts, plant: Plant | None, lang: str, key: str) -> str:
    """Name of an area: the plant's, else that of the equipment type it is called after, else its key."""
    if plant and key in plant.areas:
        return texts.label(lang, plant.areas[key]) or key
    if plant and isinstance(kind := plant.types.get(key), EquipmentType):
        return texts.of_type(lang, kind, kind.label)
    return key


def weekday(micros: int, zone: ZoneInfo, lang: str) -> str:
    """Short name of the day: `Mo`, `pon`."""
    day = to_datetime(micros).astimezone(zone).weekday()
    return conventions(lang).days[day]
