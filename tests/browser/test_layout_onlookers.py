"""Nothing is cut for who may only look: a guest, who is told to sign in, and a viewer, who is told that he may not."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Page

from tests.browser.looks import CUT, FAULTS, SIZES, open_page
from tests.browser.station import Sit, lay_out, serving, speak
from tests.browser.test_layout_machines import DEMO
from tests.conftest import PogonServer

WHO, HOME = "vera", "/"
SCREENS = SIZES | {"ten inches": (1024, 768, "desk")}
PATHS = (
    *(f"/equipment/{machine}{part}" for machine in DEMO for part in ("", "/faceplate")),
    *(f"/equipment/cr1/page/{name}" for name in ("hoist", "sequence")),
    *("/equipment/a1/page/words", "/equipment/a1/fault-buffer", "/equipment/c1/page/ramp"),
)


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PogonServer]:
    with serving(tmp_path_factory.mktemp("onlookers"), {"vera": ("viewer",)}) as running:
        yield running


@pytest.mark.parametrize(("who", "lang"), [("", "hr"), ("vera", "de")])
def test_what_may_not_be_pressed_is_whole_and_says_why(server: PogonServer, sit: Sit, who: str, lang: str) -> None:
    page = sit(who)
    speak(page, lang, server.url)
    found: list[str] = []
    for path in PATHS:
        open_page(page, server.url + path)
        for size, (width, height, profile) in SCREENS.items():
            lay_out(page, width, height, profile)
            faults = [*page.evaluate(FAULTS), *([] if size == "phone" else page.evaluate(CUT))]
            found += [f"{path} {size}: {one}" for one in faults]
            if not said(page):
                found.append(f"{path} {size}: nothing says why")
    assert found == [], "\n".join(["", *found])


def said(page: Page) -> bool:
    """Whether Stop, if the page has it, says why it cannot be pressed."""
    stop = page.locator(".cmd.stop")
    return not stop.count() or stop.first.locator("small").inner_text().strip() != ""
