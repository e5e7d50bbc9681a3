"""The runs of sequences as a browser asks for them: list, filter, pages, detail, times, CSV, API; and a sequence that runs."""

import re
from collections.abc import Iterator
from html import unescape
from pathlib import Path
from typing import Any

import pytest

from app.access.audit.search import Filter
from app.errors import StorageError
from app.historian import record_query
from app.historian.export import verify_export
from app.historian.record_query import RecordFilter
from app.records.record import Part, Record
from app.running.page_tags import page_tags
from app.settings import Settings
from tests.historian.books import RUN
from tests.virtual import house
from tests.web import sequence_plant
from tests.web.operating import Operator, runtime_of, until
from tests.web.people import Staff

GOLDEN = Path(__file__).parent / "golden"
MARCH: dict[str, Any] = {"since": "2026-03-09T00:00", "until": "2026-03-10T00:00", "equipment": "seq1"}


@pytest.fixture(scope="module")
def staff(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Staff]:
    folder = tmp_path_factory.mktemp("runs")
    with house(Settings(plant=sequence_plant.write(folder / "plant"), data=folder / "data")) as client:
        crew = Staff(client)
        runtime = runtime_of(client)
        crew.wait(runtime.supervisor.end, "link.coil")  # the plant's own ring would end the run that is open
        plant = runtime.plant
        assert plant is not None, runtime.problems
        crew.wait(runtime.history.write, lambda connection: sequence_plant.fill(connection, plant))
        yield crew


def get(staff: Staff, path: str, status: int = 200, **query: Any) -> Any:
    answer = staff.client.get(path, params={key.rstrip("_"): value for key, value in query.items()})
    assert answer.status_code == status, answer.text
    return answer


def ids(page: str) -> list[int]:
    return [int(number) for number in re.findall(r'<tr data-row="(\d+)"', page)]


def found(staff: Staff, **wanted: Any) -> list[Record]:
    given = RecordFilter(**{"equipment": "seq1", **wanted})
    rows: list[Record] = staff.wait(
        runtime_of(staff.client).history.read, lambda connection: record_query.find(connection, RUN, given, 1000)
    )
    return rows


@pytest.mark.parametrize(
    ("lang", "gate", "drives"),
    [
        ("hr", "nedostaje: Zaštitne ograde zatvorene", "nedostaje: Pogoni spremni"),
        ("en", "missing: Guards closed", "missing: Drives ready"),
        ("de", "fehlt: Schutztüren geschlossen", "fehlt: Antriebe bereit"),
        ("cs", "chybí: Ochranné dveře zavřeny", "chybí: Pohony připraveny"),
    ],
)
def test_events_name_the_permissives_that_were_missing(staff: Staff, lang: str, gate: str, drives: str) -> None:
    """In place of a word of flags as a number; bit 0 is one like the others."""
    staff.client.cookies.set("pogon_lang", lang)
    page = unescape(get(staff, "/events", **MARCH).text)
    said = [
        " ".join(re.sub("<[^>]+>", " ", row).split()) for row in re.findall(r"<tr data-row=.*?</tr>", page, re.DOTALL)
    ]
    assert "65535" not in page and "16/16" in page
    assert any(f"Bit 0 {gate.partition(': ')[2]}" in row and f"15/16 {gate}" in row for row in said), said
    assert any(f"Bit 5 {drives.partition(': ')[2]}" in row and f"15/16 {drives}" in row for row in said), said
    number = next(int(one) for one, row in zip(ids(page), said, strict=True) if f"15/16 {gate}" in row)
    assert gate in unescape(get(staff, f"/events/detail/{number}").text)


def test_a_guest_reads_the_list_and_takes_nothing_home(staff: Staff) -> None:
    staff.have()
    page = get(staff, "/records/run", **MARCH).text
    assert len(ids(page)) == 50
    assert "export.csv" not in page
    for path in ("/records/run/export.csv", "/records/run/export/size"):
        assert staff.client.get(path).status_code in (303, 401)


def test_pages_follow_one_another_without_a_gap(staff: Staff) -> None:
    staff.enter("ana", "viewer")
    seen: list[int] = []
    page = get(staff, "/records/run", **MARCH).text
    while True:
        seen += ids(page)
        older = re.search(r'href="([^"]+)" rel="next"', page)
        if not older:
            break
        page = staff.client.get(older[1].replace("&amp;", "&")).text
        assert 'data-renewed="list"' not in page, "only the first page renews itself"
    assert seen == [run.id for run in found(staff)]
    assert len(seen) == 72


@pytest.mark.parametrize(
    ("query", "wanted"),
    [
        ({"outcome": "timed_out"}, {"outcome": "timed_out"}),
        ({"first_out": "any"}, {"given": {"first_out": "any"}}),
        ({"first_out": "drive.pressure_ok"}, {"given": {"first_out": "drive.pressure_ok"}}),
        ({"first_out": "abort.guards", "outcome": "aborted"}, {"given": {"first_out": "abort.guards"}}),
        ({"longer": "1,51"}, {"given": {"longer": 1.51}}),
        ({"longer": "1.51"}, {"given": {"longer": 1.51}}),
        ({"forced": "1"}, {"given": {"forced": "any"}}),
        ({"outcome": "unknown"}, {"outcome": "unknown"}),
    ],
)
def test_filters(staff: Staff, query: dict[str, Any], wanted: dict[str, Any]) -> None:
    staff.enter("ana", "viewer")
    expected = [run.id for run in found(staff, **wanted)]
    assert (len(expected) > 0) == (query.get("outcome") != "unknown")
    for path in ("/records/run", "/records/run/list"):
        assert ids(get(staff, path, **MARCH, **query).text) == expected


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    "query",
    [
        {"outcome": "eaten"},
        {"longer": "-1"},
        {"longer": "inf"},
        {"longer": "nan"},
        {"forced": "yes"},
        {"view": "upside_down"},
        {"before": "1"},
        {"before": "1-x"},
        {"since": "yesterday"},
        {"equipment": ["c1", "c2"]},
    ],
)
def test_what_cannot_be_is_refused(staff: Staff, query: dict[str, Any]) -> None:
    staff.enter("ana", "viewer")
    get(staff, "/records/run", 422, **query)
    get(staff, "/records/run/list", 422, **query)


@pytest.mark.parametrize("lang", ["hr", "en", "de", "cs"])
def test_one_is_told_in_every_language(staff: Staff, lang: str) -> None:
    staff.enter("ana", "viewer")
    staff.client.cookies.set("pogon_lang", lang)
    (one,) = found(staff, given={"first_out": "drive.pressure_ok"})
    page = get(staff, "/records/run", **MARCH).text
    times = get(staff, "/records/run", **MARCH, view="steps").text
    detail = get(staff, f"/records/run/detail/{one.id}").text
    assert not re.search(r"\[[a-z]{2}\]|\[(runs|event|unit)\.", page + detail + times)
    pressure = re.search(rf'{lang} = "([^"]+)"', sequence_plant.PRESSURE)
    assert pressure
    assert pressure[1] in page
    assert detail.count(pressure[1]) == 4, "first-out, two falls, a force"
    assert re.search(r"0[78]:06:46[.,]370", detail), "to the millisecond"
    assert re.search(r"\b6[12]\b", detail), "the value behind it"
    assert "=Ana; Kos" in detail
    assert "coil not round" in detail
    assert sequence_plant.STEPS["drive"][["hr", "en", "de", "cs"].index(lang)] in detail
    staff.client.cookies.delete("pogon_lang")


@pytest.mark.sweep(8)
def test_a_guest_reads_that_it_was_somebody_and_nothing_that_they_wrote(staff: Staff) -> None:
    span = "from=2026-03-09T00:00:00Z&to=2026-03-10T00:00:00Z&events=true"
    roads = [f"/records/run/detail/{one.id}" for one in found(staff)] + [f"/api/v1/records/run?{span}&limit=100"]
    words = ("Ana", "Ivo Ban", "coil not round", "HYPERLINK", "wet")
    staff.enter("ana", "viewer")
    told = "".join(staff.client.get(road).text for road in roads)
    assert [word for word in words if word not in told] == []
    staff.have()
    for road in roads:
        answer = staff.client.get(road)
        assert (answer.status_code, [word for word in words if word in answer.text]) == (200, []), road


def test_every_kind_of_run_has_a_detail(staff: Staff) -> None:
    staff.enter("ana", "viewer")
    for one in found(staff)[:8]:
        detail = get(staff, f"/records/run/detail/{one.id}").text
        assert 'href="/equipment/seq1"' in detail


def test_one_that_is_not_there_is_not_found(staff: Staff) -> None:
    staff.enter("ana", "viewer")
    for number in (0, -1, 999999, 2**70):
        get(staff, f"/records/run/detail/{number}", 404)


def test_times_per_step_are_those_of_the_filtered_runs(staff: Staff) -> None:
    staff.enter("ana", "viewer")
    staff.client.cookies.set("pogon_lang", "en")
    page = get(staff, "/records/run", **MARCH, view="steps").text
    rows = re.findall(r'<th scope="row">([^<]+)</th>\s*<td class="r num">(\d+)</td>', page)
    assert [name for name, _ in rows] == [
        "Lower the coil car",
        "Drive under the mandrel",
        "Lift to the coil",
        "Whole",
    ]
    counts = dict(rows)
    taken = [step for run in found(staff) for step in _steps(staff, run)]
    for name, key in (("Lower the coil car", "lower"), ("Lift to the coil", "lift")):
        assert int(counts[name]) == sum(step.key == key and step.state == "done" for step in taken)
    few = get(staff, "/records/run/list", **MARCH, view="steps", outcome="timed_out").text
    assert ">Whole<" not in few
    staff.client.cookies.delete("pogon_lang")


def _steps(staff: Staff, run: Record) -> list[Part]:
    read = runtime_of(staff.client).history.read
    taken: dict[int, Part] = staff.wait(read, lambda connection: record_query.parts(connection, [run.id]))[run.id]
    return list(taken.values())


@pytest.mark.parametrize("lang", ["hr", "en", "de", "cs", "machine"])
def test_the_export_is_the_golden_file(staff: Staff, lang: str, tmp_path: Path) -> None:
    """Headers and permissives in the reader's language, its separators, no formula; the file proves itself."""
    staff.enter("ana", "viewer")
    answer = get(
        staff,
        "/records/run/export.csv",
        locale=lang,
        since="2026-03-09T08:00",
        equipment="seq1",
        until="2026-03-10T00:00",
    )
    assert answer.headers["content-type"].startswith("text/csv")
    assert re.search(r'filename="pogon-runs-seq1-\d{8}-\d{6}\.csv"', answer.headers["content-disposition"])
    path = tmp_path / "x.csv"
    path.write_bytes(answer.content)
    checked = verify_export(path)
    assert checked.ok
    lines = answer.content.decode().split("\r\n")
    kept = [line for line in lines if not line.startswith(("# created", "# sha256", "# Pogon", "# plant"))]
    golden = GOLDEN / f"records.run.{lang}.csv"
    assert "\n".join(kept) == golden.read_text("utf-8")
    assert not any(cell.startswith(("=", "+", "@")) for line in kept for cell in re.split("[;,]", line))
    with_mark = get(staff, "/records/run/export.csv", locale=lang, bom="1", outcome="timed_out", **MARCH)
    assert with_mark.content.startswith(b"\xef\xbb\xbf# Pogon")


def test_an_export_is_audited_and_gives_its_place_back(staff: Staff) -> None:
    staff.enter("ivo", "operator")
    for _ in range(4):
        get(staff, "/records/run/export.csv", **MARCH)
    lines = staff.wait(staff.access.audit.find, Filter(kind="records.exported"))
    assert (lines[0].person, lines[0].object) == ("ivo", "seq1")
    assert get(staff, "/records/run/export/size", **MARCH).json()["rows"] == 72
    get(staff, "/records/run/export.csv", 422, locale="fr")
    every = get(staff, "/records/run/export.csv", locale="machine").text
    assert "step_3_s" in every


def test_programs_read_the_same(staff: Staff) -> None:
    staff.enter("ana", "viewer")
    span: dict[str, Any] = {"from_": "2026-03-09T00:00:00Z", "to": "2026-03-10T00:00:00Z"}
    first = get(staff, "/api/v1/records/run", limit=50, **span).json()
    second = get(staff, "/api/v1/records/run", limit=50, before=first["next"], parts=False, **span).json()
    assert len(first["records"]) + len(second["records"]) == 72
    assert second["next"] is None
    assert second["records"][0]["parts"] == []
    assert first["records"][0]["overlapping"] == {}
    (one,) = get(staff, "/api/v1/records/run", first_out="drive.pressure_ok", events=True, **span).json()["records"]
    said = one["fields"]
    assert (one["outcome"], said["cause"], said["step"], one["paused"]) == ("aborted", "permissive_lost", 2, 0.4)
    assert (said["first_out"], said["first_value"]) == ("drive.pressure_ok", 61.5)
    assert (said["started_by"], said["acknowledged_by"]) == ("Ivo Ban", "=Ana; Kos")
    assert one["events"][0]["event"] == "started"
    assert one["events"][-1]["event"] == "acknowledged"
    (force,) = one["overlapping"]["forces"]
    assert (force["kind"], force["fields"]["permissive"], force["person"]) == ("force", "lift.pressure_ok", "=Ana; Kos")
    assert force["reason"].startswith('sensor "B3" wet') and force["fields"]["asked"] == 120
    get(staff, "/api/v1/records/run", 422, outcome="eaten")
    get(staff, "/api/v1/records/run", 422, longer=-1)


def test_a_history_that_cannot_be_read_says_so(staff: Staff, monkeypatch: pytest.MonkeyPatch) -> None:
    staff.enter("ana", "viewer")

    async def broken(_work: Any) -> Any:
        raise StorageError("history.db: disk I/O error")

    for name in ("read", "read_long"):
        monkeypatch.setattr(runtime_of(staff.client).history, name, broken)
    get(staff, "/records/run", 503)
    get(staff, "/api/v1/records/run", 503)


@pytest.fixture
def live(tmp_path: Path) -> Iterator[Staff]:
    with house(Settings(plant=sequence_plant.write(tmp_path / "plant"), data=tmp_path / "data")) as client:
        client.pass_time(1.0)  # the first scans
        yield Staff(client)


def test_a_sequence_that_runs_is_in_the_list_with_who_started_it(live: Staff) -> None:
    """From a button over the device's ring into the history, and the page is told."""
    staff, runtime = live, runtime_of(live.client)

    def done_by() -> list[str]:
        runs = [one.id for one in found(staff, equipment="seq2", outcome="done")]
        asked = staff.wait(runtime.history.read, lambda connection: record_query.people(connection, runs))
        return [each.person for one in asked.values() for each in one]

    assert "sys.events.seq2" in page_tags("records/run", runtime.plant, runtime.points)
    ivo = Operator(staff, "ivo", ("operator",))
    assert until(lambda: runtime.tags.value(runtime.tags.handle("seq2.start_possible")) == 1)
    ivo.take("seq2")
    answer = ivo.press("/equipment/seq2/command/start", confirmed="1")
    assert answer.status_code in (200, 202), answer.text
    assert until(lambda: done_by() == ["ivo"])
    (one,) = found(staff, equipment="seq2")
    assert [step.key for step in _steps(staff, one)] == ["s1", "s2"]
    assert one.seconds == pytest.approx(0.4, abs=0.1)
    assert (runtime.tags.value(runtime.tags.handle("sys.events.seq2")) or 0) >= 1  # type: ignore[operator]
    assert runtime.events.last("seq2") is not None
    told = ivo.get("/events?equipment=seq2&event=power_up", fragment=False).text
    assert ids(told) and '<span class="e-w">' not in told, "words that are all 0 name no bit"
    page = ivo.get("/records/run?equipment=seq2", fragment=False).text
    assert 'data-tag="sys.events.seq2"' in page
    assert ids(page) == [one.id]


@pytest.mark.parametrize("edge", [{"since": "0001-01-01T00:00"}, {"until": "9999-12-31T23:59-12:00"}])
def test_a_time_that_no_clock_can_show_is_refused_before_an_export_begins(staff: Staff, edge: dict[str, str]) -> None:
    staff.enter("ivo", "operator")
    for path in ("list", "export.csv", "export/size"):
        get(staff, f"/records/run/{path}", 422, **edge)


@pytest.mark.sweep(8)
def test_a_time_with_an_offset_of_its_own_keeps_it(staff: Staff) -> None:
    staff.enter("ivo", "operator")

    def begins(since: str) -> bool:
        return (
            "# from: 2026-03-09T09:00:00.000+01:00"
            in get(staff, "/records/run/export.csv", locale="machine", since=since).text
        )

    assert begins("2026-03-09T12:00+04:00")
    assert begins("2026-03-09T09:00")
