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
    """What the page sends: each value with what it was seen at when it was reviewed."""
    fields = {f"said.{key}": text for key, text in changes.items()} | {
        f"seen.{key}": number for key, number in (seen or {}).items()
    }
    return send(who, f"{equipment}/parameters", changes, {"nonce": who.nonce(), **fields, **more})


def review(who: Operator, equipment: str, changes: dict[str, str], **more: str) -> list[tuple[str, str]]:
    """What the page says of each value: (rv-ok or rv-bad, its words)."""
    answer = send(who, f"{equipment}/parameters/review", changes, more)
    assert answer.status_code == 200, answer.text
    return [
        (look, words(text))
        for look, text in re.findall(r'<li class="rv (\S+)" data-change.*?>(.*?)</li>', answer.text, re.S)
    ]


def send(who: Operator, address: str, changes: dict[str, str], more: dict[str, str]) -> Answer:
    who.sit()
    body = {
        "csrf": who.staff.access.form_token(who.sid),
        **{f"new.{key}": text for key, text in changes.items()},
        **more,
    }
    headers = {
        "Origin": "http://127.0.0.1:8000",
        "HX-Request": "true",
        "Content-Type": "application/x-www-form-urlencoded",
    }
    return who.staff.client.post(f"/equipment/{address}", content=urlencode(body), headers=headers)


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


def test_a_review_says_what_was_what_is_new_and_what_is_wrong(staff: Staff, ivo: Operator) -> None:
    held_now = held(staff, "m2.f116")[0]
    lines = review(ivo, "m2", {"f116": f"{1.5 * held_now:g}", "f117": "0.01", "f118": "1,5x", "f904": "4", "f115": " "})
    assert [look for look, _ in lines] == ["rv-ok", "rv-bad", "rv-bad", "rv-ok"]
    assert f"{held_now:.1f}" in lines[0][1] and "+50" in lines[0][1]
    assert "Permitted: 0.1 … 3 000 s" in lines[1][1]
    assert "1,5x" in lines[2][1]
    assert "Writing this cuts the line to the drive" in lines[3][1]
    assert review(ivo, "m2", {"f116": ""}) == []
    ivo.language = "de"
    try:
        assert review(ivo, "m2", {"f116": "7.5"})[0][0] == "rv-ok"
        assert "1.250" in review(ivo, "m2", {"f116": "1.250"})[0][1]  # one thousand and more, or one and a quarter
    finally:
        ivo.language = "en"


def test_what_the_device_held_when_the_edit_began_is_kept_from_review_to_review(staff: Staff, ivo: Operator) -> None:
    answer = send(ivo, "m2/parameters/review", {"f116": "7.5", "f117": "8"}, {"seen.f116": "4.5"})
    assert 'name="seen.f116" value="4.5"' in answer.text
    assert f'name="seen.f117" value="{held(staff, "m2.f117")[0]!r}"' in answer.text


def test_nothing_is_written_that_was_not_reviewed_as_it_is_typed(staff: Staff, ivo: Operator) -> None:
    ivo.take("m2")
    before = held(staff, "m2.f116", "m2.f117")
    answer = send(
        ivo, "m2/parameters", {"f116": "75", "f117": "8"}, {"nonce": ivo.nonce(), "said.f116": "7", "said.f117": "8"}
    )
    assert line_of(answer) == "Changed since the review: look at the list and write again"
    assert 'name="said.f116" value="75"' in answer.text
    assert held(staff, "m2.f116", "m2.f117") == before


@pytest.mark.parametrize("more", [{"new.nothing": "1"}, {"seen.f116": "5", "new.f116.x": "6"}, {"new.state": "1"}])
def test_a_review_of_what_is_no_parameter_is_refused_by_name(ivo: Operator, more: dict[str, str]) -> None:
    answer = send(ivo, "m2/parameters/review", {}, more)
    assert answer.status_code == 422 and "new." in words(answer.text)


def test_an_operator_reviews_nothing(staff: Staff) -> None:
    ana = Operator(staff, "ana", ("operator",))
    assert send(ana, "m2/parameters/review", {"f116": "7.5"}, {}).status_code == 403


def test_one_value_out_of_range_keeps_all_from_being_written(staff: Staff, ivo: Operator) -> None:
    ivo.take("m2")
    before = held(staff, "m2.f116", "m2.f117")
    answer = write(ivo, "m2", {"f116": "7.5", "f117": "0.01"})
    assert rows(answer) == {"F117": "no"}
    assert "Permitted: 0.1 to 3 000 s" in words(answer.text)
    assert held(staff, "m2.f116", "m2.f117") == before


def test_limits_that_move_together_are_one_set(staff: Staff, ivo: Operator) -> None:
    ivo.take("m2")
    assert review(ivo, "m2", {"frequency_setpoint": "60"})[0][0] == "rv-bad"
    assert [look for look, _ in review(ivo, "m2", {"frequency_setpoint": "60", "f111": "65"})] == ["rv-ok", "rv-ok"]
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


@pytest.mark.sweep(8)
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


def test_limits_that_come_from_another_new_value_are_for_the_gate(staff: Staff, ivo: Operator) -> None:
    high = held(staff, "c1.longest")[0]
    assert review(ivo, "c1", {"shortest": f"{high + 1:g}"})[0][0] == "rv-bad"
    assert review(ivo, "c1", {"shortest": f"{high + 1:g}", "longest": f"{high + 2:g}"})[0][0] == "rv-ok"
    assert review(ivo, "c1", {"jerk": "999999", "longest": f"{high + 2:g}"})[0][0] == "rv-bad"


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


def test_reading_again_leads_nowhere_else(ivo: Operator) -> None:
    """Who has no scripts is sent on by an address."""
    page = "/equipment/m2/parameters"
    for next, leads in (
        ("https://evil.test/", "/"),
        ("//evil.test", "/"),
        ("/equipment/m2?a=1", "/equipment/m2?a=1"),
        ("", page),
    ):
        answer = ivo.post(f"{page}/read", fragment=False, next=next)
        assert (answer.status_code, answer.headers["location"]) == (303, leads)
