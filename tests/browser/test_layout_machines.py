"""Nothing is cut, shortened, covered or beyond the edge on any page of any machine, in every language at every size."""

import tomllib

import pytest
from playwright.sync_api import Page

from app import bundled
from tests.browser.looks import looked_at
from tests.browser.station import LANGUAGES, lay_out, origin, speak

DEMO = tomllib.loads((bundled("plants/demo") / "plant.toml").read_text("utf-8"))["equipment"]
MACHINES = tuple(DEMO)
FURTHER = {
    machine: sorted(
        path.stem.removeprefix("page_") for path in (bundled("templates/screens") / item["type"]).glob("page_*.html")
    )
    for machine, item in DEMO.items()
}
"""Machine → its further pages."""
MORE = {
    "m1": ["parameters"],
    "c1": ["parameters", "events"],
    "seq1": ["definition"],
    "cr1": ["parameters", "page/thesis?run=positioner"],
    "a1": ["drive-parameters", "drive-parameters/compare", "encoder", "fault-buffer"],
}
"""Machine → what else it shows, one of each kind."""


def pages(machine: str) -> list[str]:
    """Everything that the demo plant shows of a machine."""
    parts = ["faceplate", *(f"page/{name}" for name in FURTHER[machine]), *MORE.get(machine, ())]
    return [f"/equipment/{machine}", *(f"/equipment/{machine}/{part}" for part in parts)]


@pytest.mark.parametrize("machine", MACHINES)
@pytest.mark.parametrize("lang", LANGUAGES)
def test_nothing_of_a_machine_is_cut_at_any_size(abnormal: Page, lang: str, machine: str) -> None:
    """Nor is a text missing in a language, nor Stop out of sight."""
    speak(abnormal, lang, origin(abnormal))
    found = looked_at(abnormal, origin(abnormal), pages(machine), lang)
    assert found == [], "\n".join(["", *found])


CORNER = """() => { const [zone, stop] = [".f-cmd", ".f-cmd > .stop"].map((one) => document.querySelector(one).getBoundingClientRect());
  return zone.right - stop.right; }"""


@pytest.mark.parametrize("size", [(1280, 800), (800, 480), (390, 844)])
def test_stop_stands_in_the_right_end_of_every_faceplate(abnormal: Page, size: tuple[int, int]) -> None:
    abnormal.set_viewport_size({"width": size[0], "height": size[1]})
    for machine in MACHINES:
        abnormal.goto(f"{origin(abnormal)}/equipment/{machine}/faceplate")
        assert abnormal.evaluate(CORNER) <= 24, machine


SCREENS = ((1024, 768, "desk"), (1280, 800, "desk"), (1920, 1080, "desk"), (800, 480, "panel-9"))
BEYOND = "(one) => one.scrollWidth - one.clientWidth"
BELOW = "(one) => one.scrollHeight - one.clientHeight"
LINES = """(all) => Math.max(0, ...all.filter((one) => one.tagName === "TD" && one.textContent.trim()).map((one) => {
  const range = document.createRange();
  range.selectNodeContents(one);
  return new Set([...range.getClientRects()].map((line) => Math.round(line.top))).size; }))"""
TOUCHING = """() => [...document.querySelectorAll(".k-start")].flatMap((list) => {
  const stages = [...list.children].map((one) => {
    const texts = document.createTreeWalker(one, NodeFilter.SHOW_TEXT), lines = [];
    for (let text; (text = texts.nextNode());) {
      const range = document.createRange();
      range.selectNodeContents(text);
      if (!text.parentElement.closest(".vh, [hidden]")) lines.push(...range.getClientRects());
    }
    return [one.textContent.trim(), lines]; });
  return stages.slice(1).filter(([, lines], i) => stages[i][1].some((before) => lines.some((line) =>
    before.right > line.left - 3 && before.bottom > line.top + 1 && line.bottom > before.top + 1))).map(([text]) => text); })"""
PARTED = """() => { const word = [...document.querySelectorAll(".token .grow")].find((one) => one.getClientRects().length).firstChild;
  const range = document.createRange(), at = word.data.search(/\\S/);
  range.setStart(word, at);
  range.setEnd(word, at + word.data.trim().split(/\\s/)[0].length);
  return range.getClientRects().length; }"""


@pytest.mark.parametrize("lang", LANGUAGES)
def test_the_button_of_a_parameter_is_in_sight_without_scrolling_sideways(abnormal: Page, lang: str) -> None:
    """Of a drive with several objects, too: its table has one column more."""
    speak(abnormal, lang, origin(abnormal))
    for machine in ("m1", "a1"):
        abnormal.goto(f"{origin(abnormal)}/equipment/{machine}/drive-parameters")
        for width, height, profile in SCREENS:
            lay_out(abnormal, width, height, profile)
            beyond = abnormal.locator(".dp-scroll").evaluate(BEYOND)
            assert beyond <= 0, (machine, width)


@pytest.mark.parametrize("lang", LANGUAGES)
def test_the_settings_of_a_machine_are_in_sight_without_scrolling_sideways(abnormal: Page, lang: str) -> None:
    """What is permitted stands in one line."""
    speak(abnormal, lang, origin(abnormal))
    for machine in ("m1", "cr1", "a1"):
        abnormal.goto(f"{origin(abnormal)}/equipment/{machine}/parameters")
        for width, height, profile in SCREENS:
            lay_out(abnormal, width, height, profile)
            assert abnormal.locator(".p-cols .scroll").evaluate(BEYOND) <= 0, (machine, width)
            assert abnormal.locator(".p-range").evaluate_all(LINES) <= 1, (machine, width)


@pytest.mark.parametrize("lang", LANGUAGES)
def test_the_stages_of_a_start_stand_apart(abnormal: Page, lang: str) -> None:
    speak(abnormal, lang, origin(abnormal))
    abnormal.goto(f"{origin(abnormal)}/equipment/cr1/page/drives")
    for width, height, profile in SCREENS:
        lay_out(abnormal, width, height, profile)
        assert abnormal.evaluate(TOUCHING) == [], width
        assert abnormal.locator(".k-drives .panel-b").evaluate_all(f"(all) => Math.max(...all.map({BEYOND}))") <= 0, (
            width
        )
        if profile == "desk":
            assert (
                abnormal.locator(".k-drives .panel-b").evaluate_all(f"(all) => Math.max(...all.map({BELOW}))") <= 0
            ), width


def test_who_holds_a_machine_is_told_in_whole_words(abnormal: Page) -> None:
    speak(abnormal, "de", origin(abnormal))
    abnormal.goto(f"{origin(abnormal)}/equipment/m1")
    for width, height, profile in SCREENS:
        lay_out(abnormal, width, height, profile)
        assert abnormal.evaluate(PARTED) == 1, width


@pytest.mark.parametrize("lang", LANGUAGES)
def test_a_wide_screen_shows_the_coil_car_large_and_all_that_holds_it(abnormal: Page, lang: str) -> None:
    speak(abnormal, lang, origin(abnormal))
    abnormal.goto(f"{origin(abnormal)}/equipment/cc1")
    lay_out(abnormal, 1920, 1080, "desk")
    assert abnormal.locator(".cc-view .cc-mimic").evaluate("(one) => one.getBoundingClientRect().height") > 300
    assert abnormal.locator(".cc-low .permb").evaluate(BELOW) <= 0
