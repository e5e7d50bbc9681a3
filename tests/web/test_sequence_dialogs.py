"""Dialogs of a sequence over HTTP: only for what there is and may be asked; labels of another language with their mark."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from app import chance
from app.web.points import EquipmentView, plant_text
from app.web.screens.sequence import sequence_of
from tests import coil_plant
from tests.web.conftest import _running
from tests.web.operating import Operator, line_of, runtime_of, until, words
from tests.web.people import PASSWORD, Staff
from tests.web.test_api import Program

LABELS = (
    ('"Exercise 1"', '{ hr = "Prvi", de = "Erster" }'),
    ('"Tank 1 is ready"', '{ cs = "Pět" }'),
    ('"Exercise 2"', '{ en = "Second", de = "Zweiter" }'),
)


@pytest.fixture(scope="module")
def plant(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    folder: Path = coil_plant.write(tmp_path_factory.mktemp("dialogs") / "plant")
    drill = folder / "sequences" / "drill.toml"
    text = drill.read_text("utf-8")
    for old, new in LABELS:
        assert old in text
        text = text.replace(old, new)
    drill.write_text(text, "utf-8")
    with _running(folder.parent / "data", folder) as client:
        tags = runtime_of(client).tags
        assert until(lambda: tags.sample("seq2.step_12_id").value and tags.sample("seq1.start_possible").value, 30)
        yield client


@pytest.fixture(scope="module")
def engineer(plant: TestClient) -> Operator:
    person = Operator(Staff(plant), "ivana", ("engineer", "operator"))
    person.take("seq2")
    return person


@pytest.mark.parametrize(
    ("path", "status", "said"),
    [
        ("force?step=1&bit=2", 409, "This permissive may not be forced"),
        ("force?step=0&bit=0", 409, "This permissive may not be forced"),
        ("force?step=1&bit=9", 404, "No permissive with this number"),
        ("force?step=1&bit=99", 404, "No permissive with this number"),
        ("force?step=99&bit=1", 404, "No step with this number"),
        ("force?step=13&bit=1", 404, "No step with this number"),
        ("force?step=abc&bit=1", 422, "Not a number: abc"),
        ("force?step=1&bit=-1", 422, "Not a number: -1"),
        ("force?step=1&bit=\u00b2", 422, "Not a number: \u00b2"),
        ("force?step=1.5&bit=1", 422, "Not a number: 1.5"),
        ("force?step=1", 422, "Required field"),
        ("force", 422, "Required field"),
        ("release?step=1&bit=99", 404, "No permissive with this number"),
        ("set_times?step=99", 404, "No step with this number"),
        ("set_times?step=0", 404, "No step with this number"),
        ("set_times?step=x", 422, "Not a number: x"),
    ],
)
def test_what_is_not_there_or_may_not_be_is_refused_without_a_dialog(
    engineer: Operator, path: str, status: int, said: str
) -> None:
    engineer.language = "en"
    answer = engineer.get(f"/equipment/seq2/ask/{path}")
    assert answer.status_code == status
    assert said in line_of(answer)
    assert "<form" not in answer.text and 'name="password"' not in answer.text


@pytest.mark.parametrize(
    ("lang", "said"),
    [
        ("hr", "Ovaj se uvjet ne smije forsirati"),
        ("de", "Diese Freigabe darf nicht zwangsgesetzt werden"),
        ("cs", "Tuto podmínku nelze vynutit"),
    ],
)
def test_the_refusal_is_in_the_language_of_the_person(engineer: Operator, lang: str, said: str) -> None:
    engineer.language = lang
    assert line_of(engineer.get("/equipment/seq2/ask/force?step=1&bit=2")) == said


@pytest.mark.sweep(8)
def test_a_permissive_is_released_only_when_it_is_forced(plant: TestClient, engineer: Operator) -> None:
    engineer.language = "en"
    tags = runtime_of(plant).tags
    given = {"arg_step": "3", "arg_bit": "1"}
    proof = {"reason": "test", "confirmed": "1", "password": PASSWORD}
    engineer.press("/equipment/seq2/command/force", **given, arg_duration="6", **proof)
    assert until(lambda: tags.sample("seq2.forces").value == 1)
    held = engineer.get("/equipment/seq2/ask/release?step=3&bit=1")
    other = engineer.get("/equipment/seq2/ask/release?step=4&bit=1")
    assert "Tank 3 is ready" in held.text and "<form" in held.text
    assert (other.status_code, line_of(other)) == (409, "This permissive is not forced")
    assert until(lambda: tags.sample("seq2.forces").value == 0)


@pytest.mark.parametrize("password", [PASSWORD, "nothing like it"])
def test_of_an_order_that_is_refused_anyway_no_password_is_looked_at(
    plant: TestClient, engineer: Operator, monkeypatch: pytest.MonkeyPatch, password: str
) -> None:
    """Neither does a refusal cost a hash, nor does it tell whether a password was right."""
    engineer.language = "en"
    looked: list[str] = []
    passwords = runtime_of(plant).access.passwords
    verify = passwords._verify_now
    monkeypatch.setattr(passwords, "_verify_now", lambda *given: (looked.append(given[0]), verify(*given))[1])
    given = {"arg_step": "3", "arg_bit": "1", "arg_duration": "6", "reason": "test", "confirmed": "1"}
    engineer.post("/equipment/seq2/token/release")
    try:
        refused = engineer.press("/equipment/seq2/command/force", **given, password=password)
    finally:
        engineer.take("seq2")
    assert (refused.status_code, looked) == (423, [])
    wrong = engineer.press("/equipment/seq2/command/force", **given, password="nothing like it")
    assert (wrong.status_code, looked) == (401, ["nothing like it"])
    runtime_of(plant).access.throttle.clear(f"ivana {engineer.sid}")


def test_a_token_has_no_password_and_cannot_force(plant: TestClient, engineer: Operator) -> None:
    staff = engineer.staff
    engineer.post("/equipment/seq2/token/release")
    program = Program(staff, "view", "operate", "configure")
    program.headers["Accept-Language"] = "hr"
    program.post("/equipment/seq2/control/take")
    path = "/equipment/seq2/commands/force"

    def force(step: int) -> Any:
        given = {"step": step, "bit": 1, "duration": 5}
        return program.order(path, chance.token_hex(16), arguments=given, confirmed=True, reason="test")

    try:
        refused, far = force(3), force(99)
    finally:
        program.post("/equipment/seq2/control/release")
        engineer.take("seq2")
    assert (refused.status_code, refused.json()["error"]) == (409, "why.password_needed")
    assert (far.status_code, far.json()["text"]) == (422, "Dopušteno: 0 do 12")
    assert runtime_of(plant).tags.sample("seq2.forces").value == 0


def test_a_label_of_another_language_has_its_mark_on_page_and_in_dialogs(plant: TestClient, engineer: Operator) -> None:
    engineer.language = "en"
    page = words(engineer.get("/equipment/seq2", fragment=False).text)
    assert "[hr] Prvi" in page and "[en] Second" not in page and "Second" in page
    assert "[cs] Pět" in words(engineer.get("/equipment/seq2/part/word?step=1&all=1").text)
    assert "[cs] Pět" in words(engineer.get("/equipment/seq2/ask/force?step=1&bit=1").text)
    assert "[hr] Prvi" in words(engineer.get("/equipment/seq2/ask/set_times?step=1").text)
    engineer.language = "hr"
    assert "[en] Second" in words(engineer.get("/equipment/seq2/ask/set_times?step=2").text)
    assert "[hr]" not in words(engineer.get("/equipment/seq2/ask/set_times?step=1").text)


@pytest.mark.parametrize("lang", ["hr", "en", "de", "cs"])
def test_page_and_interface_mark_labels_alike(plant: TestClient, lang: str) -> None:
    runtime = runtime_of(plant)
    assert runtime.plant
    item = runtime.plant.equipment["seq2"]
    view = sequence_of(
        EquipmentView(item, runtime, lang, lambda key, **params: runtime.texts.text(lang, key, **params))
    )
    assert view
    for step in (1, 2, 3):
        assert view.step(step).label == runtime.texts.step(lang, item, step)
        assert view.label(step, 1) == runtime.texts.permissive(lang, item, step, 1)
    assert plant_text({}, lang, runtime.plant) == ""


@pytest.mark.sweep(8)
def test_why_a_permissive_is_forced_is_what_was_said_with_the_force_that_stands(
    plant: TestClient, engineer: Operator
) -> None:
    """Whatever was asked for and refused afterwards."""
    tags = runtime_of(plant).tags
    given = {"arg_step": "3", "arg_bit": "1", "arg_duration": "6"}
    proof = {"confirmed": "1", "password": PASSWORD}
    engineer.press("/equipment/seq2/command/force", **given, **proof, reason="sensor B3 wet")
    assert until(lambda: tags.sample("seq2.forces").value == 1)
    assert until(lambda: "sensor B3 wet" in engineer.get("/forces/list").text)
    assert "<span data-some>1</span>" in engineer.get("/forces/count").text
    engineer.press("/equipment/seq2/command/force", **given, confirmed="1", password="wrong", reason="never happened")
    engineer.press(
        "/equipment/seq2/command/force", **given | {"arg_duration": "99999999"}, **proof, reason="never happened"
    )
    page = engineer.get("/forces/list").text
    assert "sensor B3 wet" in page and "never happened" not in page
    assert until(lambda: tags.sample("seq2.forces").value == 0)
    assert "<span>0</span>" in engineer.get("/forces/count").text
