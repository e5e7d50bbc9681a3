"""Trends as a browser asks for them: what the address may say, who may look, numbers, marks, the past of sparklines."""

import html
import re
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any
from urllib.parse import parse_qs, urlencode, urlsplit

import orjson
import pytest
from fastapi.testclient import TestClient

from app import bundled
from app.clock import to_micros
from app.errors import StorageError
from app.historian import store
from app.historian.statistics import Numbers, statistics
from app.plant.loader import read_plant
from app.runtime import Runtime
from app.tags.quality import COMM_FAILURE, GOOD
from app.web.trend_address import MOST_PENS, first_pens
from tests.virtual import pass_time
from tests.web.people import Staff

BEGIN = 1_773_036_000_000_000
"""2026-03-09T06:00Z."""
END = BEGIN + 600_000_000
HOUR = 3_600_000_000
BEGUN = datetime(2026, 3, 9, 8, 0, tzinfo=UTC)


def runtime_of(client: TestClient) -> Runtime:
    found: Runtime = client.app.state.runtime  # type: ignore[attr-defined]
    return found


@pytest.fixture(scope="module")
def staff(demo: TestClient) -> Iterator[Staff]:
    """The demo plant with ten minutes in March: 1000 for five, bad for one, 1200 for four; and a point that the plant has no longer."""
    runtime = runtime_of(demo)
    crew = Staff(demo)

    def fill(connection: Any) -> None:
        numbers = store.register(connection, [runtime.points["m1.speed"]])
        connection.exec_driver_sql(
            "INSERT INTO point (lasting_id, name, unit, kind) VALUES ('old.flow', 'old.flow', 'Hz', 'analog')"
        )
        number = numbers["m1.speed"]
        rows: list[store.Row] = [
            (number, BEGIN, 1000.0, None, GOOD),
            (number, BEGIN + 300_000_000, None, None, COMM_FAILURE),
            (number, BEGIN + 360_000_000, 1200.0, None, GOOD),
        ]
        store.append(connection, rows, BEGIN, END)

    crew.wait(runtime.history.write, fill)
    yield crew


@pytest.fixture
def client(staff: Staff) -> TestClient:
    staff.client.cookies.clear()
    staff.client.cookies.set("pogon_lang", "en")
    return staff.client


def told(client: TestClient, path: str, lang: str = "en") -> tuple[int, str]:
    """Status and the words of a refusal."""
    client.cookies.set("pogon_lang", lang)
    answer = client.get(path, headers={"HX-Request": "true"})
    found = re.search(r"data-message[^>]*>([^<]*)", answer.text)
    return answer.status_code, html.unescape(found[1]) if found else ""


def data(client: TestClient, path: str) -> dict[str, Any]:
    """What the page hands to its script."""
    text = client.get(path).text
    found = re.search(r'data-trend="([^"]*)"', text)
    assert found, text[:400]
    content: dict[str, Any] = orjson.loads(html.unescape(found[1]))
    return content


def test_a_guest_may_look_at_trends_and_has_no_export(client: TestClient) -> None:
    text = client.get("/trends?tags=m1.speed").text
    assert 'data-pen="m1.speed"' in text
    assert "data-export" not in text and "/trends/export" not in text
    assert client.get("/trends/export?tags=m1.speed", headers={"HX-Request": "true"}).status_code == 401


def test_who_is_signed_in_finds_the_export(staff: Staff) -> None:
    staff.enter("ana", "viewer")
    assert "/trends/export" in staff.client.get("/trends?tags=m1.speed").text
    query = urlencode({"view": f"tags=m1.speed&from={BEGIN}&to={END}"})
    text = html.unescape(staff.client.get(f"/trends/export?{query}").text)
    (raw, sums, shifts) = re.findall(r'href="(/history/export\.csv\?[^"]*)"', text)
    asked = parse_qs(urlsplit(raw).query)
    assert (asked["tags"], asked["from"], asked["to"]) == (["m1.speed"], [str(BEGIN)], [str(END)])
    assert sums == f"{raw}&interval=1" and shifts == f"{raw}&interval=shift"


@pytest.mark.parametrize(("roles", "raw"), [(("operator",), False), (("engineer",), True)])
def test_a_pen_is_named_by_its_machine_and_its_point_and_for_engineers_as_in_the_files(
    staff: Staff, roles: tuple[str, ...], raw: bool
) -> None:
    staff.enter(f"who-{roles[0]}", *roles)
    staff.client.cookies.set("pogon_lang", "en")
    pens = staff.client.get("/trends?tags=m1.speed").text
    listed = re.search(r'<li class="pen" .*?</li>', pens, re.DOTALL)
    assert listed and re.search(r"Fan 1 ·\s+Speed<", listed[0]), pens
    found = staff.client.get("/trends/points?q=fan+1+speed").text
    assert "Fan 1" in found and "<span>Speed<" in found
    for text, name in ((listed[0], "m1.<wbr>speed"), (found, "m1.speed")):
        assert (re.search(rf'class="mono">\s*{re.escape(name)}<', text) is not None) is raw


def test_the_page_without_tags_says_how_to_begin(client: TestClient) -> None:
    text = client.get("/trends?tags=").text
    assert "There is no pen yet" in text
    assert "data-canvas" not in text


def test_the_address_is_the_view(client: TestClient) -> None:
    got = data(
        client,
        "/trends?tags=m1.speed,m1.current&from=2026-03-09T06:00:00Z&to=2026-03-09T07:00:00Z&off=m1.current&pen=m1.current&axis=fit"
        "&a=2026-03-09T06:10:00Z&b=2026-03-09T06:20:00Z",
    )
    assert (got["from"], got["to"], got["span"]) == (BEGIN, BEGIN + 3_600_000_000, None)
    assert (got["a"], got["b"]) == (BEGIN + 600_000_000, BEGIN + 1_200_000_000)
    assert [pen["on"] for pen in got["pens"]] == [True, False]
    assert (got["selected"], got["axis"]) == ("m1.current", "fit")
    assert data(client, "/trends?tags=m1.speed&span=8h")["span"] == 8 * 3600
    assert data(client, "/trends?tags=m1.speed")["span"] == 600
    assert data(client, "/trends?tags=m1.speed")["under"] is None
    assert data(client, "/trends?tags=m1.speed&under=24h")["under"] == 86400
    assert data(client, "/trends?tags=m1.speed&under=90.5s")["under"] == 90.5


def test_a_language_is_chosen_and_a_new_version_loaded_without_losing_the_view(client: TestClient) -> None:
    place = "/trends?tags=m1.speed&pen=m1.speed"
    page = client.get(place).text
    assert f'name="next" value="{html.escape(place)}"' in page
    assert f'<a class="btn tap" href="{html.escape(place)}">' in page
    assert f'id="view" value="{html.escape(urlsplit(place).query)}"' in page, "pens are added to it"


def test_times_without_an_offset_are_those_of_the_plant(client: TestClient) -> None:
    got = data(client, "/trends?tags=m1.speed&from=2026-03-09T07:00&to=2026-03-09T08:00")
    assert got["from"] == BEGIN


def test_a_pen_knows_how_it_is_drawn(client: TestClient) -> None:
    client.cookies.set("pogon_lang", "de")
    speed, setpoint, status = data(client, "/trends?tags=m1.speed,m1.frequency_setpoint,m1.status")["pens"]
    assert (speed["label"], speed["unit"], speed["stepped"], speed["number"]) == ("Drehzahl", "1/min", False, 1)
    assert setpoint["stepped"] and status["stepped"]
    assert status["texts"]["1"] == "Läuft vorwärts"
    assert status["scale"] == "enum:m1.status"


def test_same_unit_shares_an_axis(client: TestClient) -> None:
    pens = data(client, "/trends?tags=m1.speed,m2.speed,m1.current")["pens"]
    assert [pen["scale"] for pen in pens] == ["rpm", "rpm", "A"]


def test_a_point_that_the_plant_has_no_longer_can_still_be_looked_at(client: TestClient) -> None:
    (pen,) = data(client, "/trends?tags=old.flow")["pens"]
    assert (pen["label"], pen["unit"]) == ("old.flow", "Hz")


@pytest.mark.parametrize(
    ("query", "words"),
    [
        ("tags=" + ",".join(f"m1.p{i}" for i in range(9)), f"Pens: 9. At most {MOST_PENS} are possible"),
        ("tags=m1.nothing", "“m1.nothing” is neither in the plant nor in the history"),
        ("tags=m1.state_since", "“m1.state_since” has no curve"),
        ("tags=m1.speed&span=soon", "The span “soon” cannot be read. Expected: 10m"),
        ("tags=m1.speed&span=0m", "The span “0m” cannot be read"),
        ("tags=m1.speed&span=99999d", "The span “99999d” cannot be read"),
        ("tags=m1.speed&from=yesterday", "The time “yesterday” cannot be read. Expected: 2026-03-09T06:00"),
        ("tags=m1.speed&from=2026-03-09T07:00&to=2026-03-09T06:00", "The end must come after the beginning"),
        ("tags=m1.speed&from=1990-01-01T00:00", "The range is too long. At most 3660 days"),
        ("tags=m1.speed&a=x", "The time “x” cannot be read"),
        ("tags=m1.speed&under=soon", "The difference “soon” of the other period cannot be read. Expected: 24h"),
        ("tags=m1.speed&under=0s", "The difference “0s” of the other period cannot be read"),
        ("tags=m1.speed&axis=log", "The axis “log” is not known. Expected: auto, fit, scale"),
    ],
)
def test_what_cannot_be_drawn_is_refused_in_words(client: TestClient, query: str, words: str) -> None:
    status, text = told(client, f"/trends?{query}")
    assert status == 422
    assert words in text


@pytest.mark.parametrize("lang", ["hr", "de", "cs"])
def test_refusals_speak_the_language_of_the_page(client: TestClient, lang: str) -> None:
    tags = ",".join(f"m1.p{i}" for i in range(9))
    english = told(client, f"/trends?tags={tags}")[1]
    status, text = told(client, f"/trends?tags={tags}", lang)
    assert status == 422
    assert "9" in text and "8" in text and text != english


def test_markup_in_the_address_stays_text(client: TestClient) -> None:
    answer = client.get("/trends?tags=%3Cscript%3Ealert(1)%3C/script%3E")
    assert answer.status_code == 422
    assert "<script>alert" not in answer.text


def numbers(staff: Staff, name: str, begin: int, end: int, *moments: int) -> Numbers:
    runtime = runtime_of(staff.client)
    now = runtime.clock.micros()
    (found,) = staff.wait(
        runtime.history.read, lambda connection: statistics(connection, [name], begin, end, now, moments)
    )
    assert isinstance(found, Numbers)
    return found


def cells(client: TestClient, query: str) -> list[dict[str, str]]:
    """The lines of the table as they are read: column → words."""
    text = client.get(f"/trends/table?{query}").text
    lines = re.findall(r"<tr (?:class|data-stat)(.*?)</tr>", text, re.DOTALL)
    found = (re.findall(r'data-cell="(\w+)">(.*?)</td>', line, re.DOTALL) for line in lines)
    return [{name: re.sub(r"<[^>]*>|\s+", " ", html.unescape(words)).strip() for name, words in line} for line in found]


def test_the_table_has_the_numbers_between_two_moments(client: TestClient, staff: Staff) -> None:
    row = numbers(staff, "m1.speed", BEGIN, END, BEGIN, END)
    assert (row.low, row.high) == (1000.0, 1200.0)
    assert row.mean == pytest.approx((5 * 1000 + 4 * 1200) / 9)
    assert row.good == pytest.approx(0.9)
    assert row.held == ((1000.0, 0), (1200.0, 0))
    assert (row.low_at, row.high_at) == ((BEGIN, BEGIN), (BEGIN + 360_000_000,) * 2)
    assert row.lacking == 60_000_000
    (line,) = cells(client, f"tags=m1.speed&from={BEGIN}&to={END}")
    assert line == {
        "a": "–", "b": "–", "delta": "–", "low": "1 000 07:00:00", "mean": "1 089", "high": "1 200 07:06:00",
        "good": "90.0 1 min 00 s lacking",
    }  # fmt: skip


def test_numbers_are_those_between_the_rulers_in_whichever_order_they_stand(client: TestClient) -> None:
    wide = f"tags=m1.speed&from={BEGIN - 3_600_000_000}&to={END + 3_600_000_000}"
    (line,) = cells(client, f"{wide}&a={END}&b={BEGIN}")
    assert (line["a"], line["b"], line["delta"], line["mean"]) == ("1 200", "1 000", "−200", "1 089")
    (one,) = cells(client, f"{wide}&a={BEGIN + 330_000_000}")
    assert (one["a"], one["b"], one["delta"]) == ("----", "–", "–"), "nothing is known there"


def test_another_period_has_its_own_numbers_under_each_line(client: TestClient) -> None:
    late, under = BEGIN + 86_400_000_000, "under=24h"
    lines = cells(client, f"tags=m1.speed&from={late}&to={late + 600_000_000}&{under}")
    assert [line["mean"] for line in lines] == ["–", "1 089"]
    at = f"a={late}&b={late + 600_000_000}"
    assert [line["a"] for line in cells(client, f"tags=m1.speed&from={late}&to={late + 600_000_000}&{under}&{at}")] == [
        "----",
        "1 000",
    ]


def test_time_that_nobody_recorded_is_lacking_and_time_to_come_is_not(client: TestClient, staff: Staff) -> None:
    row = numbers(staff, "m1.speed", BEGIN - 600_000_000, END)
    assert row.good == pytest.approx(0.45) and row.lacking == 660_000_000
    assert row.mean == pytest.approx((5 * 1000 + 4 * 1200) / 9), "what is lacking is not counted as zero"
    now = runtime_of(client).clock.micros()
    assert numbers(staff, "m1.speed", now - 10_000_000, now + 3_600_000_000).lacking < 20_000_000


def test_when_the_recorder_has_stopped_what_came_after_is_lacking(
    staff: Staff, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.historian.statistics.query.alive", lambda _connection: END)
    row = numbers(staff, "m1.speed", BEGIN, END + 600_000_000)
    assert row.good == pytest.approx(0.45) and row.lacking == 660_000_000


def test_a_ruler_behind_the_end_of_the_curve_has_no_value(staff: Staff, monkeypatch: pytest.MonkeyPatch) -> None:
    alive = BEGIN + 500_000_000
    monkeypatch.setattr("app.historian.statistics.query.alive", lambda _connection: alive)
    assert numbers(staff, "m1.speed", BEGIN, END, alive + 10_000_000, alive + 60_000_000).held == ((1200.0, 0), None)


def test_what_a_clock_that_was_ahead_had_written_makes_no_time_past(
    staff: Staff, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = runtime_of(staff.client).clock.micros()
    monkeypatch.setattr("app.historian.statistics.query.alive", lambda _connection: now + 7_200_000_000)
    assert numbers(staff, "m1.speed", now - 10_000_000, now + 3_600_000_000).lacking < 20_000_000


def test_a_ruler_in_a_gap_has_no_value(staff: Staff) -> None:
    assert numbers(staff, "m1.speed", BEGIN, END, BEGIN + 330_000_000).held == ((None, 2),)


def test_a_ruler_beside_the_range_has_what_was_recorded_there(staff: Staff) -> None:
    row = numbers(staff, "m1.speed", BEGIN - 2 * HOUR, BEGIN - HOUR, BEGIN + 60_000_000)
    assert row.held == ((1000.0, 0),) and row.mean is None


def test_a_tag_without_history_has_empty_numbers(staff: Staff) -> None:
    assert numbers(staff, "x.y", BEGIN, END, BEGIN) == Numbers(
        "x.y", None, None, None, None, None, good=0.0, lacking=END - BEGIN, held=(None,)
    )


def chosen(client: TestClient, path: str, view: str, **typed: str) -> Any:
    """What a menu tells the page, or its words when it tells nothing."""
    answer = client.get(f"{path}?{urlencode({'view': view, **typed})}")
    told = answer.headers.get("HX-Trigger")
    return orjson.loads(told)["trend"] if told else html.unescape(answer.text)


def test_a_range_is_typed_on_the_clock_of_the_plant(client: TestClient) -> None:
    view = f"tags=m1.speed&from={BEGIN}&to={END}"
    form = chosen(client, "/trends/range", view)
    assert 'value="09/03/2026 07:00"' in form and 'value="09/03/2026 07:10"' in form and "role=" not in form
    typed = {"from": "25/10/2026 01:00", "to": "2026-10-25T04:00:00"}
    day = chosen(client, "/trends/range", view, **typed)
    assert day["to"] - day["from"] == 4 * 3_600_000_000, "the hour that comes twice is in it twice"
    for begin, end in (("09.03.2026 08:00", "09.03.2026 07:00"), ("31.02.2026", "09.03.2026"), ("", "")):
        wrong = chosen(client, "/trends/range", view, **{"from": begin, "to": end})
        assert "The end must come after the beginning" in wrong and f'value="{begin}"'[:18] in wrong.replace("/", ".")


@pytest.mark.parametrize(
    ("begin", "end", "begins", "ends"),
    [
        ("25.10.2026 02:00", "25.10.2026 02:30", "2026-10-25T00:00Z", "2026-10-25T01:30Z"),
        ("29.03.2026 02:15", "29.03.2026 02:45", "2026-03-29T01:00Z", "2026-03-29T01:00Z"),
        ("29.03.2026 01:00", "29.03.2026 02:45", "2026-03-29T00:00Z", "2026-03-29T01:00Z"),
        ("29.03.2026", "29.03.2026", "2026-03-28T23:00Z", "2026-03-29T22:00Z"),
    ],
)
def test_a_range_that_is_typed_leaves_out_nothing_between_as_in_the_lists(
    client: TestClient, begin: str, end: str, begins: str, ends: str
) -> None:
    """Of a time that comes twice the end is the second; of one that is skipped both are the jump; a day alone is the whole of it."""
    found = chosen(client, "/trends/range", "tags=m1.speed", **{"from": begin, "to": end})
    first, last = (to_micros(datetime.fromisoformat(one)) for one in (begins, ends))
    assert found == {"from": first, "to": last} if first < last else "The end must come after" in found


def test_a_range_in_the_hour_that_comes_twice_is_typed_back_as_it_was(client: TestClient) -> None:
    for begin, end in (("2026-10-25T00:10Z", "2026-10-25T00:40Z"), ("2026-10-25T00:30Z", "2026-10-25T01:20Z")):
        form = chosen(client, "/trends/range", f"tags=m1.speed&from={begin}&to={end}")
        written = dict(re.findall(r'name="(from|to)"[^>]*value="([^"]+)"', form))
        back = chosen(client, "/trends/range", "tags=m1.speed", **written)
        assert (back["from"], back["to"]) == tuple(to_micros(datetime.fromisoformat(one)) for one in (begin, end))


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    "view",
    [
        "from=0001-01-02&to=0001-01-03",
        "from=9999-12-30&to=9999-12-31T22:00Z",
        f"from={BEGIN}&to={END}&a=0001-01-02&b={END}",
        "from=0010-01-01&to=0010-01-02&under=3660d",
        "from=0010-12-31&to=0010-12-31T12:00&under=3660d",
    ],
)
@pytest.mark.parametrize("part", ["compare", "range", "table", "marks", "points", "export", "notes"])
def test_the_ends_of_the_calendar_are_drawn_or_refused(staff: Staff, part: str, view: str) -> None:
    staff.enter("ana", "viewer")
    answer = staff.client.get(f"/trends/{part}?{urlencode({'view': f'tags=m1.speed&{view}'})}")
    assert answer.status_code == (422 if "=00" in view and part != "points" else 200)
    assert staff.client.get(f"/trends?tags=m1.speed&{view}").status_code == (422 if "=00" in view else 200)


def test_a_view_that_is_too_long_is_refused_and_not_cut(staff: Staff) -> None:
    staff.enter("ana", "viewer")
    query = urlencode({"view": "tags=m1.speed&axis=fit&off=" + "m1.current," * 200})
    for part in ("compare", "range", "table", "marks", "points", "export", "notes", "pens"):
        status, text = told(staff.client, f"/trends/{part}?{query}")
        assert status == 422 and "2000" in text, part


def test_numbers_between_rulers_are_made_of_ten_years_at_most(client: TestClient) -> None:
    far = BEGIN - 3661 * 86_400_000_000
    status, text = told(client, f"/trends/table?tags=m1.speed&from={BEGIN}&to={END}&a={far}&b={BEGIN}")
    assert status == 422 and "At most 3660 days" in text


def test_another_period_is_chosen_by_length_by_rulers_or_by_its_beginning(client: TestClient) -> None:
    view = f"tags=m1.speed&from={BEGIN}&to={END}"
    for name, length in (("none", 0), ("span", END - BEGIN), ("24h", 86_400_000_000), ("7d", 604_800_000_000)):
        assert chosen(client, "/trends/compare", view, under=name) == {"under": length}
    menu = chosen(client, "/trends/compare", f"{view}&under=24h")
    assert re.findall(r'data-under="(\w+)" aria-pressed="true"', menu) == ["24h"]
    assert re.search(r'data-under="rulers" disabled', menu), "there are no rulers yet"
    rulers = f"{view}&a={BEGIN + 500_000_000}&b={BEGIN + 100_000_000}"
    assert chosen(client, "/trends/compare", rulers, under="rulers") == {
        "under": 400_000_000, "a": BEGIN + 500_000_000, "b": None, "from": BEGIN + 200_000_000, "to": BEGIN + 800_000_000,
    }  # fmt: skip
    assert chosen(client, "/trends/compare", view, begin="08.03.2026 07:00") == {"under": 86_400_000_000}
    for typed in ("09.03.2026 07:00", "10.03.2026 07:00", "soon", "01.01.1990"):
        assert "must begin earlier than this one" in chosen(client, "/trends/compare", view, begin=typed)


@pytest.mark.parametrize(
    ("begin", "name", "hours"),
    [
        ("2026-03-29T10:00:00+02:00", "24h", 23),
        ("2026-03-29T10:00:00+02:00", "7d", 167),
        ("2026-03-29T01:00:00+01:00", "24h", 24),
        ("2026-10-25T10:00:00+01:00", "24h", 25),
        ("2026-10-26T10:00:00+01:00", "24h", 24),
        ("2026-10-31T10:00:00+01:00", "7d", 169),
        ("2026-03-30T02:30:00+02:00", "24h", 23.5),
    ],
)
def test_a_day_and_a_week_earlier_are_the_same_time_on_the_wall_also_over_a_clock_change(
    client: TestClient, begin: str, name: str, hours: float
) -> None:
    """Where the clock left that time out, it is when it jumped."""
    first = round(datetime.fromisoformat(begin).timestamp() * 1e6)
    view = f"tags=m1.speed&from={first}&to={first + 3_600_000_000}"
    earlier = chosen(client, "/trends/compare", view, under=name)["under"]
    assert earlier == hours * 3_600_000_000
    menu = chosen(client, "/trends/compare", f"{view}&under={earlier // 1_000_000}s")
    assert re.findall(r'data-under="(\w+)" aria-pressed="true"', menu) == [name]


def test_a_pen_is_taken_out_of_the_view_that_one_has_or_put_into_it(client: TestClient) -> None:
    view = "tags=m1.speed,m1.current&span=8h&off=m1.current&axis=fit"

    def left(without: str) -> str:
        query = urlencode({"view": view, "without": without})
        return str(client.get(f"/trends/pens?{query}", follow_redirects=False).headers["location"])

    assert left("m1.speed") == "/trends?tags=m1.current&span=8h&off=m1.current&axis=fit"
    assert left("m1.current") == "/trends?tags=m1.speed&span=8h&axis=fit"
    query = urlencode({"view": view, "with": "m2.speed"})
    more = client.get(f"/trends/pens?{query}", follow_redirects=False).headers["location"]
    assert more == "/trends?tags=m1.speed,m1.current,m2.speed&span=8h&off=m1.current&axis=fit"
    assert (
        "There is no pen yet"
        in client.get("/trends/pens?view=tags%3Dm1.speed&without=m1.speed", follow_redirects=True).text
    )


def test_alarms_of_the_machines_in_view_are_marked(client: TestClient, staff: Staff) -> None:
    runtime = runtime_of(client)

    def marks(tag: str) -> list[tuple[str, int, str]]:
        text = client.get(f"/trends/marks?tags={tag}&from=-1h&to=now").text
        found = re.findall(r'<li data-mark="([1-4])" data-at="(\d+)">([^<]+)</li>', text)
        return [(priority, int(at), words) for priority, at, words in found]

    before = marks("m1.speed")
    staff.wait(lambda: _in_loop(runtime.alarms.system.report, "command_unconfirmed", "m1"))
    staff.wait(runtime.alarms.journal.flush)
    pass_time(1)  # a period ends before its last moment
    after = marks("m1.speed")
    assert len(after) == len(before) + 1
    assert " m1: " in after[0][2] and runtime.clock.micros() - after[0][1] < 60_000_000
    assert marks("m2.speed") == []


async def _in_loop(work: Any, *arguments: Any) -> None:
    work(*arguments, params={"command": "x"})


def test_one_request_gives_all_sparklines_their_past(client: TestClient, staff: Staff) -> None:
    runtime = runtime_of(client)
    staff.wait(runtime.recorder.flush)
    got = client.get("/trends/recent?tags=m1.speed,m2.speed,m1.current,x.y").json()
    assert {"m1.speed", "m2.speed", "m1.current"} == set(got["series"])
    times = [at for at, _ in got["series"]["m1.speed"]]
    assert times == sorted(times) and all(got["now"] - 601_000_000 <= at <= got["now"] for at in times)
    assert told(client, "/trends/recent?tags=" + ",".join(f"m1.p{i}" for i in range(201)))[0] == 422
    assert told(client, "/trends/recent")[0] == 422


def test_the_picker_finds_by_words_of_label_tag_and_machine(client: TestClient) -> None:
    def found(query: str, tags: str = "") -> list[str]:
        return re.findall(r'data-add="([^"]+)"', client.get(f"/trends/points?q={query}&tags={tags}").text)

    everything = found("")
    assert "m1.speed" in everything and "m2.current" in everything
    assert "m1.state_since" not in everything
    assert found("m2.cur") == ["m2.current"]
    assert "m1.speed" in found("fan 1 speed") and "m2.speed" not in found("fan 1 speed")
    assert "m1.speed" not in found("speed", "m1.speed")
    assert found("no such thing") == []
    client.cookies.set("pogon_lang", "de")
    assert found("ausgangsstrom m1") == ["m1.current"]  # its label may be parted where "Strom" begins
    assert found("kuhlkorper m1") == found("Kühlkörper m1") != []


def test_the_picker_offers_no_ninth_pen(client: TestClient) -> None:
    full = "m1.speed,m1.current,m1.power,m1.voltage,m1.torque,m1.frequency,m2.speed,m2.current"
    text = client.get(f"/trends/points?tags={full}").text
    assert "data-add" not in text
    assert "already has 8 pens" in text


def test_a_history_that_cannot_be_read_is_told(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    async def broken(_work: Any) -> None:
        raise StorageError("disk gone")

    for name in ("read", "read_long"):
        monkeypatch.setattr(runtime_of(client).history, name, broken)
    for path in (f"/trends/table?tags=m1.speed&from={BEGIN}&to={END}", "/trends/recent?tags=m1.speed"):
        status, text = told(client, path)
        assert status == 503
        assert "history is not available now" in text
    assert client.get("/trends?tags=m1.speed").status_code == 200


def test_a_sparkline_leads_to_its_trend(client: TestClient) -> None:
    text = client.get("/equipment/m1").text
    assert '<a class="spark-a" href="/trends?tags=m1.current" aria-label="Trend: ' in text
    assert "/trends?tags=m1.speed,m1.current" in text
    assert '<a href="/trends">Trends</a>' in text


def test_an_address_without_tags_shows_the_speeds_of_all_drives_and_keeps_the_rest(client: TestClient) -> None:
    answer = client.get("/trends?span=1h", follow_redirects=False)
    drives = "m1.speed,m2.speed,cr1.hoist_1_speed,cr1.hoist_2_speed,cr1.trolley_1_speed,cr1.bridge_1_speed,a1.speed"
    assert (answer.status_code, answer.headers["location"]) == (303, f"/trends?tags={drives}&span=1h")


def test_a_type_says_which_values_open_the_trends() -> None:
    belts, _ = read_plant(bundled("plants/belts"))
    assert belts is not None
    assert first_pens(belts) == [f"c5.belt_speed_{belt}" for belt in range(1, 6)], "no drive turns in rpm here"
    machine = belts.equipment["c5"]
    points = {
        key: replace(one, opens_trends=key == "motor_2", history=key != "motor_1")
        for key, one in machine.points.items()
    }
    assert first_pens(replace(belts, equipment={"c5": replace(machine, points=points)})) == ["c5.motor_2"]


def test_every_pen_names_its_machine(client: TestClient) -> None:
    text = client.get("/trends?tags=m1.speed").text
    assert re.search(r"data-select[^>]*>.*?<span>Fan 1 · \s*Speed</span>", text, re.DOTALL)
