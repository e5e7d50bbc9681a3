"""Figures of a machine that a fault holds are whole on a desk and on a panel of ten inches, whatever its axes say; lists scroll."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Page

from tests.browser.looks import FAULTS, open_page
from tests.browser.station import LANGUAGES, Sit, Stations, built, fault, heard, lay_out, origin, serving, speak
from tests.browser.test_layout import SIDEWAYS, WIDEST_COIL_CAR

DESKS = ((1280, 800), (1024, 768), (1366, 768), (1280, 720), (1920, 1080))
LIMITS = (11, 13)
"""Faults of a coil car: it stands at a limit switch of its travel, of its lift."""
LOWER = """() => { const one = document.querySelector('.cc-low > .panel > .panel-b');
  return one.scrollHeight > one.clientHeight ? [`figures end ${one.scrollHeight - one.clientHeight} px below their panel`] : []; }"""


@pytest.fixture(scope="module")
def coils(stations: Stations, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    """A page of the demo plant as it was built."""
    with serving(tmp_path_factory.mktemp("hurt"), {"ana": ("engineer", "operator")}) as running:
        seat = Sit(stations, running, {}, "ana", "/alarms")
        yield seat()
        seat.leave()


@pytest.mark.parametrize("lang", LANGUAGES)
def test_figures_of_a_coil_car_at_a_limit_switch_are_whole(coils: Page, lang: str) -> None:
    page, found = coils, []
    for code in LIMITS:
        fault(page, "cc1", code)
        heard(page, "cc1.limit_left")
        speak(page, lang, origin(page))
        open_page(page, f"{origin(page)}/equipment/cc1")
        for widest in ("() => 0", WIDEST_COIL_CAR):
            page.evaluate(widest)
            for width, height in DESKS:
                lay_out(page, width, height, "desk")
                wrong = [*page.evaluate(FAULTS), *page.evaluate(SIDEWAYS), *page.evaluate(LOWER)]
                found += [f"{code} {width}x{height}: {one}" for one in wrong]
    built(page, "cc1")
    assert found == [], "\n".join(["", *found])
