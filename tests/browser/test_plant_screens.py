"""A screen of the plant's own in a browser: its values live, what a trip and a pulled cable show, its links by keyboard."""

import shutil
from collections.abc import Callable
from pathlib import Path

from playwright.sync_api import Page, expect

from app import bundled
from app.sim.training import REG_LINE_FAULT, REG_MACHINE_FAULT
from tests.browser.station import write
from tests.conftest import PogonServer, find_port

ENDS = """() => {
    const letters = document.createRange();
    letters.selectNodeContents(document.querySelector(".drawn .val i"));
    return [letters, document.querySelector(".drawn rect")].map((one) => one.getBoundingClientRect().right);
}"""


def test_a_value_whose_text_ends_somewhere_ends_there_whatever_its_unit(
    page: Page, pogon_server: Callable[..., PogonServer], tmp_path: Path
) -> None:
    folder = shutil.copytree(bundled("plants/hall"), tmp_path / "plant")
    (folder / "screens" / "one.svg").write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 400 100"><rect width="300" height="100" fill="none"/>'
        '<text x="300" y="50" text-anchor="end" data-tag="m1.current"/></svg>', "utf-8"
    )  # fmt: skip
    page.goto(f"{pogon_server(plant=folder).url}/screens/one")
    letters, place = page.evaluate(ENDS)
    assert abs(letters - place) < 4


def test_a_picture_shows_what_its_machines_do_and_what_nobody_knows(
    page: Page, pogon_server: Callable[..., PogonServer]
) -> None:
    modbus = find_port()
    server = pogon_server(plant=bundled("plants/hall"), serve_modbus=f"127.0.0.1:{modbus}")
    page.goto(f"{server.url}/screens/hall")
    expect(page.locator("body")).to_have_attribute("data-live", "live")
    speed, fan = (
        page.locator(f'.drawn {kind}[data-tag="m1.{key}"]') for kind, key in ((".val", "speed"), ("circle", "running"))
    )
    expect(speed).to_have_attribute("data-q", "good")
    expect(speed.locator("i")).to_be_visible()
    expect(fan).to_have_class("d-body d-run")

    sign = page.locator('.drawn [data-mark-of="m1"] svg')
    expect(sign).to_have_count(0)
    write(modbus, 1, REG_MACHINE_FAULT, 13)
    expect(sign).to_be_visible()
    expect(fan).to_have_class("d-body")

    write(modbus, 2, REG_LINE_FAULT, 3)  # unit 2 is silent
    other, lost = page.locator('.drawn circle[data-tag="m2.running"]'), page.locator('.drawn .val[data-tag="m2.speed"]')
    expect(lost).to_have_attribute("data-q", "bad")
    expect(lost.locator("b")).to_have_text("----")
    expect(other).to_have_class("d-body d-unknown")
    write(modbus, 2, REG_LINE_FAULT, 0)
    expect(other).to_have_class("d-body")
    expect(lost).to_have_attribute("data-q", "good")

    link = page.locator('.drawn a[href="/equipment/m1"]')
    link.focus()
    page.keyboard.press("Enter")
    page.wait_for_url("**/equipment/m1")
    page.go_back()
    expect(page.locator("body")).to_have_attribute("data-live", "live")
    server.process.kill()
    expect(page.locator("body")).to_have_attribute("data-live", "offline", timeout=15_000)
