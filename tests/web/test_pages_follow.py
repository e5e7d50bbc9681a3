"""What a screen draws of a value changes with it: it is live by its own tag, or in a part that is fetched again.

Tried from outside: all values of a machine are changed, its screens are drawn again, and but for what is live they must come out as
they were. Anything else shows the former value for as long as somebody looks.
"""

from collections.abc import Iterable, Sequence
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest

from app.settings import Settings
from tests import virtual
from tests.conftest import ROOT
from tests.web.hand import CHANGES, PASSING, House

ALIVE = {
    "data-tag",
    "data-tags",
    "data-renewed",
    "data-part",
    "data-revision",
    "data-mark-area",
    "data-mark-part",
    "data-mark-machine",
}
"""An element with one of these is kept up to date with all that it holds."""
HEAD = ("body", "meta", "script", "time")
OF_ONE = ("csrf", "tab", "q", "htmx-config")
"""Fields that are new on every page, or name what is."""
VOID = frozenset(("area", "base", "br", "col", "embed", "hr", "img", "input", "link", "meta", "source", "track", "wbr"))
READ_ONCE = ("/parameters", "/encoder", "/fault-buffer", "/compare")
"""Ends of pages that say when they were read."""


class Still(HTMLParser):
    """What of a page does not change by itself: tags with their attributes, and texts."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.found: list[str] = []
        self._open: list[tuple[str, bool]] = []
        self.feed(html)

    @property
    def _alive(self) -> bool:
        return any(alive for _, alive in self._open)

    def handle_starttag(self, tag: str, attrs: Sequence[tuple[str, str | None]]) -> None:
        self._begin(tag, attrs, closes=tag in VOID)

    def handle_startendtag(self, tag: str, attrs: Sequence[tuple[str, str | None]]) -> None:
        self._begin(tag, attrs, closes=True)

    def _begin(self, tag: str, attrs: Iterable[tuple[str, str | None]], *, closes: bool) -> None:
        given = dict(attrs)
        alive = bool(ALIVE & given.keys()) or tag in ("script", "time")
        if not (alive or self._alive or tag in HEAD or given.get("name") in OF_ONE):
            self.found.append(PASSING.sub("", f"<{tag} {given}>"))
        if not closes:
            self._open.append((tag, alive))

    def handle_endtag(self, tag: str) -> None:
        while self._open and self._open.pop()[0] != tag:
            pass

    def handle_data(self, data: str) -> None:
        if data.strip() and not self._alive:
            self.found.append(PASSING.sub("", data.strip()))


class Reader(House):
    """Looks at whole pages."""

    def drawn(self, url: str) -> str:
        answer = self.client.get(url)
        assert answer.status_code == 200, (url, answer.text)
        return "\n".join(Still(answer.text).found)


@pytest.mark.sweep(8)
@pytest.mark.parametrize("plant", ["feeding", "drive_steps", "crane", "epos", "sinamics", "hall", "belts", "demo"])
def test_what_a_page_says_of_a_value_follows_it(tmp_path: Path, plant: str) -> None:
    left: list[Any] = []
    with virtual.house(Settings(data=tmp_path / "data", plant=ROOT / "plants" / plant)) as client:
        client.pass_time(20)
        reader = Reader(client)
        assert reader.runtime.plant
        for item in reader.runtime.plant.equipment.values():
            values = reader.values_of(item)
            for url in reader.pages(item):
                if url.endswith(READ_ONCE) or client.get(url).status_code != 200:
                    continue
                for change in CHANGES:
                    if reader.moved_by(url, values, change):
                        left.append((url, reader.first_of(url, values, change)))
    assert left == []


def test_what_stands_still_is_found() -> None:
    """Or the test above would be green whatever a page says."""
    page = (
        '<p>1<br>2</p><b data-tag="m1.speed">3<i>4</i></b><div data-part="x"><p>5</p></div>'
        '<i>6 <time>7</time></i><svg><path d="8"/></svg>'
    )
    assert Still(page).found == ["<p {}>", "1", "<br {}>", "2", "<i {}>", "6", "<svg {}>", "<path {'d': '8'}>"]
