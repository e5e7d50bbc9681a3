"""Records as a browser and a program ask for them: list, filter, pages, one with its events, times of parts, CSV."""

import re
from collections.abc import Iterator
from typing import Any

import pytest
from sqlalchemy import Connection

from app.access.audit.search import Filter
from app.errors import StorageError
from app.historian import record_query
from app.historian.export import verify_export
from app.historian.record_export import kinds
from app.historian.record_query import RecordFilter
from app.historian.records import RecordFold
from app.records.record import Record
from app.settings import Settings
from tests.historian import books, stories
from tests.historian.former import plant as former
from tests.historian.rings import BEGIN, SECOND, Ring
from tests.virtual import house
from tests.web.operating import runtime_of
from tests.web.people import Staff

MARCH: dict[str, Any] = {"since": "2026-03-09T00:00", "until": "2026-03-10T00:00"}
LANGUAGES = ["hr", "en", "de", "cs"]
KINDS = ["passage", "force", "run"]
"""Of those that the plant has, those that are filled here."""


@pytest.fixture(scope="module")
def staff(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Staff]:
    folder = tmp_path_factory.mktemp("records")
    with house(Settings(plant=former.write(folder / "plant"), data=folder / "data")) as client:
        crew = Staff(client)
        runtime = runtime_of(client)
        for link in ("coil", "line"):
            crew.wait(
                runtime.supervisor.end, f"link.{link}"
            )  # the plant's own rings would go on with what is told here
        plant = runtime.plant
        assert plant is not None, runtime.problems
        fold = RecordFold(plant.equipment.values())

        def fill(connection: Connection) -> None:
            for equipment, portions in (
                ("c1", stories.products(1, 260)),
                ("c2", stories.products(2, 120, BEGIN + 5)),
                ("seq1", stories.interrupted(BEGIN + 11)),
                ("seq2", stories.runs(3, 70, BEGIN + 7)),
            ):
                for portion in portions:
                    books.store(connection, fold, equipment, portion.events, portion.lost)
            ring = Ring(time=BEGIN + 7200 * SECOND, sequence=5000, boot=9)
            ring.tell(1, 99_999, source=1)
            ring.tell(3, 99_999, source=2, value=-2.75)
            ring.tell(10, 99_999, source=2, value=-2.75, after=0)
            ring.tell(20, 99_999, source=2, second=99_998, value=4.5, other=6.25)
            ring.tell(6, 99_999)
            books.store(connection, fold, "c1", ring.drain())
            connection.exec_driver_sql(
                "UPDATE event SET person = '=Ana; Kos', reason = 'fell \"down\"' WHERE code IN (6, 1, 15) AND boot IN (1, 9)"
            )

        crew.wait(runtime.history.write, fill)
        yield crew


def get(staff: Staff, path: str, status: int = 200, **query: Any) -> Any:
    answer = staff.client.get(path, params={key.rstrip("_"): value for key, value in query.items()})
    assert answer.status_code == status, (path, answer.text[:2000])
    return answer


def ids(page: str) -> list[int]:
    return [int(number) for number in re.findall(r'<tr data-row="(\d+)"', page)]


def found(staff: Staff, kind: str, **wanted: Any) -> list[Record]:
    runtime = runtime_of(staff.client)
    of = kinds(runtime.plant)[kind]
    rows: list[Record] = staff.wait(
        runtime.history.read, lambda connection: record_query.find(connection, of, RecordFilter(**wanted), 10_000)
    )
    return rows


def test_the_first_kind_is_where_one_begins(staff: Staff) -> None:
    staff.have()
    answer = staff.client.get("/records", follow_redirects=False)
    assert (answer.status_code, answer.headers["location"]) == (
        303,
        f"/records/{next(iter(kinds(runtime_of(staff.client).plant)))}",
    )
    get(staff, "/records/colour", 404)
    get(staff, "/records/passage/export/size/x", 404)


@pytest.mark.parametrize("kind", KINDS)
def test_a_guest_reads_the_list_and_takes_nothing_home(staff: Staff, kind: str) -> None:
    staff.have()
    page = get(staff, f"/records/{kind}", **MARCH).text
    assert ids(page) == [one.id for one in found(staff, kind)[:50]]
    assert "export.csv" not in page
    assert "Ana" not in page
    detail = get(staff, f"/records/{kind}/detail/{ids(page)[0]}").text
    assert "Ana" not in detail and "fell" not in detail
    for path in ("export.csv", "export/size"):
        assert staff.client.get(f"/records/{kind}/{path}").status_code in (303, 401)


@pytest.mark.parametrize("kind", KINDS)
def test_pages_follow_one_another_without_a_gap(staff: Staff, kind: str) -> None:
    staff.enter("ana", "viewer")
    seen: list[int] = []
    page = get(staff, f"/records/{kind}", **MARCH).text
    while True:
        seen += ids(page)
        older = re.search(r'href="([^"]+)" rel="next"', page)
        if not older:
            break
        page = staff.client.get(older[1].replace("&amp;", "&")).text
        assert 'data-renewed="list"' not in page, "only the first page renews itself"
    assert seen == [one.id for one in found(staff, kind)]


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("kind", "query", "wanted"),
    [
        ("passage", {"product": "99999"}, {"given": {"product": 99_999}}),
        ("passage", {"product": "#99999"}, {"given": {"product": 99_999}}),
        ("passage", {"outcome": "deleted"}, {"outcome": "deleted"}),
        ("passage", {"correction": "2,5"}, {"given": {"correction": 2.5}}),
        ("passage", {"correction": "2.5", "equipment": "c2"}, {"given": {"correction": 2.5}, "equipment": "c2"}),
        ("passage", {"alarm": "any"}, {"given": {"alarm": "any"}}),
        ("passage", {"alarm": "10"}, {"given": {"alarm": "10"}}),
        ("run", {"outcome": "timed_out"}, {"outcome": "timed_out"}),
        ("run", {"first_out": "any"}, {"given": {"first_out": "any"}}),
        ("run", {"first_out": "lift.pressure_ok"}, {"given": {"first_out": "lift.pressure_ok"}}),
        ("run", {"longer": "1,51"}, {"given": {"longer": 1.51}}),
        ("run", {"forced": "1"}, {"given": {"forced": "any"}}),
        ("run", {"forced": "any", "equipment": "seq1"}, {"given": {"forced": "any"}, "equipment": "seq1"}),
        ("force", {"outcome": "over"}, {"outcome": "over"}),
    ],
)
def test_filters(staff: Staff, kind: str, query: dict[str, str], wanted: dict[str, Any]) -> None:
    staff.enter("ana", "viewer")
    expected = [one.id for one in found(staff, kind, **wanted)]
    assert expected
    for path in ("", "/list"):
        assert ids(get(staff, f"/records/{kind}{path}", **query).text) == expected[:50]
    program = get(staff, f"/api/v1/records/{kind}", limit=1000, **query).json()
    assert [one["id"] for one in program["records"]] == expected


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("kind", "query"),
    [
        *((kind, query) for kind in KINDS for query in (
            {"outcome": "eaten"}, {"before": "1"}, {"before": "1-x"}, {"before": "²-1"}, {"since": "yesterday"},
            {"equipment": ["c1", "c2"]}, {"view": "upside_down"},
        )),
        *(("passage", {"product": text}) for text in ("many", str(2**32), "²", "1" * 5000, "-1", "1.5", "٣")),
        *(("passage", {"correction": text}) for text in ("-1", "inf", "nan", "²", "1e9")),
        *(("passage", {"alarm": text}) for text in ("loud", "²", "9" * 5000)),
        ("passage", {"view": "steps"}),
        *(("run", {"longer": text}) for text in ("-1", "inf", "nan")),
        ("run", {"forced": "yes"}),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused(staff: Staff, kind: str, query: dict[str, Any]) -> None:
    staff.enter("ana", "viewer")
    for path in ("", "/list", "/export.csv", "/export/size"):
        get(staff, f"/records/{kind}{path}", 422, **query)


@pytest.mark.sweep(8)
@pytest.mark.parametrize("lang", LANGUAGES)
@pytest.mark.parametrize("kind", KINDS)
def test_everything_is_told_in_every_language(staff: Staff, kind: str, lang: str) -> None:
    staff.enter("ana", "viewer")
    staff.client.cookies.set("pogon_lang", lang)
    pages = [get(staff, f"/records/{kind}").text, get(staff, f"/records/{kind}", equipment="c1").text]
    if kind == "run":
        pages.append(get(staff, "/records/run", view="steps").text)
    by_outcome = {one.outcome: one.id for one in found(staff, kind)}
    pages += [get(staff, f"/records/{kind}/detail/{number}").text for number in by_outcome.values()]
    for page in pages:
        assert not re.search(r"\[[a-z]{2}\] |\[(records|record|event|unit)\.", page), re.findall(
            r"\[[a-z_.]+\]?[^<]*", page
        )
    staff.client.cookies.delete("pogon_lang")


def test_a_passage_tells_its_events_with_values_alarms_and_people(staff: Staff) -> None:
    staff.enter("ana", "viewer")
    staff.client.cookies.set("pogon_lang", "en")
    (one,) = found(staff, "passage", given={"product": 99_999})
    page = get(staff, f"/records/passage/detail/{one.id}").text
    assert page.count("<li") == 5
    assert "−2.75" in page and "S2" in page and "#99998" in page
    assert "=Ana; Kos" in page and "fell &#34;down&#34;" in page
    assert re.search(r"\d\d:\d\d:\d\d\.\d{3}", page)
    staff.client.cookies.delete("pogon_lang")


def test_a_run_tells_what_fell_who_forced_and_how_long_it_was_suspended(staff: Staff) -> None:
    staff.enter("ana", "viewer")
    staff.client.cookies.set("pogon_lang", "en")
    one = next(run for run in found(staff, "run", equipment="seq1") if run.fields.get("first_out"))
    page = get(staff, f"/records/run/detail/{one.id}").text
    assert page.count("Hydraulic pressure OK") >= 3, "first-out, what fell, a force"
    assert re.search(r"\b6[12]\b", page), "the value behind it"
    assert "0.30" in page or "0.3 s" in page, "suspended"
    assert "=Ana; Kos" in page
    staff.client.cookies.delete("pogon_lang")


@pytest.mark.parametrize(
    ("lang", "said"), [("en", "Missing: "), ("hr", "Nedostaje: "), ("de", "Fehlt: "), ("cs", "Chybí: ")]
)
def test_what_stopped_a_run_is_called_missing_and_not_by_its_good_state(staff: Staff, lang: str, said: str) -> None:
    staff.enter("ana", "viewer")
    staff.client.cookies.set("pogon_lang", lang)
    one = next(run for run in found(staff, "run", equipment="seq1") if run.fields.get("first_out"))
    for path in ("list", f"detail/{one.id}"):
        assert f">{said}" in get(staff, f"/records/run/{path}").text, path
    staff.client.cookies.delete("pogon_lang")


@pytest.mark.parametrize("kind", KINDS)
def test_one_that_is_not_there_is_not_found(staff: Staff, kind: str) -> None:
    staff.enter("ana", "viewer")
    other = found(staff, "run" if kind != "run" else "passage")[0].id
    for number in (999_999, 0, -1, 2**63, 10**30, other):
        get(staff, f"/records/{kind}/detail/{number}", 404)


@pytest.mark.sweep(8)
def test_times_of_parts_are_those_of_the_filtered_runs(staff: Staff) -> None:
    staff.enter("ana", "viewer")
    staff.client.cookies.set("pogon_lang", "en")
    page = get(staff, "/records/run", view="steps", equipment="seq1").text
    rows = re.findall(r'<th scope="row">([^<]+)</th>\s*<td class="r num">(\d+)</td>', page)
    assert [name for name, _ in rows] == ["Lower the coil car", "Drive under the mandrel", "Lift to the coil", "Whole"]
    few = get(staff, "/records/run/list", view="steps", equipment="seq1", outcome="timed_out").text
    assert ">Whole<" not in few
    staff.client.cookies.delete("pogon_lang")


@pytest.mark.sweep(8)
@pytest.mark.parametrize(("kind", "stem"), [("passage", "products"), ("run", "runs"), ("force", "forces")])
@pytest.mark.parametrize("locale", [*LANGUAGES, "machine"])
def test_an_export_proves_itself_and_holds_no_formula(
    staff: Staff, kind: str, stem: str, locale: str, tmp_path: Any
) -> None:
    staff.enter("ana", "viewer")
    answer = get(staff, f"/records/{kind}/export.csv", locale=locale, **MARCH)
    assert re.search(rf'filename="pogon-{stem}-\d{{8}}-\d{{6}}\.csv"', answer.headers["content-disposition"])
    path = tmp_path / "x.csv"
    path.write_bytes(answer.content)
    checked = verify_export(path)
    assert (checked.ok, checked.rows) == (True, len(found(staff, kind)))
    lines = answer.content.decode().split("\r\n")
    assert not any(cell.startswith(("=", "+", "@")) for line in lines for cell in re.split("[;,]", line))
    assert not re.search(r"\[(record|event)\.", answer.text)
    marked = get(staff, f"/records/{kind}/export.csv", locale=locale, bom="1")
    assert marked.content.startswith(b"\xef\xbb\xbf# Pogon")


def test_an_export_is_audited_and_gives_its_place_back(staff: Staff) -> None:
    staff.enter("ivo", "operator")
    for _ in range(4):
        get(staff, "/records/passage/export.csv", equipment="c2")
    lines = staff.wait(staff.access.audit.find, Filter(kind="records.exported"))
    assert (lines[0].person, lines[0].object) == ("ivo", "c2")
    assert get(staff, "/records/passage/export/size", equipment="c2").json()["rows"] == len(
        found(staff, "passage", equipment="c2")
    )
    get(staff, "/records/passage/export.csv", 422, locale="fr")
    get(staff, "/records/passage/export.csv", 404, equipment="c77")


def test_programs_read_kinds_fields_parts_and_events(staff: Staff) -> None:
    staff.enter("ana", "viewer")
    staff.client.cookies.set("pogon_lang", "en")
    known = {one["kind"]: one for one in get(staff, "/api/v1/records").json()}
    assert known["passage"]["filters"] == {"product": "is", "correction": "above", "alarm": "alarm"}
    assert known["run"]["equipment"] == ["seq1", "seq2"]
    first = get(staff, "/api/v1/records/run", limit=40).json()
    second = get(staff, "/api/v1/records/run", limit=1000, before=first["next"], parts=False).json()
    assert len(first["records"]) + len(second["records"]) == len(found(staff, "run"))
    assert second["next"] is None and second["records"][0]["parts"] == []
    one = next(
        one
        for one in get(staff, "/api/v1/records/run", equipment="seq1", events=True).json()["records"]
        if one["fields"]["first_out"]
    )
    assert (one["fields"]["cause"], one["labels"]["first_out"]) == ("time", "Hydraulic pressure OK")
    assert {event["event"] for event in one["events"]} >= {"started", "suspended", "permissive_lost"}
    assert next(event["words"]["bit"] for event in one["events"] if event["event"] == "permissive_lost") == 3
    assert one["parts"][0]["key"] == "lower"
    (thing,) = get(staff, "/api/v1/records/passage", product="99999", events=True).json()["records"]
    assert (thing["outcome"], thing["alarms"]) == ("deleted", ["outside_tolerance", "gap_stop"])
    assert thing["events"][-1]["person"] == "=Ana; Kos"
    staff.client.cookies.delete("pogon_lang")
    get(staff, "/api/v1/records/passage", 422, colour="red")
    get(staff, "/api/v1/records/passage", 422, outcome="eaten")
    get(staff, "/api/v1/records/colour", 404)


@pytest.mark.parametrize("kind", KINDS)
def test_an_end_before_the_beginning_is_named_and_what_was_typed_stays(staff: Staff, kind: str) -> None:
    staff.enter("ivo", "operator")
    turned = {"since": "2026-03-10T00:00", "until": "2026-03-09T00:00"}
    page = get(staff, f"/records/{kind}", 422, **turned).text
    assert 'role="alert">' in page
    assert 'value="10.03.2026 00:00"' in page and 'value="09.03.2026 00:00"' in page
    assert "export.csv" not in page and 'id="event-list"' not in page
    get(staff, f"/api/v1/records/{kind}", 422, from_="2026-03-10T00:00:00Z", to="2026-03-09T00:00:00Z")


def test_a_history_that_cannot_be_read_says_so(staff: Staff, monkeypatch: pytest.MonkeyPatch) -> None:
    staff.enter("ana", "viewer")

    async def broken(_work: Any) -> Any:
        raise StorageError("history.db: disk I/O error")

    for name in ("read", "read_long"):
        monkeypatch.setattr(runtime_of(staff.client).history, name, broken)
    get(staff, "/records/passage", 503)
    get(staff, "/api/v1/records/run", 503)


def test_lost_events_are_those_of_the_machines_of_the_kind(staff: Staff) -> None:
    """Of all machines together, too: what a sequence lost is nothing that a product has missed."""

    def note(connection: Connection) -> None:
        connection.exec_driver_sql("DELETE FROM event_gap")  # what the stories above have lost
        connection.exec_driver_sql(
            "INSERT INTO event_gap (equipment, boot, sequence, time, count) VALUES ('c2', 1, 1, ?, 4), ('seq1', 1, 1, ?, 300)",
            (BEGIN, BEGIN),
        )

    staff.enter("ana", "viewer")
    staff.client.cookies.set("pogon_lang", "en")
    staff.wait(runtime_of(staff.client).history.write, note)
    assert "Events lost in this time: 4<" in get(staff, "/records/passage", **MARCH).text
    assert "Events lost in this time: 300<" in get(staff, "/records/run", **MARCH).text
    staff.client.cookies.delete("pogon_lang")


@pytest.mark.parametrize(
    ("former", "now"),
    [
        ("/products", "/records/passage"),
        ("/products?equipment=c1&product=%2399999", "/records/passage?equipment=c1&product=%2399999"),
        ("/products/list?outcome=lost&before=", "/records/passage/list?outcome=lost&before="),
        ("/products/export.csv?locale=hr&bom=1", "/records/passage/export.csv?locale=hr&bom=1"),
        ("/products/export/size?correction=2%2C5", "/records/passage/export/size?correction=2%2C5"),
        ("/runs", "/records/run"),
        ("/runs?equipment=seq1&view=steps", "/records/run?equipment=seq1&view=steps"),
        ("/runs/list?first_out=any&forced=1", "/records/run/list?first_out=any&forced=1"),
        ("/runs/export.csv?longer=1.5", "/records/run/export.csv?longer=1.5"),
        ("/runs/export/size", "/records/run/export/size"),
        # a program asked for all events of a product without saying so; steps of a run are parts
        ("/api/v1/products", "/api/v1/records/passage?events=true"),
        (
            "/api/v1/products?product=99999&steps=true&from=2026-03-09T00:00:00%2B01:00",
            "/api/v1/records/passage?product=99999&events=true&from=2026-03-09T00%3A00%3A00%2B01%3A00",
        ),
        ("/api/v1/products?steps=false&alarm=any", "/api/v1/records/passage?events=false&alarm=any"),
        ("/api/v1/runs", "/api/v1/records/run"),
        ("/api/v1/runs?steps=false&events=true&limit=7", "/api/v1/records/run?parts=false&events=true&limit=7"),
        ("/api/v1/runs?forced=true&longer=1.5", "/api/v1/records/run?forced=1&longer=1.5"),
        ("/api/v1/runs?forced=False&first_out=any", "/api/v1/records/run?first_out=any"),
    ],
)
def test_an_address_from_before_there_were_records_leads_there(staff: Staff, former: str, now: str) -> None:
    staff.enter("ana", "viewer")
    answer = staff.client.get(former, follow_redirects=False)
    assert (answer.status_code, answer.headers["location"]) == (308, now)
    assert staff.client.get(now).status_code == 200


def test_numbers_from_before_there_were_records_lead_nowhere(staff: Staff) -> None:
    staff.enter("ana", "viewer")
    for path in ("/products/detail/1", "/runs/detail/1", "/forces/detail/1", "/api/v1/forces"):
        get(staff, path, 404)


def test_the_description_of_the_interface_tells_records(staff: Staff) -> None:
    staff.enter("eva", "engineer")
    described = get(staff, "/api/v1/openapi.json").json()
    assert {"/api/v1/records", "/api/v1/records/{kind}"} <= set(described["paths"])
    assert "/api/v1/products" not in described["paths"] and "/api/v1/runs" not in described["paths"]
    assert "overlapping" in described["components"]["schemas"]["RecordOut"]["properties"]
    for path in ("/api/v1/records", "/api/v1/records/{kind}"):
        assert {"401", "403", "422", "503"} <= set(described["paths"][path]["get"]["responses"])
