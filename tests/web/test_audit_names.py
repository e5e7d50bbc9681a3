"""The audit says what its lines are about in the reader's words, with the id beside it; the file taken home keeps the ids."""

from html import unescape

import pytest
from fastapi.testclient import TestClient

from app.access.audit.search import Filter
from app.access.roles import SYSTEM
from app.cli_access import terminal
from tests.web.people import Staff


@pytest.fixture(scope="module")
def staff(demo: TestClient) -> Staff:
    staff = Staff(demo)
    staff.enter("ana", "engineer", "admin")
    for name in ("m1", "m1.forward", "m1.speed", "sys.history_quota", "simulation", "gone.start"):
        staff.wait(staff.access.audit.record, "instructor.act", None, name)
    return staff


@pytest.mark.parametrize("lang", ["hr", "en", "de", "cs"])
def test_a_machine_its_parts_and_the_alarms_of_the_server_have_names(staff: Staff, lang: str) -> None:
    staff.client.cookies.set("pogon_lang", lang)
    page = unescape(staff.client.get("/audit").text)
    runtime = staff.client.app.state.runtime  # type: ignore[attr-defined]
    item, texts = runtime.plant.equipment["m1"], runtime.texts
    machine = texts.label(lang, item.label)
    forward = texts.of_type(lang, item.type, item.type.commands["forward"].label)
    speed = texts.of_type(lang, item.type, item.points["speed"].label)
    for name, id in ((machine, "m1"), (f"{machine}: {forward}", "m1.forward"), (f"{machine}: {speed}", "m1.speed")):
        assert f'<td>{name}<small class="mono">{id}</small></td>' in page, (lang, id)
    assert '<td class="mono">gone.start</td>' in page, "what is no more has no name"
    told = texts.text(lang, "instructor.speed")
    assert f'<td>{told}<small class="mono">simulation</small></td>' in page
    assert "sys.history_quota</small>" in page and "{percent}" not in page


def test_the_file_keeps_the_ids(staff: Staff) -> None:
    lines = staff.client.get("/audit.csv").text
    assert all(f",{id}," in lines for id in ("m1.forward", "sys.history_quota", "gone.start"))


@pytest.mark.parametrize("lang", ["hr", "en", "de", "cs"])
def test_the_server_and_its_terminal_are_words_and_are_found_by_what_is_stored(staff: Staff, lang: str) -> None:
    staff.wait(staff.access.audit.record, "server.started", SYSTEM)
    staff.wait(staff.access.audit.record, "person.disabled", terminal(), "ivo")
    staff.client.cookies.set("pogon_lang", lang)
    text = staff.client.app.state.runtime.texts.text  # type: ignore[attr-defined]
    by, stored = terminal().name, staff.client.get("/audit.csv").text
    for name, told in (("system", text(lang, "audit.by.system")), (by, text(lang, "audit.by.terminal", user=by[9:]))):
        for typed in (name, told, told.upper() if name == "system" else told):
            page = unescape(staff.client.get("/audit", params={"person": typed}).text)
            assert f'<td title="{name}">{told}</td>' in page
            assert f"<td>{name}</td>" not in page and "<td>ana</td>" not in page
        assert f",{name}," in stored, "the file keeps what is stored"
    assert "<td>ana</td>" in staff.client.get("/audit").text


@pytest.mark.parametrize("lang", ["hr", "en", "de", "cs"])
def test_a_lesson_is_told_by_its_title(staff: Staff, lang: str) -> None:
    runtime = staff.client.app.state.runtime  # type: ignore[attr-defined]
    for name in (*runtime.classroom.lessons, "gone"):
        staff.wait(staff.access.audit.record, "lesson.begun", None, "m1", new=name)
    staff.client.cookies.set("pogon_lang", lang)
    page = unescape(staff.client.get("/audit", params={"kind": "lesson"}).text)
    assert len(runtime.classroom.lessons) >= 3
    for name, lesson in runtime.classroom.lessons.items():
        assert f">{runtime.texts.label(lang, lesson.title)}<" in page, (lang, name)
        assert f"<td>{name}</td>" not in page
    assert ">gone<" in page, "what is no more has no title"


REFUSED = {
    "/equipment/m1/stop": ("m1", "stop", ""),
    "/equipment/m1/command/forward": ("m1", "forward", ""),
    "/equipment/m2/command/forward": ("m2", "forward", ""),
    "/equipment/m1/command/reverse": ("m1", "reverse", ""),
    "/equipment/m1/setpoint/f114": ("m1", "f114", ""),
    "/equipment/m1/token/take": ("m1", "", "take"),
    "/equipment/m1/token/release": ("m1", "", "release"),
    "/equipment/m1/hold/jog_forward": ("m1", "jog_forward", ""),
    "/equipment/m1/command/nonsense": ("m1", "", ""),
}


def test_of_what_is_refused_at_the_door_the_line_says_what_and_why(staff: Staff) -> None:
    """A Stop, a setpoint and the control of one machine were one and the same line."""
    csrf = staff.enter("vera", "viewer")
    for path in REFUSED:
        for _ in range(2):
            assert staff.client.post(path, data={"csrf": csrf}).status_code == 403, path
    staff.enter("ana", "engineer", "admin")
    runtime = staff.client.app.state.runtime  # type: ignore[attr-defined]
    texts = runtime.texts
    for lang in ("hr", "en", "de", "cs"):
        staff.client.cookies.set("pogon_lang", lang)
        page = unescape(staff.client.get("/audit", params={"person": "vera"}).text)
        told = []
        for machine, key, control in REFUSED.values():
            item = runtime.plant.equipment[machine]
            kind = item.type
            label = kind.commands[key].label if key in kind.commands else item.points[key].label if key else ""
            what = (
                texts.of_type(lang, kind, label)
                if label
                else texts.text(lang, f"control.{control}" if control else "frame.commands")
            )
            told.append(f"<td>{texts.label(lang, item.label)}: {what}</td>")
        assert len(set(told)) == len(REFUSED)
        assert [page.count(one) for one in told] == [1] * len(REFUSED), lang
        needed = " / ".join(texts.text(lang, f"access.role.{role}") for role in ("operator", "engineer"))
        assert page.count(f"<small>{texts.text(lang, 'audit.needs', roles=needed)}</small>") >= len(REFUSED), lang


def test_who_asks_for_everything_fills_no_audit(staff: Staff) -> None:
    csrf = staff.enter("vid", "viewer")
    runtime = staff.client.app.state.runtime  # type: ignore[attr-defined]
    asked = [
        f"/equipment/{item.id}/command/{key}" for item in runtime.plant.equipment.values() for key in item.type.commands
    ]
    assert len(asked) > 60
    for path in asked:
        staff.client.post(path, data={"csrf": csrf})
    staff.enter("ana", "engineer", "admin")
    lines = staff.wait(staff.access.audit.find, Filter(person="vid", kind="access.denied"), 1000)
    assert len(lines) == 31 and "command" not in lines[0].parameters
