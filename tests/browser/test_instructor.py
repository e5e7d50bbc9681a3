"""An instructor breaks a machine in a real browser and sees what became of it; plant files are taken while the page is open."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, StorageState, expect

from app.web.terminal import LOOK, ask
from tests.browser.station import AXE, PASSWORD, Sit, built, serving, small, some_of_the_demo
from tests.conftest import PogonServer

WHO, HOME = "ivana", "/"
DEMO = some_of_the_demo("m1", "m2")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return small(tmp_path_factory.mktemp("lesson"), "m1", "m2") / "plant"


@pytest.fixture(scope="module")
def server(folder: Path) -> Iterator[PogonServer]:
    """One Pogon with a plant whose files are changed."""
    with serving(folder.parent, people={}) as running:
        yield running


@pytest.fixture(scope="module")
def sessions(browser: Browser, server: PogonServer) -> dict[str, StorageState]:
    """The first account, made as a newcomer makes it."""
    page = browser.new_page(locale="en-GB")
    page.goto(f"{server.url}/first")
    code = (server.data / "first-code").read_text().split()[-1]
    given = {"code": code, "name": "ivana", "display": "Ivana Horvat", "password": PASSWORD, "again": PASSWORD}
    for name, value in given.items():
        page.fill(f"[name={name}]", value)
    page.click(".sheet-form button.cmd")
    expect(page.locator("body")).to_contain_text("Ivana Horvat")
    state = page.context.storage_state()
    page.close()
    return {"ivana": state}


@pytest.fixture
def engineer(sit: Sit, server: PogonServer, folder: Path) -> Page:
    """The overview of the demo plant as its files and its devices are delivered, whatever went on before."""
    (folder / "plant.toml").write_text(DEMO, "utf-8")
    found = ask(server.data, LOOK, "test")
    assert not found["problems"]
    if found["changes"]:
        assert ask(server.data, found["digest"], "test")["done"]
    page = sit()
    for machine in ("m1", "m2"):
        built(page, machine)
    return page


def test_a_fault_is_caused_seen_and_its_cause_cleared(engineer: Page) -> None:
    page = engineer
    page.click(".tabs a[href='/communication']")
    page.click(".tabs a[href='/instructor']")
    page.click("a[href='/instructor/m1']")
    expect(page.locator(".in-live")).to_contain_text("Running forward")
    page.get_by_text("ESP – external fault").click()
    expect(page.locator(".in-fault label:has(:checked) small")).to_contain_text("the motor coasts")
    page.get_by_role("button", name="Inject fault").click()
    expect(page.locator(".in-now")).to_contain_text("Read back: Machine fault")
    expect(page.locator(".in-active .in-on")).to_contain_text("ESP – external fault")
    expect(page.locator(".in-live")).to_contain_text("ESP – external fault")
    page.get_by_role("button", name="Remove fault").click()
    expect(page.locator(".in-active")).to_contain_text("No fault injected")
    expect(page.locator(".in-live")).to_contain_text(
        "ESP – external fault"
    )  # the drive stays tripped until it is reset


def test_what_ran_down_by_itself_leaves_the_page_by_itself(engineer: Page) -> None:
    page = engineer
    page.goto(page.url.rstrip("/") + "/instructor/m2")
    page.get_by_text("Silent", exact=True).click()
    page.fill("#in-count", "4")
    page.get_by_role("button", name="Inject line fault").click()
    expect(page.locator(".in-now")).to_contain_text("Read back: Line fault")
    expect(page.locator(".in-active")).to_contain_text("No fault injected", timeout=60_000)


def test_plant_files_are_taken_while_the_overview_is_open(engineer: Page, folder: Path) -> None:
    page, home = engineer, engineer.url
    (folder / "plant.toml").write_text(DEMO.replace('en = "Fan 2"', 'en = "Fan East"'), "utf-8")
    other = page.context.new_page()
    other.goto(home + "plant")
    expect(other.locator(".p-changes")).to_contain_text("Equipment m2: changed")
    other.get_by_text("I have read the changes").click()
    other.get_by_role("button", name="Take the changes").click()
    expect(other.locator("body")).to_contain_text("The changes were taken.")
    expect(page.locator("body")).to_have_attribute("data-live", "live")
    page.goto(home)
    expect(page.locator("#content")).to_contain_text("Fan East")


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_axe_finds_nothing(engineer: Page, folder: Path, theme: str) -> None:
    page, home = engineer, engineer.url
    page.context.add_cookies([{"name": "pogon_theme", "value": theme, "url": home}])
    (folder / "plant.toml").write_text(DEMO.replace('en = "Fan 2"', 'en = "Fan East"'), "utf-8")
    for path in ("instructor", "instructor/m1", "plant"):
        page.goto(home + path)
        page.evaluate(AXE.read_text("utf-8"))
        found = page.evaluate("axe.run().then(r => r.violations.map(v => [v.id, v.nodes.map(n => n.html)]))")
        assert found == [], (path, found)
