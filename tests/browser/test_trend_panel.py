"""The small trend of a machine has a height wherever a screen puts it."""

import pytest
from playwright.sync_api import Page

from tests.conftest import ROOT

STYLES = "".join((ROOT / "static" / "css" / name).read_text("utf-8") for name in ("base.css", "plot.css"))


@pytest.mark.parametrize(
    "around",
    ["<section class='panel'><div class='panel-b tight'>{}</div></section>", "<div>{}</div>", "<td>{}</td>", "{}"],
)
def test_a_trend_outside_a_grid_does_not_collapse(page: Page, around: str) -> None:
    panel = '<div class="t-mini" role="img"><div class="uplot"></div></div>'
    page.set_content(f"<style>{STYLES}</style><main>{around.format(panel)}</main>")
    box = page.locator(".t-mini").bounding_box()
    assert box and box["height"] >= 100
