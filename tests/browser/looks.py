"""What is looked for on a page, whichever it is: what is cut, shortened, covered, too small for a finger or closed to a screen reader."""

from collections.abc import Iterable

from playwright.sync_api import Page, expect

from tests.browser.station import AXE, lay_out
from tests.conftest import ROOT
from tools.pictures import MARKS

FAULTS = (ROOT / "tools" / "faults.js").read_text("utf-8")
SIZES = {
    "panel": (1280, 800, "desk"),
    "small": (800, 480, "panel-9"),
    "phone": (390, 844, "desk"),
    "wide": (1920, 1080, "desk"),
}
LONGEST = """(byWord) => { // every state as its longest text or the one of the longest word, until the next value of its point comes
  const length = (text) => (byWord ? Math.max(...text.split(/[ \\u00ad]/).map((word) => word.length)) : text.length);
  for (const element of document.querySelectorAll('main [data-texts], aside [data-texts]')) {
    if (element.children.length || element.tagName === 'tspan') continue;
    const { texts, pattern } = element.dataset;
    const [longest] = Object.values(JSON.parse(texts)).filter((text) => typeof text === 'string')
      .sort((a, b) => length(b) - length(a));
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
EACH_WAY = """
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
"""The end of a script that has `zone`, the place of the commands, and `look`, which fills the set `found`: it looks in every way of
operating and leaves the chosen one."""
CUT = (
    """() => { // commands that lie under Stop or that one has to scroll for, whichever way of operating is chosen
  const found = new Set(), zone = document.querySelector('.zone:has(.cmd.stop)');
  if (!zone) return [];
  const stop = zone.querySelector('.cmd.stop');
  const look = () => {
    const end = Math.min(stop.getBoundingClientRect().top, zone.querySelector('.op-list').getBoundingClientRect().bottom);
    for (const one of zone.querySelectorAll('.cmd:not(.stop), .token'))
      if (one.checkVisibility() && one.getBoundingClientRect().bottom > end + 1)
        found.add(`"${one.textContent.trim().replace(/\\s+/g, ' ').slice(0, 40)}" lies lower than where the commands end`);
  };"""
    + EACH_WAY
)
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
AXE_RUN = """axe.run(document, {resultTypes: ['violations'], preload: false}).then(({ violations }) => violations.map(
  ({ id, nodes }) => `${id} ${nodes.length}: ${nodes[0].html.slice(0, 160)}`))"""
ENGINEERED = ("parameters", "/events", "/compare", "/encoder", "/fault-buffer", "/definition")
"""Ends of pages of a machine on which nobody operates it."""
LOOKED_AT = {"hr": "light", "cs": "dark"}
"""Language → theme in which no page has a barrier; each test of what a page does looks at others."""
BOTH = f"() => {{ ({LONGEST})(); return ({FAULTS[FAULTS.index('() =>') :].strip()})(); }}"


def open_page(page: Page, url: str) -> None:
    """Go there, until it is drawn and, if it lives, alive; what is refused is no page to look at, but one that is not there is."""
    answer = page.goto(url, wait_until="load")
    assert answer is not None and answer.status in (200, 404), url
    if page.locator("body[data-live]").count():
        expect(page.locator("body")).to_have_attribute("data-live", "live")
    page.evaluate("document.fonts.ready.then(() => 1)")


def looked_at(page: Page, root: str, paths: Iterable[str], lang: str) -> list[str]:
    """What is wrong with these pages in a language at any size, each loaded once; Stop has to be in sight where a machine is operated."""
    found: list[str] = []
    theme = LOOKED_AT.get(lang, "auto")
    page.context.add_cookies([{"name": "pogon_theme", "value": theme, "url": root}])
    for path in paths:
        open_page(page, root + path)
        found += [f"{lang} {path}: {mark} is no text" for mark in MARKS.findall(page.inner_text("body"))]
        if lang in LOOKED_AT:
            page.evaluate(AXE.read_text("utf-8"))
            found += [f"{lang} {path} {theme}: {one}" for one in page.evaluate(AXE_RUN)]
        for size, (width, height, profile) in SIZES.items():
            lay_out(page, width, height, profile)
            if size != "phone" and page.evaluate("document.documentElement.scrollHeight") > height:
                found.append(f"{lang} {path} {size}: the page is higher than the screen")
            found += [f"{lang} {path} {size}: {one}" for one in wrong(page, size)]
            if path.startswith("/equipment/") and not path.endswith(ENGINEERED):
                found += [f"{lang} {path} {size}: no Stop in sight" for _ in range(not page.evaluate(STOP, height))]
    return found


def wrong(page: Page, size: str) -> list[str]:
    """What is wrong with the page as it stands at a size."""
    found = [] if size == "phone" else page.evaluate(CUT)
    return [*found, *page.evaluate(SMALLEST, FLOORS[size]), *page.evaluate(BOTH)]
