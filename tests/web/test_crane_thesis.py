"""The page of the tests of the thesis: who may run one, what it draws, and that nothing of the plant moves."""

import re
from collections.abc import Iterator
from html import unescape

import pytest
from fastapi.testclient import TestClient

from app import bundled
from app.access.roles import ROLES
from app.plant.plant_files.languages import LANGUAGES
from app.settings import Settings
from app.web.screens.crane import RUNS, PositionerDrawing
from tests.virtual import house
from tests.web.operating import runtime_of
from tests.web.people import Staff

PAGE = "/equipment/cr1/page/thesis"


@pytest.fixture(scope="module")
def staff(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Staff]:
    settings = Settings(plant=bundled("plants/crane"), data=tmp_path_factory.mktemp("thesis") / "data")
    with house(settings) as browser:
        yield Staff(browser)


def drawn(staff: Staff, path: str, language: str = "en") -> str:
    staff.client.cookies.set("pogon_lang", language)
    answer = staff.client.get(path)
    assert answer.status_code == 200, (path, answer.text[:300])
    return unescape(answer.text)


def plant_of(client: TestClient) -> list[object]:
    tags = runtime_of(client).tags
    return [
        tags.sample(f"cr1.{axis}_{what}").value
        for axis in ("hoist", "trolley", "bridge")
        for what in ("position", "speed")
    ]


@pytest.mark.sweep(8)
@pytest.mark.parametrize("name", RUNS)
@pytest.mark.parametrize("role", [*ROLES, None])
def test_an_engineer_runs_a_test_and_others_see_why_they_may_not(staff: Staff, role: str | None, name: str) -> None:
    staff.have()
    if role:
        staff.enter(f"one-{role}", role)
    before = plant_of(staff.client)
    first, page = drawn(staff, PAGE), drawn(staff, f"{PAGE}?run={name}")
    for html in (first, page):
        buttons = re.findall(r'<button[^>]*name="run" value="(\w+)"([^>]*)>', html)
        assert [value for value, _ in buttons] == list(RUNS)
        assert all(("disabled" in rest) is (role != "engineer") for _, rest in buttons)
        assert ("Only an engineer may run a test." in html) is (role != "engineer")
        assert "does not move" in html
    assert "k-expected" not in first
    assert ("k-trace" in page) is (role == "engineer")
    assert ("k-expected" in page) is (role == "engineer" and name != "sequence"), "nothing is expected of a sequence"
    assert plant_of(staff.client) == before


@pytest.mark.parametrize("language", LANGUAGES)
def test_numbers_of_the_positioner_stand_beside_those_of_the_thesis(staff: Staff, language: str) -> None:
    staff.enter("one-engineer", "engineer")
    html = drawn(staff, f"{PAGE}?run=positioner", language)
    mark = "." if language == "en" else ","
    rows = re.findall(r"<tr><th scope=\"row\">.*?</tr>", html, re.DOTALL)
    cells = [
        [text.replace("\u202f", "").replace("\u00a0", " ") for text in re.findall(r"<td[^>]*>(.*?)</td>", row)]
        for row in rows
    ]
    assert [row[0] for row in cells] == [
        text.replace(".", mark) for text in ("660.4", "6981.2", "8486.8", "16.10", "10000.0", "0.0")
    ]
    assert cells[2][1] == "8486.9".replace(".", mark), "as the pure run measures it"
    curves = re.findall(r'class="(k-expected|m-livel k-trace)" d="(M[^"]+)"', html)
    assert len(curves) == 6 and all(path.count("L") > 3 for _, path in curves)


@pytest.mark.sweep(8)
@pytest.mark.parametrize("language", LANGUAGES)
def test_a_sequence_has_our_figures_alone_and_says_so(staff: Staff, language: str) -> None:
    staff.enter("one-engineer", "engineer")
    html = drawn(staff, f"{PAGE}?run=sequence", language)
    rows = re.findall(r"<tr><th scope=\"row\">(.*?)</th>(.*?)</tr>", html, re.DOTALL)
    assert [name[:4] for name, _ in rows][:3] == ["S100", "S102", "S200"] and len(rows) == 15 + 4
    assert all(cells.count("<td") == 1 for _, cells in rows), "no column of the thesis, no difference"
    assert staff.client.app.state.runtime.texts.text(language, "crane.thesis.basis_sequence") in html  # type: ignore[attr-defined]
    curves = re.findall(r'class="m-livel k-trace" d="(M[^"]+)"', html)
    assert len(curves) == 3 and all(path.count("L") > 400 for path in curves)


def test_a_run_is_done_once_for_all_who_ask(staff: Staff, monkeypatch: pytest.MonkeyPatch) -> None:
    staff.enter("one-engineer", "engineer")
    once = drawn(staff, f"{PAGE}?run=positioner")

    def again() -> PositionerDrawing:
        raise AssertionError("it is run again")

    monkeypatch.setitem(RUNS, "positioner", again)  # type: ignore[arg-type]
    assert drawn(staff, f"{PAGE}?run=positioner").count("k-trace") == once.count("k-trace") == 3


@pytest.mark.parametrize("asked", ["none", "", "positioner%22", "../x"])
def test_a_test_that_there_is_not_is_not_there(staff: Staff, asked: str) -> None:
    staff.enter("one-engineer", "engineer")
    assert staff.client.get(f"{PAGE}?run={asked}").status_code == 404
