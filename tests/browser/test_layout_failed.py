"""A machine that a fault holds, or whose command failed, has every command above Stop, each with why it cannot be pressed."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, expect

from app.plant.texts import Texts
from tests.browser.looks import CUT, FAULTS, SIZES, open_page
from tests.browser.station import (
    LANGUAGES,
    Sit,
    Stations,
    built,
    fault,
    heard,
    lay_out,
    let_go,
    origin,
    serving,
    speak,
    take,
)
from tests.browser.test_layout_alarms import ORDINARY, UNTOLD
from tests.browser.test_layout_machines import MACHINES

SCREENS = {
    "panel": SIZES["panel"],
    "ten inches": (1024, 768, "desk"),
    "small": SIZES["small"],
    "upright": (768, 1024, "desk"),
    "narrow phone": (360, 740, "desk"),
    "wide": SIZES["wide"],
}
FAULTY = {"c1": (50,), "cc1": (41, 50), "cr1": (71, 90)}
"""Machine → faults that hold it: emergency stop, an open guard, ropes that overlap."""
FAILED = f"""([why, asks, end, stop, within, all]) => {{ // each command in turn as one that failed, before the next answer draws it anew
  const found = new Set();
  for (const one of document.querySelectorAll('.zone .op .cmd:not([hidden])')) {{
    const [before, state, disabled] = [one.innerHTML, one.dataset.state, one.ariaDisabled];
    [one.dataset.state, one.ariaDisabled] = ['failed', null];
    const small = one.querySelector('small');
    small.textContent = one.matches('.stop') ? stop : one.matches('.danger') ? `${{why}} · ${{asks}}` : why;
    if (!one.querySelector('.cmd-end')) small.insertAdjacentHTML('afterend', `<small class="cmd-end" aria-hidden="true">${{end}}</small>`);
    for (const wrong of [...(all ? ({FAULTS[FAULTS.index("() =>") :].strip().rstrip(";")})() : []), ...(within ? ({CUT})() : [])])
      found.add(`${{one.dataset.part}}: ${{wrong}}`);
    [one.innerHTML, one.dataset.state, one.ariaDisabled] = [before, state, disabled];
  }}
  return [...found];
}}"""
SILENT = """() => { // ways and lists of what can be changed that cannot be pressed, whose reason stands nowhere among the commands
  const seen = (e) => e.checkVisibility({ visibilityProperty: true }) && getComputedStyle(e).clipPath !== 'inset(50%)' && !e.closest('.vh');
  const zone = document.querySelector('.zone:has(.cmd.stop)'), bare = (text) => text.replace(/, [^,]*\\d[^,]*$/, '');
  const said = [...zone.querySelectorAll('small, .hint')].filter(seen).map((e) => e.textContent).join(' · ');
  return [...zone.querySelectorAll('.seg > button[aria-disabled=true], .c-edit > [aria-disabled=true]')]
    .filter((one) => one.checkVisibility() && one.title && !said.includes(bare(one.title)))
    .map((one) => `"${one.textContent.trim().slice(0, 20)}" does not say "${one.title}"`);
}"""


@pytest.fixture(scope="module")
def plant(stations: Stations, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    """A page of the demo plant as it was built."""
    with serving(tmp_path_factory.mktemp("failed"), {"ana": ("admin", "engineer", "operator")}) as running:
        seat = Sit(stations, running, {}, "ana", "/alarms")
        yield seat()
        seat.leave()


@pytest.mark.parametrize("lang", ["hr", "de"])
def test_a_command_that_failed_moves_no_other_below_stop(plant: Page, lang: str) -> None:
    """Whichever it is, and for the longest of what is said then."""
    page, text = plant, Texts.read().text
    speak(page, lang, origin(page))
    end = max((text(lang, f"fb.{one}") for one in ("failed", "unconfirmed", "refused", "unknown")), key=len)
    why, asks = text(lang, "why.unknown"), text(lang, "operate.asks_first")
    stop = text(lang, "why.stop_not_confirmed").replace("{seconds}", "10")
    found: list[str] = []
    for machine in MACHINES:
        lay_out(page, *SIZES["panel"])
        open_page(page, f"{origin(page)}/equipment/{machine}")
        take(page)
        for size in ("panel", "ten inches", "small", "narrow phone"):
            lay_out(page, *SCREENS[size])
            wrong = page.evaluate(
                FAILED, [why, asks, end, stop, "phone" not in size, size in ("small", "narrow phone")]
            )
            found += [f"{lang} {size} {one}" for one in wrong]
        lay_out(page, *SIZES["panel"])
        let_go(page)
    assert found == [], "\n".join(["", *found])


@pytest.mark.parametrize(("machine", "code"), [(machine, code) for machine, codes in FAULTY.items() for code in codes])
def test_what_a_fault_holds_says_so_and_no_command_is_below_stop(plant: Page, machine: str, code: int) -> None:
    page = plant
    fault(page, machine, code)
    heard(page, f"{machine}.state")
    open_page(page, f"{origin(page)}/equipment/{machine}")
    take(page)
    ordinary = ", ".join(f"[data-part^='{machine}.{key}']" for key in ORDINARY)
    found: list[str] = []
    for lang in LANGUAGES:
        speak(page, lang, origin(page))
        open_page(page, f"{origin(page)}/equipment/{machine}")
        for size, (width, height, profile) in SCREENS.items():
            lay_out(page, width, height, profile)
            wrong = [*page.evaluate(FAULTS), *page.evaluate(UNTOLD, ordinary if size == "small" else None)]
            wrong += [] if "phone" in size else page.evaluate(CUT)
            found += [f"{lang} {size}: {one}" for one in wrong]
        lay_out(page, *SIZES["panel"])
    let_go(page)
    built(page, machine)
    assert found == [], "\n".join(["", *found])


@pytest.mark.parametrize("lang", LANGUAGES)
def test_a_conveyor_that_runs_says_why_its_ways_cannot_be_chosen(plant: Page, lang: str) -> None:
    """Once, where there is no room for it on what is pressed: also on a small panel, over who holds the machine."""
    page = plant
    speak(page, lang, origin(page))
    open_page(page, f"{origin(page)}/equipment/c1")
    take(page)
    expect(page.locator(".c-mode [aria-disabled=true]")).to_have_count(1, timeout=30_000)
    found: list[str] = []
    for size in ("panel", "ten inches", "small", "narrow phone"):
        lay_out(page, *SCREENS[size])
        found += [f"{size}: {one}" for one in page.evaluate(SILENT)]
    lay_out(page, *SIZES["panel"])
    let_go(page)
    assert found == [], "\n".join(["", *found])
