"""The ladle crane in a real browser: by hand to its limit and back, a set that fails."""

import re
from collections.abc import Iterator
from contextlib import suppress

import pytest
from playwright.sync_api import Locator, Page, expect

from tests.browser.station import Sit, built, fault, serving, take
from tests.conftest import PogonServer

WHO, HOME = "ivana", "/equipment/cr1"
PLANT = """
[plant]
name = { hr = "Kran", en = "Crane", de = "Kran", cs = "Jeřáb" }
timezone = "Europe/Zagreb"
languages = ["hr", "en", "de", "cs"]

[areas.cranes]
label = { hr = "Kranovi", en = "Cranes", de = "Krane", cs = "Jeřáby" }

[links.crane]
transport = "memory"
writes = true

[equipment.cr1]
type = "crane"
link = "crane"
unit = 1
label = { hr = "Kran za lonce 1", en = "Ladle crane 1", de = "Gießkran 1", cs = "Licí jeřáb 1" }
trolley_lower_slow_at = 600
trolley_lower_stop_at = 300
stand_1_trolley = 1700
stand_2_trolley = 1700
stand_1_bridge = 8000
stand_2_bridge = 10000
stand_1_hoist = 3000
stand_2_hoist = 3000
stand_3_hoist = 3000
stand_4_hoist = 3000

[equipment.cr1.simulation]
ladle = 210
stand = 1
safe_height = 4500
arc_radius = 1000
arc_speed = 200
hoist_max_speed = 200
hoist_step_4 = 200
trolley_max_speed = 300
trolley_step_1 = 150
trolley_step_2 = 200
trolley_step_3 = 250
trolley_step_4 = 300
trolley_slow_down_time = 1
trolley_speed_up_time = 1
"""
"""Low stands and a small circle."""


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PogonServer]:
    """One Pogon with one crane."""
    folder = tmp_path_factory.mktemp("crane")
    (folder / "plant").mkdir()
    (folder / "plant" / "plant.toml").write_text(PLANT, "utf-8")
    with serving(folder) as running:
        yield running


def give(page: Page, command: str) -> None:
    """Give a command of the column, and answer what it asks."""
    button = page.locator(f".k-op [data-command='cr1.{command}']").first
    expect(button).not_to_have_attribute("aria-disabled", "true")
    button.click()
    if command in ("select_manual", "start_automatic", "resume", "abort"):
        page.locator("#overlay .danger").click()
    if command == "select_manual":
        expect(page.locator(".k-mode [data-command='cr1.select_manual']")).to_have_attribute("aria-pressed", "true")
    else:
        label = button.locator(".cmd-t").evaluate("text => text.firstChild.textContent")
        expect(page.locator("#message")).to_contain_text(re.compile(f"{label}: Accepted .*Done", re.IGNORECASE))


def subject(page: Page, name: str) -> None:
    page.locator(f".k-subject label:has([value={name}])").click()


def manual(page: Page, axis: str, step: int) -> None:
    """A crane as it was built, in manual, one axis chosen at a speed step."""
    built(page, "cr1")
    take(page)
    give(page, "select_manual")
    subject(page, axis)
    chosen = page.locator(f"[data-subject={axis}] .k-speed [value='{step}']")
    chosen.click()
    expect(chosen).to_have_attribute("aria-pressed", "true")


def press(page: Page, command: str) -> None:
    """Hold a button until the crane moves; who is too busy to keep it alive lets go, as it must, and presses anew."""
    button = page.locator(f"[data-hold='cr1.{command}']")
    expect(button).not_to_have_attribute("aria-disabled", "true", timeout=30_000)
    box = button.bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 40, box["y"] + 30)
    page.mouse.down()


def hold_until(page: Page, command: str, seen: Locator) -> None:
    """Hold a button until `seen` is there. A station too busy to keep the motion alive lets go, as it must; then it is pressed anew."""
    for _ in range(12):
        press(page, command)
        with suppress(AssertionError):
            expect(seen).to_be_visible(timeout=9_000)
            return
        page.mouse.up()
    expect(seen).to_be_visible()


def position(page: Page, axis: str) -> float:
    text = page.locator(f".k-axes .val[data-tag='cr1.{axis}_position'] b").inner_text()
    return float(re.sub(r"[^\d.]", "", text) or 0)


def drawn(page: Page, axis: str) -> float:
    """Where the picture from above has an axis [mm]."""
    found: float = page.evaluate(
        """(axis) => {
          const group = document.querySelector(`.k-above [data-tag="cr1.${axis}_position"][data-move]`);
          const [[a, x], [b, y]] = group.dataset.map.split(' ').map((knot) => knot.split(':').map(Number));
          const { e, f } = new DOMMatrix(getComputedStyle(group).transform);
          return a + ((group.dataset.move === 'x' ? e : f) - x) * (b - a) / (y - x);
        }""",
        axis,
    )
    return found


def test_by_hand_to_the_limit_and_back(sit: Sit) -> None:
    page = sit()
    manual(page, "trolley", 4)
    left, right = (page.locator(f"[data-hold='cr1.jog_trolley_{way}']") for way in ("down", "up"))
    stop = page.locator(".k-axes [data-tag='cr1.trolley_lower_stop'][data-show='1']")
    expect(page.locator("[data-subject=trolley] .k-why")).to_have_text("Both directions permitted", use_inner_text=True)
    expect(page.locator("[data-subject=trolley] .field .num")).to_contain_text("300.00 mm/s · 100.0 %")
    hold_until(page, "jog_trolley_down", stop)
    page.mouse.up()
    expect(left).to_have_attribute("aria-disabled", "true")
    expect(page.locator("[data-subject=trolley] .k-why")).to_have_text(
        "Only to the right permitted", use_inner_text=True
    )
    expect(page.locator(".k-axes tr", has_text="Trolley").locator("small")).to_contain_text(
        "Only to the right permitted", use_inner_text=True
    )
    assert position(page, "trolley") <= 300
    expect(page.locator(".k-above path[data-tag='cr1.trolley_lower_stop']")).to_have_count(0)
    expect(page.locator(".k-beside path[data-tag='cr1.trolley_lower_stop']")).to_have_class(re.compile(r"\bhit\b"))
    expect(page.locator("#alarms")).to_contain_text("stop switch")
    expect(page.locator("[data-mark-part='cr1.trolley'] svg")).to_have_count(1)
    expect(page.locator("[data-mark-part='cr1.hoist'] svg")).to_have_count(0)
    page.goto(page.url + "/page/trolley")
    expect(page.locator(".k-told li:visible")).to_contain_text("move away first")
    subject(page, "trolley")
    expect(right).not_to_have_attribute("aria-disabled", "true", timeout=30_000)
    hold_until(
        page, "jog_trolley_up", page.locator(".k-told li:visible", has_text="may be reset").get_by_text("may be reset")
    )
    page.mouse.up()
    expect(page.locator("#message")).to_contain_text(re.compile("right .hold.: .*Done"), timeout=30_000)
    give(page, "reset")
    expect(page.locator(".k-told li:visible")).to_have_count(0)
    expect(page.locator(".k-sentence")).to_have_text("Both directions permitted", use_inner_text=True)
    page.goto(page.url.removesuffix("/page/trolley"))
    expect(page.locator(".k-above h2")).to_have_text("Manual")
    page.wait_for_timeout(500)
    assert drawn(page, "trolley") == pytest.approx(position(page, "trolley"), abs=25)


def test_a_set_that_fails_leaves_what_was(sit: Sit) -> None:
    page = sit()
    manual(page, "hoist", 2)
    page.goto(page.url + "/parameters")

    def wanted(**values: str) -> None:
        for key, text in values.items():
            page.fill(f"tr[data-key={key}] [data-new]", text)
        page.click("[data-submit]")

    def stands(key: str, text: str) -> None:
        expect(page.locator(f"tr[data-key={key}] .val b")).to_have_text(text)

    wanted(hoist_step_1="60", hoist_fan_run_on="50")  # above step 2
    expect(page.locator("#message")).to_contain_text("speed steps rise")
    stands("hoist_step_1", "20.32")
    stands("hoist_fan_run_on", "60")
    other = sit("ivana")
    subject(other, "hoist")
    speed = other.locator(".k-axes .val[data-tag='cr1.hoist_speed'] b")
    moving, refused = speed.get_by_text(re.compile(r"^[1-9]")), re.compile("An axis moves|Hold-to-move active")
    for _ in range(6):  # a station too busy to keep the motion alive lets go, as it must; then it is pressed anew
        hold_until(other, "jog_hoist_up", moving)  # let go before, it is not confirmed
        wanted(hoist_step_1="30", hoist_fan_run_on="50")
        expect(page.locator("body")).to_contain_text(re.compile(f"{refused.pattern}|still ending"), use_inner_text=True)
        if refused.search(page.inner_text("body")):
            break
        other.mouse.up()
        expect(moving).to_have_count(0)
    expect(page.locator("body")).to_contain_text(refused, use_inner_text=True)
    stands("hoist_step_1", "20.32")
    stands("hoist_fan_run_on", "60")
    other.mouse.up()
    expect(other.locator(".k-above h2")).to_have_text("Manual", timeout=30_000)
    expect(other.locator("#message")).to_contain_text("Done", timeout=30_000)
    fault(other, "cr1", 93)  # the whole set arrives, and the PLC cannot keep it
    wanted(hoist_step_1="30", hoist_fan_run_on="50")
    expect(page.locator("body")).to_contain_text("The memory of the PLC takes no settings", use_inner_text=True)
    stands("hoist_step_1", "20.32")
    stands("hoist_fan_run_on", "60")
    fault(other, "cr1", 0)
    wanted(hoist_step_1="30", hoist_fan_run_on="50")
    stands("hoist_step_1", "30.00")
    stands("hoist_fan_run_on", "50")
    other.reload()
    expect(other.locator("[data-subject=hoist] .k-speed")).to_be_visible()
    other.locator("[data-subject=hoist] .k-speed [value='1']").click()
    expect(other.locator("[data-subject=hoist] .field .num")).to_contain_text("30.00 mm/s · 15.0 %")
