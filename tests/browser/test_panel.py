"""A panel that is only touched: keys on the screen write setpoints and reasons, Stop stays in sight, and nobody else loads them."""

import re
from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, Route, StorageState, expect

from tests.browser.station import PASSWORD, Sit, let_go, serving, small, take
from tests.conftest import PogonServer, enroll

WHO, HOME = "ivana", "/"
COVERED = """() => { const stop = document.querySelector('.zone .stop'), { left, top, width, height } = stop.getBoundingClientRect();
  return [0.1, 0.5, 0.9].some((x) => !stop.contains(document.elementFromPoint(left + width * x, top + height / 2))); }"""
"""Whether something lies over Stop."""


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PogonServer]:
    with serving(small(tmp_path_factory.mktemp("panel"), "m1", "m2")) as running:
        yield running


def tap(page: Page, keys: str) -> None:
    for key in keys:
        page.locator(f"#keypad [data-key='{key}']").click()


def test_a_setpoint_is_typed_on_the_screen_and_stop_stays_in_sight(sit: Sit) -> None:
    page = sit(path="/equipment/m2?panel=1")
    take(page)
    keypad, field = (
        page.locator("#keypad"),
        page.locator("[data-setpoint='m2.set_frequency'] input[name=argument]").first,
    )
    expect(keypad).to_be_hidden()
    field.click()
    expect(keypad).to_be_visible()
    expect(keypad).to_contain_text("Frequency setpoint")
    for width, height in ((1280, 800), (800, 480), (390, 844)):
        page.set_viewport_size({"width": width, "height": height})
        assert not page.evaluate(COVERED), width
    page.set_viewport_size({"width": 1280, "height": 800})
    field.click()
    field.select_text()
    tap(page, "411")
    tap(page, "←")
    tap(page, ".5")
    expect(field).to_have_value("41.5")
    expect(keypad.locator("output")).to_have_text("41.5")
    tap(page, "✓")
    expect(keypad).to_be_hidden()
    card = page.locator("[data-review='m2.set_frequency'] button").first
    expect(page.locator("#message").or_(card).first).to_be_visible()
    if card.count():
        card.click()
    expect(field).to_have_value("41.50")
    let_go(page)


def test_words_are_typed_in_the_letters_of_the_language(sit: Sit) -> None:
    page = sit(path="/equipment/m1?panel=1", lang="hr")
    page.keyboard.press("Control+k")
    expect(page.locator("#pal-q")).to_be_focused()
    tap(page, "▲Ž")
    expect(page.locator("#pal-q")).to_have_value("Ž")
    tap(page, "←")
    tap(page, "ventilator—")
    page.locator("#keypad [data-key='123']").click()
    tap(page, "2")
    expect(page.locator("#pal-q")).to_have_value("ventilator 2")
    tap(page, "✓")
    expect(page).to_have_url(re.compile("/equipment/m2$"))


def test_every_letter_and_sign_of_a_password_is_on_the_keys(sit: Sit) -> None:
    """A panel has no other keyboard: who cannot type theirs cannot sign in. A capital C is a letter and clears nothing."""
    page = sit(path="/equipment/m1?panel=1")
    page.keyboard.press("Control+k")
    expect(page.locator("#pal-q")).to_be_focused()
    seen: set[str] = set()
    for step in ("", "▲", "123", "▲"):
        if step:
            page.locator(f"#keypad [data-key='{step}']").click()
        seen |= set(
            page.locator("#keypad .kp-keys [data-key]").evaluate_all("all => all.map((one) => one.dataset.key)")
        )
    missing = set(map(chr, range(33, 127))) - seen
    assert missing == set()
    page.locator("#keypad [data-key='abc']").click()
    page.fill("#pal-q", "")
    tap(page, "ab▲Cd")
    expect(page.locator("#pal-q")).to_have_value("abCd")
    page.locator("#keypad [data-key='123']").click()
    tap(page, "1▲$2")
    expect(page.locator("#pal-q")).to_have_value("abCd1$2")
    for width, height in ((1280, 800), (800, 480), (390, 844)):
        page.set_viewport_size({"width": width, "height": height})
        tap(page, "▲")
        assert page.locator("#keypad").evaluate(
            "keys => keys.scrollWidth <= keys.clientWidth && keys.getBoundingClientRect().bottom <= innerHeight"
        )
        tap(page, "▲")


def test_it_holds_for_this_browser_until_it_is_ended_and_others_load_none_of_it(sit: Sit, server: PogonServer) -> None:
    asked: list[str] = []
    page = sit(path="/equipment/m1")
    page.on("request", lambda request: asked.append(request.url))
    page.reload()
    expect(page.locator("[data-go-back]")).to_have_count(0)
    page.goto(f"{server.url}/alarms?panel=1")
    page.goto(f"{server.url}/account")
    page.locator("[data-go-back]").click()
    expect(page).to_have_url(re.compile("/alarms"))
    page.goto(f"{server.url}/account")
    page.get_by_role("button", name="Switch off").click()
    expect(page.locator("[data-go-back]")).to_have_count(0)
    asked.clear()
    page.goto(f"{server.url}/equipment/m1")
    expect(page.locator("body")).to_have_attribute("data-live", "live")
    assert not [url for url in asked if "keypad" in url]


def test_who_signs_out_in_one_window_is_signed_out_in_all(sit: Sit, sessions: dict[str, StorageState]) -> None:
    sessions.clear()
    page = sit()
    other = page.context.new_page()
    other.goto(page.url)
    expect(other.locator(".head .who")).to_contain_text("ivana")
    other.click(".user-drop summary")
    other.click("form[action='/signout'] button")
    expect(other.locator(".head .who")).to_contain_text("Sign in")
    expect(page.locator(".head .who")).to_contain_text("Sign in")
    sessions.clear()


def test_the_way_back_after_a_sign_out_leads_to_nothing_of_the_person(
    sit: Sit, server: PogonServer, sessions: dict[str, StorageState]
) -> None:
    sessions.clear()
    page = sit(path="/equipment/m1")
    for path in ("/users", "/equipment/m1/parameters", "/account"):
        page.goto(server.url + path)
        expect(page.locator(".head .who")).to_contain_text("ivana")
    page.click(".user-drop summary")
    page.click("form[action='/signout'] button")
    expect(page.locator(".head .who")).to_contain_text("Sign in")
    seen: set[str] = set()
    for _ in range(4):
        page.go_back()
        expect(page.locator(".head .who")).to_contain_text("Sign in")
        expect(page.locator("[data-token=take]")).to_have_count(0)
        assert "ivana" not in page.content()
        seen.add(page.url)
    assert len(seen) >= 3, seen
    sessions.clear()


def test_who_takes_control_on_a_slow_line_is_told_to_wait(sit: Sit) -> None:
    page = sit(path="/equipment/m1")
    held: list[Route] = []
    page.route("**/token/take", lambda route: held.append(route))
    page.locator("[data-token=take]").click()
    expect(page.locator(".waits")).to_be_visible()
    held.pop().continue_()
    expect(page.locator(".token").first).to_have_attribute("data-holding", "mine")
    expect(page.locator(".waits")).to_be_hidden()


def test_whose_session_an_administrator_ends_reads_so_at_once_on_every_page(
    sit: Sit, server: PogonServer, sessions: dict[str, StorageState]
) -> None:
    sessions.pop("ivo", None)
    pages = [sit("ivo", "/equipment/m1"), sit("ivo", "/account"), sit("ivo", "/alarms")]
    typing = pages[-1]
    typing.locator("#alarm-filter [name=q]").fill("fan")
    enroll(server.data, {"ada": ("admin",)}, PASSWORD)
    admin = sit("ada", "/users")
    row = admin.locator("details.u-row", has=admin.locator(".chip", has_text="ivo"))
    row.locator("summary").click()
    while (ends := row.locator("form[action$='/sessions/end'] button")).count():
        ends.first.click()
        expect(admin.locator("#content")).to_contain_text("The session has ended.")
        row.locator("summary").click()
    told = "Your session was ended by another session or by an administrator"
    machine, account, _ = pages
    expect(machine.locator(".head .who")).to_contain_text("Sign in")
    expect(machine.locator("#message")).to_contain_text(told)
    expect(account).to_have_url(re.compile("/signin"))
    expect(account.locator("body")).to_contain_text(told)
    # who types keeps what was typed, and hears that it leads nowhere
    expect(typing.locator("#message")).to_contain_text("The session has ended: nothing can be sent from here any more")
    expect(typing.locator("#alarm-filter [name=q]")).to_have_value("fan")
    sessions.pop("ivo", None)
