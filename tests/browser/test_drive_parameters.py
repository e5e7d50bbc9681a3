"""Drive parameters in two browsers: one writes and saves while the other reads, each with a list of its own."""

import re
import shutil
from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, expect

from app import bundled
from tests.browser.station import PASSWORD, Sit, serving, take
from tests.conftest import PogonServer

WHO, HOME = "ivana", "/equipment/d2/drive-parameters?group=ramp"


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PogonServer]:
    """One Pogon with the two drives of the bundled plant, and two engineers."""
    folder = tmp_path_factory.mktemp("drives")
    shutil.copytree(bundled("plants/sinamics"), folder / "plant")
    with serving(folder, {"ivana": ("engineer", "operator"), "petra": ("engineer", "operator")}) as running:
        yield running


def choose(page: Page, code: str, value: str) -> None:
    page.locator(f"tr[data-code={code}] .dp-add button").click()
    field = page.locator(f"#dw [data-element$=':{code}'] input[name=value]")
    field.fill(value)


def review(page: Page) -> None:
    page.locator("#dw-form button.edge").click()
    expect(page.locator("#dw form[data-order] [name=password]").first).to_be_visible(timeout=15_000)


def order(page: Page, action: str) -> None:
    form = page.locator(f"#dw form[action$='/{action}']")
    form.locator("[name=reason]").fill("longer ramps")
    form.locator("[name=password]").fill(PASSWORD)
    form.locator("button").click()


def test_one_writes_and_saves_while_the_other_reads(sit: Sit) -> None:
    page, other = sit(), sit("petra")
    take(page)
    choose(page, "p1120", "7.5")
    choose(page, "p1121", "8")
    expect(page.locator("#dw [data-element='2:p1120'] input[name=value]")).to_have_value(
        "7.5"
    )  # what was typed is kept
    review(page)
    expect(page.locator("#dw [data-element='2:p1120'] .rv-v")).to_have_text(re.compile(r"5\s*7\.5\s*s"))
    other.locator(".dp-read button").click()
    order(page, "write")
    expect(page.locator("#dw [data-result='1:p1120']")).to_have_attribute("data-done", "yes", timeout=20_000)
    expect(page.locator("#dw [data-result='1:p1121']")).to_have_attribute("data-done", "yes")
    expect(page.locator("#dw .dw-save")).to_contain_text("Unsaved changes: 2")
    expect(other.locator("#dp progress")).to_have_count(0, timeout=20_000)
    expect(other.locator("tr[data-code=p1135] td.r").first).to_have_text(re.compile(r"\d"))

    # who is not in control is told so, and the drive keeps what the first one wrote
    choose(other, "p1120", "3")
    review(other)
    expect(other.locator("#dw [data-element='1:p1120'] .rv-v")).to_contain_text("7.5")
    order(other, "write")
    expect(other.locator("#dw .dw-bad")).to_contain_text("Control held by", timeout=20_000)

    order(page, "save")
    expect(page.locator("#dw .dw-save")).to_contain_text("Nothing unsaved", timeout=20_000)
    page.locator(".dp-read button").click()
    expect(page.locator("tr[data-code=p1120] td.r").first).to_contain_text("7.5", timeout=20_000)
