"""The pages of a conveyor that is not of three belts: drawn in every language, with as many belts, sensors and areas as the machine has."""

import re
from collections.abc import Iterator
from html import unescape
from pathlib import Path

import pytest

from app import bundled
from app.plant.plant_files.languages import LANGUAGES
from app.settings import Settings
from tests.virtual import house, pass_time
from tests.web.operating import Operator, runtime_of
from tests.web.people import Staff

UNTOLD = re.compile(r"\[(?:[a-z]{2}\]|[a-z_]+(?:\.[a-z0-9_]+)+\])")
PAGES = ("", "/faceplate", "/parameters", "/page/ramp?belt={belts}", "/events")
SIZES = {"c5": (5, 8), "c16": (16, 32), "c1": (1, 1)}


def plant(folder: Path) -> Path:
    """The example of five belts, one of as many as there may be, and one of one."""
    ends = "".join(f"belt_{n}_end = {300 * n}\n" for n in range(1, 16))
    places = "".join(f"sensor_{n} = {100 + 147 * (n - 1)}\n" for n in range(1, 33))
    row = '[equipment.{id}]\ntype = "conveyor"\nlink = "line"\nunit = {unit}\nsimulation = {{ start = "automatic" }}\n'
    more = row.format(id="c16", unit=2) + f"belts = 16\nsensors = 32\n{ends}line_length = 4800\n{places}"
    one = row.format(id="c1", unit=3) + "belts = 1\nsensors = 1\n"
    folder.mkdir()
    (folder / "plant.toml").write_text(
        f"{(bundled('plants/belts') / 'plant.toml').read_text('utf-8')}\n{more}\n{one}", "utf-8"
    )
    return folder


@pytest.fixture(scope="module")
def staff(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Staff]:
    base = tmp_path_factory.mktemp("belts")
    with house(Settings(plant=plant(base / "plant"), data=base / "data")) as browser:
        crew = Staff(browser)
        crew.enter("ivana", "engineer", "operator")
        pass_time(40)  # until the first product is at the first sensor
        yield crew


def page(staff: Staff, path: str, language: str = "en") -> str:
    Operator(staff, "ivana", ("engineer", "operator")).sit().staff.client.cookies.set("pogon_lang", language)
    answer = staff.client.get(path)
    assert answer.status_code == 200, (path, answer.text[:300])
    return unescape(answer.text)


@pytest.mark.sweep(8)
@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("machine", SIZES)
def test_every_page_is_drawn_in_every_language_without_a_text_missing(
    staff: Staff, machine: str, language: str
) -> None:
    for path in PAGES:
        drawn = page(staff, f"/equipment/{machine}{path.format(belts=SIZES[machine][0])}", language)
        assert not UNTOLD.findall(re.sub(r"<script.*?</script>", "", drawn, flags=re.DOTALL)), (path, language)


@pytest.mark.sweep(8)
@pytest.mark.parametrize("machine", SIZES)
def test_the_picture_has_every_belt_sensor_and_area_and_a_button_for_each_belt(staff: Staff, machine: str) -> None:
    belts, sensors = SIZES[machine]
    drawn = page(staff, f"/equipment/{machine}")
    assert len(re.findall(r'<g class="c-belt[ "]', drawn)) == belts
    assert len(re.findall(r'<g class="c-sensor[ "]', drawn)) == sensors
    assert len(re.findall(r'<g class="c-area[ "]', drawn)) == belts + 1
    assert len(re.findall(r'<input class="vh" type="radio" name="belt"', drawn)) == belts + 1
    assert len(re.search(r'data-ends="([^"]*)"', drawn)[1].split()) == belts  # type: ignore[index]
    tile = page(staff, "/")
    assert tile.count(f'data-tag="{machine}.motor_') >= belts
    assert page(staff, f"/equipment/{machine}/page/ramp").count("?belt=") >= belts


def test_what_the_plc_says_agrees_with_the_plant_file(staff: Staff) -> None:
    for machine, (belts, sensors) in SIZES.items():
        tags = runtime_of(staff.client).tags
        assert tags.sample(f"{machine}.configuration_differs").value == 0, machine
        last = (
            f"motor_{belts}",
            f"beam_{sensors}",
            f"area_{belts + 1}",
            f"speed_{belts}",
            f"sensor_position_{sensors}",
        )
        assert all(tags.sample(f"{machine}.{key}").value is not None for key in last), machine
        assert tags.sample(f"{machine}.products").value > 0, machine


@pytest.mark.sweep(8)
def test_the_order_that_a_scanner_read_is_shown_and_found(staff: Staff) -> None:
    pass_time(60)
    drawn = page(staff, "/equipment/c5")
    assert 'class="c-scan"' in drawn and ">Order</th>" in drawn
    rows = re.findall(r'<tr data-product="(\d+)".*?</tr>', drawn, re.DOTALL)
    orders = re.findall(r">\s*(24\d{6}) <span class=\"cap c-class\">class ([123])</span>", drawn)
    assert rows and orders, "some of the products have passed the scanner"
    known = [
        (id, found[1]) for id in rows if (found := re.search(r"<dd class=\"num\">(24\d{6})</dd>", dialog(staff, id)))
    ]
    assert {order for _, order in known} == {order for order, _ in orders}
    assert "\N{NO-BREAK SPACE}kg" in dialog(staff, known[0][0])

    order = known[0][1]
    listed = page(staff, f"/records/passage?equipment=c5&order={order}")
    assert f">{order}</td>" in listed and f"#{known[0][0]}" in listed
    assert set(re.findall(r">(24\d{6})</td>", listed)) == {order}, "those of this order and no others"
    assert ">24" not in page(staff, "/records/passage?equipment=c5&order=23999999")
    refused = staff.client.get("/records/passage?order=abc")
    assert refused.status_code == 422
    sheet = page(staff, f"/records/passage/export.csv?equipment=c5&order={order}&locale=machine")
    head = next(line for line in sheet.splitlines() if "order" in line and "length_mm" in line).split(",")
    row = next(line for line in sheet.splitlines() if line.count(",") > 10 and order in line).split(",")
    told = dict(zip(head, row, strict=False))
    assert told["order"] == order and told["class"] in "123" and float(told["weight_kg"]) > 0
    events = page(staff, "/equipment/c5/events")
    assert "Label read" in events and order in events.replace("\N{NARROW NO-BREAK SPACE}", "").replace("\xa0", "")


def dialog(staff: Staff, product: str) -> str:
    return page(staff, f"/equipment/c5/table/product/{product}")


def test_a_line_without_a_scanner_speaks_of_none(staff: Staff) -> None:
    drawn = page(staff, "/equipment/c16")
    assert "c-scan" not in drawn and ">Order</th>" not in drawn
