"""What somebody typed outlives their session: it waits in this window until they are back, and nobody else gets it."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, expect

from tests.browser.station import PASSWORD, serving, small, speak
from tests.conftest import PogonServer

VALUES = "all => all.map(one => one.value)"


@pytest.fixture(scope="module")
def office(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PogonServer]:
    people = {"ana": ("admin", "operator"), "ema": ("admin",)}
    with serving(small(tmp_path_factory.mktemp("office"), "m1"), people) as server:
        yield server


def sign_in(page: Page, name: str) -> None:
    page.fill("[name=name]", name)
    page.fill("[name=password]", PASSWORD)
    page.click("form.sheet-form button.cmd")
    expect(page.locator(".head .who")).to_contain_text(name)


def at_the_form(page: Page, office: PogonServer) -> None:
    """Ana has typed a new account; her session ends before she has sent it."""
    speak(page, "en", office.url)
    page.goto(f"{office.url}/signin?next=/users")
    sign_in(page, "ana")
    page.fill("#f-name", "marko")
    page.locator("#f-display").fill("Marko Babić")
    page.locator("form[action='/users'] [value=engineer]").check()
    page.fill("#own-new", PASSWORD)
    (sid,) = [one for one in page.context.cookies() if one["name"] == "sid"]
    page.context.add_cookies([{"name": "sid", "value": sid["value"][::-1], "url": office.url}])


def test_it_is_there_again_for_who_sends_it_too_late(page: Page, office: PogonServer) -> None:
    at_the_form(page, office)
    page.click("form[action='/users'] button.edge")
    page.locator("main a[href*='/signin']").click()
    sign_in(page, "ana")
    expect(page).to_have_url(f"{office.url}/users")
    expect(page.locator("#f-name")).to_have_value("marko")
    expect(page.locator("#f-display")).to_have_value("Marko Babić")
    expect(page.locator("form[action='/users'] [value=engineer]")).to_be_checked()
    expect(page.locator("#own-new")).to_have_value("")
    page.fill("#own-new", PASSWORD)
    page.click("form[action='/users'] button.edge")
    expect(page.locator(".u-secret")).to_be_visible()
    expect(page.locator("#f-name")).to_have_value("")


def test_of_boxes_of_one_name_those_are_ticked_that_were(page: Page, office: PogonServer) -> None:
    """Whatever the reason for which the page is loaded anew, nobody becomes an administrator by it."""
    speak(page, "en", office.url)
    page.goto(f"{office.url}/signin?next=/users")
    sign_in(page, "ana")
    form, others = page.locator("form[action='/users']"), page.locator(".u-row :checked").evaluate_all(VALUES)
    form.locator("[value=viewer]").check()
    form.locator("[value=operator]").uncheck()
    page.click(".lang > summary")
    page.click(".lang button[value=de]")
    expect(page.locator("html")).to_have_attribute("lang", "de")
    assert form.locator(":checked").evaluate_all(VALUES) == ["viewer"]
    assert page.locator(".u-row :checked").evaluate_all(VALUES) == others


def test_it_is_there_again_when_the_page_noticed_first(page: Page, office: PogonServer) -> None:
    at_the_form(page, office)
    page.reload()
    sign_in(page, "ana")
    expect(page.locator("#f-name")).to_have_value("marko")
    page.goto(f"{office.url}/users")
    expect(page.locator("#f-name")).to_have_value("")


def test_somebody_else_does_not_get_it(page: Page, office: PogonServer) -> None:
    at_the_form(page, office)
    page.reload()
    sign_in(page, "ema")
    expect(page).to_have_url(f"{office.url}/users")
    expect(page.locator("#f-name")).to_have_value("")
    assert "marko" not in page.evaluate("JSON.stringify(sessionStorage)")
