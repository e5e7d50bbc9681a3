"""A sequence says on every screen and in every language what holds it, or ended it: nothing of that is cut, broken or covered."""

import shutil
from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, expect

from app import bundled
from tests.browser.looks import FAULTS, SIZES
from tests.browser.station import (
    LANGUAGES,
    Sit,
    Stations,
    fault,
    lay_out,
    let_go,
    origin,
    serving,
    small,
    speak,
    stopped,
    take,
)
from tests.browser.test_sequence import head

SCREENS = (*SIZES.values(), (1024, 768, "desk"), (768, 1024, "desk"), (360, 740, "desk"))


@pytest.fixture
def page(stations: Stations, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    """A page of the transport of the demo plant, which has begun."""
    folder = small(tmp_path_factory.mktemp("coils"), "cc1", "seq1")
    shutil.copytree(bundled("plants/demo") / "sequences", folder / "plant" / "sequences")
    plant = folder / "plant" / "plant.toml"
    plant.write_text(plant.read_text("utf-8").replace("crane = 150", "crane = 150, coil = 1, growth = 400"), "utf-8")
    with serving(folder) as running:
        seat = Sit(stations, running, {}, "ivana", "/equipment/seq1")
        page = seat()
        expect(page.locator("[data-row-step='2'][aria-selected=true]")).to_have_count(1, timeout=120_000)
        yield page
        seat.leave()


def cut(page: Page) -> list[str]:
    """What is wrong with the page of the sequence as it stands."""
    found: list[str] = []
    for lang in LANGUAGES:
        speak(page, lang, origin(page))
        page.goto(f"{origin(page)}/equipment/seq1", wait_until="load")
        expect(page.locator("body")).to_have_attribute("data-live", "live")
        for width, height, profile in SCREENS:
            lay_out(page, width, height, profile)
            found += [f"{lang} {width}x{height}: {one}" for one in page.evaluate(FAULTS)]
        lay_out(page, 1280, 800, "desk")
    speak(page, "en", origin(page))
    return found


def test_what_a_step_waits_for_is_read_whole(page: Page) -> None:
    """The hydraulics fail: permissives fall, one after the other."""
    fault(page, "cc1", 31)
    expect(head(page)).to_contain_text("Stalled", timeout=30_000)
    found = cut(page)
    assert found == [], "\n".join(["", *found])


def test_what_ended_a_run_is_read_whole(page: Page) -> None:
    """Somebody stops the machine under the run."""
    page.goto(f"{origin(page)}/equipment/cc1")
    take(page)
    stopped(page)
    let_go(page)
    page.goto(f"{origin(page)}/equipment/seq1")
    expect(head(page)).to_contain_text("Aborted in step", timeout=30_000)
    found = cut(page)
    assert found == [], "\n".join(["", *found])
