"""Nothing is cut, shortened, covered or beyond the edge for who operates a machine, who is shown more, in every language at every size."""

import shutil
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from app import bundled
from tests.browser.looks import BOTH, CUT, FAULTS, SIZES, STOP, wrong
from tests.browser.station import LANGUAGES, Sit, Stations, lay_out, let_go, origin, serving, speak, take
from tests.browser.test_layout_machines import MACHINES

PUT_BACK = f"""() => {{ // in one go, before the next answer hides it again
  const back = document.querySelector("[data-command='m2.put_back']");
  back.hidden = false;
  back.ariaDisabled = null;
  return [...({CUT})(), ...({BOTH})()];
}}"""


@pytest.mark.parametrize("lang", LANGUAGES)
def test_nothing_is_cut_for_who_operates_a_machine(abnormal: Page, lang: str) -> None:
    """Who holds control is shown more: his commands are all there at once, as large as a finger needs, and Stop is."""
    page, url = abnormal, origin(abnormal)
    speak(page, lang, url)
    found: list[str] = []
    for machine in MACHINES:
        page.goto(f"{url}/equipment/{machine}", wait_until="load")
        expect(page.locator("body")).to_have_attribute("data-live", "live")
        lay_out(page, *SIZES["panel"])
        take(page)
        for size, (width, height, profile) in SIZES.items():
            lay_out(page, width, height, profile)
            found += [f"{lang} {machine} {size}: {one}" for one in wrong(page, size)]
            found += [f"{lang} {machine} {size}: no Stop in sight" for _ in range(not page.evaluate(STOP, height))]
        lay_out(page, 1024, 768, "desk")
        found += [f"{lang} {machine} ten inches: {one}" for one in (*page.evaluate(CUT), *page.evaluate(FAULTS))]
        lay_out(page, *SIZES["panel"])
        let_go(page)
    assert found == [], "\n".join(["", *found])


@pytest.mark.parametrize("lang", LANGUAGES)
def test_why_a_sequence_is_aborted_hides_none_of_its_steps(abnormal: Page, lang: str) -> None:
    """At 1280x800 every step of eight is seen, whatever was lost and however long its name is."""
    page, url = abnormal, origin(abnormal)
    speak(page, lang, url)
    page.goto(f"{url}/equipment/seq1", wait_until="load")
    lay_out(page, *SIZES["panel"])
    file = bundled("plants/demo") / "sequences" / "coil_transport.toml"
    abort = tomllib.loads(file.read_text("utf-8"))["abort"].values()
    most = max((one["missing"][lang] for one in abort), key=len)
    lowest, above = page.evaluate(
        """(text) => { const cell = document.querySelector('.q-abort td:last-child'); cell.innerHTML = `<b>${text}</b>`;
           return ['.seqt tbody:not(.q-abort) tr:last-child', '.q-abort td'].map((one, n) =>
             document.querySelector(one).getBoundingClientRect()[n ? 'top' : 'bottom']); }""",
        f"{most} · {len(abort) - 1} more",
    )
    assert lowest <= above + 1


def other_plant(folder: Path) -> Path:
    """A plant in `folder` that is not the demo: a drive with automatic steps and four values for a run, and a line of five belts."""
    plant = folder / "plant"
    shutil.copytree(bundled("plants/drive_steps"), plant)
    belts = (bundled("plants/belts") / "plant.toml").read_text("utf-8")
    with (plant / "plant.toml").open("a", encoding="utf-8") as file:
        file.write("\n" + belts[belts.index("[links.line]") :])
    steps = plant / "sequences" / "automatic_steps.toml"
    text, more = steps.read_text("utf-8"), ""
    for key, label in (("pause", "Stillstand zwischen den Fahrten"), ("cooling", "Nachlaufzeit des Lüfters")):
        label = ", ".join(f'{lang} = "{label}"' for lang in LANGUAGES)
        more += f'[[recipe]]\nkey = "{key}"\nlabel = {{ {label} }}\nunit = "s"\ndecimals = 1\nminimum = 0\nmaximum = 40\ndefault = 10\n\n'
    steps.write_text(text.replace("[[steps]]", more + "[[steps]]", 1), "utf-8")
    return folder


@pytest.fixture(scope="module")
def other(stations: Stations, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    """A page of another plant."""
    with serving(other_plant(tmp_path_factory.mktemp("other")), {"ana": ("engineer", "operator")}) as running:
        seat = Sit(stations, running, {}, "ana", "/equipment/steps1")
        yield seat()
        seat.leave()


@pytest.mark.parametrize("lang", LANGUAGES)
def test_nothing_is_cut_in_a_plant_with_more_of_everything(other: Page, lang: str) -> None:
    """The run's four values, the editor, a drive that a sequence runs, five belts while somebody moves them."""
    page, url = other, origin(other)
    speak(page, lang, url)
    found: list[str] = []
    for path in (
        "/equipment/steps1",
        "/equipment/steps1/definition",
        "/equipment/m1",
        "/equipment/c5",
        "/equipment/c5/page/ramp",
    ):
        page.goto(url + path, wait_until="load")
        expect(page.locator("body")).to_have_attribute("data-live", "live")
        lay_out(page, *SIZES["panel"])
        held = page.locator("[data-token=take]").count() > 0
        if held:
            take(page)
        for size, (width, height, profile) in SIZES.items():
            lay_out(page, width, height, profile)
            found += [f"{lang} {path} {size}: {one}" for one in wrong(page, size)]
        lay_out(page, 1024, 768, "desk")
        found += [f"{lang} {path} ten inches: {one}" for one in page.evaluate(FAULTS)]
        lay_out(page, *SIZES["panel"])
        if held:
            let_go(page)
    assert found == [], "\n".join(["", *found])


@pytest.mark.parametrize("lang", LANGUAGES)
def test_a_command_more_hides_no_other(abnormal: Page, lang: str) -> None:
    """What puts the former frequency back comes on top of all others when a server died while somebody jogged."""
    page, url = abnormal, origin(abnormal)
    speak(page, lang, url)
    page.goto(f"{url}/equipment/m2", wait_until="load")
    expect(page.locator("body")).to_have_attribute("data-live", "live")
    lay_out(page, *SIZES["panel"])
    take(page)
    found: list[str] = []
    for size in ("panel", "small", "wide"):
        lay_out(page, *SIZES[size])
        found += [f"{lang} {size}: {one}" for one in page.evaluate(PUT_BACK)]
    lay_out(page, *SIZES["panel"])
    let_go(page)
    assert found == [], "\n".join(["", *found])


@pytest.mark.parametrize("lang", LANGUAGES)
def test_the_review_of_a_value_is_whole(abnormal: Page, lang: str) -> None:
    """Nothing of it is beside the column, where one would have to scroll for the button that sets."""
    page, url = abnormal, origin(abnormal)
    speak(page, lang, url)
    page.goto(f"{url}/equipment/m1", wait_until="load")
    expect(page.locator("body")).to_have_attribute("data-live", "live")
    lay_out(page, *SIZES["panel"])
    take(page)
    page.fill(".sp-field [name=argument]", "12")
    page.press(".sp-field [name=argument]", "Enter")
    expect(page.locator(".review-form .review")).to_be_visible()
    found: list[str] = []
    for size in ("panel", "small", "wide"):
        lay_out(page, *SIZES[size])
        beside = page.locator(".op-list").evaluate("(list) => list.scrollWidth - list.clientWidth")
        found += [f"{lang} {size}: {beside} px beside the column" for _ in range(beside > 0)]
        found += [f"{lang} {size}: {one}" for one in page.evaluate(FAULTS)]
    lay_out(page, *SIZES["panel"])
    page.click(".review-form [data-cancel]")
    let_go(page)
    assert found == [], "\n".join(["", *found])
