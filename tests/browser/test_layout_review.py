"""What is reviewed before it is set is whole beside the fields, also when it is refused: long names, long numbers, several at once."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, expect

from app.plant.texts import Texts
from tests.browser.looks import FAULTS, SIZES, open_page
from tests.browser.station import LANGUAGES, Sit, Stations, lay_out, let_go, origin, serving, speak, take
from tests.browser.test_layout import SIDEWAYS

SCREENS = {"panel": SIZES["panel"], "small": SIZES["small"], "phone": SIZES["phone"]} | {
    "ten inches": (1024, 768, "desk"),
    "upright": (768, 1024, "desk"),
}
MACHINES = ("m1", "c1", "cr1", "a1")
"""Machines whose settings differ."""
SEVERAL = 8
"""So many values are typed, every second of which is refused."""


@pytest.fixture(scope="module")
def plant(stations: Stations, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    """A page of the demo plant as it was built."""
    with serving(tmp_path_factory.mktemp("review"), {"ana": ("admin", "engineer", "operator")}) as running:
        seat = Sit(stations, running, {}, "ana", "/alarms")
        yield seat()
        seat.leave()


def wrong(page: Page) -> list[str]:
    """What is wrong at each of SCREENS, or has to be pushed aside where that is no telephone."""
    found: list[str] = []
    for name, size in SCREENS.items():
        lay_out(page, *size)
        checks = (FAULTS,) if name == "phone" else (FAULTS, SIDEWAYS)
        found += [f"{name}: {one}" for check in checks for one in page.evaluate(check)]
    lay_out(page, *SIZES["panel"])
    return found


@pytest.mark.parametrize("lang", LANGUAGES)
def test_several_settings_are_reviewed_whole_whatever_was_typed(plant: Page, lang: str) -> None:
    page, found = plant, []
    speak(page, lang, origin(page))
    for machine in MACHINES:
        lay_out(page, *SIZES["panel"])
        open_page(page, f"{origin(page)}/equipment/{machine}/parameters")
        take(page)
        fields = page.locator("tr[data-key] input[data-new]")
        for number in range(min(SEVERAL, fields.count())):
            fields.nth(number).fill("123456.789" if number % 2 else "1")
        expect(page.locator("[data-changes] .rv-bad")).not_to_have_count(0)
        expect(page.locator("[data-changes] li")).to_have_count(min(SEVERAL, fields.count()))
        found += [f"{machine} {one}" for one in wrong(page)]
        page.click("#p-act [data-discard]")
        expect(page.locator("[data-changes] li")).to_have_count(0)
        open_page(page, f"{origin(page)}/equipment/{machine}")
        let_go(page)
    assert found == [], "\n".join(["", *found])


@pytest.mark.parametrize("lang", LANGUAGES)
def test_why_a_setpoint_is_refused_is_read_whole_at_its_field(plant: Page, lang: str) -> None:
    page, sent = plant, Texts.read().text(lang, "fb.requested")
    found: list[str] = []
    speak(page, lang, origin(page))
    for machine in ("m1", "a1"):
        lay_out(page, *SIZES["panel"])
        open_page(page, f"{origin(page)}/equipment/{machine}")
        take(page)
        fields = page.locator(".sp-field:has([name=argument]:visible)")
        for number in range(fields.count()):
            for typed in ("999999", "12.3456789", "x" * 20):
                field = fields.nth(number)
                field.locator("[name=argument]").fill(typed)
                with page.expect_response(lambda answer: "/command/" in answer.url and answer.status >= 400):
                    field.locator("[name=argument]").press("Enter")
                expect(field.locator("[data-hint]")).not_to_have_text(sent)
                found += [f"{machine} {number} {typed}: {one}" for one in wrong(page)]
            fields.nth(number).locator("[name=argument]").press("Escape")
        let_go(page)
    assert found == [], "\n".join(["", *found])
