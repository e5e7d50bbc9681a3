"""A plant of four machines has an overview of four narrow tiles that show all they can: nothing in them is cut or alone in a line."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Page

from app import bundled
from tests.browser.looks import FAULTS, SIZES, open_page
from tests.browser.station import LANGUAGES, Sit, Stations, lay_out, origin, serving, speak
from tests.browser.test_layout import BETWEEN, SIDEWAYS

EVERY = {name: size for name, size in SIZES.items()} | {name: (*size, "desk") for name, size in BETWEEN.items()}
ROWS = """() => [...document.querySelectorAll('.ov-r')].filter((row) => row.checkVisibility()).flatMap((row) => {
  const parts = [...row.children].map((one) => one.getBoundingClientRect()).filter((one) => one.height);
  return parts.some((one) => one.top >= parts[0].bottom) ? [row.textContent.trim() + ' stands in two lines'] : [];
})"""


@pytest.fixture(scope="module")
def hall(stations: Stations, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    people = {"ana": ("engineer", "operator")}
    with serving(tmp_path_factory.mktemp("hall"), people, plant=bundled("plants/hall")) as running:
        seat = Sit(stations, running, {}, "ana", "/")
        yield seat()
        seat.leave()


@pytest.mark.parametrize("lang", LANGUAGES)
def test_nothing_of_four_tiles_is_cut_at_any_size(hall: Page, lang: str) -> None:
    speak(hall, lang, origin(hall))
    open_page(hall, origin(hall) + "/")
    found: list[str] = []
    for name, (width, height, profile) in EVERY.items():
        lay_out(hall, width, height, profile)
        found += [f"{name}: {one}" for one in [*hall.evaluate(FAULTS), *hall.evaluate(SIDEWAYS), *hall.evaluate(ROWS)]]
    assert found == [], "\n".join(["", *found])
