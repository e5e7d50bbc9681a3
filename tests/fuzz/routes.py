"""What there is to ask for: routes from the application's own table, addresses and forms from the pages it serves, fields from its code.

Nothing is written down here. A part of an address is what pages had in such a place; a field is what a form has, what the
description of the interface says, or what a handler asked its request for.
"""

import json
import re
import sys
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any
from urllib.parse import parse_qsl, unquote, urlsplit

import pytest
from fastapi import FastAPI
from starlette.datastructures import FormData, ImmutableMultiDict, QueryParams
from starlette.routing import compile_path

from app.web import guard
from app.web.api.description import described
from tests.fuzz.asking import part
from tests.fuzz.pages import Form, Page
from tests.fuzz.values import Field

MOST_OF_ONE, MOST_SEEN = 8, 20
"""Addresses of one route that are kept, and looked at in the end: so many with the same fields in their query, and in all."""
MOST_FORMS, MOST_FIELDS = 12, 60
PARTS = re.compile(r"{(\w+)(?::\w+)?}")
FILES = ("/static/",)
MOST_POOLED, MOST_UNLINKED = 40, 3


class Routes:
    """All routes of one application, and what has been seen of each so far."""

    def __init__(self, app: FastAPI) -> None:
        self.table = guard.permissions(app)
        """`GET /equipment/{key}` → who may."""
        self._patterns: list[tuple[str, str, re.Pattern[str]]] = []
        for route in self.table:
            method, _, path = route.partition(" ")
            self._patterns.append((method, path, compile_path(path)[0]))
        self.pool: dict[str, dict[str, None]] = defaultdict(dict)
        """Place in an address, such as `equipment/{key}` → what stood there; and name alone → what answers had under it."""
        self.seen: dict[str, dict[str, None]] = defaultdict(dict)
        """Template → addresses that pages lead to."""
        self.forms: dict[str, dict[str, Form]] = defaultdict(dict)
        """Route → forms that lead there, by their address and fields."""
        self.where: dict[str, dict[str, None]] = defaultdict(dict)
        """Route → pages that have a form of it, the last that was seen at the end."""
        self.fields: dict[str, dict[str, Field]] = defaultdict(dict)
        """Template → fields that its handler asks for in its query."""
        self.wanted: dict[str, dict[str, bool]] = defaultdict(dict)
        """Template → fields that its handler asks for in a form, and whether it needs them."""
        self._by_name: dict[str, Field] = {}
        self.kinds: dict[str, None] = {}
        """Of pages with a socket."""
        self.asking = ""
        """Template of the request that is being answered."""
        self.bodies = _bodies()
        self._in_forms: set[str] = set()
        """Names that handlers have asked their forms for: what a script adds, from the data of an element."""
        self._named = {name for _, template, _ in self._patterns for name in PARTS.findall(template)}

    def of(self, method: str, address: str) -> str:
        """The template that serves `address`; empty: none."""
        path = unquote(address.partition("?")[0])
        for known, template, pattern in self._patterns:
            if known == method and pattern.match(path):
                return template
        return ""

    def take(self, other: "Routes") -> None:
        """Begin with what was seen of the same plant before."""
        self.pool = defaultdict(dict, {name: dict(had) for name, had in other.pool.items()})
        self.seen = defaultdict(dict, {name: dict(had) for name, had in other.seen.items()})
        self.forms = defaultdict(dict, {name: dict(had) for name, had in other.forms.items()})
        self.where = defaultdict(dict, {name: dict(had) for name, had in other.where.items()})
        self.fields = defaultdict(dict, {name: dict(had) for name, had in other.fields.items()})
        self.wanted = defaultdict(dict, {name: dict(had) for name, had in other.wanted.items()})
        self._in_forms = set(other._in_forms)
        self.kinds, self._by_name = dict(other.kinds), dict(other._by_name)

    def learn(self, page: Page, at: str = "/") -> None:
        """Keep addresses and forms of a page that was served at `at`."""
        for address in sorted(page.links):
            self.link(address)
        for form in page.forms:
            if not form.action.startswith("/"):
                form.action = at.partition("?")[0] + (form.action if form.action.startswith("?") else "")
            template = self.of(form.method, form.action)
            self._parts(form.method, form.action)
            if not template:
                continue
            self._by_name |= {one.name: one for one in form.fields}
            if form.method == "GET":
                self.fields[template] |= {one.name: one for one in form.fields}
                continue
            where = self.where[f"POST {template}"]
            where.pop(at, None)
            where[at] = None
            if len(where) > MOST_SEEN:
                del where[next(iter(where))]
            kept = self.forms[f"POST {template}"]
            shape = f"{form.action} {sorted({one.name for one in form.fields})}"
            if len(kept) < MOST_FORMS or shape in kept:
                kept[shape] = form
        for name, value in page.data:
            if name in self._named or name in self._in_forms:
                self._pool(name, value)
        self.kinds |= dict.fromkeys(sorted(page.live))

    def link(self, address: str) -> bool:
        """Keep one address, if it is the first or one of few of its route; whether it is new."""
        template = self.of("GET", address)
        self._parts("GET", address)
        if not template:
            self._parts("POST", address)
            return False
        query = parse_qsl(urlsplit(address).query, keep_blank_values=True)
        for name, value in query:
            self.fields[template].setdefault(name, Field(name, "text", value))
        kept = self.seen[template]
        if address in kept or len(kept) >= MOST_SEEN or address.startswith(FILES):
            return False
        if sum(_asks(one) == _asks(address) for one in kept) >= MOST_OF_ONE:
            return False
        kept[address] = None
        return True

    def _parts(self, method: str, address: str) -> None:
        path = unquote(address.partition("?")[0])
        for known, template, pattern in self._patterns:
            if known == method and (found := pattern.match(path)):
                places = dict(zip(PARTS.findall(template), _places(template), strict=True))
                for name, value in found.groupdict().items():
                    self._pool(places[name], value)

    def _pool(self, place: str, value: str) -> None:
        pool = self.pool[place]
        if len(pool) < MOST_POOLED and "{" not in value:
            pool[value] = None

    def read(self, tree: Any) -> None:
        """Keep what a JSON answer has under the names of parts of addresses."""
        if isinstance(tree, list):
            for one in tree:
                self.read(one)
        elif isinstance(tree, dict):
            for name, value in tree.items():
                if name in self._named and isinstance(value, str | int):
                    self._pool(name, str(value))
                else:
                    self.read(value)

    def filled(self, template: str, choose: Callable[[str, list[str]], str]) -> str:
        """An address of `template`; `choose(name, seen)` says what stands in each part."""
        places = iter(_places(template))

        def put(found: re.Match[str]) -> str:
            place = next(places)
            return part(choose(found[1], list(self.pool[place]) or list(self.pool[found[1]])))

        return PARTS.sub(put, template)

    def addresses(self, most: int = MOST_SEEN) -> list[str]:
        """Every address that is looked at in the end: of each route `most` that pages lead to, or few where none does."""
        found: dict[str, None] = {}
        for route in self.table:
            method, _, template = route.partition(" ")
            if method != "GET" or template.startswith(FILES):
                continue
            if seen := self.seen[template]:
                found |= dict.fromkeys(list(seen)[:most])
                continue
            for number in range(min(most, MOST_UNLINKED)):
                found[self.filled(template, partial(_nth, number))] = None
        return list(found)

    def costly(self, address: str) -> bool:
        """Whether one look is enough: a file, or the same for everybody."""
        return ".csv" in address or "/export" in address or address.startswith(("/metrics", "/docs", "/api/v1/openapi"))

    @contextmanager
    def listening(self) -> Iterator[None]:
        """While this runs, what is asked of a form or a query is a field of the template in `asking`."""
        with pytest.MonkeyPatch.context() as patch:
            _listen(patch, self._heard)
            yield

    def _heard(self, name: object, required: bool | None = None) -> None:
        """The handler that answers now asked for `name`: in its query (None), or in its form, where it may be needed."""
        template = self.asking
        if not template or not isinstance(name, str) or not name.isascii() or len(name) >= 40:
            return
        if required is None:
            if len(self.fields[template]) < MOST_FIELDS:
                self.fields[template].setdefault(name, Field(name, "text"))
        elif len(self.wanted[template]) < MOST_FIELDS:
            self._in_forms.add(name)
            self.wanted[template][name] = required or self.wanted[template].get(name, False)

    def field(self, name: str) -> Field:
        """A field as forms have it that have one of this name."""
        return self._by_name.get(name) or Field(name, "text")


def _listen(patch: pytest.MonkeyPatch, heard: Callable[..., None]) -> None:
    multi, fields = ImmutableMultiDict, guard.fields
    get, item, several = multi.get, multi.__getitem__, multi.getlist

    def told(of: Any, name: Any) -> None:
        if isinstance(of, FormData):
            heard(name, False)
        elif isinstance(of, QueryParams):
            heard(name)

    def getting(self: Any, key: Any, default: Any = None) -> Any:
        told(self, key)
        return get(self, key, default)

    def taking(self: Any, key: Any) -> Any:
        told(self, key)
        return item(self, key)

    def listing(self: Any, key: Any) -> Any:
        told(self, key)
        return several(self, key)

    async def asked(request: Any, required: Any, optional: Any = (), lists: Any = ()) -> dict[str, str]:
        required, optional, lists = tuple(required), tuple(optional), tuple(lists)
        for name in (*required, *optional, *lists):
            heard(name, name in required)
        return await fields(request, required, optional, lists)

    patch.setattr(ImmutableMultiDict, "get", getting)
    patch.setattr(ImmutableMultiDict, "__getitem__", taking)
    patch.setattr(ImmutableMultiDict, "getlist", listing)
    for name, module in list(sys.modules.items()):
        if name.startswith("app.web") and getattr(module, "fields", None) is fields:
            patch.setattr(module, "fields", asked)


def _nth(number: int, _name: str, seen: list[str]) -> str:
    return seen[number % len(seen)] if seen else "1"


def _asks(address: str) -> set[str]:
    return {name for name, _ in parse_qsl(urlsplit(address).query, keep_blank_values=True)}


def _places(template: str) -> list[str]:
    """Where its parts stand: the part of the address before, and the name."""
    parts = template.split("/")
    return [f"{parts[number - 1]}/{one}" for number, one in enumerate(parts) if one.startswith("{")]


def _bodies() -> dict[str, dict[str, Any]]:
    """Route → the schema of its JSON body, references resolved."""
    told = json.loads(described())
    schemas = told["components"]["schemas"]

    def whole(schema: Any, depth: int = 0) -> Any:
        if isinstance(schema, list):
            return [whole(one, depth) for one in schema]
        if not isinstance(schema, dict) or depth > 6:
            return schema
        if "$ref" in schema:
            return whole(schemas[schema["$ref"].rpartition("/")[2]], depth + 1)
        return {name: whole(one, depth) for name, one in schema.items()}

    found = {}
    for path, methods in told["paths"].items():
        for method, operation in methods.items():
            content = operation.get("requestBody", {}).get("content", {})
            if "application/json" in content:
                found[f"{method.upper()} {path}"] = whole(content["application/json"]["schema"])
    return found
