"""The live script: it writes what the server would draw, keeps nine tabs live, and says so when the server is gone."""

import json
import os
import random
import re
import signal
import threading
import time
from collections.abc import Callable, Iterator
from functools import partial
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from mimetypes import guess_type
from pathlib import Path
from typing import Any
from zoneinfo import ZoneInfo

import pytest
from playwright.sync_api import Browser, BrowserContext, Page, Route, WebSocketRoute, expect

from app import bundled
from app.clock import ManualClock
from app.plant.loader import read_plant
from app.plant.texts import Texts
from app.tags import quality as q
from app.tags.batch import Batch, Value
from app.tags.database import Tag, TagDatabase
from app.tags.quality import Origin
from app.web import format as fmt
from app.web.assets import Assets
from app.web.points import EquipmentView, live_texts
from app.web.view import View
from tests.browser.station import LANGUAGES, LOOKS, PLACE, small
from tests.conftest import PogonServer

STATES = {
    "good": q.GOOD,
    "uncertain": q.OUT_OF_RANGE,
    "bad": q.COMM_FAILURE,
    "stale": q.STALE,
    "none": q.NO_DATA,
    "manual": q.GOOD | Origin.SUBSTITUTED,
    "forced": q.GOOD | Origin.FORCED,
    "simulated": q.GOOD | Origin.SIMULATED,
}
CONTENT = """
{% from "macros/value.html" import value, plain %}{% from "macros/indicators.html" import gauge, mai, spark, shown, worn %}
{% from "screens/eura_e800/symbol.html" import motor %}{% from "macros/drive.html" import values with context %}
<main id="content" class="content">
{% set status, setpoint = equipment.status, equipment.frequency_setpoint %}
<p>{{ value(equipment.speed, "hero bare", unit=false) }} {{ value(equipment.speed, "boxed") }}</p>
<p>{{ value(equipment.current) }} {{ value(setpoint, "key sp") }}</p>
<p>{{ plain(status, silent=true) }} {{ plain(status, hexadecimal=true) }}</p>
<p>{{ plain(equipment.state_since, pattern=_("live.since")) }} {{ motor(equipment) }}</p>
<p>{{ gauge(equipment.speed, [(setpoint, 30, status, "0,1"), (setpoint, -30, status, "2")]) }}</p>
<p><b data-tag="{{ status.name }}" data-class="d-unknown:bad;d-old:uncertain"
  class="d-body{{ worn(status, 'd-unknown', 'bad') }}{{ worn(status, 'd-old', 'uncertain') }}"></b></p>
{{ values(equipment, ["speed", "frequency", "current", "voltage", "power", "torque", "heatsink_temperature"], {"frequency": setpoint}) }}
</main>
"""
SHEETS = (
    *(f"css/{name}" for name in ("tokens", "base", "panel", "value", "indicators", "tables", "plot", "offline")),
    "css/screens/drive",
)


class Hall:
    """A plant whose values only a test moves; it renders like the server and speaks like its socket."""

    def __init__(self) -> None:
        plant, problems = read_plant(bundled("plants/demo"))
        assert plant is not None, problems
        self.plant = plant
        self.clock = ManualClock()
        self.texts = Texts.read(plant)
        self.tags = TagDatabase(self.clock)
        self.machine = plant.equipment["m1"]
        self.tags.configure(
            Tag(point.name, point.id, "hall", stale_after=2.0) for point in self.machine.points.values()
        )
        self.view = View(Assets(bundled("static")))

    def publish(self, values: dict[str, Value], quality: int = q.GOOD) -> None:
        now = self.clock.micros()
        handles = [self.tags.handle(f"m1.{key}") for key in values]
        self.tags.publish(Batch("hall", 0, now, now, handles, list(values.values()), quality))

    def publish_all(self, quality: int, value: Callable[[str], Value]) -> None:
        self.publish({key: value(key) for key in self.machine.points}, quality)

    def page(self, lang: str) -> str:
        text = partial(self.texts.text, lang)
        machine = EquipmentView(self.machine, self, lang, text)
        content = self.view._environment(self.texts, lang).from_string(CONTENT).render(equipment=machine)
        links = "".join(f'<link rel="stylesheet" href="/static/{name}.css">' for name in SHEETS)
        texts = json.dumps(live_texts(text)).replace("&", "&amp;").replace('"', "&quot;")
        return (
            f'<!doctype html><html lang="{lang}" data-theme="light"><head><meta charset="utf-8">{links}</head><body data-live="delayed">'
            f'{content}<div id="live" hidden data-kind="equipment/m1" data-rev="1" data-build="b" data-lang="{lang}" '
            f'data-zone="{self.plant.timezone}" data-texts="{texts}"></div>'
            '<script type="module" src="/static/js/live.js"></script></body></html>'
        )

    def hello(self, rev: int = 1) -> str:
        return json.dumps(
            {"hello": {"kind": "equipment/m1", "rev": rev, "handles": dict(self.tags.handles), "build": "b"}}
        )

    def frame(self, number: int, *, full: bool = True, keys: tuple[str, ...] = (), rev: int = 1) -> str:
        handles = range(len(self.tags)) if full else [self.tags.handle(f"m1.{key}") for key in keys]
        values = [[handle, self.tags.value(handle), self.tags.quality(handle)] for handle in handles]
        frame: dict[str, object] = {"rev": rev, "n": number, "t": self.clock.micros(), "v": values}
        return json.dumps(frame | ({"full": True} if full else {}))


class Wire:
    """The server's end of the socket of one page."""

    def __init__(self) -> None:
        self.sockets: list[WebSocketRoute] = []
        self.heard: list[dict[str, Any]] = []

    def send(self, text: str) -> None:
        self.sockets[-1].send(text)

    def asked(self, key: str) -> int:
        return sum(key in message for message in self.heard)


class Site:
    """A web server with the product's static files, which a browser keeps, and the one page that a test gives it."""

    def __init__(self) -> None:
        self.page: Callable[[], str] = str
        site = self

        class Answer(BaseHTTPRequestHandler):
            protocol_version = "HTTP/1.1"

            def do_GET(self) -> None:
                static = self.path.startswith("/static/")
                name = re.sub(r"\.[0-9a-f]{12}(?=\.\w+$)", "", self.path.removeprefix("/static/"))
                body = (bundled("static") / name).read_bytes() if static else site.page().encode()
                self.send_response(200)
                kind = guess_type(name)[0] or "application/octet-stream" if static else "text/html; charset=utf-8"
                self.send_header("Content-Type", kind)
                self.send_header("Content-Length", str(len(body)))
                self.send_header("Cache-Control", "max-age=3600" if static else "no-store")
                self.end_headers()
                self.wfile.write(body)

            def log_message(self, *_: object) -> None:
                pass

        self.server = ThreadingHTTPServer(("127.0.0.1", 0), Answer)
        self.server.daemon_threads = True
        self.address = f"http://127.0.0.1:{self.server.server_port}"


@pytest.fixture(scope="module")
def site() -> Iterator[Site]:
    site = Site()
    thread = threading.Thread(target=site.server.serve_forever)
    thread.start()
    yield site
    site.server.shutdown()
    thread.join()
    site.server.server_close()


@pytest.fixture(scope="module")
def place(browser: Browser) -> Iterator[BrowserContext]:
    """A browser for all tests of this module: what it has loaded once it keeps."""
    context = browser.new_context(**PLACE, **LOOKS)
    yield context
    context.close()


@pytest.fixture
def page(place: BrowserContext) -> Iterator[Page]:
    """A page of its own: what a test puts in the place of its socket stays with it."""
    page = place.new_page()
    yield page
    page.close()


@pytest.fixture
def hall() -> Hall:
    return Hall()


@pytest.fixture
def opened(page: Page, hall: Hall, site: Site) -> Callable[..., Wire]:
    """Open the page of `hall` in a language; its socket is the returned wire, which says nothing by itself but hello."""

    def start(lang: str = "en", *, greet: bool = True) -> Wire:
        wire = Wire()

        def speak(socket: WebSocketRoute) -> None:
            wire.sockets.append(socket)

            def hear(message: str | bytes) -> None:
                wire.heard.append(json.loads(message))
                if greet and "subscribe" in wire.heard[-1]:
                    socket.send(hall.hello())

            socket.on_message(hear)

        site.page = partial(hall.page, lang)
        page.route_web_socket("**/live", speak)
        page.goto(f"{site.address}/equipment/m1")
        wait_for(page, lambda: wire.asked("subscribe") > 0)
        return wire

    return start


def wait_for(page: Page, truth: Callable[[], bool], seconds: float = 5) -> None:
    until = time.monotonic() + seconds
    while not truth():
        assert time.monotonic() < until, "it did not come"
        page.wait_for_timeout(20)


TIMES = """() => {
    window.times = {};
    document.addEventListener("pogon:live", ({ detail }) => { window.times[detail] = Date.now(); });
}"""
"""Keeps when the state of the connection changed [ms]."""


def live(page: Page, state: str = "live", seconds: float = 5) -> None:
    expect(page.locator(f"body[data-live={state}]")).to_be_attached(timeout=seconds * 1000)


# ---- one text on both sides -----------------------------------------------------------------------------------


@pytest.mark.parametrize("lang", LANGUAGES)
def test_script_and_server_write_every_number_alike(page: Page, opened: Callable[..., Wire], lang: str) -> None:
    opened(lang)
    dice = random.Random(4)
    numbers: list[float] = [
        0.0,
        -0.0,
        1e21,
        -1e21,
        5e-324,
        1.7e308,
        999.5,
        9.995,
        0.05,
        -0.05,
        1.005,
        2.675,
        1e15,
        123456789.5,
        2.0**53,
        2.0**53 + 2,
        -(2.0**63),
        9.9999999e20,
    ]
    numbers += [dice.uniform(-10, 10) * 10.0 ** dice.randint(15, 307) for _ in range(500)]
    numbers += [dice.uniform(-10, 10) ** dice.randint(1, 9) for _ in range(1500)]
    numbers += [dice.randint(-20000, 20000) / 8 for _ in range(500)] + [
        dice.randint(-9999, 9999) / 1000 for _ in range(500)
    ]
    numbers += [float(dice.randint(-(10**9), 10**9)) for _ in range(300)] + [
        dice.randint(0, 65535) * 0.01 for _ in range(500)
    ]
    script = """async ([numbers, lang]) => {
        const format = await import("/static/js/format.js");
        return numbers.map((number) => [0, 1, 2, 3].map((decimals) => format.number(number, decimals, lang)));
    }"""
    written = page.evaluate(script, [numbers, lang])
    for number, texts in zip(numbers, written, strict=True):
        assert texts == [fmt.number(number, decimals, lang) for decimals in range(4)], repr(number)


def test_script_and_server_write_times_ages_and_durations_alike(page: Page, opened: Callable[..., Wire]) -> None:
    opened()
    dice = random.Random(5)
    now = 1_772_000_000_000_000
    moments = [now + dice.randint(-(4 * 10**13), 4 * 10**13) for _ in range(600)]
    for change in (1_792_890_000, 1_774_746_000, 1_743_296_400):  # the clock goes back, forward, forward
        moments += [(change + dice.randint(-9000, 9000)) * 1_000_000 + dice.randint(0, 999_999) for _ in range(200)]
    spans = [dice.random() * 10 ** dice.randint(0, 7) for _ in range(800)] + [
        9.94,
        9.95,
        9.96,
        59.4,
        59.5,
        59.6,
        3599.5,
        86399.5,
    ]
    zones = ("Europe/Zagreb", "UTC", "Australia/Lord_Howe", "America/St_Johns")
    script = """async ([moments, spans, zones, now]) => {
        const f = await import("/static/js/format.js");
        return {
            moments: zones.map((zone) => moments.map((at) => ["hr", "en"].flatMap((lang) => [
                f.clockTime(at, zone), f.clockTime(at, zone, { seconds: false }), f.date(at, zone, lang),
                f.dateTime(at, zone, lang, now), f.momentOrTime(at, zone, lang, now)]))),
            spans: spans.map((s) => [f.age(s), f.duration(s, "de"), f.duration(s, "en"), f.quantity(s, 1, "%", "cs")]),
            hex: [0, 1, 0x337, 65535].map((word) => f.hexadecimal(word)),
        };
    }"""
    written = page.evaluate(script, [moments, spans, zones, now])
    for name, rows in zip(zones, written["moments"], strict=True):
        zone = ZoneInfo(name)
        for at, row in zip(moments, rows, strict=True):
            assert row == [
                text
                for lang in ("hr", "en")
                for text in (
                    fmt.clock_time(at, zone),
                    fmt.clock_time(at, zone, seconds=False),
                    fmt.date(at, zone, lang),
                    fmt.date_time(at, zone, lang, now),
                    fmt.moment_or_time(at, zone, lang, now),
                )
            ], (name, at)
    for span, row in zip(spans, written["spans"], strict=True):
        assert row == [fmt.age(span), fmt.duration(span, "de"), fmt.duration(span, "en"), fmt.percent(span, 1, "cs")], (
            span
        )
    assert written["hex"] == [fmt.hexadecimal(word) for word in (0, 1, 0x337, 65535)]


PICTURE = """(root) => [...root.querySelectorAll("[data-tag]")].map((element) => {
    const place = (element.style.transform || element.getAttribute("transform") || "").match(/-?[\\d.]+/g)?.map(Number) ?? [];
    const turn = element.dataset.turn !== undefined, y = element.dataset.move === "y";
    const at = !place.length ? null : turn ? (element.style.transform ? place[2] : place[0]) : y ? place[1] : place[0];
    const value = root.querySelector(`.val[data-tag="${element.dataset.tag}"]`);
    const usable = !["bad", "none"].includes(value?.dataset.q);
    const attributes = ["data-q", "data-src", "class", "display", "aria-label", "aria-valuenow", "aria-valuetext"];
    return [element.dataset.tag, element.localName, element.dataset.line !== undefined ? null : element.textContent, usable ? at : null,
        ...attributes.map((name) => element.getAttribute(name))];
})"""


@pytest.mark.parametrize("lang", LANGUAGES)
def test_what_the_script_draws_is_what_the_server_draws(
    page: Page, hall: Hall, opened: Callable[..., Wire], lang: str
) -> None:
    """In every state, which comes after a good value each time; the first one after a page to which nothing was sent."""
    wire = opened(lang)
    for number, (state, quality) in enumerate({**STATES, "misplaced": q.CONFIGURATION}.items()):
        hall.publish_all(q.GOOD, lambda key: 1)
        wire.send(hall.frame(2 * number + 1))
        live(page)
        now = hall.clock.micros()
        special: dict[str, Value] = {
            "status": 2,
            "state_since": now - 90_000_000,
            "speed": -1180.4,
            "frequency_setpoint": 40.0,
        }
        value = (lambda key: None) if state == "none" else (lambda key, special=special: special.get(key, 31.237))
        hall.publish_all(quality, value)
        if state == "stale":  # becomes so by time, 2 s after it was seen last
            hall.publish_all(q.GOOD, value)
            hall.clock.advance(2.05)
            hall.tags.sweep()
        wire.send(hall.frame(2 * number + 2))
        page.wait_for_timeout(300)
        drawn = page.evaluate(f"({PICTURE})(document)")
        server = page.evaluate(
            f"(html) => ({PICTURE})(new DOMParser().parseFromString(html, 'text/html'))", hall.page(lang)
        )
        assert len(drawn) > 40
        for mine, theirs in zip(drawn, server, strict=True):
            assert mine == theirs, state


OWN_WORDS = """() => { // the same words beside it, which say something of their own
  const own = document.querySelector("main [data-silent]").cloneNode();
  own.id = "own";
  delete own.dataset.silent;
  document.querySelector("main").append(own);
  document.dispatchEvent(new Event("pogon:drawn")); }"""


def test_only_what_stands_for_silence_says_that_another_device_answers(
    page: Page, hall: Hall, opened: Callable[..., Wire]
) -> None:
    """Whatever else is said in the same words stays."""
    wire = opened("en")
    page.evaluate(OWN_WORDS)
    hall.publish_all(q.CONFIGURATION, lambda key: 1)
    wire.send(hall.frame(1))
    live(page)
    expect(page.locator("main [data-silent]").first).to_have_text("Wrong configuration")
    expect(page.locator("#own")).to_have_text("No communication")


def test_an_unlisted_value_and_one_out_of_scale_are_drawn_alike_too(
    page: Page, hall: Hall, opened: Callable[..., Wire]
) -> None:
    wire = opened("de")
    hall.publish_all(q.GOOD, lambda key: 99999.5)
    wire.send(hall.frame(1))
    live(page)
    page.wait_for_timeout(200)
    assert page.evaluate(f"({PICTURE})(document)") == page.evaluate(
        f"(html) => ({PICTURE})(new DOMParser().parseFromString(html, 'text/html'))", hall.page("de")
    )
    assert "Unbekannt (99999.5)" in page.inner_text("main")


def test_all_qualities_look_different(page: Page, hall: Hall, opened: Callable[..., Wire]) -> None:
    wire = opened()
    looks: dict[str, bytes] = {}
    for number, (state, quality) in enumerate(STATES.items(), 1):
        hall.publish({"speed": None if state == "none" else 1180.0}, quality)
        wire.send(hall.frame(number))
        live(page)
        page.wait_for_timeout(250)
        looks[state] = page.locator(".val.boxed").first.screenshot()
    assert len(set(looks.values())) == len(STATES)


@pytest.mark.parametrize("quality", [q.HALTED, q.STALE, q.OUT_OF_RANGE])
def test_a_word_that_nobody_vouches_for_is_marked_and_what_the_server_made_of_it_is_made_anew(
    page: Page, hall: Hall, opened: Callable[..., Wire], quality: int
) -> None:
    """As a number in its box is; a PLC that stands still goes on telling what it computed last."""
    wire = opened()
    after = "(element) => getComputedStyle(element, '::after').content"
    word = page.locator("main p > span[data-tag='m1.status']").first
    page.evaluate("""() => {
        const part = document.createElement("i");
        Object.assign(part.dataset, { tags: "m1.status", revision: "" });
        document.querySelector("main").append(part);
        part.addEventListener("changed", () => { part.dataset.heard = Number(part.dataset.heard ?? 0) + 1; });
        document.dispatchEvent(new Event("pogon:drawn"));
    }""")
    wait_for(page, lambda: wire.asked("subscribe") > 0)
    heard = page.locator("i[data-heard]")
    hall.publish_all(q.GOOD, lambda key: 1)
    wire.send(hall.frame(1))
    live(page)
    expect(word).to_have_text("Running forward")
    assert word.evaluate(after) == "none"
    before = int(heard.get_attribute("data-heard") or 0)
    hall.publish_all(quality, lambda key: 1)
    wire.send(hall.frame(2))
    expect(word).to_have_attribute("data-q", "stale" if quality == q.STALE else "uncertain")
    assert word.evaluate(after) == '"?"'
    expect(heard).to_have_attribute("data-heard", str(before + 1))


def test_a_bad_value_leaves_no_number_on_the_page(page: Page, hall: Hall, opened: Callable[..., Wire]) -> None:
    wire = opened()
    hall.publish_all(q.GOOD, lambda key: 1234.0)
    wire.send(hall.frame(1))
    live(page)
    expect(page.locator(".val.hero b")).to_have_text("1\u202f234")
    hall.publish_all(q.COMM_FAILURE, lambda key: 1234.0)
    wire.send(hall.frame(2))
    expect(page.locator(".val.hero b")).to_have_text("----")
    assert "1\u202f234" not in page.inner_text(".vals tbody")
    expect(page.locator(".mai-ptr").first).to_be_hidden()
    expect(page.locator("main")).to_contain_text("No communication")
    hall.publish_all(q.CONFIGURATION, lambda key: 1234.0)
    wire.send(hall.frame(3))
    expect(page.locator("main")).to_contain_text("Wrong configuration")
    expect(page.locator("main")).not_to_contain_text("No communication")


def test_a_setpoint_that_is_not_known_has_no_place_on_a_scale(
    page: Page, hall: Hall, opened: Callable[..., Wire]
) -> None:
    """While what is measured beside it is good; neither at the beginning of the scale nor where it was last."""
    wire = opened()
    place = page.locator(".mai-sp, .gauge-sp:visible")
    expect(page.locator(".mai-sp")).to_have_count(1)
    expect(place.locator("visible=true")).to_have_count(0)
    hall.publish_all(q.GOOD, lambda key: 1)
    wire.send(hall.frame(1))
    live(page)
    expect(place.locator("visible=true")).to_have_count(2)
    hall.publish({"frequency_setpoint": 40.0}, q.COMM_FAILURE)
    wire.send(hall.frame(2))
    expect(place.locator("visible=true")).to_have_count(0)


def test_the_age_of_a_stale_value_counts_in_the_browser(page: Page, hall: Hall, opened: Callable[..., Wire]) -> None:
    wire = opened()
    hall.publish({"speed": 1180.0})
    hall.clock.advance(2.05)
    hall.tags.sweep()
    wire.send(hall.frame(1))
    badge = page.locator(".val.boxed .badge").first
    expect(badge).to_have_text("2\u00a0s")
    for number in range(2, 5):
        page.wait_for_timeout(700)
        wire.send(hall.frame(number, full=False))
    expect(badge).to_have_text("4\u00a0s", timeout=2000)


# ---- the wire -------------------------------------------------------------------------------------------------


def test_a_gap_in_the_numbers_asks_for_a_snapshot_and_shows_nothing_until_it_comes(
    page: Page, hall: Hall, opened: Callable[..., Wire]
) -> None:
    wire = opened()
    hall.publish({"speed": 10.0})
    wire.send(hall.frame(1))
    expect(page.locator(".val.hero b")).to_have_text("10")
    hall.publish({"speed": 20.0})
    wire.send(hall.frame(3, full=False, keys=("speed",)))
    wait_for(page, lambda: wire.asked("snapshot") == 1)
    page.wait_for_timeout(300)
    assert page.inner_text(".val.hero b") == "10"
    wire.send(hall.frame(3))
    expect(page.locator(".val.hero b")).to_have_text("20")
    hall.publish({"speed": 30.0})
    wire.send(hall.frame(4, full=False, keys=("speed",)))
    expect(page.locator(".val.hero b")).to_have_text("30")
    assert wire.asked("snapshot") == 1


def test_a_new_revision_is_subscribed_to_again_and_reloads_a_page_that_nobody_edits(
    page: Page, hall: Hall, opened: Callable[..., Wire]
) -> None:
    wire = opened()
    wire.send(hall.frame(1))
    live(page)
    wire.send(hall.frame(2, rev=2))
    wait_for(page, lambda: wire.asked("subscribe") == 2)
    with page.expect_navigation(timeout=5000):
        wire.send(hall.hello(rev=2))


def test_a_page_on_which_somebody_types_is_not_reloaded(page: Page, hall: Hall, opened: Callable[..., Wire]) -> None:
    wire = opened()
    wire.send(hall.frame(1))
    live(page)
    page.evaluate("document.body.insertAdjacentHTML('beforeend', '<input id=typed><p data-outdated hidden>new</p>')")
    page.focus("#typed")
    wire.send(hall.hello(rev=2))
    expect(page.locator("[data-outdated]")).to_be_visible()
    page.wait_for_timeout(2500)
    assert page.locator("#typed").is_visible()
    with page.expect_navigation(timeout=5000):
        page.evaluate("document.activeElement.blur()")


def test_numbers_are_redrawn_at_most_five_times_a_second_and_pointers_ten(
    page: Page, hall: Hall, opened: Callable[..., Wire]
) -> None:
    wire = opened()
    hall.publish({"speed": 0.0})
    wire.send(hall.frame(1))
    live(page)
    page.evaluate("""() => {
        window.drawn = { number: 0, pointer: 0 };
        const count = (name, selector, what) =>
            new MutationObserver(() => window.drawn[name]++).observe(document.querySelector(selector), what);
        count("number", ".val.hero b", { childList: true, characterData: true, subtree: true });
        count("pointer", ".gauge-ptr", { attributes: true });
    }""")
    began = time.monotonic()
    for number in range(2, 62):
        hall.publish({"speed": 10.0 * number})
        wire.send(hall.frame(number, full=False, keys=("speed",)))
        page.wait_for_timeout(30)
    least = time.monotonic() - began
    drawn = page.evaluate("window.drawn")
    most = time.monotonic() - began  # what was drawn until it was counted
    assert 2 * least <= drawn["number"] <= 5 * most + 1
    assert 4 * least <= drawn["pointer"] <= 10 * most + 1


def test_a_change_below_half_a_digit_does_not_flicker_but_settles(
    page: Page, hall: Hall, opened: Callable[..., Wire]
) -> None:
    wire = opened()
    hall.publish({"speed": 100.4})
    wire.send(hall.frame(1))
    expect(page.locator(".val.hero b")).to_have_text("100")
    hall.publish({"speed": 100.6})
    wire.send(hall.frame(2, full=False, keys=("speed",)))
    page.wait_for_timeout(400)
    assert page.inner_text(".val.hero b") == "100"
    for number in range(3, 7):
        page.wait_for_timeout(700)
        wire.send(hall.frame(number, full=False))
    assert page.inner_text(".val.hero b") == "101"


def test_text_of_the_field_is_never_markup(page: Page, hall: Hall, opened: Callable[..., Wire]) -> None:
    wire = opened()
    hall.publish({"speed": "<img src=x onerror=alert(1)>"})
    wire.send(hall.frame(1))
    expect(page.locator(".val.hero b")).to_have_text("<img src=x onerror=alert(1)>")
    assert page.locator("main img").count() == 0


def test_curves_grow_from_what_was_seen_and_have_a_gap_where_it_was_bad(
    page: Page, hall: Hall, opened: Callable[..., Wire]
) -> None:
    wire = opened()
    line = page.locator('tr[data-row="speed"] .spark-line')
    for number in range(1, 11):
        hall.publish({"speed": 1000.0 + number}, q.COMM_FAILURE if number in (5, 6, 7) else q.GOOD)
        wire.send(hall.frame(number))
        page.wait_for_timeout(500)
    path = line.get_attribute("d") or ""
    assert path.count("M") == 2
    assert path.count("L") >= 1
    last = float(path.replace("M", "L").split("L")[-1].split(" ")[0])
    assert 115 <= last <= 116


def test_a_silent_server_is_delayed_after_two_seconds_and_gone_after_three(
    page: Page, hall: Hall, opened: Callable[..., Wire]
) -> None:
    wire = opened()
    hall.publish({"speed": 1180.0, "status": 1})
    page.evaluate("""document.body.insertAdjacentHTML("beforeend",
        '<button class="cmd" data-command="m1.forward">Start<small>ready</small></button>' +
        '<button class="cmd stop" data-command="m1.stop">Stop<small>ramp</small></button>')""")
    page.evaluate(TIMES)
    wire.send(hall.frame(1))
    live(page, "offline", 6)
    times = page.evaluate("window.times")
    assert 1950 <= times["delayed"] - times["live"] <= 2400
    assert 2850 <= times["offline"] - times["live"] <= 3300
    assert page.locator(".val.hero").get_attribute("data-q") == "stale"
    assert page.inner_text('[data-command="m1.forward"] small') == "No connection"
    assert page.locator('[data-command="m1.forward"]').get_attribute("aria-disabled") == "true"
    assert page.locator('[data-command="m1.stop"]').get_attribute("aria-disabled") is None
    wait_for(page, lambda: len(wire.sockets) > 1)
    wait_for(page, lambda: wire.asked("subscribe") > 1)
    hall.publish({"speed": 1200.0})
    wire.send(hall.frame(9, full=False, keys=("speed",)))
    page.wait_for_timeout(300)
    live(page, "offline")
    wire.send(hall.frame(9))
    live(page)
    expect(page.locator(".val.hero b")).to_have_text("1\u202f200")
    assert page.inner_text('[data-command="m1.forward"] small') == "ready"
    assert page.locator('[data-command="m1.forward"]').get_attribute("aria-disabled") is None


# ---- a real server --------------------------------------------------------------------------------------------


@pytest.fixture
def server(demo: PogonServer) -> PogonServer:
    return demo


def number(page: Page, selector: str = ".val.hero b") -> float:
    return float(page.inner_text(selector).replace("\u202f", "").replace("\u2212", "-").replace(",", "."))


def test_the_page_is_right_before_any_script(browser: Browser, server: PogonServer) -> None:
    context = browser.new_context(java_script_enabled=False, locale="en-GB")
    page = context.new_page()
    page.goto(f"{server.url}/equipment/m1")
    expect(page.locator(".val.hero")).to_have_attribute("data-q", "good")
    assert number(page) > 900
    assert page.locator(".st.when-online .st-t").inner_text() == "Running forward"
    assert "translate(" in (page.locator(".mai-ptr").first.get_attribute("transform") or "")
    assert page.evaluate("1") == 1
    context.close()


def test_a_page_looks_alive_only_when_all_of_it_answers_to_a_press(page: Page, server: PogonServer) -> None:
    held: list[Route] = []
    page.route("**/js/commands*.js*", lambda route: held.append(route))
    with page.expect_event("websocket") as opened:
        page.goto(server.url, wait_until="commit")
    for _ in range(4):
        opened.value.wait_for_event("framereceived")  # values come
    expect(page.locator("body")).to_have_attribute("data-live", "delayed")
    held[0].continue_()
    expect(page.locator("body")).to_have_attribute("data-live", "live")


@pytest.mark.always
def test_values_move_on_a_real_server(page: Page, server: PogonServer) -> None:
    page.goto(f"{server.url}/equipment/m1")
    live(page)
    seen: set[str] = set()
    until = time.monotonic() + 6
    while time.monotonic() < until and len(seen) < 3:
        seen.add(page.inner_text(".val.hero b"))
        page.wait_for_timeout(100)
    assert len(seen) >= 3


def test_a_motor_at_rest_is_drawn_by_server_and_script_alike(browser: Browser, server: PogonServer) -> None:
    pictures = []
    for script in (False, True):
        context = browser.new_context(java_script_enabled=script, locale="en-GB")
        page = context.new_page()
        page.goto(f"{server.url}/equipment/m2")
        page.wait_for_timeout(2500)
        if script:
            live(page)
        pictures.append(page.evaluate(f"({PICTURE})(document.querySelector('main'))"))
        context.close()
    before, after = pictures
    assert len(before) > 60
    differing = [pair for pair in zip(before, after, strict=True) if pair[0] != pair[1]]
    assert not [pair for pair in differing if pair[0][0].startswith("m2.") and "temperature" not in pair[0][0]]


def test_nine_tabs_of_one_browser_stay_live(browser: Browser, server: PogonServer) -> None:
    context = browser.new_context(**PLACE, **LOOKS)
    pages = [context.new_page() for _ in range(9)]
    for index, page in enumerate(pages):
        page.goto(f"{server.url}/equipment/m{1 + index % 2}")
    for page in pages:
        live(page)
    pages[0].wait_for_timeout(5000)
    for page in pages:
        assert page.evaluate("document.body.dataset.live") == "live"
    context.close()


@pytest.mark.always
def test_a_killed_server_is_noticed_within_three_seconds_and_found_again(
    page: Page, pogon_server: Callable[..., PogonServer], tmp_path: Path
) -> None:
    plant = small(tmp_path, "m1") / "plant"
    server = pogon_server(plant=plant)
    page.goto(f"{server.url}/equipment/m1")
    live(page)
    page.evaluate(TIMES)
    killed = time.time() * 1000
    server.kill()
    live(page, "offline", 6)
    assert page.evaluate("window.times.offline") - killed <= 3100
    expect(page.locator(".offline")).to_be_visible()
    expect(page.locator(".off-re")).to_be_visible()
    expect(page.locator(".st.when-online")).to_be_hidden()
    pogon_server(plant=plant, data=server.data, port=server.port)
    live(page, "live", 8)
    page.wait_for_timeout(1500)
    assert page.locator(".val.hero").get_attribute("data-q") == "good"
    expect(page.locator(".offline")).to_be_hidden()


def test_a_frozen_server_is_noticed_too_and_comes_back(page: Page, server: PogonServer) -> None:
    page.goto(f"{server.url}/equipment/m1")
    live(page)
    os.kill(server.process.pid, signal.SIGSTOP)
    try:
        live(page, "offline", 4.5)
    finally:
        os.kill(server.process.pid, signal.SIGCONT)
    live(page, "live", 8)


def test_every_socket_message_of_a_page_is_small(page: Page, server: PogonServer) -> None:
    sizes: list[int] = []
    page.on("websocket", lambda socket: socket.on("framereceived", lambda text: sizes.append(len(text))))
    page.goto(f"{server.url}/equipment/m1")
    live(page)
    page.wait_for_timeout(3000)
    assert len(sizes) > 5
    assert max(sizes) < 16_000
    assert sorted(sizes)[len(sizes) // 2] < 2_000


def test_no_error_reaches_the_console(page: Page, server: PogonServer) -> None:
    said: list[str] = []
    page.on("pageerror", lambda error: said.append(str(error)))
    page.on("console", lambda message: said.append(message.text) if message.type in ("error", "warning") else None)
    for path in ("/", "/equipment/m1", "/equipment/m2"):
        page.goto(server.url + path)
        live(page)
        page.wait_for_timeout(1200)
    assert said == []
