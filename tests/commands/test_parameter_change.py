"""Elements of parameters: how they are called, what they may be, how many a request holds, what stands there."""

import pytest

from app.commands.parameter_change import ParameterChange, requests, saving_of, wrong_value
from app.commands.value_set import Stands
from app.plant import types
from app.plant.plant_files.languages import LANGUAGES
from app.profidrive.parameter_access.messages import LONGEST, Request, Values, encode_request

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
