"""The history of products as a browser asks for it: list, filter, pages, steps, CSV, API."""

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from app.access.audit.search import Filter
from app.errors import StorageError
from app.historian.events import Delivery, EndedCommand, attribute, store
from app.historian.export import verify_export
from app.historian.records import RecordFold
from app.runtime import Runtime
from tests.historian.rings import BEGIN, SECOND, Ring
from tests.web.people import Staff

GOLDEN = Path(__file__).parent / "golden"
MARCH = {"since": "2026-03-09T00:00", "until": "2026-03-10T00:00"}


def runtime_of(client: TestClient) -> Runtime:
    found: Runtime = client.app.state.runtime  # type: ignore[attr-defined]
    return found


def fill(connection: Any, fold: RecordFold) -> None:
    """Seventy products in March, on two machines; one with everything that can happen."""
    for equipment in ("c1", "gone"):
        ring = Ring()
        for product in range(1, 36):
            ring.passage(product, 20.0 + product / 4, (0.25, -0.5, 1.0 if product % 5 else 3.5))
        if equipment == "c1":
            ring.tell(1, 99, source=1)
            ring.tell(2, 99, source=1, value=33.25)
            ring.tell(3, 99, source=2, value=-2.75)
            ring.tell(10, 99, source=2, value=-2.75, after=0)
            ring.tell(20, 99, source=2, second=98, value=4.5, other=6.25)
            ring.tell(6, 99, request=77)
        store(connection, Delivery(equipment, ring.drain()), (fold,), BEGIN)
    told = EndedCommand(
        "c1", (77,), "=Ana; Kos", 'fell "down"\n=HYPERLINK("x")', ring.time - SECOND, ring.time + 60 * SECOND
    )
    assert attribute(connection, told, (fold,))
    connection.exec_driver_sql("DELETE FROM event_mark WHERE equipment = 'c1'")


@pytest.fixture(scope="module")
def staff(demo: TestClient) -> Iterator[Staff]:
    crew = Staff(demo)
    plant = runtime_of(demo).plant
    assert plant is not None
    (line,) = (item for item in plant.equipment.values() if item.id == "c1")
    fold = RecordFold([line, replace(line, id="gone")])
    crew.wait(runtime_of(demo).history.write, lambda connection: fill(connection, fold))
    yield crew


def get(staff: Staff, path: str, status: int = 200, **query: Any) -> Any:
    answer = staff.client.get(path, params={key.rstrip("_"): value for key, value in query.items()})
    assert answer.status_code == status, answer.text
    return answer


def products(page: str) -> list[int]:
    return [int(number) for number in re.findall(r'<span class="num">#(\d+)</span></button>', page)]


def test_a_guest_reads_the_list_and_takes_nothing_home(staff: Staff) -> None:
    staff.have()
    page = get(staff, "/records/passage", **MARCH).text
    assert products(page)[:3] == [98, 99, 35]
    assert "export.csv" not in page
    for path in ("/records/passage/export.csv", "/records/passage/export/size"):
        assert staff.client.get(path).status_code in (303, 401)


def test_pages_follow_one_another_without_a_gap(staff: Staff) -> None:
    staff.enter("ana", "viewer")
    seen: list[int] = []
    url = "/records/passage?equipment=gone"
    page = staff.client.get(url).text
    assert products(page) == list(range(35, 0, -1))
    page = get(staff, "/records/passage", **MARCH).text
    while True:
        seen += products(page)
        older = re.search(r'href="([^"]+)" rel="next"', page)
        if not older:
            break
        page = staff.client.get(older[1].replace("&amp;", "&")).text
        assert 'data-renewed="list"' not in page, "only the first page renews itself"
    assert sorted(seen) == sorted([*range(1, 36), *range(1, 36), 98, 99])


@pytest.mark.parametrize(
    ("query", "wanted"),
    [
        ({"product": "7", "equipment": "gone"}, [7]),
        ({"product": "#7", "equipment": "gone"}, [7]),
        ({"outcome": "deleted", **MARCH}, [99]),
        ({"outcome": "lost", **MARCH}, []),
        ({"correction": "3,4", "equipment": "gone"}, [35, 30, 25, 20, 15, 10, 5]),
        ({"correction": "3.5", "equipment": "gone"}, []),
        ({"alarm": "any", **MARCH}, [98, 99]),
        ({"alarm": "10", **MARCH}, [99]),
        ({"since": "2026-03-09T07:00", "until": "2026-03-09T07:00:02", "equipment": "gone"}, [1]),
    ],
)
def test_filters(staff: Staff, query: dict[str, str], wanted: list[int]) -> None:
    staff.enter("ana", "viewer")
    for path in ("/records/passage", "/records/passage/list"):
        page = get(staff, path, **query).text
        assert products(page) == wanted


@pytest.mark.parametrize(
    "query",
    [
        {"outcome": "eaten"},
        {"product": "many"},
        {"product": str(2**32)},
        {"correction": "-1"},
        {"correction": "inf"},
        {"correction": "nan"},
        {"alarm": "loud"},
        {"before": "1"},
        {"before": "1-x"},
        {"since": "yesterday"},
        {"equipment": ["c1", "c2"]},
    ],
)
def test_what_cannot_be_is_refused(staff: Staff, query: dict[str, Any]) -> None:
    staff.enter("ana", "viewer")
    get(staff, "/records/passage", 422, **query)
    get(staff, "/records/passage/list", 422, **query)


@pytest.mark.parametrize("lang", ["hr", "en", "de", "cs"])
def test_the_steps_of_one_are_told_in_every_language(staff: Staff, lang: str) -> None:
    staff.enter("ana", "viewer")
    staff.client.cookies.set("pogon_lang", lang)
    page = get(staff, "/records/passage", product="99", **MARCH).text
    number = re.search(r'data-row="(\d+)"', page)
    assert number
    detail = get(staff, f"/records/passage/detail/{number[1]}").text
    assert not re.search(r"\[[a-z]{2}\]|\[(products|event)\.", page + detail)
    assert detail.count("<li") == 6
    assert "07:21:" in detail or re.search(r"\d\d:\d\d:\d\d\.\d{3}", detail)
    assert ("−2.75" if lang == "en" else "−2,75") in detail
    assert "=Ana; Kos" in detail
    assert "#98" in detail
    staff.client.cookies.delete("pogon_lang")


def test_one_that_is_not_there_is_not_found(staff: Staff) -> None:
    staff.enter("ana", "viewer")
    for number in (999999, 0, -1, 2**63, 10**30):
        get(staff, f"/records/passage/detail/{number}", 404)


@pytest.mark.parametrize("lang", ["hr", "en", "de", "cs", "machine"])
def test_the_export_is_the_golden_file(staff: Staff, lang: str, tmp_path: Path) -> None:
    """Headers in the reader's language, its separators, no formula; the file proves itself."""
    staff.enter("ana", "viewer")
    answer = get(staff, "/records/passage/export.csv", locale=lang, equipment="c1", correction="2,5", **MARCH)
    assert answer.headers["content-type"].startswith("text/csv")
    assert re.search(r'filename="pogon-products-c1-\d{8}-\d{6}\.csv"', answer.headers["content-disposition"])
    path = tmp_path / "x.csv"
    path.write_bytes(answer.content)
    found = verify_export(path)
    assert (found.ok, found.rows) == (True, 8)
    lines = answer.content.decode().split("\r\n")
    kept = [line for line in lines if not line.startswith(("# created", "# sha256", "# Pogon", "# plant"))]
    golden = GOLDEN / f"records.passage.{lang}.csv"
    assert "\n".join(kept) == golden.read_text("utf-8")
    assert not any(cell.startswith(("=", "+", "@")) for line in kept for cell in re.split("[;,]", line))
    if lang != "machine":
        assert answer.content.count(b"\xef\xbb\xbf") == 0
    with_mark = get(staff, "/records/passage/export.csv", locale=lang, bom="1", product="99", **MARCH)
    assert with_mark.content.startswith(b"\xef\xbb\xbf# Pogon")


def test_an_export_is_audited_and_gives_its_place_back(staff: Staff) -> None:
    staff.enter("ivo", "operator")
    for _ in range(4):
        get(staff, "/records/passage/export.csv", equipment="gone")
    lines = staff.wait(staff.access.audit.find, Filter(kind="records.exported"))
    assert (lines[0].person, lines[0].object) == ("ivo", "gone")
    assert get(staff, "/records/passage/export/size", equipment="gone").json()["rows"] == 35
    get(staff, "/records/passage/export.csv", 422, locale="fr")


def test_programs_read_the_same(staff: Staff) -> None:
    staff.enter("ana", "viewer")
    span = {"from_": "2026-03-09T00:00:00Z", "to": "2026-03-10T00:00:00Z"}
    first = get(staff, "/api/v1/records/passage", limit=50, events=True, **span).json()
    assert [one["number"] for one in first["records"]][:2] == [98, 99]
    second = get(staff, "/api/v1/records/passage", limit=50, before=first["next"], **span).json()
    assert len(first["records"]) + len(second["records"]) == 72
    assert second["next"] is None
    assert second["records"][0]["events"] == []
    one = get(staff, "/api/v1/records/passage", product=99, events=True, **span).json()["records"][0]
    assert (one["outcome"], one["fields"]["length"], one["alarms"]) == (
        "deleted",
        33.25,
        ["outside_tolerance", "gap_stop"],
    )
    assert [event["event"] for event in one["events"]][-1] == "deleted"
    assert one["events"][-1]["person"] == "=Ana; Kos"
    pair = next(event for event in one["events"] if event["event"] == "gap_stop")
    assert (pair["value"], pair["words"]["second"], pair["words"]["second_value"]) == (4.5, 98, 6.25)
    get(staff, "/api/v1/records/passage", 422, outcome="eaten")


def test_a_guest_reads_that_it_was_somebody_and_nothing_that_they_wrote(staff: Staff) -> None:
    span = "from=2026-03-09T00:00:00Z&to=2026-03-10T00:00:00Z"
    words = ("Ana", "fell", "HYPERLINK")
    road = f"/api/v1/records/passage?product=99&events=true&{span}"
    staff.enter("ana", "viewer")
    assert [word for word in words if word not in staff.client.get(road).text] == []
    rows = re.findall(
        r'<tr data-row="(\d+)"', get(staff, "/records/passage", since="2026-03-09T00:00", until="2026-03-10T00:00").text
    )
    roads = [road, *(f"/records/passage/detail/{row}" for row in rows)]
    staff.have()
    for road in roads:
        answer = staff.client.get(road)
        assert (answer.status_code, [word for word in words if word in answer.text]) == (200, []), road


def test_a_history_that_cannot_be_read_says_so(staff: Staff, monkeypatch: pytest.MonkeyPatch) -> None:
    staff.enter("ana", "viewer")

    async def broken(_work: Any) -> Any:
        raise StorageError("history.db: disk I/O error")

    for name in ("read", "read_long"):
        monkeypatch.setattr(runtime_of(staff.client).history, name, broken)
    get(staff, "/records/passage", 503)
    get(staff, "/api/v1/records/passage", 503)


@pytest.mark.sweep(8)
@pytest.mark.parametrize("lang", ["hr", "en", "de", "cs"])
@pytest.mark.parametrize("path", ["/records/passage", "/records/run"])
def test_an_end_before_the_beginning_is_named_and_what_was_typed_stays(staff: Staff, path: str, lang: str) -> None:
    staff.enter("ivo", "operator")
    staff.client.cookies.set("pogon_lang", lang)
    turned = {"since": "2026-03-10T00:00", "until": "2026-03-09T00:00", "equipment": "c1"}
    page = get(staff, path, 422, **turned).text
    said = runtime_of(staff.client).texts.text(lang, "history.range", begin="2026-03-10T00:00", end="2026-03-09T00:00")
    assert re.search(rf'role="alert">.*<p>{re.escape(said)}</p>', page)
    day = "{}/03/2026 00:00" if lang == "en" else "{}.03.2026 00:00"
    assert f'name="since" class="moment" value="{day.format(10)}"' in page
    assert f'name="until" class="moment" value="{day.format("09")}"' in page
    assert "export.csv" not in page and 'id="event-list"' not in page
    same = {"since": "2026-03-09T00:00", "until": "2026-03-09T00:00"}
    get(staff, path, 422, **same)
    for part in ("list", "export.csv", "export/size"):
        assert said in get(staff, f"{path}/{part}", 422, **turned).text
    get(staff, f"/api/v1{path}", 422, from_="2026-03-10T00:00:00Z", to="2026-03-09T00:00:00Z")
    staff.client.cookies.delete("pogon_lang")


@pytest.mark.parametrize("edge", [{"since": "0001-01-01T00:00"}, {"until": "9999-12-31T23:59-12:00"}])
def test_a_time_that_no_clock_can_show_is_refused_before_an_export_begins(staff: Staff, edge: dict[str, str]) -> None:
    staff.enter("ivo", "operator")
    for path in ("list", "export.csv", "export/size"):
        get(staff, f"/records/passage/{path}", 422, **edge)
