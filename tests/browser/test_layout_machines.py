"""Nothing is cut, shortened, covered or beyond the edge on any page of any machine, in every language at every size."""

import tomllib

import pytest
from playwright.sync_api import Page

from app import bundled
from tests.browser.looks import looked_at
from tests.browser.station import LANGUAGES, origin, speak

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


@pytest.mark.parametrize("lang", LANGUAGES)
def test_the_button_of_a_parameter_is_in_sight_without_scrolling_sideways(abnormal: Page, lang: str) -> None:
    """Of a drive with several objects, too: its table has one column more."""
    speak(abnormal, lang, origin(abnormal))
    for machine in ("m1", "a1"):
        for width in (1280, 1920):
            abnormal.set_viewport_size({"width": width, "height": 800})
            abnormal.goto(f"{origin(abnormal)}/equipment/{machine}/drive-parameters")
            beyond = abnormal.locator(".dp-scroll").evaluate("(table) => table.scrollWidth - table.clientWidth")
            assert beyond <= 0, (machine, width)
