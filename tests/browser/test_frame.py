"""The frame in a real browser: what htmx may not do, the message line, menus, sizes, and the looks of a lost connection."""

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Literal

import pytest
from playwright.sync_api import Browser, Page, Route, expect

from tests.browser.station import AXE, SIZES, serving, small
from tests.conftest import PogonServer

EVIL = """<b id="in" hx-on:click="window.bad = 1" data-hx-on:click="window.bad = 2"
  hx-get="/never" hx-trigger="dblclick[window.bad = 5]" hx-vals="js:{x: window.bad = 6}">here</b>
<script>window.bad = 4</script><script src="/evil.js"></script>
<svg><script>window.bad = 8</script></svg>"""
ASK = """url => {
  document.getElementById('overlay').innerHTML = '<button id="ask" hx-target="#place">ask</button><div id="place">before</div>';
  document.getElementById('ask').setAttribute('hx-get', url);
  htmx.process(document.getElementById('overlay'));
}"""


@pytest.fixture
def server(demo: PogonServer) -> PogonServer:
    return demo


@pytest.fixture(params=[False, True], ids=["with the policy", "without the policy"])
def visitor(browser: Browser, server: PogonServer, request: pytest.FixtureRequest) -> Iterator[Page]:
    """A page of an English browser; once with the content policy, once as if it were not there: htmx alone must hold too."""
    context = browser.new_context(bypass_csp=request.param, locale="en-GB", viewport={"width": 1280, "height": 800})
    context.add_cookies([{"name": "pogon_lang", "value": "en", "url": server.url}])
    yield context.new_page()
    context.close()


def test_chromium_reaches_a_pogon(page: Page, server: PogonServer) -> None:
    """Before any page of ours: whether the browser of this machine starts, scripts, and reaches a server."""
    answer = page.goto(f"{server.url}/healthz")
    assert answer is not None and answer.status == 200
    assert page.evaluate("1 + 1") == 2


def test_a_fragment_brings_no_program_along(visitor: Page, server: PogonServer) -> None:
    fetched: list[str] = []
    visitor.route("**/evil", lambda route: route.fulfill(body=EVIL, content_type="text/html"))
    visitor.route("**/evil.js", lambda route: (fetched.append(route.request.url), route.fulfill(body="window.bad = 9")))
    visitor.goto(server.url)
    visitor.evaluate(ASK, "/evil")
    visitor.click("#ask")
    expect(visitor.locator("#in")).to_have_text("here")
    visitor.click("#in")
    visitor.dblclick("#in")
    visitor.wait_for_timeout(200)
    assert visitor.evaluate("window.bad") is None
    assert visitor.locator("#place script").count() == 0
    assert fetched == []


def test_the_policy_stops_programs_in_attributes(page: Page, server: PogonServer) -> None:
    page.goto(server.url)
    page.evaluate(
        "document.getElementById('overlay').innerHTML = '<b id=in onclick=\"window.bad = 1\">x</b><img src=x onerror=\"window.bad = 2\">'"
    )
    page.click("#in")
    assert page.evaluate("window.bad") is None


def test_htmx_asks_no_other_server(page: Page, server: PogonServer) -> None:
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.goto(server.url)
    page.evaluate(ASK, "http://localhost:9/elsewhere")
    page.click("#ask")
    page.wait_for_timeout(200)
    assert not [url for url in asked if "elsewhere" in url]
    expect(page.locator("#place")).to_have_text("before")


@pytest.mark.parametrize("status", [400, 403, 404, 409, 422, 500, 503])
def test_an_error_is_said_in_the_message_line_and_replaces_nothing(
    page: Page, server: PogonServer, status: int
) -> None:
    body = "<p data-message>Missing: <script>window.bad = 1</script>&lt;b&gt;</p>"
    page.route("**/refused", lambda route: route.fulfill(status=status, body=body, content_type="text/html"))
    page.goto(server.url)
    page.evaluate(ASK, "/refused")
    page.click("#ask")
    expect(page.locator("#message")).to_contain_text("Missing: ")
    expect(page.locator("#message")).to_contain_text("<b>")
    expect(page.locator("#message")).to_have_attribute("data-kind", "error")
    expect(page.locator("#place")).to_have_text("before")
    assert page.evaluate("window.bad") is None


def test_a_server_that_does_not_answer_is_said_too(visitor: Page, server: PogonServer) -> None:
    visitor.route("**/gone", lambda route: route.abort())
    visitor.goto(server.url)
    visitor.evaluate(ASK, "/gone")
    visitor.click("#ask")
    expect(visitor.locator("#message")).to_contain_text("No answer from the server")
    expect(visitor.locator("#place")).to_have_text("before")


def test_a_slow_answer_is_waited_for_in_words(page: Page, server: PogonServer) -> None:
    """Whatever was pressed; what the page fetches by itself is not told."""
    held: list[Route] = []
    page.route("**/slow", lambda route: held.append(route))
    page.goto(server.url)
    page.evaluate(ASK, "/slow")
    expect(page.locator(".waits")).to_be_hidden()
    page.locator("#ask").dispatch_event("click")
    expect(page.locator(".waits")).to_be_visible()
    held.pop().fulfill(body="after", content_type="text/html")
    expect(page.locator("#place")).to_have_text("after")
    expect(page.locator(".waits")).to_be_hidden()
    page.locator("#ask").evaluate("button => { button.dataset.renewed = 'part'; button.click(); }")
    expect(page.locator("#ask")).to_have_class("htmx-request")
    expect(page.locator(".waits")).to_be_hidden()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_drawing_is_read_in_the_colours_of_the_reader(
    browser: Browser, server: PogonServer, scheme: Literal["light", "dark"]
) -> None:
    """Colours that the system forces have the ground of the system, whatever theme was chosen here."""
    context = browser.new_context(forced_colors="active", color_scheme=scheme)
    context.add_cookies([{"name": "pogon_theme", "value": "light" if scheme == "dark" else "dark", "url": server.url}])
    page = context.new_page()
    page.goto(f"{server.url}/equipment/m1")
    fills = page.evaluate(
        "[...document.querySelectorAll('main svg text')].filter((e) => e.checkVisibility()).map((e) => getComputedStyle(e).fill)"
    )
    text = page.evaluate("getComputedStyle(document.querySelector('main h2')).color")
    assert fills and set(fills) <= {text}, (fills, text)
    context.close()


def test_the_language_changes_in_place_and_keeps_what_was_typed(page: Page, server: PogonServer) -> None:
    page.goto(f"{server.url}/equipment/m1?from=2#commands")
    page.wait_for_load_state("networkidle")  # the column of commands may be fetched anew right after the page
    field = page.locator("[name=argument]").first
    field.evaluate("field => field.readOnly = false")
    field.fill("33,3")
    page.click(".lang > summary")
    page.click(".lang button[value=cs]")
    expect(page.locator("html")).to_have_attribute("lang", "cs")
    assert page.url == f"{server.url}/equipment/m1?from=2#commands"
    expect(page.locator("[name=argument]").first).to_have_value("33,3")
    page.reload()
    expect(page.locator("[name=argument]").first).not_to_have_value("33,3")


def test_menus_work_without_scripts_and_close_with_escape(browser: Browser, page: Page, server: PogonServer) -> None:
    plain = browser.new_context(java_script_enabled=False, locale="en-GB").new_page()
    plain.goto(server.url)
    plain.click(".theme > summary")
    plain.click(".theme button[value=dark]")
    assert plain.locator("html").get_attribute("data-theme") == "dark"
    plain.context.close()
    page.goto(server.url)
    page.click(".lang > summary")
    expect(page.locator(".lang .menu")).to_be_visible()
    page.keyboard.press("Escape")
    expect(page.locator(".lang .menu")).to_be_hidden()
    page.click(".lang > summary")
    page.click("main", position={"x": 5, "y": 400})
    expect(page.locator(".lang .menu")).to_be_hidden()


def test_the_letters_are_ours_and_nothing_moves_when_they_come(page: Page, server: PogonServer) -> None:
    page.goto(f"{server.url}/equipment/m1")
    page.evaluate("document.fonts.ready.then(() => 1)")
    faces = page.evaluate(
        "[...document.fonts].filter(f => f.status === 'loaded').map(f => f.family.replaceAll('\"', ''))"
    )
    assert faces.count("Pogon") >= 2
    wire = page.context.new_cdp_session(page)
    wire.send("DOM.enable")
    wire.send("CSS.enable")
    root = wire.send("DOM.getDocument")["root"]["nodeId"]
    for one in ("h1", ".clock b", ".cmd", "main .val", "main .val i", ".count b"):
        for node in wire.send("DOM.querySelectorAll", {"nodeId": root, "selector": one})["nodeIds"]:
            used = wire.send("CSS.getPlatformFontsForNode", {"nodeId": node})["fonts"]
            assert {font["isCustomFont"] for font in used} <= {True}, (one, used)
    wire.detach()


def test_a_lost_server_is_seen_and_heard_of_again(
    page: Page, pogon_server: Callable[..., PogonServer], tmp_path: Path
) -> None:
    server = pogon_server(plant=small(tmp_path, "m1") / "plant")
    page.context.add_cookies([{"name": "pogon_lang", "value": "en", "url": server.url}])
    page.goto(f"{server.url}/equipment/m1")
    expect(page.locator("body")).to_have_attribute("data-live", "live")
    expect(page.locator(".offline")).to_be_hidden()
    server.kill()
    expect(page.locator("body")).to_have_attribute("data-live", "offline", timeout=5000)
    expect(page.locator(".offline")).to_be_visible()
    expect(page.locator("[data-offline-age]")).to_have_text("5\u00a0s", timeout=4000)
    expect(page.locator("#message")).to_contain_text("all values are stale")
    expect(page.locator(".live [data-when=offline]")).to_be_visible()
    assert page.locator(".content .panel").first.evaluate("e => getComputedStyle(e).borderTopStyle") == "dashed"
    assert page.evaluate("document.documentElement.scrollWidth") <= 1280


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_the_frame_has_no_barrier(page: Page, server: PogonServer, theme: str) -> None:
    page.context.add_cookies([{"name": "pogon_theme", "value": theme, "url": server.url}])
    for path in ("/", "/equipment/m1", "/nowhere"):
        page.goto(server.url + path)
        expect(page.locator("body")).to_have_attribute("data-live", "live")
        page.click(".lang > summary")
        page.evaluate(AXE.read_text("utf-8"))
        found = page.evaluate("axe.run({resultTypes: ['violations']})")["violations"]
        assert [(rule["id"], node["html"][:120]) for rule in found for node in rule["nodes"]] == [], path


def test_a_keyboard_reaches_content_alarms_and_commands_first(page: Page, server: PogonServer) -> None:
    page.goto(f"{server.url}/equipment/m1")
    targets = []
    for _ in range(3):
        page.keyboard.press("Tab")
        targets.append(page.evaluate("document.activeElement.getAttribute('href')"))
        assert page.evaluate("document.activeElement.getBoundingClientRect().top") >= 0
    assert targets == ["#content", "#alarms", "#commands"]
    page.keyboard.press("Enter")
    assert page.evaluate("document.activeElement.id") == "commands"


def test_a_panel_without_tabs_has_a_menu_of_them(page: Page, server: PogonServer) -> None:
    page.set_viewport_size({"width": 800, "height": 480})
    page.goto(server.url)
    expect(page.locator(".tabs")).to_be_hidden()
    page.click(".places summary")
    for link in page.locator(".places .menu a").all():
        expect(link).to_be_in_viewport(ratio=1)
    page.click(".places a[href='/alarms']")
    expect(page).to_have_url(f"{server.url}/alarms")


def test_where_one_is_can_be_read_however_long_the_name_of_the_plant_is(page: Page, server: PogonServer) -> None:
    page.goto(f"{server.url}/equipment/m1/parameters")
    page.locator(".crumbs > a span").first.evaluate(
        "crumb => { crumb.textContent = 'A very long name of a plant '.repeat(6); }"
    )
    for width, height in SIZES.values():
        page.set_viewport_size({"width": width, "height": height})
        assert page.locator(".crumbs h1").evaluate("h1 => h1.scrollWidth <= h1.clientWidth"), width
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth"), width


def test_a_curve_of_a_tile_is_pressed_where_it_is_seen_and_reached_nowhere_else(
    page: Page, server: PogonServer
) -> None:
    page.goto(server.url)
    for name, (width, height) in SIZES.items():
        page.set_viewport_size({"width": width, "height": height})
        curves = page.locator(".ov .spark-a:visible, .ov .spark-a:focus-within")
        assert (curves.count() > 0) == (name == "panel"), name
        assert page.locator(".ov .spark-a").evaluate_all(
            "all => all.every((one) => !one.checkVisibility() || one.offsetHeight > 20)"
        )
    page.set_viewport_size({"width": 1280, "height": 800})
    page.locator(".ov .spark-a").first.click()
    expect(page).to_have_url(re.compile("/trends"))


def test_a_plant_that_cannot_start_shows_each_mistake_whole(page: Page, tmp_path: Path) -> None:
    """Also where there is only one: the row is what the page is for."""
    (small(tmp_path, "m1") / "plant" / "plant.toml").write_text(
        (tmp_path / "plant" / "plant.toml").read_text("utf-8").replace('"eura_e800"', '"eura_e900"'), "utf-8"
    )
    with serving(tmp_path, people={}) as server:
        for width, height in SIZES.values():
            page.set_viewport_size({"width": width, "height": height})
            page.goto(server.url)
            row = page.locator(".problems tbody tr").first
            expect(row).to_contain_text("eura_e900")
            table = page.locator(".problems")
            assert table.evaluate("box => box.clientHeight >= box.firstElementChild.offsetHeight"), (width, height)


def test_the_overview_asks_once_for_the_reasons_of_all_its_tiles(page: Page, server: PogonServer) -> None:
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url.removeprefix(server.url)))
    page.goto(server.url)
    lines = page.locator("[id^=why-]")
    assert lines.count() > 1
    page.wait_for_timeout(1500)  # the socket has brought what there is, and it is what the page was made with
    assert not [one for one in asked if one.endswith("/part/why")]
    lines.evaluate_all("lines => lines.forEach(line => { line.textContent = 'of old'; })")
    expect(lines.filter(has_text="of old")).to_have_count(0, timeout=8000)
    assert "/why" in asked
