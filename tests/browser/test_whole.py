"""What a desk of 1280 x 800 shows whole: every column of a table, headings on one line, the bars of a day with their times."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, expect

from tests.browser.station import LANGUAGES, Sit, lay_out, origin, serving, speak
from tests.conftest import PogonServer

WHO, HOME = "ivana", "/"

SIDEWAYS = """() => [...document.querySelectorAll('main *')].filter((e) => e.checkVisibility() && e.querySelector('table')
  && /(auto|scroll)/.test(getComputedStyle(e).overflowX) && e.scrollWidth > e.clientWidth + 1)
  .map((e) => `${e.className} scrolls sideways by ${e.scrollWidth - e.clientWidth}`)"""


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PogonServer]:
    with serving(tmp_path_factory.mktemp("whole")) as running:
        yield running


def shown(page: Page, lang: str, path: str) -> None:
    speak(page, lang, origin(page))
    page.goto(origin(page) + path)
    expect(page.locator("body")).to_have_attribute("data-live", "live")


@pytest.mark.parametrize("lang", LANGUAGES)
def test_nothing_of_a_desk_is_beyond_an_edge(sit: Sit, lang: str) -> None:
    page = sit()
    for path in ("/", "/equipment/m1/parameters", "/equipment/c1/parameters", "/equipment/c1", "/equipment/seq1"):
        shown(page, lang, path)
        assert page.evaluate(SIDEWAYS) == [], path
    lines = page.locator(".q-word h2").evaluate(
        """(one) => { const range = document.createRange(); range.selectNodeContents(one.firstChild);
            return new Set([...range.getClientRects()].map((r) => Math.round(r.top))).size; }"""
    )
    assert lines == 1, page.inner_text(".q-word h2")
    shown(page, lang, "/equipment/c1")
    needed = page.locator(".c-stat .push .cap").last.evaluate(
        """(one) => { for (const e of [one, ...one.parentElement.children]) e.hidden = e !== one;
            one.parentElement.hidden = false; return [one.parentElement.scrollWidth, one.parentElement.clientWidth]; }"""
    )
    assert needed[0] <= needed[1], f"{needed} of {page.inner_text('.c-stat .push')}"


@pytest.mark.parametrize(
    ("size", "path"), [((800, 480), "/equipment/cc1"), ((390, 844), "/equipment/cc1"), ((390, 844), "/")]
)
def test_no_column_of_a_small_screen_is_beyond_the_edge(sit: Sit, size: tuple[int, int], path: str) -> None:
    page = sit()
    lay_out(page, *size, "panel-9" if size[0] == 800 else "")
    for lang in LANGUAGES:
        shown(page, lang, path)
        assert page.evaluate(SIDEWAYS) == [], f"{lang} {path} {size}"


@pytest.mark.parametrize("lang", LANGUAGES)
def test_the_bars_of_the_day_are_seen_with_their_times(sit: Sit, lang: str) -> None:
    """Also beside three alarms, one of them on two lines, and as many machines as the demo plant has."""
    page = sit()
    shown(page, lang, "/")
    page.locator(".ov-al").evaluate(
        """(one) => { const rows = one.querySelector("tbody"), list = one.querySelector(".ov-new");
            while (rows.children.length < 8) rows.append(rows.lastElementChild.cloneNode(true));
            const line = document.createElement("li");
            line.innerHTML = '<span class="grow">Simulacija: sporija od stvarnog vremena svijeta</span><time class="num cap">23:50</time>';
            list.replaceChildren(line, line.cloneNode(true), line.cloneNode(true)); }"""
    )
    for text in page.locator(".hist text").all():
        box, edge = text.bounding_box(), page.locator(".ov-al").bounding_box()
        assert box and edge and box["y"] + box["height"] <= edge["y"] + edge["height"]
        assert edge["x"] <= box["x"] and box["x"] + box["width"] <= edge["x"] + edge["width"]
