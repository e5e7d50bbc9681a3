"""While alarms are shelved or out of service, each with a long reason, who hid it and when is read whole and can be undone in sight."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, expect

from tests.browser.looks import AXE_RUN, FAULTS, LOOKED_AT, SIZES, open_page
from tests.browser.station import AXE, LANGUAGES, Sit, Stations, fault, lay_out, origin, serving, speak
from tests.browser.test_layout import SIDEWAYS
from tests.browser.test_layout_silent import TRIPPED

SCREENS = SIZES | {"ten inches": (1024, 768, "desk"), "upright": (768, 1024, "desk"), "low": (1280, 720, "desk")}
PATHS = ("/", "/alarms", "/alarms?tab=hidden", "/equipment/m1", "/equipment/c1", "/equipment/cr1")
WHY = {"reason": "Senzor se mijenja", "more": "čeka se rezervni dio iz skladišta u Zagrebu, narudžba 4711-2026"}
HOW = (
    ("shelve", {"minutes": "60"}),
    ("take-out", {"permit": "RN-2026-114471/B"}),
    ("shelve", {"minutes": "480", "once": "1"}),
)
"""Ways to hide an alarm, and what each is told besides why."""
OUT_OF_SIGHT = """() => [...document.querySelectorAll('[data-put]')].filter((one) => {
  const { right } = one.getBoundingClientRect();
  return one.checkVisibility() && right > one.closest('.scroll').getBoundingClientRect().right;
}).map((one) => `${one.textContent.trim()} is beside the list`)"""


@pytest.fixture(scope="module")
def hidden(stations: Stations, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    """A page of the demo plant whose machines have tripped, and whose alarms are all hidden in one way or another."""
    with serving(tmp_path_factory.mktemp("hidden"), {"ana": ("admin", "engineer", "operator")}) as running:
        seat = Sit(stations, running, {}, "ana", "/alarms")
        page = seat()
        for machine, code in TRIPPED.items():
            fault(page, machine, code)
            expect(page.locator("#content .alist", has_text=machine).first).to_be_visible()
        form = {"csrf": page.locator("[name=csrf]").first.get_attribute("value") or ""} | WHY
        alarms = page.locator("#content tr[data-alarm]").evaluate_all("all => all.map((one) => one.dataset.alarm)")
        for number, alarm in enumerate(alarms):
            way, more = HOW[number % len(HOW)]
            url = f"{running.url}/alarms/{way}"
            answer = page.request.post(url, form={"alarm": alarm} | form | more, headers={"Origin": running.url})
            assert answer.ok, answer.text()
        yield page
        seat.leave()


@pytest.mark.parametrize("lang", LANGUAGES)
def test_a_hidden_alarm_is_whole_wherever_it_is_told(hidden: Page, lang: str) -> None:
    page, found = hidden, []
    speak(page, lang, origin(page))
    theme = LOOKED_AT.get(lang, "auto")
    page.context.add_cookies([{"name": "pogon_theme", "value": theme, "url": origin(page)}])
    for path in PATHS:
        open_page(page, origin(page) + path)
        if lang in LOOKED_AT:
            page.evaluate(AXE.read_text("utf-8"))
            found += [f"{path} {theme}: {one}" for one in page.evaluate(AXE_RUN)]
        found += [f"{path} {one}" for one in wrong(page)]
    assert found == [], "\n".join(["", *found])


@pytest.mark.parametrize("lang", LANGUAGES)
def test_why_an_alarm_is_hidden_is_read_whole_beside_the_list(hidden: Page, lang: str) -> None:
    page, found = hidden, []
    speak(page, lang, origin(page))
    for number in range(len(HOW)):
        lay_out(page, *SIZES["panel"])
        open_page(page, f"{origin(page)}/alarms?tab=hidden")
        page.locator("#content tr[data-row] .a-open").nth(number).click()
        expect(page.locator("#alarm-detail .a-why")).to_contain_text("4711-2026")
        found += [f"{number} {one}" for one in wrong(page)]
    assert found == [], "\n".join(["", *found])


def wrong(page: Page) -> list[str]:
    """What is wrong at each of SCREENS, or has to be pushed aside where that is no telephone."""
    found: list[str] = []
    for name, size in SCREENS.items():
        lay_out(page, *size)
        checks = (FAULTS, OUT_OF_SIGHT) if name == "phone" else (FAULTS, OUT_OF_SIGHT, SIDEWAYS)
        found += [f"{name}: {one}" for check in checks for one in page.evaluate(check)]
    return found
