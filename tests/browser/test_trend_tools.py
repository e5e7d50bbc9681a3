"""What people do with a chart: keep it as a view, put notes on it, lay another period under it, take it along."""

import re
import time
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit
from xml.etree import ElementTree

import pytest
from playwright.sync_api import Page, Route, expect

from app import bundled
from app.db import Database
from app.historian import store
from app.plant.loader import read_plant
from app.tags.quality import GOOD
from tests.browser.station import AXE, SIZES, Sit, serving, small
from tests.conftest import PogonServer

WHO, HOME = "ivana", "/trends?tags=m1.speed,m1.current&span=1h"
SECOND, HOUR = 1_000_000, 3_600_000_000
SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PogonServer]:
    """A Pogon that knows 30 hours of m1: 1000 rpm until a day ago, 1200 from then on."""
    folder = tmp_path_factory.mktemp("tools")
    data = folder / "data"
    data.mkdir(mode=0o700)
    plant, _ = read_plant(bundled("plants/demo"))
    assert plant is not None
    now = time.time_ns() // 1000
    database = Database(data / "history.db", "history")
    database.migrate()

    def fill(connection: Any) -> None:
        numbers = store.register(connection, [plant.points["m1.speed"], plant.points["m1.current"]])
        rows: list[store.Row] = []
        for ago in range(30 * 3600, 59, -20):
            at = now - ago * SECOND
            rows.append((numbers[plant.points["m1.speed"].id], at, 1000.0 if ago > 12 * 3600 else 1200.0, None, GOOD))
            rows.append((numbers[plant.points["m1.current"].id], at, 2.0, None, GOOD))
        store.append(connection, sorted(rows), now - 30 * HOUR, now - 50 * SECOND)
        while not store.roll_up(connection, now):
            pass

    database.run(fill)
    database.close()
    with serving(small(folder, "m1", "m2")) as running:
        yield running


def ready(page: Page) -> Page:
    expect(page.locator('[data-trend][data-state="ready"]')).to_be_attached(timeout=30_000)
    return page


def menu(page: Page, name: str) -> None:
    page.locator(".t-do summary").filter(has_text=re.compile(f"^\\s*{name}\\s*$")).click()
    expect(page.locator(".t-do details[open] > .menu > *").first).to_be_visible()


def query(page: Page) -> dict[str, list[str]]:
    return parse_qs(urlsplit(page.url).query)


def test_a_view_is_kept_and_opened_again(sit: Sit) -> None:
    page = ready(sit())
    page.locator("[data-axis]").select_option("fit")
    menu(page, "Views")
    page.locator("#trend-views > form [name=name]").fill("Start of the fan")
    page.keyboard.press("Enter")
    link = page.locator("#trend-views a", has_text="Start of the fan")
    expect(page.locator("#trend-views > form [name=name]")).to_be_focused()
    expect(link).to_have_attribute("href", re.compile(r"tags=m1\.speed,m1\.current&span=1h&axis=fit"))
    page.locator("[data-span='8h']").click()
    menu(page, "Views")
    link.click()
    ready(page)
    assert query(page)["span"] == ["1h"] and query(page)["axis"] == ["fit"]


def test_the_focus_stays_with_the_view_that_something_was_done_with(sit: Sit) -> None:
    page = ready(sit())
    menu(page, "Views")
    page.locator("#t-view-name").fill("Pump")
    page.keyboard.press("Enter")
    mine = page.locator("#trend-views li", has_text="Pump").locator("summary")
    mine.click()
    page.locator(".t-deeds:visible [name=name]").fill("Pump 2")
    page.keyboard.press("Enter")
    expect(page.locator("#trend-views a", has_text="Pump 2")).to_be_visible()
    expect(mine).to_be_focused()
    page.keyboard.press("Enter")
    page.locator(".t-deeds:visible button", has_text="Delete").press("Enter")
    expect(mine).to_have_count(0)
    expect(page.locator("#t-view-name")).to_be_focused()


def test_the_page_begins_with_the_last_view(sit: Sit) -> None:
    page = ready(sit(path="/trends?tags=m1.current&span=24h"))
    with page.expect_response("**/trends/last") as told:
        page.locator("[data-span='8h']").click()
    assert told.value.status == 204
    page.locator(".tabs a[href='/trends']").click()
    ready(page)
    assert query(page) == {"tags": ["m1.current"], "span": ["8h"]}


def test_a_note_is_a_flag_on_the_curves_and_a_line_in_the_list(sit: Sit) -> None:
    page = ready(sit())
    menu(page, "Notes")
    page.locator("#trend-notes [name=text]").fill("Belt tightened")
    page.keyboard.press("Enter")
    line = page.locator("#trend-notes li", has_text="Belt tightened")
    expect(line).to_contain_text("ivana")
    expect(page.locator("#trend-notes [name=text]")).to_be_focused()
    flags = page.evaluate("() => document.querySelector('[data-canvas]').chart.notes")
    assert [flag["number"] for flag in flags] == ["1"]
    assert abs(flags[0]["at"] - time.time_ns() // 1000) < 60 * SECOND
    new = {name: page.locator(f"#trend-notes .t-note-new [name={name}]") for name in ("text", "time", "machine")}
    new["text"].fill("Belt slips")
    new["time"].fill("2026-01-02 03:04:05")
    new["machine"].select_option("m1")
    line.locator("form button").click()
    expect(line).to_have_count(0)
    assert page.evaluate("() => document.querySelector('[data-canvas]').chart.notes") == []
    kept = [one.input_value() for one in new.values()]
    assert kept == ["Belt slips", "2026-01-02 03:04:05", "m1"]  # what is typed is no note yet, and not what was deleted


def test_flags_are_those_of_the_range_that_one_looks_at(sit: Sit) -> None:
    now = time.time_ns() // 1000
    page = ready(sit(path=f"/trends?tags=m1.speed&from={now - 9 * HOUR}&to={now - 8 * HOUR}"))
    flags = "() => document.querySelector('[data-canvas]').chart.notes.map(({ at }) => at)"
    written = []
    for text in ("Earlier", "Later"):
        menu(page, "Notes")
        page.locator("#trend-notes [name=text]").fill(text)
        page.locator(".t-note-new button").click()
        expect(page.locator("#t-note-list li")).to_have_text(re.compile(text))
        written += page.evaluate(flags)
        if text == "Earlier":
            page.locator('[data-go="1"]').click()
            expect(page.locator("#t-note-list")).to_contain_text("Nobody wrote")
    assert abs(written[1] - written[0] - HOUR) < 2 * SECOND
    page.locator('[data-go="-1"]').click()
    expect(page.locator("#t-note-list li")).to_have_text(re.compile("Earlier"))
    assert page.evaluate(flags) == written[:1]


def test_another_period_lies_under_this_one_with_its_own_times_and_numbers(sit: Sit) -> None:
    page = ready(sit())
    menu(page, "Compare")
    page.locator("[data-under='24h']").click()
    row = page.locator('[data-under-stat="m1.speed"]')
    expect(row.locator("[data-cell=mean]")).to_have_text(re.compile(r"^1\s?000"))
    expect(page.locator('[data-stat="m1.speed"] [data-cell=high]')).to_have_text(re.compile(r"^1\s?[12]\d\d"))
    expect(row.locator("th")).to_contain_text("earlier")
    low, high = page.evaluate(
        """() => { const { chart } = document.querySelector('[data-canvas]'), { ghost } = chart.pen('m1.speed');
        return [ghost[0].at - chart.from, chart.to - ghost.at(-1).at].map((one) => one / 1e6); }"""
    )
    assert abs(low) < 60 and abs(high) < 60, "it lies where this period is"
    page.wait_for_timeout(300)
    assert query(page)["under"] == ["24h"]
    page.reload()
    expect(ready(page).locator('[data-under-stat="m1.speed"] [data-cell=mean]')).to_have_text(re.compile(r"^1\s?000"))
    menu(page, "Compare")
    page.locator("[data-under='none']").click()
    expect(row).to_be_hidden()


def test_what_was_at_two_cursors_is_laid_over_each_other(sit: Sit) -> None:
    page = ready(sit(path="/trends?tags=m1.speed&span=8h"))
    page.locator("[data-rulers]").click()
    expect(page.locator(".t-ruler:visible")).to_have_count(2)
    menu(page, "Compare")
    page.locator("[data-under=rulers]").click()
    expect(page.locator('[data-under-stat="m1.speed"] [data-cell=mean]')).to_have_text(
        re.compile(r"\d")
    )  # it came and is drawn
    shift = page.evaluate("() => document.querySelector('[data-canvas]').chart.shift")
    assert abs(shift - 8 * HOUR / 3) < 120 * SECOND
    expect(page.locator(".t-ruler:visible")).to_have_count(1)


def test_what_one_sees_is_taken_along_as_picture_and_as_table(sit: Sit, tmp_path: Path) -> None:
    page = ready(sit(path=f"{HOME}&under=24h"))
    expect(page.locator('[data-under-stat="m1.speed"]')).to_be_visible()
    page.locator("[data-rulers]").click()
    expect(page.locator("[data-table-title]")).to_have_text("Between cursors")
    for kind in ("svg", "png"):
        menu(page, "Export")
        with page.expect_download() as coming:
            page.locator(f"[data-picture={kind}]").click()
        name = coming.value.suggested_filename
        assert re.fullmatch(rf"pogon-trends-\d{{8}}-\d{{6}}\.{kind}", name)
        coming.value.save_as(tmp_path / kind)
    assert (tmp_path / "png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    root = ElementTree.parse(tmp_path / "svg").getroot()
    words = [one.text or "" for one in root.iter(f"{SVG}text")]
    assert {"Fan 1", "Speed", "Output current", "rpm", "A", "B"} <= set(words), "the cursors too"
    assert any(word.startswith("thin: ") for word in words) and "SIMULATION" in " ".join(words)
    drawn = [(one.get("d", ""), one.get("fill")) for one in root.iter(f"{SVG}path")]
    assert max(len(path) for path, _ in drawn) > 200, "the curves are in it"
    assert all(path.startswith("M") for path, _ in drawn), "a path that begins otherwise is not drawn"
    assert sum(fill == "none" and path.count("L") > 30 for path, fill in drawn) == 4, (
        "two pens, each with another period"
    )
    assert page.locator("[data-export]").get_attribute("href") is not None
    assert re.search(r"interval=\d+", page.locator("[data-export-sums]").get_attribute("href") or "")


@pytest.mark.parametrize(
    ("begin", "end", "told"),
    [
        ("2026-01-05T10:00:00Z", "2026-01-05T11:00:00Z", "05/01/2026 11:00 – 12:00"),
        ("2025-12-31T22:55:00Z", "2025-12-31T23:55:00Z", "31/12/2025 23:55 – 01/01/2026 00:55"),
    ],
)
def test_a_picture_says_once_of_which_days_it_is(sit: Sit, tmp_path: Path, begin: str, end: str, told: str) -> None:
    page = sit(path=f"{HOME.split('&')[0]}&from={begin}&to={end}")
    expect(page.locator('[data-trend][data-state="empty"]')).to_be_attached()
    menu(page, "Export")
    with page.expect_download() as coming:
        page.locator("[data-picture=svg]").click()
    coming.value.save_as(tmp_path / "svg")
    words = [one.text or "" for one in ElementTree.parse(tmp_path / "svg").getroot().iter(f"{SVG}text")]
    assert f"{told} · Europe/Zagreb" in words


def test_a_menu_that_is_opened_before_every_script_runs_is_filled(sit: Sit) -> None:
    page = sit()
    held: list[Route] = []
    page.route("**/js/trend.*js*", lambda route: held.append(route))
    page.goto(page.url, wait_until="commit")
    page.locator("[data-take] > summary").click()
    expect(page.locator("[data-picture=svg]")).to_be_visible()
    for route in held[:]:
        route.continue_()
    ready(page)
    expect(page.locator("[data-export]")).to_be_visible()


def test_without_the_server_pictures_are_taken_and_the_line_says_since_when(sit: Sit, tmp_path: Path) -> None:
    page = ready(sit(accept_downloads=True))  # a browser of its own
    page.context.set_offline(True)
    expect(page.locator("body")).to_have_attribute("data-live", "offline", timeout=30_000)
    said = page.locator("#message span").inner_text()
    with page.expect_event("requestfailed", lambda request: request.url.endswith("/trends/last")):
        page.locator("[data-axis]").select_option("fit")
    page.locator("[data-take] > summary").click()
    with page.expect_download() as coming:
        page.locator("[data-picture=svg]").click()
    coming.value.save_as(tmp_path / "svg")
    assert ElementTree.parse(tmp_path / "svg").getroot().tag == f"{SVG}svg"
    assert page.locator("#message span").inner_text() == said != ""
    page.keyboard.press("Escape")
    menu(page, "Notes")
    page.locator("#trend-notes [name=text]").fill("Belt tightened")
    page.keyboard.press("Enter")
    expect(page.locator("#message span")).to_have_text("No answer from the server")
    expect(page.locator("#trend-notes [name=text]")).to_have_value("Belt tightened")
    page.goto("about:blank")  # it asks no more
    expected = re.compile(
        "ERR_INTERNET_DISCONNECTED|Failed to fetch.*t-note-time", re.DOTALL
    )  # the menu asks for the time when it opens
    sit.complaints[:] = [told for told in sit.complaints if not expected.search(told)]


@pytest.mark.parametrize("size", SIZES)
def test_the_menus_fit_the_screen_and_axe_finds_nothing(sit: Sit, size: str) -> None:
    width, height = SIZES[size]
    page = ready(sit(lang="de", viewport={"width": width, "height": height}, bypass_csp=True))
    if size == "small":
        page.locator("label:has([value=pens])").click()
    page.evaluate(AXE.read_text("utf-8"))
    for name in ("Ansichten", "Vergleich", "Notizen", "Export"):
        menu(page, name)
        box = page.locator(".t-do details[open] > .menu").bounding_box()
        assert box and box["x"] >= 0 and box["x"] + box["width"] <= width, name
        assert page.evaluate("document.documentElement.scrollWidth") <= width, name
        found = page.evaluate("axe.run(document.querySelector('.t-do'), {resultTypes: ['violations']})")["violations"]
        assert [(rule["id"], node["html"][:160]) for rule in found for node in rule["nodes"]] == [], name


def test_names_stand_beside_the_plot_and_none_on_another(sit: Sit) -> None:
    page = ready(
        sit(path="/trends?tags=m1.speed,m1.current,m1.power,m1.voltage,m2.speed,m2.current,m2.power,m2.voltage&span=1h")
    )
    placed = page.evaluate(
        """() => { const { chart } = document.querySelector('[data-canvas]'), out = [], { plot } = chart, { text } = chart;
        chart.text = function (to, words, x, y, how = {}) {
            if (how.strong) out.push([words, x, y]);
            return text.call(this, to, words, x, y, how);
        };
        chart.names(plot);
        chart.text = text;
        return { out, edge: plot.bbox.left + plot.bbox.width }; }"""
    )
    names = [(x, y) for _, x, y in placed["out"]]
    assert len(names) == 8 and all(x > placed["edge"] for x, _ in names)
    heights = sorted(y for _, y in names)
    assert all(b - a >= 15 for a, b in pairwise(heights))


def test_pens_of_one_machine_are_told_apart_where_there_is_little_room(sit: Sit) -> None:
    """Their names differ in the middle, which is what is left out; that all are of the same machine need not be said."""
    page = ready(sit(path="/trends?tags=m1.speed,m1.current,m1.power,m1.voltage&span=1h"))
    page.set_viewport_size({"width": 800, "height": 480})
    written = page.evaluate(
        """() => { const { chart } = document.querySelector('[data-canvas]'), out = [], { text } = chart;
        chart.pens.forEach((pen, i) => {
            pen.machine = "Kran 1";
            pen.label = `Vitlo, pretvarač ${i % 2 + 1}: ${i < 2 ? "brzina" : "temperatura"} motora`;
            pen.name = `${pen.machine} · ${pen.label}`;
        });
        chart.rebuild();
        chart.text = function (to, words, x, y, how = {}) { out.push(words); return text.call(this, to, words, x, y, how); };
        chart.names(chart.plot);
        chart.text = text;
        return out; }"""
    )
    told = list(zip(written[::2], written[1::2], strict=True))
    parts = [("Vitlo, pretvarač 1", "Vitlo, pretvarač 2"), ("brzina motora", "temperatura motora")]
    assert sorted(told) == [(drive, what) for drive in parts[0] for what in parts[1]]
