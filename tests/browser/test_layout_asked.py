"""Who is asked for the machine that he operates reads it whole; no command moves from under his finger or goes below Stop."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, expect

from tests.browser.looks import CUT, FAULTS, SIZES, open_page
from tests.browser.station import LANGUAGES, Sit, lay_out, serving, speak, take
from tests.conftest import PogonServer

KINDS = ("m2", "c1", "cr1")
"""Machines whose columns of commands differ most."""
WHO, HOME = "ivana", "/equipment/m2"
PEOPLE = {"ivana": ("operator",), "aleksandra": ("operator",)}
PHONES = {"phone": SIZES["phone"], "narrow": (360, 740, "desk")}
SCREENS = {"panel": SIZES["panel"], "small": SIZES["small"], "ten inches": (1024, 768, "desk")} | PHONES
TOKEN = """async (language) => new DOMParser().parseFromString(await (await fetch('/equipment/m2/commands')).text(), 'text/html')
  .querySelector('.token').outerHTML"""
ASKED = f"""(token) => {{ // in one go, before the next answer hides it again
  const places = () => [...document.querySelectorAll('.op-list > :not(.op-above), .op > .stop')].filter((one) => one.checkVisibility())
    .map((one) => [one.className, Math.round(one.getBoundingClientRect().top)]);
  const before = places();
  const own = document.querySelector('.op > .token').outerHTML;
  const put = (one) => {{ document.querySelector('.op > .token').outerHTML = one; }};
  put(token);
  const moved = places().filter(([, top], i) => Math.abs(top - before[i][1]) > 1).map(([name]) => `${{name}} moves`);
  const wrong = [...moved, ...({FAULTS[FAULTS.index("() =>") :].strip().rstrip(";")})(), ...({CUT})()];
  put(own);
  return wrong;
}}"""


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PogonServer]:
    with serving(tmp_path_factory.mktemp("asked"), PEOPLE) as running:
        yield running


def test_a_request_for_a_machine_moves_no_command_and_is_read_whole(server: PogonServer, sit: Sit) -> None:
    """What is said of one machine is put where each says it: who was refused may not ask again for a while."""
    page, other = sit(), sit("aleksandra")
    take(page)
    expect(other.locator(".token")).to_have_attribute("data-holding", "other")
    other.click(".token [data-token]")
    expect(page.locator(".token [data-token=refuse]")).to_be_visible()
    said = {}
    for lang in LANGUAGES:
        speak(page, lang, server.url)
        said[lang] = page.evaluate(TOKEN)
        assert "aleksandra" in said[lang]
    page.click(".token [data-token=refuse]")
    found: list[str] = []
    for machine in KINDS:
        for lang in LANGUAGES:
            lay_out(page, *SIZES["panel"])
            speak(page, lang, server.url)
            open_page(page, f"{server.url}/equipment/{machine}")
            take(page)
            for size, (width, height, profile) in SCREENS.items():
                lay_out(page, width, height, profile)
                found += [f"{machine} {lang} {size}: {one}" for one in put(page, said[lang], size)]
    page.reload()  # what was put there by hand answers to nobody
    assert found == [], "\n".join(["", *found])


def put(page: Page, row: str, size: str) -> list[str]:
    """What is wrong while `row` says who has the machine."""
    wrong = page.evaluate(ASKED, row)
    return [
        one for one in wrong if size not in PHONES or " lies lower " not in one
    ]  # a phone scrolls its commands under Stop
