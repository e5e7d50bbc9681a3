"""The browser of this machine, before any page of ours: whether it starts, scripts, and reaches a Pogon."""

from collections.abc import Callable

from playwright.sync_api import Page

from tests.conftest import PogonServer


def test_chromium_reaches_a_pogon(page: Page, pogon_server: Callable[..., PogonServer]) -> None:
    server = pogon_server()
    answer = page.goto(f"{server.url}/healthz")
    assert answer is not None and answer.status == 200
    assert page.evaluate("1 + 1") == 2
