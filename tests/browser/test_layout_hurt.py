"""States in which a plant seldom is: an axis at its end or led on the spot, something forced, a lesson, a form over the page."""

import re
from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, expect

from tests.browser.looks import CUT, FAULTS, SIZES, open_page
from tests.browser.station import (
    LANGUAGES,
    PASSWORD,
    Sit,
    Stations,
    built,
    fault,
    heard,
    lay_out,
    let_go,
    origin,
    serving,
    speak,
    take,
)
from tests.browser.test_layout import SIDEWAYS, WIDEST_COIL_CAR
from tests.browser.test_layout_alarms import UNTOLD

DESKS = ((1280, 800), (1024, 768), (1366, 768), (1280, 720), (1920, 1080))
LIMITS = (11, 13)
"""Faults of a coil car: it stands at a limit switch of its travel, of its lift."""
LOWER = """() => { const one = document.querySelector('.cc-low > .panel > .panel-b');
  return one.scrollHeight > one.clientHeight ? [`figures end ${one.scrollHeight - one.clientHeight} px below their panel`] : []; }"""
SCREENS = SIZES | {"ten inches": (1024, 768, "desk"), "upright": (768, 1024, "desk"), "low": (1280, 720, "desk")}
ASKED = {"c1": "confirm_positions", "cc1": "select_target"}
"""Machine → a command that asks for something first."""
STOP_BESIDE = """() => { // Stop over a form: where it always stands, and free
  const [stop, over] = [".op > .stop", ".scrim-stop"].map((one) => document.querySelector(one)), found = [];
  const [place, put] = [stop, over].map((one) => one.getBoundingClientRect());
  for (const side of ["left", "right", "bottom"])
    if (Math.abs(place[side] - put[side]) > 1) found.push(`its ${side} is at ${put[side]}, not at ${place[side]}`);
  for (const x of [put.left + 8, put.right - 8]) for (const y of [put.top + 8, put.bottom - 8])
    if (!over.contains(document.elementFromPoint(x, y))) found.push(`covered at ${Math.round(x)}, ${Math.round(y)}`);
  return found;
}"""
OFF_THE_RULER = """() => [...document.querySelectorAll(".c-area")].map((one) => [one.querySelector(".c-ground"), one.nextElementSibling])
  .filter(([ground, name]) => name.getBoundingClientRect().top < ground.getBoundingClientRect().top - 1)
  .map(([, name]) => `${name.textContent.trim()} touches the ruler`)"""
PUSHED_PAGES = """() => [...document.querySelectorAll(".tabs, .tabs-sub")].filter((one) => one.checkVisibility()
  && one.scrollWidth > one.clientWidth + 1).map((one) => `${one.className} is pushed by ${one.scrollWidth - one.clientWidth}`)"""


@pytest.fixture(scope="module")
def plant(stations: Stations, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    """A page of the demo plant as it was built."""
    with serving(tmp_path_factory.mktemp("hurt"), {"ana": ("admin", "engineer", "operator")}) as running:
        seat = Sit(stations, running, {}, "ana", "/alarms")
        yield seat()
        seat.leave()


def wrong_at_each_size(page: Page, *checks: str, but_phone: str = "") -> list[str]:
    """What the `checks` find at each of SCREENS, and the one `but_phone` at each that is none; the page is left at the panel's."""
    found: list[str] = []
    for name, size in SCREENS.items():
        lay_out(page, *size)
        asked = [*checks, but_phone] if but_phone and name != "phone" else checks
        found += [f"{name}: {one}" for check in asked for one in page.evaluate(check)]
    lay_out(page, *SIZES["panel"])
    return found


@pytest.mark.parametrize("lang", LANGUAGES)
def test_figures_of_a_coil_car_at_a_limit_switch_are_whole(plant: Page, lang: str) -> None:
    page, found = plant, []
    for code in LIMITS:
        fault(page, "cc1", code)
        heard(page, "cc1.limit_left")
        speak(page, lang, origin(page))
        open_page(page, f"{origin(page)}/equipment/cc1")
        for widest in ("() => 0", WIDEST_COIL_CAR):
            page.evaluate(widest)
            for width, height in DESKS:
                lay_out(page, width, height, "desk")
                wrong = [*page.evaluate(FAULTS), *page.evaluate(SIDEWAYS), *page.evaluate(LOWER)]
                found += [f"{code} {width}x{height}: {one}" for one in wrong]
    built(page, "cc1")
    assert found == [], "\n".join(["", *found])


@pytest.mark.parametrize("machine", ASKED)
def test_stop_stays_free_where_it_stands_while_something_is_asked(plant: Page, machine: str) -> None:
    page = plant
    speak(page, "de", origin(page))
    lay_out(page, *SIZES["panel"])
    open_page(page, f"{origin(page)}/equipment/{machine}")
    take(page)
    asked = page.locator(f".zone [data-arguments*='/ask/{ASKED[machine]}']")
    expect(asked).not_to_have_attribute("aria-disabled", "true")
    asked.click()
    expect(page.locator("#overlay dialog")).to_be_visible()
    found = wrong_at_each_size(page, STOP_BESIDE, FAULTS)
    let_go(page)
    assert found == [], "\n".join(["", *found])


@pytest.mark.parametrize("lang", LANGUAGES)
def test_an_axis_that_nobody_holds_says_why_it_takes_no_command(plant: Page, lang: str) -> None:
    speak(plant, lang, origin(plant))
    open_page(plant, f"{origin(plant)}/equipment/a1")
    found = wrong_at_each_size(plant, UNTOLD, FAULTS, but_phone=CUT)
    assert found == [], "\n".join(["", *found])


@pytest.mark.parametrize("lang", LANGUAGES)
def test_an_axis_that_is_led_on_the_spot_has_every_command_above_stop(plant: Page, lang: str) -> None:
    """Why it takes no commands is one sentence for all of them."""
    page = plant
    page.goto(f"{origin(page)}/instructor/a1")
    page.select_option("[name=local]", "1")
    page.click("form[action$='/world'] button")
    heard(page, "a1.state")
    speak(page, lang, origin(page))
    open_page(page, f"{origin(page)}/equipment/a1")
    take(page)
    expect(page.locator(".op-others .said")).to_have_count(4)
    found = wrong_at_each_size(page, FAULTS, but_phone=CUT)
    let_go(page)
    built(page, "a1")
    assert found == [], "\n".join(["", *found])


@pytest.mark.parametrize("lang", ["hr", "de"])
def test_what_is_forced_is_whole_everywhere_it_is_told(plant: Page, lang: str) -> None:
    page = plant
    speak(page, lang, origin(page))
    lay_out(page, *SIZES["panel"])
    open_page(page, f"{origin(page)}/equipment/seq1")
    take(page)
    page.click("[data-all='1']")
    page.locator(".q-word li .q-f").first.click()
    page.fill("[name=reason]", "Senzor se mijenja")
    page.fill("[name=password]", PASSWORD)
    page.locator("#overlay dialog .danger").click()
    expect(page.locator(".f-force b")).to_have_text("1", timeout=30_000)
    found: list[str] = []
    for path in ("/equipment/seq1", "/forces", "/"):
        open_page(page, origin(page) + path)
        found += [f"{path} {one}" for one in wrong_at_each_size(page, FAULTS)]
    open_page(page, f"{origin(page)}/equipment/seq1")
    let_go(page)
    built(page, "seq1")
    assert found == [], "\n".join(["", *found])


@pytest.mark.parametrize("lang", ["hr", "de"])
def test_beside_a_lesson_all_values_of_a_motor_are_in_sight(plant: Page, lang: str) -> None:
    page = plant
    page.goto(f"{origin(page)}/lessons/motor")
    if page.locator("#le-m").count():
        page.select_option("#le-m", "m2")
        page.click(".le-side form[action$='/begin'] button")
        expect(page.locator(".le-here")).to_be_visible()
    speak(page, lang, origin(page))
    lay_out(page, *SIZES["panel"])
    open_page(page, f"{origin(page)}/equipment/m2")
    expect(page.locator(".le-strip a")).to_be_visible()
    below = "(one) => one.scrollHeight - one.clientHeight"
    assert page.locator(".m-values .panel-b").evaluate(below) == 0


@pytest.mark.parametrize("lang", LANGUAGES)
def test_pages_of_a_crane_are_all_in_sight_on_a_tablet_and_on_a_small_panel(plant: Page, lang: str) -> None:
    speak(plant, lang, origin(plant))
    open_page(plant, f"{origin(plant)}/equipment/cr1")
    for name in ("upright", "small"):
        lay_out(plant, *SCREENS[name])
        assert plant.evaluate(PUSHED_PAGES) == [], name


def test_names_of_areas_keep_off_the_ruler(plant: Page) -> None:
    speak(plant, "hr", origin(plant))
    open_page(plant, f"{origin(plant)}/equipment/c1")
    for size in SCREENS.values():
        lay_out(plant, *size)
        assert plant.evaluate(OFF_THE_RULER) == [], size


def test_the_beam_of_a_sensor_crosses_no_number_of_a_product(plant: Page) -> None:
    """It is drawn around in the colour of what it stands on."""
    open_page(plant, f"{origin(plant)}/equipment/c1")
    number = plant.locator(".prod .p-id").first  # of another element after each exchange of the line
    expect(number).to_have_css("paint-order", re.compile("^stroke"))
    expect(number).to_have_css("stroke-width", re.compile(r"^([3-9]|\d\d+)(\.\d+)?px$"))


def test_a_cycle_that_is_suspended_cannot_be_suspended_again(plant: Page) -> None:
    """A drive that trips suspends it."""
    page = plant
    lay_out(page, *SIZES["panel"])
    speak(page, "en", origin(page))
    open_page(page, f"{origin(page)}/equipment/cr1")
    take(page)
    suspend = page.locator(".zone [data-command='cr1.suspend']")
    expect(suspend).not_to_have_attribute("aria-disabled", "true", timeout=60_000)
    fault(page, "cr1", 4)
    expect(suspend).to_have_attribute("aria-disabled", "true", timeout=60_000)
    expect(suspend).to_contain_text("The cycle is suspended")
    let_go(page)
    built(page, "cr1")


def test_confirm_all_of_a_conveyor_has_the_marks_of_a_command(plant: Page) -> None:
    open_page(plant, f"{origin(plant)}/equipment/c1")
    expect(plant.locator(".zone [data-command='c1.confirm_positions'] .steps i")).to_have_count(3)
