"""The audit tells in words what stood before and what stands after: names, numbers of the language with their units, texts of a state."""

import json
import re
from html import unescape

import pytest
from fastapi.testclient import TestClient

from app.sim.training import REG_MACHINE_FAULT
from tests.web.people import Staff
from tests.web.test_alarms import LANGUAGES


@pytest.fixture(scope="module")
def staff(demo: TestClient) -> Staff:
    staff = Staff(demo)
    staff.enter("ana", "engineer", "admin")
    return staff


def written(staff: Staff, lang: str, *line: object, **more: object) -> list[str]:
    """The cells of a line as its page has them, without marks; the id beside a name is left out."""
    staff.wait(staff.access.audit.record, *line, **more)
    staff.client.cookies.set("pogon_lang", lang)
    page = unescape(staff.client.get("/audit").text)
    row = re.findall(r"<tr[^>]*>(<td class=\"r num dim\">.*?)</tr>", page, re.DOTALL)[0]
    cells = re.findall(r"<t[dh][^>]*>(.*?)</t[dh]>", re.sub(r'<small class="mono">.*?</small>', "", row), re.DOTALL)
    return [" ".join(re.sub(r"<[^>]+>", " ", cell).split()) for cell in cells]


def changes(*values: tuple[str, float, float]) -> dict[str, str]:
    return {f"change_{at}": json.dumps([*one, None, "unknown"]) for at, one in enumerate(values, 1)}


@pytest.mark.parametrize(("lang", "mark"), [("hr", ","), ("en", "."), ("de", ","), ("cs", ",")])
def test_a_setpoint_has_its_unit_and_the_sign_of_the_language(staff: Staff, lang: str, mark: str) -> None:
    cells = written(staff, lang, "command", None, "m1.set_frequency", 40.0, 38.5, "confirmed")
    assert cells[5:7] == [f"40{mark}00 Hz", f"38{mark}50 Hz"]


@pytest.mark.parametrize(("lang", "mark"), [("hr", ","), ("en", "."), ("de", ","), ("cs", ",")])
def test_the_limits_of_a_refusal_have_the_sign_of_the_language(staff: Staff, lang: str, mark: str) -> None:
    why = {"reason": "why.out_of_limits", "reason_min": "0.5", "reason_max": "47.25", "reason_unit": "Hz"}
    cells = written(staff, lang, "command", None, "m1.set_frequency", "", "0.4", "refused", **why)
    assert f"0{mark}5 " in cells[7] and f"47{mark}25 Hz" in cells[7]


@pytest.mark.parametrize(
    ("lang", "number", "said"),
    [("hr", 81.5, " 81,5 °C"), ("de", 85.0, " 85 °C"), ("en", 81.5, " 81.5 °C"), ("cs", 9.0, " 9 °C")],
)
def test_the_numbers_of_a_missing_condition_have_the_sign_of_the_language(
    staff: Staff, lang: str, number: float, said: str
) -> None:
    why = {"reason_label": "missing.permissive.cooled", "reason_temperature": number}
    cells = written(staff, lang, "command", None, "m2.reset", "", "", "refused", reason="why.condition", **why)
    assert said in cells[7]


@pytest.mark.sweep(8)
@pytest.mark.parametrize("typed", ["NaN", "nan", "inf", "-Infinity", "9" * 400, "1_000", "1e1", "٣٨"])
def test_what_was_typed_and_is_no_number_stays_as_it_was_typed(staff: Staff, typed: str) -> None:
    """One person typed NaN into a setpoint, and nobody could look at the audit any more."""
    assert written(staff, "en", "command", None, "m1.set_frequency", 40.0, typed, "refused")[5:7] == ["40.00 Hz", typed]
    cells = written(staff, "en", "command", None, "m1.set_frequency", 40.0, f"f114 = {typed}", "refused")
    assert cells[6].endswith(typed)


def test_a_number_that_has_an_exponent_is_one(staff: Staff) -> None:
    cells = written(staff, "en", "command", None, "m1.set_frequency", 1e-05, 1e16, "refused")
    assert cells[5] == "0.00 Hz" and cells[6].endswith(" Hz")


def test_values_written_together_have_their_names_and_many_unfold(staff: Staff) -> None:
    two = changes(("f114", 5.0, 6.5), ("f115", 5.0, 7.0))
    cells = written(staff, "hr", "command", None, "m1.setpoints", "F114 = 5", "F114 = 6.5", "confirmed", **two)
    assert "6,5 s" in cells[6] and "=" not in cells[6] and "5,0 s" in cells[5]
    three = two | changes(("f114", 5.0, 6.5), ("f115", 5.0, 7.0), ("f111", 50.0, 45.0))
    cells = written(staff, "en", "command", None, "m1.setpoints", "F114 = 5", "F114 = 6.5", "confirmed", **three)
    assert cells[6].startswith("Values: 3 ") and "45.00 Hz" in cells[6] and "Set of values" in cells[4]


def test_a_parameter_of_a_drive_has_its_code_and_its_unit(staff: Staff) -> None:
    one = changes(("2:p1120", 10.0, 4.5))
    cells = written(staff, "de", "command", None, "a1.drive_parameters", "", "p1120 = 4.5", "confirmed", **one)
    assert cells[6].startswith("p1120 ") and cells[6].endswith("4,5 s")


@pytest.mark.parametrize("lang", LANGUAGES)
def test_roles_faults_and_periods_are_words(staff: Staff, lang: str) -> None:
    texts = staff.client.app.state.runtime.texts  # type: ignore[attr-defined]
    cells = written(staff, lang, "person.roles", None, "ivo", "viewer", "engineer, operator")
    roles = [texts.text(lang, f"access.role.{role}") for role in ("viewer", "engineer", "operator")]
    assert cells[5:7] == [roles[0], f"{roles[1]}, {roles[2]}"]
    plant, register = staff.client.app.state.runtime.plant, f"0x{REG_MACHINE_FAULT:04X}"  # type: ignore[attr-defined]
    fault = next(iter(plant.equipment["m1"].type.training.faults.values()))
    cells = written(staff, lang, "instructor.fault", None, "m1", f"{register} = 0", f"{register} = {fault}")
    assert not re.search(r"0x|=", cells[5] + cells[6]) and cells[5] and cells[6] and not cells[6].isdigit()
    cells = written(staff, lang, "alarm.acknowledged", None, "m1.fault", new="1234567")
    assert cells[6] == "", "the number of an occurrence says nothing to a person"
    cells = written(staff, lang, "history.exported", None, "m1.speed m1.current")
    assert "m1." not in "".join(cells)


def test_what_is_not_in_the_plant_any_more_stays_as_it_was_written(staff: Staff) -> None:
    cells = written(staff, "hr", "command", None, "gone.f114", 5.0, 6.0, "confirmed")
    assert cells[5:7] == ["5.0", "6.0"]


@pytest.mark.parametrize(
    ("lang", "code", "said"),
    [
        ("en", "6", "(exception 6): device busy"),
        ("de", "2", "(Ausnahme 2): unzulässige Adresse"),
        ("hr", "99", "(iznimka 99): nepoznata iznimka"),
    ],
)
def test_what_a_device_refused_with_has_its_name(staff: Staff, lang: str, code: str, said: str) -> None:
    cells = written(
        staff, lang, "command", None, "m1.f114", "", "", "failed", reason="why.device_refused", reason_code=code
    )
    assert said in " ".join(cells)
    cells = written(staff, lang, "command", None, "m1.f114", "", "", "failed", reason="why.device_refused")
    assert "?): " in " ".join(cells) and "{" not in " ".join(cells), "a line of before"


@pytest.mark.parametrize("machine", ["m1", "gone"])
def test_the_label_of_a_command_that_the_machine_has_no_more_is_no_key(staff: Staff, machine: str) -> None:
    """`[command.off]` of the type that it had, or the key as it is once the machine was taken out."""
    superseded = {"reason": "why.superseded", "reason_label": "command.former_order", "reason_display": "Ivo"}
    cells = written(staff, "en", "command", None, f"{machine}.former_order", "", "", "superseded", **superseded)
    assert "Newer command: former_order, Ivo" in " ".join(cells)


def test_what_went_well_is_not_marked_as_what_did_not(staff: Staff) -> None:
    for result, marked in (("confirmed", False), ("sent", False), ("refused", True), ("unconfirmed", True)):
        written(staff, "en", "command", None, "m1.forward", result=result)
        first = re.search(r"<tbody>\s*<tr([^>]*)>", staff.client.get("/audit").text)
        assert first and ("au-no" in first[1]) is marked, result
