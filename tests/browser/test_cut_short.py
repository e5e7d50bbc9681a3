"""A motion that something else than the hand ended: why stays said when the machine stands."""

import re
from collections.abc import Iterator

import pytest
from playwright.sync_api import Locator, Page, expect

from app.plant.texts import Texts
from tests.browser.station import Sit, built, fault, serving, small, take
from tests.conftest import PogonServer

WHO, HOME = "ana", "/equipment/m2"


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PogonServer]:
    """One Pogon with the drives of the demo plant, and somebody who may also break them."""
    people = {"ana": ("operator", "engineer", "admin")}
    with serving(small(tmp_path_factory.mktemp("cut"), "m1", "m2"), people) as running:
        yield running


@pytest.fixture
def page(sit: Sit) -> Page:
    """Somebody who holds the button of a machine that moves."""
    page = sit()
    built(page, "m2")
    take(page)
    page.locator(".zone fieldset label").nth(1).click()
    jog = page.locator("[data-hold='m2.jog_forward']")
    expect(jog).not_to_have_attribute("aria-disabled", "true", timeout=30_000)
    jog.hover()
    page.mouse.down()
    expect(message(page)).to_contain_text(said("fb.accepted"), timeout=30_000)
    return page


def message(page: Page) -> Locator:
    return page.locator("#message span")


def said(key: str) -> str:
    return Texts.read().text("en", key)


def test_by_a_window_over_the_page(page: Page) -> None:
    page.keyboard.press("F1")
    expect(page.locator("[data-held]")).to_have_count(0)
    expect(message(page)).to_contain_text(re.compile("→ Done .*: Movement stopped: "), timeout=30_000)


def test_by_a_fault_of_the_machine(page: Page) -> None:
    fault(page, "m2", 13)
    expect(page.locator("[data-held]")).to_have_count(0)
    expect(message(page)).to_contain_text(re.compile("→ (Done|Failed) .*: Movement stopped: "), timeout=30_000)
    page.mouse.up()


def test_who_lets_go_reads_no_cause(page: Page) -> None:
    page.mouse.up()
    expect(message(page)).to_contain_text(said("fb.confirmed"), timeout=30_000)
    expect(message(page)).not_to_contain_text(said("hold.cause.released"))
