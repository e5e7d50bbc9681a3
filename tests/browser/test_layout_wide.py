"""What is wide fits: axes of a crane on a telephone, its permissives while nobody answers, a line of 16 belts, a long name."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from app import bundled
from app.sim.training import REG_LINE_FAULT
from tests.browser.looks import FAULTS, LONGEST, SIZES, open_page
from tests.browser.station import LANGUAGES, Sit, Stations, lay_out, origin, serving, speak, write
from tests.browser.test_layout import BETWEEN, SIDEWAYS
from tests.conftest import find_port

NAME = "Förderstrecke zwischen Wareneingang Nord und Versandhalle Süd"
SILENT, MODBUS = 3, find_port()
CLOSE = f"""async () => {{ // short products of every state all along the line, in its free slots, and what is wrong before news comes
  let svg;
  do {{
    await new Promise(requestAnimationFrame);
    svg = document.querySelector('[data-conveyor]');
  }} while (svg.dataset.q !== 'good'); // its script has drawn it
  const free = [...svg.querySelectorAll('.prod[display]')];
  const good = (value) => ({{ state: 'good', value }});
  free.forEach((group, i) => {{
    const head = (872 * (i + 1)) / (free.length + 1) / svg.dataset.factor;
    const detail = {{ x_id: good(9900 + i), x_state: good(1 + (i % 5)), x_head: good(head), x_tail: good(head - 1 / svg.dataset.factor) }};
    group.dispatchEvent(new CustomEvent('tags', {{ bubbles: true, detail }}));
  }});
  await Promise.resolve();
  const named = [...svg.querySelectorAll('.out:not([display]) .p-id')].filter((one) => getComputedStyle(one).visibility === 'visible');
  return [named.length, ({FAULTS[FAULTS.index("() =>") :].strip()})()];
}}"""
EVERY = {name: size for name, size in SIZES.items()} | {name: (*size, "desk") for name, size in BETWEEN.items()}


def long_line() -> str:
    """A conveyor with as many belts and sensors as there may be, each after the other, and a scanner; and one of three belts."""
    names = ", ".join(f'{lang} = "{NAME}"' for lang in LANGUAGES)
    ends = "\n".join(f"belt_{n}_end = {300 * n}" for n in range(1, 16))
    sensors = "\n".join(f"sensor_{n} = {150 * n - 20}" for n in range(1, 33))
    return (
        f'[links.line]\ntransport = "memory"\n[equipment.c16]\ntype = "conveyor"\nlink = "line"\nunit = 90\nlabel = {{ {names} }}\n'
        f"belts = 16\nsensors = 32\n{ends}\nline_length = 4800\n{sensors}\nscanner = 2\n"
        'simulation = { start = "automatic", interval = 4 }\n'
        '[equipment.c3]\ntype = "conveyor"\nlink = "line"\nunit = 91\nlabel = { en = "Short" }\n'
    )


def plant(folder: Path) -> Path:
    """A plant in `folder`: that line beside a crane."""
    (folder / "plant").mkdir()
    crane = (bundled("plants/crane") / "plant.toml").read_text("utf-8")
    (folder / "plant" / "plant.toml").write_text(f"{crane}\n{long_line()}", "utf-8")
    return folder


@pytest.fixture(scope="module")
def wide(stations: Stations, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    people = {"ana": ("engineer", "operator")}
    with serving(plant(tmp_path_factory.mktemp("wide")), people, serve_modbus=f"127.0.0.1:{MODBUS}") as running:
        seat = Sit(stations, running, {}, "ana", "/")
        yield seat()
        seat.leave()


@pytest.mark.parametrize("lang", LANGUAGES)
def test_the_axes_of_a_crane_fit_a_telephone(wide: Page, lang: str) -> None:
    """Each value behind its name, also those for which a row has no room there."""
    page = wide
    speak(page, lang, origin(page))
    open_page(page, f"{origin(page)}/equipment/cr1")
    for width in (390, 360, 320):
        lay_out(page, width, 844, "desk")
        assert page.evaluate(SIDEWAYS) == [], width
        page.evaluate(LONGEST)
        assert [*page.evaluate(SIDEWAYS), *page.evaluate(FAULTS)] == [], width
    assert page.locator(".k-axes td[data-name]").filter(visible=True).count() == 15


@pytest.mark.parametrize("lang", LANGUAGES)
def test_nothing_of_a_crane_is_pushed_aside_while_nobody_answers(wide: Page, lang: str) -> None:
    page, url = wide, origin(wide)
    speak(page, lang, url)
    write(MODBUS, 1, REG_LINE_FAULT, SILENT)
    found: list[str] = []
    try:
        open_page(page, f"{url}/equipment/cr1")
        expect(page.locator(".k-above h2 [data-tag='cr1.state']")).to_have_attribute("data-q", "bad")
        for path in ("", *(f"/page/{name}" for name in ("hoist", "trolley", "bridge", "drives", "sequence"))):
            open_page(page, f"{url}/equipment/cr1{path}")
            for size in ("panel", "small", "phone", "wide", "a panel of ten inches"):
                lay_out(page, *EVERY[size])
                found += [f"{path} {size}: {one}" for one in [*page.evaluate(SIDEWAYS), *page.evaluate(FAULTS)]]
    finally:
        write(MODBUS, 1, REG_LINE_FAULT, 0)
    assert found == [], "\n".join(["", *found])


@pytest.mark.parametrize("lang", LANGUAGES)
def test_a_line_of_16_belts_with_a_long_name_is_whole(wide: Page, lang: str) -> None:
    """Its picture is to scale, so on a telephone it is pushed aside; nothing else is."""
    page, url = wide, origin(wide)
    speak(page, lang, url)
    open_page(page, f"{url}/equipment/c16")
    expect(page.locator(".prods [data-product]").nth(1)).to_be_visible(timeout=60_000)
    found: list[str] = []
    for name, size in EVERY.items():
        lay_out(page, *size)
        open_page(page, f"{url}/equipment/c16")  # a name is measured once
        expect(page.locator(".prod:not([display])").nth(1)).to_be_attached()
        wrong = [one for one in page.evaluate(SIDEWAYS) if "mimic-b" not in one]
        found += [f"{name}: {one}" for one in [*wrong, *page.evaluate(FAULTS)]]
    assert found == [], "\n".join(["", *found])


@pytest.mark.parametrize("line", ["c16", "c3"])
def test_names_of_products_that_stand_close_are_drawn_over_nothing(wide: Page, line: str) -> None:
    """They stand above their products then, on two levels, on a small screen on one, between those and the names of the areas."""
    page, url = wide, origin(wide)
    speak(page, "hr", url)
    found: list[str] = []
    for name, size in EVERY.items():
        lay_out(page, *size)
        open_page(page, f"{url}/equipment/{line}")
        named, faults = page.evaluate(CLOSE)
        assert named > 5, name
        found += [f"{name}: {one}" for one in faults if "p-id" in one]
    assert found == [], "\n".join(["", *found])
