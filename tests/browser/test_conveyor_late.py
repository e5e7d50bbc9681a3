"""A page of a line that was opened while nobody answered there."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import expect

from app.sim.training import REG_LINE_FAULT
from tests.browser.station import Sit, origin, serving, write
from tests.conftest import PogonServer, find_port
from tests.line_plant import plant

WHO, HOME = "ivana", "/"
SILENT, MODBUS = 3, find_port()


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PogonServer]:
    folder = tmp_path_factory.mktemp("late")
    (folder / "plant").mkdir()
    (folder / "plant" / "plant.toml").write_text(plant('start = "automatic", interval = 3'), "utf-8")
    with serving(folder, serve_modbus=f"127.0.0.1:{MODBUS}") as running:
        yield running


def test_a_line_that_answers_again_is_drawn_with_its_areas_and_products(sit: Sit) -> None:
    """What was not known is known now; the page is not loaded again for that."""
    page = sit()
    state = page.locator("[data-tag='c1.state']").first
    write(MODBUS, 10, REG_LINE_FAULT, SILENT)
    try:
        expect(state).to_have_attribute("data-q", "bad")
        page.goto(f"{origin(page)}/equipment/c1")
        expect(page.locator(".c-line h2 [data-tag='c1.state']")).to_have_attribute("data-q", "bad")
        expect(page.locator("[data-conveyor]")).to_be_visible()
        expect(page.locator(".c-mimic .c-area")).to_have_count(0)
        page.evaluate("window.same = true")
    finally:
        write(MODBUS, 10, REG_LINE_FAULT, 0)
    expect(page.locator(".c-mimic .c-area")).to_have_count(4)
    expect(page.locator(".c-line h2 [data-tag='c1.state']")).to_have_attribute("data-q", "good")
    expect(page.locator(".c-mimic .prod:not([display])").first).to_be_visible(timeout=30_000)
    assert page.evaluate("window.same") is True
