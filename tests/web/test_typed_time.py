"""Dates are typed in the order of our languages, wherever they are asked for; what is none is named with what was expected."""

import re
from datetime import UTC, datetime

import pytest
from fastapi.testclient import TestClient

from app import bundled
from app.web import typed_time
from tests.web.operating import Operator, words
from tests.web.people import Staff

FIELDS = ("/alarms?tab=journal", "/events", "/audit", "/records/passage", "/alarms/statistics?span=own")


@pytest.fixture(scope="module")
def staff(demo: TestClient) -> Staff:
    demo.pass_time(2)
    return Staff(demo)


@pytest.mark.parametrize(
    ("typed", "moment"),
    [
        ("23.11.2026 14:05", datetime(2026, 11, 23, 14, 5)),
        ("23/11/2026 14:05:30", datetime(2026, 11, 23, 14, 5, 30)),
        ("3. 1. 2026. 7:05", datetime(2026, 1, 3, 7, 5)),
        ("3-1-2026, 7.05", datetime(2026, 1, 3, 7, 5)),
        (" 23.11.2026 ", datetime(2026, 11, 23)),
        ("2026-11-23T14:05", datetime(2026, 11, 23, 14, 5)),
        ("2026-11-23T14:05:00Z", datetime(2026, 11, 23, 14, 5, tzinfo=UTC)),
    ],
)
def test_what_people_type_is_read(typed: str, moment: datetime) -> None:
    assert typed_time.read(typed) == moment
    assert re.fullmatch(typed_time.PATTERN, typed)


@pytest.mark.parametrize(
    "typed", ["31.2.2026", "11/23/2026 14:05", "23.11.26", "23.11.2026 25:00", "23.11.", "yesterday", "٣.1.2026"]
)
def test_what_is_no_time_is_refused(typed: str) -> None:
    with pytest.raises(ValueError):
        typed_time.read(typed)
    assert typed_time.shown(typed, "de") == typed


def test_a_day_alone_is_its_beginning_or_its_end() -> None:
    assert typed_time.read("31.12.2026", end=True) == datetime(2027, 1, 1)
    assert typed_time.read("31.12.2026 00:00", end=True) == datetime(2026, 12, 31)


@pytest.mark.parametrize(
    ("typed", "lang", "shown"),
    [
        ("2026-11-23T14:05", "hr", "23.11.2026 14:05"),
        ("2026-11-23T14:05:07", "en", "23/11/2026 14:05:07"),
        ("3.1.2026", "en", "03/01/2026"),
        ("2026-11-23T14:05:00Z", "de", "2026-11-23T14:05:00Z"),
    ],
)
def test_a_field_shows_it_in_the_readers_language(typed: str, lang: str, shown: str) -> None:
    assert typed_time.shown(typed, lang) == shown


def test_no_page_leaves_a_date_to_the_language_of_the_browser() -> None:
    for file in bundled("templates").rglob("*.html"):
        assert not re.search(r'type="(date|time|datetime-local|month|week)"', file.read_text("utf-8")), file


@pytest.mark.sweep(8)
@pytest.mark.parametrize("path", FIELDS)
def test_every_page_with_a_date_reads_and_shows_it(staff: Staff, path: str) -> None:
    boss = Operator(staff, "boss", ("admin", "engineer", "operator"), "de")
    mark = "&" if "?" in path else "?"
    page = boss.get(f"{path}{mark}since=9.3.2026 6:00&until=9/3/2026", fragment=False)
    assert page.status_code == 200
    assert 'value="09.03.2026 06:00"' in page.text
    assert 'value="09.03.2026"' in page.text
    assert 'placeholder="TT.MM.JJJJ hh:mm"' in page.text
    wrong = boss.get(f"{path}{mark}since=31.2.2026 6:00", fragment=False)
    assert wrong.status_code == 422
    said = words(wrong.text)
    assert "31.2.2026 6:00" in said and "TT.MM.JJJJ hh:mm" in said, said[:500]


@pytest.mark.sweep(8)
def test_help_opened_directly_is_a_whole_page(staff: Staff) -> None:
    for who in (None, Operator(staff, "boss", ("admin", "engineer", "operator"))):
        staff.have()
        page = who.get("/help?of=/alarms", fragment=False).text if who else staff.client.get("/help?of=/alarms").text
        assert page.startswith("<!doctype html>") and page.count("<h1>") == 1
        assert 'class="help-signs"' in page.partition("<main")[2].partition("</main>")[0]
    fragment = staff.client.get("/help", headers={"HX-Request": "true"}).text
    assert 'class="help-signs"' in fragment and "<html" not in fragment
