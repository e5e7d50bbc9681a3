"""Series and exports as a browser asks for them, and the page Storage."""

import hashlib
import html
from collections.abc import Callable, Iterator
from dataclasses import replace
from datetime import UTC, datetime
from itertools import accumulate
from pathlib import Path
from typing import Any

import orjson
import pytest
from fastapi.testclient import TestClient
from sqlalchemy import Connection

from app.errors import StorageError
from app.historian import query, store
from app.historian.export import verify_export
from app.runtime import Runtime
from app.tags.quality import COMM_FAILURE, GOOD, Origin
from app.web import history
from app.web.guard import permission_of_point
from tests.virtual import pass_time
from tests.web.people import Staff

BEGIN = 1_773_036_000_000_000
"""2026-03-09T06:00Z."""
BEGUN = datetime(2026, 3, 9, 8, 0, tzinfo=UTC)


@pytest.fixture(scope="module")
def staff(demo: TestClient) -> Iterator[Staff]:
    """The demo plant with ten minutes of history in March."""
    runtime = runtime_of(demo)
    crew = Staff(demo)

    def fill(connection: Any) -> None:
        numbers = store.register(connection, [runtime.points["m1.speed"], runtime.points["m1.current"]])
        rows: list[store.Row] = []
        for i in range(600):
            bad = 200 <= i < 300
            quality = COMM_FAILURE if bad else GOOD | Origin.SIMULATED
            rows.append((numbers["m1.speed"], BEGIN + i * 1_000_000, None if bad else 1000.0 + i, None, quality))
        rows.append((numbers["m1.current"], BEGIN + 500_000, 2.25, None, GOOD))
        store.append(connection, rows, BEGIN, BEGIN + 600_000_000)

    crew.wait(runtime.history.write, fill)
    yield crew


def runtime_of(client: TestClient) -> Runtime:
    found: Runtime = client.app.state.runtime  # type: ignore[attr-defined]
    return found


def ask(client: TestClient, path: str, status: int = 200, **query: Any) -> Any:
    named = {"from": BEGIN, "to": BEGIN + 600_000_000} | {key.rstrip("_"): value for key, value in query.items()}
    answer = client.get(f"/history/{path}", params=named)
    assert answer.status_code == status, answer.text
    return answer


def unpacked(series: dict[str, Any]) -> dict[str, Any]:
    """All columns of a series, as chart.js unpacks them."""
    time = list(accumulate(series["time"]))
    same = {name: series.get(name, series["first"]) for name in ("low", "high", "last")}
    each = {name: one if isinstance(one := series[name], list) else [one] * len(time) for name in ("quality", "count")}
    return series | same | each | {"time": time}


def test_a_series_has_columns_of_one_length_with_a_gap_where_it_was_bad(staff: Staff) -> None:
    staff.enter("ana", "viewer")
    answer = orjson.loads(ask(staff.client, "series", tags="m1.speed,m1.current", width=60).content)
    speed, current = map(unpacked, answer["series"])
    assert (speed["tag"], speed["unit"], speed["stepped"], speed["source"]) == ("m1.speed", "rpm", False, "sample")
    columns = [speed[name] for name in ("time", "first", "low", "high", "last", "quality", "count")]
    assert {len(column) for column in columns} == {len(speed["time"])}
    assert sum(speed["count"]) == 600
    bad = [t for t, v in zip(speed["time"], speed["high"], strict=True) if v is None]
    assert min(bad) >= BEGIN + 200_000_000
    assert max(bad) < BEGIN + 300_000_000
    assert current["last"][-1] == 2.25
    assert (answer["from"], answer["to"], answer["width"]) == (BEGIN, BEGIN + 600_000_000, 60)


def test_an_answer_says_everything_once_and_unpacks_to_what_was_asked(staff: Staff) -> None:
    """At every width the same columns as the query gives; of single samples less than half of what they took."""
    staff.enter("ana", "viewer")
    runtime = runtime_of(staff.client)
    for width in (1, 7, 60, 600, 4000):
        for tag in ("m1.speed", "m1.current"):
            answer = ask(staff.client, "series", tags=tag, width=width)
            (series,) = orjson.loads(answer.content)["series"]

            def work(connection: Connection, tag: str = tag, width: int = width) -> dict[str, Any]:
                known = query.find(connection, tag)
                assert known is not None
                found = query.columns(connection, known.number, BEGIN, BEGIN + 600_000_000, width)
                return {name: getattr(found, name) for name in found.__slots__}

            wanted = staff.wait(runtime.history.read, work)
            assert {name: unpacked(series)[name] for name in wanted} == wanted
            if width == 4000 and tag == "m1.speed":
                assert len(answer.content) < 0.5 * len(orjson.dumps(wanted))


def test_what_only_the_history_knows_is_read_with_the_right_to_its_page(staff: Staff) -> None:
    """Points of a link that is gone, and a point by the lasting id that it has from a former name."""
    runtime = runtime_of(staff.client)
    point = next(one for one in runtime.points.values() if permission_of_point(one) == "diagnose")
    staff.wait(
        runtime.history.write,
        lambda connection: store.register(
            connection,
            [replace(point, id="sys.old.polls", name="sys.old.polls"), replace(point, id="m0.gone", name="m0.gone")],
        ),
    )
    kept = runtime.points[point.name]
    runtime.points[point.name] = replace(kept, id="old.name")
    try:
        staff.have()
        ask(staff.client, "series", tags="m0.gone")
        ask(staff.client, "series", tags="sys.old.polls", status=403)
        ask(staff.client, "series", tags="old.name", status=403)
    finally:
        runtime.points[point.name] = kept
    staff.enter("eva", "engineer")
    ask(staff.client, "series", tags="sys.old.polls")


def test_live_values_become_history_at_once(staff: Staff) -> None:
    staff.enter("ana", "viewer")
    runtime = runtime_of(staff.client)
    pass_time(1)
    staff.wait(runtime.recorder.flush)
    answer = orjson.loads(staff.client.get("/history/series?tags=m1.speed&from=-1m").content)
    assert sum(unpacked(answer["series"][0])["count"]) >= 1
    assert answer["alive"] > answer["now"] - 5_000_000


def test_a_guest_sees_series_and_takes_nothing_home(staff: Staff) -> None:
    staff.have()
    ask(staff.client, "series", tags="m1.speed")
    for path in (
        "/history/export.csv",
        "/history/export/size",
        "/history/export/progress",
        "/storage",
        "/storage/figures",
    ):
        assert staff.client.get(path, params={"tags": "m1.speed"}).status_code in (303, 401), path


@pytest.mark.parametrize(
    ("query", "status"),
    [
        ({"tags": "m9.speed"}, 404),
        ({"tags": ""}, 422),
        ({"tags": ",".join(f"m1.p{i}" for i in range(9))}, 422),
        ({"tags": "m1.speed", "width": 4001}, 422),
        ({"tags": "m1.speed", "width": "many"}, 422),
        ({"tags": "m1.speed", "from_": "yesterday"}, 422),
        ({"tags": "m1.speed", "from_": BEGIN + 700_000_000}, 422),
    ],
)
def test_what_cannot_be_is_refused_with_a_reason(staff: Staff, query: dict[str, Any], status: int) -> None:
    staff.enter("ana", "viewer")
    assert "history." not in ask(staff.client, "series", status, **query).text


@pytest.mark.parametrize(
    ("begin", "end", "told"),
    [
        (
            "2026-03-29T02:30",
            "2026-03-29T03:10",
            ["2026-03-29T02:30 (= 2026-03-29T03:30:00+02:00)", "2026-03-29T03:10"],
        ),
        ("2026-10-25T01:30Z", "2026-10-25T02:30", ["2026-10-25T01:30Z (= 2026-10-25T02:30:00+01:00)"]),
        ("now", "-1h", ["-1h (= ", "now (= "]),
    ],
)
@pytest.mark.parametrize("part", ["series", "export.csv", "export/size"])
def test_a_span_that_ends_before_it_begins_is_told_as_it_was_written_and_as_what_it_is(
    staff: Staff, part: str, begin: str, end: str, told: list[str]
) -> None:
    """The clock leaves out an hour in spring and has one twice in autumn."""
    staff.enter("ana", "viewer")
    answer = html.unescape(ask(staff.client, part, 422, tags="m1.speed", from_=begin, to=end).text)
    assert not [words for words in told if words not in answer], answer


def test_the_export_is_a_file_that_proves_itself(staff: Staff, tmp_path: Path) -> None:
    staff.enter("ana", "viewer")
    answer = ask(staff.client, "export.csv", tags="m1.speed,m1.current", locale="hr", bom=1)
    assert answer.headers["content-disposition"].startswith('attachment; filename="pogon-history-20260309-070000.csv"')
    path = tmp_path / "x.csv"
    path.write_bytes(answer.content)
    assert verify_export(path).ok
    assert verify_export(path).rows == 601
    text = answer.content.decode("utf-8-sig")
    assert "# user: ana" in text
    assert "SIMULATION" in text
    assert ";2,25;A;" in text
    assert "2026-03-09T06:03:20.000Z;2026-03-09T07:03:20.000+01:00;m1.speed;;rpm;bad:comm_failure;" in text
    assert orjson.loads(ask(staff.client, "export/size", tags="m1.speed").content) == {"rows": 600, "limit": 1_000_000}
    assert orjson.loads(ask(staff.client, "export/progress").content) == []
    lines = staff.wait(staff.access.audit.find, _exports())
    assert lines[0].person == "ana"
    assert lines[0].object == "m1.speed m1.current"


def test_aggregates_have_one_row_per_interval(staff: Staff) -> None:
    staff.enter("ana", "viewer")
    text = ask(staff.client, "export.csv", tags="m1.speed", interval=60, locale="machine").text
    rows = [line for line in text.splitlines() if line[:1].isdigit()]
    assert len(rows) == 10
    assert rows[0].split(",")[3:7] == ["1000", "1059", "1000", "1059"]
    assert rows[4].split(",")[3] == ""


def test_shifts_have_a_row_each_by_the_clock_of_the_plant(staff: Staff) -> None:
    """Those of the plant file, from 6, 14 and 22 o'clock in Zagreb; the range cuts the first and the last."""
    staff.enter("ana", "viewer")
    asked = {"tags": "m1.speed", "interval": "shift", "from_": "2026-03-08T20:00", "to": "2026-03-09T15:00"}
    text = ask(staff.client, "export.csv", locale="machine", **asked).text
    rows = [line.split(",") for line in text.splitlines() if line[:1].isdigit()]
    assert [(row[1][11:16], row[2][11:16], row[3], row[4]) for row in rows] == [
        ("20:00", "22:00", "2", "2"),
        ("22:00", "06:00", "3", "8"),
        ("06:00", "14:00", "1", "8"),
        ("14:00", "15:00", "2", "1"),
    ]
    assert rows[2][6:8] == ["1000", "1599"] and rows[0][6:8] == ["", ""]
    assert orjson.loads(ask(staff.client, "export/size", **asked).content)["rows"] == 4


def test_a_third_export_at_a_time_is_asked_to_come_later_and_the_place_is_given_back(staff: Staff) -> None:
    staff.enter("ana", "viewer")
    places = history.exports_of(staff.client.app)  # type: ignore[arg-type]
    busy = {object(): 0, object(): 0}
    places.update(busy)  # type: ignore[arg-type]
    ask(staff.client, "export.csv", 503, tags="m1.speed")
    for one in busy:
        places.pop(one)  # type: ignore[arg-type]
    for _ in range(4):
        ask(staff.client, "export.csv", tags="m1.speed")
    assert not places


def test_no_language_lets_a_formula_out(staff: Staff) -> None:
    staff.enter("ana", "viewer")
    digests = set()
    for lang in ("hr", "en", "de", "cs"):
        staff.client.cookies.set("pogon_lang", lang)
        content = ask(staff.client, "export.csv", tags="m1.speed", locale="machine").content
        rows = b"".join(line for line in content.splitlines() if line[:1].isdigit())
        digests.add(hashlib.sha256(rows).hexdigest())
    staff.client.cookies.delete("pogon_lang")
    assert len(digests) == 1, "the machine format is the same in every language"


@pytest.mark.parametrize("lang", ["hr", "en", "de", "cs"])
def test_the_page_storage_speaks_every_language(staff: Staff, lang: str) -> None:
    staff.enter("ivo", "operator")
    runtime = runtime_of(staff.client)
    staff.wait(runtime.recorder.upkeep.measure)
    staff.client.cookies.set("pogon_lang", lang)
    for path in ("/storage", "/storage/figures"):
        page = staff.client.get(path)
        assert page.status_code == 200
        assert "[storage" not in page.text
        assert "GB" in page.text
        assert 'data-figure="reached"' in page.text
    runtime.recorder._say(StorageError("history.db: database or disk is full"))
    assert "database or disk is full" in staff.client.get("/storage/figures").text
    runtime.recorder.full = False
    staff.client.cookies.delete("pogon_lang")


def test_the_recorder_speaks_as_tags(staff: Staff) -> None:
    runtime = runtime_of(staff.client)
    runtime.sweep.publish()
    tags = runtime.tags
    assert tags.sample("sys.history.full").value == 0
    assert isinstance(tags.sample("sys.history.fill").value, float)


def test_a_history_that_cannot_be_opened_does_not_stop_the_plant(
    start: Callable[..., TestClient], tmp_path: Path
) -> None:
    (tmp_path / "data" / "history.db").mkdir(mode=0o700, parents=True)
    (tmp_path / "data").chmod(0o700)
    client = start()
    runtime = runtime_of(client)
    runtime.sweep.publish()
    assert runtime.tags.sample("sys.history.full").value == 1
    assert runtime.recorder.error
    assert client.get("/healthz").json()["tasks_down"] == []
    assert client.get("/equipment/m1").status_code == 200
    assert client.get("/history/series?tags=m1.speed").status_code == 503


def _exports() -> Any:
    from app.access.audit.search import Filter

    return Filter(kind="history.exported")


def test_a_trend_opens_while_exports_and_curves_of_months_are_read(
    staff: Staff, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those who read much wait for one another, and nobody else for them."""
    asked: list[str] = []

    async def taken(_work: Any) -> None:
        asked.append("much")
        raise StorageError("its readers are taken")

    staff.enter("ana", "viewer")
    monkeypatch.setattr(runtime_of(staff.client).history, "read_long", taken)
    for path in ("/trends?tags=m1.speed,m1.current&span=1h", "/trends/recent?tags=m1.speed"):
        assert staff.client.get(path).status_code == 200, path
    ask(staff.client, "series", tags="m1.speed,m1.current", from_="-8h", to="now")
    assert not asked
    ask(staff.client, "series", 503, tags="m1.speed,m1.current", from_="-60d", to="now")
    ask(staff.client, "export/size", 503, tags="m1.speed")
    assert len(asked) == 2
