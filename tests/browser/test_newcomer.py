"""The story of a newcomer, from an empty folder to a first-out: one browser, no page typed into the address line, every press counted."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Locator, Page, expect

from tests.browser.station import PASSWORD
from tests.conftest import PogonServer

PRESSES = {
    "first account": 5,
    "motor": 4,
    "setpoint": 2,
    "fault": 7,
    "acknowledge": 1,
    "reset": 1,
    "trend": 1,
    "CSV": 2,
    "language": 2,
    "conveyor by hand": 5,
    "sequence suspended": 3,
    "forced": 6,
    "first-out": 7,
}
"""Stage → presses that it takes: a change of a page that needs more has to say here why."""


class Hand:
    """The one who presses. A field that has the focus already costs no press, a key that is held is one."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self.stage = ""
        self.presses: dict[str, int] = {}

    def begin(self, stage: str) -> None:
        """What is pressed from now on belongs to this stage."""
        self.stage = stage
        self.presses[stage] = 0

    def press(self, what: str | Locator) -> None:
        """Press what is seen and may be pressed, whichever of several comes first."""
        self._at(what).click()
        self.presses[self.stage] += 1

    def type(self, what: str | Locator, text: str) -> None:
        """Write into a field in place of what stands there."""
        field = self._at(what)
        if not field.evaluate("field => field === document.activeElement"):
            self.press(field)
        self.page.keyboard.press("Control+A")
        self.page.keyboard.type(text)

    def hold(self, what: str | Locator) -> None:
        """Press and keep the finger there until `let_go`."""
        self._at(what).hover()
        self.page.mouse.down()
        self.presses[self.stage] += 1

    def let_go(self) -> None:
        """Take the finger away."""
        self.page.mouse.up()

    def _at(self, what: str | Locator) -> Locator:
        found = self.page.locator(f"{what} >> visible=true").first if isinstance(what, str) else what
        expect(found).to_be_visible(timeout=30_000)
        expect(found).not_to_have_attribute("aria-disabled", "true", timeout=30_000)
        return found


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PogonServer]:
    """`pogon run` in an empty folder: the whole demo plant, and nobody who may sign in."""
    folder = tmp_path_factory.mktemp("newcomer")
    running = PogonServer.start(folder / "data", folder / "pogon.log")
    try:
        yield running
    finally:
        running.stop()


def live(page: Page) -> None:
    expect(page.locator("body")).to_have_attribute("data-live", "live", timeout=30_000)


def said(page: Page, what: str) -> None:
    expect(page.locator("#message")).to_contain_text(re.compile(what), timeout=30_000)


def inject(hand: Hand, machine: str, fault: int) -> None:
    """Break a machine on the instructor's page, whatever its language."""
    hand.press(".tabs a[href='/communication']")
    hand.press("a[href='/instructor']")
    hand.press(f".in-list a[href='/instructor/{machine}']")
    hand.press(f"label:has([name=code][value='{fault}'])")
    hand.press("form[action$='/fault'] .edge")


@pytest.mark.always
@pytest.mark.timeout(600)
def test_a_newcomer_gets_from_an_empty_folder_to_a_first_out_with_few_presses(
    page: Page, server: PogonServer, tmp_path: Path
) -> None:
    hand = Hand(page)
    page.goto(server.url)  # the one address that the terminal prints

    hand.begin("first account")
    found = re.search(r"type this code:\s+(\S+)", server.log())
    assert found, server.log()
    hand.press(page.get_by_role("link", name="Sign in"))
    hand.type("[name=code]", found[1])
    hand.type("[name=name]", "ana")
    hand.type("[name=password]", PASSWORD)
    hand.type("[name=again]", PASSWORD)
    hand.press(".sheet-form button.cmd")
    live(page)
    expect(page.locator(".head .who")).to_contain_text("ana")

    hand.begin("motor")
    hand.press(page.get_by_role("link", name="Open a machine"))
    hand.press(".zone .stop")
    said(page, "Stop: Accepted .* Done")
    hand.press("[data-token=take]")
    hand.press("[data-command='m1.reverse']")
    expect(page.locator(".hero-v .val b")).to_have_text(re.compile("\u2212"), timeout=30_000)

    hand.begin("setpoint")
    hand.type(".sp-field input[name=argument]", "35")
    hand.press(".sp-field button:has-text('Set')")
    said(page, "Set frequency = 35.Hz: Accepted .* Done")

    hand.begin("fault")
    inject(hand, "m1", 4)
    expect(page.locator("#alarms strong")).to_have_text("Converter: overcurrent", timeout=30_000)
    hand.press("[form=in-clear]")  # the cause goes, the trip stays until it is reset
    hand.press(page.get_by_role("link", name="Open the machine"))
    expect(page.locator("#alarms strong")).to_have_text("Converter: overcurrent", timeout=30_000)

    hand.begin("acknowledge")
    page.wait_for_timeout(600)  # a press right after the banner changed was meant for what stood there before
    hand.press("#banner-ack")
    said(page, "1 alarm acknowledged")

    hand.begin("reset")
    hand.press("[data-command='m1.reset']")
    said(page, "Fault reset: Accepted .* Done")

    hand.begin("trend")
    hand.press(page.get_by_role("link", name="Trend", exact=True))
    expect(page.locator("h1")).to_have_text("Trends")
    expect(page.locator("main")).to_contain_text("Fan 1 · Speed")

    hand.begin("CSV")
    hand.press("[data-take] > summary")
    with page.expect_download() as download:
        hand.press("[data-export]")
    download.value.save_as(tmp_path / "speed.csv")
    lines = (tmp_path / "speed.csv").read_text("utf-8-sig").splitlines()
    assert any("m1.speed" in line for line in lines), lines[:5]
    assert len(lines) > 10

    hand.begin("language")
    hand.press(".lang > summary")
    hand.press(".lang button[value=hr]")
    expect(page.locator("html")).to_have_attribute("lang", "hr")
    expect(page.locator("main")).to_contain_text("Ventilator 1")

    hand.begin("conveyor by hand")
    hand.press(page.get_by_role("link", name="Pokretne trake"))
    hand.press("[data-token=take]")
    hand.press(".zone .stop")
    hand.press(".c-mode [data-command='c1.select_manual']")
    hand.hold("[data-hold='c1.jog_forward']")
    expect(page.locator(".c-belt.run").first).to_be_visible(timeout=30_000)
    hand.let_go()
    expect(page.locator(".c-belt.run")).to_have_count(0, timeout=30_000)

    hand.begin("sequence suspended")
    hand.press(page.get_by_role("link", name="Sekvence"))
    hand.press("main a[href='/equipment/seq1']")
    expect(page.locator(".q-top .q-t")).to_contain_text(
        re.compile(r"[Kk]orak \d od 8"), timeout=180_000
    )  # the next coil is wound
    hand.press(".zone .stop")
    expect(page.locator(".q-top .q-t")).to_contain_text("Obustavljen", timeout=30_000)

    hand.begin("forced")
    hand.press("[data-token=take]")
    hand.press("[data-all='1']")
    hand.press(".q-f")
    hand.type("#overlay [name=reason]", "ispravlja se senzor")
    hand.type("#overlay [name=password]", PASSWORD)
    hand.press("#overlay .danger")
    expect(page.locator(".f-force b")).to_have_text("1", timeout=30_000)

    hand.begin("first-out")
    inject(hand, "cc1", 42)
    hand.press(page.get_by_role("link", name="Sekvence"))
    hand.press("main a[href='/equipment/seq1']")
    first = page.locator(".q-first li").filter(has=page.locator(".first"))
    expect(first).to_contain_text("Zaštitna ograda 2 otvorena", timeout=30_000)
    expect(page.locator(".q-abort td").last).to_have_text(
        "Zaštitna ograda 2 otvorena"
    )  # and not what would be in order
    assert hand.presses == PRESSES
