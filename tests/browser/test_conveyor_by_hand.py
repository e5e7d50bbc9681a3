"""A line of belts by hand and by keys in a real browser: one belt alone, every command on a small panel, nothing that needs a mouse."""

import re
import time
from collections.abc import Callable, Iterator

import pytest
from playwright.sync_api import Locator, Page, expect

from tests.browser.station import Sit, serving, take
from tests.conftest import PogonServer
from tests.line_plant import plant

WHO, HOME = "ivana", "/equipment/c1"
PLANT = plant('start = "stopped", arrivals = 0')


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PogonServer]:
    """One Pogon with a line that stands, empty."""
    folder = tmp_path_factory.mktemp("by-hand")
    (folder / "plant").mkdir()
    (folder / "plant" / "plant.toml").write_text(PLANT, "utf-8")
    with serving(folder) as running:
        yield running


def manual(page: Page) -> None:
    """Hand mode, by the switch."""
    mode = page.locator(".c-mode button").nth(1)
    if mode.get_attribute("aria-pressed") != "true":
        expect(mode).not_to_have_attribute("aria-disabled", "true", timeout=30_000)
        mode.click()
    expect(mode).to_have_attribute("aria-pressed", "true", timeout=30_000)


def whole(button: Locator) -> bool:
    """Whether a button can be seen whole and nothing lies over it."""
    return bool(
        button.evaluate(
            """(button) => {
              const { left, right, top, bottom } = button.getBoundingClientRect();
              return [[left + 3, top + 3], [right - 3, top + 3], [left + 3, bottom - 3], [right - 3, bottom - 3]]
                .every(([x, y]) => document.elementFromPoint(x, y)?.closest('button') === button);
            }"""
        )
    )


def belts(page: Page) -> list[bool]:
    """Which belts run as they are drawn, at one moment."""
    found: list[bool] = page.locator(".c-belt").evaluate_all("all => all.map((belt) => belt.classList.contains('run'))")
    return found


def runs_alone(page: Page, belt: int, press: Callable[[], None], let_go: Callable[[], None]) -> None:
    """Press until this belt runs, and see that no other one does.

    A station that is too busy to keep the motion alive lets go, as it must; then it is pressed anew.
    """
    alone = [number == belt for number in range(3)]
    for _ in range(4):
        press()
        end = time.monotonic() + 20
        while time.monotonic() < end:
            seen = belts(page)
            assert seen in (alone, [False] * 3), "another belt runs"
            if seen == alone:
                return
            page.wait_for_timeout(50)
        let_go()
        page.wait_for_timeout(500)
    raise AssertionError(f"the belt does not run: {page.inner_text('#message')}")


@pytest.mark.parametrize("lang", ["hr", "en", "de", "cs"])
def test_a_small_panel_has_every_command(sit: Sit, lang: str) -> None:
    page = sit(lang=lang, viewport={"width": 800, "height": 480})
    take(page)
    shared = [f".c-edit [data-part='c1.{key}']" for key in ("edit_product", "delete_product", "insert_product")]
    shared += ["[data-part='c1.reset']", "[data-part='c1.confirm_positions']", ".zone .stop", ".c-mode button >> nth=0"]
    if page.locator(".c-mode button").nth(1).get_attribute("aria-pressed") != "true":
        for key in (*shared, ".c-op .op-list > [data-command='c1.start_automatic']"):
            assert whole(page.locator(key).first), key
    manual(page)
    always = shared[-2:]
    for key in (*always, "[data-hold='c1.jog_forward']", "[data-hold='c1.jog_reverse']", ".c-belts label >> nth=3"):
        found = page.locator(key).first
        assert whole(found) if found.evaluate("e => e.localName") == "button" else found.is_visible(), key
    page.locator(".c-way .op-more").click()
    for key in shared:
        assert whole(page.locator(key).first), key


def test_one_belt_moves_by_hand_and_the_others_stand(sit: Sit) -> None:
    page = sit(viewport={"width": 800, "height": 480})
    take(page)
    manual(page)
    page.locator(".c-belts label").nth(2).click()
    expect(page.locator("[data-hold='c1.jog_forward']")).to_be_hidden()
    button = page.locator("[data-hold='c1.jog_forward_2']")
    expect(button).to_be_visible()
    box = button.bounding_box()
    assert box
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    runs_alone(page, 1, page.mouse.down, page.mouse.up)
    page.mouse.up()
    expect(page.locator(".c-belt").nth(1)).not_to_have_class(re.compile(r"\brun\b"), timeout=30_000)
    page.locator(".c-belts input").nth(2).focus()
    page.keyboard.press("ArrowRight")
    page.locator("[data-hold='c1.jog_reverse_3']").focus()
    runs_alone(page, 2, lambda: page.keyboard.down(" "), lambda: page.keyboard.up(" "))
    expect(page.locator(".c-line .cap").first).to_contain_text("Right to left")
    page.keyboard.up(" ")
    expect(page.locator(".c-belt").nth(2)).not_to_have_class(re.compile(r"\brun\b"), timeout=30_000)


def test_who_has_no_mouse_starts_stops_puts_edits_and_deletes(sit: Sit) -> None:
    page = sit()

    def to(locator: Locator) -> None:
        """Go on with Tab until the focus is there, and see that it shows."""
        for _ in range(80):
            if locator.evaluate("e => e === document.activeElement"):
                break
            page.keyboard.press("Tab")
        expect(locator).to_be_focused()
        width = locator.evaluate("e => getComputedStyle(e).outlineWidth")
        assert float(width.removesuffix("px")) >= 2, "the focus shows"

    def answer(first: Locator | None, **fields: str) -> None:
        """Fill the dialog that opened and say yes; the focus comes back to where it was, if that is still there."""
        dialog = page.locator("#overlay dialog[data-ask]")
        expect(dialog.locator("[data-cancel]")).to_be_focused()
        for name, text in fields.items():
            field = dialog.locator(f"[name={name}]")
            for _ in range(12):
                if field.evaluate("e => e === document.activeElement"):
                    break
                page.keyboard.press("Shift+Tab")
            page.keyboard.press("Control+A")
            page.keyboard.type(text)
        yes = dialog.locator(".danger")
        for _ in range(12):
            if yes.evaluate("e => e === document.activeElement"):
                break
            page.keyboard.press("Tab")
        page.keyboard.press("Enter")
        expect(dialog).to_have_count(0, timeout=30_000)
        if first is not None:
            expect(first).to_be_focused()

    take_it = page.locator("[data-token=take]")
    to(take_it)
    page.keyboard.press("Enter")
    expect(page.locator(".token")).to_have_attribute("data-holding", "mine")
    insert = page.locator("[data-part='c1.insert_product']")
    expect(insert).not_to_have_attribute("aria-disabled", "true", timeout=30_000)
    to(insert)
    page.keyboard.press("Enter")
    answer(insert, arg_head="300", arg_length="40", reason="put by hand")
    row = page.locator(".prods tr[data-product]")
    expect(row).to_have_count(1, timeout=30_000)
    name = row.locator(".c-id")
    to(name)
    page.keyboard.press("Enter")
    expect(page.locator("#overlay dialog")).to_contain_text("Product #")
    edit = page.locator("#overlay [data-arguments*='edit_product']")
    to(edit)
    page.keyboard.press("Enter")
    answer(name, arg_head="320.5", reason="it lies further")
    expect(page.locator(".prods td").first).to_have_text("320.5", timeout=30_000)
    mode, start = (
        page.locator(".c-mode button").first,
        page.locator(".c-op .op-list > [data-command='c1.start_automatic']"),
    )
    to(mode)
    page.keyboard.press("Enter")
    expect(mode).to_have_attribute("aria-pressed", "true", timeout=30_000)
    expect(start).not_to_have_attribute("aria-disabled", "true", timeout=30_000)
    to(start)
    page.keyboard.press("Enter")
    answer(start)
    expect(page.locator(".c-line h2")).to_contain_text("Automatic", timeout=30_000)
    stop = page.locator(".zone .stop")
    to(stop)
    page.keyboard.press("Enter")
    expect(page.locator("#message")).to_contain_text(re.compile("Stop: Accepted .* Done"), timeout=30_000)
    if row.count():
        to(name)
        page.keyboard.press("Enter")
        to(page.locator("#overlay [data-arguments*='delete_product']"))
        page.keyboard.press("Enter")
        answer(None, reason="taken off")
        expect(row).to_have_count(0, timeout=30_000)
