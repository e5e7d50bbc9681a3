"""What an answer holds: addresses and forms to go on with, and what must never be in one."""

import csv
import io
import json
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from html.parser import HTMLParser

from app.historian.export import FORMATS
from tests.fuzz.values import MARK, Field

ADDRESSES = ("href", "src", "action", "formaction")
LANDMARKS = ("html", "header", "nav", "main", "footer", "h1")
CELL = re.compile(r"[+-]?\d[\d.,  ]*(?:[eE][+-]?\d+)?")
"""A number, with the signs of any language."""
FORMULA = ("=", "+", "-", "@", "\t", "\r")
FOREIGN = re.compile(r'[;,\t\r\n]"*(?:=|@|[+-][^\d;,\t\r\n"]).{0,60}')
"""A cell that begins with one, for a program that is set to whatever separator."""
TEMPORAL = {"date", "time", "datetime-local", "month", "week"}


@dataclass
class Form:
    """What may be sent, and where to."""

    method: str
    action: str
    fields: list[Field] = field(default_factory=list)


class Page(HTMLParser):
    """Reads a page or a piece of one.

    Every attribute that begins with `/` is an address: links, what htmx fetches, what our scripts are told to fetch.
    """

    def __init__(self, text: str) -> None:
        super().__init__()
        self.links: set[str] = set()
        self.forms: list[Form] = []
        self.marks: dict[str, int] = dict.fromkeys(LANDMARKS, 0)
        self.wrong: list[str] = []
        """What somebody's text became a part of."""
        self.live: set[str] = set()
        """Kinds of pages that its socket may ask for."""
        self.data: list[tuple[str, str]] = []
        """Names and values of what elements tell our scripts."""
        self._open: list[Form] = []
        self._by_id: dict[str, Form] = {}
        self._select: tuple[Form | None, dict[str, str], list[str], list[str]] | None = None
        self._area: tuple[Form | None, dict[str, str], list[str]] | None = None
        self._inside = ""
        self._later: list[tuple[str, Field]] = []
        self.feed(text)
        self.close()
        for id, one in self._later:
            if id in self._by_id:
                self._by_id[id].fields.append(one)

    def handle_starttag(self, tag: str, pairs: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in pairs}
        self._check(tag, given)
        if tag in self.marks:
            self.marks[tag] += 1
        if tag in ("script", "style"):
            self._inside = tag
        for name, value in given.items():
            if name.startswith("data-") and value:
                self.data.append((name.removeprefix("data-"), value))
            if value.startswith("/") and not value.startswith("//") and name not in ("hx-post", "value"):
                self.links.add(value)
        if tag in ("body", "div") and given.get("data-kind"):
            self.live.add(given["data-kind"])
        if tag == "form":
            method = "post" if "hx-post" in given else given.get("method", "get").lower()
            one = Form(method.upper(), given.get("hx-post") or given.get("action") or given.get("hx-get", ""))
            self.forms.append(one)
            self._open.append(one)
            if given.get("id"):
                self._by_id[given["id"]] = one
        elif "hx-post" in given or "formaction" in given:
            around = self._by_id.get(given.get("form", "")) or (self._open[-1] if self._open else None)
            self.forms.append(
                Form("POST", given.get("hx-post") or given["formaction"], around.fields if around else [])
            )
        if given.get("name") and tag in ("input", "textarea", "button", "select"):
            self._field(tag, given)
        elif tag == "option" and self._select:
            self._select[2].append(given.get("value", ""))
            if "selected" in given:
                self._select[3].append(given.get("value", ""))

    def handle_endtag(self, tag: str) -> None:
        if tag == "form" and self._open:
            self._open.pop()
        if tag == "select" and self._select:
            form, given, choices, chosen = self._select
            value = (chosen or choices or [""])[0]
            self._put(form, given, Field(given["name"], "choice", value, tuple(choices), "disabled" not in given))
            self._select = None
        if tag == "textarea" and self._area:
            form, given, written = self._area
            text = "".join(written).removeprefix("\n").replace("\r\n", "\n").replace("\n", "\r\n")
            needed = "required" in given
            self._put(form, given, Field(given["name"], "text", text, on="disabled" not in given, needed=needed))
            self._area = None
        if tag == self._inside:
            self._inside = ""

    def handle_data(self, data: str) -> None:
        if self._area:
            self._area[2].append(data)
        if self._inside and MARK in data:
            self.wrong.append(f"in a {self._inside}: {data[:80]!r}")

    def _check(self, tag: str, given: dict[str, str]) -> None:
        if tag.startswith(MARK):
            self.wrong.append(f"a tag <{tag}>")
        for name, value in given.items():
            if name.startswith((MARK, "on")) or name == "style" or name.startswith("hx-on"):
                self.wrong.append(f"an attribute {name}={value[:60]!r} of <{tag}>")
            if name in ADDRESSES and value and (not value.startswith(("/", "#", "?")) or value.startswith("//")):
                self.wrong.append(f"{name}={value[:80]!r} leads elsewhere")

    def _field(self, tag: str, given: dict[str, str]) -> None:
        form, kind = self._open[-1] if self._open else None, given.get("type", "text")
        if tag == "select":
            self._select = (form, given, [], [])
            return
        if tag == "textarea":
            self._area = (form, given, [])
            return
        one_of, on = "", "disabled" not in given
        if kind == "password":
            what = "secret"
        elif kind in ("hidden", "submit") or tag == "button":
            what, one_of = "hidden", "" if kind == "hidden" else "button"
        elif kind in ("checkbox", "radio"):
            what, one_of, on = "ticked", "radio" if kind == "radio" else "", on and "checked" in given
        elif kind in TEMPORAL:
            what = "time"
        elif kind == "number" or given.get("inputmode") in ("decimal", "numeric"):
            what = "number"
        else:
            what = "text"
        value, least, most = (given.get(name, "") for name in ("value", "min", "max"))
        one = Field(given["name"], what, value, (), on, one_of, least, most, "required" in given)
        self._put(form, given, one)

    def _put(self, form: Form | None, given: dict[str, str], one: Field) -> None:
        if id := given.get("form", ""):
            self._later.append((id, one))
        elif form is not None:
            form.fields.append(one)


def broken_csv(text: str, address: str) -> Iterator[str]:
    """What is wrong with a file of lines: a cell that is a formula to a spreadsheet, a line that has more cells than the heads."""
    locale = next((one for one in FORMATS if f"locale={one}" in address), "machine")
    rows = list(
        csv.reader(io.StringIO(text.removeprefix("\ufeff"), newline=""), delimiter=FORMATS[locale][0], strict=True)
    )
    for number, row in enumerate(rows):
        for cell in row:
            if cell.startswith(FORMULA) and len(cell) > 1 and not CELL.fullmatch(cell):
                yield f"line {number} has a formula: {cell[:60]!r}"
    if found := FOREIGN.search(text):
        yield f"a formula where the separators are others: {found[0]!r}"


def broken_json(text: str) -> Iterator[str]:
    """What is wrong with it: JSON knows no NaN and no Infinity."""

    def refuse(name: str) -> None:
        raise ValueError(name)

    try:
        json.loads(text, parse_constant=refuse)
    except ValueError as error:
        yield f"no JSON: {error}"


def links_in(text: str) -> set[str]:
    """Addresses that a JSON answer names."""
    return set(re.findall(r'"(/[a-z][^"\\\s]*)"', text))
