"""Who waits for a machine is read whole where it is said who has it; no command moves when somebody comes into the line or leaves it."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, expect

from tests.browser.looks import SIZES, open_page
from tests.browser.station import LANGUAGES, Sit, lay_out, serving, speak, take
from tests.browser.test_layout_asked import KINDS, SCREENS, TOKEN, put
from tests.conftest import PogonServer

WHO, HOME = "ivana", "/equipment/m2"
PEOPLE = {name: ("operator",) for name in ("ivana", "aleksandra", "maximiliana", "katarina", "tomislav")}


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PogonServer]:
    with serving(tmp_path_factory.mktemp("line"), PEOPLE) as running:
        yield running


def test_a_line_moves_no_command_and_is_read_whole(server: PogonServer, sit: Sit) -> None:
    """What is said of one machine is put where each says it."""
    pages = {name: sit(name) for name in PEOPLE}
    page = pages["ivana"]
    take(page)
    for name in ("maximiliana", "aleksandra", "katarina"):
        ask(pages[name])
    said = {"asked": told(page, server), "put": told(pages["maximiliana"], server)}
    refuse(page, pages["maximiliana"])
    mine = {"holds": told(page, server)}
    others = {"first": told(pages["aleksandra"], server), "second": told(pages["katarina"], server)}
    others |= {"looks": told(pages["tomislav"], server), "put": said.pop("put")}
    for lang in LANGUAGES:
        assert "aleksandra +1" in mine["holds"][lang]
        assert "maximiliana (+2)" in said["asked"][lang]
    found: list[str] = []
    for machine in KINDS:
        open_page(page, f"{server.url}/equipment/{machine}")
        take(page)
    for who, rows in ((page, mine | said), (pages["tomislav"], others)):
        for machine in KINDS:
            for lang in LANGUAGES:
                lay_out(who, *SIZES["panel"])
                speak(who, lang, server.url)
                open_page(who, f"{server.url}/equipment/{machine}")
                for size, (width, height, profile) in SCREENS.items():
                    lay_out(who, width, height, profile)
                    for row, by in rows.items():
                        found += [f"{row} {machine} {lang} {size}: {one}" for one in put(who, by[lang], size)]
    for who in (page, pages["tomislav"]):
        who.reload()  # what was put there by hand answers to nobody
    assert found == [], "\n".join(["", *found])


def ask(page: Page) -> None:
    """Stand in line."""
    expect(page.locator(".token")).to_have_attribute("data-holding", "other")
    page.click(".token [data-token=request]")
    expect(page.locator(".token [data-token=withdraw]")).to_be_visible()


def refuse(holder: Page, first: Page) -> None:
    """The first in line is refused: the next one is not put to the holder yet."""
    holder.click(".token [data-token=refuse]")
    expect(holder.locator(".token [data-token=release]")).to_be_visible()
    expect(first.locator(".token [data-token=request]")).to_be_visible()


def told(page: Page, server: PogonServer) -> dict[str, str]:
    """The row of who has the machine, as this person reads it in each language."""
    rows = {}
    for lang in LANGUAGES:
        speak(page, lang, server.url)
        rows[lang] = page.evaluate(TOKEN)
    return rows
