"""The pages of a SINAMICS drive in a real browser: start and stop, a fault and its acknowledgement, the words bit by bit."""

import re
import shutil
import time
from collections.abc import Iterator
from contextlib import suppress

import pytest
from playwright.sync_api import Error, Page, Route, expect

from app import bundled
from tests.browser.looks import BOTH
from tests.browser.station import LANGUAGES, SIZES, Sit, built, fault, lay_out, serving, take
from tests.conftest import PogonServer

WHO, HOME = "ivana", "/equipment/d2"
PARTS = ("", "/page/words", "/faceplate", "/parameters", "/drive-parameters", "/fault-buffer")
COMMANDS = ("forward", "reverse", "coast", "quick_stop", "reset", "stop")


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PogonServer]:
    """One Pogon with the two drives of the bundled plant."""
    folder = tmp_path_factory.mktemp("drives")
    shutil.copytree(bundled("plants/sinamics"), folder / "plant")
    with serving(folder) as running:
        yield running


def press(page: Page, command: str) -> None:
    """Give a command of the column; it is done before anything else is."""
    button = page.locator(f".op [data-command='d2.{command}']")
    label = button.locator(".cmd-t").evaluate("text => text.firstChild.textContent")
    asks = "danger" in (button.get_attribute("class") or "")
    button.click()
    if asks:
        page.locator("#overlay .danger").click()
    expect(page.locator("#message")).to_contain_text(re.compile(f"{label}: .*Done"), timeout=20_000)


def bit(page: Page, name: str, on: bool) -> None:
    row = page.locator(f"li[data-tag='d2.{name}']")
    expect(row).to_have_class(re.compile(r"\bon\b") if on else re.compile(r"^(?!.*\bon\b)"))
    expect(row.locator("svg")).to_be_visible(visible=on)


def test_start_and_stop_are_seen_in_state_symbol_and_gauge(sit: Sit) -> None:
    page = sit()
    built(page, "d2")
    take(page)
    running, symbol = page.locator(".m-state .st-t").first, page.locator(".m-state .when-online .eq")
    expect(running).not_to_have_text("In operation")
    press(page, "forward")
    expect(symbol).to_have_class(re.compile(r"\brun\b"))
    expect(page.locator(".m-state .st-dir:not(.rev) use")).to_be_visible()
    expect(page.locator(".m-state .st-dir.rev use")).to_be_hidden()
    expect(page.locator(".m-gauge [role=meter]")).to_have_attribute("aria-valuenow", re.compile(r"^8\d\d|^9\d\d"))
    press(page, "stop")
    expect(symbol).not_to_have_class(re.compile(r"\brun\b"))
    expect(page.locator(".m-state .st-dir use").first).to_be_hidden()


def test_an_answer_that_comes_late_does_not_hide_what_became_of_the_command(sit: Sit) -> None:
    page = sit()
    built(page, "d2")
    take(page)

    def late(route: Route) -> None:
        answer = route.fetch()  # accepted
        expect(page.locator("#message")).to_contain_text("Forward: Accepted", timeout=10_000)
        expect(page.locator("#message")).to_contain_text("Done", timeout=20_000)  # heard by the way of everybody
        route.fulfill(response=answer)

    page.route("**/command/forward", late)
    press(page, "forward")
    page.wait_for_timeout(1_500)
    expect(page.locator("#message")).to_contain_text("Done")
    expect(page.locator(".op [data-command='d2.forward']")).to_have_attribute("data-state", re.compile("done|idle"))
    press(page, "stop")


@pytest.mark.parametrize("code", [7860, 30005, 1910])
def test_a_fault_is_named_and_the_drive_runs_again_after_its_acknowledgement(sit: Sit, code: int) -> None:
    page = sit()
    built(page, "d2")
    take(page)
    reset = page.locator(".op [data-command='d2.reset']")
    expect(reset).to_have_attribute("aria-disabled", "true")
    press(page, "forward")
    fault(page, "d2", code)
    expect(page.locator(".si-fault")).to_contain_text(f"F{code:05d}")
    expect(page.locator(".m-state .when-online [href$='#e-motor-x']")).to_be_visible()
    page.locator("[data-faceplate]").first.click()
    expect(page.locator("dialog .f-code")).to_have_text(f"F{code:05d}")
    page.locator("dialog [data-close]").click()
    fault(page, "d2", 0)
    press(page, "reset")
    expect(page.locator(".m-state .when-online [href$='#e-motor-x']")).to_be_hidden()
    expect(page.locator(".si-fault")).not_to_contain_text("F0")
    press(page, "forward")
    press(page, "stop")


def test_the_words_follow_the_drive_bit_by_bit(sit: Sit) -> None:
    page = sit(path="/equipment/d2/page/words")
    built(page, "d2")
    take(page)
    bit(page, "zsw1_operation_enabled", on=False)
    press(page, "forward")
    for name, on in (("zsw1_operation_enabled", True), ("zsw1_fault", False), ("stw1_invert", False)):
        bit(page, name, on)
    press(page, "reverse")
    bit(page, "stw1_invert", on=True)
    bit(page, "zsw1_forward", on=False)
    press(page, "coast")
    bit(page, "stw1_no_coast_stop", on=False)
    bit(page, "zsw1_operation_enabled", on=False)


def test_parameters_behind_the_mailbox_come_in_without_the_page_being_loaded_again(sit: Sit) -> None:
    page = sit(path="/equipment/d2/parameters")
    page.locator("a[href$='/drive-parameters']").click()
    page.locator("input[type=search]").fill("ramp")
    page.keyboard.press("Enter")
    row = page.locator("tr[data-code=p1120] td").nth(2)
    expect(row).to_have_text("not read")
    page.evaluate("window.stayed = true")
    page.locator(".dp-read button").click()
    expect(row).to_have_text(re.compile(r"^\s*\d+\ss\s*\d\d:\d\d:\d\d\s*$"), timeout=20_000)
    expect(page.locator(".dp-read progress")).to_have_count(0)
    assert page.evaluate("window.stayed") is True and page.locator("tr[data-code]").count() > 5


def test_a_search_that_is_answered_late_does_not_take_the_reading_away(sit: Sit) -> None:
    page = sit(path="/equipment/d2/drive-parameters")
    row = page.locator("tr[data-code=p1120] td").nth(2)
    page.locator("[data-row], tr[data-code]").first.wait_for()
    held: list[Route] = []
    page.route("**/drive-parameters?*q=ramp*", lambda route: held.append(route))
    page.locator("input[type=search]").fill("ramp")
    end = time.monotonic() + 30
    while not held:
        assert time.monotonic() < end
        page.wait_for_timeout(50)
    answer = held[0].fetch()  # as it was before the press
    with page.expect_response("**/drive-parameters/read"):
        page.locator(".dp-read button").click()
    with suppress(Error):  # given up
        held[0].fulfill(response=answer)
    page.unroute_all()
    expect(page.locator(".dp-read progress")).to_have_count(0, timeout=60_000)
    expect(row).to_have_text(re.compile(r"^\s*\d+\ss\s*\d\d:\d\d:\d\d\s*$"))


def test_the_fault_buffer_is_read_on_a_press_and_by_itself_when_a_fault_comes(sit: Sit) -> None:
    page = sit(path="/equipment/d2/faceplate")
    built(page, "d2")
    page.locator("a[href$='/fault-buffer']").click()
    page.locator("#fb button").click()
    present = page.locator("#fb [data-situation=s0] [data-code]")
    expect(page.locator("#fb [role=status]")).to_contain_text("Read at", timeout=20_000)
    expect(present).to_have_count(0)
    fault(page, "d2", 30005)
    expect(present).to_have_attribute("data-code", "F30005", timeout=20_000)
    expect(present).to_contain_text("Reduce the load, let it cool down.")
    expect(page.locator("#fb .fb-old")).to_have_count(0, timeout=20_000)
    lay_out(page, *SIZES["phone"], "desk")
    value = present.locator("td").nth(1)
    expect(value).to_have_text(re.compile(r"^\s*Value \d+\s*$"))
    assert value.evaluate("cell => getComputedStyle(cell, '::before').content") == "none"  # it is of no drive object
    assert page.evaluate(BOTH) == []
    fault(page, "d2", 0)


@pytest.mark.parametrize("lang", LANGUAGES)
def test_nothing_is_cut_and_no_command_is_missing_at_any_size(sit: Sit, server: PogonServer, lang: str) -> None:
    page = sit(lang=lang)
    found: list[str] = []
    for machine in ("d1", "d2"):
        for part in PARTS:
            page.goto(f"{server.url}/equipment/{machine}{part}")
            expect(page.locator("body")).to_have_attribute("data-live", "live")
            page.evaluate("document.fonts.ready.then(() => 1)")
            for size, (width, height) in SIZES.items():
                lay_out(page, width, height, "panel-9" if size == "small" else "desk")
                found += [f"{lang} {machine}{part} {size}: {one}" for one in page.evaluate(BOTH)]
                if part.endswith(("parameters", "buffer")):
                    continue
                seen = {key: page.locator(f"[data-command='{machine}.{key}']:visible").count() for key in COMMANDS}
                if page.locator(".op-more:visible").count():  # one press leads to what has no room beside the others
                    page.locator(".op-more").click()
                    seen |= {
                        key: page.locator(f"[data-command='{machine}.{key}']:visible").count()
                        for key, n in seen.items()
                        if not n
                    }
                    page.locator(".op-mode label").first.click()
                found += [f"{lang} {machine}{part} {size}: no {key}" for key, n in seen.items() if not n]
    assert found == [], "\n".join(["", *found])
