"""Alarms in a real browser: the banner changes by itself and guards its button, the list stays still, the horn is silenced."""

import re
import time

import pytest
from playwright.sync_api import Page, expect

from tests.browser.station import AXE, Operator, built

CUT = """() => {
    const real = window.fetch;
    window.cut = true;
    window.fetch = async (url, options) => { // the head comes, then the line breaks
        const ended = new AbortController(), answer = await real(url, { ...options, signal: ended.signal });
        if (!window.cut) return answer;
        const text = answer.text.bind(answer);
        answer.text = () => { ended.abort(); document.body.dataset.lost = "some"; return text(); };
        return answer;
    };
}"""

PRESSES = """async () => {
    const row = document.querySelector("tr[data-row]"), list = document.querySelector("[data-renewed=list]"), found = {};
    const press = (kind, button) => row.dispatchEvent(new PointerEvent(kind, { bubbles: true, button }));
    const asks = () => {
        let goes = false;
        const look = (event) => { if (event.target === list) goes = !event.defaultPrevented; };
        document.addEventListener("htmx:before:request", look);
        window.htmx.trigger(list, "again");
        document.removeEventListener("htmx:before:request", look);
        return goes;
    };
    press("pointerdown", 2);
    found["other button"] = asks();
    press("pointerup", 2);
    await new Promise((done) => setTimeout(done, 1500)); // the answer came
    for (const kind of ["pointerdown", "pointerup", "pointerdown"]) press(kind, 0);
    await new Promise((done) => setTimeout(done, 400)); // longer than what follows the first
    found.twice = asks();
    press("pointerup", 0);
    return found;
}"""
"""What is pressed on a list, and whether it is asked for anew meanwhile."""


@pytest.mark.always
def test_an_alarm_comes_to_every_page_by_itself_and_is_acknowledged_there(operator: Operator) -> None:
    page = operator.page
    operator.go("/equipment/m2")
    banner = page.locator("#alarms")
    expect(banner).to_contain_text("No active alarms")
    operator.trip(1, 4)
    expect(banner.locator("strong")).to_have_text("Converter: overcurrent", timeout=30_000)
    expect(page.locator("[data-mark-area] .alm-2")).to_be_visible()
    expect(page.locator("#alarm-alert")).to_have_text("New alarm, priority 2: Converter: overcurrent")
    assert page.locator("#silence").get_attribute("data-idle") is None
    page.wait_for_timeout(600)
    page.click("#banner-ack")
    expect(page.locator("#message")).to_contain_text("1 alarm acknowledged")
    expect(banner).to_contain_text("All alarms acknowledged: 1")


def test_the_alarm_of_a_point_takes_the_place_of_its_pointer(operator: Operator) -> None:
    page = operator.page
    operator.go("/equipment/m2")
    place = page.locator(".mai-ptr [data-mark-pointer]").first
    mark = """(place, mark) => {
        const banner = document.querySelector("[data-marks]").dataset, marks = JSON.parse(banner.marks);
        marks.point = mark ? { [place.dataset.markPointer]: mark } : {};
        banner.marks = JSON.stringify(marks);
        document.dispatchEvent(new Event("pogon:drawn"));
    }"""
    arrow = place.locator("xpath=preceding-sibling::*[local-name()='path']")
    expect(arrow).to_be_visible()
    place.evaluate(mark, [2, "unack"])
    expect(place.locator(".alm-2[data-state=unack]")).to_be_visible()
    expect(arrow).to_be_hidden()
    beside = """place => {
        const [mark, line] = [".alm", "line"].map((one) => place.parentElement.querySelector(one).getBoundingClientRect());
        return [Math.abs(mark.x + mark.width / 2 - line.x - line.width / 2), mark.width]; }"""
    off, wide = place.evaluate(beside)
    assert off <= 2 and 8 <= wide <= 40, (off, wide)
    place.evaluate(mark, None)
    expect(place.locator("svg")).to_have_count(0)
    expect(arrow).to_be_visible()


def test_an_open_page_stays_in_its_language_when_another_window_chooses_one(operator: Operator) -> None:
    page = operator.page
    operator.go("/equipment/m1")
    other = page.context.new_page()
    other.goto(f"{operator.server.url}/equipment/m2")
    other.evaluate("() => document.querySelector('form[action=\"/language\"] [value=de]').click()")
    expect(other.locator("html")).to_have_attribute("lang", "de")
    operator.trip(1, 4)
    expect(page.locator("#alarms strong")).to_have_text("Converter: overcurrent", timeout=30_000)
    expect(other.locator("#alarms strong")).to_have_text("Umrichter: Überstrom", timeout=30_000)
    page.locator("[data-token]").first.click()
    expect(page.locator("#message")).to_contain_text("Control taken")
    other.evaluate("() => document.querySelector('form[action=\"/language\"] [value=en]').click()")
    expect(other.locator("html")).to_have_attribute("lang", re.compile("en"))
    other.close()


def test_a_press_right_after_the_banner_changed_was_meant_for_another_alarm(operator: Operator) -> None:
    page = operator.page
    operator.go("/")
    page.wait_for_timeout(600)  # the page itself is not new any more
    # the press comes in the very moment in which the alarm is drawn
    page.evaluate(
        """() => new MutationObserver((_, watcher) => {
            const button = document.getElementById("banner-ack");
            if (button) { watcher.disconnect(); button.click(); document.body.dataset.pressed = "1"; }
        }).observe(document.getElementById("banner"), { childList: true, subtree: true })"""
    )
    operator.trip(1, 4)
    expect(page.locator("body")).to_have_attribute("data-pressed", "1", timeout=30_000)
    expect(page.locator("#message")).to_contain_text("Nothing was acknowledged")  # a press is never met with silence
    page.wait_for_timeout(800)
    expect(page.locator("#alarms strong")).to_have_text("Converter: overcurrent")
    page.keyboard.press("F8")
    expect(page.locator("#message")).to_contain_text("1 alarm acknowledged")


@pytest.mark.parametrize("button", ["tr[data-unack] [data-ack]", "#ack-visible[aria-disabled=false]"])
def test_a_press_on_what_the_list_has_only_just_shown_is_told(operator: Operator, button: str) -> None:
    page = operator.page
    operator.go("/alarms")
    page.evaluate(
        """(wanted) => new MutationObserver((_, watcher) => {
            const button = document.querySelector(wanted);
            if (button) { watcher.disconnect(); button.click(); }
        }).observe(document.body, { childList: true, subtree: true, attributes: true })""",
        button,
    )
    operator.trip(1, 4)
    expect(page.locator("#message")).to_contain_text("Nothing was acknowledged", timeout=30_000)
    expect(page.locator("#ack-confirm")).to_be_hidden()
    page.wait_for_timeout(700)
    expect(page.locator("tr[data-unack]")).to_have_count(1)
    page.locator("tr[data-unack] [data-ack]").click()
    expect(page.locator("#message")).to_contain_text("1 alarm acknowledged")


def test_the_list_stays_still_while_something_is_chosen(operator: Operator) -> None:
    page = operator.page
    operator.trip(1, 4)
    operator.go("/alarms")
    rows = page.locator("tr[data-row]")
    expect(rows).to_have_count(1)
    expect(page.locator("#alarm-detail h2")).to_have_text("Converter: overcurrent")
    first = page.locator("td[data-since]").inner_text()
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.wait_for_timeout(2200)
    assert page.locator("td[data-since]").inner_text() != first
    assert not [url for url in asked if "/alarms" in url], "durations ask nobody"
    page.locator(".alist .ck").check()
    operator.trip(2, 9)
    expect(page.locator(".a-new")).to_have_text("New: 1. Show")
    expect(rows).to_have_count(1)
    expect(page.locator("#alarms strong")).to_have_text("Converter: overheated", timeout=30_000)
    page.locator("#ack-selected").click()
    expect(rows).to_have_count(2)
    expect(page.locator("tr[data-unack]")).to_have_count(1)
    page.wait_for_timeout(700)
    page.locator("#ack-visible").click()
    expect(page.locator("#ack-confirm")).to_contain_text("Number: 1")
    page.locator("#ack-confirm button[value=yes]").click()
    expect(page.locator("tr[data-unack]")).to_have_count(0)


def test_who_acknowledges_by_keyboard_stays_in_the_row(operator: Operator) -> None:
    page = operator.page
    operator.trip(1, 4)
    operator.trip(2, 9)
    operator.go("/alarms")
    row = page.locator("tr[data-row][data-unack]").nth(1)
    expect(row).to_be_visible()
    number = row.get_attribute("data-row")
    button = row.locator("[form=alarm-one], button:not(.a-open)").first
    page.wait_for_timeout(700)  # a row that one could not look at yet is not meant
    button.focus()
    page.keyboard.press("Enter")
    expect(page.locator(f"tr[data-row='{number}']:not([data-unack])")).to_have_count(1)
    expect(page.locator(f"tr[data-row='{number}'] .a-open")).to_be_focused()


def test_the_list_waits_while_a_press_may_become_a_click_and_no_longer(operator: Operator) -> None:
    page = operator.page
    operator.trip(1, 4)
    operator.go("/alarms")
    rows = page.locator("tr[data-row]")
    expect(rows).to_have_count(1)
    expect(page.locator("#alarm-detail h2")).to_have_text("Converter: overcurrent")
    asked = page.evaluate(PRESSES)
    assert asked == {"other button": True, "twice": False}
    rows.first.locator("th").hover()
    page.mouse.down()  # and nobody hears of its end
    operator.trip(2, 9)
    expect(page.locator("#alarms strong")).to_have_text("Converter: overheated", timeout=30_000)
    expect(rows).to_have_count(2, timeout=3_000)
    page.mouse.up()


def test_a_press_counts_although_the_banner_is_drawn_anew_meanwhile(operator: Operator) -> None:
    page = operator.page
    operator.trip(1, 4)
    operator.go("/")
    expect(page.locator("#alarms strong")).to_have_text("Converter: overcurrent", timeout=30_000)
    page.wait_for_timeout(600)  # a press right after the banner changed was meant for what stood there before
    page.locator("#banner-ack").hover()
    page.mouse.down()
    page.locator("#banner").evaluate(
        """banner => new Promise((done) => {
            banner.addEventListener("htmx:after:swap", () => setTimeout(done, 100), { once: true });
            window.htmx.trigger(banner, "again");
        })"""
    )
    with page.expect_request("**/alarms/acknowledge"):
        page.mouse.up()
    expect(page.locator("#banner-ack")).to_have_count(0)


def test_what_is_typed_about_an_alarm_stays_while_that_changes_and_is_not_said_of_another(operator: Operator) -> None:
    page, detail = operator.page, operator.page.locator("#alarm-detail")
    operator.trip(1, 4)
    operator.trip(2, 9)
    operator.go("/alarms")
    rows = page.locator("tr[data-row]")
    expect(rows).to_have_count(2, timeout=30_000)
    rows.filter(has_text="Converter: overcurrent").locator(".a-open").click()
    expect(detail.locator("h2")).to_have_text("Converter: overcurrent")
    detail.locator(".a-aside > summary").first.click()
    detail.locator("#a-more-shelve").fill("The fan is replaced")
    number = rows.filter(has_text="Converter: overcurrent").get_attribute("data-row") or ""
    csrf = page.locator("[name=csrf]").first.get_attribute("value") or ""
    url = operator.server.url
    page.request.post(
        f"{url}/alarms/acknowledge", form={"occurrence": number, "csrf": csrf}, headers={"Origin": url}, max_redirects=0
    )
    expect(detail).to_contain_text("Active, acknowledged")
    expect(detail.locator("#a-more-shelve")).to_have_value("The fan is replaced")
    expect(detail.locator("#a-more-shelve")).to_be_focused()
    expect(detail.locator("[form=alarm-shelve][data-put]")).to_be_visible()
    rows.filter(has_text="Converter: overheated").locator(".a-open").click()
    expect(detail.locator("h2")).to_have_text("Converter: overheated")
    expect(detail.locator("#a-more-shelve")).to_have_value("")
    expect(detail.locator("[form=alarm-shelve][data-put]")).to_be_hidden()


def test_the_horn_is_silent_here_until_the_next_alarm(operator: Operator) -> None:
    page = operator.page
    operator.go("/")
    operator.trip(1, 4)
    silence = page.locator("#silence")
    expect(page.locator("#alarms strong")).to_be_visible(timeout=30_000)
    page.mouse.click(5, 400)  # the browser lets a page sound after the first gesture
    expect(silence).not_to_have_attribute("data-blocked", "")
    silence.click()
    expect(silence).to_have_attribute("aria-pressed", "true")
    other = page.context.browser.new_context() if page.context.browser else None
    assert other is not None
    station = other.new_page()
    station.goto(operator.server.url)
    assert station.locator("#silence").get_attribute("aria-pressed") == "false", "another station sounds on"
    other.close()
    page.evaluate(
        "() => { const now = Date.now; Date.now = () => now() - 3600e3; }"
    )  # somebody sets the clock of this computer back
    expect(silence).to_have_attribute("aria-pressed", "false", timeout=5_000)
    page.evaluate("() => { const now = Date.now; Date.now = () => now() + 3600e3; }")
    expect(silence).to_have_attribute("aria-pressed", "true", timeout=5_000)
    operator.trip(2, 9)
    expect(silence).to_have_attribute("aria-pressed", "false", timeout=30_000)


BEEPS = """() => {
    const start = OscillatorNode.prototype.start;
    OscillatorNode.prototype.start = function (...at) { document.documentElement.dataset.beeps += "."; return start.apply(this, at); };
}"""


UNTOUCHED = """() => {
    let touched = false;
    addEventListener("pointerdown", () => { touched = true; }, true);
    Object.defineProperty(AudioContext.prototype, "state", { get: () => touched ? "running" : "suspended" });
}"""
"""No sound before the first gesture, as browsers have it; a headless one does not always."""


def sounds(page: Page) -> None:
    """Wait until this page sounds from now on."""
    page.evaluate("() => { document.documentElement.dataset.beeps = ''; }")
    expect(page.locator("html")).to_have_attribute("data-beeps", re.compile(r"^\.+$"))


def test_of_two_tabs_the_one_sounds_that_may(operator: Operator) -> None:
    """A tab that was opened behind this one, and never touched, took the horn over with the next page here, and kept silent."""
    page = operator.page
    page.add_init_script(f"({BEEPS})()")
    operator.go("/")
    page.mouse.click(5, 400)
    behind = page.context.new_page()
    behind.add_init_script(f"({BEEPS})(); ({UNTOUCHED})()")
    behind.goto(operator.server.url + "/trends")
    operator.trip(2, 9)
    expect(behind.locator("#silence")).to_have_attribute("data-blocked", "", timeout=30_000)
    operator.go("/alarms")
    page.mouse.click(5, 400)
    expect(page.locator("#silence")).not_to_have_attribute("data-blocked", "")
    sounds(page)
    behind.mouse.click(5, 400)  # now somebody is there
    sounds(behind)
    page.evaluate("() => { document.documentElement.dataset.beeps = ''; }")
    sounds(behind)
    expect(page.locator("html")).to_have_attribute("data-beeps", "")  # one of them sounds
    behind.close()
    sounds(page)


@pytest.mark.parametrize("path", ["/alarms", "/"])
def test_what_is_shown_is_made_good_when_answers_broke_off(operator: Operator, path: str) -> None:
    page = operator.page
    operator.go(path)
    rows = page.locator("tr[data-row]")
    before = rows.count()
    page.evaluate(CUT)
    operator.trip(1, 4)
    expect(page.locator("body")).to_have_attribute("data-lost", "some", timeout=30_000)
    page.wait_for_timeout(1500)
    expect(page.locator("#alarms")).to_contain_text("No active alarms")
    page.evaluate("() => { window.cut = false; }")
    expect(page.locator("#alarms strong")).to_have_text("Converter: overcurrent")
    if path == "/alarms":
        expect(rows).to_have_count(before + 1)
        expect(page.locator("#alarm-detail h2")).to_have_text("Converter: overcurrent")


@pytest.mark.parametrize("path", ["/alarms", "/alarms?tab=journal", "/"])
def test_axe_finds_nothing(operator: Operator, path: str) -> None:
    page = operator.page
    operator.trip(1, 4)
    operator.go(path)
    time.sleep(1)
    page.evaluate(AXE.read_text("utf-8"))
    found = page.evaluate(
        "async () => (await axe.run()).violations.map((v) => v.id + ': ' + v.nodes.map((n) => n.html).join(' | '))"
    )
    assert found == []
    assert not re.search("undefined|\\[alarm", page.inner_text("body"))


def test_an_alarm_is_shelved_with_a_reason_and_comes_back_unacknowledged(operator: Operator) -> None:
    page = operator.page
    operator.trip(1, 4)
    operator.go("/alarms")
    expect(page.locator("#alarm-detail h2")).to_have_text("Converter: overcurrent")
    page.locator(".a-aside > summary").first.click()
    expect(page.locator("#alarm-detail [form=alarm-shelve][data-put]")).to_be_in_viewport(ratio=1)
    page.fill("#a-more-shelve", "The fan is replaced on Friday")
    page.locator("#alarm-detail [form=alarm-shelve][data-put]").click()
    expect(page.locator("#alarms")).to_contain_text("No active alarms", timeout=30_000)
    expect(page.locator("[data-tag='sys.alarms.hidden']").first).to_have_text("1", timeout=30_000)
    operator.go("/alarms?tab=hidden")
    row = page.locator("tr[data-row]")
    expect(row).to_contain_text("The fan is replaced on Friday")
    page.set_viewport_size({"width": 390, "height": 844})
    button = row.locator("[form=alarm-unshelve]")
    box = button.bounding_box()
    assert box and box["x"] + box["width"] <= 390
    button.click()
    expect(page.locator("#alarms strong")).to_have_text("Converter: overcurrent", timeout=30_000)
    operator.go("/alarms")
    expect(row).to_contain_text("Active, unacknowledged")


def test_what_stands_beside_the_list_is_not_left_as_it_was_when_its_row_goes(operator: Operator) -> None:
    """The shelving of the only one ends while one looks; later somebody else acknowledges what has returned."""
    page, detail = operator.page, operator.page.locator("#alarm-detail")

    def another(where: str, **form: str) -> None:
        form |= {"csrf": page.locator("[name=csrf]").first.get_attribute("value") or ""}
        answer = page.request.post(
            f"{operator.server.url}{where}", form=form, headers={"Origin": operator.server.url}, max_redirects=0
        )
        assert answer.status == 303, answer.text()

    operator.trip(1, 4)
    operator.go("/alarms")
    expect(page.locator("tr[data-row]")).to_have_count(1)
    name = page.locator("tr[data-row]").get_attribute("data-alarm") or ""
    another("/alarms/shelve", alarm=name, minutes="15", reason="Maintenance")
    operator.go("/alarms?tab=hidden")
    expect(detail).to_contain_text("Shelved")
    another("/alarms/unshelve", alarm=name)
    expect(page.locator("tr[data-row]")).to_have_count(0)
    expect(detail).to_contain_text("Active, unacknowledged")
    expect(detail).not_to_contain_text("Shelved")
    built(page, "m1")
    expect(detail).to_contain_text("Cleared, unacknowledged")
    number = page.evaluate("document.querySelector('#alarm-detail').getAttribute('hx-get').split('/').pop()")
    another("/alarms/acknowledge", occurrence=number)
    expect(detail).to_contain_text("This alarm is over")
