"""What somebody does on a page whose scripts are still on their way is done once they are there: no press is in vain, none counts twice."""

import re
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest
from playwright.sync_api import Page, Request, expect

from tests.browser.station import Sit, hold_back, let_go, origin, serving, small, stopped, take, wait_for
from tests.conftest import PogonServer

WHO, HOME = "ivana", "/"


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PogonServer]:
    with serving(small(tmp_path_factory.mktemp("early"), "m1", "m2", "a1")) as running:
        yield running


@contextmanager
def slow(page: Page, script: str) -> Iterator[list[str]]:
    """The page again, on a line on which one script comes only at the end of the block; what it asks of machines then and afterwards."""
    posted: list[str] = []

    def note(one: Request) -> None:
        if one.method == "POST" and "/equipment/" in one.url:  # and not that somebody is there
            posted.append(one.url.split("/", 3)[3])

    page.on("request", note)
    held = hold_back(page, f"**/js/{script}.*.js")
    page.reload(wait_until="commit")
    wait_for(page, held, 1)
    yield posted
    assert posted == []
    held[0].continue_()
    expect(page.locator("body")).to_have_attribute("data-live", "live")
    page.unroute_all()


@pytest.mark.parametrize("script", ["commands", "live", "hold"])
def test_control_is_taken_once_by_a_press_that_came_before_the_scripts(sit: Sit, script: str) -> None:
    page = sit(path="/equipment/m1")
    with slow(page, script) as posted:
        page.locator("[data-token=take]").first.click()
    expect(page.locator(".token").first).to_have_attribute("data-holding", "mine")
    assert posted == ["equipment/m1/token/take"]
    let_go(page)


def test_of_two_early_presses_the_last_counts(sit: Sit) -> None:
    page = sit(path="/equipment/m1")
    with slow(page, "commands"):
        page.locator("[data-token=take]").first.click()
        page.locator("[data-over='/palette'] >> visible=true").first.click()
    expect(page.locator(".pal")).to_have_count(1)
    expect(page.locator(".token").first).to_have_attribute("data-holding", "free")


def test_a_setpoint_that_was_typed_early_stays_and_is_sent(sit: Sit) -> None:
    page = sit(path="/equipment/m2")
    take(page)
    field = page.locator(".sp-field input[name=argument] >> visible=true").first
    with slow(page, "commands"):
        field.fill("41")
    expect(field).to_have_value("41")
    page.wait_for_timeout(600)  # what is fetched again once the page is live
    expect(field).to_have_value("41")
    page.locator(".sp-field button:has-text('Set') >> visible=true").first.click()
    expect(page.locator("#message")).to_contain_text(re.compile("= 41.Hz: Accepted .* Done"), timeout=30_000)
    let_go(page)


def test_a_parameter_that_was_typed_early_is_reviewed(sit: Sit) -> None:
    page = sit(path="/equipment/m1/parameters")
    field = page.locator("#p-new input[data-new]").first
    with slow(page, "commands"):
        field.fill("7")
        field.press("Enter")
    expect(page).to_have_url(re.compile("/equipment/m1/parameters$"))  # the browser has sent no form of its own
    expect(page.locator("#p-count")).to_have_text("1")


MENUS: dict[str, Callable[[Page], None]] = {
    "menu": lambda page: page.locator(".lang > summary").click(),
    "search": lambda page: page.locator("[data-over='/palette'] >> visible=true").first.click(),
}


@pytest.mark.parametrize("what", MENUS)
def test_what_opens_is_open_once_the_scripts_are_there(sit: Sit, what: str) -> None:
    page = sit(path="/equipment/m1")
    with slow(page, "commands"):
        MENUS[what](page)
    expect(page.locator(".lang[open], .pal")).to_have_count(1)


def test_a_command_that_was_pressed_early_is_carried_out_once(sit: Sit) -> None:
    page = sit(path="/equipment/m1")
    take(page)
    with slow(page, "commands") as posted:
        page.locator("[data-command='m1.forward']").first.click()
    expect(page.locator("[data-command='m1.forward']").first).to_have_attribute("data-state", "done")
    assert [one for one in posted if "command" in one] == ["equipment/m1/command/forward"]
    stopped(page)
    let_go(page)


def test_a_setpoint_that_was_sent_early_is_carried_out_once(sit: Sit) -> None:
    page = sit(path="/equipment/m2")
    take(page)
    field = page.locator(".sp-field input[name=argument] >> visible=true").first
    with slow(page, "commands") as posted:
        field.fill("42")
        field.press("Enter")
    expect(page.locator("#message")).to_contain_text(re.compile("= 42.Hz: Accepted .* Done"), timeout=30_000)
    assert [one for one in posted if "token" not in one] == ["equipment/m2/command/set_frequency"]
    let_go(page)


@pytest.mark.parametrize("button", ["[data-command='m1.forward']", "[data-token=take]"])
def test_a_press_that_nobody_expects_any_more_is_not_carried_out_and_said(sit: Sit, button: str) -> None:
    page = sit(path="/equipment/m1")
    if "command" in button:
        take(page)
    stopped(page)
    with slow(page, "commands") as posted:
        page.locator(button).first.click()
        page.wait_for_timeout(3_200)
    expect(page.locator("#message")).to_contain_text("Not carried out: the page was still loading")
    page.wait_for_timeout(300)
    assert posted == []
    let_go(page)


def test_who_holds_too_early_is_told(sit: Sit) -> None:
    page = sit(path="/equipment/a1")
    take(page)
    with slow(page, "hold") as posted:
        page.locator("[data-hold]").first.dispatch_event("click")
    expect(page.locator("#message")).to_contain_text("Not carried out: the page was still loading")
    assert posted == []
    let_go(page)


@pytest.mark.parametrize("script", ["live", "values"])
def test_a_page_whose_scripts_never_come_looks_disconnected_and_still_stops(sit: Sit, script: str) -> None:
    """What it shows is of the moment in which it was made, however long it stands there."""
    page = sit(path="/equipment/m1")
    page.route(f"**/js/{script}.*", lambda route: route.abort())
    page.reload(wait_until="commit")
    expect(page.locator(".offline")).to_be_visible()
    expect(page.locator("[data-offline-age]")).to_have_text(re.compile(r"^\d\d:\d\d:\d\d$"))
    expect(page.locator(".off-re")).to_be_hidden()  # nobody tries
    page.unroute_all()
    with page.expect_request(lambda one: one.method == "POST" and one.url.endswith("/equipment/m1/stop")):
        page.locator(".zone .stop").click(no_wait_after=True)
    page.goto(f"{origin(page)}/equipment/m1")
    expect(page.locator("body")).to_have_attribute("data-live", "live")
    sit.complaints[:] = [one for one in sit.complaints if "ERR_FAILED" not in one]


@pytest.mark.parametrize("script", ["commands", "live"])
def test_stop_does_not_wait_for_any_script(sit: Sit, script: str) -> None:
    page = sit(path="/equipment/m1")
    held = hold_back(page, f"**/js/{script}.*.js")
    page.reload(wait_until="commit")
    wait_for(page, held, 1)
    with page.expect_request(lambda one: one.method == "POST" and one.url.endswith("/equipment/m1/stop")):
        page.locator(".zone .stop").click(no_wait_after=True)
    page.unroute_all(behavior="ignoreErrors")  # what follows is another page
    expect(page.locator("body")).to_have_attribute("data-live", "live")


@pytest.mark.parametrize("age", [1_000, 1_500, 2_000])
def test_a_server_that_is_lost_soon_after_a_page_came_is_lost_like_any_other(
    sit: Sit, server: PogonServer, age: int
) -> None:
    """The page is so many milliseconds old: when it is four seconds old nobody takes it for one whose scripts never came."""
    page = sit(path="/equipment/m1")
    take(page)
    page.reload()
    expect(page.locator("body")).to_have_attribute("data-live", "live")
    page.wait_for_function("(age) => performance.now() > age", arg=age)
    server.process.send_signal(signal.SIGSTOP)
    try:
        expect(page.locator("body")).to_have_attribute("data-live", "offline", timeout=10_000)
        expect(page.locator("[data-command='m1.coast'] small")).to_have_text("No connection")
        expect(page.locator("[data-command='m1.coast']")).to_have_attribute("aria-disabled", "true")
    finally:
        server.process.send_signal(signal.SIGCONT)
    expect(page.locator("body")).to_have_attribute("data-live", "live", timeout=30_000)
    expect(page.locator("[data-command='m1.coast']")).not_to_have_attribute("aria-disabled", "true")
    sit.complaints[:] = [one for one in sit.complaints if "closed before the connection is established" not in one]
    let_go(page)


def test_a_page_one_of_whose_scripts_hangs_looks_disconnected_until_it_comes(sit: Sit) -> None:
    """Nothing is drawn before all are there: what it shows is of the moment in which it was made."""
    page = sit(path="/equipment/m1")
    with slow(page, "commands"):
        expect(page.locator("body")).to_have_attribute("data-live", "offline", timeout=15_000)
    expect(page.locator(".offline")).to_be_hidden()
