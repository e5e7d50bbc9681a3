"""What somebody presses is drawn anew meanwhile, because something else has changed: the press still counts, by finger and by key."""

import itertools
import re
from collections.abc import Callable, Iterator

import pytest
from playwright.sync_api import Page, Route, expect

from tests.browser.station import Sit, let_go, serving, small, take
from tests.conftest import PogonServer

WHO, HOME = "ivana", "/equipment/m1"


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PogonServer]:
    with serving(small(tmp_path_factory.mktemp("pressed"), "m1")) as running:
        yield running


def by_finger(page: Page, button: str, meanwhile: Callable[[], None]) -> None:
    page.locator(button).first.hover()
    page.mouse.down()
    meanwhile()
    page.mouse.up()


def by_key(page: Page, button: str, meanwhile: Callable[[], None]) -> None:
    page.locator(button).first.focus()
    page.keyboard.down(" ")
    meanwhile()
    page.keyboard.up(" ")


PRESSES = {"finger": by_finger, "key": by_key}


def drawn_anew(page: Page) -> Callable[[], None]:
    """Have the column fetched, as a change of the machine has it."""

    def fetch() -> None:
        with page.expect_response(re.compile("/equipment/m1/commands$")) as answer:
            page.evaluate("window.htmx.trigger(document.querySelector('[data-operation]'), 'again')")
        answer.value.finished()
        page.evaluate("() => new Promise((done) => requestAnimationFrame(() => setTimeout(done, 50)))")

    return fetch


@pytest.mark.parametrize("how", PRESSES)
def test_control_is_given_although_the_time_that_is_left_is_drawn_meanwhile(sit: Sit, how: str) -> None:
    mine, other = sit(), sit("ivo")
    take(mine)
    other.locator("[data-token=request]").first.click()
    expect(mine.locator("[data-token=give]").first).to_be_visible()
    mine.wait_for_timeout(1100)  # another number of seconds is left
    with mine.expect_request(re.compile("/equipment/m1/token/give$")):
        PRESSES[how](mine, "[data-token=give]", drawn_anew(mine))
    expect(other.locator(".token").first).to_have_attribute("data-holding", "mine")
    let_go(other)


@pytest.mark.parametrize("how", PRESSES)
@pytest.mark.parametrize(
    "button", [".sp-field [data-set]", "[data-command='m1.reset']", "[data-command='m1.stop']", "[data-token=release]"]
)
def test_a_press_counts_whose_button_gets_another_text_meanwhile(sit: Sit, how: str, button: str) -> None:
    page = sit()
    take(page)
    counter = itertools.count()

    def altered(route: Route) -> None:
        answer = route.fetch()
        body = re.sub(r"(<button[^>]*>)", rf"\1<i hidden>{next(counter)}</i>", answer.text())
        route.fulfill(response=answer, body=body)

    page.route(re.compile("/equipment/m1/commands$"), altered)
    drawn_anew(page)()
    page.locator("#message span").evaluate("line => { line.textContent = ''; }")
    PRESSES[how](page, button, drawn_anew(page))
    expect(page.locator("#message span")).not_to_have_text("")
    page.unroute_all(behavior="wait")
    let_go(page)


def test_what_was_not_drawn_under_a_finger_is_drawn_when_it_is_gone(sit: Sit) -> None:
    mine, other = sit(), sit("ivo")
    mine.locator("[data-token=take]").first.hover()
    mine.mouse.down()
    take(other)
    mine.wait_for_timeout(200)
    mine.mouse.move(5, 400)  # not meant after all
    mine.mouse.up()
    expect(mine.locator(".token").first).to_have_attribute("data-holding", "other")
    expect(mine.locator("[data-token=request]").first).to_be_visible()
    assert not mine.locator("[data-token=take]").count()
    let_go(other)
