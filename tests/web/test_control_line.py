"""A class that wants one machine: everybody stands in line, reads the place, and has it in turn."""

import re
from collections.abc import Iterator

import pytest
from fastapi.testclient import TestClient

from app.access.audit.search import Filter
from app.commands.control_line import ANSWER, REST
from tests.virtual import pass_time
from tests.web.operating import Operator, line_of, runtime_of, until, words
from tests.web.people import Staff
from tests.web.test_alarms import LANGUAGES
from tests.web.test_api import Program

M1, TOKEN = "/equipment/m1/commands", "/equipment/m1/token"
CLASS = 30


@pytest.fixture(scope="module")
def staff(demo: TestClient) -> Staff:
    return Staff(demo)


@pytest.fixture(scope="module")
def people(staff: Staff) -> list[Operator]:
    return [Operator(staff, f"student{n:02}", ("operator",)) for n in range(CLASS)]


@pytest.fixture(autouse=True)
def calm(staff: Staff, people: list[Operator]) -> Iterator[None]:
    yield
    control = runtime_of(staff.client).gate.control  # type: ignore[union-attr]
    control._tenures.clear()
    control._refusals.clear()


def holder(staff: Staff) -> str:
    held = runtime_of(staff.client).gate.control.holder("m1")  # type: ignore[union-attr]
    return held.person if held else ""


def row(who: Operator) -> str:
    """The row of who holds the machine, as somebody reads it."""
    found = re.search(r'<div class="token".*?</div>', who.get(M1).text, re.S)
    assert found
    return words(found[0]).replace("\xa0", " ")


def buttons(who: Operator) -> list[str]:
    return re.findall(r'data-token="(\w+)"', who.get(M1).text)


@pytest.mark.sweep(20)
def test_thirty_who_ask_at_once_have_it_one_after_the_other(staff: Staff, people: list[Operator]) -> None:
    """Most let it go when they are done; two keep silent, and the next comes all the same."""
    for who in people:
        assert who.post(f"{TOKEN}/request").status_code == 200
    turns = []
    for n, who in enumerate(people):
        turns.append(holder(staff))
        if n < 2:
            pass_time(ANSWER + 1 + REST * n)
        else:
            assert who.post(f"{TOKEN}/release").status_code == 200
    assert turns == [str(staff.add(who.name, *who.roles)) for who in people], "nobody is left out, nobody comes early"
    assert holder(staff) == ""


@pytest.mark.sweep(8)
def test_everybody_reads_who_waits_and_the_own_place(staff: Staff, people: list[Operator]) -> None:
    ana, ivo, eva, tom, uma = people[:5]
    ana.post(f"{TOKEN}/take")
    asked = ivo.post(f"{TOKEN}/request")
    assert line_of(asked) == "M1: Control requested"
    assert line_of(eva.post(f"{TOKEN}/request")) == "M1: In line: place 2 of 2"
    tom.post(f"{TOKEN}/request")
    assert re.search(r"student01 \(\+2\) asks for control 10 s", row(ana))
    assert buttons(ana) == ["give", "refuse"]
    assert re.search("student00 · requested 10 s", row(ivo))
    assert re.search(r"student00 · place 2 of 3 (?!.* s )", row(eva) + " ")
    assert "in line: student01 +2" in row(uma)
    assert [buttons(who) for who in (ivo, eva, uma)] == [["withdraw"], ["withdraw"], ["request"]]
    assert line_of(ivo.post(f"{TOKEN}/withdraw")) == "M1: Request withdrawn"
    assert "You · in line: student02 +1" in row(ana)
    assert buttons(ana) == ["release"]
    assert re.search("place 1 of 2 70 s", row(eva))
    assert "in line: student02 +1" in row(ivo)
    staff.have()
    staff.client.cookies.set("pogon_lang", "en")
    guest = words(staff.client.get(M1, headers={"HX-Request": "true"}).text)
    assert "in line: Operator +1" in guest
    assert "student" not in guest


@pytest.mark.sweep(20)
def test_the_line_is_told_to_everybody_who_looks(staff: Staff, people: list[Operator]) -> None:
    tags = runtime_of(staff.client).tags
    ana, ivo, eva = people[:3]
    ana.post(f"{TOKEN}/take")
    for work in (
        lambda: ivo.post(f"{TOKEN}/request"),
        lambda: eva.post(f"{TOKEN}/request"),
        lambda: ana.post(f"{TOKEN}/refuse"),
        lambda: pass_time(REST),  # Eva is put to Ana
        lambda: eva.post(f"{TOKEN}/withdraw"),
    ):
        pass_time(1)
        before = tags.sample("sys.commands.m1").value
        work()
        assert until(lambda before=before: tags.sample("sys.commands.m1").value != before)  # type: ignore[misc]


def test_who_is_told_why_not(staff: Staff, people: list[Operator]) -> None:
    ana, ivo, eva = people[:3]
    ana.post(f"{TOKEN}/take")
    ivo.post(f"{TOKEN}/request")
    phone = Operator(staff, ivo.name, ivo.roles)
    elsewhere = phone.post(f"{TOKEN}/request")
    assert (elsewhere.status_code, line_of(elsewhere)) == (409, "M1: You are in line already, from another browser")
    assert buttons(phone) == ["withdraw"]
    nothing = eva.post(f"{TOKEN}/withdraw")
    assert (nothing.status_code, line_of(nothing)) == (409, "M1: You are not in line for control")
    assert line_of(phone.post(f"{TOKEN}/withdraw")) == "M1: Request withdrawn"
    taken = ana.post(f"{TOKEN}/release")
    assert taken.status_code == 200
    assert line_of(eva.post(f"{TOKEN}/request")) == "M1: Control taken", "it was free"


@pytest.mark.sweep(8)
@pytest.mark.parametrize("lang", LANGUAGES)
def test_every_language_tells_the_place_and_who_waits(staff: Staff, people: list[Operator], lang: str) -> None:
    ana, ivo, eva, tom = (Operator(staff, who.name, who.roles, lang, who.sid) for who in people[:4])
    ana.post(f"{TOKEN}/take")
    for who in (ivo, eva):
        who.post(f"{TOKEN}/request")
    for who, told in ((eva, ("2", "2")), (tom, ("student01", "+1")), (ana, ("student01", "+1"))):
        read = row(who)
        assert all(word in read for word in told), read
        assert "operate." not in read


def test_what_was_done_in_the_line_is_in_the_audit(staff: Staff, people: list[Operator]) -> None:
    ana, ivo, eva = people[3:6]
    ana.post(f"{TOKEN}/take")
    for who in (ivo, eva):
        who.post(f"{TOKEN}/request")
    ivo.post(f"{TOKEN}/withdraw")
    ana.post(f"{TOKEN}/release")
    lines = staff.wait(staff.access.audit.find, Filter(object="m1"), 4)
    assert [(line.person, line.result, line.reason) for line in reversed(lines)] == [
        ("student03", "taken", "control.taken"),
        ("student04", "withdrawn", "control.withdrawn"),
        ("student03", "released", "control.released"),
        ("student05", "moved_up", "control.moved_up"),
    ]


def test_a_program_reads_the_line_and_stands_in_it(staff: Staff, people: list[Operator]) -> None:
    program = Program(staff, "view", "operate")
    nobody = {"holder": "", "since": None, "yours": False, "line": [], "place": 0, "asked": False, "left": None}
    assert program.get("/equipment/m1/control").json() == nobody
    ana, ivo = people[:2]
    ana.post(f"{TOKEN}/take")
    ivo.post(f"{TOKEN}/request")
    assert program.post("/equipment/m1/control/request").status_code == 204
    told = program.get("/equipment/m1/control").json()
    assert (told["holder"], told["line"][0], told["place"], told["yours"]) == ("student00", "student01", 2, False)
    assert told["asked"] and 9 < told["left"] <= 10
    ivo.post(f"{TOKEN}/withdraw")
    told = program.get("/equipment/m1/control").json()
    assert (told["place"], told["asked"]) == (1, False)
    assert 69 < told["left"] <= 70
    ana.post(f"{TOKEN}/release")
    assert program.get("/equipment/m1/control").json()["yours"]
    assert program.post("/equipment/m1/control/withdraw").json()["error"] == "why.not_in_line"
    assert program.post("/equipment/m1/control/release").status_code == 204
