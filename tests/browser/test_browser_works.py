"""The browser of this machine, before any page of ours: whether it starts, scripts, and reaches a Pogon."""

from playwright.sync_api import Page

from tests.conftest import PogonServer


def test_chromium_reaches_a_pogon(page: Page, demo: PogonServer) -> None:
    answer = page.goto(f"{demo.url}/healthz")
    assert answer is not None and answer.status == 200
    assert page.evaluate("1 + 1") == 2
