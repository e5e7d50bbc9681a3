"""While alarms stand and a drive is tripped, every command of every machine is above Stop, for who holds it and for who does not."""

import tomllib
from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, expect

from app import bundled
from tests.browser.looks import CUT, EACH_WAY, FAULTS, SIZES, open_page
from tests.browser.station import (
    LANGUAGES,
    Sit,
    Stations,
    built,
    fault,
    lay_out,
    let_go,
    origin,
    serving,
    speak,
    stopped,
    take,
)
from tests.browser.test_layout_machines import MACHINES

DESKS = ((1280, 800), (1024, 768), (1366, 768), (1280, 720))
TRIPPED = {"m1": 13, "a1": 7900}
"""Machine → the fault that it has."""
UNTOLD = (
    """(ordinary) => { // refused commands whose reason stands nowhere among them, whichever way of operating is chosen
  const found = new Set(), zone = document.querySelector('.zone:has(.cmd.stop)');
  const seen = (e) => e.checkVisibility({ visibilityProperty: true }) && getComputedStyle(e).clipPath !== 'inset(50%)' && !e.closest('.vh');
  const look = () => {
    const said = [...zone.querySelectorAll('small, .hint')].filter(seen).map((e) => e.textContent).join(' · ');
    for (const one of zone.querySelectorAll('.cmd[aria-disabled=true]')) {
      if (ordinary && one.matches(ordinary)) continue;
      const why = one.querySelector('small').textContent.trim();
      if (one.checkVisibility() && !said.includes(why.replace(/, [^,]*\\d[^,]*$/, ''))) // without how many more there are
        found.add(`"${one.querySelector('.cmd-t').firstChild.data.trim()}" does not say "${why}"`);
    }
  };"""
    + EACH_WAY
)
ORDINARY = (
    "reset",
    "confirm_weight",
    "suspend",
    "resume",
    "abort",
    "reject_task",
    "run_blocks",
    "move_",
    "intermediate_stop",
)
"""Commands that one seldom can give, and need not: a small panel tells why when they are pressed, a tripped axis of Enable only."""
WHOLE = (
    """(longest) => { // what says why, as long as it may become, whichever way of operating is chosen
  const found = new Set(), zone = document.querySelector('.zone:has(.cmd.stop)');
  const look = () => {
    for (const one of zone.querySelectorAll('.op-above')) {
      one.textContent = longest;
      const { right, bottom } = one.getBoundingClientRect(), release = zone.querySelector('.token .btn').getBoundingClientRect();
      if (!one.checkVisibility()) continue;
      if (one.scrollHeight > one.clientHeight + 1 || one.scrollWidth > one.clientWidth + 1) found.add(`cut: ${longest}`);
      if (right > release.left + 1 || bottom > release.bottom + 1) found.add(`beyond its row: ${longest}`);
    }
  };"""
    + EACH_WAY
)
UNREAD = """() => [...document.querySelectorAll('main .sp-field input, .zone .sp-field input')]
  .filter((one) => one.checkVisibility() && one.scrollWidth > one.clientWidth + 1).map((one) => `"${one.value}" of ${one.id} is cut`)"""


@pytest.fixture(scope="module")
def tripped(stations: Stations, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    """A page of the demo plant whose motor and axis have tripped: their commands say at length why they cannot be pressed."""
    with serving(tmp_path_factory.mktemp("tripped"), {"ana": ("admin", "engineer", "operator")}) as running:
        seat = Sit(stations, running, {}, "ana", "/alarms")
        page = seat()
        for machine, code in TRIPPED.items():
            fault(page, machine, code)
            expect(page.locator("#content .alist", has_text=machine).first).to_be_visible()
        yield page
        seat.leave()


@pytest.mark.parametrize("lang", LANGUAGES)
def test_no_command_is_below_stop_while_alarms_stand(tripped: Page, lang: str) -> None:
    page, url = tripped, origin(tripped)
    speak(page, lang, url)
    found: list[str] = []
    for machine in MACHINES:
        lay_out(page, 1280, 800, "desk")
        open_page(page, f"{url}/equipment/{machine}")
        for whose in ("nobody's", "mine"):
            if whose == "mine":
                take(page)
            for width, height in DESKS:
                lay_out(page, width, height, "desk")
                wrong = [*page.evaluate(CUT), *page.evaluate(FAULTS)]
                found += [f"{machine} {whose} {width}x{height}: {one}" for one in wrong]
            lay_out(page, 1280, 800, "desk")
        let_go(page)
    assert found == [], "\n".join(["", *found])


@pytest.mark.parametrize("lang", LANGUAGES)
def test_a_command_that_is_refused_says_why_before_it_is_pressed(tripped: Page, lang: str) -> None:
    """Also a crane that was stopped, of whose cycle almost nothing can be pressed. Why an axis does not move is said once, below."""
    page, url = tripped, origin(tripped)
    speak(page, lang, url)
    found: list[str] = []
    for machine, standing in (*((one, "at work") for one in MACHINES if one != "a1"), ("cr1", "stopped")):
        lay_out(page, 1280, 800, "desk")
        open_page(page, f"{url}/equipment/{machine}")
        take(page)
        if standing == "stopped":
            stopped(page)
        for width, height in DESKS:
            lay_out(page, width, height, "desk")
            wrong = [*page.evaluate(UNTOLD), *page.evaluate(CUT), *page.evaluate(UNREAD)]
            found += [f"{machine} {standing} {width}x{height}: {one}" for one in wrong]
        lay_out(page, 1280, 800, "desk")
        let_go(page)
    built(page, "cr1")
    assert found == [], "\n".join(["", *found])


@pytest.mark.parametrize("lang", LANGUAGES)
def test_a_small_panel_says_why_what_is_chosen_cannot_be_pressed(tripped: Page, lang: str) -> None:
    """Buttons have no line for it there; it is said once, also as long as it may become, and hides no command."""
    page, url = tripped, origin(tripped)
    speak(page, lang, url)
    found: list[str] = []
    for machine, kind in (("cc1", "coil_car"), ("cr1", "crane"), ("a1", "epos")):
        lay_out(page, 1280, 800, "desk")
        open_page(page, f"{url}/equipment/{machine}")
        take(page)
        if machine != "a1":
            stopped(page)
        lay_out(page, *SIZES["small"])
        ordinary = ", ".join(f"[data-part^='{machine}.{key}']" for key in ORDINARY)
        wrong = [*page.evaluate(UNTOLD, ordinary), *page.evaluate(CUT), *page.evaluate(WHOLE, _longest(kind, lang))]
        found += [f"{lang} {machine}: {one}" for one in wrong]
        lay_out(page, 1280, 800, "desk")
        let_go(page)
    built(page, "cr1")
    assert found == [], "\n".join(["", *found])


def _longest(kind: str, lang: str) -> str:
    """The longest of what a machine of this type may lack."""
    texts = tomllib.loads((bundled("app/equipment") / kind / f"texts.{lang}.toml").read_text("utf-8"))
    return max((text for group in texts["missing"].values() for text in group.values()), key=len)


@pytest.mark.parametrize("lang", LANGUAGES)
def test_what_an_axis_is_set_to_is_read_whole(tripped: Page, lang: str) -> None:
    page, url = tripped, origin(tripped)
    speak(page, lang, url)
    open_page(page, f"{url}/equipment/a1")
    found: list[str] = []
    for width, height in DESKS:
        lay_out(page, width, height, "desk")
        found += [f"{width}x{height}: {one}" for one in page.evaluate(UNREAD)]
    assert found == [], "\n".join(["", *found])


@pytest.mark.parametrize("size", DESKS)
def test_why_an_axis_that_tripped_does_not_move_is_said_once_beside_its_commands(
    tripped: Page, size: tuple[int, int]
) -> None:
    page, url = tripped, origin(tripped)
    speak(page, "en", url)
    lay_out(page, *size, "desk")
    open_page(page, f"{url}/equipment/a1")
    take(page)
    said = page.locator(".zone :is(.op-why, small)", has_text="remove its cause, then fault reset").filter(visible=True)
    expect(said).to_have_count(1)
    let_go(page)
