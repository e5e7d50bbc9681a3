"""Diverting gates in a real browser: into the lane and back by hand, refused in automatic, counted, nothing cut at any size."""

import re
from collections.abc import Iterator

import pytest
from playwright.sync_api import expect

from app import bundled
from tests.browser.looks import SIZES, looked_at
from tests.browser.station import LANGUAGES, Sit, lay_out, serving, take
from tests.browser.test_conveyor_by_hand import manual
from tests.conftest import PogonServer

WHO, HOME = "ivana", "/equipment/c5"
STANDS = """
[equipment.c6]
type = "conveyor"
link = "line"
unit = 2
label = { hr = "Traka 6", en = "Conveyor 6", de = "Förderer 6", cs = "Dopravník 6" }
gates = 1
simulation = { start = "stopped", arrivals = 0 }
"""
"""A line of the simplest, which stands empty."""


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PogonServer]:
    """One Pogon with the sorting line, and one with a gate that stands."""
    folder = tmp_path_factory.mktemp("gates")
    (folder / "plant").mkdir()
    plant = (
        (bundled("plants/belts") / "plant.toml")
        .read_text("utf-8")
        .replace("[links.line]\n", "[links.line]\nwrites = true\n")
    )
    every = plant.replace("gate_1_at = 580", "gate_1_at = 330").replace("gate_1_rule = 1 ", "gate_1_rule = 4 ")
    (folder / "plant" / "plant.toml").write_text(f"{every.replace('interval = 12', 'interval = 6')}\n{STANDS}", "utf-8")
    with serving(folder) as running:
        yield running


@pytest.mark.parametrize("lang", LANGUAGES)
def test_nothing_of_a_line_with_gates_is_cut_at_any_size(sit: Sit, server: PogonServer, lang: str) -> None:
    page = sit(lang=lang)
    assert looked_at(page, server.url, (HOME, f"{HOME}/faceplate"), lang) == []
    page.goto(server.url + HOME)
    expect(page.locator("body")).to_have_attribute("data-live", "live")
    page.locator(".c-gates > summary").click()
    for size, (width, height, profile) in SIZES.items():
        lay_out(page, width, height, profile)
        inside = page.locator(".c-gates .cmd").evaluate_all(
            """(all) => all.map((one) => {
              const { left, right, top, bottom, height } = one.getBoundingClientRect(), name = document.createRange();
              name.selectNode(one.querySelector('.cmd-t').firstChild);
              const said = name.getBoundingClientRect();
              return left >= 0 && right <= innerWidth && top >= 0 && bottom <= innerHeight && height >= 44
                && said.left > left && said.right < right && said.top > top && said.bottom < bottom;
            })"""
        )
        assert inside == [True] * 4, (lang, size)


def test_a_product_goes_into_the_lane_and_is_counted(sit: Sit) -> None:
    page = sit()
    count = page.locator(".c-gate .m-sub").first
    expect(count).to_contain_text(re.compile(r"[1-9]\d*\s*$"), timeout=90_000)
    page.goto(page.url + "/events")
    expect(page.locator("main")).to_contain_text("Product diverted")


def test_a_gate_is_turned_by_hand_and_not_in_automatic(sit: Sit) -> None:
    page = sit(path="/equipment/c6", viewport={"width": 800, "height": 480})
    take(page)
    page.locator(".c-gates > summary").click()
    lane, straight = (page.locator(f"[data-part='c6.gate_{way}_1']") for way in ("lane", "straight"))
    why = page.locator("[data-part='c6.gatewhy1']")
    expect(lane).to_have_attribute("aria-disabled", "true")
    expect(why).to_have_text("Gate 1 is turned by its rule: select manual first")
    page.keyboard.press("Escape")
    manual(page)
    drop = page.locator(".c-gates")
    if drop.get_attribute("open") is None:
        page.locator(".c-gates > summary").click()
    expect(lane).not_to_have_attribute("aria-disabled", "true", timeout=30_000)
    expect(why).to_be_empty()
    drawn = page.locator(".c-gate").first
    lane.click()
    expect(drawn).to_have_class(re.compile(r"\blane\b"), timeout=30_000)
    expect(page.locator("#message")).to_contain_text(
        re.compile("Gate 1 into the lane: Accepted .* Done"), timeout=30_000
    )
    straight.click()
    expect(drawn).to_have_class(re.compile(r"\bstraight\b"), timeout=30_000)
    expect(page.locator("#message")).to_contain_text(re.compile("Gate 1 straight on: Accepted .* Done"), timeout=30_000)
