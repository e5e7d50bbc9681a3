"""The keys that every page promises (F1 help, F2 overview, F4 alarms, F6 trends, F8 acknowledge) do it on every kind of page."""

import re

import pytest
from playwright.sync_api import Page, expect

from tests.browser.station import Operator, let_go, take

KINDS = (
    *("/", "/equipment/m1", "/equipment/m1/parameters", "/trends", "/alarms", "/alarms?tab=journal", "/events"),
    *("/instructor/m1", "/communication", "/users", "/audit", "/help"),
)
FOCUS = """() => { // the focus in the first field that one can write in, if there is one
  const field = [...document.querySelectorAll('main input:not([type=hidden], [type=radio], [type=checkbox]), aside input[name=argument]')]
    .find((one) => one.checkVisibility() && !one.disabled);
  field?.focus();
  return Boolean(field);
}"""


@pytest.mark.timeout(300)
def test_each_key_leads_there_from_every_page_and_out_of_a_field(operator: Operator) -> None:
    page, fields = operator.page, 0
    for path in KINDS:
        operator.go(path)
        fields += page.evaluate(FOCUS)
        page.keyboard.press("F1")
        expect(page.locator(".help [data-close]")).to_be_focused()
        page.keyboard.press("Escape")
        expect(page.locator(".help [data-close]")).to_have_count(0)
        assert page.url.startswith(operator.server.url + path), "it stays where it was"
        for key, there in (("F4", "/alarms"), ("F2", "/"), ("F6", "/trends")):
            page.evaluate(FOCUS)
            page.evaluate("() => { document.body.dataset.former = '1'; }")
            page.keyboard.press(key)
            expect(page.locator("body:not([data-former])")).to_have_count(1, timeout=30_000)
            assert page.url.partition("?")[0] == operator.server.url + there, f"{key} on {path}"
            if there == "/trends":  # its address tells what is looked at as soon as that is drawn
                expect(page).to_have_url(re.compile(r"/trends\?tags="), timeout=30_000)
            operator.go(path)
    assert fields >= 4, "fields in which the keys were tried"


def test_the_key_acknowledges_what_is_shown_and_on_the_list_what_is_chosen(operator: Operator) -> None:
    page = operator.page
    operator.go("/equipment/m1")
    page.keyboard.press("F8")
    expect(page.locator("#message")).to_contain_text("There is nothing to acknowledge")
    banner = page.locator("#alarms")
    for unit, code, text in ((2, 9, "Converter: overheated"), (1, 4, "Converter: overcurrent")):
        operator.trip(unit, code)
        expect(banner.locator("strong")).to_have_text(text, timeout=30_000)
    operator.go("/alarms")
    rows = page.locator("tr[data-unack]")
    expect(rows).to_have_count(2, timeout=30_000)
    rows.filter(has_text="overcurrent").locator(".ck").check()
    page.keyboard.press("F8")
    expect(rows).to_have_count(1, timeout=30_000)
    expect(rows).to_contain_text("overheated")
    guest = page.context.browser.new_page()  # type: ignore[union-attr]
    guest.goto(f"{operator.server.url}/equipment/m2")
    expect(guest.locator("#alarms strong")).to_have_text("Pretvarač: pregrijavanje", timeout=30_000)
    guest.keyboard.press("F8")
    expect(guest.locator("#message")).to_contain_text("Za ovo je potrebna prijava")
    guest.close()
    operator.go("/equipment/m2")
    expect(banner.locator("strong")).to_have_text("Converter: overheated", timeout=30_000)
    page.wait_for_timeout(600)  # a press right after the banner changed was meant for what stood there before
    page.keyboard.press("F8")
    expect(page.locator("#message")).to_contain_text("1 alarm acknowledged")


def test_the_keys_lead_out_of_help_but_from_no_dialog_that_asks_or_holds_what_was_typed(operator: Operator) -> None:
    page, url = operator.page, operator.server.url
    for key, there in (("F2", "/"), ("F4", "/alarms"), ("F6", "/trends")):
        operator.go("/equipment/m1")
        page.keyboard.press("F1")
        expect(page.locator(".help [data-close]")).to_be_focused()
        page.keyboard.press(key)
        expect(page.locator(".help")).to_have_count(0, timeout=30_000)
        assert page.url.partition("?")[0] == url + there, key
    operator.go("/equipment/m1")
    page.keyboard.press("Control+k")
    page.locator("#pal-q").fill("fan")
    stays_under(page, "#pal-q")
    page.locator("#pal-q").fill("")
    page.keyboard.press("F4")
    expect(page).to_have_url(f"{url}/alarms", timeout=30_000)
    operator.go("/equipment/m1")
    take(page)
    page.locator("[data-faceplate]").first.click()
    field = page.locator(".fp [data-setpoint] input:not([type=hidden])").first
    field.fill("41")
    stays_under(page, ".fp")
    assert field.input_value() == "41"
    let_go(page)


def test_what_opens_over_a_page_has_its_looks_at_once(operator: Operator) -> None:
    """It is never drawn without them, however late a style sheet of its own would come."""
    page = operator.page
    operator.go("/")
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    for key, part, display in (("Control+k", ".pal-found a", "grid"), ("F1", ".help .help-keys", "grid")):
        page.keyboard.press(key)
        expect(page.locator(".pal [data-first]")).to_be_focused()
        assert page.locator(part).first.evaluate("(one) => getComputedStyle(one).display") == display
        page.keyboard.press("Escape")
        expect(page.locator(".pal")).to_have_count(0)
    assert asked and not [url for url in asked if ".css" in url]


def stays_under(page: Page, dialog: str) -> None:
    """No key leads away from what lies under the dialog."""
    page.evaluate("() => { document.body.dataset.former = '1'; }")
    for key in ("F2", "F4", "F6"):
        page.keyboard.press(key)
    page.wait_for_timeout(500)
    expect(page.locator(dialog)).to_be_visible()
    assert page.locator("body[data-former]").count() == 1
