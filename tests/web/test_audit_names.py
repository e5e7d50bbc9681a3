"""The audit says what its lines are about in the reader's words, with the id beside it; the file taken home keeps the ids."""

from html import unescape

import pytest
from fastapi.testclient import TestClient

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
