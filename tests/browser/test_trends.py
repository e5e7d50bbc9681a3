"""Trends in a real browser: no spike is lost, gaps stay gaps, steps are steps, the live edge moves, the address is the view."""

import re
import time
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

import pytest
from playwright.sync_api import Browser, Page, expect

from app import bundled
from app.db import Database
from app.historian import store
from app.plant.loader import read_plant
from app.tags.quality import COMM_FAILURE, GOOD
from tests.browser.station import AXE, SIZES, serving, small
from tests.conftest import PogonServer

SECOND, HOUR = 1_000_000, 3_600_000_000
SPIKE = 3 * HOUR
"""How long ago the one sample of 1490 was [µs]."""
GAP = (5 * HOUR, 4 * HOUR)
STEP = 2 * HOUR
"""When the setpoint changed from 30 to 40 Hz [µs ago]."""

PLOTTED = "(tag) => { const { chart } = document.querySelector('[data-canvas]'); return chart.points(chart.pen(tag)); }"
"""What uPlot was given of a pen: seconds and values."""
VIEW = "() => { const { chart } = document.querySelector('[data-canvas]'); return [chart.from, chart.to]; }"
LOADED = "Number(document.querySelector('[data-trend]').dataset.loaded ?? 0)"


@pytest.fixture(scope="module")
def past(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, int]:
    """A data folder with 30 hours of history of m1, and its "now"."""
    data = tmp_path_factory.mktemp("past") / "data"
    data.mkdir(mode=0o700)
    plant, _ = read_plant(bundled("plants/demo"))
    assert plant is not None
    now = time.time_ns() // 1000
    database = Database(data / "history.db", "history")
    database.migrate()

    def fill(connection: Any) -> None:
        points = [plant.points[name] for name in ("m1.speed", "m1.frequency_setpoint", "m1.status")]
        numbers = store.register(connection, points)
        speed, setpoint, status = (numbers[point.id] for point in points)
        rows: list[store.Row] = []
        for ago in range(30 * 3600, 59, -5):
            at = now - ago * SECOND
            if GAP[1] < ago * SECOND < GAP[0]:
                continue
            rows.append((speed, at, 1000.0 + ago % 7, None, GOOD))
        rows.append((speed, now - GAP[0] + 1, None, None, COMM_FAILURE))
        rows.append((speed, now - SPIKE - 2 * SECOND, 1490.0, None, GOOD))
        for ago in range(30 * 3600, 59, -300):
            rows.append((setpoint, now - ago * SECOND, 30.0 if ago * SECOND > STEP else 40.0, None, GOOD))
            rows.append((status, now - ago * SECOND, 1.0, None, GOOD))
        rows.append((setpoint, now - STEP, 40.0, None, GOOD))
        store.append(connection, sorted(rows), now - 30 * HOUR, now - 50 * SECOND)
        while not store.roll_up(connection, now):
            pass

    database.run(fill)
    database.close()
    return data, now


@pytest.fixture(scope="module")
def server(past: tuple[Path, int]) -> Iterator[PogonServer]:
    """One Pogon with that history; all only look at it."""
    with serving(small(past[0].parent, "m1", "m2"), people={}) as running:
        yield running


def show(page: Page, server: PogonServer, query: str) -> None:
    page.goto(f"{server.url}/trends?{query}")
    expect(page.locator('[data-trend][data-state="ready"]')).to_be_attached(timeout=30_000)


def reload_of(page: Page, deed: Callable[[], object]) -> None:
    """Do something that changes the view and wait until its curves have come."""
    before = page.evaluate(LOADED)
    deed()
    wait_for(page, lambda: page.evaluate(LOADED) > before)


def wait_for(page: Page, truth: Callable[[], bool], seconds: float = 30) -> None:
    """Poll from outside: the content policy lets nothing be evaluated within."""
    until = time.monotonic() + seconds
    while not truth():
        assert time.monotonic() < until, "it did not come"
        page.wait_for_timeout(50)


def plotted(page: Page, tag: str = "m1.speed") -> list[tuple[float, float | None]]:
    xs, ys = page.evaluate(PLOTTED, tag)
    return list(zip(xs, ys, strict=True))


def span(page: Page) -> float:
    begin, end = page.evaluate(VIEW)
    return float(end - begin) / SECOND


# ---- what is drawn --------------------------------------------------------------------------------------------


def test_a_spike_of_one_sample_is_drawn_at_every_zoom(page: Page, server: PogonServer) -> None:
    for name in ("8h", "24h", "7d"):
        show(page, server, f"tags=m1.speed&span={name}")
        line = plotted(page)
        assert max(y for _, y in line if y is not None) == 1490.0, name
        assert len(line) <= 4 * 4000 + 2000
        assert spike_pixels(page) >= 5, name


def spike_pixels(page: Page) -> int:
    """Dark pixels of the canvas between 1200 and 1450 rpm: only the spike reaches there."""
    count: int = page.evaluate("""() => {
        const { chart } = document.querySelector('[data-canvas]'), { plot } = chart;
        const y = (value) => Math.round(plot.valToPos(value, 'y' + chart.pens[0].scale, true));
        const top = y(1450), height = y(1200) - top;
        const { data } = plot.ctx.getImageData(plot.bbox.left, top, plot.bbox.width, height);
        let dark = 0;
        for (let i = 0; i < data.length; i += 4) if (data[i] + data[i + 1] + data[i + 2] < 240) dark++;
        return dark;
    }""")
    return count


def test_zooming_in_keeps_the_spike_and_asks_for_more(page: Page, server: PogonServer, past: tuple[Path, int]) -> None:
    at = (past[1] - SPIKE - 2 * SECOND) / SECOND
    show(page, server, "tags=m1.speed&span=24h")
    for _ in range(6):
        box = page.evaluate(
            """(at) => { const { plot } = document.querySelector('[data-canvas]').chart; const r = plot.over.getBoundingClientRect();
               return [r.left + plot.valToPos(at, 'x'), r.top + r.height / 2]; }""",
            at,
        )
        page.mouse.move(*box)
        reload_of(page, lambda: page.mouse.wheel(0, -400))
        line = plotted(page)
        assert max(y for _, y in line if y is not None) == 1490.0
    assert span(page) < 24 * 3600 * 0.8**5
    (found,) = {x for x, y in line if y == 1490.0}
    assert abs(found - at) < span(page) / 300


def test_a_gap_is_never_drawn_across(page: Page, server: PogonServer, past: tuple[Path, int]) -> None:
    show(page, server, "tags=m1.speed&span=8h")
    begin, end = (past[1] - ago for ago in GAP)
    line = plotted(page)
    inside = [y for x, y in line if begin / SECOND + 60 < x < end / SECOND - 60]
    assert all(y is None for y in inside)
    before = [index for index, (x, _) in enumerate(line) if x <= begin / SECOND + 60][-1]
    after = next(index for index, (x, y) in enumerate(line) if x >= end / SECOND - 60 and y is not None)
    assert any(y is None for _, y in line[before : after + 1])
    gaps = page.evaluate(
        "() => { const { chart } = document.querySelector('[data-canvas]'); return chart.gaps(chart.pens[0]); }"
    )
    assert any(abs(a - begin) < 60 * SECOND and abs(b - end) < 60 * SECOND for a, b in gaps)


def test_a_setpoint_is_a_step_and_a_measurement_is_a_line(
    page: Page, server: PogonServer, past: tuple[Path, int]
) -> None:
    show(page, server, "tags=m1.frequency_setpoint,m1.speed&span=8h")
    line = [(x, y) for x, y in plotted(page, "m1.frequency_setpoint") if y is not None]
    change = next(i for i in range(1, len(line)) if line[i - 1][1] == 30.0 and line[i][1] == 40.0)
    assert line[change - 1][0] == line[change][0], "the old value holds until the new one"
    assert abs(line[change][0] - (past[1] - STEP) / SECOND) < 90
    speed = plotted(page, "m1.speed")
    assert not any(
        a[0] == b[0] == c[0] and b[1] == a[1] != c[1]
        for a, b, c in zip(speed, speed[1:], speed[2:], strict=False)
        if a[1] is None
    )


# ---- live -----------------------------------------------------------------------------------------------------


def test_the_live_edge_moves_and_brings_new_values(page: Page, server: PogonServer) -> None:
    show(page, server, "tags=m1.current&span=1m")
    first_end, first = page.evaluate(VIEW)[1], plotted(page, "m1.current")[-1]
    page.wait_for_timeout(2500)
    end, last = page.evaluate(VIEW)[1], plotted(page, "m1.current")[-1]
    assert 1.5 <= (end - first_end) / SECOND <= 5
    assert last[0] - first[0] >= 1.5
    assert abs(span(page) - 60) < 0.01


def test_dragging_pauses_and_one_press_goes_back_to_live(page: Page, server: PogonServer) -> None:
    show(page, server, "tags=m1.speed&span=10m")
    edge = page.locator("[data-live-edge]")
    expect(edge).to_have_attribute("aria-pressed", "true")
    over = page.locator(".u-over").bounding_box()
    assert over
    x, y = over["x"] + over["width"] / 2, over["y"] + over["height"] / 2
    page.mouse.move(x, y)

    def drag() -> None:  # curves come while the button is still held when the mouse rests, and none when it is let go
        page.mouse.down()
        page.mouse.move(x + 200, y, steps=4)
        page.wait_for_timeout(400)
        page.mouse.up()

    reload_of(page, drag)
    expect(edge).to_have_attribute("aria-pressed", "false")
    expect(edge).to_contain_text(re.compile("Natrag na uživo|Back to live"))
    stopped = page.evaluate(VIEW)
    page.wait_for_timeout(1200)
    assert page.evaluate(VIEW) == stopped
    assert abs(span(page) - 600) < 1
    reload_of(page, edge.click)
    expect(edge).to_have_attribute("aria-pressed", "true")
    assert page.evaluate(VIEW)[1] > stopped[1] + 100 * SECOND


def test_buttons_and_keys_move_and_zoom(page: Page, server: PogonServer) -> None:
    show(page, server, "tags=m1.speed&span=1h")
    reload_of(page, page.locator('[data-zoom="0.5"]').click)
    assert span(page) == pytest.approx(1800, abs=1)
    begin, _ = page.evaluate(VIEW)
    reload_of(page, page.locator('[data-go="-1"]').click)
    again = page.evaluate(VIEW)
    assert again[1] == pytest.approx(begin, abs=15 * SECOND)
    page.locator("[data-canvas]").focus()
    reload_of(page, lambda: page.keyboard.press("ArrowLeft"))
    assert page.evaluate(VIEW)[0] == pytest.approx(again[0] - 180 * SECOND, abs=SECOND)
    reload_of(page, lambda: page.keyboard.press("-"))
    assert span(page) == pytest.approx(3600, abs=1)
    reload_of(page, lambda: page.keyboard.press("End"))
    expect(page.locator("[data-live-edge]")).to_have_attribute("aria-pressed", "true")
    reload_of(page, page.locator('[data-span="8h"]').click)
    assert span(page) == pytest.approx(8 * 3600, abs=1)


def test_a_box_on_the_axis_zooms_into_it(page: Page, server: PogonServer) -> None:
    show(page, server, "tags=m1.speed&span=8h")
    over = page.locator(".u-over").bounding_box()
    assert over
    y = over["y"] + over["height"] + 12
    page.mouse.move(over["x"] + over["width"] * 0.25, y)
    page.mouse.down()
    page.mouse.move(over["x"] + over["width"] * 0.5, y, steps=4)
    expect(page.locator(".t-box")).to_be_visible()
    reload_of(page, lambda: page.mouse.up())
    assert span(page) == pytest.approx(2 * 3600, rel=0.02)
    expect(page.locator(".t-box")).to_have_count(0)


def test_a_press_on_the_curves_sets_a_ruler_and_opens_nothing(page: Page, server: PogonServer) -> None:
    asked: list[str] = []
    show(page, server, "tags=m1.speed&span=8h")
    page.on("request", lambda request: asked.append(urlsplit(request.url).path))
    reload_of(page, page.locator(".u-over").click)
    expect(page.locator(".t-ruler:visible")).to_have_count(1)
    expect(page.locator("dialog[open]")).to_have_count(0)
    assert "/trends" not in asked
    expect(page.locator("[data-trend][data-state=ready]")).to_be_attached()


@pytest.mark.always
def test_two_rulers_give_the_numbers_between_them(page: Page, server: PogonServer) -> None:
    show(page, server, "tags=m1.speed,m1.frequency_setpoint&span=8h")
    reload_of(page, page.locator("[data-rulers]").click)
    expect(page.locator(".t-ruler:visible")).to_have_count(2)
    cell = page.locator('[data-stat="m1.frequency_setpoint"] [data-cell="a"]')
    expect(cell).to_have_text(re.compile(r"30[.,]0"))
    expect(page.locator('[data-stat="m1.speed"] [data-cell="high"]')).not_to_have_text("–")
    good = page.locator('[data-stat="m1.speed"] [data-cell="good"]')
    expect(good).to_have_text(re.compile(r"^6[0-5][.,]"))  # a gap of one hour within 2 h 40 min
    before = page.locator("[data-col=b]").inner_text()
    page.locator(".t-ruler").nth(1).focus()
    reload_of(page, lambda: page.keyboard.press("PageUp"))
    assert page.locator("[data-col=b]").inner_text() != before


# ---- the address ----------------------------------------------------------------------------------------------


def test_the_address_round_trips_and_survives_a_change_of_language(page: Page, server: PogonServer) -> None:
    show(page, server, "tags=m1.speed,m1.frequency_setpoint&span=8h")
    reload_of(page, page.locator('[data-go="-0.25"]').click)
    page.locator('[data-pen="m1.frequency_setpoint"] .ck').uncheck()
    page.locator("[data-axis]").select_option("fit")
    page.wait_for_timeout(300)
    query = parse_qs(urlsplit(page.url).query)
    assert query["tags"] == ["m1.speed,m1.frequency_setpoint"]
    assert query["off"] == ["m1.frequency_setpoint"] and query["axis"] == ["fit"]
    here = page.evaluate(VIEW)
    page.reload()
    expect(page.locator('[data-trend][data-state="ready"]')).to_be_attached(timeout=30_000)
    assert page.evaluate(VIEW) == pytest.approx(here, abs=2000)
    expect(page.locator('[data-pen="m1.frequency_setpoint"] .ck')).not_to_be_checked()
    page.locator(".lang summary").click()
    page.locator('.lang button[value="cs"]').click()
    expect(page.locator("html")).to_have_attribute("lang", "cs")
    expect(page.locator('[data-trend][data-state="ready"]')).to_be_attached(timeout=30_000)
    assert page.evaluate(VIEW) == pytest.approx(here, abs=2000)


def test_a_page_asks_once_for_its_curves(page: Page, server: PogonServer) -> None:
    asked: list[str] = []
    page.on("request", lambda request: asked.append(urlsplit(request.url).path))
    show(page, server, "tags=m1.speed&span=8h")
    expect(page.locator("body")).to_have_attribute("data-live", "live")
    page.wait_for_timeout(800)
    assert [asked.count(path) for path in ("/history/series", "/trends/table", "/trends/marks")] == [1, 1, 1]


def test_pens_are_added_and_removed_without_losing_the_view(page: Page, server: PogonServer) -> None:
    show(page, server, "tags=m1.speed&span=8h")
    page.locator("[data-picker] summary").click()
    page.locator("[data-picker] input").fill("m1.current")
    page.locator('[data-add="m1.current"]').click()
    expect(page.locator('[data-pen="m1.current"]')).to_be_visible()
    expect(page.locator('[data-trend][data-state="ready"]')).to_be_attached(timeout=30_000)
    assert parse_qs(urlsplit(page.url).query)["span"] == ["8h"]
    page.locator('[data-pen="m1.speed"] [data-remove]').click()
    expect(page.locator('[data-pen="m1.speed"]')).to_have_count(0)
    assert parse_qs(urlsplit(page.url).query) == {"tags": ["m1.current"], "span": ["8h"]}


def test_a_pen_is_added_to_the_view_that_one_has_by_then(page: Page, server: PogonServer) -> None:
    show(page, server, "tags=m1.speed&span=8h")
    picker = page.locator("[data-picker] summary")
    picker.click()
    expect(page.locator('[data-add="m1.current"]')).to_be_visible()
    picker.click()
    page.locator("[data-span='1h']").click()
    picker.click()
    page.locator('[data-add="m1.current"]').click()
    expect(page.locator('[data-pen="m1.current"]')).to_be_visible()
    assert parse_qs(urlsplit(page.url).query) == {"tags": ["m1.speed,m1.current"], "span": ["1h"]}


def test_the_search_for_a_pen_is_typed_at_once(page: Page, server: PogonServer) -> None:
    show(page, server, "tags=m1.speed&span=8h")
    page.locator("[data-picker] summary").click()
    expect(page.locator("[data-picker] input")).to_be_focused()
    lines = "(one) => one.getBoundingClientRect().height / parseFloat(getComputedStyle(one).fontSize)"
    assert page.locator('[data-add="m1.power"] .cap').evaluate(lines) < 2, "kW is one word"


def test_an_own_range_is_read_in_the_plants_zone(page: Page, server: PogonServer) -> None:
    show(page, server, "tags=m1.speed&span=1h")
    page.locator(".t-range summary").click()
    page.locator("#own-range [name=from]").fill("25/10/2026 01:00")
    page.locator("#own-range [name=to]").fill("2026-10-25T04:00:00")
    page.locator("#own-range button").click()
    wait_for(page, lambda: span(page) == 4 * 3600)
    labels = page.evaluate("""async () => {
        const time = await import('/static/js/time_axis.js');
        const [from, to] = [Date.UTC(2026, 9, 24, 23) * 1000, Date.UTC(2026, 9, 25, 3) * 1000];
        return [time.labels(time.ticks(from, to, 9, 'Europe/Zagreb'), 'Europe/Zagreb', 'en'), time.changes(from, to, 'Europe/Zagreb')];
    }""")
    assert labels[0] == ["01:00", "01:30", "02:00A", "02:30A", "02:00B", "02:30B", "03:00", "03:30", "04:00"]
    (change,) = labels[1]
    assert (change["before"], change["after"]) == ("+02:00", "+01:00")
    assert change["at"] == 1_792_890_000_000_000


@pytest.mark.parametrize(
    ("opens", "field"), [(".t-range", "#t-range [name=to]"), ("[data-compare]", "#t-compare [name=begin]")]
)
def test_who_typed_a_wrong_time_goes_on_typing(page: Page, server: PogonServer, opens: str, field: str) -> None:
    show(page, server, "tags=m1.speed&span=1h")
    page.locator(f"{opens} > summary").click()
    page.locator(field).fill("01.01.1990 00:00")
    page.locator(field).press("Enter")
    expect(page.locator(f"{opens} [role=alert]")).to_be_visible()
    expect(page.locator(field)).to_be_focused()
    expect(page.locator(field)).to_have_value(re.compile("1990"))


def test_days_on_the_axis_have_23_24_and_25_hours(page: Page, server: PogonServer) -> None:
    page.goto(f"{server.url}/healthz")
    page.goto(server.url)
    ticks = page.evaluate("""async () => {
        const time = await import('/static/js/time_axis.js');
        const of = (y, m, d) => Date.UTC(y, m, d) * 1000;
        const ranges = [[of(2026, 2, 27), of(2026, 3, 1)], [of(2026, 9, 23), of(2026, 9, 28)]];
        return ranges.map(([from, to]) => time.ticks(from, to, 6, 'Europe/Zagreb'));
    }""")
    hours = [[(b - a) / HOUR for a, b in pairwise(one)] for one in ticks]
    assert 23.0 in hours[0] and set(hours[0]) <= {23.0, 24.0}
    assert 25.0 in hours[1] and set(hours[1]) <= {25.0, 24.0}


# ---- states and looks -----------------------------------------------------------------------------------------


def test_an_empty_range_and_a_broken_history_are_told_in_the_same_place(page: Page, server: PogonServer) -> None:
    page.goto(f"{server.url}/trends?tags=m1.speed&from=2020-01-01T00:00&to=2020-01-02T00:00")
    expect(page.locator('[data-trend][data-state="empty"] [data-say]')).to_be_visible(timeout=30_000)
    size = page.locator("[data-canvas]").bounding_box()
    page.route("**/history/series*", lambda route: route.fulfill(status=503, body="<p data-message>Disk gone</p>"))
    page.reload()
    say = page.locator('[data-trend][data-state="error"] [data-say]')
    expect(say).to_have_text("Disk gone", timeout=30_000)
    assert page.locator("[data-canvas]").bounding_box() == size


def test_the_motor_screen_begins_with_its_history(page: Page, server: PogonServer) -> None:
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.goto(f"{server.url}/equipment/m1")
    expect(page.locator('[data-panel][data-state="ready"]')).to_be_attached(timeout=30_000)
    points = page.evaluate(
        "() => { const { chart } = document.querySelector('[data-panel]'); return chart.points(chart.pen('m1.speed')); }"
    )
    assert points[0][0] < time.time() - 300
    page.wait_for_timeout(1200)
    path = page.locator('tr[data-row="speed"] .spark-line').get_attribute("d") or ""
    places = [float(x) for x in re.findall(r"[ML](-?[\d.]+)", path)]
    assert min(places) < 20 and max(places) > 110
    assert sum("/trends/recent" in url for url in asked) == 1
    page.locator('tr[data-row="current"] .spark-a').click()
    expect(page).to_have_url(re.compile(r"/trends\?tags=m1\.current"))


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("size", SIZES)
def test_axe_finds_nothing_and_nothing_is_wider_than_the_screen(
    browser: Browser, server: PogonServer, size: str, theme: str
) -> None:
    width, height = SIZES[size]
    context = browser.new_context(viewport={"width": width, "height": height}, locale="de-DE", bypass_csp=True)
    context.add_cookies([{"name": "pogon_theme", "value": theme, "url": server.url}])
    page = context.new_page()
    said: list[str] = []
    page.on("pageerror", lambda error: said.append(str(error)))
    page.on("console", lambda message: said.append(message.text) if message.type in ("error", "warning") else None)
    show(page, server, "tags=m1.speed,m1.frequency_setpoint,m2.heatsink_temperature&span=8h")
    reload_of(page, page.locator("[data-rulers]").click)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    page.evaluate(AXE.read_text("utf-8"))
    found = page.evaluate("axe.run({resultTypes: ['violations']})")["violations"]
    assert [(rule["id"], node["html"][:160]) for rule in found for node in rule["nodes"]] == []
    assert said == []
    context.close()
