"""Somebody finds their way by the keyboard alone: Ctrl+K, a few letters, Enter; an action is only led to, never done."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import expect

from tests.browser.station import LANGUAGES, Sit, lay_out, serving, small, speak
from tests.browser.test_layout import BOTH, SIZES
from tests.conftest import PogonServer

WHO, HOME = "ivana", "/"


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PogonServer]:
    with serving(small(tmp_path_factory.mktemp("palette"), "m1", "m2")) as running:
        yield running


def test_a_few_letters_lead_to_a_button_that_nobody_has_pressed(sit: Sit) -> None:
    page = sit(lang="de")
    sent: list[str] = []
    page.on("request", lambda request: sent.append(request.url) if request.method == "POST" else None)
    page.keyboard.press("Control+k")
    expect(page.locator("#pal-q")).to_be_focused()
    page.keyboard.type("lufter 2 vorwa")
    expect(page.locator("#pal-found a").first).to_contain_text("Vorwärts")
    page.keyboard.press("Enter")
    expect(page.locator("[data-command='m2.forward']")).to_be_focused()
    assert not [url for url in sent if "/commands/" in url or "/equipment/" in url]


def test_arrows_choose_escape_closes_and_the_same_page_takes_the_focus_too(sit: Sit) -> None:
    page = sit(path="/equipment/m1")
    page.keyboard.press("Control+k")
    expect(page.locator(".scrim-stop")).to_be_visible()
    page.keyboard.type("fan 1")
    expect(page.locator("#pal-found a").first).to_contain_text("Fan 1")
    page.keyboard.press("ArrowDown")
    expect(page.locator("#pal-found [aria-selected=true]")).to_have_id("pal-2")
    page.keyboard.press("ArrowUp")
    page.keyboard.press("ArrowUp")
    expect(page.locator("#pal-found [aria-selected=true]")).to_have_attribute("id", "pal-24")
    page.keyboard.press("Escape")
    expect(page.locator(".pal")).to_have_count(0)
    page.keyboard.press("Control+k")
    expect(page.locator("#pal-q")).to_be_focused()
    page.keyboard.type("reverse fan 1")
    expect(page.locator("#pal-found a").first).to_contain_text("Reverse")
    page.keyboard.press("Enter")
    expect(page.locator("[data-command='m1.reverse']")).to_be_focused()
    page.keyboard.press("F2")
    expect(page).to_have_url(page.url.split("/equipment")[0] + "/")
    page.keyboard.press("F6")
    expect(page.locator("h1")).to_have_text("Trends")


@pytest.mark.parametrize("lang", LANGUAGES)
def test_nothing_of_it_is_cut(sit: Sit, server: PogonServer, lang: str) -> None:
    page = sit(path="/equipment/m1")
    speak(page, lang, server.url)
    page.reload()
    found: list[str] = []
    for size, (width, height, profile) in SIZES.items():
        lay_out(page, width, height, profile)
        found += [f"{lang} {size}: {one}" for one in page.evaluate(BOTH)]
        page.keyboard.press("Control+k")
        expect(page.locator("#pal-q")).to_be_focused()
        found += [f"{lang} {size} palette: {one}" for one in page.evaluate(BOTH)]
        page.keyboard.press("Escape")
    assert found == [], "\n".join(["", *found])
