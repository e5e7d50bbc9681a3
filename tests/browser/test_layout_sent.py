"""While a command is on its way, when the device refuses or says nothing, all that is said is whole and every command above Stop; what
is pressed next does not move for it."""

import time
from collections.abc import Iterator

import pytest
from playwright.sync_api import Locator, Page, expect

from app.plant.texts import Texts
from tests.browser.looks import CUT, EACH_WAY, FAULTS, SIZES, STOP, open_page
from tests.browser.station import (
    LANGUAGES,
    Sit,
    Stations,
    built,
    instruct,
    lay_out,
    let_go,
    origin,
    serving,
    speak,
    stopped,
    take,
)
from tests.browser.test_layout_machines import MACHINES

SCREENS = {"panel": SIZES["panel"], "small": SIZES["small"], "phone": SIZES["phone"]} | {
    "ten inches": (1024, 768, "desk"),
    "low": (1280, 720, "desk"),
}
KINDS = tuple(one for one in MACHINES if one != "m2")
"""Machines that differ."""
SENT = {"m1": "coast", "c1": "reset", "cc1": "reset", "cr1": "reset", "a1": "move_relative"}
"""Machine → a command that it takes as it stands, or stopped."""
ITSELF = ("c1", "cr1")
"""Machines of the demo plant that begin anew by themselves."""
IN_ORDER, CABLE_PULLED, SLOW, REFUSES = (
    {"mode": mode, "delay": delay, "argument": "4", "count": "0"}
    for mode, delay in (("0", "0"), ("1", "0"), ("2", "150"), ("7", "0"))
)
"""What becomes of the line of a machine."""
REASON = "[aria-disabled=true]:not(:has([data-why]))"
"""A command that cannot be pressed, and says why."""
UNSAID = """(words) => { // what is said of a Stop beside it and in the message line, each of which is seen
  const said = [document.querySelector('.op > .stop small'), document.querySelector('#message')];
  return said.filter((one) => !one.checkVisibility({ visibilityProperty: true }) || getComputedStyle(one).clipPath === 'inset(50%)'
    || !one.textContent.includes(words)).map((one) => `${one.localName}${one.id} does not say so: ${one.textContent.trim()}`);
}"""
PLACES = (
    """(sent) => { // where everything that is pressed stands, in whichever way of operating, pressed in or not; but for what is sent
  const found = new Set(), zone = document.querySelector('.zone:has(.cmd.stop)');
  const look = () => {
    const way = zone.querySelector('fieldset :checked')?.value ?? '';
    for (const one of zone.querySelectorAll('.cmd, .btn, .in, .seg > *'))
      if (one.checkVisibility() && one.dataset.command !== sent) {
        const { x, y, width } = one.getBoundingClientRect(), part = one.closest('[data-part]')?.dataset.part ?? '';
        const pressed = new DOMMatrix(getComputedStyle(one).transform).m42;
        const place = [x, y + scrollY - pressed, width].map(Math.round).join(' ');
        found.add(`${way} ${part} ${one.className || one.firstElementChild?.value}: ${place}`);
      }
  };"""
    + EACH_WAY
)


@pytest.fixture
def plant(stations: Stations, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    """A page of the demo plant as it was built."""
    with serving(tmp_path_factory.mktemp("sent"), {"ana": ("admin", "engineer", "operator")}) as running:
        seat = Sit(stations, running, {}, "ana", "/alarms")
        yield seat()
        seat.leave()


def wrong(page: Page, *checks: str) -> list[str]:
    """What is wrong at each of SCREENS; on a telephone commands are scrolled for. The page is left at the panel's size."""
    found: list[str] = []
    for name, (width, height, profile) in SCREENS.items():
        lay_out(page, width, height, profile)
        asked = [FAULTS, *checks, *([] if name == "phone" else [CUT])]
        found += [f"{name}: {one}" for check in asked for one in page.evaluate(check)]
        found += [f"{name}: no Stop in sight" for _ in range(not page.evaluate(STOP, height))]
    lay_out(page, *SIZES["panel"])
    return found


@pytest.mark.parametrize("lang", LANGUAGES)
def test_while_a_command_is_sent_every_other_is_above_stop(plant: Page, lang: str) -> None:
    """All say that another is being sent; the page is kept so as long as it takes to look at."""
    found: list[str] = []
    for command, _ in each_sent(plant, lang):
        found += [f"{command} {one}" for one in wrong(plant)]
    assert found == [], "\n".join(["", *found])


def each_sent(page: Page, lang: str) -> Iterator[tuple[str, set[str]]]:
    """Each command of SENT while it is on its way, on a page that is kept so, with where what is pressed stood before."""
    speak(page, lang, origin(page))
    for machine, key in SENT.items():
        open_page(page, f"{origin(page)}/equipment/{machine}")
        take(page)
        sent = ready(page, machine, key)
        before, why = places(page, f"{machine}.{key}"), reasons(page, shown(page, machine))
        instruct(page, f"{machine}/line", **SLOW)
        sent.click()
        keep_while_it_says(page, machine, busy(lang), why)
        yield f"{machine}.{key}", before
        page.unroute_all()
        instruct(page, f"{machine}/line", **IN_ORDER)
        built(page, machine)
        open_page(page, f"{origin(page)}/equipment/{machine}")
        let_go(page)


def busy(lang: str) -> str:
    """How every other command says that one is on its way."""
    return Texts.read().text(lang, "why.busy").split("{")[0]


def ready(page: Page, machine: str, key: str) -> Locator:
    """The button of a command that can be given; what runs by itself was stopped, as it may forbid that the next moment."""
    button = page.locator(f".zone [data-command='{machine}.{key}']")
    if machine in ITSELF or button.get_attribute("aria-disabled"):
        stopped(page)
    expect(button).not_to_have_attribute("aria-disabled", "true", timeout=30_000)
    return button


def places(page: Page, sent: str) -> set[str]:
    """Where what is pressed stands, at each of SCREENS."""
    found: set[str] = set()
    for name, (width, height, profile) in SCREENS.items():
        lay_out(page, width, height, profile)
        found |= {f"{name} {one}" for one in page.evaluate(PLACES, sent)}
    lay_out(page, *SIZES["panel"])
    return found


@pytest.mark.parametrize("lang", LANGUAGES)
def test_while_a_command_is_sent_nothing_moves_from_under_a_finger(plant: Page, lang: str) -> None:
    """That another is being sent is heard, and told to who presses; nothing that can be pressed stands elsewhere for it."""
    moved: list[str] = []
    for command, before in each_sent(plant, lang):
        press_another(plant, busy(lang))
        moved += sorted(places(plant, command) ^ before)
    assert moved == [], "\n".join(["", *moved])


def test_why_a_motor_cannot_run_moves_nothing_under_it(plant: Page) -> None:
    """On a desk each direction says so in the room that it has: the frequency and what else is pressed stand where they stood."""
    page, moved = plant, []
    for lang in LANGUAGES:
        speak(page, lang, origin(page))
        open_page(page, f"{origin(page)}/equipment/m1")
        take(page)
        before = under_the_directions(page)
        instruct(page, "m1/line", **REFUSES)
        expect(page.locator(".op-run .cmd" + REASON)).to_have_count(2, timeout=30_000)
        moved += [f"{lang} {one}" for one in sorted(under_the_directions(page) ^ before)]
        instruct(page, "m1/line", **IN_ORDER)
        expect(page.locator(".op-run .cmd" + REASON)).to_have_count(0, timeout=30_000)
    assert moved == [], "\n".join(["", *moved])


def under_the_directions(page: Page) -> set[str]:
    """Where on a desk stands what is pressed while a way to run is chosen; but for the directions."""
    return {
        one
        for one in places(page, "m1.reverse")
        if one.startswith(("panel run", "low run")) and "m1.forward" not in one
    }


def keep_while_it_says(page: Page, machine: str, words: str, why: set[str]) -> None:
    """Wait until commands of the machine say these `words`, and otherwise what they said before; the page is answered so from then on."""
    end = time.monotonic() + 10
    while words not in (text := shown(page, machine)) or reasons(page, text) != why:
        assert time.monotonic() < end, f"{page.inner_text('#message')}; {reasons(page, text)}, before {why}"
    page.route(commands(page, machine), lambda route: route.fulfill(body=text, content_type="text/html; charset=utf-8"))
    page.evaluate("htmx.trigger(document.querySelector('[data-operation]'), 'again')")
    expect(page.locator(".op .cmd[aria-disabled=true] small", has_text=words).first).to_be_attached()


def commands(page: Page, machine: str) -> str:
    """Where the page of the machine asks for its commands again."""
    return f"{origin(page)}/equipment/{machine}/commands"


def shown(page: Page, machine: str) -> str:
    """The commands of the machine as they are drawn now."""
    return page.request.get(commands(page, machine), max_retries=1).text()


def reasons(page: Page, text: str) -> set[str]:
    """Why commands drawn so cannot be pressed; that another is being sent is none of them."""
    return set(
        page.evaluate(
            f"""(text) => [...new DOMParser().parseFromString(text, 'text/html').querySelectorAll('.cmd{REASON}')].map(
      (one) => `${{one.dataset.command}}: ${{one.textContent.trim()}}`)""",
            text,
        )
    )


def press_another(page: Page, words: str) -> None:
    """Who presses one that waits is told these `words`; over which may be said what becomes of the one that is sent."""
    other, end = page.locator(".zone .cmd[aria-disabled=true]:visible", has_text=words).first, time.monotonic() + 30
    said = ""
    while words not in said:
        assert time.monotonic() < end, said
        other.click(force=True)
        said = page.inner_text("#message")


def led_over_a_line(page: Page, **what: str) -> None:
    """Take control of each machine, then let that become of its line."""
    for machine in KINDS:
        open_page(page, f"{origin(page)}/equipment/{machine}")
        take(page)
    for machine in KINDS:
        instruct(page, f"{machine}/line", **what)


def test_what_a_machine_says_that_refuses_all_is_whole(plant: Page) -> None:
    """Its values cannot be used, and each command says which one it lacks."""
    page, found = plant, []
    led_over_a_line(page, **REFUSES)
    for machine in KINDS:
        for lang in LANGUAGES:
            speak(page, lang, origin(page))
            open_page(page, f"{origin(page)}/equipment/{machine}")
            found += [f"{lang} {machine} {one}" for one in wrong(page)]
    assert found == [], "\n".join(["", *found])


def test_that_a_stop_was_not_confirmed_is_told_whole(plant: Page) -> None:
    """While it is sent, then that it was not: beside it, in the message line and above all pages."""
    page, found = plant, []
    led_over_a_line(page, **CABLE_PULLED)
    for machine in KINDS:
        open_page(page, f"{origin(page)}/equipment/{machine}")
        with page.expect_response(lambda answer: answer.url.endswith("/stop")):
            page.click(".op > .stop")
        speak(page, "de", origin(page))
        open_page(page, f"{origin(page)}/equipment/{machine}")
        found += [f"sent {machine} {one}" for one in wrong(page)]
    for lang in ("hr", "de"):
        words = Texts.read().text(lang, "why.stop_not_confirmed").split("{")[0]
        speak(page, lang, origin(page))
        for machine in KINDS:
            open_page(page, f"{origin(page)}/equipment/{machine}")
            expect(page.locator(".op > .stop small").first).to_contain_text(words, timeout=30_000)
            found += [f"{lang} {machine} {one}" for one in [*wrong(page), *page.evaluate(UNSAID, words)]]
    assert found == [], "\n".join(["", *found])
