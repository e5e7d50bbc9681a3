"""What a person typed is a number within its limits, of the value that they saw, and asked back when the level wants more."""

from dataclasses import replace
from itertools import product

import pytest

from app.commands import interlocks
from app.commands.entered import argument_of, arguments_of, check_seen, confirm
from app.commands.orders import Order, Question
from app.errors import Refused
from app.plant.definitions import EquipmentType
from app.plant.expression import Look
from app.tags.quality import GOOD
from tests.commands.stand import ANA, demo_plant

ITEM = demo_plant().equipment["m1"]
SETPOINT = interlocks.prepare(ITEM, interlocks.setting(ITEM, ITEM.type.setpoints["frequency_setpoint"]))
STOP = interlocks.prepare(ITEM, next(command for command in ITEM.type.commands.values() if command.stop))
UNCHECKED: EquipmentType = replace(ITEM.type, checks=[])
ORDER = Order(ANA, "m1", "frequency_setpoint", None, "id", "", None, False, False, "", "", "en", 0)


def look(**values: float) -> Look:
    known = {"f111": 50.0, "f112": 0.0, "frequency_setpoint": 20.0} | values
    return lambda key: (known.get(key, 0.0), GOOD)


@pytest.mark.parametrize(
    ("given", "language", "value"),
    [
        ("25", "en", 25.0),
        ("25.5", "en", 25.5),
        ("25,5", "hr", 25.5),
        (" 25 ", "de", 25.0),
        (25, "en", 25.0),
        (25.5, "cs", 25.5),
    ],
)
def test_a_number_is_read_as_the_language_writes_it(given: str | float, language: str, value: float) -> None:
    order = replace(ORDER, argument=given, language=language)
    assert argument_of(order, SETPOINT, UNCHECKED, look()) == value


@pytest.mark.parametrize("poles", [2, 3, 4, 57, 100])
def test_a_motor_has_an_even_number_of_poles(poles: int) -> None:
    number = interlocks.prepare(ITEM, interlocks.setting(ITEM, ITEM.type.setpoints["f804"]))
    order = replace(ORDER, key="f804", argument=poles)
    if poles % 2 == 0:
        assert argument_of(order, number, ITEM.type, look(f804=3)) == poles
    else:
        with pytest.raises(Refused, match=r"why\.check"):
            argument_of(order, number, ITEM.type, look(f804=4))


@pytest.mark.parametrize("given", ["", None])
def test_nothing_is_asked_for_by_name(given: str | None) -> None:
    with pytest.raises(Refused, match=r"why\.argument_missing") as refused:
        argument_of(replace(ORDER, argument=given), SETPOINT, UNCHECKED, look())
    assert refused.value.status == 422


@pytest.mark.parametrize(
    "given", ["fast", "1e", "--1", "25 Hz Hz", "99", "-1", "nan", "inf", 51.0, float("nan"), float("inf")]
)
def test_what_is_no_number_or_outside_is_refused(given: str | float) -> None:
    with pytest.raises(Refused) as refused:
        argument_of(replace(ORDER, argument=given), SETPOINT, UNCHECKED, look())
    assert refused.value.status == 422


@pytest.mark.parametrize(("given", "refused"), [(None, False), ("", False), ("1", True), (0.0, True)])
def test_a_command_without_argument_takes_none(given: str | float | None, refused: bool) -> None:
    order = replace(ORDER, argument=given)
    if refused:
        with pytest.raises(Refused, match=r"why\.no_argument"):
            argument_of(order, STOP, UNCHECKED, look())
    else:
        assert argument_of(order, STOP, UNCHECKED, look()) is None


@pytest.mark.parametrize("decimals", [0, 1, 2])
@pytest.mark.parametrize("off", [-1.0, -0.7, -0.5, 0.0, 0.5, 0.7, 1.0])
def test_a_value_is_the_one_that_was_seen_within_its_last_digit(decimals: int, off: float) -> None:
    assert SETPOINT.point is not None
    prepared = replace(SETPOINT, point=replace(SETPOINT.point, decimals=decimals))
    now = look(frequency_setpoint=20.0 + off * 10.0**-decimals)
    check_seen(prepared, now, None)
    if abs(off) < 0.6:
        check_seen(prepared, now, 20.0)
    else:
        with pytest.raises(Refused, match=r"why\.changed") as refused:
            check_seen(prepared, now, 20.0)
        assert (refused.value.status, refused.value.params["expected"]) == (409, 20.0)


def test_an_argument_that_the_command_does_not_know_is_refused_by_its_name() -> None:
    with pytest.raises(Refused, match=r"why\.unknown_argument") as refused:
        arguments_of(replace(ORDER, arguments={"x" * 100: "1"}), STOP, look())
    assert refused.value.params["argument"] == "x" * 40
    assert arguments_of(ORDER, STOP, look()) == {}


@pytest.mark.parametrize("level", ["C0", "C1", "C2", "C3", "C4"])
def test_every_level_asks_for_the_first_thing_that_is_missing(level: str) -> None:
    for confirmed, reason, proven in product((False, True), ("", "  ", "because"), (False, True)):
        order = replace(ORDER, confirmed=confirmed, reason=reason, proven=proven)
        missing = [
            key
            for key, lacks in (
                ("why.confirm", level >= "C2" and not confirmed),
                ("why.reason_needed", level >= "C3" and not reason.strip()),
                ("why.password_needed", level >= "C4" and not proven),
            )
            if lacks
        ]
        if not missing:
            confirm(order, SETPOINT, level, (), 30.0, 20.0, {})
            continue
        with pytest.raises(Question) as asked:
            confirm(order, SETPOINT, level, ("point.f111",), 30.0, 20.0, {})
        params = asked.value.params
        assert (asked.value.reason, params["level"], params["difference"]) == (missing[0], level, 10.0)
        assert (params["old"], params["new"], params["needs_reason"]) == (20.0, 30.0, level >= "C3")
