"""Notes on trends: who writes, reads and deletes them, what they are about, and that an export has them."""

import html
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

import pytest
from fastapi.testclient import TestClient
from sqlalchemy import insert

from app.access.audit.search import Filter
from app.historian import store
from app.historian.notes import note_table
from app.tags.quality import GOOD
from app.web import typed_time
from tests.migrated import differences
from tests.web.people import Staff

HX = {"HX-Request": "true"}
BEGIN = 1_772_949_600_000_000
"""2026-03-08T06:00Z."""
RANGE = urlencode({"tags": "m1.speed", "from": BEGIN, "to": BEGIN + 3_600_000_000})


@pytest.fixture(scope="module")
def crew(demo: TestClient) -> Iterator[Staff]:
    crew = Staff(demo)
    runtime = demo.app.state.runtime  # type: ignore[attr-defined]

    def fill(connection: Any) -> None:
        number = store.register(connection, [runtime.points["m1.speed"]])["m1.speed"]
        store.append(connection, [(number, BEGIN, 1000.0, None, GOOD)], BEGIN, BEGIN + 60_000_000)

    crew.wait(runtime.history.write, fill)
    yield crew


@pytest.fixture
def staff(crew: Staff) -> Staff:
    enter(crew, "writer", "operator")
    return crew


def enter(staff: Staff, name: str, *roles: str) -> None:
    staff.enter(name, *roles)
    staff.client.cookies.set("pogon_lang", "en")


def write(staff: Staff, text: str, time: str = "08.03.2026 07:10:00", machine: str = "m1") -> Any:
    return staff.post("/trends/notes", {"text": text, "time": time, "machine": machine, "view": RANGE}, **HX)


def listed(answer: Any) -> dict[str, tuple[int, int]]:
    """Text → time and number (0: it may not be deleted by who looks)."""
    found: dict[str, tuple[int, int]] = {}
    for item in re.findall(r"<li data-note(.*?)</li>", answer.text, re.DOTALL):
        text, at = re.search(r"<span hx-ignore>([^<]*)", item), re.search(r'data-at="(\d+)"', item)
        number = re.search(r"/trends/notes/(\d+)/delete", item)
        assert text and at
        found[html.unescape(text[1])] = int(at[1]), int(number[1]) if number else 0
    return found


def told(answer: Any) -> str:
    found = re.search(r'role="alert".*?<span>([^<]*)</span>', answer.text, re.DOTALL)
    return html.unescape(found[1]) if found else ""


def seen(staff: Staff, query: str = RANGE) -> dict[str, tuple[int, int]]:
    return listed(staff.client.get(f"/trends/notes?{query}", headers=HX))


def test_the_migration_makes_the_table(tmp_path: Path) -> None:
    assert differences(tmp_path, note_table) == []


def test_a_note_stands_at_its_time_in_the_plants_zone_and_is_written_down(staff: Staff) -> None:
    answer = write(staff, "Bearing <b>greased</b>")
    assert listed(answer)["Bearing <b>greased</b>"][0] == BEGIN + 600_000_000
    assert "<b>greased" not in answer.text
    (line,) = staff.wait(staff.access.audit.find, Filter(kind="trend.noted", object="m1"))[:1]
    assert (line.person, line.new) == ("writer", "Bearing <b>greased</b>")


def test_a_note_is_seen_with_its_machine_or_with_all_and_within_its_range(staff: Staff) -> None:
    write(staff, "of the first fan")
    write(staff, "of everything", machine="")
    assert {"of the first fan", "of everything"} <= set(seen(staff))
    other = seen(staff, RANGE.replace("m1.speed", "m2.speed"))
    assert "of everything" in other and "of the first fan" not in other
    assert seen(staff, urlencode({"tags": "m1.speed", "from": BEGIN, "to": BEGIN + 600_000_000})) == {}


def test_a_note_of_now_is_listed_though_the_chart_was_drawn_a_moment_before(staff: Staff) -> None:
    assert "right now" in listed(write(staff, "right now", "08.03.2026 08:00:30"))
    assert "later" not in listed(write(staff, "later", "08.03.2026 08:01:30"))


def test_a_note_outside_the_range_says_where_it_stands(staff: Staff) -> None:
    answer = write(staff, "long ago", "01.02.2020 10:00")
    assert "long ago" not in listed(answer)
    assert "The note was written at 01/02/2020 10:00:00, outside the range on the screen." in answer.text
    assert "outside the range" not in write(staff, "right now", "08.03.2026 08:00:30").text


@pytest.mark.parametrize("time", ["01.01.0001 00:00", "02.01.0001 00:00", "9999-12-31T23:59-12:00"])
def test_a_note_beyond_the_calendar_is_refused_in_words(staff: Staff, time: str) -> None:
    answer = write(staff, "Beyond", time)
    assert answer.status_code == 200 and "cannot be read" in answer.text and "Beyond" not in listed(answer)


def test_its_author_or_an_engineer_deletes_a_note_and_nobody_else(staff: Staff) -> None:
    write(staff, "first")
    write(staff, "second")
    numbers = {text: number for text, (_, number) in seen(staff).items()}
    enter(staff, "colleague", "operator")
    assert seen(staff)["first"][1] == 0
    refused = staff.post(f"/trends/notes/{numbers['first']}/delete", {"view": RANGE}, **HX)
    assert "Only who wrote a note, or an engineer" in told(refused) and "first" in listed(refused)
    enter(staff, "chief", "engineer")
    assert "first" not in listed(staff.post(f"/trends/notes/{numbers['first']}/delete", {"view": RANGE}, **HX))
    enter(staff, "writer")
    assert "second" not in listed(staff.post(f"/trends/notes/{numbers['second']}/delete", {"view": RANGE}, **HX))
    assert "gone already" in told(staff.post(f"/trends/notes/{numbers['second']}/delete", {"view": RANGE}, **HX))
    lines = staff.wait(staff.access.audit.find, Filter(kind="trend.note_deleted"))
    assert {(line.person, line.old) for line in lines} >= {("chief", "first"), ("writer", "second")}


@pytest.mark.parametrize("number", ["0", str(2**63), "9" * 20])
def test_a_number_that_no_note_can_have_is_told_as_one_that_is_gone(staff: Staff, number: str) -> None:
    assert "gone already" in told(staff.post(f"/trends/notes/{number}/delete", {"view": RANGE}, **HX))


def test_a_viewer_reads_notes_and_writes_none_and_a_guest_does_neither(staff: Staff) -> None:
    write(staff, "to be read")
    enter(staff, "watcher", "viewer")
    text = staff.client.get(f"/trends/notes?{RANGE}", headers=HX).text
    assert "to be read" in text and "<form" not in text
    assert write(staff, "mine").status_code == 403
    staff.have()
    assert staff.client.get(f"/trends/notes?{RANGE}", headers=HX).status_code == 401
    assert "trend-notes" not in staff.client.get("/trends?tags=m1.speed").text


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("text", "time", "machine", "words"),
    [
        ("  ", "2026-03-08T07:10", "m1", "needs 1 to 300 characters"),
        ("x" * 301, "2026-03-08T07:10", "m1", "needs 1 to 300 characters"),
        ("a\u202eb", "2026-03-08T07:10", "m1", "needs 1 to 300 characters"),
        ("soon", "2999-03-09T07:10", "m1", "must not be in the future"),
        ("when", "breakfast", "m1", "The time “breakfast” cannot be read. Expected: dd/mm/yyyy hh:mm, for example "),
        ("where", "2026-03-08T07:10", "m9", "The machine “m9” is not in the plant"),
    ],
)
def test_what_is_no_note_is_refused_in_words_and_stays_in_its_field(
    staff: Staff, text: str, time: str, machine: str, words: str
) -> None:
    answer = write(staff, text, time, machine)
    assert words in told(answer)
    assert f'value="{text}"' in answer.text and f'value="{typed_time.shown(time, "en")}"' in answer.text
    assert machine != "m1" or '<option value="m1" selected>' in answer.text


def test_a_nul_that_was_typed_is_in_no_page(staff: Staff) -> None:
    answer = write(staff, "a\x00b")
    assert "needs 1 to 300 characters" in told(answer) and 'value="a\ufffdb"' in answer.text
    assert "\x00" not in staff.post("/trends/views", {"name": "a\x00b", "view": RANGE}, **HX).text
    assert "\x00" not in staff.post("/signin", {"name": "a\x00b", "password": "x", "next": "/"}).text


def test_an_export_has_every_note_of_its_time(staff: Staff) -> None:
    """A list on a page has the newest 200 of them."""
    runtime = staff.client.app.state.runtime  # type: ignore[attr-defined]
    at, row = BEGIN + 7_200_000_000, {"machine": "m1", "person": 1, "author": "many", "created": BEGIN}
    rows = [{"time": at + number, "text": f"note {number}.", **row} for number in range(201)]
    staff.wait(runtime.db.write, lambda connection: connection.execute(insert(note_table), rows) and None)
    query = urlencode({"tags": "m1.speed", "from": at, "to": at + 3_600_000_000, "locale": "en"})
    text = staff.client.get(f"/history/export.csv?{query}").text
    assert [re.findall(r"note (\d+)\.", line)[0] for line in text.splitlines() if "many" in line] == [
        str(number) for number in range(201)
    ]


def test_an_export_has_the_notes_of_its_time_before_the_values(staff: Staff) -> None:
    write(staff, "=HYPERLINK(1); oiled")
    query = urlencode({"tags": "m1.speed", "from": BEGIN, "to": BEGIN + 3_600_000_000, "locale": "en"})
    text = staff.client.get(f"/history/export.csv?{query}").text
    (line,) = [line for line in text.splitlines() if "oiled" in line]
    assert line == '"# note: 2026-03-08T07:10:00.000+01:00 m1 (writer): =HYPERLINK(1); oiled"'
    assert text.index(line) < text.index("time_utc")
    later = query.replace(str(BEGIN), str(BEGIN + 1_800_000_000), 1)
    assert "oiled" not in staff.client.get(f"/history/export.csv?{later}").text
