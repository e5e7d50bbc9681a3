"""While the server is away no page says what it cannot know: that there is no alarm, or that a machine is in this or that state."""

from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from playwright.sync_api import Page, expect

from tests import coil_plant
from tests.browser.station import LANGUAGES, Sit, serving
from tests.conftest import PogonServer

WHO, HOME = "ivana", "/"
SAID = {
    "hr": ("Nema aktivnih alarma", "Alarmi nisu poznati", "Nepoznato stanje"),
    "en": ("No active alarms", "Alarms not known", "State unknown"),
    "de": ("Keine anstehenden Alarme", "Alarme nicht bekannt", "Zustand unbekannt"),
    "cs": ("Žádné aktivní alarmy", "Alarmy nejsou známy", "Neznámý stav"),
}


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PogonServer]:
    folder = tmp_path_factory.mktemp("unknown")
    coil_plant.write(folder / "plant", ways=True)
    with serving(folder) as running:
        yield running


@contextmanager
def away(sit: Sit, page: Page) -> Iterator[None]:
    """The line to the server is broken, and whole again after that."""
    page.context.set_offline(True)
    try:
        expect(page.locator("body")).to_have_attribute("data-live", "offline", timeout=15_000)
        yield
    finally:
        page.context.set_offline(False)
        expect(page.locator("body")).to_have_attribute("data-live", "live", timeout=30_000)
        sit.complaints[:] = [told for told in sit.complaints if "ERR_INTERNET_DISCONNECTED" not in told]


@pytest.mark.parametrize("lang", LANGUAGES)
def test_nobody_is_told_that_there_is_no_alarm(sit: Sit, lang: str) -> None:
    none, unknown, _ = SAID[lang]
    page = sit(path="/alarms", lang=lang)
    expect(page.get_by_text(none)).to_have_count(2)
    for one in page.get_by_text(none).all():
        expect(one).to_be_visible()
    assert not page.get_by_text(unknown).first.is_visible()
    with away(sit, page):
        for one in page.get_by_text(none).all():
            expect(one).to_be_hidden()
        expect(page.locator("#alarms").get_by_text(unknown)).to_be_visible()
        expect(page.locator("#alarm-list").get_by_text(unknown)).to_be_visible()
    expect(page.locator("#alarms").get_by_text(none)).to_be_visible()
    expect(page.locator("#alarms").get_by_text(unknown)).to_be_hidden()


@pytest.mark.parametrize("lang", LANGUAGES)
def test_a_sequence_is_in_no_state_that_one_knows(sit: Sit, lang: str) -> None:
    unknown = SAID[lang][2]
    page = sit(path="/equipment/seq1", lang=lang)
    head = page.locator(".q-head")
    said = head.locator("b.when-online")
    expect(said).to_be_visible()
    assert unknown not in head.inner_text()
    with away(sit, page):
        expect(said).to_be_hidden()
        expect(head.get_by_text(unknown)).to_be_visible()
        expect(head.locator("p.when-offline")).to_be_visible()  # what it was when it was last heard
    expect(said).to_be_visible()
