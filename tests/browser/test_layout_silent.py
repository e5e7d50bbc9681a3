"""While every line of the plant is cut and alarms flood, what is not known is told on every screen: nothing is broken, cut or covered."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, expect

from tests.browser.looks import AXE_RUN, CUT, FAULTS, SIZES, open_page
from tests.browser.station import AXE, LANGUAGES, Sit, Stations, fault, instruct, lay_out, origin, serving, speak
from tests.browser.test_layout_machines import MACHINES

SCREENS = {
    "small": SIZES["small"],
    "phone": SIZES["phone"],
    "ten inches": (1024, 768, "desk"),
    "upright": (768, 1024, "desk"),
}
TRIPPED = {"m1": 26, "c1": 50, "cc1": 50, "cr1": 90, "a1": 7452}
"""Machine → the fault that it had before its line was cut."""
CUT_OFF = {"mode": "1", "delay": "0", "argument": "0", "count": "0"}


@pytest.fixture(scope="module")
def silent(stations: Stations, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    """A page of the demo plant that hears of none of its machines, each of which had tripped; `m2` has not, and is heard."""
    with serving(tmp_path_factory.mktemp("silent"), {"ana": ("admin", "engineer", "operator")}) as running:
        seat = Sit(stations, running, {}, "ana", "/alarms")
        page = seat()
        for machine, code in TRIPPED.items():
            fault(page, machine, code)
            expect(page.locator("#content .alist", has_text=machine).first).to_be_visible()
        for machine in MACHINES:
            if machine != "m2":
                instruct(page, f"{machine}/line", **CUT_OFF)
        expect(page.locator("#content tr[data-row]", has_text="no communication").nth(3)).to_be_visible(timeout=30_000)
        yield page
        seat.leave()


def looked(page: Page, paths: tuple[str, ...], lang: str) -> list[str]:
    """What is wrong with these pages in a language on any screen."""
    found: list[str] = []
    speak(page, lang, origin(page))
    for path in paths:
        open_page(page, origin(page) + path)
        for size, (width, height, profile) in SCREENS.items():
            lay_out(page, width, height, profile)
            wrong = [*page.evaluate(FAULTS), *([] if size == "phone" else page.evaluate(CUT))]
            found += [f"{lang} {path} {size}: {one}" for one in wrong]
    return found


@pytest.mark.parametrize("lang", LANGUAGES)
def test_an_overview_of_machines_that_say_nothing_is_whole(silent: Page, lang: str) -> None:
    found = looked(silent, ("/", "/alarms"), lang)
    assert found == [], "\n".join(["", *found])


@pytest.mark.parametrize("lang", ["hr", "de"])
def test_a_machine_that_says_nothing_is_whole(silent: Page, lang: str) -> None:
    found = looked(silent, tuple(f"/equipment/{machine}" for machine in MACHINES if machine != "m2"), lang)
    assert found == [], "\n".join(["", *found])


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_what_is_not_known_has_no_barrier_in_any_theme(silent: Page, theme: str) -> None:
    """Faulted, stale and dead: what is drawn for that has the contrast of everything else."""
    speak(silent, "en", origin(silent))
    lay_out(silent, 1280, 800, "desk")
    silent.context.add_cookies([{"name": "pogon_theme", "value": theme, "url": origin(silent)}])
    found: list[str] = []
    for path in ("/", "/alarms", "/communication", *(f"/equipment/{machine}" for machine in MACHINES)):
        open_page(silent, origin(silent) + path)
        silent.evaluate(AXE.read_text("utf-8"))
        found += [f"{path}: {one}" for one in silent.evaluate(AXE_RUN)]
    silent.context.add_cookies([{"name": "pogon_theme", "value": "auto", "url": origin(silent)}])
    assert found == [], "\n".join(["", *found])
