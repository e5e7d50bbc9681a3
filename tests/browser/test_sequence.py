"""Sequences in a real browser: a run, a stall with its first-out, suspend and resume, abort and reset, a force and its end by itself."""

import re
from collections.abc import Iterator
from typing import Any

import pytest
from playwright.sync_api import Page, Route, expect

from tests import coil_plant
from tests.browser.station import (
    AXE,
    LANGUAGES,
    PASSWORD,
    SIZES,
    Sit,
    acknowledge,
    built,
    fault,
    heard,
    lay_out,
    serving,
    take,
)
from tests.conftest import PogonServer

WHO, HOME = "ivana", "/equipment/seq1"


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PogonServer]:
    """One Pogon with a coil car, its transport and a drill; an engineer and an operator."""
    folder = tmp_path_factory.mktemp("coils")
    coil_plant.write(folder / "plant", ways=True)
    with serving(folder) as running:
        yield running


def press(page: Page, command: str) -> None:
    """Press a command, and say yes when it asks."""
    button = page.locator(f".op [data-command='{command}']:visible")
    expect(button).not_to_have_attribute("aria-disabled", "true", timeout=30_000)
    with page.expect_response(lambda answer: answer.url.endswith("/command/" + command.partition(".")[2])) as answer:
        button.click()
    if "<dialog" in answer.value.text():
        page.locator("#overlay .danger").click()
        expect(page.locator("#overlay dialog")).to_have_count(0)


def head(page: Page) -> Any:
    return page.locator(".q-top .q-t")


def begin(page: Page) -> None:
    """A run that has just begun on a line as it was built, with no alarm, whatever went on before."""
    heard(page, "seq1.state")  # or there may be no link yet that takes this
    for machine in ("cc1", "seq1"):
        built(page, machine)
    heard(page, "seq1.state")
    home = page.url
    acknowledge(page)
    page.goto(home)  # or "Ready to start" may still be that of the machine before
    expect(page.locator("body")).to_have_attribute("data-live", "live")
    expect(head(page)).to_contain_text("Ready to start", timeout=30_000)
    take(page)
    press(page, "seq1.start")
    expect(page.locator(".seqt [aria-selected=true]")).to_have_count(1, timeout=30_000)


@pytest.mark.timeout(300)  # a minute on an idle machine
def test_a_coil_is_carried_from_the_mandrel_to_a_saddle(sit: Sit) -> None:
    page = sit(reduced_motion="no-preference")
    begin(page)
    car = page.locator(".cc-car")
    place = "element => new DOMMatrix(getComputedStyle(element).transform).m41"
    before = car.evaluate(place)
    expect(page.locator("[data-row-step='5'][aria-selected=true]")).to_have_count(1, timeout=60_000)
    under = car.evaluate(place)
    assert under < before - 20, "the car went under the mandrel"
    expect(head(page)).to_contain_text(
        re.compile(r"[Ss]tep 7 .*[\d.]+\ss, allowed 60.0\ss\s*Step 8 waits: missing: Car is at its saddle"),
        timeout=60_000,
    )
    expect(head(page)).to_contain_text(re.compile(r"Done in \d"), timeout=90_000)
    assert car.evaluate(place) > under + 200, "and then to the saddle"
    page.click("#q-tab-times")
    expect(page.locator("#q-times tbody tr").first.locator("td").nth(3)).not_to_have_text("0")
    expect(page.locator("#q-steps")).to_be_hidden()


def test_a_stall_says_what_is_missing_and_what_fell_first(sit: Sit) -> None:
    page = sit()
    begin(page)
    expect(page.locator("[data-row-step='2'][aria-selected=true]")).to_have_count(1, timeout=30_000)
    try:
        fault(page, "cc1", 31)
        expect(head(page)).to_contain_text(
            re.compile(r"Stalled: step \d waits [\d.]+\ss, allowed 60.0\ss"), timeout=30_000
        )
        expect(head(page)).to_contain_text(re.compile(r"Step \d waits: .*missing: Pressure is there"))
        expect(page.locator(".q-word .miss").filter(has_text="Pressure is there")).to_have_count(1)
        first = page.locator(".q-first li").filter(has_text="Pressure is there").first
        expect(first).to_contain_text(re.compile(r"\d\d:\d\d:\d\d\.\d{3}"))
        expect(first).to_contain_text("required: ")
        expect(page.locator(".q-first .first")).to_have_count(1)
        expect(page.locator(".banner")).to_contain_text("permissive missing")
        waited = page.locator(".q-t b [data-as=duration]")
        seconds = waited.inner_text()
        expect(waited).not_to_have_text(seconds)  # the seconds run
    finally:
        fault(page, "cc1", 0)
    expect(page.locator("[data-row-step='4'][aria-selected=true]")).to_have_count(1, timeout=60_000)


@pytest.mark.always
def test_suspend_stops_the_time_and_resume_goes_on(sit: Sit) -> None:
    page = sit()
    begin(page)
    page.click(".zone .stop")
    expect(head(page)).to_contain_text("Suspended in step", timeout=30_000)
    page.wait_for_timeout(1200)
    stands = page.locator(".seqt [aria-selected=true] .q-act").inner_text()
    page.wait_for_timeout(1500)
    assert page.locator(".seqt [aria-selected=true] .q-act").inner_text() == stands
    expect(page.locator("[data-command='seq1.start']")).to_be_hidden()
    press(page, "seq1.resume")
    expect(head(page)).to_contain_text("of 8", timeout=30_000)
    expect(page.locator("[data-command='seq1.resume']")).to_be_hidden()


def test_an_abort_is_told_with_its_cause_and_has_to_be_reset(sit: Sit) -> None:
    page = sit()
    begin(page)
    press(page, "seq1.abort")
    expect(head(page)).to_contain_text(re.compile(r"Aborted in step \d: by an operator"), timeout=30_000)
    expect(head(page)).to_contain_text("Reset the first-out")
    expect(page.locator(".op [data-command='seq1.start']")).to_have_attribute("aria-disabled", "true")
    press(page, "seq1.acknowledge")
    expect(head(page)).not_to_contain_text("Aborted", timeout=30_000)
    expect(page.locator(".q-first")).to_contain_text("Nothing has stopped the sequence")


def test_a_force_names_its_permissive_asks_for_the_password_and_ends_by_itself(sit: Sit) -> None:
    page = sit(path="/equipment/seq2")
    take(page)
    page.click("[data-row-step='3'] .q-perm")
    expect(page.locator(".q-word h2")).to_contain_text("Permissives of step 3")
    page.click("[data-all='1']")
    guard = page.locator(".q-word li").filter(has_text="Guard is closed")
    expect(guard.locator(".q-no")).to_have_attribute("title", re.compile("may not be forced"))
    expect(guard.locator(".q-f")).to_have_count(0)
    page.locator(".q-word li").filter(has_text="Tank 3 is ready").locator(".q-f").click()
    dialog = page.locator("#overlay dialog")
    expect(dialog).to_contain_text("Tank 3 is ready")
    page.fill("[name=reason]", "Sensor is being replaced")
    page.fill("[name=password]", "not this one at all")
    dialog.locator(".danger").click()
    expect(dialog.locator("[data-hint]")).not_to_be_empty(timeout=30_000)
    expect(page.locator(".f-force b")).to_have_text("0")
    page.wait_for_timeout(1200)
    page.fill("[name=password]", PASSWORD)
    dialog.locator(".danger").click()
    expect(dialog).to_have_count(0, timeout=30_000)
    expect(page.locator(".f-force b")).to_have_text("1", timeout=30_000)
    expect(page.locator("[data-row-step='3'] .tickbox.f")).to_have_count(1)
    expect(page.locator(".q-word li").filter(has_text="Tank 3 is ready")).to_contain_text("forced, left")
    other = page.context.new_page()
    other.goto(page.url.split("/equipment")[0] + "/forces")
    row = other.locator(".fc-t tbody tr")
    expect(row).to_contain_text("Tank 3 is ready")
    expect(row).to_contain_text("Sensor is being replaced")
    expect(row).to_contain_text("ivana")
    expect(other.locator(".fc")).to_contain_text("Nothing is forced", timeout=30_000)
    expect(page.locator(".f-force b")).to_have_text("0", timeout=30_000)
    expect(page.locator("[data-row-step='3'] .tickbox.f")).to_have_count(0)


def test_a_list_that_is_drawn_anew_under_the_finger_loses_no_click(sit: Sit) -> None:
    page = sit("ivo", path="/equipment/seq2")
    held: list[Route] = []
    page.route("**word?*step=3*", lambda route: held.append(route))
    with page.expect_request("**word?*step=3*"):
        page.click("[data-row-step='3'] .q-perm")
    page.locator("[data-all='1']").hover()
    for _ in range(100):
        if held:
            break
        page.wait_for_timeout(50)
    answer = held[0].fetch()  # before the press, which is one for a second only, however busy the server is
    page.mouse.down()
    with page.expect_response("**step=3*"):
        held[0].fulfill(response=answer)
    page.unroute_all()
    expect(page.locator(".q-word h2")).not_to_contain_text("Permissives of step 3")  # not while the finger is there
    page.mouse.up()
    expect(page.locator("[data-all='1']")).to_have_attribute("aria-pressed", "true")
    expect(page.locator(".q-word h2")).to_contain_text("Permissives of step 3")


def test_what_one_asks_for_outlives_the_answer_to_what_was_asked_before(sit: Sit) -> None:
    page = sit("ivo", path="/equipment/seq2")
    held: list[Route] = []
    page.route(re.compile(r"/part/word\?step=[23]"), lambda route: held.append(route))
    with page.expect_request("**word?step=2*"):
        page.click("[data-row-step='2'] .q-perm")
    page.click("[data-row-step='3'] .q-perm")
    with page.expect_request("**word?step=3*"):
        held.pop(0).continue_()
    expect(page.locator(".q-word h2")).to_contain_text("Permissives of step 2")
    page.locator("[data-all='1']").hover()
    page.mouse.down()
    with page.expect_response("**word?step=3*"):
        held.pop(0).continue_()
    page.unroute_all()
    page.mouse.up()
    expect(page.locator(".q-word h2")).to_contain_text("Permissives of step 3")
    expect(page.locator("[data-all='1']")).to_have_attribute("aria-pressed", "true")


def test_operators_cannot_force(sit: Sit) -> None:
    page = sit("ivo", path="/equipment/seq2?step=3")
    page.click("[data-all='1']")
    expect(page.locator(".q-word li")).to_have_count(16)
    expect(page.locator(".q-f")).to_have_count(0)


def test_a_step_without_maximum_says_that_it_stays_and_times_are_changed(sit: Sit) -> None:
    page = sit(path="/equipment/seq2")
    expect(page.locator("[data-row-step='2']")).to_contain_text("∞ waiting")
    take(page)
    page.click("#q-tab-times")
    page.click("#q-times tbody tr:nth-child(4) [data-arguments]")
    dialog = page.locator("#overlay dialog")
    expect(dialog).to_contain_text("Exercise 4")
    page.fill("[name=arg_minimum]", "3.5")
    if page.locator("[name=reason]").count():
        page.fill("[name=reason]", "slower valve")
    dialog.locator(".danger").click()
    expect(dialog).to_have_count(0, timeout=30_000)
    expect(page.locator("#q-times tbody tr:nth-child(4) td").nth(1)).to_have_text("3.5 s", timeout=30_000)


def test_the_list_of_twelve_steps_follows_the_active_one(sit: Sit) -> None:
    page = sit(path="/equipment/seq2")
    assert page.locator("#q-steps").evaluate("list => list.scrollTop") == 0

    def answer(route: Route) -> None:
        told = route.fetch()
        route.fulfill(response=told, body=told.text().replace('data-row-step="12"', 'data-row-step="12" data-active'))

    page.route("**/part/steps", answer)
    page.evaluate("htmx.trigger('#q-steps', 'again')")
    expect(page.locator("[data-row-step='12']")).to_have_attribute("aria-selected", "true")
    shown = page.evaluate(
        """() => {
          const list = document.getElementById('q-steps').getBoundingClientRect();
          const box = document.querySelector('[data-row-step="12"]').getBoundingClientRect();
          return [box.top >= list.top, box.bottom <= list.bottom];
        }"""
    )
    assert shown == [True, True]
    expect(page.locator(".q-abort")).to_be_in_viewport()


def test_the_tabs_obey_the_keyboard(sit: Sit) -> None:
    page = sit(path="/equipment/seq2")
    page.focus("#q-tab-steps")
    page.keyboard.press("ArrowRight")
    expect(page.locator("#q-times")).to_be_visible()
    expect(page.locator("#q-tab-times")).to_be_focused()


COVERED = """() => { const box = (e) => e.getBoundingClientRect(), tabs = box(document.querySelector(".q-tabs")), out = [];
  for (const head of document.querySelectorAll("#q-steps thead th:not(:has(.vh))")) {
    const words = document.createRange();
    words.selectNodeContents(head);
    const { left, right, width } = words.getBoundingClientRect();
    if (width > 2 && left < tabs.right && right > tabs.left) out.push(head.textContent.trim());
  }
  const row = box(document.querySelector("#q-steps thead"));
  return [out, tabs.top >= row.top - 1 && tabs.bottom <= row.bottom + 1]; }"""


@pytest.mark.parametrize("lang", LANGUAGES)
def test_the_switch_in_the_head_of_the_steps_covers_no_word_of_it(sit: Sit, lang: str) -> None:
    page = sit(WHO, HOME, lang=lang)
    for width, height in ((1280, 800), (1920, 1080)):
        page.set_viewport_size({"width": width, "height": height})
        covered, within = page.evaluate(COVERED)
        assert covered == [] and within, (width, covered, within)


LONG_RUN = """() => {
  for (const one of document.querySelectorAll(".q-n .val b, .q-last > .num:not(.q-ends)")) one.textContent = "59 min 59 s";
}"""
LINES = """() => { // where the labels of the head end, and the lines that its figures are written on [px]
  const shown = [...document.querySelectorAll(".q-n")].filter((one) => one.checkVisibility());
  const end = (one) => {
    const words = document.createRange();
    words.selectNodeContents(one.firstChild);
    return words.getBoundingClientRect().bottom;
  };
  const line = (one) => {
    const probe = document.createElement("span");
    probe.style.cssText = "display: inline-block; width: 1px; height: 1px; align-self: baseline";
    one.append(probe);
    const { bottom } = probe.getBoundingClientRect();
    probe.remove();
    return bottom;
  };
  const each = (find, chosen) => shown.map((one) => find(one.querySelector(chosen)));
  return [each(end, ".lab"), each(line, ".val b, .q-ends > span, b:not(.q-ends, .val b)")];
}"""


@pytest.mark.parametrize("lang", LANGUAGES)
def test_the_figures_of_the_head_stand_on_one_line_and_so_do_their_labels(sit: Sit, lang: str) -> None:
    page = sit(WHO, HOME, lang=lang)
    for width, height in (*SIZES.values(), (1024, 768), (1920, 1080)):
        lay_out(page, width, height)
        page.evaluate(LONG_RUN)
        labels, figures = page.evaluate(LINES)
        beside = 2 if width == 390 else 3  # on a phone two stand beside each other, the third below
        for stand in (labels[:beside], figures[:beside]):
            assert stand and max(stand) - min(stand) < 1, (width, height, labels, figures)
        beyond = page.locator(".q-head").evaluate("(head) => head.scrollWidth - head.clientWidth")
        assert beyond <= 0, (width, height)


@pytest.mark.parametrize("path", ["/equipment/seq1", "/equipment/seq2", "/equipment/cc1", "/forces"])
def test_nobody_is_left_out(sit: Sit, path: str) -> None:
    page = sit(path=path)
    page.evaluate(AXE.read_text("utf-8"))
    found = page.evaluate("axe.run(document, { runOnly: ['wcag2a', 'wcag2aa', 'wcag21aa'] })")
    assert not [f"{one['id']}: {[node['html'] for node in one['nodes']]}" for one in found["violations"]]


@pytest.mark.parametrize("lang", LANGUAGES)
def test_nothing_of_a_long_sequence_is_cut_off_in_any_language_and_size(sit: Sit, lang: str) -> None:
    """Twelve steps that nothing moves; the pages of a machine and its sequence are among those of test_layout_machines."""
    from tools.pictures import LOOK, MARKS

    page = sit(lang=lang, path="/equipment/seq2")
    faults = MARKS.findall(page.inner_text("body"))
    for width, height in SIZES.values():
        lay_out(page, width, height)
        found = page.evaluate(LOOK)
        faults += [f"{width}: {one}" for one in found if "div#message" not in one and "SEQ2" not in one]
    assert not faults
