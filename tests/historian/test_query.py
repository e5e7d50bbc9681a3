"""What a trend is shown, against the raw rows."""

from itertools import pairwise

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from sqlalchemy import Connection

from app.historian import query, store
from app.historian.query import Columns
from app.historian.store import GAP_AFTER, HOUR, MINUTE
from app.plant.definitions import Kind
from app.tags.quality import COMM_FAILURE, GOOD, NO_DATA, STALE
from tests.historian.brute_force import RawRow, held_at
from tests.historian.conftest import fill, point
from tests.historian.test_store import BEGIN, as_rows, fresh, histories, roll_up_all

widths = st.one_of(st.integers(1, 12), st.integers(1, 4000))


@st.composite
def questions(draw: st.DrawFn) -> tuple[list[RawRow], int, int, int, int]:
    """Rows, the range, its width, and up to when roll-ups are written."""
    rows = draw(histories())
    span = rows[-1][0] - rows[0][0]
    begin = draw(
        st.one_of(st.integers(rows[0][0] - HOUR, rows[-1][0] + HOUR), st.sampled_from(rows).map(lambda r: r[0]))
    )
    length = draw(st.one_of(st.integers(1, span + 2 * HOUR), st.sampled_from([HOUR, 100 * HOUR, 10_000_000])))
    rolled = draw(st.sampled_from([rows[0][0], (rows[0][0] + rows[-1][0]) // 2, rows[-1][0], rows[-1][0] + 2 * HOUR]))
    return rows, begin, begin + length, draw(widths), rolled


def asked(rows: list[RawRow], begin: int, end: int, width: int, rolled: int = 0, alive: int | None = None) -> Columns:
    with fresh() as connection:
        fill(connection, as_rows(rows), alive=alive)
        roll_up_all(connection, rolled or rows[-1][0] + 2 * HOUR)
        return query.columns(connection, 1, begin, end, width)


def drawn(columns: Columns) -> list[tuple[int, float | None]]:
    """The points of the line, as a page draws them."""
    out: list[tuple[int, float | None]] = []
    for i in range(len(columns)):
        for value in (columns.first[i], columns.low[i], columns.high[i], columns.last[i]):
            out.append((columns.time[i], value))
    return out


@pytest.mark.sweep(8)
@settings(max_examples=150, deadline=None)
@given(questions())
def test_every_column_has_the_true_extremes_ends_and_count_of_its_samples(
    question: tuple[list[RawRow], int, int, int, int],
) -> None:
    rows, begin, end, width, rolled = question
    got = asked(rows, begin, end, width, rolled)
    inside = [row for row in rows if begin <= row[0] < end]
    expected: dict[int, list[RawRow]] = {}
    for row in inside:
        expected.setdefault(row[0] // got.step, []).append(row)
    real = [i for i in range(len(got)) if got.count[i]]
    assert [got.time[i] // got.step for i in real] == list(expected)
    for i, members in zip(real, expected.values(), strict=True):
        numbers = [v for _, v, _ in members if v is not None]
        assert got.time[i] == members[0][0]
        assert (got.low[i], got.high[i]) == (min(numbers, default=None), max(numbers, default=None))
        assert (got.first[i], got.last[i]) == (members[0][1], members[-1][1])
        assert got.quality[i] == max(q & 3 for _, _, q in members)
        assert got.count[i] == len(members)
    assert len(real) <= width + 1
    assert len(got) <= 3 * (width + 2)
    assert got.time == sorted(set(got.time))
    assert all(begin <= time <= end for time in got.time)


@pytest.mark.sweep(8)
@settings(max_examples=150, deadline=None)
@given(questions())
@example(([(BEGIN, 0.0, GOOD), (BEGIN + 1, None, NO_DATA)], BEGIN - 1, BEGIN + 1, 2, 0))
def test_where_nothing_held_for_longer_than_a_column_the_line_is_broken(
    question: tuple[list[RawRow], int, int, int, int],
) -> None:
    rows, begin, end, width, rolled = question
    got = asked(rows, begin, end, width, rolled)
    line = drawn(got)
    for (t0, v0), (t1, v1) in pairwise(line):
        if v0 is None or v1 is None or t0 // got.step == t1 // got.step:
            continue
        # the line runs from the column of t0 to that of t1: each column between must have held a value, at least at its beginning; at the
        # end of the range, which is no more of it, the line ends with what held until then
        for edge in range((t0 // got.step + 1) * got.step, min(t1 // got.step * got.step + 1, end), got.step):
            assert held_at(rows, edge) is not None, (t0, edge, t1)


@pytest.mark.sweep(8)
@settings(max_examples=100, deadline=None)
@given(questions())
def test_a_value_that_held_is_drawn_wherever_it_held(question: tuple[list[RawRow], int, int, int, int]) -> None:
    """Up to the recorder's last sign of life: no gap where there is none."""
    rows, begin, end, width, rolled = question
    alive = rows[-1][0]
    got = asked(rows, begin, end, width, rolled, alive)
    line = drawn(got)
    covered = [(t0, t1) for (t0, v0), (t1, v1) in pairwise(line) if v0 is not None and v1 is not None]
    for edge in range(-(-begin // got.step) * got.step, min(end, alive), got.step):
        if held_at(rows, edge) is not None and held_at(rows, edge - 1) is not None and edge > begin:
            assert any(t0 <= edge <= t1 + got.step for t0, t1 in covered) or any(
                time // got.step in (edge // got.step, edge // got.step - 1) and n
                for time, n in zip(got.time, got.count, strict=True)
            )


@pytest.mark.parametrize("kind", [Kind.ANALOG, Kind.STEP])
@pytest.mark.parametrize("gap", [100_000, store.RAMP, store.RAMP + 1])
@pytest.mark.parametrize(("begin", "end"), [(0.25, 0.75), (0.25, 1.5), (-0.5, 0.75)])
def test_a_range_that_begins_or_ends_on_a_ramp_shows_the_line(kind: Kind, gap: int, begin: float, end: float) -> None:
    """Samples 0 and 80; between them a line leads, if they are near each other and the point is drawn as lines."""
    with fresh() as connection:
        fill(
            connection,
            [(1, BEGIN, 0.0, None, GOOD), (1, BEGIN + gap, 80.0, None, GOOD)],
            point(kind=kind),
            alive=BEGIN + HOUR,
        )
        got = query.columns(connection, 1, BEGIN + round(begin * gap), BEGIN + round(end * gap), 10)
    on_ramp = kind is Kind.ANALOG and gap <= store.RAMP
    for at, shown in ((begin, got.first[0]), (end, got.last[-1])):
        if 0 < at < 1:
            assert shown == pytest.approx(80 * at if on_ramp else 0, abs=0.01)


@pytest.mark.sweep(8)
@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2999), widths, st.booleans())
def test_one_spike_is_seen_at_every_width(place: int, width: int, rolled: bool) -> None:
    rows: list[RawRow] = [(BEGIN + i * 4_000_000, 999.0 if i == place else 10.0, GOOD) for i in range(3000)]
    got = asked(rows, BEGIN, rows[-1][0] + 1, width, 0 if rolled else BEGIN)
    assert max(v for v in got.high if v is not None) == 999.0
    assert sum(v == 999.0 for v in got.high) == 1


@settings(max_examples=60, deadline=None)
@given(histories())
def test_a_roll_up_that_fills_a_column_is_read_as_one_of_several_is(rows: list[RawRow]) -> None:
    with fresh() as connection:
        fill(connection, as_rows(rows))
        roll_up_all(connection, rows[-1][0] + 2 * HOUR)
        for table, step in (("minute", MINUTE), ("hour", HOUR)):
            asks = {"step": step, "number": 1, "begin": rows[0][0] - HOUR, "end": rows[-1][0] + HOUR}
            each, several = (found[table](connection, **asks).all() for found in (query.OF_EACH, query.OF_ROLL_UPS))
            assert [tuple(row) for row in each] == [tuple(row) for row in several]
            assert len(each) == len({time // step for time, _, _ in rows})


@pytest.mark.sweep(8)
def test_a_year_keeps_its_spike_too() -> None:
    with fresh() as connection:
        connection.exec_driver_sql(
            "WITH RECURSIVE n(i) AS (SELECT 0 UNION ALL SELECT i + 1 FROM n WHERE i < 365 * 144 - 1) "
            "INSERT INTO sample SELECT 1, ? + i * 600000000, iif(i = 31234, 77.0, 1.0), NULL, 0 FROM n",
            (BEGIN,),
        )
        store.register(connection, [point()])
        roll_up_all(connection, BEGIN + 365 * 24 * HOUR)
        for width in (1, 7, 400, 1600, 4000):
            got = query.columns(connection, 1, BEGIN, BEGIN + 365 * 24 * HOUR, width)
            assert got.source == "hour"
            assert max(got.high, key=lambda v: v or 0) == 77.0


def test_a_step_holds_from_the_edge_to_the_next_sample_and_to_the_recorders_last_sign() -> None:
    rows: list[RawRow] = [(BEGIN, 1.0, GOOD), (BEGIN + 100_000_000, 2.0, GOOD)]
    got = asked(rows, BEGIN + 10_000_000, BEGIN + 400_000_000, 1000, alive=BEGIN + 300_000_000)
    assert list(zip(got.time, got.last, got.count, strict=True)) == [
        (BEGIN + 10_000_000, 1.0, 0),
        (BEGIN + 100_000_000, 2.0, 1),
        (BEGIN + 300_000_000, 2.0, 0),
    ]


def test_bad_quality_ends_the_line_where_it_came_and_not_before() -> None:
    rows: list[RawRow] = [(BEGIN, 1.0, GOOD), (BEGIN + 9_000_000, None, COMM_FAILURE), (BEGIN + 20_000_000, 3.0, STALE)]
    got = asked(rows, BEGIN, BEGIN + 30_000_000, 300, alive=BEGIN + 30_000_000)
    assert list(zip(got.time, got.last, got.quality, strict=True)) == [
        (BEGIN, 1.0, 0),
        (BEGIN + 8_999_999, 1.0, 0),
        (BEGIN + 9_000_000, None, 2),
        (BEGIN + 20_000_000, 3.0, 1),
        (BEGIN + 30_000_000, 3.0, 1),
    ]


def test_a_pause_of_the_recorder_is_a_gap() -> None:
    with fresh() as connection:
        fill(connection, as_rows([(BEGIN, 1.0, GOOD)]), alive=BEGIN + 20_000_000)
        store.begin_run(connection, BEGIN + 60_000_000)
        store.append(connection, as_rows([(BEGIN + 61_000_000, 1.0, GOOD)]), BEGIN + 60_000_000, BEGIN + 70_000_000)
        got = query.columns(connection, 1, BEGIN, BEGIN + HOUR, 1000)
        assert list(zip(got.time, got.last, strict=True)) == [
            (BEGIN, 1.0),
            (BEGIN + 20_000_000, 1.0),
            (BEGIN + 20_000_001, None),
            (BEGIN + 61_000_000, 1.0),
            (BEGIN + 70_000_000, 1.0),
        ]


@pytest.mark.parametrize("end", [20 * MINUTE, 4 * HOUR])
def test_after_a_clock_that_was_ahead_a_value_is_drawn_up_to_now_and_no_further(end: int) -> None:
    """Also where what was written under the clock that was ahead follows."""
    ahead, now = BEGIN + 3 * HOUR, BEGIN + 20_000_000
    with fresh() as connection:
        fill(connection, as_rows([(ahead, 7.0, GOOD)]), alive=ahead + 20_000_000)
        store.begin_run(connection, BEGIN)
        store.append(connection, as_rows([(BEGIN + 1_000_000, 1.0, GOOD)]), BEGIN, now)
        got = query.columns(connection, 1, BEGIN, BEGIN + end, 1000)
    line = [(time, value) for time, value in zip(got.time, got.last, strict=True) if time < ahead]
    assert line == [(BEGIN + 1_000_000, 1.0), (now, 1.0), (now + 1, None)]
    assert (7.0 in got.last) is (end > 3 * HOUR)


def test_silence_longer_than_the_heartbeat_is_a_gap() -> None:
    rows: list[RawRow] = [(BEGIN, 1.0, GOOD), (BEGIN + HOUR, 2.0, GOOD)]
    got = asked(rows, BEGIN, BEGIN + HOUR + MINUTE, 3600)
    assert list(zip(got.time, got.last, strict=True)) == [
        (BEGIN, 1.0),
        (BEGIN + GAP_AFTER, 1.0),
        (BEGIN + GAP_AFTER + 1, None),
        (BEGIN + HOUR, 2.0),
    ]


def test_an_empty_range_or_width_is_refused() -> None:
    with fresh() as connection:
        for begin, end, width in ((5, 5, 10), (6, 5, 10), (0, 10, 0), (0, 10, 4001)):
            with pytest.raises(ValueError, match=r"range|width"):
                query.columns(connection, 1, begin, end, width)


def test_raw_gives_every_row_in_portions() -> None:
    with fresh() as connection:
        rows: list[RawRow] = [(BEGIN + i, float(i), GOOD) for i in range(57)]
        fill(connection, as_rows(rows))
        assert list(query.raw(connection, 1, BEGIN + 3, BEGIN + 50, chunk=7)) == rows[3:50]
        assert query.count(connection, 1, BEGIN + 3, BEGIN + 50) == 47
        assert query.at(connection, 1, BEGIN + 200) == rows[-1]
        assert query.at(connection, 1, BEGIN - 1) is None


def _texts(connection: Connection) -> None:
    store.register(connection, [point("m1.fault", Kind.TEXT)])
    store.append(
        connection,
        [
            (1, BEGIN, None, "none", GOOD),
            (1, BEGIN + MINUTE, None, "none", GOOD),
            (1, BEGIN + 2 * MINUTE, None, "OC", GOOD),
            (1, BEGIN + 3 * MINUTE, None, None, NO_DATA),
        ],
        BEGIN,
        BEGIN + HOUR,
    )


def test_texts_come_as_changes() -> None:
    with fresh() as connection:
        _texts(connection)
        assert query.texts(connection, 1, BEGIN + 1, BEGIN + HOUR) == [
            (BEGIN + 1, "none"),
            (BEGIN + 2 * MINUTE, "OC"),
            (BEGIN + 3 * MINUTE, None),
        ]


def test_a_point_is_found_by_its_name_and_by_its_lasting_id() -> None:
    with fresh() as connection:
        store.register(connection, [point("m1.speed", unit="rpm")])
        connection.exec_driver_sql("UPDATE point SET name = 'm7.speed'")
        by_name, by_id = query.find(connection, "m7.speed"), query.find(connection, "m1.speed")
        assert by_name == by_id == query.recorded(connection)["m1.speed"]
        assert by_name is not None
        assert by_name.unit == "rpm"
        assert query.find(connection, "m9.speed") is None


def test_between_the_samples_of_a_ramp_the_line_tells_else_what_held() -> None:
    second = 1_000_000
    rows = [
        (BEGIN, 10.0, GOOD),
        (BEGIN + second // 2, 20.0, GOOD),
        (BEGIN + 60 * second, 50.0, GOOD),
        (BEGIN + 61 * second, None, COMM_FAILURE),
    ]
    with fresh() as connection:
        fill(connection, as_rows(rows))
        found = [
            query.line_at(connection, 1, BEGIN + at)
            for at in (-1, 0, second // 4, second // 2, 30 * second, 60 * second + second // 2)
        ]
    assert [None if one is None else one[1] for one in found] == [None, 10.0, 15.0, 20.0, 20.0, 50.0]
