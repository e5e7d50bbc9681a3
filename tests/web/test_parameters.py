"""The parameter page writes a set: all values or none, in the words of the reader, with what the device holds of each."""

import re
from collections.abc import Iterator
from urllib.parse import urlencode

import pytest
from fastapi.testclient import TestClient

from app.access.audit.search import Filter
from tests.web.operating import Answer, Operator, line_of, runtime_of, until, words
from tests.web.people import Staff
from tests.web.test_api import Program

LANGUAGES = ("hr", "en", "de", "cs")


@pytest.fixture(scope="module")
def staff(demo: TestClient) -> Staff:
    crew = Staff(demo)
    tags = runtime_of(demo).tags
    assert until(lambda: tags.sample("m2.f905").seen and tags.sample("c1.jerk").seen)
    return crew


@pytest.fixture(scope="module")
def ivo(staff: Staff) -> Operator:
    return Operator(staff, "ivo", ("engineer", "operator"))


@pytest.fixture(autouse=True)
def calm(staff: Staff) -> Iterator[None]:
    gate = runtime_of(staff.client).gate
    assert gate is not None
    gate._admission.rate.take = lambda _person: True  # type: ignore[method-assign]
    yield


def write(
    who: Operator, equipment: str, changes: dict[str, str], seen: dict[str, str] | None = None, **more: str
) -> Answer:
    """What the page sends: each value with what it was seen at."""
    nonce = who.nonce()
    body = [("csrf", who.staff.access.form_token(who.sid)), ("nonce", nonce), *more.items()]
    for key, text in changes.items():
        body += [("key", key), ("value", text), ("expected", (seen or {}).get(key, ""))]
    who.sit()
    headers = {
        "Origin": "http://127.0.0.1:8000",
        "HX-Request": "true",
        "Content-Type": "application/x-www-form-urlencoded",
    }
    return who.staff.client.post(f"/equipment/{equipment}/parameters", content=urlencode(body), headers=headers)


def rows(answer: Answer) -> dict[str, str]:
    return dict(re.findall(r'data-row="(\w+)" data-done="(\w+)"', answer.text))


def held(staff: Staff, *names: str) -> list[float]:
    return [float(str(runtime_of(staff.client).tags.sample(name).value)) for name in names]


def audit_lines(staff: Staff, name: str, kind: str) -> list[str]:
    lines = staff.wait(runtime_of(staff.client).access.audit.find, Filter(object=name, kind=kind))
    return [line.new for line in lines if line.kind == kind]


def test_reviewed_changes_are_written_as_one_with_what_was_read_back(staff: Staff, ivo: Operator) -> None:
    ivo.take("m2")
    answer = write(ivo, "m2", {"f114": "7.5", "f115": "8", "f209": "1"}, {"f114": "5"}, reason="softer start")
    assert answer.status_code == 200, answer.text
    assert rows(answer) == {"F114": "yes", "F115": "yes", "F209": "yes"}, words(answer.text)
    assert line_of(answer) == "Written and read back: 3"
    assert "7.5 s" in words(answer.text)
    assert held(staff, "m2.f114", "m2.f115", "m2.f209") == [7.5, 8.0, 1.0]
    for kind in ("command.sent", "command"):
        assert until(
            lambda kind=kind: audit_lines(staff, "m2.setpoints", kind)[:1] == ["F114 = 7.5, F115 = 8, F209 = 1"]
        )


def test_one_value_out_of_range_keeps_all_from_being_written(staff: Staff, ivo: Operator) -> None:
    ivo.take("m2")
    before = held(staff, "m2.f116", "m2.f117")
    answer = write(ivo, "m2", {"f116": "7.5", "f117": "0.01"})
    assert rows(answer) == {"F117": "no"}
    assert "Permitted: 0.1 to 3 000 s" in words(answer.text)
    assert held(staff, "m2.f116", "m2.f117") == before


def test_limits_that_move_together_are_one_set(staff: Staff, ivo: Operator) -> None:
    ivo.take("m2")
    page = ivo.get("/equipment/m2/parameters", fragment=False).text
    assert 'data-key="frequency_setpoint"' in page and 'data-depends="f111 f112"' in page
    answer = write(ivo, "m2", {"frequency_setpoint": "60", "f111": "65"})
    assert rows(answer) == {"F113": "yes", "F111": "yes"}, words(answer.text)
    answer = write(ivo, "m2", {"frequency_setpoint": "40", "f111": "50"})
    assert rows(answer) == {"F113": "yes", "F111": "yes"}, words(answer.text)


def test_a_machine_with_a_staging_area_takes_the_set_in_one_commit(staff: Staff, ivo: Operator) -> None:
    ivo.take("c1")
    device = runtime_of(staff.client).sim
    assert device is not None
    commits = device.devices["c1"]._settings.generation  # type: ignore[attr-defined]
    answer = write(ivo, "c1", {"jerk": "250", "acceleration": "70", "longest": "160", "shortest": "12"})
    assert set(rows(answer).values()) == {"yes"}, words(answer.text)
    assert held(staff, "c1.jerk", "c1.acceleration", "c1.longest", "c1.shortest") == [250, 70, 160, 12]
    assert device.devices["c1"]._settings.generation == commits + 2  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("language", "said"),
    [
        ("hr", "Vrijednosti nisu međusobno usklađene: ubrzanje najviše 5 s × trzaj"),
        ("en", "Values do not go together: acceleration at most 5 s × jerk"),
        ("de", "Werte passen nicht zusammen: Beschleunigung höchstens 5 s × Ruck"),
        ("cs", "Hodnoty k sobě nepasují: zrychlení nejvýše 5 s × ryv"),
    ],
)
def test_values_that_do_not_go_together_are_named(ivo: Operator, staff: Staff, language: str, said: str) -> None:
    ivo.take("c1")
    before = held(staff, "c1.jerk", "c1.acceleration")
    ivo.language = language
    try:
        assert line_of(write(ivo, "c1", {"jerk": "10", "acceleration": "400"})) == said
        assert line_of(ivo.press("/equipment/c1/setpoint/jerk", argument="10", confirmed="1")) == said
    finally:
        ivo.language = "en"
    assert held(staff, "c1.jerk", "c1.acceleration") == before


TOLD = {
    "hr": "F117 1,0 s (prijašnja)",
    "en": "F117 1.0 s (former)",
    "de": "F117 1,0 s (früher)",
    "cs": "F117 1,0 s (původní)",
}


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_mixed_state_is_told_in_the_readers_language(staff: Staff, ivo: Operator, language: str) -> None:
    """The drive takes F116 and refuses F117, and does not take F116 back."""
    ivo.take("m2")
    assert set(rows(write(ivo, "m2", {"f116": "1", "f117": "1"})).values()) == {"yes"}
    device = runtime_of(staff.client).sim
    assert device is not None
    bus = device.buses["hall"]
    answer_of = bus.answer

    def refuse(unit: int, pdu: bytes) -> object:
        wrong = {b"\x01\x11\x00\x14", b"\x01\x10\x00\x0a"}  # F117 := 2.0, F116 := 1.0
        return answer_of(unit, b"\x06\xff\xff\x00\x00" if pdu[0] == 6 and pdu[1:5] in wrong and unit == 2 else pdu)

    bus.answer = refuse  # type: ignore[method-assign, assignment]
    ivo.language = language
    try:
        answer = write(ivo, "m2", {"f116": "2", "f117": "2"})
        assert rows(answer) == {"F116": "yes", "F117": "no"}, words(answer.text)
        assert TOLD[language] in line_of(answer), line_of(answer)
        alarms = words(ivo.get("/alarms", fragment=False).text)
        word = TOLD[language].partition("(")[2]
        assert f"F117 = 1.0 s ({word}" in alarms
        audit = words(ivo.get("/audit?object=m2.setpoints", fragment=False).text)
        assert f"f117 = 1 ({word}" in audit
    finally:
        ivo.language = "en"
        del bus.answer
        ivo.take("m2")
        write(ivo, "m2", {"f116": "1", "f117": "1"})


def test_limits_of_a_parameter_name_what_they_come_from(staff: Staff, ivo: Operator) -> None:
    page = ivo.get("/equipment/c1/parameters", fragment=False).text
    assert re.search(r'data-key="shortest"[^>]*data-depends="longest"', page)
    assert re.search(r'data-key="jerk"[^>]*data-depends=""', page)


@pytest.mark.parametrize(
    ("fields", "status"),
    [
        ({"values": {"f114": 6.0}}, 403),
        ({"values": {}}, 422),
        ({"values": {"nothing": 1.0}}, 404),
        ({"values": {"frequency_setpoint": 30.0}, "extra": 1}, 422),
        ({"values": {"frequency_setpoint": "x"}}, 422),
        ({"values": {"frequency_setpoint": 30.0}, "expected": {"frequency_setpoint": 12.0}}, 409),
    ],
)
def test_a_set_over_the_api_that_cannot_be_written_says_why(
    staff: Staff, fields: dict[str, object], status: int
) -> None:
    program = Program(staff, "view", "operate", "stop")
    assert program.post("/equipment/m1/control/take").status_code == 204
    identity = f"api-set-none-{status}-{len(str(fields))}"  # one of its own: another session's would be a replay
    answer = program.order("/equipment/m1/setpoints", identity, confirmed=True, **fields)
    assert answer.status_code == status, answer.text
    program.post("/equipment/m1/control/release")


def test_a_set_over_the_api_is_answered_when_it_is_over(staff: Staff) -> None:
    program = Program(staff, "view", "operate", "stop")
    assert program.post("/equipment/c1/control/take").status_code in (204, 409, 423)
    staff.wait(_free, staff, "c1")
    assert program.post("/equipment/c1/control/take").status_code == 204
    wanted = {"automatic_speed": 35.0, "manual_speed": 12.0}
    answer = program.order("/equipment/c1/setpoints", "api-set-all", values=wanted, confirmed=True)
    assert answer.status_code == 200, answer.text
    told = answer.json()
    assert (told["state"], told["arguments"]) == ("confirmed", wanted)
    assert [(one["setpoint"], one["found"], one["stands"]) for one in told["changes"]] == [
        (key, number, "new") for key, number in wanted.items()
    ]
    assert held(staff, "c1.automatic_speed", "c1.manual_speed") == [35.0, 12.0]
    program.post("/equipment/c1/control/release")


async def _free(staff: Staff, equipment: str) -> None:
    gate = runtime_of(staff.client).gate
    assert gate is not None
    holder = gate.control.holder(equipment)
    if holder is not None:
        gate.control.session_ended(holder.session)
