"""Cycles of the ladle crane in a real browser: one with both of its arcs, and one whose trolley trips on the first."""

import re
from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, expect

from tests.browser.station import Sit, built, fault, pace, serving, take
from tests.browser.test_crane import HOME, PLANT, WHO, give, subject
from tests.conftest import PogonServer

__all__ = ["HOME", "WHO"]
NEAR = {
    "stand_1_hoist = 3000": "stand_1_hoist = 2500",
    "stand_2_hoist = 3000": "stand_2_hoist = 2500",
    "stand_3_hoist = 3000": "stand_3_hoist = 2500",
    "stand_4_hoist = 3000": "stand_4_hoist = 2500",
    "stand_2_bridge = 10000": "stand_2_bridge = 8600",
    "safe_height = 4500": "safe_height = 3560",
    "trolley_slow_down_time = 1": "trolley_slow_down_time = 0.9",
    "trolley_speed_up_time = 1": "trolley_speed_up_time = 0.9",
}
STEEP = """hoist_step_1 = 60
hoist_step_2 = 100
hoist_step_3 = 150
hoist_slow_down_time = 1.4
hoist_speed_up_time = 1.4
bridge_slow_down_time = 2
bridge_speed_up_time = 2
"""
"""Stands that are near each other and the safe height, and steep ramps: a cycle takes 78 s of the crane, and not two minutes."""
SOON = 60_000
"""Longest step of a cycle here [ms]."""


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PogonServer]:
    """One Pogon with one crane."""
    folder = tmp_path_factory.mktemp("crane")
    (folder / "plant").mkdir()
    plant = PLANT
    for far, near in NEAR.items():
        assert far in plant, far
        plant = plant.replace(far, near)
    (folder / "plant" / "plant.toml").write_text(plant + STEEP, "utf-8")
    with serving(folder) as running:
        yield running


def begin(page: Page) -> None:
    """A crane as it was built that begins a cycle from stand 1 to stand 2."""
    built(page, "cr1")
    take(page)
    give(page, "start_automatic")
    page.locator("[data-arguments$='/ask/start_cycle']").click()
    expect(page.locator("[name=arg_from]")).to_have_value("1")
    expect(page.locator("[name=arg_to]")).to_have_value("2")
    page.fill("[name=arg_planned]", "210")
    page.locator("#overlay .danger").click()
    expect(page.locator("#message")).to_contain_text("Start cycle (From stand 1, To stand 2, Planned load 210.0 t)")


def reaches(page: Page, step: str | re.Pattern[str]) -> None:
    expect(page.locator(".k-list .a b")).to_have_text(step, timeout=SOON)


def travels_to_the_arc(page: Page) -> None:
    """What leads to the first arc in a fifth of its time, and the arc itself in the time that it takes."""
    pace(page, 5)
    reaches(page, re.compile("S20[12]|S220"))  # the steps before the arc are short: one that is missed is no harm
    pace(page, 1)
    reaches(page, "S220")


def confirm(page: Page) -> None:
    """Confirm the weight as the scale says it."""
    page.locator("[data-arguments$='/ask/confirm_weight']:not([aria-disabled])").click(timeout=SOON)
    shown = page.locator("#overlay dd .val b").first.inner_text()
    assert float(shown) == pytest.approx(210, abs=4)
    page.fill("[name=arg_weight]", shown)
    page.locator("#overlay .danger").click()
    expect(page.locator("#overlay [data-hint]")).to_have_text("Hold the button for one second; only then it counts.")
    page.locator("#overlay .danger").click(delay=1200)
    expect(page.locator("#message")).to_contain_text("Confirm mass")


def test_a_cycle_with_its_arc(sit: Sit) -> None:
    page = sit(path="/equipment/cr1/page/sequence")
    begin(page)
    travels_to_the_arc(page)
    expect(page.locator(".k-path h2")).to_contain_text("Moving", timeout=SOON)
    reaches(page, "S222")
    trace, error = (page.locator(f"[data-arc-{name}]").get_attribute("d") or "" for name in ("path", "error"))
    points = [tuple(map(float, one.split())) for one in re.split("[ML]", trace) if one]
    assert len(points) > 20, trace
    assert all((x - 20) ** 2 + (y - 220) ** 2 == pytest.approx(200**2, rel=0.03) for x, y in points), "on its circle"
    assert points[0][1] > 200 and points[-1][1] < 30, "from the lock to above it"
    assert len(re.findall("[ML]", error)) > 5
    expect(page.locator(".k-list li.d")).to_have_count(9)
    confirm(page)
    reaches(page, "S302")
    pace(page, 5)
    reaches(page, "S420")
    expect(page.locator(".k-list header .cap")).to_contain_text("Done", timeout=2 * SOON)
    facts = page.locator(".k-cycle dl")
    expect(facts).to_contain_text(re.compile("Stand of the ladle\\s*2"))
    expect(facts).to_contain_text(re.compile("1 / 0"))
    page.goto(page.url.removesuffix("/page/sequence"))
    expect(page.locator(".k-above .k-ladle:not([display])")).to_have_count(1)


@pytest.mark.parametrize(("code", "drive", "told"), [(3, "trolley_1", "Tripped")])
def test_a_drive_that_trips_on_the_arc(sit: Sit, code: int, drive: str, told: str) -> None:
    page = sit(path="/equipment/cr1/page/sequence")
    begin(page)
    travels_to_the_arc(page)
    expect(page.locator(".k-path h2")).to_contain_text("Moving", timeout=SOON)
    fault(page, "cr1", code)
    expect(page.locator(".k-list header .cap")).to_contain_text("Suspended (Drive)", timeout=30_000)
    expect(page.locator("#alarms")).to_contain_text("tripped")
    resume = page.locator("[data-command='cr1.resume']")
    expect(resume).to_have_attribute("aria-disabled", "true")
    expect(page.locator(".k-needs .k-no").first).to_be_visible()
    page.goto(page.url.replace("sequence", "drives"))
    page.locator(f"[data-row$='drive={drive}']").click()
    dialog = page.locator("dialog.fp")
    expect(dialog.locator(".k-told li:visible")).to_have_text(told)
    expect(dialog.locator(f"li[data-tag='cr1.{drive}_permit_no_alarm']")).to_have_class(re.compile("k-no"))
    expect(page.locator(".scrim .stop").first).to_be_visible()
    dialog.locator("[data-close]").click()
    fault(page, "cr1", 0)
    subject(page, "cycle")
    give(page, "reset")
    expect(page.locator(".k-told li:visible")).to_have_count(0)
    give(page, "resume")
    page.goto(page.url.replace("drives", "sequence"))
    pace(page, 5)
    reaches(page, "S222")
    pace(page, 1)
    confirm(page)
    reaches(page, "S300")
