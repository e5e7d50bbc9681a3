"""The positioning page of an axis in a real browser: moves, override, stop and resume, jog and its speeds, limits, a fault."""

import re
import shutil
import time
from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, expect

from app import bundled
from tests.browser.station import PASSWORD, Sit, built, fault, review, serving, take
from tests.conftest import PogonServer

WHO, HOME = "ivana", "/equipment/a1"


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PogonServer]:
    """One Pogon with an axis that stands in the middle of its travel, its parameters behind a PLC; and an engineer."""
    folder = tmp_path_factory.mktemp("axis")
    shutil.copytree(bundled("plants/epos"), folder / "plant")
    file = folder / "plant" / "plant.toml"
    text = file.read_text("utf-8")
    assert 'start = "blocks"' in text
    file.write_text(text.replace('start = "blocks"', 'start = "stopped"'), "utf-8")
    with serving(folder, {"ivana": ("engineer", "operator")}) as running:
        yield running


def at_the_axis(sit: Sit) -> Page:
    page = sit()
    built(page, "a1")
    page.reload()
    take(page)
    return page


def press(page: Page, command: str) -> None:
    button = page.locator(f".op [data-command='a1.{command}']")
    label = button.locator(".cmd-t").evaluate("text => text.firstChild.textContent")
    asks = "danger" in (button.get_attribute("class") or "")
    button.click()
    if asks:
        page.locator("#overlay .danger").click()
    expect(page.locator("#message")).to_contain_text(re.compile(f"{re.escape(label)}: .*Done"), timeout=20_000)


def put(page: Page, setpoint: str, value: str) -> None:
    """Set one of the values of a move; a large step is reviewed first."""
    field = page.locator(f"[data-setpoint='a1.{setpoint}']")
    told = page.locator("#message")
    said = told.inner_text()
    field.locator("input[name=argument]").fill(value)
    field.locator("[data-set]").click()
    card = page.locator(".review-form")
    done = told.filter(has_text=re.compile("Done")).filter(has_not_text=said.strip() or "nothing was said")
    expect(card.or_(done).first).to_be_visible(timeout=20_000)
    if card.count():
        card.get_by_role("button", name="Set").click()
        expect(card).to_have_count(0)
        expect(done).to_be_visible(timeout=20_000)


def stands_at(page: Page, millimetres: str) -> None:
    expect(page.locator(".ax-now [data-tag='a1.position']")).to_contain_text(millimetres, timeout=30_000)


@pytest.mark.always
def test_an_axis_is_moved_to_a_target_and_by_a_distance_slowed_stopped_and_resumed(sit: Sit) -> None:
    page = at_the_axis(sit)
    stands_at(page, "400.000")
    press(page, "enable")
    put(page, "set_velocity", "20000")
    put(page, "set_target", "450")
    press(page, "move_absolute")
    stands_at(page, "450.000")
    put(page, "set_target", "-30")
    press(page, "move_relative")
    stands_at(page, "420.000")
    put(page, "set_override", "10")
    put(page, "set_target", "600")
    press(page, "move_absolute")
    press(page, "intermediate_stop")
    expect(page.locator(".ax-now [data-tag='a1.position']")).not_to_contain_text("600.000")
    press(page, "resume")
    put(page, "set_override", "100")
    stands_at(page, "600.000")
    put(page, "set_target", "300")  # would be beyond the travel as a distance
    expect(page.locator(".op [data-command='a1.move_relative']")).to_have_attribute("aria-disabled", "true")
    press(page, "stop")


def test_a_target_beyond_the_travel_is_refused_with_the_travel(sit: Sit) -> None:
    page = at_the_axis(sit)
    form = page.locator("[data-setpoint='a1.set_target']")
    form.locator("input[name=argument]").fill("801")
    form.locator("[data-set]").click()
    expect(page.locator("#message")).to_contain_text(re.compile("Permitted: .800 to 800.mm"))
    stands_at(page, "400.000")


def held_until_it_moves(page: Page) -> None:
    """A station that is too busy to keep the motion alive lets go, as it must; then it is pressed anew."""
    plus = page.locator("[data-hold='a1.jog_plus']")
    for _ in range(4):
        expect(plus).not_to_have_attribute("aria-disabled", "true", timeout=30_000)
        plus.hover()
        page.mouse.down()
        end = time.monotonic() + 20
        while time.monotonic() < end:
            if "400.000" not in page.inner_text(".ax-now [data-tag='a1.position']"):
                return
            if plus.get_attribute("data-state") == "idle":
                break
            page.wait_for_timeout(50)
        page.mouse.up()
    raise AssertionError(f"the axis does not move: {page.inner_text('#message')}")


def test_it_jogs_while_held_with_the_speed_that_the_engineer_has_set(sit: Sit) -> None:
    page = at_the_axis(sit)
    press(page, "enable")
    page.locator(".op-mode [value=hold]").check(force=True)
    speeds = page.locator("#jog-speeds")
    expect(speeds).to_contain_text("300", timeout=20_000)
    speeds.locator("[name=p2586]").fill("1200")
    speeds.locator("button").click()
    page.locator(".dw [name=value]").wait_for()
    expect(page.locator(".dw [name=value]")).to_have_value("1200")
    review(page)
    form = page.locator("#dw form[action$='/write']")
    form.locator("[name=reason]").fill("faster")
    form.locator("[name=password]").fill(PASSWORD)
    form.locator("button").last.click()
    expect(page.locator(".dw [data-result='2:p2586']")).to_have_attribute("data-done", "yes", timeout=20_000)
    page.goto(page.url.partition("/drive-parameters")[0])
    page.locator(".op-mode [value=hold]").check(force=True)
    expect(page.locator("#jog-speeds label", has_text="p2586").locator("b")).to_contain_text("1 200", timeout=20_000)
    held_until_it_moves(page)
    page.mouse.up()
    expect(page.locator("#message")).to_contain_text(re.compile(r"Jog \+: .*Done"), timeout=20_000)


def test_a_fault_is_named_read_from_the_buffer_and_acknowledged(sit: Sit) -> None:
    page = at_the_axis(sit)
    press(page, "enable")
    fault(page, "a1", 7452)
    expect(page.locator(".si-fault")).to_contain_text("F07452")
    page.goto(page.url + "/fault-buffer")
    page.locator("#fb button").click()
    expect(page.locator("#fb [data-situation=s0] [data-code]")).to_contain_text("F07452", timeout=20_000)
    page.locator("#fb nav a", has_text="Control Unit").click()
    page.locator("#fb button").click()
    expect(page.locator("#fb [role=status]")).to_contain_text("Read at", timeout=20_000)
    expect(page.locator("#fb [data-situation=s0]")).not_to_contain_text("F07452")
    page.goto(page.url.partition("/fault-buffer")[0])
    fault(page, "a1", 0)
    press(page, "reset")
    expect(page.locator(".si-fault")).not_to_contain_text("F0")
