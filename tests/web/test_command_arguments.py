"""Commands that take arguments, over HTTP at the conveyor of the demo plant: fields, words, reasons of the device, audit, the interface."""

from typing import Any

import pytest
from fastapi.testclient import TestClient

from app import chance
from app.commands.lifecycle import Progress
from tests.web.operating import Operator, line_of, runtime_of, until, words
from tests.web.people import Staff
from tests.web.test_api import Program

DELETE, EDIT = "/equipment/c1/command/delete_product", "/equipment/c1/command/edit_product"


@pytest.fixture(scope="module")
def staff(demo: TestClient) -> Staff:
    runtime = runtime_of(demo)
    assert until(lambda: runtime.tags.sample("c1.automatic").value == 1 and runtime.tags.sample("c1.longest").seen)
    return Staff(demo)


@pytest.fixture(autouse=True)
def free(staff: Staff) -> None:
    """Every test begins with a machine that nobody holds."""
    gate = runtime_of(staff.client).gate
    assert gate is not None
    if holder := gate.control.holder("c1"):
        staff.wait(gate.control.session_ended, holder.session)


@pytest.fixture
def eva(staff: Staff, free: None) -> Operator:
    engineer = Operator(staff, "eva", ("engineer", "operator"))
    engineer.take("c1")
    return engineer


def latest(staff: Staff) -> Progress:
    gate = runtime_of(staff.client).gate
    assert gate is not None
    found = gate.progress("c1")
    assert found is not None
    return found


def over(staff: Staff) -> Progress:
    assert until(lambda: latest(staff).over)
    return latest(staff)


def value(staff: Staff, key: str) -> Any:
    return runtime_of(staff.client).tags.sample(f"c1.{key}").value


def standing(staff: Staff, eva: Operator) -> None:
    """The line in manual, at rest."""
    if value(staff, "mode") == 2 and not value(staff, "moving"):
        return
    eva.post("/equipment/c1/stop")
    assert until(lambda: not value(staff, "moving") and not value(staff, "automatic")), latest(staff)
    assert over(staff).state == "confirmed"
    assert until(lambda: eva.press("/equipment/c1/command/select_manual", confirmed="1").status_code == 202)
    assert until(lambda: value(staff, "mode") == 2)


def put(staff: Staff, eva: Operator, head: str) -> int:
    """A product by hand; its number."""
    number = int(value(staff, "next_id"))
    answer = eva.press(
        "/equipment/c1/command/insert_product", confirmed="1", reason="test", arg_head=head, arg_length="20"
    )
    assert answer.status_code in (200, 202), words(answer.text)
    assert over(staff).state == "confirmed", over(staff)
    assert until(lambda: value(staff, "next_id") == number + 1)
    return number


def numbers(staff: Staff) -> set[int]:
    slots = runtime_of(staff.client).plant.equipment["c1"].tables["product"]  # type: ignore[union-attr]
    return {int(value(staff, f"product_{slot}_id") or 0) for slot in range(1, slots + 1)} - {0}


@pytest.mark.sweep(8)
def test_a_product_is_put_moved_and_deleted_and_the_audit_says_by_whom_and_why(staff: Staff, eva: Operator) -> None:
    standing(staff, eva)
    product = put(staff, eva, "40")
    assert until(lambda: product in numbers(staff))
    program = Program(staff, "view")

    def length() -> object:
        found = program.get("/records/passage", equipment="c1", product=product).json()["records"]
        return found[0]["fields"].get("length") if found else None

    assert until(lambda: length() == 20.0), "its passage has the length that was given"
    moved = eva.press(EDIT, confirmed="1", reason="slipped", arg_product=str(product), arg_head="45.5", arg_length="22")
    assert moved.status_code in (200, 202), words(moved.text)
    assert over(staff).state == "confirmed"
    assert "45.5" in words(eva.get("/equipment/c1/commands").text)
    assert until(lambda: length() == 22.0)
    gone = eva.press(DELETE, confirmed="1", reason="fell off", arg_product=str(product))
    assert gone.status_code in (200, 202)
    assert over(staff).state == "confirmed"
    assert until(lambda: product not in numbers(staff))
    page = words(Operator(staff, "adam", ("admin",)).get("/audit?object=c1.delete_product", fragment=False).text)
    assert f"Product ID {product}" in page
    assert "fell off" in page


def test_the_device_s_own_reason_is_told_in_the_person_s_words(staff: Staff, eva: Operator) -> None:
    standing(staff, eva)
    answer = eva.press(DELETE, confirmed="1", reason="test", arg_product="4000000000")
    assert answer.status_code == 409
    assert latest(staff).params["label"] == "reason.no_such_product"
    runtime = runtime_of(staff.client)
    assert runtime.plant is not None
    reason = runtime.texts.of_type("en", runtime.plant.types["conveyor"], "reason.no_such_product")
    assert reason in line_of(answer)
    page = words(Operator(staff, "adam", ("admin",)).get("/audit?object=c1.delete_product", fragment=False).text)
    assert reason in page


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"arg_head": "700"}, "660"),
        ({"arg_head": "10.55"}, "decimal"),
        ({"arg_head": "here"}, "Not a number"),
        ({"arg_head": ""}, "Required"),
        ({"arg_product": "0"}, "At least 1"),
    ],
)
def test_a_wrong_argument_is_named_and_nothing_is_sent(
    staff: Staff, eva: Operator, given: dict[str, str], said: str
) -> None:
    standing(staff, eva)
    before = latest(staff).id
    fields = {"arg_product": "1", "arg_head": "40", "arg_length": "20"} | given
    answer = eva.press(EDIT, confirmed="1", reason="test", **fields)
    assert answer.status_code == 422
    runtime = runtime_of(staff.client)
    assert runtime.plant is not None
    name = next(iter(given)).removeprefix("arg_")
    assert runtime.texts.of_type("en", runtime.plant.types["conveyor"], f"argument.{name}") in line_of(answer)
    assert said in line_of(answer)
    assert latest(staff).id == before


def test_a_number_that_means_two_things_is_to_be_written_again(staff: Staff) -> None:
    eva = Operator(staff, "eva2", ("engineer", "operator"), language="de")
    eva.take("c1")
    answer = eva.press(EDIT, confirmed="1", reason="x", arg_product="1", arg_head="1.234", arg_length="20")
    assert answer.status_code == 422
    assert "1,234" in line_of(answer)


def test_without_confirmation_the_gate_asks_back_with_what_was_given(staff: Staff) -> None:
    eva = Operator(staff, "eva3", ("engineer", "operator"))
    eva.take("c1")
    answer = eva.press(DELETE, arg_product="3")
    assert answer.status_code == 409
    assert 'name="arg_product" value="3"' in answer.text
    assert 'name="reason"' in answer.text
    gate = runtime_of(staff.client).gate
    assert gate is not None
    staff.wait(_in_loop, gate.control.session_ended, gate.control.holder("c1").session)  # type: ignore[union-attr]


def test_programs_give_arguments_by_name(staff: Staff) -> None:
    program = Program(staff, "view", "operate", "stop")
    assert program.post("/equipment/c1/control/take").status_code == 204
    path = "/equipment/c1/commands/"

    def order(command: str, **body: Any) -> Any:
        return program.order(path + command, f"api-{chance.token_hex(16)}", **body)

    asked = order("confirm_positions", arguments={"product": 0})
    assert (asked.status_code, asked.json()["error"]) == (409, "why.confirm")
    done = order("confirm_positions", arguments={"product": 0}, confirmed=True)
    assert done.status_code == 202, done.text
    assert done.json()["arguments"] == {"product": 0.0}
    wrong = order("confirm_positions", arguments={"product": -1}, confirmed=True)
    assert (wrong.status_code, wrong.json()["argument"]) == (422, "product")
    unknown = order("confirm_positions", arguments={"products": 1}, confirmed=True)
    assert (unknown.status_code, unknown.json()["error"], unknown.json()["argument"]) == (
        422,
        "why.unknown_argument",
        "products",
    )
    missing = order("confirm_positions", confirmed=True)
    assert (missing.status_code, missing.json()["error"]) == (422, "why.argument_missing")
    assert "argument.product" not in missing.json()["text"]
    many = order("confirm_positions", arguments=dict.fromkeys("abcde", 1.0))
    assert many.status_code == 422
    assert program.get("/equipment/c1/commands").json()[0]["arguments"] is not None
    assert program.post("/equipment/c1/control/release").status_code == 204


async def _in_loop(work: Any, *arguments: Any) -> None:
    work(*arguments)


@pytest.mark.parametrize(
    ("lang", "said", "broken"),
    [
        ("hr", "Najmanje 1", "Previše decimalnih mjesta. Dopušteno: 0"),
        ("en", "At least 1", "Too many decimal places. Permitted: 0"),
    ],
)
def test_limits_of_whole_numbers_are_whole_in_the_interface(staff: Staff, lang: str, said: str, broken: str) -> None:
    program = Program(staff, "view", "operate", "configure")
    program.headers["Accept-Language"] = lang
    program.post("/equipment/c1/control/take")
    try:
        texts = [
            program.order(
                "/equipment/c1/commands/delete_product",
                chance.token_hex(16),
                arguments={"product": product},
                confirmed=True,
                reason="test",
            ).json()["text"]
            for product in (0, 1.5)
        ]
    finally:
        program.post("/equipment/c1/control/release")
    assert texts == [said, broken]
