"""What is refused of what was typed: which field it is about is seen and heard, in the language of the page, and nothing typed is lost."""

import re
from collections.abc import Iterator

import pytest
from playwright.sync_api import Locator, Page, Route, expect

from app.plant.texts import Texts
from tests.browser.looks import AXE_RUN, FAULTS, SIZES
from tests.browser.station import AXE, LANGUAGES, Sit, lay_out, serving, small, stopped, take
from tests.conftest import PogonServer

WHO, HOME = "ana", "/equipment/m1"
SCREENS = {name: SIZES[name] for name in ("panel", "small", "phone")}
FIELD = "#set-m1\\.set_frequency"


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PogonServer]:
    """One Pogon with a drive and a coil car of the demo plant, and two people."""
    people = {"ana": ("operator", "engineer"), "ivo": ("operator",)}
    with serving(small(tmp_path_factory.mktemp("refused"), "m1", "c1", "cc1"), people) as running:
        yield running


def words(lang: str, key: str, **numbers: str) -> str:
    return Texts.read().text(lang, key).format(**numbers)


def framed(near: Locator) -> list[str]:
    """Names of the fields that are framed as wrong; the same ones say so to who hears the page."""
    names: list[str] = near.locator(".in.bad [name]").evaluate_all("all => all.map((one) => one.name)")
    assert near.locator("[aria-invalid=true]").evaluate_all("all => all.map((one) => one.name)") == names
    return names


def wrong(page: Page) -> list[str]:
    """What is wrong with the page as it stands, at each of SCREENS."""
    found: list[str] = []
    for name, size in SCREENS.items():
        lay_out(page, *size)
        found += [f"{name}: {one}" for one in page.evaluate(FAULTS)]
    lay_out(page, *SIZES["panel"])
    return found


def dialog(page: Page) -> Locator:
    """What asks for the saddle of a coil."""
    page.locator("[data-arguments$='/ask/select_target']").first.click()
    asked = page.locator("#overlay [data-ask]")
    expect(asked).to_be_visible()
    return asked


# ---- setpoints ------------------------------------------------------------------------------------------------


def test_a_setpoint_that_is_refused_is_framed_until_it_is_typed_anew(sit: Sit) -> None:
    page = sit()
    take(page)
    field, form = page.locator(FIELD), page.locator(".sp-field").first
    on_its_way: list[Route] = []
    page.route("**/command/set_frequency", lambda route: on_its_way.append(route), times=1)
    field.fill("90")
    with page.expect_request("**/command/set_frequency"):
        field.press("Enter")
    expect(form.locator("[data-hint]")).to_have_text(words("en", "fb.requested"))
    assert framed(form) == []  # what is being sent is not refused
    on_its_way[0].continue_()
    expect(form.locator("[data-hint]")).to_have_text("Permitted: 0.5 to 50 Hz")
    assert framed(form) == ["argument"]
    field.press("Backspace")
    assert framed(form) == []
    field.press("Enter")
    expect(form.locator("[data-hint]")).not_to_have_text("")
    field.fill("90")
    field.press("Enter")
    expect(form.locator(".in.bad")).to_have_count(1)
    field.press("Escape")
    expect(form.locator(".in.bad")).to_have_count(0)
    expect(field).to_have_value("40.00")


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_a_refused_setpoint_has_no_barrier_in_either_theme(sit: Sit, server: PogonServer, theme: str) -> None:
    page = sit()
    page.context.add_cookies([{"name": "pogon_theme", "value": theme, "url": server.url}])
    page.reload()
    take(page)
    page.fill(FIELD, "90")
    page.press(FIELD, "Enter")
    expect(page.locator(".sp-field .in.bad")).to_have_count(1)
    page.evaluate(AXE.read_text("utf-8"))
    assert page.evaluate(AXE_RUN) == []
    assert wrong(page) == []
    edge, ground = page.locator(".sp-field .in.bad").evaluate(
        "(one) => [getComputedStyle(one).borderTopColor, getComputedStyle(one).backgroundColor]"
    )
    assert contrast(edge, ground) >= 3, f"{edge} on {ground}"


def contrast(one: str, other: str) -> float:
    """Of two colours as a browser computes them (WCAG 2.2)."""
    lighter, darker = sorted((luminance(one), luminance(other)), reverse=True)
    return (lighter + 0.05) / (darker + 0.05)


def luminance(colour: str) -> float:
    parts = [float(part) / 255 for part in colour[colour.index("(") + 1 : -1].split(",")[:3]]
    red, green, blue = (part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts)
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


@pytest.mark.parametrize("lang", LANGUAGES)
def test_who_is_refused_for_another_cause_is_still_told_what_somebody_else_set(sit: Sit, lang: str) -> None:
    """In another tab it is set while somebody types here what is not permitted; the next press here does not overrule it unseen."""
    page, other = sit(lang=lang), sit(lang=lang)
    take(page)
    now = page.locator("input[name=expected]").first.input_value()
    theirs = "38" if float(now) != 38 else "39"
    field, form = page.locator(FIELD), page.locator(".sp-field").first
    field.fill("90")
    other.fill(FIELD, theirs)
    other.press(FIELD, "Enter")
    expect(page.locator("#message")).to_contain_text(f"= {theirs}")
    expect(other.locator("input[name=expected]").first).to_have_value(re.compile(rf"^{theirs}\b"), timeout=30_000)
    field.press("Enter")
    expect(form.locator(".in.bad")).to_have_count(1)
    field.fill("41")
    field.press("Enter")
    told = words(lang, "why.changed", current=theirs, unit="Hz")
    expect(form.locator("[data-hint]")).to_have_text(told)
    assert wrong(page) == []
    expect(field).to_have_value("41")
    field.press("Enter")  # who has read that may
    expect(page.locator("#message")).to_contain_text("= 41")
    expect(form.locator("[data-hint]")).to_have_text("")
    expect(other.locator(FIELD)).to_have_value(re.compile("^41"))
    other.fill(FIELD, "40")
    other.press(FIELD, "Enter")
    expect(page.locator("#message")).to_contain_text("= 40")


# ---- dialogs of commands with arguments -------------------------------------------------------------------------


@pytest.mark.parametrize("lang", LANGUAGES)
def test_what_is_missing_in_a_dialog_is_said_there_in_the_language_of_the_page(sit: Sit, lang: str) -> None:
    page = sit(path="/equipment/cc1", lang=lang)
    take(page)
    sent: list[str] = []
    page.on("request", lambda one: sent.append(one.url) if "/command/" in one.url else None)
    asked = dialog(page)
    field, hint = asked.locator("[name=arg_saddle]"), asked.locator("[data-hint]")
    label = asked.locator("label[for=arg-saddle]").evaluate("(one) => one.firstChild.textContent.trim()")
    asked.locator("footer .danger").click()
    expect(hint).to_have_text(words(lang, "why.argument_missing", label=label))
    assert framed(asked) == ["arg_saddle"]
    assert page.evaluate("document.activeElement.name") == "arg_saddle"
    assert sent == []
    assert wrong(page) == []
    field.press("1")
    expect(hint).to_have_text("")
    assert framed(asked) == []
    page.keyboard.press("Escape")


@pytest.mark.parametrize("lang", LANGUAGES)
def test_a_value_that_a_dialog_cannot_take_stays_and_says_why_at_its_field(sit: Sit, lang: str) -> None:
    page = sit(path="/equipment/cc1", lang=lang)
    take(page)
    asked = dialog(page)
    field, hint = asked.locator("[name=arg_saddle]"), asked.locator("[data-hint]")
    label = asked.locator("label[for=arg-saddle]").evaluate("(one) => one.firstChild.textContent.trim()")
    limits = words(lang, "why.out_of_limits", min="0", max="3", unit="").rstrip()
    missing = words(lang, "why.argument_missing", label=label)
    for typed, said in {
        "4": limits,
        "\u22121": limits,
        "9" * 40: limits,
        "1e3": words(lang, "why.not_a_number", text="1e3"),
        "   ": missing,
    }.items():
        field.fill(typed)
        with page.expect_response("**/command/select_target") as answer:
            asked.locator("footer .danger").click()
        assert answer.value.status == 422
        expect(hint).to_have_text(said if said == missing else f"{label}: {said}")
        expect(field).to_have_value(typed)
        assert framed(asked) == ["arg_saddle"]
        assert wrong(page) == []
    page.keyboard.press("Escape")


def test_the_field_that_is_wrong_is_framed_of_several(sit: Sit) -> None:
    page = sit(path="/equipment/c1")
    take(page)
    stopped(page)
    manual = page.locator("[data-command$='select_manual']").first
    expect(manual).not_to_have_attribute("aria-disabled", "true", timeout=30_000)
    manual.click()
    expect(manual).to_have_attribute("aria-pressed", "true", timeout=30_000)
    new = page.locator("[data-arguments$='/ask/insert_product']")
    expect(new).not_to_have_attribute("aria-disabled", "true", timeout=30_000)
    new.click()
    asked = page.locator("#overlay [data-ask]")
    for name, value in {"arg_head": "100", "arg_length": "9", "reason": "  "}.items():
        asked.locator(f"[name={name}]").fill(value)
    asked.locator("footer .danger").click()
    expect(asked.locator("[data-hint]")).to_have_text("Required field: Reason")
    assert framed(asked) == ["reason"]
    asked.locator("[name=reason]").fill("a test")
    asked.locator("footer .danger").click()
    expect(asked.locator("[data-hint]")).to_have_text("Length: Permitted: 10 to 150 mm")
    assert framed(asked) == ["arg_length"]
    page.keyboard.press("Escape")
