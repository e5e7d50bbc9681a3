"""A page enlarged to 400 % on 1280 pixels: all that is pressed can be brought into sight, a dialog too (WCAG 2.2, 1.4.10)."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import expect

from tests.browser.station import Sit, let_go, serving, stopped, take
from tests.conftest import PogonServer

WHO, HOME = "ana", "/equipment/m1"
HIDDEN = """(within) => {
  const found = document.documentElement.scrollWidth > innerWidth + 1 ? ['the page is wider than the screen'] : [];
  for (const one of document.querySelectorAll(`${within} :is(a[href], button, input, select, summary, textarea)`)) {
    const { width, height } = one.getBoundingClientRect();
    if (!one.checkVisibility({visibilityProperty: true}) || one.closest('.skip') || Math.min(width, height) < 2) continue;
    const seen = ['center', 'start', 'end'].some((block) => {
      one.scrollIntoView({block, inline: 'center'});
      const { left, top, right, bottom } = one.getBoundingClientRect();
      const at = document.elementFromPoint((left + right) / 2, (top + bottom) / 2);
      return at && (one.contains(at) || [...(one.labels ?? [])].some((label) => label.contains(at)));
    });
    if (!seen) found.push(`${(one.textContent.trim() || one.ariaLabel || one.name || one.tagName).slice(0, 40)} stays out of sight`);
  }
  return found;
}"""
"""What cannot be brought where it is pressed."""


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PogonServer]:
    """One Pogon with the whole demo plant and somebody who may do everything."""
    with serving(tmp_path_factory.mktemp("enlarged"), {"ana": ("operator", "engineer")}) as running:
        yield running


@pytest.mark.parametrize("height", [200, 256])
@pytest.mark.parametrize("path", ["/", "/alarms", "/equipment/m1", "/equipment/c1", "/equipment/cr1"])
def test_whatever_is_pressed_can_be_brought_into_sight(sit: Sit, path: str, height: int) -> None:
    page = sit(path=path, lang="de", viewport={"width": 320, "height": height})
    assert page.evaluate(HIDDEN, "body") == []
    if path.startswith("/equipment/"):
        expect(page.locator(".zone .stop").first).to_be_in_viewport(ratio=1)


@pytest.mark.parametrize("height", [200, 256])
def test_a_dialog_is_answered_beside_stop(sit: Sit, height: int) -> None:
    page = sit(lang="de", viewport={"width": 320, "height": height})
    take(page)
    page.press("[data-command='m1.forward']", "Enter")
    expect(page.locator("[data-command='m1.forward']")).to_have_attribute("data-state", "done", timeout=30_000)
    page.press("[data-command='m1.reverse']", "Enter")
    expect(page.locator("#overlay [data-ask]")).to_be_visible()
    assert page.evaluate(HIDDEN, "#overlay") == []
    assert page.locator("#overlay .dlg").evaluate("(one) => one.scrollHeight - one.clientHeight") <= 1
    page.keyboard.press("Escape")
    stopped(page)
    let_go(page)
