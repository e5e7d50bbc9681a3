"""The first account is made on a page that shows all of it at once, and is made there."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from tests.browser.station import LANGUAGES, PASSWORD, serving, small, speak
from tests.conftest import PogonServer


@pytest.fixture
def server(tmp_path: Path) -> Iterator[PogonServer]:
    """One for each test: once there is an account, the page is gone."""
    with serving(small(tmp_path, "m1"), people={}) as running:
        yield running


@pytest.mark.always
def test_all_of_it_is_seen_on_a_desk_in_every_language(page: Page, server: PogonServer) -> None:
    for lang in LANGUAGES:
        speak(page, lang, server.url)
        page.goto(f"{server.url}/first")
        last = page.locator(".sheet .btn.quiet").bounding_box()
        assert last and last["y"] + last["height"] <= 800, lang
        whole, seen = page.locator(".sheet .body").evaluate("(one) => [one.scrollHeight, one.clientHeight]")
        assert whole <= seen, f"{lang}: {whole} px in {seen}"
    page.set_viewport_size({"width": 390, "height": 844})
    columns = page.locator(".sheet-form .pair").first.evaluate("(one) => getComputedStyle(one).gridTemplateColumns")
    assert len(columns.split()) == 1, "on a phone one below the other"


def test_the_account_is_made_from_above_to_below_by_the_keyboard(page: Page, server: PogonServer) -> None:
    page.goto(f"{server.url}/first")
    code = (server.data / "first-code").read_text().split()[-1]
    for text in (code, "ana", "Ana Kos"):
        page.keyboard.type(text)
        page.keyboard.press("Tab")
    page.keyboard.type(PASSWORD)
    page.keyboard.press("Tab")
    page.keyboard.press("Tab")
    page.keyboard.type(PASSWORD)
    page.keyboard.press("Enter")
    expect(page.locator("body")).to_contain_text("Ana Kos")
