"""What engineers and administrators do at sequences in a real browser: forces on several, times while one runs, how it runs."""

import re
from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, expect

from tests import coil_plant
from tests.browser.station import PASSWORD, SIZES, Sit, built, heard, serving, take
from tests.conftest import PogonServer

WHO, HOME = "ana", "/equipment/seq2"
MACHINES = ("cc1", "seq1", "seq2")
WHY = "The sensor shows nothing since the morning shift, a new one is ordered; checked by hand at the gauge. " * 3


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PogonServer]:
    """One Pogon with two sequences; an administrator who is an engineer, and an engineer who is no administrator."""
    folder = tmp_path_factory.mktemp("engineering")
    coil_plant.write(folder / "plant")
    drill = folder / "plant" / "sequences" / "drill.toml"
    drill.write_text(drill.read_text("utf-8").replace("longest_force = 6", "longest_force = 600"), "utf-8")
    people = {"ana": ("admin", "engineer", "operator"), "ivana": ("engineer", "operator")}
    with serving(folder, people) as running:
        yield running


def begin(page: Page) -> None:
    """The sequences and the coil car as when they were built, whatever went on before; nothing is forced there, none runs."""
    for machine in MACHINES:
        built(page, machine)
    for machine in MACHINES:
        heard(page, f"{machine}.state")
    page.reload()
    expect(page.locator("body")).to_have_attribute("data-live", "live")


def force(page: Page, step: int, name: str, why: str) -> None:
    """Force a permissive of a step on the page of its sequence."""
    take(page)
    page.click(f"[data-row-step='{step}'] .q-perm")
    page.click("[data-all='1']")
    button = page.locator(".q-word li").filter(has_text=name).locator(".q-f")
    expect(button).not_to_have_attribute("aria-disabled", "true", timeout=30_000)  # the list knows who holds the token
    button.click()
    page.fill("#overlay [name=reason]", why)
    page.fill("#overlay [name=password]", PASSWORD)
    page.click("#overlay .danger")
    expect(page.locator("#overlay dialog")).to_have_count(0, timeout=30_000)
    expect(page.locator(f"[data-row-step='{step}'] .tickbox.f")).to_have_count(1, timeout=30_000)


def let_go(page: Page) -> None:
    page.locator(".token [data-token=release]").first.click()
    expect(page.locator("[data-token=take]").first).to_be_visible()


def test_forces_of_two_sequences_are_counted_listed_and_taken_back(sit: Sit) -> None:
    watched = sit("ivana", path="/forces")
    begin(watched)
    expect(watched.locator(".fc")).to_contain_text("Nothing is forced")
    page = sit(path="/equipment/seq1")
    force(page, 3, "Pressure is there", WHY[:300])
    let_go(page)
    root = page.url.split("/equipment")[0]
    page.goto(root + "/equipment/seq2")
    for step in (3, 5):
        force(page, step, f"Tank {step} is ready", "Tank is being cleaned")
    let_go(page)
    expect(watched.locator(".f-force b")).to_have_text("3", timeout=30_000)
    expect(watched.locator(".fc-group")).to_have_count(2)
    expect(watched.locator(".fc-t tbody tr")).to_have_count(3)
    expect(watched.locator(".fc-group").first).to_contain_text(WHY[:300])
    for width, height in SIZES.values():
        watched.set_viewport_size({"width": width, "height": height})
        assert watched.evaluate("document.documentElement.scrollWidth") <= width
        cut = watched.evaluate(
            """() => [...document.querySelectorAll('.fc-t :is(td, th), .fc-t button')].filter((cell) => {
                 const box = cell.getBoundingClientRect();
                 return box.width && (box.right > innerWidth + 1 || cell.scrollWidth > cell.clientWidth + 1);
               }).map((cell) => cell.className)"""
        )
        assert not cut, (width, cut)
        for part in (".fc-who", ".fc-why", ".fc-left"):
            expect(watched.locator(f".fc-t {part}").first).to_be_visible()
    watched.set_viewport_size({"width": 1280, "height": 800})
    take(watched)
    release = watched.locator(".fc-group").first.locator("tbody .btn")
    expect(release).not_to_have_attribute("aria-disabled", "true")
    release.focus()
    watched.keyboard.press("Enter")
    expect(watched.locator("#overlay dialog")).to_contain_text("Pressure is there")
    expect(watched.locator("#overlay [data-cancel]")).to_be_focused()
    watched.keyboard.press("Tab")
    watched.keyboard.press("Enter")
    expect(watched.locator(".fc-group")).to_have_count(1, timeout=30_000)
    expect(watched.locator(".f-force b")).to_have_text("2", timeout=30_000)
    take(watched)
    watched.locator("[data-command='seq2.release_all']").click()
    asked = watched.locator("#overlay .danger")
    expect(asked.or_(watched.locator(".fc", has_text="Nothing is forced"))).not_to_have_count(0)
    if asked.count():
        asked.click()
    expect(watched.locator(".fc")).to_contain_text("Nothing is forced", timeout=30_000)
    expect(page.locator(".f-force b")).to_have_text("0", timeout=30_000)
    held = watched.locator(".fc-held")
    expect(held).to_have_count(2, timeout=30_000)
    for machine in ("seq1", "seq2"):
        held.filter(has_text=machine).locator("[data-token=release]").click()
        expect(held.filter(has_text=machine)).to_have_count(0, timeout=30_000)
        page.goto(f"{root}/equipment/{machine}")
        expect(page.locator("[data-token=take]").first).to_be_visible()
    expect(watched.locator(".fc")).to_contain_text("Nothing is forced")


def test_an_administrator_changes_times_while_it_runs_and_says_why(sit: Sit) -> None:
    page = sit()
    begin(page)
    take(page)
    page.click("[data-command='seq2.start']")
    page.locator("#overlay .danger").click()
    expect(page.locator("[data-row-step='2'][aria-selected=true]")).to_have_count(1, timeout=30_000)
    page.click("#q-tab-times")
    row = page.locator("#q-times tbody tr").nth(3)
    row.locator("[data-arguments]").click()
    dialog = page.locator("#overlay dialog")
    expect(dialog).to_contain_text("Exercise 4")
    expect(dialog).not_to_contain_text("This step is active")
    page.fill("[name=arg_maximum]", "77.5")
    dialog.locator(".danger").click()
    expect(dialog).to_be_visible()  # a reason is required
    page.fill("[name=reason]", "the valve is slow today")
    dialog.locator(".danger").click()
    expect(dialog).to_have_count(0, timeout=30_000)
    expect(row.locator("td").nth(2)).to_have_text("77.5 s", timeout=30_000)
    expect(page.locator("#message")).to_contain_text(re.compile("Accepted .* Done"))
    page.locator("#q-times tbody tr").nth(1).locator("[data-arguments]").click()
    expect(dialog).to_contain_text("This step is active")
    page.keyboard.press("Escape")
    expect(dialog).to_have_count(0)
    let_go(page)
    other = sit("ivana")
    take(other)
    other.click("#q-tab-times")
    locked = other.locator("#q-times tbody tr").nth(3).locator("[data-arguments]")
    expect(locked).to_have_attribute("aria-disabled", "true")
    locked.click(force=True)
    expect(other.locator("#overlay dialog")).to_have_count(0)
    other.click(".zone .stop")
    expect(other.locator(".q-top")).to_contain_text("Suspended", timeout=30_000)
    other.click("[data-command='seq2.abort']")
    other.locator("#overlay .danger").click()
    expect(other.locator(".q-top")).to_contain_text("Aborted", timeout=30_000)


def test_a_switch_shows_what_it_is_set_to_and_is_switched_back(sit: Sit) -> None:
    page = sit()
    begin(page)
    take(page)
    single = page.locator(".q-switch button").nth(1)
    expect(single).to_have_attribute("aria-pressed", "false")
    single.click()
    expect(single).to_have_attribute("aria-pressed", "true", timeout=30_000)
    expect(page.locator("[data-command='seq2.advance']")).to_be_visible()
    page.wait_for_timeout(2500)
    single.focus()
    page.keyboard.press("Enter")
    expect(single).to_have_attribute("aria-pressed", "false", timeout=30_000)
    expect(page.locator("[data-command='seq2.advance']")).to_be_hidden()
    page.goto(page.url.split("/equipment")[0] + "/equipment/cc1")
    take(page)
    manual = page.locator(".cc-mode button").nth(1)
    expect(manual).to_have_attribute("aria-pressed", "false")
    manual.click()
    page.locator("#overlay .danger").click()
    expect(manual).to_have_attribute("aria-pressed", "true", timeout=30_000)
    expect(page.locator("[data-hold='cc1.jog_forward']")).not_to_have_attribute("aria-disabled", "true", timeout=30_000)


def test_a_step_says_that_its_greatest_time_is_near_before_it_is_over(sit: Sit) -> None:
    page = sit()
    begin(page)
    take(page)
    page.click("#q-tab-times")
    page.locator("#q-times tbody tr").first.locator("[data-arguments]").click()
    page.fill("[name=arg_maximum]", "8")
    if page.locator("#overlay [name=reason]").count():
        page.fill("#overlay [name=reason]", "shorter")
    page.locator("#overlay .danger").click()
    expect(page.locator("#q-times tbody tr").first.locator("td").nth(2)).to_have_text("8.0 s", timeout=30_000)
    page.click("#q-tab-steps")
    page.locator(".q-switch button").nth(1).click()
    expect(page.locator(".q-switch button").nth(1)).to_have_attribute("aria-pressed", "true", timeout=30_000)
    page.click("[data-command='seq2.start']")
    page.locator("#overlay .danger").click()
    row = page.locator("[data-row-step='1']")
    expect(row).to_have_attribute("aria-selected", "true", timeout=30_000)
    expect(row.locator("small.q-soon")).to_be_hidden()
    expect(row.locator("small.q-soon")).to_be_visible(timeout=30_000)
    expect(page.locator(".q-top .q-soon")).to_have_text(re.compile("Near the maximum time"))
    expect(row.locator(".time-done")).to_have_class(re.compile(r"\bsoon\b"))
    assert not page.locator(".banner .alm").count() or "Maximum" not in page.inner_text(".banner"), "no alarm yet"
    expect(page.locator(".q-top")).to_contain_text("allowed 8.0", timeout=30_000)
    expect(page.locator(".q-top .q-soon")).to_have_count(0, timeout=30_000)
    expect(row.locator("small.q-soon")).to_be_hidden()
