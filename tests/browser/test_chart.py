"""A chart tells nothing that cannot be: no scale below zero for what has no sign, and dots lie on their lines, at stored values."""

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
  const column = (i) => ({ at: first + i * step, first: 10 * i, low: 10 * i, high: 10 * i + 9, last: 10 * i + 7, level: 0, count: 99 });
  pen.items = Array.from({ length: 8 }, (_, i) => column(i));
  chart.draw();
  for (const item of pen.items) told.push([chart.at(pen, item.at), item.last]);
  const [xs, ys] = pen.line;
  for (let i = 0; i + 1 < xs.length; i++) told.push([chart.at(pen, (xs[i] + xs[i + 1]) / 2 * 1e6), (ys[i] + ys[i + 1]) / 2]);
  return told; }"""


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
