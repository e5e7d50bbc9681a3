"""Rights that go while their person is at a machine: the motion ends at once, and the page and the audit say why."""

import time
from collections.abc import Iterator
from typing import Any

import pytest
from playwright.sync_api import Page, expect

from app.plant.texts import Texts
from tests.browser.station import HEARD, LANGUAGES, PASSWORD, Sit, origin, serving, small, take
from tests.conftest import PogonServer

WHO, HOME = "", "/equipment/m2"
OPERATORS = ("ivo", "eva", "jan", "ada")


@pytest.fixture
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PogonServer]:
    """One Pogon with a drive that can be held, an operator, and an administrator."""
    people = {"ana": ("admin", "engineer")} | dict.fromkeys(OPERATORS, ("operator",))
    with serving(small(tmp_path_factory.mktemp("rights"), "m2"), people) as running:
        yield running


@pytest.fixture
def sessions() -> dict[str, Any]:
    """Each server has its own."""
    return {}


def text(lang: str, key: str) -> str:
    return Texts.read().text(lang, key)


def administer(office: Page, what: str, who: str = "ivo", **form: str) -> None:
    """Send a form about an operator; the account of the first of them was made second."""
    url = office.url.split("/users")[0]
    form |= {"csrf": office.locator("[name=csrf]").first.get_attribute("value") or ""}
    answer = office.request.post(
        f"{url}/users/{2 + OPERATORS.index(who)}/{what}", form=form, headers={"Origin": url}, max_redirects=0
    )
    assert answer.status == 303, answer.text()[-600:]


def said(page: Page) -> str:
    """What the message line said."""
    heard: str = page.evaluate("sessionStorage.said ?? ''")
    return heard


def held(page: Page) -> None:
    """Hold the motor forward until it turns."""
    take(page)
    page.click(".op-mode label:has(input[value=hold])")
    button = page.locator("[data-hold='m2.jog_forward']")
    button.hover()
    page.mouse.down()
    expect(button).to_have_attribute("data-state", "held")
    expect(page.locator(".hero-v .val b")).not_to_have_text("0")
    page.evaluate(HEARD)


def ended(page: Page) -> None:
    """The button lets go under the finger."""
    expect(page.locator("[data-hold='m2.jog_forward']")).not_to_have_attribute("data-state", "held", timeout=30_000)


def told(office: Page, *words: str) -> None:
    """The audit says each of these, as soon as the motor stands."""
    end = time.monotonic() + 30
    while True:
        office.goto(f"{origin(office)}/audit")
        if all(one in office.inner_text("main") for one in words):
            return
        assert time.monotonic() < end, office.inner_text("main")
        office.wait_for_timeout(300)


@pytest.mark.parametrize("lang", LANGUAGES)
def test_who_may_operate_no_more_is_told_why_his_motion_ended(sit: Sit, lang: str) -> None:
    """A station that is too busy to keep the motion alive lets go before, as it must; then it is pressed anew."""
    office, page = sit("ana", "/users"), sit("ivo", lang=lang)
    for _ in range(6):
        held(page)
        administer(office, "roles", own_password=PASSWORD, roles="viewer")
        ended(page)
        page.wait_for_timeout(600)
        page.mouse.up()
        if text(lang, "hold.cause.token") in said(page):
            break
        assert text(lang, "fb.lost") in said(page), said(page)
        administer(office, "roles", own_password=PASSWORD, roles="operator")
        page.wait_for_timeout(2_500)
        page.reload()
    assert text(lang, "hold.cause.token") in said(page), said(page)
    told(office, text("en", "hold.cause.token"), text("en", "control.revoked"))
    assert text("en", "control.lost") not in office.inner_text("main")


@pytest.mark.parametrize("lang", LANGUAGES)
def test_who_is_shut_out_reads_that_and_not_that_nobody_answers(sit: Sit, lang: str) -> None:
    """A station that is too busy to keep the motion alive lets go before, as it must, and says so; then the next one is tried."""
    office = sit("ana", "/users")
    for who in OPERATORS:
        page = sit(who, lang=lang)
        held(page)
        administer(office, "disable", who, own_password=PASSWORD)
        ended(page)
        page.wait_for_timeout(600)
        before, over, since = said(page).partition(text(lang, "access.session_over"))
        if over or text(lang, "fb.lost") not in before:
            break
        page.mouse.up()
    assert text(lang, "fb.lost") not in (since if over else before), said(page)
    page.mouse.up()
    expect(page.locator(".head .who")).not_to_contain_text(who)  # a page of nobody, as soon as nothing is held
    told(office, text("en", "control.revoked"))
