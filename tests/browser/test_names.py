"""A plant with names as on a works order, areas that are wider than a screen together: nothing that counts is pushed out of sight."""

import re
import shutil
from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, StorageState

from app import bundled
from tests.browser.looks import FAULTS, open_page
from tests.browser.station import LANGUAGES, Sit, Stations, lay_out, serving, some_of_the_demo
from tests.browser.test_layout import SIDEWAYS
from tests.conftest import PogonServer

WHO, HOME = "ana", "/"
NAME = "Abluftventilator Glühofen Nummer {n}, Osthalle Warmwalzwerk"


def label(text: str) -> str:
    """The same in every language, as TOML."""
    return "{ " + ", ".join(f'{lang} = "{text}"' for lang in LANGUAGES) + " }"


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PogonServer]:
    folder = tmp_path_factory.mktemp("names")
    shutil.copytree(bundled("plants/demo"), folder / "plant")
    numbers = iter(range(1, 100))
    plant = re.sub(
        r"(\[(?:equipment|areas)\.\w+\]\n(?:.+\n)*?)label = \{[^}]*\}",
        lambda found: f"{found[1]}label = {label(NAME.format(n=next(numbers)))}",
        some_of_the_demo("m1", "c1", "cc1", "seq1"),
    )
    (folder / "plant" / "plant.toml").write_text(plant, "utf-8")
    with serving(folder, {"ana": ("admin", "engineer", "operator")}) as running:
        yield running


@pytest.fixture
def page(stations: Stations, server: PogonServer, sessions: dict[str, StorageState]) -> Iterator[Page]:
    seat = Sit(stations, server, sessions, WHO, HOME)
    yield seat()
    seat.leave()


@pytest.mark.parametrize("size", [(1280, 800), (1024, 768), (390, 844)])
def test_every_area_and_what_stands_behind_them_is_reached_by_hand(page: Page, size: tuple[int, int]) -> None:
    lay_out(page, *size)
    row = page.locator(".tabs")
    assert row.evaluate("(row) => row.scrollWidth > row.clientWidth && getComputedStyle(row).overflowX") == "auto"


def test_the_counts_of_alarms_stand_in_their_panel_beside_a_long_name(page: Page) -> None:
    out = """() => { const end = document.querySelector(".amx").closest(".panel").getBoundingClientRect().right;
        return [...document.querySelectorAll(".amx td")].filter((one) => one.getBoundingClientRect().right > end).length; }"""
    for size in ((1280, 800), (1024, 768), (1920, 1080)):
        lay_out(page, *size)
        assert page.locator(".amx td").count() > 8
        assert page.evaluate(out) == 0, size


NUMBER = """() => { // how far below the end of the head the number of the machine's name lies
  const head = document.querySelector(".crumbs h1"), range = document.createRange(), at = head.firstChild.data.search(/Nummer \\d/);
  range.setStart(head.firstChild, at);
  range.setEnd(head.firstChild, at + 8);
  const { right, bottom } = range.getBoundingClientRect(), box = head.getBoundingClientRect();
  return Math.max(right - box.right, bottom - box.bottom); }"""


@pytest.mark.parametrize("size", [(1280, 800), (1024, 768)])
def test_the_head_says_which_of_the_machines_it_is(page: Page, server: PogonServer, size: tuple[int, int]) -> None:
    lay_out(page, *size)
    open_page(page, f"{server.url}/equipment/m1")
    assert page.evaluate(NUMBER) <= 2


@pytest.mark.parametrize("path", ["/events", "/plant", "/communication"])
@pytest.mark.parametrize("size", [(1280, 800), (1024, 768)])
def test_no_name_pushes_its_neighbours_aside(page: Page, server: PogonServer, path: str, size: tuple[int, int]) -> None:
    lay_out(page, *size)
    open_page(page, server.url + path)
    found = [*page.evaluate(FAULTS), *page.evaluate(SIDEWAYS)]
    assert [one for one in found if "shortened" not in one and not one.startswith("seg.a-seg")] == []


@pytest.mark.parametrize("path", ["/", "/equipment/cc1", "/equipment/m1", "/forces"])
def test_no_name_makes_a_page_on_a_phone_wider(page: Page, server: PogonServer, path: str) -> None:
    lay_out(page, 390, 844)
    open_page(page, server.url + path)
    assert page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth") <= 0
