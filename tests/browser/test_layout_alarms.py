"""While alarms stand and a drive is tripped, every command of every machine is above Stop, for who holds it and for who does not."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, expect

from tests.browser.looks import CUT, FAULTS, open_page
from tests.browser.station import LANGUAGES, Sit, Stations, fault, lay_out, let_go, origin, serving, speak, take
from tests.browser.test_layout_machines import MACHINES

DESKS = ((1280, 800), (1024, 768), (1366, 768), (1280, 720))
TRIPPED = {"m1": 13, "a1": 7900}
"""Machine → the fault that it has."""


@pytest.fixture(scope="module")
def tripped(stations: Stations, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    """A page of the demo plant whose motor and axis have tripped: their commands say at length why they cannot be pressed."""
    with serving(tmp_path_factory.mktemp("tripped"), {"ana": ("admin", "engineer", "operator")}) as running:
        seat = Sit(stations, running, {}, "ana", "/alarms")
        page = seat()
        for machine, code in TRIPPED.items():
            fault(page, machine, code)
            expect(page.locator("#content .alist", has_text=machine).first).to_be_visible()
        yield page
        seat.leave()


@pytest.mark.parametrize("lang", LANGUAGES)
def test_no_command_is_below_stop_while_alarms_stand(tripped: Page, lang: str) -> None:
    page, url = tripped, origin(tripped)
    speak(page, lang, url)
    found: list[str] = []
    for machine in MACHINES:
        lay_out(page, 1280, 800, "desk")
        open_page(page, f"{url}/equipment/{machine}")
        for whose in ("nobody's", "mine"):
            if whose == "mine":
                take(page)
            for width, height in DESKS:
                lay_out(page, width, height, "desk")
                wrong = [*page.evaluate(CUT), *page.evaluate(FAULTS)]
                found += [f"{machine} {whose} {width}x{height}: {one}" for one in wrong]
            lay_out(page, 1280, 800, "desk")
        let_go(page)
    assert found == [], "\n".join(["", *found])


@pytest.mark.parametrize("size", DESKS)
def test_why_an_axis_that_tripped_does_not_move_is_said_once_beside_its_commands(
    tripped: Page, size: tuple[int, int]
) -> None:
    page, url = tripped, origin(tripped)
    speak(page, "en", url)
    lay_out(page, *size, "desk")
    open_page(page, f"{url}/equipment/a1")
    take(page)
    said = page.locator(".zone :is(.op-why, small)", has_text="remove its cause, then fault reset").filter(visible=True)
    expect(said).to_have_count(1)
    let_go(page)
