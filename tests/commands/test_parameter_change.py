"""Elements of parameters: how they are called, what they may be, how many a request holds, what stands there."""

import pytest

from app.commands.parameter_change import ParameterChange, held, in_order, requests, saving_of, wrong_value
from app.commands.value_set import Stands
from app.errors import Refused
from app.plant import types
from app.plant.expression import Look
from app.plant.plant_files.languages import LANGUAGES
from app.plant.register_parameters import unknown
from app.profidrive.parameter_access.messages import LONGEST, Request, Values, encode_request
from app.profidrive.parameter_access.parameter import DriveParameter
from app.tags.quality import GOOD

TYPE = types.read_type("sinamics", LANGUAGES)[0].type
KNOWN = TYPE.drive_parameters


def change(code: str, new: float, index: int = 0, object: int = 2, **more: object) -> ParameterChange:
    return ParameterChange(object, KNOWN[code], new, index, **more)  # type: ignore[arg-type]


def test_an_element_has_its_name_its_address_and_its_value_in_the_format() -> None:
    one, other = change("p1120", 0.1), change("p0757", 3.0, 2, 1)
    assert (one.name, one.key, one.address.count) == ("p1120", "2:p1120", 0)
    assert (other.name, other.key, other.address.subindex, other.address.count) == ("p0757[2]", "1:p0757[2]", 2, 1)
    assert one.in_format(0.1) != 0.1 and one.described(5.0).new == one.in_format(0.1)
    assert change("p1300", 21.0).block(21.0) == Values(KNOWN["p1300"].format, (21,))


@pytest.mark.parametrize("one", [one for one in KNOWN.values() if one.writable], ids=lambda one: one.code)
def test_limits_are_permitted_and_nothing_beyond(one: object) -> None:
    parameter = KNOWN[one.code]  # type: ignore[attr-defined]
    for value in parameter.allowed or (parameter.low, parameter.high):
        assert wrong_value(parameter, value) is None
    for value in (parameter.low * 1.01 - 1e3, parameter.high * 1.01 + 1e3, float("nan"), float("inf")):
        assert wrong_value(parameter, value) is not None, value


def test_requests_keep_the_order_the_limit_and_one_object() -> None:
    many = [change("p0757", 1.0, index % 4, 1) for index in range(40)] + [change("p1120", n) for n in range(30)]
    found = list(requests(many))
    assert [one for request in found for one in request] == many
    for request in found:
        assert len({one.object for one in request}) == 1
        values = tuple(one.block(one.new) for one in request)
        assert len(encode_request(Request(1, 1, tuple(one.address for one in request), values))) <= LONGEST
    assert len(found) == 5 and not list(requests([]))


@pytest.mark.parametrize(
    ("found", "failed", "stands"),
    [(7.0, False, "new"), (5.0, False, "old"), (6.0, False, "other"), (None, False, "unknown"), (8.0, False, "new"), (5.0, True, "old")],
)  # fmt: skip
def test_what_stands_there(found: float | None, failed: bool, stands: str) -> None:
    one = change("p1120", 7.0, becomes=(8.0,))
    assert one.judged(one.described(5.0), found, failed=failed).stands == Stands(stands)
    same = change("p1120", 5.0)
    assert same.judged(same.described(5.0), 5.0).stands is Stands.NEW
    assert same.judged(same.described(5.0), 5.0, failed=True).stands is Stands.OLD
    trigger = change("p3981", 1.0)
    assert trigger.judged(trigger.described(0.0), 0.0).stands is Stands.NEW


def test_saving_is_by_what_the_type_knows() -> None:
    assert saving_of(TYPE) is KNOWN["p0977"]


# ---- parameters that are registers

REGISTERS = types.read_type("eura_e800", LANGUAGES)[0].type


def register(code: str, new: float) -> ParameterChange:
    parameter = REGISTERS.drive_parameters.get(code) or unknown(code)
    assert parameter is not None
    return ParameterChange(0, parameter, new)


def look(**values: float) -> Look:
    known = {"f111": 50.0, "f112": 0.5, "frequency_setpoint": 40.0, **values}
    return lambda key: (known[key], GOOD)


@pytest.mark.parametrize("one", REGISTERS.drive_parameters.values(), ids=lambda one: one.code)
def test_a_register_holds_its_unit_in_steps(one: DriveParameter) -> None:
    for raw in (0, 1, 7, 1234, 40000, 65535):
        value = one.in_unit(raw)
        assert one.steps(value) == raw and held(one, value) == value
        assert ParameterChange(0, one, value).block(value) == Values(one.format, (raw,))


@pytest.mark.parametrize(
    ("code", "value", "why"),
    [
        ("F114", 7.5, ""), ("F114", 7.55, "why.decimals"), ("F114", 0.0, "why.out_of_limits"), ("F114", 3000.0, ""),
        ("F114", float("nan"), "why.out_of_limits"), ("F114", float("inf"), "why.out_of_limits"),
        ("F203", 7.0, "why.no_option"), ("F203", 10.0, ""), ("F431", 9.0, ""), ("F300", 65535.0, ""),
        ("F300", 65536.0, "why.out_of_limits"), ("F300", -1.0, "why.out_of_limits"), ("F300", 0.5, "why.decimals"),
    ],
)  # fmt: skip
def test_what_a_register_may_be(code: str, value: float, why: str) -> None:
    assert (wrong_value(register(code, value).parameter, value) or ("",))[0] == why


def test_changes_go_in_an_order_in_which_they_fit_each_other_after_each() -> None:
    asked = [register("F113", 70), register("F300", 1), register("F111", 80), register("F112", 60)]
    assert [one.name for one in in_order(REGISTERS, asked, look())] == ["F300", "F111", "F113", "F112"]
    assert [one.name for one in in_order(REGISTERS, asked[:0:-1], look(frequency_setpoint=65, f111=66))] == [
        "F112", "F111", "F300",
    ]  # fmt: skip


@pytest.mark.parametrize(
    "asked",
    [{"F111": 30}, {"F113": 60}, {"F112": 45}, {"F113": 0.1}, {"F111": 45, "F113": 46}, {"F804": 3}, {"F804": 99}],
)
def test_changes_that_do_not_fit_each_other_are_refused(asked: dict[str, float]) -> None:
    with pytest.raises(Refused) as refused:
        in_order(REGISTERS, [register(code, value) for code, value in asked.items()], look())
    assert (refused.value.reason, refused.value.status) == ("why.check", 422)


def test_the_adjustment_of_an_encoder_is_one_drives_own_and_its_coordinate_is_not() -> None:
    assert {code for code, one in KNOWN.items() if one.individual} == {"p0918", "p2021", "p2507", "p2525"}
