"""Operating a machine in a real browser: commands and what becomes of them, setpoints, control, hold-to-run, parameters, a lost server."""

import re
import signal
import time
from collections.abc import Callable, Iterator
from urllib.parse import parse_qs

import pytest
from playwright.sync_api import Page, Route, expect

from tests.browser.station import AXE, Sit, let_go, serving, small, take
from tests.conftest import PogonServer

WHO, HOME = "", "/equipment/m1"
PEOPLE = {"ana": ("operator", "engineer"), "ivo": ("operator",)}
SPEED = ".hero-v .val b"


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PogonServer]:
    """One Pogon with the drives of the demo plant, the first of which is soon at its speed, and two operators."""
    folder = small(tmp_path_factory.mktemp("operated"), "m1", "m2")
    file = folder / "plant" / "plant.toml"
    plant = file.read_text("utf-8")
    assert "F113 = 40.0" in plant
    file.write_text(plant.replace("F113 = 40.0", "F113 = 40.0, F114 = 1.5, F115 = 1.5"), "utf-8")
    with serving(folder, PEOPLE) as running:
        yield running


def speed(page: Page) -> float:
    text = page.inner_text(SPEED).replace("\u2212", "-").replace("\u202f", "")
    return float(text) if re.fullmatch(r"-?\d+", text) else float("nan")


def wait_speed(page: Page, holds: Callable[[float], bool], limit: float = 20.0) -> None:
    end = time.monotonic() + limit
    while not holds(speed(page)):
        assert time.monotonic() < end, f"speed stays {speed(page)}"
        page.wait_for_timeout(50)


def stop(page: Page) -> None:
    page.click(".zone .stop")
    expect(page.locator("#message")).to_contain_text(re.compile("Stop: Accepted .* Done"), timeout=30_000)
    wait_speed(page, lambda now: now == 0)


def audit(server: PogonServer, page: Page, command: str) -> int:
    """Lines of the audit about `command`, as an engineer reads them."""
    page.goto(f"{server.url}/audit")
    return page.locator("main").inner_text().count(command)


def settled(server: PogonServer, page: Page, command: str, least: int) -> int:
    """Lines of the audit about `command` a second after there are `least`."""
    end = time.monotonic() + 30
    while audit(server, page, command) < least and time.monotonic() < end:
        page.wait_for_timeout(100)
    page.wait_for_timeout(1000)
    return audit(server, page, command)


# ---- start, reverse, stop -------------------------------------------------------------------------------------


@pytest.mark.always
def test_a_start_is_asked_accepted_and_confirmed_and_the_speed_rises(sit: Sit) -> None:
    page, other = sit("ana"), sit()
    expect(page.locator("[data-command='m1.forward'] small")).to_have_text("Take control first")
    take(page)
    stop(page)
    page.click("[data-command='m1.forward']")
    expect(page.locator("#message")).to_contain_text(re.compile(r"M1 Forward: Accepted \d\d:\d\d:\d\d → Done .* ana"))
    expect(page.locator("[data-command='m1.forward']")).to_have_attribute("data-state", "done")
    wait_speed(page, lambda now: now > 900)
    expect(other.locator("#message")).to_contain_text("M1 Forward: Accepted")
    expect(other.locator("#message")).not_to_contain_text("ana")


def test_reverse_while_running_asks_and_cancel_has_the_focus(sit: Sit) -> None:
    page = sit("ana")
    take(page)
    expect(page.locator("[data-command='m1.reverse'] small")).to_have_text("Asks first")
    page.click("[data-command='m1.reverse']")
    dialog = page.locator("dialog")
    expect(dialog).to_contain_text("Reverse: Fan 1")
    expect(dialog.locator(".ask-effect")).to_have_text(
        re.compile(r"Fan 1 runs forward at 1.?\d{3} rpm: it brakes in about \d(\.\d)? s, then runs in reverse\.")
    )
    expect(dialog).not_to_contain_text("Unusual")
    assert page.evaluate("document.activeElement.hasAttribute('data-cancel')")
    page.keyboard.press("Enter")
    expect(dialog).to_have_count(0)
    wait_speed(page, lambda now: now > 900)
    page.click("[data-command='m1.reverse']")
    expect(dialog).to_be_visible()
    page.keyboard.press("Escape")
    expect(dialog).to_have_count(0)
    expect(page.locator("[data-command='m1.reverse']")).to_have_attribute("data-state", "idle")
    page.click("[data-command='m1.reverse']")
    page.locator(".scrim .stop").click()
    expect(dialog).to_have_count(0)
    wait_speed(page, lambda now: now == 0)
    page.click("[data-command='m1.forward']")
    wait_speed(page, lambda now: now > 900)
    page.click("[data-command='m1.reverse']")
    expect(page.locator(".scrim .stop")).to_be_visible()
    dialog.get_by_role("button", name="Reverse").click()
    wait_speed(page, lambda now: now < -900)
    page.click("[data-command='m1.forward']")
    dialog.get_by_role("button", name="Forward").click()
    wait_speed(page, lambda now: now > 900)


def test_a_double_click_is_one_command(server: PogonServer, sit: Sit) -> None:
    page, clerk = sit("ana"), sit("ana")
    before = audit(server, clerk, "m1.coast")
    take(page)
    page.dblclick("[data-command='m1.coast']")
    expect(page.locator("#message")).to_contain_text(re.compile("Coast stop: Accepted .* Done"), timeout=30_000)
    # a command has two lines: as sent, and with its outcome
    assert settled(server, clerk, "m1.coast", before + 2) == before + 2
    expect(page.locator("[data-command='m1.coast']")).to_be_focused()
    expect(page.locator("[data-command='m1.coast']")).not_to_have_attribute("aria-disabled", "true")
    for _ in range(11):
        page.keyboard.down("Enter")
    page.keyboard.up("Enter")
    found = settled(server, clerk, "m1.coast", before + 4)
    assert found == before + 4, "the key held down is one more press, not ten"
    page.click("[data-command='m1.forward']")
    wait_speed(page, lambda now: now > 900)


def test_stop_works_without_any_script(sit: Sit, server: PogonServer) -> None:
    page = sit("ivo")
    state = page.context.storage_state()
    assert page.context.browser is not None
    plain = page.context.browser.new_context(java_script_enabled=False, storage_state=state)
    try:
        bare = plain.new_page()
        bare.goto(f"{server.url}/equipment/m1")
        bare.click(".zone .stop")
        assert bare.url == f"{server.url}/equipment/m1"
        expect(page.locator("#message")).to_contain_text("M1 Stop: Accepted")
        wait_speed(page, lambda now: now == 0)
    finally:
        plain.close()
    take(page)
    page.click("[data-command='m1.forward']")
    wait_speed(page, lambda now: now > 900)


# ---- setpoints ------------------------------------------------------------------------------------------------


def test_an_answer_that_comes_late_does_not_hide_what_became_of_a_setpoint(sit: Sit) -> None:
    page = sit("ana")
    take(page)
    done = re.compile("Set frequency = 38.Hz: Accepted .* Done")

    def late(route: Route) -> None:
        answer = route.fetch()  # accepted
        expect(page.locator("#message")).to_contain_text(done, timeout=20_000)  # heard by the way of everybody
        route.fulfill(response=answer)

    page.route("**/command/set_frequency", late)
    page.fill("#set-m1\\.set_frequency", "38")
    with page.expect_response("**/command/set_frequency"):
        page.keyboard.press("Enter")
    page.wait_for_timeout(500)  # for the answer to be drawn
    expect(page.locator("#message")).to_contain_text(done)
    page.unroute("**/command/set_frequency")
    page.fill("#set-m1\\.set_frequency", "40")
    page.keyboard.press("Enter")
    expect(page.locator("#message")).to_contain_text(re.compile("Set frequency = 40.Hz: Accepted .* Done"))


def test_another_value_right_after_one_is_another_press(sit: Sit) -> None:
    """Typed while the first is on its way, or right after its answer: it goes, and is no change by somebody else."""
    page = sit("ana")
    take(page)
    sent: list[str] = []
    page.on("request", lambda one: sent.append(one.post_data or "") if one.url.endswith("/set_frequency") else None)
    page.route("**/command/set_frequency", lambda route: (page.wait_for_timeout(600), route.continue_()), times=1)
    for value in ("41", "42", "42"):  # the last one is the same press
        page.fill("#set-m1\\.set_frequency", value)
        page.keyboard.press("Enter")
    expect(page.locator("#message")).to_contain_text(re.compile("Set frequency = 42.Hz: Accepted .* Done"))
    expect(page.locator("#set-m1\\.set_frequency")).to_have_value("42.00")
    with page.expect_response("**/command/set_frequency"):
        page.fill("#set-m1\\.set_frequency", "43")
        page.keyboard.press("Enter")
    page.fill("#set-m1\\.set_frequency", "40")  # before it is seen what became of 43
    page.keyboard.press("Enter")
    expect(page.locator("#message")).to_contain_text(re.compile("Set frequency = 40.Hz: Accepted .* Done"))
    assert [value for one in sent for value in parse_qs(one)["argument"]] == ["41", "42", "43", "40"]


def test_a_setpoint_outside_the_normal_band_is_reviewed_first(sit: Sit) -> None:
    page = sit("ana")
    take(page)
    page.fill("#set-m1\\.set_frequency", "20")
    page.keyboard.press("Enter")
    card = page.locator(".review-form")
    expect(card).to_contain_text("Outside the normal range")
    expect(card).to_contain_text("−20.00")
    assert page.evaluate("document.activeElement.hasAttribute('data-cancel')")
    expect(page.locator(".zone .stop")).to_be_in_viewport(ratio=1)
    card.get_by_role("button", name="Set").click()
    expect(page.locator("#message")).to_contain_text(re.compile("Set frequency = 20.Hz: Accepted .* Done"))
    wait_speed(page, lambda now: 0 < now < 620)
    expect(page.locator("#set-m1\\.set_frequency")).to_have_value("20.00")
    back = page.locator(".sp-former")
    expect(back).to_have_attribute("aria-label", re.compile("Back to 40.00.Hz"))
    back.click()
    expect(card).to_contain_text("of the range")
    card.locator("[data-cancel]").click()
    page.fill("#set-m1\\.set_frequency", "40")
    page.keyboard.press("Enter")
    card.get_by_role("button", name="Set").click()
    wait_speed(page, lambda now: now > 900)


def test_what_is_being_typed_survives_live_changes_and_another_hand(sit: Sit) -> None:
    page, engineer = sit("ana"), sit("ana", "/equipment/m1/parameters")
    take(page)
    field = page.locator("#set-m1\\.set_frequency")
    field.fill("33")
    page.click("[data-command='m1.stop']")  # the column is drawn anew several times
    expect(page.locator("#message")).to_contain_text(re.compile("Stop: .* Done"), timeout=30_000)
    expect(field).to_have_value("33")
    engineer.fill("tr[data-key=frequency_setpoint] [data-new]", "42")
    engineer.click("[data-submit]")
    expect(engineer.locator("[data-row=F113]")).to_have_attribute("data-done", "yes")
    expect(field).to_have_value("33")
    field.press("Enter")
    expect(page.locator("#message")).to_contain_text("Changed meanwhile: now 42")
    expect(field).to_have_value("33")
    field.fill("40")
    field.press("Enter")
    expect(page.locator("#message")).to_contain_text(re.compile("Set frequency = 40.Hz: Accepted .* Done"))
    page.click("[data-command='m1.forward']")
    wait_speed(page, lambda now: now > 900)


def test_escape_gives_the_field_back_and_a_wrong_number_is_told_at_the_field(sit: Sit) -> None:
    page = sit("ana")
    take(page)
    field = page.locator("#set-m1\\.set_frequency")
    field.fill("90")
    field.press("Enter")
    expect(page.locator("#say-m1\\.set_frequency")).to_have_text("Permitted: 0.5 to 50 Hz")
    expect(page.locator("#message")).to_have_attribute("role", "alert")
    field.press("Escape")
    expect(field).to_have_value("40.00")


# ---- two operators --------------------------------------------------------------------------------------------


def test_a_press_is_not_lost_when_nothing_of_what_is_pressed_changes(sit: Sit) -> None:
    """What the page shows is fetched anew while the button is down."""
    page = sit("ana", "/equipment/m2")
    let_go(page)
    button = page.locator("[data-token=take]").first
    button.hover()
    page.mouse.down()
    with page.expect_response("**/equipment/m2/commands*"):
        page.evaluate("htmx.trigger(document.querySelector('[data-operation][hx-get]'), 'again')")
    page.wait_for_timeout(300)
    page.mouse.up()
    expect(page.locator(".token").first).to_have_attribute("data-holding", "mine")


@pytest.mark.always
def test_two_operators_ask_refuse_and_hand_over(sit: Sit) -> None:
    ana, ivo = sit("ana"), sit("ivo")
    take(ana)
    expect(ivo.locator("[data-command='m1.coast'] small")).to_contain_text("Control held by: ana")
    expect(ivo.locator("[data-command='m1.stop']")).not_to_have_attribute("aria-disabled", "true")
    ivo.click("[data-token=request]")
    expect(ana.locator(".token")).to_contain_text("ivo asks for control")
    ana.click("[data-token=refuse]")
    expect(ivo.locator("[data-token=request]")).to_be_visible()
    ivo.click("[data-token=request]")
    expect(ivo.locator("#message")).to_contain_text("The holder refused: ana")
    ana.click("[data-token=release]")
    take(ivo)
    ana.click("[data-token=request]")
    ivo.click("[data-token=give]")
    expect(ana.locator(".token")).to_have_attribute("data-holding", "mine")
    expect(ivo.locator(".token")).to_have_attribute("data-holding", "other")
    expect(ivo.locator("#message")).to_contain_text("M1: Control handed over")
    expect(ana.locator("#message")).to_contain_text("M1: You are in control")


def test_who_loses_control_without_a_press_of_his_own_reads_who_has_it_now(sit: Sit) -> None:
    ana, ivo = sit("ana"), sit("ivo")
    take(ivo)  # ana asks: nobody has refused her in another test, after which one may not ask for a while
    expect(ivo.locator("#message")).to_contain_text("M1: Control taken")
    ana.click("[data-token=request]")
    expect(ivo.locator(".token")).to_contain_text("ana asks for control")
    expect(ana.locator(".token")).to_have_attribute("data-holding", "mine", timeout=60_000)  # nobody answered
    expect(ivo.locator("#message")).to_contain_text("M1: Control held by: ana, since")


# ---- hold-to-run ----------------------------------------------------------------------------------------------


def jog(page: Page) -> None:
    """Choose hold-to-run and press the forward button without letting go."""
    page.click(".op-mode label:has([value=hold])")
    expect(page.locator("[data-hold='m2.jog_forward']")).not_to_have_attribute("aria-disabled", "true")
    press(page)


def press(page: Page) -> None:
    box = page.locator("[data-hold='m2.jog_forward']").bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 40, box["y"] + 30)
    page.mouse.down()


def moves(page: Page) -> None:
    """Wait until the motor turns. A station that is too busy to keep the motion alive lets go, as it must; then it is pressed anew."""
    button = page.locator("[data-hold='m2.jog_forward']")
    for _ in range(4):
        end = time.monotonic() + 20
        while time.monotonic() < end:
            if speed(page) > 30 and button.get_attribute("data-state") == "held":
                return
            if button.get_attribute("data-state") == "idle" and speed(page) == 0:
                break
            page.wait_for_timeout(50)
        page.mouse.up()
        expect(button).not_to_have_attribute("aria-disabled", "true", timeout=30_000)
        press(page)
    raise AssertionError(f"the motor does not move: {page.inner_text('#message')}")


def stands(page: Page) -> None:
    wait_speed(page, lambda now: now == 0, 8)


def at_rest(page: Page) -> None:
    """Wait until nothing is at work on the machine of who holds it: what was held in the story before has ended, with all it gives back."""
    stands(page)
    expect(page.locator("[data-command='m2.coast']")).not_to_have_attribute("aria-disabled", "true", timeout=30_000)


def test_m1_says_why_it_cannot_be_held(sit: Sit) -> None:
    page = sit("ana")
    take(page)
    page.click(".op-mode label:has([value=hold])")
    button = page.locator("[data-hold='m1.jog_forward']")
    expect(button).to_have_attribute("aria-disabled", "true")
    expect(button).to_contain_text("F905")


@pytest.mark.always
def test_m2_moves_while_it_is_held_and_stops_at_release(sit: Sit) -> None:
    page = sit("ana", "/equipment/m2")
    take(page)
    jog(page)
    moves(page)
    page.wait_for_timeout(1500)
    assert speed(page) > 30
    page.mouse.up()
    stands(page)
    expect(page.locator("#message")).to_contain_text(re.compile("M2 Jog .* Done"), timeout=30_000)


@pytest.mark.parametrize(
    "cause",
    [
        "window.dispatchEvent(new Event('blur'))",
        "document.dispatchEvent(new Event('pogon:dialog'))",
        "document.dispatchEvent(new KeyboardEvent('keydown', {key: 'a', bubbles: true}))",
        "window.dispatchEvent(new Event('resize'))",
        "document.querySelector('[data-hold=\"m2.jog_forward\"]').remove()",
    ],
)
def test_whatever_is_doubtful_ends_the_motion_and_only_a_new_press_moves_again(sit: Sit, cause: str) -> None:
    page = sit("ana", "/equipment/m2")
    take(page)
    jog(page)
    moves(page)
    page.evaluate(cause)
    stands(page)
    page.wait_for_timeout(700)
    assert speed(page) == 0
    page.mouse.up()


def test_a_pointer_that_slides_off_the_button_ends_the_motion(sit: Sit) -> None:
    page = sit("ana", "/equipment/m2")
    take(page)
    jog(page)
    moves(page)
    page.mouse.move(300, 300)
    stands(page)
    page.mouse.up()


def test_a_hold_that_the_network_ends_under_the_finger_says_so(sit: Sit) -> None:
    page = sit("ana", "/equipment/m2")
    take(page)
    jog(page)
    moves(page)
    page.evaluate(
        """window.said = [];
        const line = document.getElementById("message");
        new MutationObserver(() => said.push(line.innerText)).observe(line, { childList: true, subtree: true, characterData: true });
        WebSocket.prototype.send = () => {};"""
    )
    expect(page.locator("[data-hold='m2.jog_forward']")).to_have_attribute("data-state", "idle")
    stands(page)
    page.mouse.up()
    assert any("No answer from the server" in text for text in page.evaluate("said"))


def test_a_closed_tab_and_a_killed_browser_end_the_motion(sit: Sit) -> None:
    watcher = sit("ivo", "/equipment/m2")
    page = sit("ana", "/equipment/m2")
    take(page)
    jog(page)
    moves(page)
    page.close()
    stands(watcher)


def test_a_page_that_freezes_ends_the_motion(sit: Sit) -> None:
    watcher = sit("ivo", "/equipment/m2")
    page = sit("ana", "/equipment/m2")
    take(page)
    jog(page)
    moves(page)
    page.evaluate("const end = performance.now() + 4000; while (performance.now() < end);")
    stands(watcher)
    page.mouse.up()


def test_the_space_bar_holds_too_and_its_repeats_are_one_press(sit: Sit) -> None:
    page = sit("ana", "/equipment/m2")
    take(page)
    page.click(".op-mode label:has([value=hold])")
    expect(page.locator("[data-hold='m2.jog_forward']")).not_to_have_attribute("aria-disabled", "true")
    page.focus("[data-hold='m2.jog_forward']")
    page.keyboard.down("Space")
    for _ in range(5):
        page.keyboard.down("Space")
    wait_speed(page, lambda now: now > 30)
    page.keyboard.up("Space")
    stands(page)


# ---- faceplate and parameters -----------------------------------------------------------------------------------


def test_the_faceplate_opens_over_the_page_lives_and_gives_the_focus_back(sit: Sit) -> None:
    page = sit("ana")
    take(page)
    page.focus("[data-faceplate]")
    page.keyboard.press("Enter")
    dialog = page.locator("dialog.fp")
    expect(dialog).to_contain_text("No fault of the drive")
    expect(dialog.locator(".perm.quiet")).to_contain_text("Drive stops by itself within 2 s of silence (F905)")
    expect(page.locator(".app-main")).to_have_attribute("inert", "")
    expect(page.locator(".banner")).not_to_have_attribute("inert", "")
    dialog.locator("[data-command='m1.stop']").click()
    expect(dialog.locator("header")).to_contain_text("Stopped", timeout=30_000)
    expect(dialog.locator("[data-command='m1.forward']")).not_to_have_attribute("aria-disabled", "true")
    dialog.locator("[data-command='m1.forward']").click()
    expect(dialog.locator("header")).to_contain_text("Running forward", timeout=30_000)
    dialog.locator("[name=argument]").fill("20")
    page.keyboard.press("Enter")
    expect(dialog.locator(".review-form")).to_contain_text("Outside the normal range")
    page.keyboard.press("Escape")
    expect(page.locator(".review-form")).to_have_count(0)
    expect(dialog).to_be_visible()
    page.keyboard.press("Escape")
    expect(dialog.locator("[name=argument]")).to_have_value("40.00")
    page.keyboard.press("Escape")
    expect(dialog).to_have_count(0)
    assert page.evaluate("document.activeElement.hasAttribute('data-faceplate')")


def test_two_clicks_open_one_dialog_and_a_press_beside_it_leaves_the_keys_with_it(sit: Sit) -> None:
    page = sit("ana")
    held: list[Route] = []
    page.route("**/faceplate", lambda route: held.append(route))
    page.dblclick("[data-faceplate]")
    expect(page.locator(".waits")).to_be_visible()
    for route in held:
        route.continue_()
    page.unroute_all()
    dialog = page.locator("dialog.fp")
    expect(dialog.locator("[data-close]")).to_be_focused()
    expect(page.locator("#overlay dialog")).to_have_count(1)
    page.mouse.click(5, 780)
    page.keyboard.press("Escape")
    expect(dialog).to_have_count(0)
    assert page.evaluate("document.activeElement.hasAttribute('data-faceplate')")


def test_parameters_are_edited_reviewed_and_written_with_a_result_per_row(sit: Sit) -> None:
    page = sit("ana", "/equipment/m2")
    take(page)
    at_rest(page)
    page.goto(page.url + "/parameters")
    page.fill("tr[data-key=f114] [data-new]", "7.5")
    page.fill("tr[data-key=f115] [data-new]", "0.01")
    page.select_option("tr[data-key=f904] [data-new]", "4")
    review = page.locator("[data-changes] li")
    expect(review).to_have_count(3)
    expect(page.locator("[data-together]")).to_be_visible()
    expect(page.locator("[data-nothing]")).to_be_hidden()
    expect(review.nth(0)).to_contain_text("+50")
    expect(review.nth(1)).to_contain_text("Permitted: 0.1 … 3 000 s")
    expect(review.nth(2)).to_contain_text("Writing this cuts the line to the drive")
    expect(page.locator("[data-submit]")).to_be_disabled()
    page.fill("tr[data-key=f115] [data-new]", "6")
    page.select_option("tr[data-key=f904] [data-new]", "")
    page.click("[data-submit]")
    expect(page.locator("[data-answer] li")).to_have_count(2)
    expect(page.locator("[data-row=F114]")).to_have_attribute("data-done", "yes")
    expect(page.locator("[data-row=F115]")).to_have_attribute("data-done", "yes")
    expect(page.locator("tr[data-key=f114] .val b")).to_have_text("7.5")
    expect(page.locator("tr[data-key=f114] [data-new]")).to_have_value("")
    page.fill("[data-filter]", "f905")
    expect(page.locator("tr[data-key]:visible")).to_have_count(1)
    expect(page.locator(".p-group:visible")).to_have_count(1)
    expect(page.locator(".par + .empty")).to_be_hidden()
    page.fill("[data-filter]", "no such parameter")
    expect(page.locator("tr[data-key]:visible, .p-group:visible")).to_have_count(0)
    expect(page.locator(".par + .empty")).to_be_visible()
    page.fill("[data-filter]", "")
    page.click(".p-nav [data-group='group.ramps']")
    expect(page.locator("tr[data-key]:visible")).to_have_count(9)
    page.click("[data-read] button")
    expect(page.locator("#message")).to_contain_text("Read from the drive")


def test_new_values_are_reviewed_as_soon_as_the_server_is_back_and_discarded_on_one_press(
    sit: Sit, server: PogonServer
) -> None:
    page = sit("ana", "/equipment/m2/parameters")
    field, write = page.locator("tr[data-key=f116] [data-new]"), page.locator("[data-submit]")
    server.process.send_signal(signal.SIGSTOP)
    try:
        field.fill("7.5")
        expect(write).to_be_disabled()
        expect(page.locator("body")).to_have_attribute("data-live", "offline", timeout=6000)
        expect(page.locator("[data-changes]")).to_have_count(0)
    finally:
        server.process.send_signal(signal.SIGCONT)
    expect(page.locator("[data-changes] li")).to_have_text(re.compile("7.5"), timeout=30_000)
    expect(write).to_be_enabled()
    field.fill("75x")
    field.press("Enter")  # is no write, and sends nobody away
    expect(page.locator("[data-changes] li")).to_contain_text("Not a number: 75x")
    expect(field).to_have_attribute("aria-invalid", "true")
    expect(write).to_be_disabled()
    page.click("[data-discard]")
    expect(field).to_have_value("")
    expect(page.locator("[data-nothing]")).to_be_visible()
    expect(field).not_to_have_attribute("aria-invalid", re.compile(""))
    page.goto(page.url.removesuffix("/parameters"))  # nothing holds the page back


# ---- a lost server, a keyboard ------------------------------------------------------------------------------------


@pytest.mark.always
def test_without_the_server_every_command_is_refused_here_but_stop_tries_and_tells(
    sit: Sit, server: PogonServer
) -> None:
    page = sit("ana")
    take(page)
    server.process.send_signal(signal.SIGSTOP)
    try:
        expect(page.locator("body")).to_have_attribute("data-live", "offline", timeout=6000)
        expect(page.locator("[data-command='m1.coast'] small")).to_have_text("No connection")
        asked: list[str] = []
        page.on("request", lambda request: asked.append(request.url))
        page.click("[data-command='m1.coast']", force=True)
        page.locator("#set-m1\\.set_frequency").fill("41")
        page.keyboard.press("Enter")
        page.wait_for_timeout(300)
        assert not [url for url in asked if "/command/" in url]
        page.click(".zone .stop")
        expect(page.locator("#message")).to_contain_text("Not delivered", timeout=6000)
        assert [url for url in asked if url.endswith("/equipment/m1/stop")]
    finally:
        server.process.send_signal(signal.SIGCONT)
    expect(page.locator("body")).to_have_attribute("data-live", "live", timeout=30_000)
    # the browser tells of every socket that a frozen server did not answer
    sit.complaints[:] = [told for told in sit.complaints if "closed before the connection is established" not in told]
    page.keyboard.press("Escape")
    expect(page.locator("[data-command='m1.coast']")).not_to_have_attribute("aria-disabled", "true")
    stop(page)
    page.click("[data-command='m1.forward']")
    wait_speed(page, lambda now: now > 900)


def test_that_a_stop_was_not_delivered_is_still_said_when_the_line_is_back(sit: Sit) -> None:
    """What had stood in the line before took its place: who looked away for a moment never learnt that the machine was not stopped."""
    page = sit("ana")
    take(page)
    page.context.set_offline(True)
    expect(page.locator("body")).to_have_attribute("data-live", "offline", timeout=6000)
    page.click(".zone .stop")
    expect(page.locator("#message")).to_contain_text("Not delivered")
    page.context.set_offline(False)
    expect(page.locator("body")).to_have_attribute("data-live", "live", timeout=30_000)
    sit.complaints[:] = [told for told in sit.complaints if "ERR_INTERNET_DISCONNECTED" not in told]
    expect(page.locator("#message")).to_contain_text("Stop: Not delivered")
    expect(page.locator("#message")).to_have_attribute("data-kind", "error")


CUT = """() => {
    const real = window.fetch;
    window.fetch = async (url, options) => { // the head comes, then its time ends
        const { signal, ...given } = options, ended = new AbortController(), answer = await real(url, { ...given, signal: ended.signal });
        if (url === "/nonce") return answer;
        const text = answer.text.bind(answer);
        answer.text = answer.json = () => { ended.abort(new DOMException("signal timed out", "TimeoutError")); return text(); };
        return answer;
    };
}"""


@pytest.mark.parametrize("what", ["command", "stop", "hold", "control", "faceplate", "setpoint", "parameter"])
def test_an_answer_whose_time_ends_after_its_head_is_none_and_throws_nothing(sit: Sit, what: str) -> None:
    page = sit("ana", "/equipment/m2")
    take(page)
    at_rest(page)  # from the cut on nothing new is shown, so what is to be pressed has to be free before
    if what == "control":
        let_go(page)
        expect(page.locator("[data-token=take]")).to_be_visible()
    if what == "hold":
        page.click(".op-mode label:has([value=hold])")
        expect(page.locator("[data-hold='m2.jog_forward']")).not_to_have_attribute("aria-disabled", "true")
    if what == "parameter":
        page.goto(page.url + "/parameters")
        page.fill("tr[data-key=f116] [data-new]", "7.5")
        expect(page.locator("[data-changes] li")).to_have_count(1)
    page.evaluate(CUT)
    if what == "command":
        page.click("[data-command='m2.coast']")
    elif what == "stop":
        page.click(".zone .stop")
    elif what == "hold":
        press(page)
    elif what == "control":
        page.click("[data-token=take]")
    elif what == "faceplate":
        page.click("[data-faceplate]")
    elif what == "parameter":
        page.click("[data-submit]")
    else:
        page.fill("#set-m2\\.set_frequency", "41")
        page.keyboard.press("Enter")
    expect(page.locator("#message")).to_contain_text(re.compile("No answer|Not delivered"))
    expect(page.locator("[data-hold='m2.jog_forward'][data-state=held]")).to_have_count(0)
    page.mouse.up()
    page.reload()
    expect(page.locator("body")).to_have_attribute("data-live", "live")


def test_a_machine_is_operated_with_the_keyboard_alone(sit: Sit) -> None:
    page = sit("ana")
    page.focus("[data-token=take]")
    page.keyboard.press("Enter")
    expect(page.locator(".token")).to_have_attribute("data-holding", "mine")
    assert page.evaluate("document.activeElement.closest('.token') !== null"), "the focus stays where it was"
    for _ in range(12):
        if page.evaluate("document.activeElement.dataset?.command") == "m1.stop":
            break
        page.keyboard.press("Tab")
    page.keyboard.press("Space")
    expect(page.locator("#message")).to_contain_text(re.compile("Stop: .* Done"), timeout=30_000)
    assert page.evaluate("document.activeElement.dataset.command") == "m1.stop"
    for _ in range(12):
        if page.evaluate("document.activeElement.dataset?.command") == "m1.forward":
            break
        page.keyboard.press("Shift+Tab")
    page.keyboard.press("Enter")
    expect(page.locator("#message")).to_contain_text("Forward: Accepted")
    wait_speed(page, lambda now: now > 900)


@pytest.mark.parametrize(
    "path", ["/equipment/m1", "/equipment/m1/faceplate", "/equipment/m1/parameters", "dialog", "question"]
)
def test_axe_finds_nothing(sit: Sit, path: str) -> None:
    page = sit("ana", path if path.startswith("/") else "/equipment/m1")
    if path == "dialog":
        page.click("[data-faceplate]")
        expect(page.locator("dialog.fp")).to_be_visible()
    if path == "question":
        take(page)
        page.click("[data-command='m1.reverse']")
        expect(page.locator("dialog.ask")).to_be_visible()
    page.evaluate(AXE.read_text("utf-8"))
    found = page.evaluate(
        "async () => (await axe.run()).violations.map((v) => v.id + ': ' + v.nodes.map((n) => n.html).join(' | '))"
    )
    assert found == []
    page.keyboard.press("Escape")
