"""A sequence is edited in a browser: fields and text follow one another as one types, and a mistake stands at its field."""

import re
import shutil
from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, Route, expect

from app import bundled
from tests.browser.station import Sit, serving
from tests.conftest import PogonServer

WHO, HOME = "ivana", "/equipment/steps1/definition?section=1"


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PogonServer]:
    folder = tmp_path_factory.mktemp("editor")
    shutil.copytree(bundled("plants/drive_steps"), folder / "plant")
    with serving(folder, {"ivana": ("engineer", "operator")}) as running:
        yield running


@pytest.mark.always
def test_fields_and_text_follow_one_another_and_a_mistake_stands_at_its_field(sit: Sit) -> None:
    page = sit()
    page.fill("[name=minimum]", "much")
    expect(page.locator("#h-f-minimum")).to_contain_text("a number from 0 to 36000")
    expect(page.locator("#ed-problems")).to_contain_text("steps.0.minimum")
    page.fill("[name=minimum]", "12")
    expect(page.locator("#ed-problems")).to_contain_text("No mistakes.")
    expect(page.locator("#ed-text")).to_have_value(re.compile("minimum = 12\n"))
    text = page.locator("#ed-text")
    text.fill(text.input_value().replace("maximum = 60", "maximum = 77"))
    expect(page.locator("[name=maximum]")).to_have_value("77")
    page.fill("[name=minimum]", "13")
    expect(text).to_have_value(re.compile("minimum = 13\n"))


def slow(page: Page, what: str) -> None:
    """The server answers a post to `what` of the editor half a second late."""

    def later(route: Route) -> None:
        page.wait_for_timeout(500)
        route.continue_()

    page.route(f"**/definition/{what}", later)


def test_what_is_typed_while_the_answer_to_a_field_is_awaited_stays_in_the_text(sit: Sit) -> None:
    page = sit(path="/equipment/steps1/definition?section=2")
    text = page.locator("#ed-text")
    slow(page, "fields")
    page.fill("[name=maximum]", "44")
    with page.expect_response("**/definition/fields"):
        text.click()  # the field is left, and asked about
        page.keyboard.press("Control+Home")
        page.keyboard.press("End")
        page.keyboard.type("  # seen by Ivana")
    expect(text).to_have_value(re.compile(r"# seen by Ivana\n(?s:.*)maximum = 44\n"))
    with page.expect_response(
        lambda answer: "twice" in (answer.request.post_data or "")
    ):  # and not what was asked before it
        page.keyboard.type(", twice")
        expect(text).to_have_value(re.compile("# seen by Ivana, twice"))
        expect(page.locator("#ed-problems")).to_contain_text("No mistakes.")
        expect(page.locator("[name=maximum]")).to_have_value("44")
        text.blur()
    page.reload()
    expect(text).to_have_value(re.compile(r"# seen by Ivana, twice\n(?s:.*)maximum = 44\n"))


def test_a_form_that_is_sent_late_takes_nothing_back_that_the_text_says_since(sit: Sit) -> None:
    page = sit(path="/equipment/steps1/definition?section=2")
    text, held = page.locator("#ed-text"), list[Route]()
    before = page.locator("[name=maximum]").input_value()
    let_go = False
    page.route("**/definition/fields", lambda route: route.continue_() if let_go else held.append(route))
    page.fill("[name=minimum]", "14")
    while not held:
        page.wait_for_timeout(50)
    text.fill(text.input_value().replace(f"maximum = {before}", "maximum = 78"))
    page.wait_for_timeout(1_500)  # so long that the text would have been sent
    let_go = True
    for route in held:
        route.continue_()
    expect(page.locator("[name=maximum]")).to_have_value("78")
    expect(text).to_have_value(re.compile("minimum = 14\n"))
    expect(text).to_have_value(re.compile("maximum = 78\n"))
    expect(page.locator("#ed-problems")).to_contain_text("No mistakes.")
    page.reload()
    expect(page.locator("[name=maximum]")).to_have_value("78")
    expect(page.locator("[name=minimum]")).to_have_value("14")


def test_what_is_typed_while_the_answer_to_the_text_is_awaited_stays_in_the_field(sit: Sit) -> None:
    page = sit(path="/equipment/steps1/definition?section=4")
    text = page.locator("#ed-text")
    slow(page, "text")
    text.fill(text.input_value().replace("maximum = 60", "maximum = 55"))
    with page.expect_response("**/definition/text"):
        page.locator("[name=minimum]").click()  # the text is left, and asked about
        page.keyboard.press("Control+A")
        page.keyboard.type("3")
    expect(page.locator("[name=maximum]")).to_have_value("55")
    expect(page.locator("[name=minimum]")).to_have_value("3")
    expect(page.locator("[name=minimum]")).to_be_focused()
    expect(text).to_have_value(re.compile("minimum = 3\nmaximum = 55\n"))


def test_the_drive_runs_its_steps_from_its_own_page(sit: Sit) -> None:
    page = sit(path="/equipment/m1")
    steps = page.locator(".st-q")
    page.locator(".op-steps").click()
    expect(page.locator("[data-command='m1.stop']")).to_be_in_viewport(ratio=1)
    steps.locator("[data-token=take]").click()
    steps.locator("[data-command='steps1.start']").click()
    page.locator("#overlay").get_by_role("button", name="Start from step 1").click()
    expect(steps.locator("[data-command='steps1.abort']")).to_be_visible()
