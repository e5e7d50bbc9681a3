"""Stop against what was pressed before it and is still on its way: the machine stops and stays so, and the page says why."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, expect

from app.plant.texts import Texts
from tests.browser.station import HEARD, LANGUAGES, Sit, hold_back, serving, small, take, wait_for
from tests.conftest import PogonServer

WHO, HOME = "ana", "/equipment/m1"


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PogonServer]:
    """One Pogon with the drives of the demo plant and an operator."""
    with serving(small(tmp_path_factory.mktemp("stopped"), "m1", "m2"), {"ana": ("operator", "engineer")}) as running:
        yield running


def begin(page: Page) -> None:
    """Have control of a machine that takes commands."""
    take(page)
    expect(page.locator("[data-command$='.forward']").first).not_to_have_attribute("aria-disabled", "true")
    page.evaluate(HEARD)


def stop(page: Page) -> None:
    """Press Stop, and wait until it is taken."""
    with page.expect_response("**/stop"):
        page.click(".op > .stop")


def tells(page: Page, command: str, lang: str) -> None:
    """Wait until the page has told that the command is not carried out; what became of Stop may be told over it at once."""
    label = page.locator(f"[data-command='{command}'] .cmd-t").evaluate("one => one.firstChild.textContent.trim()")
    told = f"M1 {label}: {Texts.read().text(lang, 'why.expired')}"
    page.wait_for_function("(told) => sessionStorage.said?.includes(told)", arg=told)


@pytest.mark.parametrize("lang", LANGUAGES)
def test_a_start_whose_nonce_comes_after_a_stop_is_not_carried_out(sit: Sit, lang: str) -> None:
    page = sit(lang=lang)
    begin(page)
    held = hold_back(page, "**/nonce")
    forward = page.locator("[data-command='m1.forward']")
    with page.expect_response("**/command/forward") as answer:
        forward.press("Enter")
        wait_for(page, held, 1)
        stop(page)
        held[0].continue_()
    assert answer.value.status == 410
    tells(page, "m1.forward", lang)
    expect(forward).to_have_attribute("data-state", "idle")


def test_what_was_confirmed_before_a_stop_is_not_carried_out_after_it(sit: Sit) -> None:
    page = sit()
    begin(page)
    with page.expect_response("**/command/forward"):
        page.press("[data-command='m1.forward']", "Enter")
    expect(page.locator("#message")).to_contain_text("Done", timeout=30_000)
    page.click("[data-command='m1.reverse']")
    asked = page.locator("#overlay [data-ask]")
    expect(asked).to_be_visible()
    held = hold_back(page, "**/nonce")
    with page.expect_response("**/command/reverse") as answer:
        asked.locator(".danger").press("Enter")
        wait_for(page, held, 1)
        expect(asked).to_have_count(0)
        stop(page)
        held[0].continue_()
    assert answer.value.status == 410
    tells(page, "m1.reverse", "en")


def test_a_button_that_is_held_before_its_lease_comes_does_not_move_after_a_stop(sit: Sit) -> None:
    """Somebody else stops the machine while what the button needs is on its way here."""
    page, other = sit(path="/equipment/m2"), sit(path="/equipment/m2")
    begin(page)
    page.locator(".zone fieldset label").nth(1).click()
    held = hold_back(page, "**/nonce")
    jog = page.locator("[data-hold='m2.jog_forward']")
    jog.focus()
    page.keyboard.down(" ")
    wait_for(page, held, 1)
    answers = [one.fetch() for one in held]
    with page.expect_response("**/hold/jog_forward") as answer:
        stop(other)
        for one, given in zip(held, answers, strict=True):
            one.fulfill(response=given)
    assert answer.value.status in (409, 410), "410: the page had seen the Stop; 409: the server alone knew of it"
    expect(page.locator("[data-held]")).to_have_count(0)
    page.keyboard.up(" ")
