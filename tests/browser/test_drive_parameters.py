"""Drive parameters in two browsers: one writes and saves while the other reads, each with a list of its own."""

import csv
import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from app import bundled
from tests.browser.station import PASSWORD, Sit, origin, review, serving, speak, take
from tests.conftest import PogonServer

WHO, HOME = "ivana", "/equipment/d2/drive-parameters?group=ramp"


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PogonServer]:
    """One Pogon with the two drives of the bundled plant, and two engineers."""
    folder = tmp_path_factory.mktemp("drives")
    shutil.copytree(bundled("plants/sinamics"), folder / "plant")
    with serving(folder, {"ivana": ("engineer", "operator"), "petra": ("engineer", "operator")}) as running:
        yield running


def choose(page: Page, code: str, value: str) -> None:
    page.locator(f"tr[data-code={code}] .dp-add button").click()
    field = page.locator(f"#dw [data-element$=':{code}'] input[name=value]")
    field.fill(value)


def order(page: Page, action: str) -> None:
    form = page.locator(f"#dw form[action$='/{action}']")
    form.locator("[name=reason]").fill("longer ramps")
    form.locator("[name=password]").fill(PASSWORD)
    form.locator("button").click()


@pytest.mark.always
def test_one_writes_and_saves_while_the_other_reads(sit: Sit) -> None:
    page, other = sit(), sit("petra")
    take(page)
    choose(page, "p1120", "7.5")
    choose(page, "p1121", "8")
    expect(page.locator("#dw [data-element$=':p1120'] input[name=value]")).to_have_value(
        "7.5"
    )  # what was typed is kept
    review(page)
    expect(page.locator("#dw [data-element$=':p1120'] .rv-v")).to_have_text(re.compile(r"5\s*7\.5\s*s"))
    other.locator(".dp-read button").click()
    order(page, "write")
    expect(page.locator("#dw [data-result='1:p1120']")).to_have_attribute("data-done", "yes", timeout=20_000)
    expect(page.locator("#dw [data-result='1:p1121']")).to_have_attribute("data-done", "yes")
    expect(page.locator("#dw .dw-save")).to_contain_text("Unsaved changes: 2")
    expect(other.locator("#dp progress")).to_have_count(0, timeout=20_000)
    expect(other.locator("tr[data-code=p1135] td.r").first).to_have_text(re.compile(r"\d"))

    # who is not in control is told so, and the drive keeps what the first one wrote
    choose(other, "p1120", "3")
    review(other)
    expect(other.locator("#dw [data-element='1:p1120'] .rv-v")).to_contain_text("7.5")
    order(other, "write")
    expect(other.locator("#dw .dw-bad")).to_contain_text("Control held by", timeout=20_000)

    order(page, "save")
    expect(page.locator("#dw .dw-save")).to_contain_text("Nothing unsaved", timeout=20_000)
    page.locator(".dp-read button").click()
    expect(page.locator("tr[data-code=p1120] td.r").first).to_contain_text("7.5", timeout=20_000)


def test_a_set_goes_home_comes_back_changed_and_is_compared_reviewed_and_written(sit: Sit, tmp_path: Path) -> None:
    page = sit()
    take(page)
    page.locator(".dp-read button").click()
    expect(page.locator("tr[data-code=p1135] td.r").first).to_have_text(re.compile(r"\d"), timeout=20_000)
    page.locator(".p-head a[href$='/compare']").click()
    with page.expect_download() as saved:
        page.locator("a[href$='export.csv']").click()
    home = saved.value.path().read_text("utf-8-sig")
    [old] = [line for line in home.splitlines() if ";p1135;" in line]
    cells = next(csv.DictReader([home.splitlines()[0], old], delimiter=";"))
    changed = tmp_path / "changed.csv"
    changed.write_text(home.replace(old, ";".join((cells | {"value": "4.5"}).values())), "utf-8")

    # the button that chooses one speaks the language of the page, is reached by the keyboard, and says what was chosen
    for lang, choose_one in (
        ("hr", "Odaberi datoteku"),
        ("de", "Datei wählen"),
        ("cs", "Vybrat soubor"),
        ("en", "Choose a file"),
    ):
        speak(page, lang, origin(page))
        page.reload()
        expect(page.locator(".dc-choose label")).to_have_text(choose_one)
    # heard of all the time: who begins to listen when the key goes down may be told too late (Playwright)
    page.on("filechooser", lambda chooser: None)
    expect(page.get_by_role("button", name="A file Choose a file")).to_have_count(1)
    page.locator("#dc-file").focus()
    with page.expect_file_chooser():
        page.keyboard.press("Enter")
    with page.expect_file_chooser():
        page.locator(".dc-choose label").click()

    # a file with a mistake is refused whole, with its line
    wrong = tmp_path / "wrong.csv"
    wrong.write_text(home.replace(old, ";".join((cells | {"value": "fast"}).values())), "utf-8")
    page.set_input_files("#dc-file", wrong)
    expect(page.locator("#dc .dc-wrong li")).to_contain_text("fast")
    expect(page.locator("#dc-name")).to_have_text("wrong.csv")
    assert page.locator("#dc .dc-table").count() == 0

    page.set_input_files("#dc-file", changed)
    row = page.locator("#dc tr[data-same=no]")
    expect(row).to_have_count(1, timeout=20_000)
    expect(row).to_contain_text("4.5")
    page.locator("#dc .dp-read button").click()
    expect(page.locator("#dw [data-element$=':p1135'] input[name=value]")).to_have_value("4.5")
    review(page)
    order(page, "write")
    expect(page.locator("#dw [data-result$=':p1135']")).to_have_attribute("data-done", "yes", timeout=20_000)
    order(page, "save")  # the other test counts what is unsaved
    expect(page.locator("#dw .dw-save")).to_contain_text("Nothing unsaved", timeout=20_000)
    page.goto(f"{origin(page)}/equipment/d2/drive-parameters/compare")
    page.set_input_files("#dc-file", changed)
    expect(page.locator("#dc [role=alert], #dc td[colspan]")).to_be_visible(timeout=20_000)
    expect(page.locator("#dc tr[data-same=no]")).to_have_count(0)


def test_what_is_typed_is_looked_for_at_once(sit: Sit) -> None:
    """The list follows the typing, and the links of the groups keep what was typed."""
    page = sit()
    assert page.locator("#dp tr[data-code]").count() > 1
    search = page.locator("form[role=search] [name=q]")
    search.press_sequentially("p1121")
    expect(page.locator("#dp tr[data-code]")).to_have_count(1)
    expect(page.locator("#dp tr[data-code=p1121]")).to_be_visible()
    expect(page.locator("#p-groups a").first).to_have_attribute("href", re.compile("q=p1121"))
    expect(search).to_be_focused()
    expect(page).to_have_url(re.compile(r"[?&]q=p1121(&|$)"))
    page.reload()
    expect(search).to_have_value("p1121")
    expect(page.locator("#dp tr[data-code]")).to_have_count(1)
    for cell in ("td.mono", "th"):  # no line under one cell of the last row
        expect(page.locator(f"#dp tbody tr:last-child > {cell}").first).to_have_css("border-bottom-width", "0px")
    search.fill("no such thing")
    expect(page.locator("#dp tr[data-code]")).to_have_count(0)
    expect(page.locator("#dp tbody td")).to_have_count(1)  # which says that there is none
