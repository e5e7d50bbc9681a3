"""A browser without scripts: what does not work there says so and leads back; nobody reads what is for programs."""

import re
from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, BrowserContext, Page, StorageState, expect

from app.plant.texts import Texts
from tests.browser.looks import FAULTS
from tests.browser.station import LANGUAGES, SIZES, Sit, serving, speak
from tests.conftest import PogonServer

WHO, HOME = "ana", "/equipment/m1"
MACHINES = ("m1", "c1", "cc1", "seq1", "cr1", "a1")
PRESSED = """() => [...document.querySelectorAll('.zone button[data-command], .zone [data-set], main [data-set]')]
  .filter((one) => one.checkVisibility()).map((one) => one.dataset.command ?? `[${one.closest('[data-setpoint]').dataset.setpoint}]`)"""


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PogonServer]:
    """One Pogon with a machine of each type, and somebody who may do everything with it."""
    people = {"ana": ("operator", "engineer")}
    with serving(tmp_path_factory.mktemp("plain"), people) as running:
        yield running


@pytest.fixture
def plain(sit: Sit, browser: Browser) -> Iterator[Page]:
    """The same person in a browser without scripts."""
    state: StorageState = sit().context.storage_state()
    context: BrowserContext = browser.new_context(java_script_enabled=False, storage_state=state)
    yield context.new_page()
    context.close()


@pytest.mark.parametrize("lang", LANGUAGES)
def test_every_command_says_that_it_was_not_sent_and_leads_back(plain: Page, server: PogonServer, lang: str) -> None:
    speak(plain, lang, server.url)
    told = Texts.read().text(lang, "operate.needs_script")
    for machine in MACHINES if lang == "hr" else MACHINES[:1]:
        home = f"{server.url}/equipment/{machine}"
        plain.goto(home)
        pressed = [one for one in dict.fromkeys(plain.evaluate(PRESSED)) if one != f"{machine}.{stop_of(plain)}"]
        assert pressed, machine
        for one in pressed:
            button = f"[data-setpoint='{one[1:-1]}'] [data-set]" if one.startswith("[") else f"[data-command='{one}']"
            plain.locator(button).locator("visible=true").first.click(force=True)
            assert re.fullmatch(rf"{machine.upper()} \S.*: {re.escape(told)}", plain.inner_text(".empty .st-t")), one
            assert (plain.get_attribute("html", "lang") or "").partition("-")[0] == lang
            plain.click(f".empty a[href='/equipment/{machine}']")
            assert plain.url == home


def stop_of(page: Page) -> str:
    """What the Stop of the machine on the page is called."""
    return (page.locator(".zone .stop").first.get_attribute("data-command") or "").partition(".")[2]


@pytest.mark.parametrize("lang", LANGUAGES)
def test_stop_works_and_the_page_says_that_nothing_else_does(plain: Page, server: PogonServer, lang: str) -> None:
    speak(plain, lang, server.url)
    for machine in MACHINES if lang == "de" else MACHINES[:1]:
        plain.goto(f"{server.url}/equipment/{machine}")
        expect(plain.locator(".no-scripts")).to_have_text(Texts.read().text(lang, "frame.no_scripts"))
        for width, height in SIZES.values():
            plain.set_viewport_size({"width": width, "height": height})
            assert [one for one in plain.evaluate(FAULTS) if "no-scripts" in one] == []
            expect(plain.locator(".zone .stop").first).to_be_in_viewport(ratio=1)
        plain.set_viewport_size({"width": 1280, "height": 800})
        before = plain.inner_text("#message")
        plain.click(".zone .stop")
        assert plain.url == f"{server.url}/equipment/{machine}"
        assert plain.inner_text("#message") != before


def test_with_scripts_nobody_reads_of_it(sit: Sit) -> None:
    page = sit()
    expect(page.locator(".no-scripts")).to_have_count(0)
    assert page.locator("noscript").is_hidden()
