"""Somebody finds their way by the keyboard alone: Ctrl+K, a few letters, Enter; an action is only led to, never done."""

import re
import time
from collections.abc import Iterator

import pytest
from playwright.sync_api import expect

from tests.browser.looks import BOTH, SIZES
from tests.browser.station import (
    AXE,
    LANGUAGES,
    Sit,
    hold_back,
    lay_out,
    let_go,
    origin,
    serving,
    small,
    speak,
    take,
    wait_for,
)
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
    home = f"{origin(page)}/"
    page.keyboard.press("F2")
    expect(page).to_have_url(home)
    expect(page.locator("body")).to_have_attribute("data-live", "live")  # a page that is only on its way hears no key
    page.keyboard.press("F6")
    expect(page.locator("h1")).to_have_text("Trends")


def test_it_opens_however_late_the_other_scripts_come(sit: Sit) -> None:
    page = sit(path="/equipment/m1")
    held = hold_back(page, "**/js/commands.*.js")
    page.reload(wait_until="commit")
    wait_for(page, held, 1)
    while not page.evaluate("Boolean(window.pogon)"):
        page.wait_for_timeout(50)  # the keys are heard
    page.keyboard.press("Control+k")
    page.wait_for_timeout(500)
    held[0].continue_()
    expect(page.locator("#pal-q")).to_be_focused()
    page.unroute_all()


def test_keys_wait_until_what_was_typed_is_found_and_no_letter_is_lost(sit: Sit) -> None:
    page = sit(path="/equipment/m1")
    page.keyboard.press("Control+k")
    expect(page.locator("#pal-q")).to_be_focused()
    held = hold_back(page, "**/palette/found*")
    page.keyboard.type("fan 2", delay=250)
    page.keyboard.press("ArrowDown")
    page.keyboard.press("ArrowUp")
    page.keyboard.press("Enter")
    wait_for(page, held, 1)
    expect(page).to_have_url(re.compile("/equipment/m1$"))
    held[0].continue_()
    wait_for(page, held, 2)
    expect(page).to_have_url(re.compile("/equipment/m1$"))
    held[1].continue_()
    expect(page).to_have_url(re.compile("/equipment/m2$"))


def test_the_first_key_after_it_was_asked_for_is_its_own(sit: Sit) -> None:
    """Search and help stand in the page: a blank or Enter that follows at once presses no button behind them."""
    page = sit(path="/equipment/m1")
    take(page)
    sent: list[str] = []
    page.on("request", lambda request: sent.append(request.url) if request.method == "POST" else None)
    page.route("**/help?*", lambda route: None)
    page.route("**/palette/found*", lambda route: None)
    page.locator("[data-command='m1.stop']").focus()
    page.keyboard.press("F1")
    page.keyboard.press("Space")  # that closes it again
    expect(page.locator("[data-command='m1.stop']")).to_be_focused()
    page.keyboard.press("Control+k")
    page.keyboard.press("Space")
    expect(page.locator("#pal-q")).to_have_value(" ")
    page.wait_for_timeout(300)  # what is typed is asked for
    page.keyboard.press("Escape")
    expect(page.locator("[data-command='m1.stop']")).to_be_focused()
    assert sent == []
    page.unroute_all(behavior="ignoreErrors")
    let_go(page)


def test_what_is_typed_before_anything_is_found_presses_nothing_behind_it_and_is_looked_for(sit: Sit) -> None:
    """On a slow line the focus is still on a button of the machine, which a blank or Enter would press."""
    page = sit(path="/equipment/m1")
    take(page)
    sent: list[str] = []
    page.on("request", lambda request: sent.append(request.url) if request.method == "POST" else None)
    held = hold_back(page, "**/palette/found*")
    page.locator("[data-command='m1.stop']").focus()
    page.keyboard.press("Control+k")
    wait_for(page, held, 1)
    expect(page.locator(".waits")).to_be_visible()
    page.keyboard.type("fan 3")
    page.keyboard.press("Backspace")
    page.keyboard.type("2")
    page.keyboard.press("Enter")
    held[0].continue_()
    wait_for(page, held, 2)
    expect(page).to_have_url(re.compile("/equipment/m1$"))
    answered, end = 1, time.monotonic() + 15
    while not page.url.endswith("/equipment/m2") and time.monotonic() < end:
        for asked in held[answered:]:  # on a busy machine a letter may come so late that it is asked for by itself
            asked.continue_()
        answered = len(held)
        page.wait_for_timeout(50)
    expect(page).to_have_url(re.compile("/equipment/m2$"))
    assert sent == []
    page.unroute_all()
    page.go_back()
    let_go(page)


def test_axe_finds_nothing_where_nothing_is_found(sit: Sit) -> None:
    page = sit(path="/equipment/m1", bypass_csp=True)
    page.evaluate(AXE.read_text("utf-8"))
    page.keyboard.press("Control+k")
    for typed, text in (("fan", "Fan 1"), ("zzzz", "zzzz")):
        page.fill("#pal-q", typed)
        expect(page.locator("#pal-found")).to_contain_text(text)
        found = page.evaluate("async () => (await axe.run('.pal', { runOnly: ['wcag2a', 'wcag2aa'] })).violations")
        assert [(rule["id"], node["html"][:160]) for rule in found for node in rule["nodes"]] == [], typed


def test_escape_before_anything_is_found_gives_the_keys_back(sit: Sit) -> None:
    page = sit(path="/equipment/m1")
    held = hold_back(page, "**/palette/found*")
    page.locator(".look-for").focus()
    page.keyboard.press("Control+k")
    wait_for(page, held, 1)
    page.keyboard.press("Escape")
    expect(page.locator(".look-for")).to_be_focused()
    page.keyboard.press("Tab")
    expect(page.locator(".theme > summary")).to_be_focused()
    held[0].continue_()
    page.wait_for_timeout(300)
    expect(page.locator(".pal")).to_have_count(0)
    page.unroute_all()
    page.keyboard.press("Control+k")
    expect(page.locator("#pal-q")).to_be_focused()


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
