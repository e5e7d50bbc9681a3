"""What lists hand out as CSV opens in a spreadsheet of the reader's language; programs get the same bytes in all of them."""

import csv
import io
import re
from collections.abc import Iterator
from html import unescape

import pytest

from app.historian.export import FORMATS
from app.settings import Settings
from app.web.csv_lines import cells, number_in
from tests import virtual
from tests.web.people import BOSS
from tests.web.test_alarms import Hall

PAGES = {
    "/alarms": "/alarms.csv",
    "/alarms?tab=journal": "/alarms.csv",
    "/alarms/statistics": "/alarms/statistics.csv",
    "/audit": "/audit.csv",
    "/users/review": "/users/review.csv",
}
LANGUAGES = ("hr", "en", "de", "cs")


@pytest.fixture(scope="module")
def hall(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Hall]:
    with virtual.house(Settings(data=tmp_path_factory.mktemp("lines") / "data")) as client:
        hall = Hall(client)
        hall.tell("command_unconfirmed", "m1")
        hall.staff.wait(hall.engine.journal.flush)
        hall.staff.enter("ana", "admin", "engineer", "operator")
        yield hall


@pytest.mark.sweep(8)
@pytest.mark.parametrize("lang", LANGUAGES)
@pytest.mark.parametrize(("address", "file"), PAGES.items())
def test_the_file_of_a_page_has_the_separators_of_its_language(hall: Hall, address: str, file: str, lang: str) -> None:
    hall.client.cookies.set("pogon_lang", lang)
    (link,) = set(re.findall(rf'href="({re.escape(file)}\?[^"]*)"', hall.client.get(address).text))
    text = hall.client.get(unescape(link)).content.decode("utf-8-sig")
    separator = FORMATS[lang][0]
    rows = [row for row in csv.reader(io.StringIO(text), delimiter=separator) if not row[0].startswith("#")]
    assert len(rows) > 1
    assert {len(row) for row in rows} == {len(rows[0])}
    assert len(rows[0]) > 10


@pytest.mark.parametrize("file", sorted(set(PAGES.values())))
def test_another_locale_is_refused_by_name(hall: Hall, file: str) -> None:
    answer = hall.client.get(f"{file}?locale=fr")
    assert answer.status_code == 422
    assert "fr" in answer.text


def test_numbers_have_the_decimal_sign_and_stay_numbers() -> None:
    line = [1, -2.5, "-2.5", "a;b", "a,b", ""]
    assert cells(line) == b'1,-2.5,\'-2.5,a;b,"a,b",\r\n'
    assert cells(line, "en") == cells(line)
    assert cells(line, "hr") == b'1;-2,5;\'-2.5;"a;b";a,b;\r\n'


def test_a_sign_alone_is_no_formula_and_stays_what_it_is() -> None:
    assert cells(["%", "-", "%x", "=1+1"]) == b"%,-,'%x,'=1+1\r\n"


@pytest.mark.parametrize("locale", ["machine", "hr"])
@pytest.mark.parametrize("delimiter", [";", ",", "\t"])
@pytest.mark.parametrize(
    "text",
    [
        "a;=1+1", "a,=1+1", "a\t=1+1", "a;-1+cmd|x", "a,@SUM(A1)", "a;+x", 'a";=1', 'a;"=1"', 'a,""=1', "a\n=1+1", "a\r\n=1+1", ";=1;=2",
        "=1;=2", "a;%x", "a,|x",
    ],
)  # fmt: skip
def test_no_text_becomes_a_formula_where_the_separators_are_others(text: str, delimiter: str, locale: str) -> None:
    """A program set to `;` takes a line apart at the `;` in a text that was quoted for `,`."""
    line = cells(["2026-03-09", text, "x"], locale).decode()
    seen = [cell.strip('"') for row in line.splitlines() for cell in row.split(delimiter)]
    assert not [cell for cell in seen if cell.startswith(("=", "+", "-", "@", "|", "%"))], line


def test_numbers_and_signs_in_a_text_stay_what_they_are() -> None:
    for text in ("1,-2.5,3", "a;-;b", "1;-2", "a,%", "a, -b", "5;+3;", "a-b;c=d", "x, =y"):
        assert cells([text], "machine").decode().strip().strip('"') == text


def test_a_number_that_was_kept_as_text_has_the_decimal_sign_of_the_reader() -> None:
    kept = ["30.5", "-2.5", "-3", "0.00001", "007", "1.2.3", "3=7.5", "operator", "", "-", "1e5"]
    assert cells(map(number_in, kept), "hr") == b"30,5;-2,5;-3;0.00001;007;1.2.3;3=7.5;operator;;-;1e5\r\n"
    assert cells(map(number_in, kept)) == b"30.5,-2.5,-3,0.00001,007,1.2.3,3=7.5,operator,,-,1e5\r\n"


def test_what_a_setpoint_was_and_became_are_numbers_to_the_spreadsheet_of_the_reader(hall: Hall) -> None:
    hall.staff.wait(hall.staff.access.audit.record, "command", BOSS, "m1.set_frequency", old=-2.5, new=30.5)
    lines = hall.client.get("/audit.csv?locale=hr").content.decode("utf-8-sig").splitlines()
    (row,) = [row for row in csv.DictReader(lines, delimiter=";") if row["object"] == "m1.set_frequency"]
    assert (row["old"], row["new"]) == ("-2,5", "30,5")
