"""A screen of the plant's own in a browser: its values live, what a broken line takes away, its links by keyboard."""

from collections.abc import Callable

from playwright.sync_api import Page, expect

from tests.conftest import PogonServer


def test_a_value_lives_a_part_leads_to_its_machine_and_a_lost_server_is_told(
    page: Page, pogon_server: Callable[..., PogonServer]
) -> None:
    server = pogon_server()
    page.goto(f"{server.url}/screens/hall")
    expect(page.locator("body")).to_have_attribute("data-live", "live")
    speed = page.locator('.drawn [data-tag="m1.speed"]')
    expect(speed).to_have_attribute("data-q", "good")
    expect(speed.locator("i")).to_be_visible()
    before = page.locator('.drawn [data-tag="c1.products"] b').inner_text()
    expect(page.locator('.drawn [data-tag="c1.products"] b')).not_to_have_text(before, timeout=60_000)
    link = page.locator('.drawn a[href="/equipment/m1"]')
    link.focus()
    page.keyboard.press("Enter")
    page.wait_for_url("**/equipment/m1")
    page.go_back()
    expect(page.locator("body")).to_have_attribute("data-live", "live")
    server.process.kill()
    expect(page.locator("body")).to_have_attribute("data-live", "offline", timeout=15_000)
