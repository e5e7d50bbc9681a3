"""A line of belts in a real browser: products move without jumps, a jam is seen and overcome, records are corrected with a reason."""

import itertools
import re
import time
from collections.abc import Iterator
from typing import Any

import pytest
from playwright.sync_api import Page, expect

from tests.browser.station import AXE, LANGUAGES, Sit, built, fault, heard, instruct, serving, take
from tests.conftest import PogonServer
from tests.line_plant import plant

WHO, HOME = "ivana", "/equipment/c1"
GLIDES = "no-preference"
PLANT = plant(
    'start = "automatic", automatic_speed = 70.0, unload_dwell = 0.2, interval = 3, shortest = 25, longest = 45'
)
ENDS = """(group) => {
  const box = group.querySelector('.p-box'), width = parseFloat(getComputedStyle(box).width);
  const to = group.parentNode.getCTM().inverse().multiply(box.getCTM());
  const head = group.parentNode.getCTM().inverse().multiply(group.querySelector('.p-head').getCTM()).e;
  const ends = [to.e, to.e + to.a * width].sort((a, b) => a - b);
  return { id: group.querySelector('.p-id').textContent, left: ends[0], right: ends[1], head };
}"""
"""Where the ends of the box of a product and its thick edge are drawn at this very moment [user units]."""
DRAWN = f"() => [...document.querySelectorAll('.prod:not([display])')].map({ENDS})"
PUT = """async (cells) => {
  const given = Object.entries(cells).map(([key, value]) => [`product_20_${key}`, { value, state: 'good' }]);
  const look = () => {
    const group = document.querySelector('[data-slot="20"]');
    group.dispatchEvent(new CustomEvent('tags', { bubbles: true, detail: Object.fromEntries(given) }));
    return group;
  };
  let group = look();
  await null; await null;
  while (!group.querySelector('.p-body').style.transform) {  // the picture came anew, and its script has not seen it yet
    await new Promise(requestAnimationFrame);
    group = look();
    await null; await null;
  }
  return group;
}"""
"""Draws a product with these cells in the last slot, and gives its group at once: before the next frame."""
FOLLOW = f"""(product) => new Promise((done) => {{
  const ends = {ENDS}, named = (group) => group.querySelector('.p-id').textContent === product;
  const group = [...document.querySelectorAll('.prod:not([display])')].find(named), seen = [], began = document.timeline.currentTime;
  (function look() {{
    const now = document.timeline.currentTime - began, there = !group.hasAttribute('display') && named(group);
    if (there) {{
      const {{ head, right }} = ends(group);
      seen.push([now, head, right]);
    }}
    if (!there || now > 40000) done(seen); else requestAnimationFrame(look);
  }})();
}})"""
"""Time [ms], head edge and right end of the box of one product at every frame until it is gone.

The time is that of the frame, by which what glides is drawn: a busy machine asks later.
"""


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PogonServer]:
    """One Pogon with one line, with an engineer and an operator."""
    folder = tmp_path_factory.mktemp("line")
    (folder / "plant").mkdir()
    (folder / "plant" / "plant.toml").write_text(PLANT, "utf-8")
    with serving(folder) as running:
        yield running


def run(page: Page) -> None:
    """Have the line run by itself, from its beginning: whatever the last test left may hold it up."""
    take(page)
    built(page, "c1")
    heard(page, "c1.state")  # what the page says of the line as it was before would be taken for what it does now
    page.reload()
    page.wait_for_selector(".prods tr[data-product], .prod:not([display])", timeout=30_000, state="detached")
    if "Automatic" not in page.inner_text(".c-line h2"):
        page.click(".zone .stop")
        expect(page.locator("#message")).to_contain_text(re.compile("Stop: Accepted .* Done"), timeout=30_000)
        if page.locator("[data-command='c1.reset']").get_attribute("aria-disabled") is None:
            reset(page)
        start(page)
    expect(page.locator(".c-line h2")).to_contain_text("Automatic", timeout=30_000)


def start(page: Page) -> None:
    """Choose automatic, which starts nothing, and start it."""
    mode = page.locator(".c-mode button").first
    if mode.get_attribute("aria-pressed") != "true":
        expect(mode).not_to_have_attribute("aria-disabled", "true", timeout=30_000)
        mode.click()
        expect(mode).to_have_attribute("aria-pressed", "true", timeout=30_000)
        expect(page.locator(".c-line h2")).to_contain_text("Stopped")
    button = page.locator(".c-op .op-list > [data-command='c1.start_automatic']")
    expect(button).not_to_have_attribute("aria-disabled", "true", timeout=30_000)
    button.click()
    page.locator("#overlay .danger").click()
    # who leaves the page sooner may take the order along with it
    expect(page.locator("#message")).to_contain_text(re.compile("Start automatic: Accepted .* Done"), timeout=30_000)


def reset(page: Page) -> None:
    page.click("[data-command='c1.reset']")
    expect(page.locator("#message")).to_contain_text(re.compile("reset: Accepted .* Done"), timeout=30_000)


def drawn(page: Page, product: str = "") -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = page.evaluate(DRAWN)
    return [one for one in found if product in ("", one["id"])]


@pytest.mark.always
def test_a_product_goes_from_entry_to_unloading_without_a_jump(sit: Sit) -> None:
    page = sit(reduced_motion=GLIDES)
    run(page)
    page.wait_for_selector(".prod[data-state='2']:not([display])", timeout=30_000, state="attached")
    product = page.locator(".prod[data-state='2'] .p-id").first.text_content() or ""
    unloaded = int(page.inner_text(".c-counts dd >> nth=1"))
    expect(page.locator(f".prods tr[data-product='{product}']")).to_have_count(1)
    seen = page.evaluate(FOLLOW, product)
    heads = [head for _, head, _ in seen]
    steps = [later - sooner for sooner, later in itertools.pairwise(heads)]
    pauses = [later[0] - sooner[0] for sooner, later in itertools.pairwise(seen)]
    assert len(seen) > 200 and heads[-1] > 880, "it was followed to the end"
    assert min(steps) > -12, "never back by more than a correction"
    # 70 % are 66 mm/s = 87 units a second; a step is as long as its pause, and a correction of at most 5 mm glides in.
    assert all(step < 0.25 * pause + 8 for step, pause in zip(steps, pauses, strict=True)), max(steps)
    assert max(abs(head - right) for _, head, right in seen) < 0.01, "the thick edge is the end of its product"
    expect(page.locator(f".prods tr[data-product='{product}']")).to_have_count(0)
    expect(page.locator(".c-counts dd").nth(1)).not_to_have_text(str(unloaded))


def test_another_product_in_the_same_slot_does_not_glide_there(sit: Sit) -> None:
    page = sit(reduced_motion=GLIDES)
    places = page.evaluate(
        f"""() => {{
          const put = {PUT}, place = async (id, head) => {{
            const body = (await put({{ id, state: 1, head, tail: head - 30, direction: 0 }})).querySelector('.p-body');
            return [new DOMMatrix(getComputedStyle(body).transform).m41, new DOMMatrix(body.style.transform).m41];
          }};
          return (async () => [await place(901, 600), await place(901, 603), await place(902, 140), await place(902, 500)])();
        }}"""
    )
    (first, there), (gliding, target), (other, place), (jumped, far) = places
    assert first == pytest.approx(there) and other == pytest.approx(place) and jumped == pytest.approx(far)
    assert gliding < target - 2, "a small step glides"


def test_the_thick_edge_changes_ends_when_the_line_reverses_and_the_product_stays(sit: Sit) -> None:
    page = sit(reduced_motion=GLIDES)
    forward, backward = page.evaluate(
        f"""async () => {{
          const ends = {ENDS}, put = {PUT}, product = {{ id: 903, state: 1 }};
          return [ends(await put({{ ...product, head: 330, tail: 300, direction: 0 }})),
                  ends(await put({{ ...product, head: 300, tail: 330, direction: 1 }}))];
        }}"""
    )
    assert (forward["left"], forward["right"]) == pytest.approx((backward["left"], backward["right"]))
    assert forward["head"] == pytest.approx(forward["right"]) and backward["head"] == pytest.approx(backward["left"])


def test_who_wants_no_motion_gets_none(sit: Sit) -> None:
    page = sit(reduced_motion="reduce")
    page.wait_for_selector(".prod:not([display])", timeout=30_000, state="attached")
    assert page.evaluate("getComputedStyle(document.querySelector('.p-body')).transitionDuration") == "0s"


def test_a_jam_stops_the_line_says_why_and_is_overcome(sit: Sit) -> None:
    page = sit(reduced_motion=GLIDES)
    run(page)
    fault(page, "c1", 2)
    expect(page.locator(".c-first")).to_contain_text(
        re.compile(r"Stopped: section 2, belt jammed\s*\d\d:\d\d:\d\d\.\d{3}"), timeout=30_000
    )
    expect(page.locator(".c-belt").nth(1)).to_have_class(re.compile(r"\bjam\b"))
    expect(page.locator(".c-belt").nth(0)).not_to_have_class(re.compile(r"\bjam\b"))
    expect(page.locator(".banner")).to_contain_text("jammed")
    expect(page.locator(".c-op .op-list > [data-command='c1.start_automatic']")).to_have_attribute(
        "aria-disabled", "true"
    )
    before: list[float] | None = None
    end = time.monotonic() + 15
    while (now := [one["left"] for one in drawn(page)]) != before:  # the other belts run out along their ramps
        assert time.monotonic() < end, f"something still moves: {before}, {now}"
        before = now
        page.wait_for_timeout(1000)
    fault(page, "c1", 0)
    reset(page)
    expect(page.locator(".c-first p")).to_have_count(0)
    page.click(".c-op .op-list > [data-command='c1.start_automatic']")
    expect(page.locator("#overlay dialog")).to_contain_text("Start automatic")
    page.locator("#overlay .danger").click()
    expect(page.locator(".c-line h2")).to_contain_text("running", timeout=30_000)
    expect(page.locator(".c-belt").nth(1)).to_have_class(re.compile(r"\brun\b"))


def test_an_engineer_deletes_a_product_with_a_reason(sit: Sit) -> None:
    page = sit()
    run(page)
    page.wait_for_selector(".prods tr[data-product] >> nth=1", timeout=30_000)
    page.click(".c-edit >> text=Delete")
    expect(page.locator("#message")).to_contain_text("Choose a product")
    row = page.locator(".prods tr[data-product]").first
    product = row.get_attribute("data-product") or ""
    page.locator(f".prods tr[data-product='{product}'] td >> nth=3").click()
    expect(page.locator(f".prods tr[data-product='{product}']")).to_have_attribute("aria-selected", "true")
    expect(page.locator(".prod.chosen .p-id")).to_have_text(product)
    page.click(".c-edit >> text=Delete")
    dialog = page.locator("#overlay dialog")
    expect(dialog).to_contain_text(f"#{product}")
    expect(dialog.locator("[data-cancel]")).to_be_focused()
    dialog.locator(".danger").click()
    expect(dialog).to_be_visible()  # a reason is required
    dialog.locator("[name=reason]").fill("taken off the belt")
    dialog.locator(".danger").click()
    expect(page.locator(f".prods tr[data-product='{product}']")).to_have_count(0)
    expect(page.locator("#message")).to_contain_text(re.compile("Accepted .* Done"))
    expect(page.locator(".prod:not([display]) .p-id", has_text=re.compile(f"^{product}$"))).to_have_count(0)


def test_an_operator_is_told_why_not(sit: Sit) -> None:
    page = sit("ivo")
    take(page)
    remove = page.locator(".c-edit [data-part='c1.delete_product']")
    expect(remove).to_have_attribute("aria-disabled", "true")
    remove.click(force=True)
    expect(page.locator("#message")).to_contain_text("Delete:")
    expect(page.locator("#overlay dialog")).to_have_count(0)
    expect(page.locator(".c-sim")).to_have_count(0)


def test_a_product_is_reached_with_the_keyboard(sit: Sit) -> None:
    page = sit()
    run(page)
    page.wait_for_selector(".prod[data-state='1']:not([display])", timeout=30_000, state="attached")
    page.evaluate("document.querySelector(\".prod[data-state='1']:not([display])\").focus()")
    product = page.evaluate("document.activeElement.querySelector('.p-id').textContent")
    assert page.evaluate("document.activeElement.querySelector('title').textContent") == f"Product #{product}"
    page.keyboard.press("Enter")
    expect(page.locator("#overlay dialog")).to_contain_text(f"Product #{product}")
    expect(page.locator("#overlay dialog")).to_contain_text("Head position")
    page.keyboard.press("Escape")
    expect(page.locator("#overlay dialog")).to_have_count(0)
    page.locator(f".c-id[data-row$='/{product}']").press("Enter")
    expect(page.locator("#overlay dialog")).to_contain_text(f"Product #{product}")


def test_the_hand_of_an_instructor_is_seen_at_the_sensor(sit: Sit) -> None:
    page = sit()
    page.click(".c-sim summary")
    button = page.locator(".c-press button").nth(2)
    expect(button).to_have_attribute("aria-pressed", "false")
    button.click()
    expect(page.locator(".c-press button").nth(2)).to_have_attribute("aria-pressed", "true")
    expect(page.locator(".c-sensor").nth(2)).to_have_class(re.compile(r"\bbusy\b"))
    page.locator(".c-press button").nth(2).click()
    expect(page.locator(".c-press button").nth(2)).to_have_attribute("aria-pressed", "false")


def test_positions_nobody_knows_are_not_shown(sit: Sit) -> None:
    page = sit()
    run(page)
    page.wait_for_selector(".prod:not([display])", timeout=30_000, state="attached")
    instruct(page, "c1/line", mode="1")
    try:
        expect(page.locator("[data-conveyor]")).to_have_attribute("data-q", "bad", timeout=30_000)
        expect(page.locator(".c-dead")).to_be_visible()
        expect(page.locator(".c-prods")).not_to_be_visible()
        expect(page.locator(".c-line h2")).to_contain_text("No communication")
        expect(page.locator(".c-belt").first).to_have_class(re.compile(r"\bunknown\b"))
    finally:
        instruct(page, "c1/line", mode="0")
    expect(page.locator("[data-conveyor]")).to_have_attribute("data-q", "good", timeout=30_000)
    expect(page.locator(".c-dead")).not_to_be_visible()


@pytest.mark.skipif(not AXE.is_file(), reason="axe-core is not installed")
@pytest.mark.parametrize("theme", ["light", "dark"])
def test_the_screen_can_be_read_by_everybody(sit: Sit, server: PogonServer, theme: str) -> None:
    page = sit()
    page.context.add_cookies([{"name": "pogon_theme", "value": theme, "url": server.url}])
    page.reload()
    expect(page.locator("body")).to_have_attribute("data-live", "live")
    page.evaluate(AXE.read_text("utf-8"))
    found = page.evaluate("axe.run(document, { runOnly: ['wcag2a', 'wcag2aa', 'wcag21aa'] })")
    told = [(fault["id"], [node["html"][:160] for node in fault["nodes"]][:3]) for fault in found["violations"]]
    assert not told


LONGEST = """() => {
    const live = document.querySelector(".c-stat");
    live.replaceWith(live.cloneNode(true));
    for (const one of document.querySelectorAll("[data-tag]")) one.removeAttribute("data-tag");
    const gap = document.querySelector(".c-stat .grow2");
    for (const one of gap.querySelectorAll("[data-show]")) one.hidden = ["0,1", ">0.05,bad"].includes(one.dataset.show);
    const put = (place, text) => document.querySelectorAll(place).forEach(one => { one.textContent = text; });
    put(".c-stat .val b", "123456");
    put(".c-counts dd", "12 345");
}"""
"""Shows the longest that the facts can become, with nothing closing; what is live now is no longer in the page."""
DOUBT = "(quality) => document.querySelectorAll('.c-stat .val').forEach((one) => { one.dataset.q = quality; })"
"""How far all of them can be trusted."""
OVERLAPS = """() => {
    const boxes = [...document.querySelectorAll(".c-stat > *")].filter(one => one.offsetWidth).map(one => {
        const shown = [...one.querySelectorAll("*")].filter(part => part.offsetWidth && !part.closest(".lab .push"));
        const ends = shown.map(part => part.getBoundingClientRect());
        const own = one.getBoundingClientRect();
        return [own.left, Math.max(own.right, ...ends.map(end => end.right)), own.top];
    });
    const panel = document.querySelector(".c-facts").getBoundingClientRect();
    return boxes.filter(([, right], at) => right > panel.right + 0.5
        || boxes.some(([left, , top], other) => other > at && top === boxes[at][2] && left < right)).length;
}"""


@pytest.mark.parametrize("lang", LANGUAGES)
def test_the_facts_never_run_into_each_other(sit: Sit, lang: str) -> None:
    """However far one can trust them: a mark of quality takes the room that is there."""
    page = sit(lang=lang)
    expect(page.locator('.c-stat .val:is([data-q="bad"], [data-q="none"], [data-q="stale"])')).to_have_count(0)
    page.evaluate(LONGEST)
    for size in ((1280, 800), (1024, 768), (800, 480), (390, 844)):
        page.set_viewport_size({"width": size[0], "height": size[1]})
        page.wait_for_timeout(300)
        for quality in ("good", "uncertain", "stale"):
            page.evaluate(DOUBT, quality)
            assert page.evaluate(OVERLAPS) == 0, (size, quality)
        closing = page.locator(".c-stat .lab .push").first
        assert closing.evaluate("one => one.getBoundingClientRect().width") > 40, "there is room to read it"


def test_a_stop_is_drawn_beside_the_start_without_a_reload(sit: Sit) -> None:
    page = sit()
    run(page)
    page.goto(page.url + "/page/ramp?belt=2")
    start, stop = page.locator(".c-curves > section").all()
    expect(start.locator(".c-trace")).to_have_count(3, timeout=30_000)
    before = stop.locator("header").inner_text()
    page.click(".zone .stop")
    expect(stop.locator("header")).not_to_have_text(before, timeout=30_000)
    expect(stop.locator(".c-trace")).to_have_count(3, timeout=30_000)
    expect(stop.locator(".c-ramp-facts dd").first).to_have_text(re.compile(r"[1-9][\d.]*\s–\s0\.0"), timeout=30_000)


def test_a_list_of_products_grows_under_who_reads_one_of_them(sit: Sit) -> None:
    page = sit()
    run(page)
    page.goto(page.url.partition("/equipment")[0] + "/products?equipment=c1")
    rows, chosen = page.locator("#event-list tr[data-row]"), page.locator("#event-list tr[aria-selected]")
    expect(rows).not_to_have_count(0, timeout=60_000)
    expect(page.locator("#event-detail .scroll")).to_be_visible()
    newest = rows.first.get_attribute("data-row")
    row = page.locator(f"#event-list tr[data-row='{newest}']")
    row.locator(".a-open").click()
    expect(row).to_have_attribute("aria-selected", "true")
    expect(rows.first).not_to_have_attribute("data-row", newest or "", timeout=60_000)
    expect(row).to_have_attribute("aria-selected", "true")
    expect(chosen).to_have_count(1)
    expect(row.locator(".a-open")).to_be_focused()
    expect(page.locator("#event-detail > header")).to_contain_text(row.locator("th").inner_text().strip())
