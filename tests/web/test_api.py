"""The interface for other programs: the same gate, the same roles, JSON."""

import html
import re
import shlex
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from itertools import count
from pathlib import Path
from typing import Any

import orjson
import pytest
from sqlalchemy import Connection

from app.clock import to_datetime, to_micros
from app.historian import store
from app.plant.plant_files.languages import LOCALE
from app.plant.texts import read_product
from app.runtime import Runtime
from app.settings import Settings
from app.sim import training
from app.tags.quality import GOOD
from app.web.api.description import ERRORS, described
from app.web.api_page import _body, _parameters
from app.web.guard import permissions
from tests.virtual import house, until
from tests.web.people import AGENT, Staff

NUMBERS = count()


class Program:
    """A program with an API token."""

    def __init__(self, staff: Staff, *permissions: str) -> None:
        self.client = staff.client
        sid = staff.enter("maker", "operator", "engineer")
        maker = staff.wait(staff.access.sessions.find, sid, "127.0.0.1", AGENT)
        _, secret = staff.wait(staff.access.tokens.create, maker, f"{next(NUMBERS)} {permissions}", permissions, 1.0)
        self.headers = {"Authorization": f"Bearer {secret}"}

    def get(self, path: str, **params: Any) -> Any:
        self.client.cookies.clear()
        return self.client.get("/api/v1" + path, params=params or None, headers=self.headers)

    def post(self, path: str, body: Any = None) -> Any:
        self.client.cookies.clear()
        return self.client.post("/api/v1" + path, json=body if body is not None else {}, headers=self.headers)

    def order(self, path: str, id: str, **body: Any) -> Any:
        nonce = self.post("/nonce").json()["nonce"]
        return self.post(path, {"id": id, "nonce": nonce, **body})


def now_of(staff: Staff) -> datetime:
    return to_datetime(staff.client.app.state.runtime.clock.micros())  # type: ignore[attr-defined]


@pytest.fixture(scope="module")
def staff(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Staff]:
    settings = Settings(data=Path(tmp_path_factory.mktemp("api")) / "data")
    with house(settings, follow_redirects=True) as client:
        found = Staff(client)
        reader = Program(found, "view")
        assert until(lambda: reader.get("/tags/m2.status").json().get("quality") == "good")
        yield found


def test_tags_come_with_value_quality_unit_and_age(staff: Staff) -> None:
    program = Program(staff, "view")
    tag = program.get("/tags/m1.speed").json()
    assert tag["value"] > 1000
    assert (tag["quality"], tag["origin"], tag["unit"]) == ("good", ["simulated"], "rpm")
    assert tag["age"] < 2
    assert datetime.fromisoformat(tag["time"]).tzinfo is not None
    status = program.get("/tags/m1.status").json()
    assert status["text"]


def test_tags_are_paged_by_name(staff: Staff) -> None:
    program = Program(staff, "view")
    first = program.get("/tags", prefix="m1.", limit=10).json()
    second = program.get("/tags", prefix="m1.", limit=10, after=first[-1]["name"]).json()
    names = [tag["name"] for tag in first + second]
    assert names == sorted(set(names))
    assert len(names) == 20


@pytest.mark.parametrize(
    ("path", "status"),
    [("/tags/m1.nothing", 404), ("/equipment/m9", 404), ("/tags?limit=100000", 422), ("/history?tags=m1.speed", 422)],
)
def test_what_is_not_there_or_not_sound_is_said_in_json(staff: Staff, path: str, status: int) -> None:
    answer = Program(staff, "view").get(path)
    assert answer.status_code == status
    assert answer.json()["error"]


RANGE = "from=2026-03-09T06:00:00Z&to=2026-03-09T07:00:00Z"


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("path", "status", "field", "value", "expected"),
    [
        ("/tags?limit=0", 422, "query.limit", "0", "greater than or equal to 1"),
        ("/tags?limti=5", 422, "query.limti", "5", "one of after, limit, names, prefix"),
        ("/tags?limit=5&limit=6", 422, "query.limit", "5, 6", "once"),
        ("/tags?names=m1.speed,m1.nothing", 404, "query.names", "m1.nothing", "a tag of the plant"),
        ("/tags/m1.nothing", 404, "path.name", "m1.nothing", "a tag of the plant"),
        ("/equipment/m9", 404, "path.key", "m9", "a machine of the plant"),
        ("/equipment/m1?x=1", 422, "query.x", "1", "no parameter"),
        ("/equipment/m1/commands/fly/reasons", 404, "path.command", "fly", "one of "),
        (f"/history?tags=,&{RANGE}", 422, "query.tags", ",", "1 to 8 tags"),
        (f"/history?tags=m1.nothing&{RANGE}", 404, "query.tags", "m1.nothing", "a tag of the plant"),
        (f"/history?tags=m1.speed&wdith=9&{RANGE}", 422, "query.wdith", "9", "one of from, tags, to, width"),
        (f"/history?tags=m1.speed&from=-1h&{RANGE}", 422, "query.from", "-1h, 2026-03-09T06:00:00Z", "once"),
        ("/history?tags=m1.speed&from=20260309&to=now", 422, "query.from", "20260309", "ISO 8601 with its offset"),
        ("/history?tags=m1.speed&from=2026-03-09T06:00:00&to=2026", 422, "query.from", "2026-03-09T06:00:00", "offset"),
        (
            "/history/m1.speed/raw?from=2026-03-09T07:00:00Z&to=2026-03-09T06:00:00Z",
            422,
            "query.to",
            "2026-03-09T06:00:00Z",
            "after from",
        ),
        ("/events?lmit=5", 422, "query.lmit", "5", "one of before, equipment, event, from, limit, q, to"),
        ("/events?event=nix", 422, "query.event", "nix", "key or code of an event"),
        ("/events?from=2026-03-09", 422, "query.from", "2026-03-09", "ISO 8601 with its offset"),
        ("/records/nix", 404, "path.kind", "nix", "one of "),
        ("/records/passage?longer=5", 422, "query.longer", "5", "one of alarm, before, correction, "),
        ("/records/passage?correction=big", 422, "query.correction", "big", "above"),
        ("/records/passage?outcome=nix", 422, "query.outcome", "nix", "one that the kind has"),
        (
            "/records/passage?from=2026-03-09T07:00:00Z&to=2026-03-09T06:00:00Z",
            422,
            "query.to",
            "T06:00:00Z",
            "after from",
        ),
        (
            "/records/passage?from=9999-12-31T23:59:59-12:00&to=0001-01-01T00:00:00%2B14:00",
            422,
            "query.to",
            "0001-01-01",
            "after from",
        ),
    ],
)
def test_what_is_wrong_with_a_request_is_named_with_what_it_says_and_what_was_expected(
    staff: Staff, path: str, status: int, field: str, value: str, expected: str
) -> None:
    answer = Program(staff, "view", "export", "operate").get(path)
    assert answer.status_code == status, answer.text
    said = answer.json()
    assert said["error"] and said["text"]
    fault = said["fields"][0]
    assert fault["field"] == field and value in fault["value"] and expected in fault["expected"], fault


def test_a_plus_that_was_not_escaped_is_still_an_offset(staff: Staff) -> None:
    program = Program(staff, "view")
    asked = "/history?tags=m1.speed&from=2026-03-09T06:00:00+01:00&to=2026-03-09T07:00:00+01:00"
    assert program.get(asked).status_code == 200


@pytest.mark.parametrize(
    ("path", "body", "status", "field", "value"),
    [
        ("/equipment/m9/stop", {"id": "press-0001"}, 404, "path.key", "m9"),
        ("/equipment/m1/control/steal", {}, 404, "path.action", "steal"),
        ("/equipment/m1/commands/fly", {"id": "press-0001"}, 404, "path.command", "fly"),
        ("/equipment/m1/setpoints/fly", {"id": "press-0001", "value": 1}, 404, "path.setpoint", "fly"),
        ("/equipment/m1/setpoints/frequency_setpoint", {"id": "press-0001"}, 422, "body.value", "null"),
        ("/equipment/m1/setpoints", {"id": "press-0001", "values": {"fly": 1}}, 404, "body.values", "fly"),
        ("/alarms/acknowledge", {"occurrences": [1], "coment": "x"}, 422, "body.coment", "x"),
        ("/alarms/acknowledge", {"occurrences": ["x"]}, 422, "body.occurrences.0", "x"),
    ],
)
def test_what_is_wrong_with_an_order_is_named(
    staff: Staff, path: str, body: Any, status: int, field: str, value: str
) -> None:
    answer = Program(staff, "view", "operate", "stop", "acknowledge").post(path, body)
    assert answer.status_code == status, answer.text
    fault = answer.json()["fields"][0]
    assert (fault["field"], fault["value"]) == (field, value) and fault["expected"]


def test_history_outlives_the_tag_in_the_plant(staff: Staff) -> None:
    runtime: Runtime = staff.client.app.state.runtime  # type: ignore[attr-defined]
    gone = replace(runtime.points["m1.speed"], id="m0.speed", name="m0.speed")
    begin = to_micros(datetime(2026, 3, 9, 6, 0, tzinfo=UTC))

    def fill(connection: Connection) -> None:
        number = store.register(connection, [gone])["m0.speed"]
        rows = [(number, begin + i * 1_000_000, 100.0 + i, None, GOOD) for i in range(60)]
        store.append(connection, rows, begin, begin + 60_000_000)

    staff.wait(runtime.history.write, fill)
    asked = {"from": "2026-03-09T06:00:00Z", "to": "2026-03-09T06:01:00Z"}
    (series,) = Program(staff, "view").get("/history", tags="m0.speed", **asked).json()
    assert (series["tag"], series["unit"], max(series["high"])) == ("m0.speed", "rpm", 159.0)
    whole = Program(staff, "export").get("/history/m0.speed/raw", **asked).json()
    assert [one["value"] for one in whole["samples"]] == [100.0 + i for i in range(60)]


@pytest.mark.sweep(8)
def test_history_is_decimated_and_raw_pages_join_without_loss(staff: Staff) -> None:
    reader, exporter = Program(staff, "view"), Program(staff, "view", "export")
    begin = (now_of(staff) - timedelta(minutes=5)).isoformat()
    end = (now_of(staff) + timedelta(minutes=5)).isoformat()

    def stored() -> list[Any]:
        samples: list[Any] = exporter.get("/history/m1.current/raw", **{"from": begin, "to": end}).json()["samples"]
        return samples

    assert until(lambda: len(stored()) > 5)
    end = now_of(staff).isoformat()
    whole = stored()
    paged, start = [], begin
    while start:
        page = exporter.get("/history/m1.current/raw", **{"from": start, "to": end, "limit": 2}).json()
        paged += page["samples"]
        start = page["next"]
    assert paged == whole
    series = reader.get("/history", tags="m1.current,m1.speed", **{"from": begin, "to": end}, width=50).json()
    assert [one["tag"] for one in series] == ["m1.current", "m1.speed"]
    assert max(h for h in series[0]["high"] if h is not None) == max(
        s["value"] for s in whole if s["value"] is not None
    )
    assert reader.get("/history/m1.current/raw", **{"from": begin, "to": end}).status_code == 403


def test_who_is_refused_reads_what_is_missing_with_its_numbers_as_he_writes_them(staff: Staff) -> None:
    program = Program(staff, "view", "operate")
    hall: Any = staff.client.app.state.runtime.links["hall"]  # type: ignore[attr-defined]
    program.headers["Accept-Language"] = "de"
    program.post("/equipment/m2/control/take")
    staff.wait(hall.raw_write, 2, training.REG_MACHINE_FAULT, [9])
    assert until(lambda: program.get("/tags/m2.heatsink_temperature").json()["value"] > 84, 90)
    program.post("/equipment/m2/control/take")
    wanted = re.compile(r"Ursache steht noch an: Kühlkörper \d\d(,\d)? °C, Quittieren unter 80 °C")
    refused = program.order("/equipment/m2/commands/reset", "api-reset-1")
    assert refused.status_code == 409 and wanted.fullmatch(refused.json()["text"]), refused.json()
    (reason,) = program.get("/equipment/m2/commands/reset/reasons").json()
    assert wanted.fullmatch(reason["text"]), reason
    staff.wait(hall.raw_write, 2, training.REG_RESET, [1])
    assert until(lambda: program.get("/tags/m2.status").json()["value"] == 0, 30)
    program.post("/equipment/m2/control/release")


@pytest.mark.sweep(8)
def test_a_program_takes_control_sets_starts_and_reads_confirmed(staff: Staff) -> None:
    program = Program(staff, "view", "operate", "stop")
    refused = program.order("/equipment/m2/commands/forward", "api-forward-0")
    assert refused.status_code == 423
    assert program.post("/equipment/m2/control/take").status_code == 204
    assert program.get("/equipment/m2/commands/forward/reasons").json() == []
    path = "/equipment/m2/setpoints/frequency_setpoint"
    asked = program.order(path, "api-set-1", value=30.0)
    assert (asked.status_code, asked.json()["error"]) == (409, "why.confirm")
    assert program.order(path, "api-set-1", value=30.0, confirmed=True).status_code == 202
    started = program.order("/equipment/m2/commands/forward", "api-forward-1")
    assert started.status_code == 202
    assert started.json()["state"] in ("accepted", "confirmed")

    def state(id: str) -> str:
        return next((c["state"] for c in program.get("/equipment/m2/commands").json() if c["id"] == id), "")

    assert until(lambda: state("api-forward-1") == "confirmed")
    assert until(lambda: program.get("/tags/m2.speed").json()["value"] > 300)
    again = program.order("/equipment/m2/commands/forward", "api-forward-1")
    assert again.json()["requested"] == started.json()["requested"]
    assert program.post("/equipment/m2/stop", {"id": "api-stop-1"}).status_code == 200
    assert until(lambda: program.get("/tags/m2.status").json()["value"] == 0, 30)
    program.post("/equipment/m2/control/release")


def test_a_token_that_may_only_look_commands_nothing(staff: Staff) -> None:
    program = Program(staff, "view")
    for path in ("/nonce", "/equipment/m1/commands/forward", "/equipment/m1/stop", "/equipment/m1/control/take"):
        assert program.post(path, {"id": "no-right-1"}).status_code == 403
    assert program.get("/tags/m1.status").json()["value"] == 1


def test_an_unknown_field_is_refused_and_names_itself(staff: Staff) -> None:
    answer = Program(staff, "view", "operate").post(
        "/equipment/m1/commands/forward", {"id": "12345678", "role": "admin"}
    )
    assert answer.status_code == 422
    assert "role" in str(answer.json())


@pytest.mark.sweep(8)
def test_the_description_is_for_engineers_and_loads_nothing_from_elsewhere(staff: Staff) -> None:
    staff.have()
    assert staff.client.get("/docs", follow_redirects=False).status_code == 303
    staff.enter("olga", "operator")
    assert staff.client.get("/docs").status_code == 403
    staff.enter("ivan", "engineer")
    page = staff.client.get("/docs")
    assert page.status_code == 200
    assert not re.findall(r'(?:src|href)="(?!/|#)[^"]*"', page.text)
    assert "swagger" not in page.text and "unsafe-inline" not in page.headers["content-security-policy"]
    schema = staff.client.get("/api/v1/openapi.json").json()
    assert "/api/v1/equipment/{key}/commands/{command}" in schema["paths"]


@pytest.mark.parametrize("language", ["hr", "en", "de", "cs"])
def test_the_page_names_every_operation_with_its_permission_in_every_language(staff: Staff, language: str) -> None:
    staff.enter("ivan", "engineer")
    staff.client.cookies.set("pogon_lang", language)
    page = html.unescape(staff.client.get("/docs").text)
    schema = staff.client.get("/api/v1/openapi.json").json()
    asked = permissions(staff.client.app)  # type: ignore[arg-type]
    blocks = {
        (one[1], one[2]): one[0]
        for one in re.finditer(
            r'<details class="api-op".*?<b class="api-m"[^>]*>(\w+)</b><code>([^<]*)</code>.*?</details>',
            page,
            re.DOTALL,
        )
    }
    assert set(blocks) == {(how.upper(), path) for path, methods in schema["paths"].items() for how in methods}
    for (method, path), block in blocks.items():
        assert f"<code>{asked[f'{method} {path}']}</code>" in block, path
    assert not re.findall(r">\s*\[[a-z_.]+\]", page)
    assert ("The plant and its machines." in page) == (language == "en")
    staff.client.cookies.delete("pogon_lang")


def test_what_the_interface_tells_is_said_in_every_language() -> None:
    """Every sentence of the description has its text, and no text is of a sentence that is told no more."""
    schema = orjson.loads(described())
    operations = [told for methods in schema["paths"].values() for told in methods.values()]
    fields = [one for told in operations for one in (*_parameters(told), *_body(schema, told))]
    sentences = {" ".join(part.split()) for told in operations for part in told["description"].split("\n\n")}
    sentences |= {one.what for one in fields} | set(ERRORS.values())
    sentences.discard("")
    texts = read_product(LOCALE)
    keys = {key: text for key, text in texts["en"].items() if key.startswith("api.told.")}
    assert set(keys.values()) == sentences
    for language in ("hr", "de", "cs"):
        assert not [key for key, text in keys.items() if texts[language][key] == text], language


def test_every_example_that_only_reads_is_answered(staff: Staff) -> None:
    staff.enter("ivan", "engineer")
    page = html.unescape(staff.client.get("/docs").text)
    examples = re.findall(r'<pre class="api-curl" tabindex="0">(.*?)</pre>', page, re.DOTALL)
    reads = [shlex.split(one.replace("\\\n", " "))[-1] for one in examples if "-X" not in one]
    assert len(reads) > 8
    for address in reads:
        answer = staff.client.get(address)
        assert answer.status_code == 200, (address, answer.text)
