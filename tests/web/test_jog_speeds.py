"""The jog speeds beside the jog buttons: read from the drive, and put into the list that is reviewed before it is written."""

import shutil
from collections.abc import Iterator
from html import unescape

import pytest

from app import bundled
from app.settings import Settings
from app.sim.sinamics.mailbox import MailboxFault
from app.sim.sinamics.training import REG_MAILBOX
from tests.virtual import house, pass_time
from tests.web.people import Staff

PATH = "/equipment/a1/jog-speeds"


@pytest.fixture(scope="module")
def people(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Staff]:
    folder = tmp_path_factory.mktemp("axis")
    shutil.copytree(bundled("plants/epos"), folder / "plant")
    with house(Settings(plant=folder / "plant", data=folder / "data")) as browser:
        staff = Staff(browser)
        staff.olga = staff.enter("olga", "operator")  # type: ignore[attr-defined]
        staff.ivana = staff.enter("ivana", "engineer", "operator")  # type: ignore[attr-defined]
        pass_time(3)
        yield staff


def drawn(people: Staff, path: str = PATH) -> str:
    people.client.cookies.set("pogon_lang", "en")
    answer = people.client.get(path)
    assert answer.status_code == 200, answer.text[:200]
    return unescape(answer.text).replace("\u202f", " ").replace("\u00a0", " ").replace("\u2212", "-")


@pytest.mark.sweep(8)
def test_they_are_read_with_their_range_and_typed_ones_go_into_the_reviewed_list(people: Staff) -> None:
    people.have(people.ivana)  # type: ignore[attr-defined]
    text = drawn(people)
    assert ">-300</b>" in text and ">300</b>" in text and "1000 LU/min" in text and "40 000 000" in text
    answer = people.post(PATH, {"p2585": "-450", "p2586": ""})
    assert answer.status_code in (200, 303)
    listed = drawn(people, "/equipment/a1/drive-parameters")
    assert 'value="2:p2585"' in listed and 'value="-450"' in listed and 'name="key" value="2:p2586"' not in listed
    people.post("/equipment/a1/drive-parameters/review", {"key": "2:p2585", "value": "-450"})
    pass_time(2)
    reviewed = drawn(people, "/equipment/a1/drive-parameters/list")
    assert "-300" in reviewed and "-450" in reviewed
    people.post("/equipment/a1/drive-parameters/list", {"clear": "1"})


@pytest.mark.sweep(8)
def test_a_drive_that_tells_nothing_is_told_and_asked_again(people: Staff) -> None:
    people.have(people.ivana)  # type: ignore[attr-defined]
    drive = people.client.app.state.runtime.sim.devices["a1"]  # type: ignore[attr-defined]
    drive.write(6, REG_MAILBOX, [MailboxFault.UNREACHED])
    pass_time(1)
    drawn(people)
    pass_time(6)
    people.client.app.state.__dict__.pop("drive_parameters", None)  # type: ignore[attr-defined]
    drawn(people)
    pass_time(6)
    text = drawn(people)
    assert "not read" in text.lower() and "does not reach the drive" in text
    drive.write(6, REG_MAILBOX, [0])
    pass_time(1)
    drawn(people)
    pass_time(3)
    assert ">-300</b>" in drawn(people)


def test_only_engineers_have_them_and_only_drives_with_a_positioner(people: Staff) -> None:
    people.have(people.olga)  # type: ignore[attr-defined]
    assert people.client.get(PATH).status_code == 403
    assert people.post(PATH, {"p2585": "1"}).status_code == 403
    assert 'id="jog-speeds"' not in drawn(people, "/equipment/a1")
    people.have(people.ivana)  # type: ignore[attr-defined]
    assert 'id="jog-speeds"' in drawn(people, "/equipment/a1")
    assert people.client.get("/equipment/zz/jog-speeds").status_code == 404
    assert people.post(PATH, {"p2585": " ", "p2586": ""}).status_code == 422


def test_nothing_typed_is_told_on_a_page_that_leads_back_to_the_machine(people: Staff) -> None:
    people.have(people.ivana)  # type: ignore[attr-defined]
    people.client.cookies.set("pogon_lang", "en")
    answer = people.post(PATH, {"p2585": " ", "p2586": ""})
    assert answer.status_code == 422
    assert "Required field: Jog speeds" in answer.text
    assert 'class="btn tap" href="/equipment/a1"' in answer.text
