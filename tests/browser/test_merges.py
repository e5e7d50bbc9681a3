"""Merging gates in a real browser: opened and closed by hand, what came in counted and named, nothing cut at any size."""

import re
from collections.abc import Iterator

import pytest
from playwright.sync_api import expect

from app import bundled
from tests.browser.looks import SIZES, looked_at
from tests.browser.station import LANGUAGES, Sit, lay_out, serving, take
from tests.conftest import PogonServer

WHO, HOME = "ivana", "/equipment/c5"
JOINED = """
merges = 2
merge_1_at = 740
merge_1_mode = 2
merge_2_at = 1300
merge_2_limit = 30
"""
LANES = "interval = 9, lane_interval = 9, longest = 40"


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PogonServer]:
    """One Pogon with the sorting line, which two lanes join."""
    folder = tmp_path_factory.mktemp("merges")
    (folder / "plant").mkdir()
    plant = (bundled("plants/belts") / "plant.toml").read_text("utf-8")
    plant = plant.replace("[links.line]\n", "[links.line]\nwrites = true\n").replace("interval = 12", LANES)
    (folder / "plant" / "plant.toml").write_text(plant.replace("\ngates = 2", f"{JOINED}gates = 2"), "utf-8")
    with serving(folder) as running:
        yield running


@pytest.mark.parametrize("lang", LANGUAGES)
def test_nothing_of_a_line_with_merges_is_cut_at_any_size(sit: Sit, server: PogonServer, lang: str) -> None:
    page = sit(lang=lang)
    assert looked_at(page, server.url, (HOME, f"{HOME}/faceplate"), lang) == []
    page.goto(server.url + HOME)
    expect(page.locator("body")).to_have_attribute("data-live", "live")
    page.locator(".c-gates > summary").click()
    menu = page.locator(".c-gates > .menu")
    for size, (width, height, profile) in SIZES.items():
        lay_out(page, width, height, profile)
        inside = page.locator(".c-three .cmd").evaluate_all(
            """(all) => all.map((one) => {
              one.scrollIntoView({ block: "nearest" });
              const { left, right, top, bottom, height } = one.getBoundingClientRect(), name = document.createRange();
              name.selectNode(one.querySelector('.cmd-t').firstChild);
              const said = name.getBoundingClientRect();
              return left >= 0 && right <= innerWidth && top >= 0 && bottom <= innerHeight && height >= 44
                && said.left >= left && said.right <= right && said.top > top && said.bottom < bottom;
            })"""
        )
        assert inside == [True] * 6, (lang, size)
        assert menu.evaluate("(one) => one.scrollWidth <= one.clientWidth + 1"), (lang, size)


def test_what_comes_in_is_counted_and_its_row_names_the_lane(sit: Sit) -> None:
    page = sit()
    expect(page.locator(".c-merge").first).to_be_visible()
    expect(page.locator(".c-from").first).to_have_text(re.compile(r"^M[12]$"), timeout=90_000)
    page.goto(page.url + "/events")
    expect(page.locator("main")).to_contain_text("Product merged")


def test_a_merge_is_closed_by_hand_and_its_lane_waits(sit: Sit) -> None:
    page = sit(viewport={"width": 800, "height": 480})
    take(page)
    page.locator(".c-gates > summary").click()
    closed, automatic = (page.locator(f"[data-part='c5.merge_{way}_2']") for way in ("close", "automatic"))
    closed.click()
    expect(page.locator("#message")).to_contain_text(re.compile("Close merge 2: Accepted .* Done"), timeout=30_000)
    drawn = page.locator(".c-merge").last
    expect(drawn).to_have_class(re.compile(r"\b(waits|blocked)\b"), timeout=60_000)
    automatic.click()
    expect(page.locator("#message")).to_contain_text(re.compile("Merge 2 automatic: Accepted .* Done"), timeout=30_000)
