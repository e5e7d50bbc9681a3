"""CSV that opens in a spreadsheet of the reader's language, and can be checked."""

import asyncio
import csv
import io
import math
import threading
import tracemalloc
from datetime import datetime
from pathlib import Path
from typing import Any
from zoneinfo import ZoneInfo

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sqlalchemy import Connection

from app.clock import to_datetime, to_micros
from app.db import Database
from app.errors import ConfigurationError
from app.historian import query, store
from app.historian.calendar import intervals
from app.historian.export import FORMATS, Export, ExportSettings, moment, span, verify_export
from app.historian.store import HOUR, MINUTE
from app.plant.definitions import Kind
from app.tags.quality import COMM_FAILURE, GOOD, STALE, Origin
from tests.historian.brute_force import RawRow, bucket, spans
from tests.historian.conftest import point
from tests.historian.test_store import BEGIN, as_rows, fresh, histories

ZAGREB = ZoneInfo("Europe/Zagreb")
SIMULATED = GOOD | Origin.SIMULATED


def export(connection: Connection, tags: list[str], begin: int, end: int, **more: Any) -> tuple[Export, bytes]:
    made = Export(ExportSettings(tags, begin, end, **{"zone": ZAGREB, **more}))
    data = b""
    while not made.done:
        data += made.read(connection)
    return made, data


def table(data: bytes, locale: str = "machine") -> list[dict[str, str]]:
    lines = [line for line in data.decode("utf-8-sig").split("\r\n") if line and not line.startswith(("#", '"#'))]
    return list(csv.DictReader(io.StringIO("\n".join(lines)), delimiter=FORMATS[locale][0]))


def two_points(connection: Connection) -> None:
    store.register(connection, [point("m1.speed"), point("m1.current", unit="A"), point("m1.note", Kind.TEXT, unit="")])
    rows = [(1, BEGIN + i * 1_000_000, 1000.0 + i, None, SIMULATED) for i in range(10)]
    rows += [(2, BEGIN + 500_000 + i * 1_000_000, -2.25 * i, None, GOOD) for i in range(10)]
    rows += [(2, BEGIN + 9_700_000, None, None, COMM_FAILURE), (1, BEGIN + 9_800_000, 5.0, None, STALE)]
    store.append(connection, rows, BEGIN, BEGIN + HOUR)


def test_rows_of_several_tags_come_in_order_of_time_with_unit_quality_and_flags() -> None:
    with fresh() as connection:
        two_points(connection)
        made, data = export(connection, ["m1.speed", "m1.current"], BEGIN, BEGIN + MINUTE)
        rows = table(data)
        assert [row["time_utc"] for row in rows] == sorted(row["time_utc"] for row in rows)
        assert made.rows == len(rows) == 22
        assert list(rows[0].values()) == [
            "2026-03-09T06:00:00.000Z",
            "2026-03-09T07:00:00.000+01:00",
            "m1.speed",
            "1000",
            "rpm",
            "good",
            "S",
        ]
        assert rows[3]["value"] == "-2.25"
        assert [(row["value"], row["quality"], row["flags"]) for row in rows[-2:]] == [
            ("", "bad:comm_failure", ""),
            ("5", "uncertain:stale", ""),
        ]


@pytest.mark.parametrize("locale", FORMATS)
def test_numbers_are_numbers_in_the_readers_language(locale: str) -> None:
    with fresh() as connection:
        two_points(connection)
        _, data = export(connection, ["m1.current"], BEGIN, BEGIN + MINUTE, locale=locale)
        assert table(data, locale)[1]["value"] == ("-2,25" if locale in ("hr", "de", "cs") else "-2.25")


def test_values_are_exact_and_never_with_an_exponent() -> None:
    with fresh() as connection:
        store.register(connection, [point()])
        wanted = [
            (0.1 + 0.2, "0.3"),
            (1e-7, "0.0000001"),
            (49.900000000000006, "49.9"),
            (1e20, "1" + "0" * 20),
            (9007199254740991.0, "9007199254740991"),  # the largest count that a double holds to the last unit
            (45.815399123456, "45.815399123456"),
            (-0.0, "0"),
        ]
        rows = [(1, BEGIN + i, value, None, GOOD) for i, (value, _) in enumerate(wanted)]
        store.append(connection, rows, BEGIN, BEGIN)
        _, data = export(connection, ["m1.speed"], BEGIN, BEGIN + MINUTE)
        assert [row["value"] for row in table(data)] == [text for _, text in wanted]


def test_a_formula_in_a_text_is_only_text() -> None:
    with fresh() as connection:
        store.register(connection, [point("m1.note", Kind.TEXT, unit="=1+1")])
        texts = [
            '=cmd|" /C calc"!A0',
            "+1",
            "-1",
            "@x",
            "\t=1",
            "\r=1",
            "|x",
            "%x",
            "%",
            "a;=1+1",
            "a,@x",
            "a;b",
            'say "x", please',
            "two\r\nlines",
            "Ölstand",
        ]
        store.append(connection, [(1, BEGIN + i, None, text, GOOD) for i, text in enumerate(texts)], BEGIN, BEGIN)
        for locale in FORMATS:
            made, data = export(connection, ["m1.note"], BEGIN, BEGIN + MINUTE, locale=locale, plant="=1;=2,=3")
            rows = table(data, locale)
            assert made.rows == len(rows) == len(texts)
            for row in rows:
                assert not row["value"].startswith(("=", "+", "-", "@", "|", "\t", "\r"))
                assert row["unit"] == "'=1+1"
            assert [row["value"] for row in rows[6:11]] == ["'|x", "'%x", "%", "a;'=1+1", "a,'@x"]
            assert [row["value"] for row in rows[-4:]] == ["a;b", 'say "x", please', "two  lines", "Ölstand"]
            for line in csv.reader(io.StringIO(data.decode()), delimiter=FORMATS[locale][0]):
                assert not any(cell.startswith(("=", "+", "@")) for cell in line)


@pytest.mark.parametrize(
    ("first", "locals_"),
    [
        ("2026-10-25T00:30:00+00:00", ["02:30:00.000+02:00", "02:30:00.000+01:00", "03:30:00.000+01:00"]),
        ("2026-03-29T00:30:00+00:00", ["01:30:00.000+01:00", "03:30:00.000+02:00", "04:30:00.000+02:00"]),
    ],
)
def test_local_times_are_unambiguous_over_both_clock_changes(first: str, locals_: list[str]) -> None:
    begin = to_micros(datetime.fromisoformat(first))
    with fresh() as connection:
        store.register(connection, [point()])
        store.append(connection, [(1, begin + i * HOUR, 1.0, None, GOOD) for i in range(3)], begin, begin)
        _, data = export(connection, ["m1.speed"], begin, begin + 3 * HOUR)
        rows = table(data)
        assert [row["time_local"][11:] for row in rows] == locals_
        for row in rows:
            assert datetime.fromisoformat(row["time_local"]) == datetime.fromisoformat(row["time_utc"])


def test_days_are_local_days_also_when_the_clock_changes() -> None:
    begin = to_micros(datetime(2026, 10, 24, 12, tzinfo=ZAGREB))
    days = list(intervals(begin, begin + 3 * 24 * HOUR, 86400, ZAGREB))
    assert [(b - a) // HOUR for a, b in days] == [12, 25, 24, 11]
    hours = list(intervals(begin, begin + 24 * HOUR, 6 * 3600, ZAGREB))
    assert [to_datetime(a).astimezone(ZAGREB).hour for a, _ in hours] == [12, 18, 0, 6]
    odd = list(intervals(begin, begin + 100_000_000, 7, ZAGREB))
    assert odd[0] == (begin, begin + 7_000_000)
    assert odd[-1][1] == begin + 100_000_000


@pytest.mark.parametrize(
    ("day", "ends", "hours"),
    [
        (
            28,
            ["2026-03-28T22:00:00.000+01:00", "2026-03-29T06:00:00.000+02:00", "2026-03-29T14:00:00.000+02:00"],
            ["8", "7", "8"],
        ),
        (
            24,
            ["2026-10-24T22:00:00.000+02:00", "2026-10-25T06:00:00.000+01:00", "2026-10-25T14:00:00.000+01:00"],
            ["8", "9", "8"],
        ),
    ],
)
def test_a_row_of_each_shift_says_when_it_ends_which_it_is_and_how_long(
    day: int, ends: list[str], hours: list[str]
) -> None:
    begin = to_micros(datetime(2026, 3 if day == 28 else 10, day, 14, tzinfo=ZAGREB))
    end = begin + sum(map(int, hours)) * HOUR
    with fresh() as connection:
        store.register(connection, [point()])
        rows = [(1, begin + i * HOUR // 10, float(i), None, GOOD) for i in range((end - begin) // HOUR * 10)]
        store.append(connection, rows, begin, begin)
        made = ExportSettings(["m1.speed"], begin, end, ZAGREB, shifts=(360, 840, 1320))
        told = Export(made)
        data = b""
        while not told.done:
            data += told.read(connection)
    assert b"# values: aggregated by shift, which begin at 06:00 14:00 22:00" in data
    found = table(data)
    assert [row["end_local"] for row in found] == ends
    assert [(row["shift"], row["hours"], row["samples"]) for row in found] == [
        (shift, hour, f"{hour}0") for shift, hour in zip("231", hours, strict=True)
    ]
    assert found[1]["time_local"] == ends[0]
    assert (found[1]["min"], found[1]["max"]) == ("80", str(79 + 10 * int(hours[1])))
    assert {row["good_percent"] for row in found} == {"100"}


@pytest.mark.sweep(8)
@settings(max_examples=80, deadline=None)
@given(histories(), st.integers(-HOUR, HOUR), st.sampled_from([1, 7, 60, 900, 3600, 86400]), st.integers(1, 60))
def test_aggregates_are_what_a_recomputation_gives(rows: list[RawRow], shift: int, seconds: int, many: int) -> None:
    begin = rows[0][0] + shift
    end = begin + many * seconds * 500_000 + 1
    with fresh() as connection:
        store.register(connection, [point()])
        store.append(connection, as_rows(rows), rows[0][0], rows[-1][0])
        _, data = export(connection, ["m1.speed"], begin, end, interval=seconds)
        got = table(data)
    want = list(intervals(begin, end, seconds, ZAGREB))
    assert len(got) == len(want)
    for row, (a, b) in zip(got, want, strict=True):
        pieces = [(max(t0, a), min(t1, b), v, q) for t0, t1, v, q in spans(rows) if min(t1, b) > max(t0, a)]
        inside = [v for t, v, _ in rows if a <= t < b and v is not None]
        values = [v for _, _, v, _ in pieces] + inside
        good = sum(t1 - t0 for t0, t1, _, q in pieces if q == 0)
        area = sum((t1 - t0) * v for t0, t1, v, q in pieces if q == 0)
        samples = bucket(rows, a, b)
        assert int(row["samples"]) == (samples.count if samples else 0)
        assert (row["min"] == "") == (not values)
        if values:
            assert math.isclose(float(row["min"]), min(values), abs_tol=1e-5)
            assert math.isclose(float(row["max"]), max(values), abs_tol=1e-5)
        assert math.isclose(float(row["good_percent"]), 100 * good / (b - a), abs_tol=6e-4)
        assert (row["mean"] == "") == (good == 0)
        if good:
            assert math.isclose(float(row["mean"]), area / good, rel_tol=1e-9, abs_tol=1e-4)


def test_first_and_last_of_an_interval_are_what_held_at_its_ends() -> None:
    with fresh() as connection:
        two_points(connection)
        _, data = export(connection, ["m1.speed", "m1.current"], BEGIN + 2_000_000, BEGIN + 8_000_000, interval=3)
        assert [(r["tag"], r["first"], r["last"], r["good_percent"]) for r in table(data)] == [
            ("m1.speed", "1002", "1002", "100"),
            ("m1.current", "-2.25", "-4.5", "100"),
            ("m1.speed", "1003", "1005", "100"),
            ("m1.current", "-4.5", "-11.25", "100"),
            ("m1.speed", "1006", "1007", "100"),
            ("m1.current", "-11.25", "-15.75", "100"),
        ]


def test_the_file_proves_that_it_is_whole(tmp_path: Path) -> None:
    path = tmp_path / "x.csv"
    with fresh() as connection:
        two_points(connection)
        for bom in (False, True):
            made, data = export(connection, ["m1.speed", "m1.current"], BEGIN, BEGIN + MINUTE, bom=bom, locale="hr")
            path.write_bytes(data)
            assert data.startswith(b"\xef\xbb\xbf") is bom
            assert verify_export(path).ok
            assert verify_export(path).rows == made.rows
            for place in (0, len(data) // 2, len(data) - 3):
                changed = bytearray(data)
                changed[place] ^= 1
                path.write_bytes(changed)
                assert not verify_export(path).ok
            path.write_bytes(data[: len(data) // 2])
            assert "cut off" in verify_export(path).why
            lines = data.split(b"\r\n")
            path.write_bytes(b"\r\n".join(lines[:15] + lines[16:]))
            assert not verify_export(path).ok


def test_the_limit_of_rows_is_kept_and_told() -> None:
    with fresh() as connection:
        two_points(connection)
        made, data = export(connection, ["m1.speed"], BEGIN, BEGIN + MINUTE, most_rows=4)
        assert (made.rows, made.complete, len(table(data))) == (4, False, 4)
        assert b"incomplete: stopped at the limit of 4 rows" in data
        made, data = export(connection, ["m1.speed"], BEGIN, BEGIN + MINUTE, most_rows=11)
        assert made.complete


@pytest.mark.sweep(8)
def test_a_long_export_needs_no_more_memory_than_a_short_one(history: Database) -> None:
    def fill_in(connection: Connection) -> None:
        store.register(connection, [point(), point("m1.current")])
        connection.exec_driver_sql(
            "WITH RECURSIVE n(i) AS (SELECT 0 UNION ALL SELECT i + 1 FROM n WHERE i < 199999) "
            "INSERT INTO sample SELECT 1 + i % 2, ? + i * 1000, i, NULL, 0 FROM n",
            (BEGIN,),
        )

    history.run(fill_in)
    made = Export(ExportSettings(["m1.speed", "m1.current"], BEGIN, BEGIN + HOUR, ZAGREB))
    length = 0
    history.run(made.read)
    tracemalloc.start()
    while not made.done:
        length += len(history.run(made.read))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert made.rows == 200_000
    assert length > 10_000_000
    assert peak < 3_000_000
    assert made.progress == 1.0


async def test_it_streams_and_can_be_given_up(history: Database) -> None:
    history.run(two_points)
    made = Export(ExportSettings(["m1.speed"], BEGIN, BEGIN + HOUR, ZAGREB))
    data = b"".join([part async for part in made.stream(history)])
    assert data.count(b"m1.speed,") == 11
    given_up = Export(ExportSettings(["m1.speed"], BEGIN, BEGIN + HOUR, ZAGREB)).stream(history)
    await anext(given_up)
    await given_up.aclose()  # type: ignore[attr-defined]
    await history.write(lambda connection: connection.exec_driver_sql("DELETE FROM sample"))


@pytest.mark.real_time  # threads that wait for one another
async def test_who_asks_little_does_not_wait_for_exports(tmp_path: Path) -> None:
    history = Database(tmp_path / "history.db", "history")
    history.migrate()
    goes_on = threading.Event()

    class Slow(Export):
        def read(self, connection: Connection) -> bytes:
            goes_on.wait(30)
            return super().read(connection)

    history.run(two_points)
    asked = ExportSettings(["m1.speed"], BEGIN, BEGIN + HOUR, ZAGREB)
    exports = [asyncio.ensure_future(anext(Slow(asked).stream(history))) for _ in range(4)]
    await asyncio.sleep(0)
    try:
        async with asyncio.timeout(10):
            assert await history.read(lambda connection: query.find(connection, "m1.speed")) is not None
        assert not any(one.done() for one in exports)
    finally:
        goes_on.set()
        await asyncio.gather(*exports)
        history.close()


@pytest.mark.parametrize(
    ("asked", "named"),
    [
        ({"tags": []}, "tags"),
        ({"tags": ["m1.speed", "m1.speed"]}, "twice"),
        ({"tags": [f"m1.p{i}" for i in range(101)]}, "101"),
        ({"end": BEGIN}, "to:"),
        ({"locale": "fr"}, "fr"),
        ({"interval": -1}, "interval"),
    ],
)
def test_what_cannot_be_is_refused_by_name(asked: dict[str, Any], named: str) -> None:
    with pytest.raises(ConfigurationError, match=named):
        Export(ExportSettings(**{"tags": ["m1.speed"], "begin": BEGIN, "end": BEGIN + 1, "zone": ZAGREB, **asked}))


@pytest.mark.parametrize("rows", [{"interval": 3600}, {"interval": 366 * 86_400}, {"shifts": (360, 840, 1320)}])
@pytest.mark.parametrize(
    ("begin", "end", "named"),
    [
        ("0001-01-01T12:00+00:00", "0001-01-05", "from: 0001-01-01T12:00:00"),
        ("0001-01-02T12:00", "2026-03-09", "from: 0001-01-02"),
        ("2026-03-09", "9999-12-31T12:00", "to: 9999-12-31"),
        ("9999-12-29", "9999-12-30", "from: 9999-12-2"),
    ],
)
def test_rows_at_the_ends_of_the_calendar_are_refused_by_name(
    rows: dict[str, Any], begin: str, end: str, named: str
) -> None:
    first, last = span(begin, end, ZAGREB, BEGIN)
    with pytest.raises(ConfigurationError, match=rf"{named}.*, expected the years 3 to 9997"):
        Export(ExportSettings(["m1.speed"], first, last, ZAGREB, **rows))
    Export(ExportSettings(["m1.speed"], first, last, ZAGREB))


@pytest.mark.parametrize("rows", [{"interval": 366 * 86_400}, {"shifts": (360, 840, 1320)}])
@pytest.mark.parametrize("begin", ["0003-02-01", "9997-12-01"])
def test_rows_beside_the_ends_of_the_calendar_are_made(rows: dict[str, Any], begin: str) -> None:
    first = moment(begin, ZoneInfo("Pacific/Apia"), 0)
    asked = ExportSettings(["m1.speed"], first, first + 3 * 86_400_000_000, ZoneInfo("Pacific/Apia"), **rows)
    assert list(asked.rows())[-1][1] == asked.end


def test_shifts_of_centuries_are_counted_in_no_time() -> None:
    first, last = span("2026-03-09", "9997-03-09", ZAGREB, BEGIN)
    asked = ExportSettings(["m1.speed"], first, last, ZAGREB, shifts=(360, 840, 1320))
    assert asked.count() == pytest.approx(3 * 365.2425 * 7971, rel=1e-4)


def test_a_tag_that_was_never_recorded_is_named() -> None:
    with fresh() as connection, pytest.raises(ConfigurationError, match=r"m9\.speed"):
        export(connection, ["m9.speed"], BEGIN, BEGIN + 1)


@pytest.mark.parametrize(
    ("text", "utc"),
    [
        ("2026-03-09T07:00", "2026-03-09T06:00:00+00:00"),
        ("2026-03-09 07:00", "2026-03-09T06:00:00+00:00"),
        ("2026-03-09", "2026-03-08T23:00:00+00:00"),
        ("2026-07-09T07:00", "2026-07-09T05:00:00+00:00"),
        ("2026-03-09T07:00:00Z", "2026-03-09T07:00:00+00:00"),
        ("2026-03-09T07:00:00+02:00", "2026-03-09T05:00:00+00:00"),
        ("2026-03-09T07:00:00 02:00", "2026-03-09T05:00:00+00:00"),
        (str(BEGIN), "2026-03-09T06:00:00+00:00"),
        ("now", "2026-03-09T06:00:00+00:00"),
        ("-8h", "2026-03-08T22:00:00+00:00"),
        ("now-90s", "2026-03-09T05:58:30+00:00"),
    ],
)
def test_times_are_read_as_people_write_them(text: str, utc: str) -> None:
    assert to_datetime(moment(text, ZAGREB, BEGIN)).isoformat() == utc


@pytest.mark.parametrize("text", ["", "yesterday", "2026-13-01", "9" * 16 + "9", "-8y"])
def test_a_time_that_is_none_is_refused(text: str) -> None:
    with pytest.raises(ConfigurationError, match="expected"):
        moment(text, ZAGREB, BEGIN)


@pytest.mark.parametrize(
    ("begin", "end", "told"),
    [
        (
            "2026-03-29T02:30",
            "2026-03-29T03:10",
            ["2026-03-29T02:30 (= 2026-03-29T03:30:00+02:00)", "2026-03-29T03:10"],
        ),
        ("2026-03-29T02:30", "2026-03-29T03:30", ["2026-03-29T02:30 (= 2026-03-29T03:30:00+02:00)"]),
        ("2026-03-09T08:00", "2026-03-09T07:00", ["to: 2026-03-09T07:00,", "from: 2026-03-09T08:00"]),
        ("now", "-1h", ["to: -1h (=", "from: now (="]),
        ("2026-10-25T01:30Z", "2026-10-25T02:30", ["2026-10-25T01:30Z (= 2026-10-25T02:30:00+01:00)"]),
    ],
)
def test_a_range_that_ends_before_it_begins_is_told_in_the_words_of_who_wrote_it(
    begin: str, end: str, told: list[str]
) -> None:
    with pytest.raises(ConfigurationError) as refused:
        span(begin, end, ZoneInfo("Europe/Zagreb"), 1_774_000_000_000_000)
    assert not [part for part in told if part not in str(refused.value)], str(refused.value)


def test_a_range_over_the_lost_hour_is_one() -> None:
    first, last = span("2026-03-29T01:30", "2026-03-29T03:30", ZoneInfo("Europe/Zagreb"), 0)
    assert last - first == 3_600_000_000
