"""The encoder of an axis is adjusted in one browser while another one looks on; a drive that tells nothing ends it with the cause."""

import re
from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, expect

from app.sim.sinamics.mailbox import MailboxFault
from app.sim.sinamics.training import REG_MAILBOX
from tests.alarms.test_alarms_survive import write
from tests.browser.station import PASSWORD, SIZES, Sit, serving, take
from tests.conftest import PogonServer, find_port
from tests.web.test_encoder_adjustment import plant_with_an_axis

WHO, HOME = "ivana", "/equipment/d1/encoder"


@pytest.fixture(scope="module")
def port() -> int:
    """Where the virtual drives answer Modbus."""
    return find_port()


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory, port: int) -> Iterator[PogonServer]:
    """One Pogon with an axis that stands, and two engineers."""
    folder = tmp_path_factory.mktemp("axis")
    plant_with_an_axis(folder)
    people = {"ivana": ("engineer", "operator"), "petra": ("engineer", "operator")}
    with serving(folder, people, serve_modbus=f"127.0.0.1:{port}") as running:
        yield running


def order(page: Page, action: str, **typed: str) -> None:
    form = page.locator(f"form[data-order][action$='/{action}']")
    for name, value in {"reason": "new encoder", "password": PASSWORD, **typed}.items():
        form.locator(f"[name={name}]").fill(value)
    form.locator("button").last.click()


def step(page: Page, key: str, state: str) -> None:
    expect(page.locator(f"[data-step={key}]")).to_have_attribute("data-state", state, timeout=20_000)


def test_one_adjusts_and_saves_while_the_other_looks_on(sit: Sit) -> None:
    page, other = sit(), sit("petra")
    page.locator(".dp-read button").click()
    expect(page.locator("[data-code=p2507] dd")).to_contain_text("Not adjusted", timeout=20_000)
    expect(page.locator("[data-why]")).to_be_visible()  # nobody has the control
    page.locator("[name=coordinate]").fill("12000")
    take(page)
    expect(page.locator("[data-why]")).to_have_count(0)
    expect(page.locator("[name=coordinate]")).to_have_value("12000")  # what was typed stays
    order(page, "start", coordinate="12000")
    for key in ("read", "coordinate", "start", "wait", "verify"):
        step(page, key, "done")
        step(other, key, "done")
    expect(page.locator("[data-step=verify]")).to_contain_text(re.compile(r"r2521 = 12.000"))
    expect(other.locator("[data-step=wait]")).to_contain_text("Adjusted")
    order(page, "save")
    step(page, "save", "done")
    step(other, "save", "done")
    expect(page.locator(".dw")).to_contain_text("saved to ROM")
    for name, (width, height) in SIZES.items():
        page.set_viewport_size({"width": width, "height": height})
        assert page.evaluate("document.documentElement.scrollWidth") <= width, name


def test_a_drive_that_tells_nothing_ends_it_with_the_cause_and_nothing_was_written(sit: Sit, port: int) -> None:
    page = sit()
    take(page)
    page.locator(".dp-read button").click()
    expect(page.locator("[data-code=p2507] dd")).to_be_visible(timeout=20_000)
    write(port, 1, REG_MAILBOX, MailboxFault.INTERNAL)
    start = page.locator("form[data-order][action$='/start'] [name=reason]")
    page.wait_for_load_state("networkidle")  # what was read has its place: an adjusted drive keeps the form closed
    if not start.is_visible():
        page.locator(".dw details summary").click()
    expect(start).to_be_visible()
    order(page, "start", coordinate="-5")
    step(page, "read", "failed")
    expect(page.locator("[data-step=read] .enc-why")).to_contain_text("internal error")
    expect(page.locator("[data-step=coordinate]")).to_have_attribute("data-state", "waiting")
    expect(page.locator(".dw .dw-bad")).to_contain_text("internal error")
    write(port, 1, REG_MAILBOX, 0)
    order(page, "start", coordinate="-5")
    step(page, "verify", "done")
