"""A chart tells nothing that cannot be: no scale below zero for what has no sign, and dots lie on their lines, at stored values."""

from itertools import pairwise

from playwright.sync_api import Page, expect

from tests.conftest import PogonServer

SCALES = """() => { const { chart } = document.querySelector("[data-panel]"), found = [];
  for (const axis of ["auto", "fit", "scale"]) for (const value of [0, 0.01, 3]) {
    chart.axis = axis;
    for (const pen of chart.pens) {
      if (pen.low === null || pen.low < 0 || Object.keys(pen.texts).length) continue;
      pen.scale = pen.tag;
      pen.columns = []; pen.fresh = [];
      pen.items = [{ at: chart.to - 1e6, first: value, low: value, high: value, last: value, level: 0, count: 1 }];
      const [low, high] = chart.range(chart.scaleOf(pen));
      found.push([axis, pen.tag, value, low, high]);
    }
  }
  return found; }"""
WIDE = """() => { const { chart } = document.querySelector("[data-panel]"), pen = chart.pens.find((one) => !one.stepped);
  const [first, step] = [chart.from + 60e6, (chart.to - chart.from) / 20], told = [];
  pen.fresh = [];
  pen.step = step;
  const column = (i) => ({ at: first + i * step, first: 10 * i, low: 10 * i, high: 10 * i + 9, last: 10 * i + 7, level: 0, count: 99 });
  pen.items = Array.from({ length: 8 }, (_, i) => column(i));
  chart.draw();
  for (const item of pen.items) told.push([chart.at(pen, item.at), item.last]);
  const [xs, ys] = pen.line;
  for (let i = 0; i + 1 < xs.length; i++) told.push([chart.at(pen, (xs[i] + xs[i + 1]) / 2 * 1e6), (ys[i] + ys[i + 1]) / 2]);
  return told; }"""
RESTS = """() => { const { chart } = document.querySelector("[data-panel]"), pen = chart.pens.find((one) => !one.stepped);
  pen.fresh = [];
  pen.step = (chart.to - chart.from) / 500;
  const at = (part) => chart.from + part * (chart.to - chart.from), moves = { first: 0, low: -40, high: 0, last: -35, level: 0, count: 5 };
  const stands = { first: 0, low: 0, high: 0, last: 0, level: 0, count: 1 };
  pen.items = [0.2, 0.8].flatMap((part) => [{ ...moves, at: at(part) }, { ...stands, at: at(part) + pen.step }]);
  chart.draw();
  return [[0.3, 0.5, 0.79].map((part) => chart.at(pen, at(part))), chart.at(pen, at(0.8))]; }"""

BEFORE = """() => { const { chart } = document.querySelector("[data-panel]"), pen = chart.pens[0];
  pen.fresh = [];
  pen.items = [{ at: (chart.from + chart.to) / 2, first: 1, low: 1, high: 1, last: 1, level: 0, count: 1 }];
  chart.draw();
  return chart.at(pen, chart.from + 1e6); }"""
GAPS = """() => { const { chart } = document.querySelector("[data-panel]"), pen = chart.pens[0], written = [];
  chart.mini = false;
  const at = (part) => chart.from + part * (chart.to - chart.from);
  chart.gaps = () => [[0, 0.3], [0.32, 0.7], [0.72, 1]].map((ends) => ends.map(at));
  chart.text = (plot, text, x) => {
    if (text.startsWith(chart.texts.no_data)) written.push([x, chart.measured(text, 12) * uPlot.pxRatio]);
    return 0;
  };
  chart.selected = pen.tag;
  pen.on = true;
  chart.texts.no_data ??= "no data";
  chart.gapLabels(chart.plot);
  return written; }"""
NAMES = """() => { const { chart } = document.querySelector("[data-panel]"), most = chart.measured("Conveyor 1 · Actual sp", 13, true);
  const names = [1, 2, 3].map((n) => `Conveyor 1 · Actual speed, section ${n}`);
  const short = names.map((name) => chart.fitted(name, most, 13, true));
  return [short, short.every((name) => chart.measured(name, 13, true) <= most)]; }"""

APART = """async () => { const { apart } = await import("/static/js/names.js");
  const fit = (text) => text.length > 16 ? `${text.slice(0, 8)}…${text.slice(-7)}` : text;
  const crane = ["Hoist, drive 1", "Hoist, drive 2", "Trolley, drive"].map((name) => `Crane 1 · ${name}: motor speed`);
  return apart(["Ventilator 1 · Motor speed", "Ventilator 2 · Motor speed", "Axis 1 · Speed", ...crane], fit); }"""

WRITTEN = """async () => { // with a time that is written at the very beginning of the axis
  const { chart } = document.querySelector("[data-panel]"), minutes = 600e6;
  const brush = CanvasRenderingContext2D.prototype, { fillText } = brush;
  let written = [];
  brush.fillText = function (text, x, y) {
    const ink = this.measureText(text), at = this.getTransform().transformPoint({ x, y });
    written.push([text, at.x - ink.actualBoundingBoxLeft, at.y - ink.actualBoundingBoxAscent,
      at.x + ink.actualBoundingBoxRight, at.y + ink.actualBoundingBoxDescent]);
    return fillText.call(this, text, x, y);
  };
  chart.from = Math.floor(chart.from / minutes) * minutes;
  chart.to = chart.from + minutes;
  chart.draw();
  await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
  brush.fillText = fillText;
  return written; }"""


def seen(page: Page, server: PogonServer, machine: str) -> None:
    page.goto(f"{server.url}/equipment/{machine}")
    expect(page.locator('[data-panel][data-state="ready"]')).to_be_attached(timeout=30_000)


def test_what_has_no_sign_has_no_scale_below_zero(page: Page, demo: PogonServer) -> None:
    seen(page, demo, "m2")
    found = page.evaluate(SCALES)
    assert len(found) >= 9, "speed or current of the drive in every kind of scale"
    for axis, tag, value, low, high in found:
        assert 0 <= low <= value <= high and low < high, (axis, tag, value, low, high)


def test_a_dot_lies_on_the_line_and_at_a_column_on_its_last_value(page: Page, demo: PogonServer) -> None:
    seen(page, demo, "m1")
    told = page.evaluate(WIDE)
    assert len(told) > 12
    for shown, expected in told:
        assert abs(shown - expected) < 1e-6, (shown, expected)


def test_no_line_leads_from_where_a_value_rested_to_where_it_went(page: Page, demo: PogonServer) -> None:
    """An axis stood for a minute and then moved within one column: no ramp is drawn over the minute."""
    seen(page, demo, "m1")
    rested, moved = page.evaluate(RESTS)
    assert rested == [0, 0, 0]
    assert moved == -35


def test_before_its_first_value_a_pen_is_nowhere(page: Page, demo: PogonServer) -> None:
    """No marker stands in the corner of the chart, and a ruler has no number there."""
    seen(page, demo, "m1")
    assert page.evaluate(BEFORE) is None


def test_no_gap_is_written_over_another(page: Page, demo: PogonServer) -> None:
    """Where two have no room the longer one is; all of them are hatched."""
    page.set_viewport_size({"width": 390, "height": 844})
    seen(page, demo, "m1")
    written = sorted(page.evaluate(GAPS))
    assert len(written) >= 1
    for (left, wide), (right, other) in pairwise(written):
        assert right - left > (wide + other) / 2, written


def test_names_without_room_stay_apart(page: Page, demo: PogonServer) -> None:
    """Points of one machine differ at the ends of their names."""
    seen(page, demo, "m1")
    short, fits = page.evaluate(NAMES)
    assert len(set(short)) == 3 and all("…" in one for one in short) and fits, short


def test_names_that_read_alike_lose_what_they_have_in_common(page: Page, demo: PogonServer) -> None:
    seen(page, demo, "m1")
    told = page.evaluate(APART)
    assert told == [
        "Ventilator 1…",
        "Ventilator 2…",
        "Axis 1 · Speed",
        "Hoist, drive 1…",
        "Hoist, drive 2…",
        "Trolley, drive…",
    ]


def test_the_first_time_stands_below_the_scale_and_not_in_it(page: Page, demo: PogonServer) -> None:
    seen(page, demo, "m1")
    written = page.evaluate(WRITTEN)
    times = [one for one in written if ":" in one[0]]
    numbers = [one for one in written if one[0].lstrip("−").replace("\u202f", "").isdigit()]
    assert times and numbers
    for text, left, top, right, bottom in times:
        near = [
            one
            for one in numbers
            if one[1] < right + 2 and left < one[3] + 2 and one[2] < bottom + 2 and top < one[4] + 2
        ]
        assert near == [], (text, left, top, right, bottom)
