"""F1 on any page: help over it, nothing cut, Escape leads back to where one was."""

import re
from collections.abc import Iterator

import pytest
from playwright.sync_api import expect

from tests.browser.looks import BOTH, SIZES
from tests.browser.station import AXE, LANGUAGES, Sit, lay_out, serving, small, speak
from tests.conftest import PogonServer

WHO, HOME = "ivana", "/equipment/m1"

COVERED = """() => { // whether Stop is behind the help
  const [stop, help] = [".scrim-stop", ".help"].map((one) => document.querySelector(one).getBoundingClientRect());
  return Number(stop.left < help.right && help.left < stop.right && stop.top < help.bottom && help.top < stop.bottom);
}"""


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PogonServer]:
    with serving(small(tmp_path_factory.mktemp("help"), "m1", "m2")) as running:
        yield running


@pytest.mark.parametrize("lang", LANGUAGES)
def test_help_opens_by_its_key_and_nothing_is_cut(sit: Sit, server: PogonServer, lang: str) -> None:
    page = sit()
    speak(page, lang, server.url)
    page.reload()
    expect(page.locator("body")).to_have_attribute("data-live", "live")
    found: list[str] = []
    for size, (width, height, profile) in SIZES.items():
        lay_out(page, width, height, profile)
        page.keyboard.press("F1")
        expect(page.locator(".help [data-close]")).to_be_focused()
        expect(page.locator(".help .help-keys")).to_be_visible()
        found += [f"{lang} {size}: {one}" for one in page.evaluate(BOTH)]
        found += [f"{lang} {size}: Stop is covered" for _ in range(page.evaluate(COVERED))]
        page.keyboard.press("Escape")
        expect(page.locator(".help")).to_have_count(0)
    assert found == [], "\n".join(["", *found])


def test_help_and_search_are_in_reach_of_a_finger_and_of_a_screen_reader(sit: Sit) -> None:
    page = sit()
    lay_out(page, 800, 480, "panel-9")
    page.locator(".places > summary").click()
    page.locator(".places [data-over='/help']").click()
    expect(page.locator(".help")).to_contain_text("About this machine")
    page.evaluate(AXE.read_text("utf-8"))
    wrong = page.evaluate("axe.run('.help').then((all) => all.violations.map((one) => one.id))")
    assert wrong == []
    page.keyboard.press("Escape")
    page.locator(".places > summary").click()
    page.locator(".places [data-over='/palette']").click()
    expect(page.locator("#pal-q")).to_be_focused()
    wrong = page.evaluate("axe.run('.pal').then((all) => all.violations.map((one) => one.id))")
    assert wrong == []


def test_paper_has_what_is_read_and_nothing_that_is_pressed(sit: Sit) -> None:
    page = sit()
    page.emulate_media(media="print")
    expect(page.locator("h1")).to_be_visible()
    expect(page.locator(".m-vals, main table").first).to_be_visible()
    for gone in (".tabs", ".zone", ".banner", ".foot"):
        expect(page.locator(gone)).to_be_hidden()
    for left in page.locator(".head-r > *").all():
        clock = "clock" in (left.get_attribute("class") or "").split()
        expect(left).to_be_visible() if clock else expect(left).to_be_hidden()
    expect(page.locator(".head-r > .clock")).to_contain_text(re.compile(r"\d\d:\d\d:\d\d.*20\d\d", re.DOTALL))
    assert page.evaluate("getComputedStyle(document.querySelector('main')).overflowY") == "visible"
    page.locator("html").evaluate("(html) => { html.dataset.theme = 'dark'; }")
    assert page.evaluate("getComputedStyle(document.querySelector('h1')).color") == "rgb(20, 20, 20)", "no white ink"
    page.emulate_media(media="screen")
