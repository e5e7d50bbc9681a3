"""Nothing is cut, shortened, covered or beyond the edge: every page in every language at every size, each page loaded once per language."""

import shutil
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, expect

from app import bundled
from tests.browser.station import AXE, LANGUAGES, Sit, Stations, fault, lay_out, let_go, origin, serving, speak, take
from tests.conftest import ROOT, PogonServer
from tools.pictures import MARKS

FAULTS = (ROOT / "tools" / "faults.js").read_text("utf-8")
SIZES = {
    "panel": (1280, 800, "desk"),
    "small": (800, 480, "panel-9"),
    "phone": (390, 844, "desk"),
    "wide": (1920, 1080, "desk"),
}
DEMO = tomllib.loads((bundled("plants/demo") / "plant.toml").read_text("utf-8"))["equipment"]
MACHINES = tuple(DEMO)
FURTHER = {
    machine: sorted(
        path.stem.removeprefix("page_") for path in (bundled("templates/screens") / item["type"]).glob("page_*.html")
    )
    for machine, item in DEMO.items()
}
"""Machine → its further pages."""
LONGEST = """() => { // every state as its longest text, until the next value of its point comes
  for (const element of document.querySelectorAll('main [data-texts], aside [data-texts]')) {
    if (element.children.length || element.tagName === 'tspan') continue;
    const { texts, pattern } = element.dataset;
    const [longest] = Object.values(JSON.parse(texts)).filter((text) => typeof text === 'string').sort((a, b) => b.length - a.length);
    if (longest) element.textContent = (pattern || '{}').replace('{}', longest);
  }
}"""
LONG = """() => { // every list with thirty rows more
  const lists = [...document.querySelectorAll('main tbody, aside tbody')].filter((body) => body.rows.length);
  for (const body of lists) for (let n = 0; n < 30; n++) body.append(body.rows[0].cloneNode(true));
  return lists.length;
}"""
STOP = """(within) => [...document.querySelectorAll('.cmd.stop')].some((button) => {
  const { top, bottom } = button.getBoundingClientRect();
  return button.checkVisibility() && top >= 0 && bottom <= within + 1;
})"""
"""Whether Stop is there, no lower than this."""
CUT = """() => { // commands that lie under Stop or that one has to scroll for, whichever way of operating is chosen
  const found = new Set(), zone = document.querySelector('.zone:has(.cmd.stop)');
  if (!zone) return [];
  const stop = zone.querySelector('.cmd.stop');
  const look = () => {
    const end = Math.min(stop.getBoundingClientRect().top, zone.querySelector('.op-list').getBoundingClientRect().bottom);
    for (const one of zone.querySelectorAll('.cmd:not(.stop), .token'))
      if (one.checkVisibility() && one.getBoundingClientRect().bottom > end + 1)
        found.add(`"${one.textContent.trim().replace(/\\s+/g, ' ').slice(0, 40)}" lies lower than where the commands end`);
  };
  const ways = [...zone.querySelectorAll('fieldset label input[type=radio]')].filter((one) => one.parentElement.checkVisibility());
  const chosen = ways.filter((one) => one.checked);
  look();
  for (const one of [...ways, ...chosen]) {
    one.checked = true;
    one.dispatchEvent(new Event('change', { bubbles: true }));
    look();
  }
  return [...found];
}"""
SMALLEST = """(least) => { // commands and what leads to them that a finger misses; a way of operating is one press, not a motion
  const found = [];
  for (const [kind, chosen, px] of [['command', '.zone .cmd', least.command], ['Stop', '.zone .cmd.stop', least.stop],
    ['other', '.zone :is(.btn, .seg > :is(button, label, a), .in), main .sp-field :is(.btn, .in)', least.other]])
    for (const one of document.querySelectorAll(chosen)) {
      const { height, width } = one.getBoundingClientRect();
      if (one.checkVisibility() && Math.min(height, width) < px - 0.5)
        found.push([kind, one.textContent.trim().slice(0, 30), Math.round(width), 'x', Math.round(height), 'expected', px].join(' '));
    }
  for (const one of document.querySelectorAll('.zone .seg > :is(button, label, a)'))
    if (one.checkVisibility() && one.scrollWidth > one.clientWidth + 1)
      found.push(`${one.textContent.trim().slice(0, 30)} is wider than its place`);
  return found;
}"""
FLOORS = {
    "panel": {"command": 44, "stop": 74, "other": 36},
    "small": {"command": 61, "stop": 61, "other": 44},
    "phone": {"command": 44, "stop": 56, "other": 36},
    "wide": {"command": 44, "stop": 74, "other": 36},
}
"""Size → least side of what is pressed beside a machine [px].

On the small panel that is what is wanted: 15 mm for a command and for Stop, 9 mm and at least 44 px for what leads to them; none
may lie under Stop or be scrolled for, whichever way of operating is chosen. On the others 15 mm are 74 px, which Stop has.
"""
AXE_RUN = """axe.run(document, {resultTypes: ['violations']}).then(({ violations }) => violations.map(
  ({ id, nodes }) => `${id} ${nodes.length}: ${nodes[0].html.slice(0, 160)}`))"""
ENGINEERED = ("parameters", "/events", "/compare", "/encoder", "/fault-buffer", "/definition")
"""Ends of pages of a machine on which nobody operates it."""
LOOKED_AT = {"hr": "light", "cs": "dark"}
"""Language → theme in which no page has a barrier; each test of what a page does looks at others."""
LIGHT = {"/": 150_000, "/alarms": 150_000, "/equipment/m1": 190_000}
"""What a page may weigh when nothing of it is kept [bytes]."""
BOTH = f"() => {{ ({LONGEST})(); return ({FAULTS[FAULTS.index('() =>') :].strip()})(); }}"
PUT_BACK = f"""() => {{ // in one go, before the next answer hides it again
  const back = document.querySelector("[data-command='m2.put_back']");
  back.hidden = false;
  back.ariaDisabled = null;
  return [...({CUT})(), ...({BOTH})()];
}}"""
PAGES = (
    "/",
    *(f"/equipment/{machine}{part}" for machine in MACHINES for part in ("", "/faceplate")),
    *(f"/equipment/{machine}/page/{name}" for machine in MACHINES for name in FURTHER[machine]),
    "/equipment/cr1/page/thesis?run=positioner",
    *(f"/equipment/{machine}/parameters" for machine in ("m1", "c1", "cr1")),
    "/trends?tags=m1.speed,m1.frequency_setpoint,c1.measured_speed_1&span=10m",
    "/area/drives",
    "/alarms",
    "/alarms?tab=journal",
    "/alarms?tab=hidden",
    "/alarms/statistics",
    "/events",
    "/equipment/c1/events",
    *(f"/equipment/a1/{name}" for name in ("drive-parameters", "drive-parameters/compare", "encoder", "fault-buffer")),
    "/equipment/seq1/definition",
    "/records/passage?equipment=c1",
    "/records/run?equipment=seq1",
    "/records/run?equipment=seq1&view=steps",
    "/records/coil?equipment=cc1",
    "/records/crane_cycle?equipment=cr1",
    "/records/crane_cycle?equipment=cr1&view=last",
    "/communication",
    "/forces",
    "/users",
    "/tokens",
    "/audit",
    "/account",
    "/account/factor",
    "/users/review",
    "/lessons",
    "/welcome",
    "/help",
    "/docs",
    "/storage",
    "/plant",
    *(f"/instructor{machine}" for machine in ("", "/m1", "/c1", "/cc1")),
    "/no-such-page",
)


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PogonServer]:
    """One Pogon with the whole demo plant."""
    with serving(tmp_path_factory.mktemp("whole"), {"ana": ("admin", "engineer", "operator")}) as running:
        yield running


@pytest.fixture(scope="module")
def abnormal(stations: Stations, server: PogonServer) -> Iterator[Page]:
    """A page of a plant at work, one of whose drives has tripped."""
    seat = Sit(stations, server, {}, "ana", "/equipment/m2")
    page = seat()
    fault(page, "m2", 13)
    expect(page.locator("#alarms .banner-row, #alarms li, #alarms a").first).to_be_visible()
    yield page
    seat.leave()


@pytest.mark.parametrize("lang", LANGUAGES)
def test_nothing_is_cut_at_any_size(abnormal: Page, server: PogonServer, lang: str) -> None:
    """Nor is a text missing in a language, nor Stop out of sight on the page of a machine."""
    page = abnormal
    speak(page, lang, server.url)
    found: list[str] = []
    theme = LOOKED_AT.get(lang, "auto")
    page.context.add_cookies([{"name": "pogon_theme", "value": theme, "url": server.url}])
    for path in PAGES:
        page.goto(server.url + path, wait_until="load")
        if page.locator("body[data-live]").count():
            expect(page.locator("body")).to_have_attribute("data-live", "live")
        page.evaluate("document.fonts.ready.then(() => 1)")
        found += [f"{lang} {path}: {mark} is no text" for mark in MARKS.findall(page.inner_text("body"))]
        if lang in LOOKED_AT:
            page.evaluate(AXE.read_text("utf-8"))
            found += [f"{lang} {path} {theme}: {one}" for one in page.evaluate(AXE_RUN)]
        for size, (width, height, profile) in SIZES.items():
            lay_out(page, width, height, profile)
            if size != "phone" and page.evaluate("document.documentElement.scrollHeight") > height:
                found.append(f"{lang} {path} {size}: the page is higher than the screen")
            if size != "phone":
                found += [f"{lang} {path} {size}: {one}" for one in page.evaluate(CUT)]
            found += [f"{lang} {path} {size}: {one}" for one in page.evaluate(SMALLEST, FLOORS[size])]
            found += [f"{lang} {path} {size}: {one}" for one in page.evaluate(BOTH)]
            if path.startswith("/equipment/") and not path.endswith(ENGINEERED):
                found += [f"{lang} {path} {size}: no Stop in sight" for _ in range(not page.evaluate(STOP, height))]
    assert found == [], "\n".join(["", *found])


@pytest.mark.parametrize("lang", LANGUAGES)
def test_nothing_is_cut_for_who_operates_a_machine(abnormal: Page, server: PogonServer, lang: str) -> None:
    """Who holds control is shown more: his commands are all there at once, as large as a finger needs, and Stop is."""
    page = abnormal
    speak(page, lang, server.url)
    found: list[str] = []
    for machine in MACHINES:
        page.goto(f"{server.url}/equipment/{machine}", wait_until="load")
        expect(page.locator("body")).to_have_attribute("data-live", "live")
        lay_out(page, *SIZES["panel"])
        take(page)
        for size, (width, height, profile) in SIZES.items():
            lay_out(page, width, height, profile)
            looks = [] if size == "phone" else page.evaluate(CUT)
            looks += page.evaluate(SMALLEST, FLOORS[size]) + page.evaluate(BOTH)
            found += [f"{lang} {machine} {size}: {one}" for one in looks]
            found += [f"{lang} {machine} {size}: no Stop in sight" for _ in range(not page.evaluate(STOP, height))]
        lay_out(page, *SIZES["panel"])
        let_go(page)
    assert found == [], "\n".join(["", *found])


@pytest.mark.parametrize("lang", LANGUAGES)
def test_why_a_sequence_is_aborted_hides_none_of_its_steps(abnormal: Page, server: PogonServer, lang: str) -> None:
    """At 1280x800 every step of eight is seen, whatever was lost and however long its name is."""
    page = abnormal
    speak(page, lang, server.url)
    page.goto(f"{server.url}/equipment/seq1", wait_until="load")
    lay_out(page, *SIZES["panel"])
    file = bundled("plants/demo") / "sequences" / "coil_transport.toml"
    abort = tomllib.loads(file.read_text("utf-8"))["abort"].values()
    most = max((one["missing"][lang] for one in abort), key=len)
    lowest, above = page.evaluate(
        """(text) => { const cell = document.querySelector('.q-abort td:last-child'); cell.innerHTML = `<b>${text}</b>`;
           return ['.seqt tbody:not(.q-abort) tr:last-child', '.q-abort td'].map((one, n) =>
             document.querySelector(one).getBoundingClientRect()[n ? 'top' : 'bottom']); }""",
        f"{most} · {len(abort) - 1} more",
    )
    assert lowest <= above + 1


def other_plant(folder: Path) -> Path:
    """A plant in `folder` that is not the demo: a drive with automatic steps and four values for a run, and a line of five belts."""
    plant = folder / "plant"
    shutil.copytree(bundled("plants/drive_steps"), plant)
    belts = (bundled("plants/belts") / "plant.toml").read_text("utf-8")
    with (plant / "plant.toml").open("a", encoding="utf-8") as file:
        file.write("\n" + belts[belts.index("[links.line]") :])
    steps = plant / "sequences" / "automatic_steps.toml"
    text, more = steps.read_text("utf-8"), ""
    for key, label in (("pause", "Stillstand zwischen den Fahrten"), ("cooling", "Nachlaufzeit des Lüfters")):
        label = ", ".join(f'{lang} = "{label}"' for lang in LANGUAGES)
        more += f'[[recipe]]\nkey = "{key}"\nlabel = {{ {label} }}\nunit = "s"\ndecimals = 1\nminimum = 0\nmaximum = 40\ndefault = 10\n\n'
    steps.write_text(text.replace("[[steps]]", more + "[[steps]]", 1), "utf-8")
    return folder


@pytest.fixture(scope="module")
def other(stations: Stations, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    """A page of another plant."""
    with serving(other_plant(tmp_path_factory.mktemp("other")), {"ana": ("engineer", "operator")}) as running:
        seat = Sit(stations, running, {}, "ana", "/equipment/steps1")
        yield seat()
        seat.leave()


@pytest.mark.parametrize("lang", LANGUAGES)
def test_nothing_is_cut_in_a_plant_with_more_of_everything(other: Page, lang: str) -> None:
    """The run's four values, the editor, a drive that a sequence runs, five belts while somebody moves them."""
    page, url = other, origin(other)
    speak(page, lang, url)
    found: list[str] = []
    for path in ("/equipment/steps1", "/equipment/steps1/definition", "/equipment/m1", "/equipment/c5"):
        page.goto(url + path, wait_until="load")
        expect(page.locator("body")).to_have_attribute("data-live", "live")
        lay_out(page, *SIZES["panel"])
        held = page.locator("[data-token=take]").count() > 0
        if held:
            take(page)
        for size, (width, height, profile) in SIZES.items():
            lay_out(page, width, height, profile)
            looks = [] if size == "phone" else page.evaluate(CUT)
            looks += page.evaluate(SMALLEST, FLOORS[size]) + page.evaluate(BOTH)
            found += [f"{lang} {path} {size}: {one}" for one in looks]
        lay_out(page, *SIZES["panel"])
        if held:
            let_go(page)
    assert found == [], "\n".join(["", *found])


def test_a_long_list_does_not_make_the_page_higher(abnormal: Page, server: PogonServer) -> None:
    page = abnormal
    speak(page, "en", server.url)
    found: list[str] = []
    for path in (
        "/",
        "/alarms",
        "/alarms?tab=journal",
        "/communication",
        "/users",
        "/audit",
        "/events",
        "/equipment/m1/parameters",
    ):
        page.goto(server.url + path, wait_until="load")
        for size in ("panel", "small"):
            width, height, profile = SIZES[size]
            lay_out(page, width, height, profile)
            assert page.evaluate(LONG), path
            lay_out(page, width, height, profile)
            if page.evaluate("document.documentElement.scrollHeight") > height:
                found.append(f"{path} {size}")
    assert found == []


@pytest.mark.parametrize("path", ["/", "/alarms", "/equipment/m1"])
def test_a_cold_page_is_light(browser: Browser, server: PogonServer, path: str) -> None:
    """Bytes of all answers with their heads, as they come over the wire."""
    context = browser.new_context(locale="hr-HR")
    page = context.new_page()
    wire = context.new_cdp_session(page)
    came: list[float] = []
    wire.on("Network.loadingFinished", lambda done: came.append(done["encodedDataLength"]))
    wire.send("Network.enable")
    page.goto(server.url + path)
    expect(page.locator("body")).to_have_attribute("data-live", "live")
    page.wait_for_load_state("networkidle")
    assert len(came) > 10
    assert sum(came) <= LIGHT[path], sorted(map(int, came))
    context.close()


@pytest.mark.parametrize("lang", LANGUAGES)
def test_a_command_more_hides_no_other(abnormal: Page, server: PogonServer, lang: str) -> None:
    """What puts the former frequency back comes on top of all others when a server died while somebody jogged."""
    page = abnormal
    speak(page, lang, server.url)
    page.goto(f"{server.url}/equipment/m2", wait_until="load")
    expect(page.locator("body")).to_have_attribute("data-live", "live")
    lay_out(page, *SIZES["panel"])
    take(page)
    found: list[str] = []
    for size in ("panel", "small", "wide"):
        lay_out(page, *SIZES[size])
        found += [f"{lang} {size}: {one}" for one in page.evaluate(PUT_BACK)]
    lay_out(page, *SIZES["panel"])
    let_go(page)
    assert found == [], "\n".join(["", *found])


@pytest.mark.parametrize("lang", LANGUAGES)
def test_the_review_of_a_value_is_whole(abnormal: Page, server: PogonServer, lang: str) -> None:
    """Nothing of it is beside the column, where one would have to scroll for the button that sets."""
    page = abnormal
    speak(page, lang, server.url)
    page.goto(f"{server.url}/equipment/m1", wait_until="load")
    expect(page.locator("body")).to_have_attribute("data-live", "live")
    lay_out(page, *SIZES["panel"])
    take(page)
    page.fill(".sp-field [name=argument]", "12")
    page.press(".sp-field [name=argument]", "Enter")
    expect(page.locator(".review-form .review")).to_be_visible()
    found: list[str] = []
    for size in ("panel", "small", "wide"):
        lay_out(page, *SIZES[size])
        beside = page.locator(".op-list").evaluate("(list) => list.scrollWidth - list.clientWidth")
        found += [f"{lang} {size}: {beside} px beside the column" for _ in range(beside > 0)]
        found += [f"{lang} {size}: {one}" for one in page.evaluate(FAULTS)]
    lay_out(page, *SIZES["panel"])
    page.click(".review-form [data-cancel]")
    let_go(page)
    assert found == [], "\n".join(["", *found])
