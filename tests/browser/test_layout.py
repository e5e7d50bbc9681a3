"""Nothing is cut, shortened, covered or beyond the edge on any page that is of no machine alone, in every language at every size."""

import pytest
from playwright.sync_api import Browser, Page, expect

from app.plant import types
from tests.browser.looks import FAULTS, LONG, LONGEST, SIZES, looked_at, open_page
from tests.browser.station import LANGUAGES, lay_out, origin, speak

PAGES = {
    "plant": (
        "/",
        "/area/drives",
        "/alarms",
        "/alarms?tab=journal",
        "/alarms?tab=hidden",
        "/alarms/statistics",
        "/events",
    ),
    "history": (
        "/trends?tags=m1.speed,m1.frequency_setpoint,c1.speed_1&span=10m",
        "/records/passage?equipment=c1",
        "/records/run?equipment=seq1",
        "/records/run?equipment=seq1&view=steps",
        "/records/coil?equipment=cc1",
        "/records/crane_cycle?equipment=cr1",
        "/records/crane_cycle?equipment=cr1&view=last",
    ),
    "engineering": (
        *("/communication", "/forces", "/storage", "/plant", "/audit", "/docs"),
        *(f"/instructor{machine}" for machine in ("", "/m1", "/c1", "/cc1")),
    ),
    "people": (
        *("/users", "/users/review", "/tokens", "/account", "/account/factor"),
        *("/lessons", "/welcome", "/help", "/no-such-page"),
    ),
}
"""What it is about → its pages."""
BETWEEN = {
    "a panel of ten inches": (1024, 768),
    "twice as large": (640, 400),
    "a tablet upright": (768, 1024),
    "a phone on its side": (844, 390),
    "four times as large": (320, 640),
}
"""Sizes that none of the others is near: a common industrial panel, 1280x800 in a browser that was told to
show 200 or 400 %, what is held in a hand."""
THERE = (
    *("/", "/alarms", "/alarms?tab=journal", "/events", "/records/passage?equipment=c1", "/trends", "/communication"),
    *(f"/equipment/{machine}" for machine in ("m1", "c1", "cc1", "cr1", "seq1", "a1")),
    *("/equipment/cr1/page/hoist", "/equipment/cr1/page/drives", "/equipment/c1/events", "/equipment/a1/page/words"),
    *("/instructor/c1", "/equipment/seq1/definition"),
)
"""What is looked at there."""
TEN_INCHES = (
    *(f"/equipment/{machine}" for machine in ("m1", "c1", "cc1", "cr1", "seq1", "a1")),
    *(f"/equipment/cr1/page/{name}" for name in ("hoist", "trolley", "drives", "sequence", "thesis?run=positioner")),
    *("/equipment/a1/page/words", "/equipment/a1/faceplate", "/equipment/c1/faceplate", "/equipment/seq1/events"),
    *("/", "/events", "/trends", "/account", "/instructor/c1", "/alarms"),
)
"""What is looked at on the panel that most cabinets have."""
SIDEWAYS = """() => [...document.querySelectorAll('main, main *, aside *')].filter((e) => e.checkVisibility() && e.clientWidth > 60
  && /(auto|scroll)/.test(getComputedStyle(e).overflowX) && e.scrollWidth > e.clientWidth + 1)
  .map((e) => [...e.classList].join('.') + ' scrolls sideways by ' + (e.scrollWidth - e.clientWidth))"""
"""What has to be pushed aside to be read."""
PUSHED = f"(byWord) => {{ ({LONGEST})(byWord); return [...({FAULTS[FAULTS.index('() =>') :].strip()})(), ...({SIDEWAYS})()]; }}"
"""What is wrong or has to be pushed aside whatever the machines say: which state one has just then is chance."""
WRITTEN = """() => new Promise((done) => { // what a chart writes when it is drawn anew
  const brush = CanvasRenderingContext2D.prototype, { fillText } = brush, written = [];
  brush.fillText = function (text, ...place) { written.push(String(text)); return fillText.call(this, text, ...place); };
  document.querySelector("main").style.paddingRight = "1px";
  setTimeout(() => { brush.fillText = fillText; done(written); }, 1000);
})"""
LIGHT = {"/": 150_000, "/alarms": 150_000, "/equipment/m1": 190_000}
"""What a page may weigh when nothing of it is kept [bytes]."""


@pytest.mark.parametrize("about", PAGES)
@pytest.mark.parametrize("lang", LANGUAGES)
def test_nothing_is_cut_at_any_size(abnormal: Page, lang: str, about: str) -> None:
    """Nor is a text missing in a language."""
    speak(abnormal, lang, origin(abnormal))
    found = looked_at(abnormal, origin(abnormal), PAGES[about], lang)
    assert found == [], "\n".join(["", *found])


def test_nothing_is_cut_between_these_sizes(abnormal: Page) -> None:
    """In the language with the longest words."""
    speak(abnormal, "de", origin(abnormal))
    found: list[str] = []
    for path in THERE:
        open_page(abnormal, origin(abnormal) + path)
        for name, (width, height) in BETWEEN.items():
            lay_out(abnormal, width, height, "desk")
            found += [f"{path} {name}: {one}" for one in abnormal.evaluate(FAULTS)]
    assert found == [], "\n".join(["", *found])


@pytest.mark.parametrize("lang", LANGUAGES)
def test_the_name_of_any_step_that_runs_is_whole(abnormal: Page, lang: str) -> None:
    """It is heavy then, and longer; which one runs is a matter of the moment, so all of them are drawn so at once."""
    speak(abnormal, lang, origin(abnormal))
    open_page(abnormal, f"{origin(abnormal)}/equipment/seq1")
    found: list[str] = []
    for name, (width, height) in {
        "a desk": (1280, 800),
        "a panel": (800, 480),
        "a phone": (390, 844),
        **BETWEEN,
    }.items():
        lay_out(abnormal, width, height, "panel-9" if name == "a panel" else "desk")
        rows = abnormal.evaluate(
            "() => [...document.querySelectorAll('.seqt [data-row-step]')].map((row) => row.setAttribute('aria-selected', 'true')).length"
        )
        assert rows == 8
        found += [f"{name}: {one}" for one in abnormal.evaluate(FAULTS) if "q-name" in one]
    assert found == [], "\n".join(["", *found])


LONG_FACTS = """() => { for (const dd of document.querySelectorAll('#event-detail .p-facts dd'))
  dd.textContent = 'Uvjeti za prekid: ulazi 16/16 · 2026-11-28 00:00:00,000'; }"""


@pytest.mark.parametrize("lang", LANGUAGES)
def test_facts_of_an_event_however_long_push_nothing_aside(abnormal: Page, lang: str) -> None:
    """Names of facts keep their words whole beside them."""
    speak(abnormal, lang, origin(abnormal))
    lay_out(abnormal, *BETWEEN["a panel of ten inches"], "desk")
    open_page(abnormal, origin(abnormal) + "/equipment/seq1/events")
    expect(abnormal.locator("#event-detail .p-facts")).not_to_have_count(0)
    abnormal.evaluate(LONG_FACTS)
    for size in (BETWEEN["a panel of ten inches"], (1280, 800), (800, 480), (390, 844)):
        lay_out(abnormal, *size, "desk")
        assert [one for one in abnormal.evaluate(SIDEWAYS) if "p-det" in one] == [], size


@pytest.mark.parametrize("lang", ["hr", "de"])
def test_a_panel_of_ten_inches_shows_all_of_a_page_without_pushing_it_aside(abnormal: Page, lang: str) -> None:
    speak(abnormal, lang, origin(abnormal))
    found: list[str] = []
    for path in TEN_INCHES:
        lay_out(abnormal, *BETWEEN["a panel of ten inches"], "desk")
        open_page(abnormal, origin(abnormal) + path)
        found += [f"{path}: {one}" for one in [*abnormal.evaluate(PUSHED), *abnormal.evaluate(PUSHED, True)]]
    assert found == [], "\n".join(["", *found])


COIL_CAR = types.read_type("coil_car", LANGUAGES)[0].type
UNDER_WAY = """(words) => { // a coil car drives to a target with the largest coil
  const [drive] = document.querySelectorAll(".cc-small small[data-show]"), figures = document.querySelectorAll(".cc-small .val b");
  drive.hidden = false;
  drive.querySelector(".sp-c").textContent = words;
  [figures[0].textContent, figures[2].textContent] = ["2\u202f683", "1\u202f300"];
}"""


@pytest.mark.parametrize("lang", LANGUAGES)
def test_figures_beside_the_picture_of_a_sequence_are_whole_while_it_moves(abnormal: Page, lang: str) -> None:
    """The targets of both axes stand there then, and what is done may be a long text."""
    speak(abnormal, lang, origin(abnormal))
    found: list[str] = []
    for size in ((1024, 768), (1280, 800), (1366, 768), (1280, 720)):
        lay_out(abnormal, *size, "desk")
        open_page(abnormal, f"{origin(abnormal)}/equipment/seq1")
        abnormal.evaluate(UNDER_WAY, COIL_CAR.texts[lang]["screen.to"].replace("{}", "1\u202f000"))
        found += [f"{size}: {one}" for one in [*abnormal.evaluate(PUSHED), *abnormal.evaluate(PUSHED, True)]]
    assert found == [], "\n".join(["", *found])


WIDEST_COIL_CAR = """() => { // every limit that a drive may stand at, all that is wrong with a movement, large doubtful figures
  for (const one of document.querySelectorAll(".cc-axes .cc-ends [hidden], .cc-low header [hidden]")) one.hidden = false;
  for (const one of document.querySelectorAll(".cc-low [data-class]")) one.classList.add(one.dataset.class.split(":")[0]);
  const zones = [...document.querySelectorAll(".cc-kv b[data-show]")];
  const word = (one) => Math.max(...one.textContent.split(" ").map((part) => part.length));
  const [widest] = zones.sort((one, other) => word(other) - word(one));
  for (const one of zones) one.hidden = one !== widest;
  for (const one of document.querySelectorAll(".cc-low .val")) {
    [one.dataset.q, one.querySelector("b").textContent] = ["uncertain", one.closest(".cc-kv") ? "1 300" : "-1234,5"];
  }
}"""
WIDEST_CRANE = """() => { // brakes that disagree, large doubtful figures
  for (const one of document.querySelectorAll(".k-axes td.k-wide [hidden]")) one.hidden = false;
  for (const one of document.querySelectorAll(".k-axes .val"))
    [one.dataset.q, one.querySelector("b").textContent] = ["uncertain", "-120,0"];
  for (const one of document.querySelectorAll(".k-axes .sp-c")) one.textContent = "-120,0";
}"""


@pytest.mark.parametrize("lang", ["hr", "en", "de", "cs"])
@pytest.mark.parametrize(("machine", "widest"), [("cc1", WIDEST_COIL_CAR), ("cr1", WIDEST_CRANE)])
def test_axes_stay_in_sight_whatever_they_say_on_a_panel_of_ten_inches(
    abnormal: Page, machine: str, widest: str, lang: str
) -> None:
    speak(abnormal, lang, origin(abnormal))
    lay_out(abnormal, *BETWEEN["a panel of ten inches"], "desk")
    open_page(abnormal, f"{origin(abnormal)}/equipment/{machine}")
    abnormal.evaluate(widest)
    assert [*abnormal.evaluate(PUSHED), *abnormal.evaluate(PUSHED, True)] == []


@pytest.mark.parametrize("lang", LANGUAGES)
def test_words_of_axes_are_whole_on_a_narrow_telephone_whatever_they_say(abnormal: Page, lang: str) -> None:
    speak(abnormal, lang, origin(abnormal))
    for machine, widest in (("cc1", WIDEST_COIL_CAR), ("cr1", WIDEST_CRANE)):
        open_page(abnormal, f"{origin(abnormal)}/equipment/{machine}")
        lay_out(abnormal, 360, 740, "desk")
        abnormal.evaluate(widest)
        assert abnormal.evaluate(FAULTS) == [], machine


ELSEWHERE = {
    "a desk": (1280, 800, "desk"),
    "a small panel": (800, 480, "panel-9"),
    "a tablet upright": (*BETWEEN["a tablet upright"], "desk"),
    "a phone": (390, 844, "desk"),
}


@pytest.mark.parametrize("lang", LANGUAGES)
def test_whatever_a_machine_says_is_whole_on_every_other_screen(abnormal: Page, lang: str) -> None:
    """On a telephone pictures to scale and rows of choices are pushed aside on purpose; elsewhere nothing is."""
    speak(abnormal, lang, origin(abnormal))
    found: list[str] = []
    for machine, widest in {"m1": "", "cc1": WIDEST_COIL_CAR, "seq1": "", "a1": "", "cr1": WIDEST_CRANE}.items():
        open_page(abnormal, f"{origin(abnormal)}/equipment/{machine}")
        for name, size in ELSEWHERE.items():
            lay_out(abnormal, *size)
            for by_word in (False, True):
                if widest:
                    abnormal.evaluate(widest)
                wrong = abnormal.evaluate(PUSHED, by_word)
                found += [f"{machine} {name}: {one}" for one in wrong if name != "a phone" or "sideways" not in one]
    assert found == [], "\n".join(["", *found])


FLOOD = """() => { // alarms with long names, and as many as in a flood
  for (const one of document.querySelectorAll(".alist .a-open > span:last-child")) one.textContent = "Umrichter: Ausgangsphasenausfall";
  for (const one of document.querySelectorAll(".td tbody .td-l")) one.innerHTML = '<a href="/">08:23 Umrichter: Hardware-Überstrom</a>';
  for (const one of document.querySelectorAll(".as-measures td b")) one.textContent = "482/10 min";
  for (const one of document.querySelectorAll(".as-measures .as-v")) one.lastChild.data = "Maßnahme nötig";
}"""


@pytest.mark.parametrize("path", ["/", "/alarms", "/alarms/statistics"])
def test_a_flood_of_alarms_with_long_names_stays_in_sight_on_a_panel_of_ten_inches(abnormal: Page, path: str) -> None:
    """Else the button that acknowledges a row is out of sight, and no row counts as shown."""
    speak(abnormal, "de", origin(abnormal))
    lay_out(abnormal, *BETWEEN["a panel of ten inches"], "desk")
    open_page(abnormal, origin(abnormal) + path)
    abnormal.evaluate(FLOOD)
    assert [*abnormal.evaluate(FAULTS), *abnormal.evaluate(SIDEWAYS)] == []


@pytest.mark.parametrize("size", [(1280, 800), (1024, 768), (1920, 1080)])
def test_the_curves_beside_all_values_end_above_the_fold(abnormal: Page, size: tuple[int, int]) -> None:
    lay_out(abnormal, *size, "desk")
    open_page(abnormal, f"{origin(abnormal)}/equipment/m1/page/values")
    canvas = abnormal.locator(".pl-trend canvas").first
    expect(canvas).to_be_visible()
    below = "(one) => document.querySelector('.foot').getBoundingClientRect().top - one.getBoundingClientRect().bottom"
    assert canvas.evaluate(below) >= 0


@pytest.mark.parametrize("lang", LANGUAGES)
def test_the_name_of_a_curve_is_whole_at_its_end(abnormal: Page, lang: str) -> None:
    speak(abnormal, lang, origin(abnormal))
    for width, height in ((1280, 800), (1920, 1080)):
        lay_out(abnormal, width, height, "desk")
        open_page(
            abnormal, origin(abnormal) + "/trends?tags=m1.speed,m1.frequency_setpoint,c1.speed_1,a1.position&span=10m"
        )
        written = abnormal.evaluate(WRITTEN)
        assert len(written) > 10, "the chart was not drawn"
        assert [one for one in written if "…" in one] == [], width


STACKED = (
    "/plant",
    "/users/review",
    "/audit",
    "/communication?open=hall.1",
    "/tokens",
    "/account",
    "/users",
    "/storage",
    "/trends?tags=m1.speed,m1.frequency_setpoint,c1.speed_1&span=10m",
)


@pytest.mark.parametrize("path", STACKED)
def test_a_telephone_shows_a_table_without_pushing_it_aside(abnormal: Page, path: str) -> None:
    """Each cell of a row stands behind the name of its column."""
    speak(abnormal, "de", origin(abnormal))
    lay_out(abnormal, 390, 844, "desk")
    open_page(abnormal, origin(abnormal) + path)
    assert [*abnormal.evaluate(FAULTS), *abnormal.evaluate(SIDEWAYS)] == []


@pytest.mark.parametrize("path", ["/users", "/tokens"])
def test_what_makes_an_account_or_a_token_is_in_sight_on_a_panel(abnormal: Page, path: str) -> None:
    lay_out(abnormal, 1280, 800, "desk")
    open_page(abnormal, origin(abnormal) + path)
    button = abnormal.locator(".u-wide > .panel > .u-form > button.edge")
    below = "(one) => document.querySelector('.foot').getBoundingClientRect().top - one.getBoundingClientRect().bottom"
    assert button.evaluate(below) >= 0


def test_a_long_list_does_not_make_the_page_higher(abnormal: Page) -> None:
    page = abnormal
    speak(page, "en", origin(page))
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
        page.goto(origin(page) + path, wait_until="load")
        for size in ("panel", "small"):
            width, height, profile = SIZES[size]
            lay_out(page, width, height, profile)
            assert page.evaluate(LONG), path
            lay_out(page, width, height, profile)
            if page.evaluate("document.documentElement.scrollHeight") > height:
                found.append(f"{path} {size}")
    assert found == []


@pytest.mark.parametrize("path", ["/", "/alarms", "/equipment/m1"])
def test_a_cold_page_is_light(browser: Browser, abnormal: Page, path: str) -> None:
    """Bytes of all answers with their heads, as they come over the wire."""
    context = browser.new_context(locale="hr-HR")
    page = context.new_page()
    wire = context.new_cdp_session(page)
    came: list[float] = []
    wire.on("Network.loadingFinished", lambda done: came.append(done["encodedDataLength"]))
    wire.send("Network.enable")
    page.goto(origin(abnormal) + path)
    expect(page.locator("body")).to_have_attribute("data-live", "live")
    page.wait_for_load_state("networkidle")
    assert len(came) > 10
    assert sum(came) <= LIGHT[path], sorted(map(int, came))
    context.close()


ALONE = r"""() => { const found = [], place = (node, from, to) => {
    const words = document.createRange();
    words.setStart(node, from);
    words.setEnd(node, to);
    return words.getBoundingClientRect();
  };
  const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  for (let node; (node = texts.nextNode());) {
    const last = /(\S+)\s+(\d{1,2})\s*$/.exec(node.data);
    if (!last || !node.parentElement.closest("td, th, h2, dt")) continue;
    const before = place(node, last.index, last.index + last[1].length), number = last.index + last[0].lastIndexOf(last[2]);
    if (before.width && place(node, number, number + last[2].length).top > before.top + 2) found.push(node.data.trim());
  }
  return found; }"""
COVERED = """() => [...document.querySelectorAll(".pp-m")].filter((tile) => {
  const sign = tile.querySelector("[data-mark-of] svg")?.getBoundingClientRect();
  return sign?.width && [...tile.querySelectorAll("h2 a, .cap .when-online > *")].some((word) => [...word.getClientRects()].some((text) =>
    text.right > sign.left && text.left < sign.right && text.bottom > sign.top && text.top < sign.bottom)); }).length"""


def test_the_number_of_a_name_is_not_alone_in_its_last_line(abnormal: Page) -> None:
    speak(abnormal, "hr", origin(abnormal))
    for size in ((1280, 800), (800, 480), (390, 844)):
        abnormal.set_viewport_size({"width": size[0], "height": size[1]})
        for path in ("/", "/equipment/m1/drive-parameters", "/equipment/cr1/page/hoist"):
            abnormal.goto(origin(abnormal) + path)
            assert abnormal.evaluate(ALONE) == [], (size, path)


@pytest.mark.parametrize("lang", LANGUAGES)
def test_the_sign_of_an_alarm_covers_no_word_of_its_machine(abnormal: Page, lang: str) -> None:
    speak(abnormal, lang, origin(abnormal))
    for size in ((1280, 800), (800, 480), (1920, 1080)):
        abnormal.set_viewport_size({"width": size[0], "height": size[1]})
        abnormal.goto(origin(abnormal))
        expect(abnormal.locator(".pp-m [data-mark-of] svg").first).to_be_attached()
        assert abnormal.evaluate(COVERED) == 0, size


UNSAID = """() => [...document.querySelectorAll("main tbody tr .a-open")]
  .filter((one) => one.closest("tr").getClientRects().length && !one.getClientRects().length).map((one) => one.textContent.trim())"""


@pytest.mark.parametrize("path", ["/alarms", "/events", "/records/passage?equipment=c1"])
def test_on_paper_a_list_says_what_its_rows_are_about(abnormal: Page, path: str) -> None:
    abnormal.emulate_media(media="print")
    abnormal.goto(origin(abnormal) + path)
    expect(abnormal.locator("main tbody .a-open").first).to_be_visible()
    assert abnormal.evaluate(UNSAID) == []
    abnormal.emulate_media(media="screen")


@pytest.mark.parametrize(("machine", "rows"), [("m1", 7), ("a1", 6)])
def test_a_sheet_of_paper_has_the_whole_screen_of_a_drive(abnormal: Page, machine: str, rows: int) -> None:
    """In the width of A4, which is that of a panel on which one half of it is chosen."""
    abnormal.emulate_media(media="print")
    abnormal.set_viewport_size({"width": 718, "height": 1000})
    abnormal.goto(f"{origin(abnormal)}/equipment/{machine}")
    expect(abnormal.locator(".m-part")).to_be_hidden()
    expect(abnormal.locator(".m-trend")).to_be_visible()
    expect(abnormal.locator(".vals tbody tr >> visible=true")).to_have_count(rows)
    expect(abnormal.locator(".m-state")).to_be_visible()
    assert abnormal.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth") <= 0
    abnormal.emulate_media(media="screen")


@pytest.mark.parametrize("path", ["/equipment/m1/parameters", "/equipment/a1/drive-parameters", "/audit"])
def test_a_sheet_of_paper_has_the_table_whole_and_says_of_which_plant_and_when(abnormal: Page, path: str) -> None:
    """In the width of A4, and without what one presses, chooses or searches with."""
    abnormal.emulate_media(media="print")
    abnormal.set_viewport_size({"width": 718, "height": 1000})
    abnormal.goto(origin(abnormal) + path)
    for shown in (".head [data-clock]", ".head [data-date]", ".crumbs > a >> nth=0", "main tbody tr td >> nth=1"):
        expect(abnormal.locator(shown)).to_be_visible()
    assert abnormal.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth") <= 0
    if "parameters" in path:
        for shown in (".par .p-range >> nth=2", ".par .p-def >> nth=2"):
            expect(abnormal.locator(shown)).to_be_visible()
        expect(
            abnormal.locator("main :is(.p-nav, [type=search], .dp-show, .p-edit, .dp-change) >> visible=true")
        ).to_have_count(0)
    abnormal.emulate_media(media="screen")


@pytest.mark.parametrize("lang", LANGUAGES)
def test_a_sheet_of_paper_has_all_that_was_read_of_a_drive(abnormal: Page, lang: str) -> None:
    """With when each value was read, and the longest names of it."""
    page = abnormal
    speak(page, lang, origin(page))
    found: list[str] = []
    for machine in ("m1", "a1"):
        page.emulate_media(media="screen")
        page.set_viewport_size({"width": 1280, "height": 800})
        open_page(page, f"{origin(page)}/equipment/{machine}/drive-parameters")
        if not page.locator(".dp-time", has_text=":").count():
            page.locator(".dp-read button:not([name=cancel])").last.click()
            expect(page.locator(".dp-time", has_text=":").first).to_be_attached(timeout=60_000)
            expect(page.locator(".dp-read [name=cancel]")).to_have_count(0, timeout=120_000)
        page.emulate_media(media="print")
        page.set_viewport_size({"width": 718, "height": 1000})
        open_page(page, f"{origin(page)}/equipment/{machine}/drive-parameters")
        expect(page.locator(".dp-time", has_text=":").first).to_be_visible()
        wide = page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth")
        found += [f"{machine}: {wide} px too wide" for _ in range(wide > 0)]
        found += [f"{machine}: {one}" for one in page.evaluate(FAULTS) if "broken word" in one or "beyond" in one]
    page.emulate_media(media="screen")
    assert found == [], "\n".join(["", *found])
