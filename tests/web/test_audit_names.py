"""The audit says what its lines are about in the reader's words, with the id beside it; the file taken home keeps the ids."""

from html import unescape

import pytest
from fastapi.testclient import TestClient

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


@pytest.mark.sweep(8)
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
