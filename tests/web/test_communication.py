"""The Communication page over a running plant: what it shows, to whom, and what it forecasts."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from app import bundled
from app.errors import EXCEPTION_NAMES
from app.links.statistics import ERROR_KINDS, LINK_KEYS, UNIT_KEYS, LinkState
from app.plant.texts import Texts
from app.registers.references import reference
from app.settings import Settings
from tests.virtual import house, pass_time, until
from tests.web.operating import runtime_of
from tests.web.people import Staff

SERIAL = """
[plant]
name = { en = "Serial" }
timezone = "UTC"
languages = ["en", "hr", "de", "cs"]
[areas.drives]
label = { en = "Drives" }
[links.press_shop]
transport = "rtu"
port = "/dev/pogon-has-none"
label = { en = "Press shop" }
[equipment.m1]
type = "eura_e800"
link = "press_shop"
unit = 1
label = { en = "One" }
[equipment.m2]
type = "eura_e800"
link = "press_shop"
unit = 2
label = { en = "Two" }
"""


@pytest.fixture
def staff(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Staff]:
    folder = bundled("plants/demo")
    if getattr(request, "param", "") == "serial":
        folder = tmp_path / "plant"
        folder.mkdir()
        (folder / "plant.toml").write_text(SERIAL)
    with house(Settings(data=tmp_path / "data", plant=folder)) as client:
        yield Staff(client)


def page(staff: Staff, address: str = "/communication", lang: str = "en", status: int = 200) -> str:
    staff.client.cookies.set("pogon_lang", lang)
    answer = staff.client.get(address)
    assert answer.status_code == status, answer.text
    return answer.text


@pytest.mark.sweep(8)
def test_operators_see_it_viewers_and_guests_have_no_way_to_it(staff: Staff) -> None:
    home = page(staff, "/")
    assert 'href="/communication"' not in home and page(staff, status=303) == ""
    staff.enter("vera", "viewer")
    assert 'href="/communication"' not in page(staff, "/")
    page(staff, status=403)
    staff.enter("ole", "operator")
    home = page(staff, "/")
    assert len(re.findall(r'href="/communication"', home)) == 3, (
        "the tab of engineering, that of the menu, the counter of the message line"
    )
    assert "Communication" in page(staff)


@pytest.mark.sweep(8)
@pytest.mark.parametrize("lang", ["hr", "en", "de", "cs"])
def test_every_number_of_a_link_and_its_units_is_a_tag_on_it(staff: Staff, lang: str) -> None:
    staff.enter("ole", "operator")
    shown = page(staff, lang=lang)
    for key in set(LINK_KEYS) - {"simulated", "damaged", "late_answers", "last_error"}:
        assert f'data-tag="sys.link.hall.{key}"' in shown, key
    for unit in (1, 2):
        for key in UNIT_KEYS:
            assert f'data-tag="sys.link.hall.unit{unit}.{key}"' in shown, key
    assert not re.search(r"\[(sys|link|communication|nav)\.", shown), "a text is missing"


def test_every_state_error_and_exception_has_words_in_every_language() -> None:
    texts = Texts.read()
    for lang in ("hr", "en", "de", "cs"):
        wanted = [f"communication.state.{state.name.lower()}" for state in LinkState]
        wanted += [f"link.error.{kind or 'none'}" for kind in ERROR_KINDS]
        wanted += [f"communication.exception.{code}" for code in EXCEPTION_NAMES]
        wanted += [f"sys.link.{key}" for key in (*LINK_KEYS, *UNIT_KEYS)]
        assert [key for key in wanted if not texts.has(lang, key)] == []


@pytest.mark.sweep(8)
def test_raw_words_stand_beside_the_values_that_were_made_of_them(staff: Staff) -> None:
    staff.enter("ole", "operator")
    runtime = staff.client.app.state.runtime  # type: ignore[attr-defined]
    assert until(lambda: runtime.tags.sample("m2.frequency").value is not None)
    closed = page(staff)
    assert "0x1004" not in closed
    shown = page(staff, "/communication?open=hall.1")
    row = next(part for part in shown.split("<tr>") if ">0x010D<" in part)
    assert ">40270<" in row
    assert "0FA0" in row and "40.00" in row, "F113 = 40.0 Hz of the demo plant"
    fragment = page(staff, "/communication/hall/2/words")
    assert "m2.frequency" in fragment and "0x1000 + 25" in fragment and "<html" not in fragment
    page(staff, "/communication/nowhere/2/words", status=404)


@pytest.mark.parametrize("staff", ["serial"], indirect=True)
def test_a_serial_line_that_is_too_short_for_what_is_asked_is_told_with_what_it_allows(staff: Staff) -> None:
    staff.enter("ole", "operator")
    shown = page(staff)
    assert "/dev/pogon-has-none · 9600 8E1" in shown and "Writing off" in shown and "Real devices" in shown
    assert "at most 12.5 by arithmetic" in shown
    assert 'data-tag="sys.link.press_shop.late_answers"' in shown
    details = page(staff, "/communication/press_shop/details").replace("\u00a0", " ")
    assert "100 ms is asked, the line allows" in details
    allowed = re.search(r"allows (\d+)\sms", details)
    assert allowed and 200 < int(allowed[1]) < 320, "two polls of 100 ms each, and the slow blocks between them"


@pytest.mark.parametrize("staff", ["serial"], indirect=True)
def test_a_port_that_is_not_there_is_told_in_words(staff: Staff) -> None:
    staff.enter("ole", "operator")
    pass_time(0.3)
    details = page(staff, "/communication/press_shop/details")
    assert "not connected" in details and "/dev/pogon-has-none: no such device; is the adapter plugged in?" in details


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("lang", "counted", "strange"),
    [
        ("en", "3 parity and 5 framing errors", "no telegram: compare baud rate, parity"),
        ("de", "3 Paritäts- und 5 Rahmenfehler", "kein Telegramm: Baudrate, Parität"),
        ("hr", "grešaka pariteta: 3, grešaka okvira: 5", "nije telegram: usporedite brzinu"),
        ("cs", "chyb parity: 3, chyb rámce: 5", "není telegram: porovnejte rychlost"),
    ],
)
@pytest.mark.parametrize("staff", ["serial"], indirect=True)
def test_a_line_on_which_nothing_is_understood_says_what_to_compare(
    staff: Staff, lang: str, counted: str, strange: str
) -> None:
    staff.enter("ole", "operator")
    wire = runtime_of(staff.client).links["press_shop"].statistics.wire
    address = "/communication/press_shop/details"
    assert strange not in page(staff, address, lang)
    wire.strange = True
    told = page(staff, address, lang)
    assert strange in told and "9600" in told and "{" not in told
    wire.parity, wire.framing = 3, 5
    told = page(staff, address, lang)
    assert counted in told and strange not in told


@pytest.mark.parametrize("staff", ["serial"], indirect=True)
def test_the_forecast_of_more_registers_is_that_of_the_sheet(staff: Staff) -> None:
    staff.enter("ole", "operator")
    shown = page(staff, "/communication/press_shop/forecast?unit=2&registers=25")
    # another telegram of 25 registers at 9600 baud, with 20 ms for a device that was never heard
    assert "25 more registers cost 100.2 ms per cycle" in shown.replace("\u00a0", " ")
    assert "0.0 ms" in page(staff, "/communication/press_shop/forecast?registers=0").replace("\u00a0", " ")
    for wrong in ("-1", "x", "10001", "1e3", "999999999"):
        refused = page(staff, f"/communication/press_shop/forecast?registers={wrong}", status=422)
        assert "whole number from 0 to 10000" in refused
    whole = page(staff, "/communication?link=press_shop&registers=25&unit=1")
    assert 'value="25"' in whole and "100.2" in whole


@pytest.mark.parametrize(
    ("address", "table", "written"),
    [
        (0x1000, "holding", "44097"),
        (0, "holding", "40001"),
        (9998, "holding", "49999"),
        (9999, "holding", "410000"),
        (0xE000, "holding", "457345"),
        (0, "input", "30001"),
        (65535, "input", "365536"),
    ],
)
def test_addresses_have_the_numbers_of_older_manuals_beside_them(address: int, table: str, written: str) -> None:
    assert reference(address, table) == written


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("role", "pages"),
    [
        ("viewer", []),
        ("operator", ["/communication", "/storage", "/audit"]),
        ("engineer", ["/communication", "/storage", "/plant", "/instructor", "/audit", "/tokens"]),
        ("admin", ["/communication", "/storage", "/audit", "/users", "/tokens"]),
    ],
)
def test_pages_of_engineering_are_under_a_tab_of_their_own(staff: Staff, role: str, pages: list[str]) -> None:
    """Each role has those that it may open, in the tab's row and nowhere else; who may open none has no such tab."""
    staff.enter(f"one-{role}", role)
    tabs = re.search(r'<nav class="tabs".*?</nav>', page(staff, "/"), re.S)
    assert tabs and ("Engineering" in tabs[0]) == bool(pages) and "tabs-sub" not in tabs[0]
    for address in pages:
        row = re.search(r'<span class="tabs-sub.*?</span>', page(staff, address), re.S)
        assert row and re.findall(r'href="([^"]+)"', row[0]) == pages
        assert re.findall(r'href="([^"]+)" aria-current', row[0]) == [address]
