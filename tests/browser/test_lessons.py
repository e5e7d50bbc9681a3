"""A learner does the first steps of a lesson in a real browser; nothing of it is cut in any language at any size."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, expect

from tests.browser.looks import BOTH, SIZES
from tests.browser.station import LANGUAGES, Sit, lay_out, serving, small, speak
from tests.conftest import PogonServer

WHO, HOME = "ivana", "/lessons"


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PogonServer]:
    with serving(small(tmp_path_factory.mktemp("lessons"), "m1", "m2")) as running:
        yield running


@pytest.fixture
def learner(sit: Sit) -> Page:
    """In the lesson on m2."""
    page = sit()
    page.click(".le-list a")
    page.select_option("#le-m", "m2")
    page.click(".le-side form[action$='/begin'] button")
    expect(page.locator(".le-here")).to_be_visible()
    return page


def test_a_step_ticks_itself_off_on_the_page_of_the_machine_and_in_the_lesson(learner: Page, sit: Sit) -> None:
    expect(learner.locator(".le-here")).to_contain_text("30 Hz")  # m2 stands as it was built: the first step is done
    machine = sit("ivana", "/equipment/m2")
    expect(machine.locator(".le-strip")).to_contain_text("Set 30 Hz")
    learner.locator("#hint").click()
    expect(learner.locator(".le-here .note")).to_contain_text("confirmed it")


@pytest.mark.parametrize("lang", LANGUAGES)
def test_nothing_of_a_lesson_is_cut(learner: Page, server: PogonServer, lang: str) -> None:
    speak(learner, lang, server.url)
    found: list[str] = []
    for path in ("/welcome", "/lessons", "/lessons/motor", "/equipment/m2"):
        learner.goto(server.url + path, wait_until="load")
        expect(learner.locator("body")).to_have_attribute("data-live", "live")
        learner.evaluate("document.fonts.ready.then(() => 1)")
        for size, (width, height, profile) in SIZES.items():
            lay_out(learner, width, height, profile)
            if size != "phone" and learner.evaluate("document.documentElement.scrollHeight") > height:
                found.append(f"{lang} {path} {size}: the page is higher than the screen")
            found += [f"{lang} {path} {size}: {one}" for one in learner.evaluate(BOTH)]
    assert found == [], "\n".join(["", *found])
