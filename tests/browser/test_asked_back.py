"""What is asked back beside a field: it closes as every dialog does, and when something else took its place it is gone."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import expect

from app.plant.texts import Texts
from tests.browser.station import LANGUAGES, Sit, serving, small, stopped, take
from tests.conftest import PogonServer

WHO, HOME = "ana", "/equipment/a1"
TARGET, VELOCITY = "#set-a1\\.set_target", "#set-a1\\.set_velocity"
TWO_MEANINGS = {"hr": "1.234", "en": "1,234", "de": "1.234", "cs": "1.234"}


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PogonServer]:
    """One Pogon with the axis of the demo plant and an operator."""
    with serving(small(tmp_path_factory.mktemp("asked"), "a1"), {"ana": ("operator",)}) as running:
        yield running


@pytest.mark.parametrize("lang", LANGUAGES)
def test_escape_closes_what_asks_which_number_was_meant(sit: Sit, lang: str) -> None:
    page = sit(lang=lang)
    take(page)
    page.fill(TARGET, TWO_MEANINGS[lang])
    page.press(TARGET, "Enter")
    asked = page.locator(".review-form")
    expect(asked.locator("[name=argument]").first).to_be_focused()
    page.keyboard.press("Escape")
    expect(asked).to_have_count(0)
    expect(page.locator(TARGET)).to_be_focused()
    expect(page.locator(TARGET)).to_have_value(TWO_MEANINGS[lang])


def test_what_asked_before_takes_no_focus_from_another_field(sit: Sit) -> None:
    """Half a minute later: its place was taken by the answer to another value, so there is nothing that could close by itself."""
    page = sit()
    page.clock.install()
    page.reload()
    expect(page.locator("body")).to_have_attribute("data-live", "live")
    take(page)
    page.fill(TARGET, "1,234")
    page.press(TARGET, "Enter")
    expect(page.locator(".review-form")).to_be_visible()
    page.fill(TARGET, "nothing")
    page.press(TARGET, "Enter")
    expect(page.locator(".review-form")).to_have_count(0)
    refused = Texts.read().text("en", "why.not_a_number").format(text="nothing")
    expect(page.locator("#message span")).to_have_text(f"A1 Set target position: {refused}")
    page.focus(VELOCITY)
    page.clock.fast_forward(31_000)
    page.clock.run_for(1_000)
    expect(page.locator(VELOCITY)).to_be_focused()
    expect(page.locator("#message span")).not_to_have_text(Texts.read().text("en", "operate.cancelled"))


def test_stop_closes_what_asks_which_number_was_meant(sit: Sit) -> None:
    page = sit()
    take(page)
    page.fill(TARGET, "1,234")
    page.press(TARGET, "Enter")
    expect(page.locator(".review-form")).to_be_visible()
    stopped(page)
    expect(page.locator(".review-form")).to_have_count(0)
    expect(page.locator(TARGET)).to_have_value("1,234")
