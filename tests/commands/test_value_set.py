"""In which order values of a set go, which go together, and what stands where: over every order and every step."""

from dataclasses import replace
from itertools import permutations, product

import pytest

from app.commands import interlocks, value_set
from app.commands.interlocks import Prepared, RefusalReason
from app.commands.value_set import Change, Stands
from app.plant.definitions import Condition, EquipmentType
from app.tags.quality import GOOD
from tests.commands.stand import demo_plant

ITEM = demo_plant().equipment["m1"]
PARTS = {key: interlocks.prepare(ITEM, interlocks.setting(ITEM, one)) for key, one in ITEM.type.setpoints.items()}
KEYS = ("f112", "frequency_setpoint", "f111")
LEVELS = (5.0, 20.0, 40.0, 60.0)
SORTED = [one for one in product(LEVELS, repeat=3) if one[0] <= one[1] <= one[2]]


def kind(*checks: str) -> EquipmentType:
    return replace(ITEM.type, checks=[Condition(text, text, text) for text in checks])


def steps(
    of: EquipmentType, now: dict[str, float], values: dict[str, float], groups: list[list[str]]
) -> tuple[tuple[str, ...], ...] | RefusalReason:
    parts: list[Prepared] = [PARTS[key] for key in values]
    return value_set.steps(of, parts, groups, values, lambda key: (now[key], GOOD))


@pytest.mark.parametrize("order", list(permutations(KEYS)))
def test_from_every_three_to_every_three_there_is_an_order_that_keeps_the_limits(order: tuple[str, ...]) -> None:
    for before, after in product(SORTED, SORTED):
        now, wanted = dict(zip(KEYS, before, strict=True)), dict(zip(KEYS, after, strict=True))
        found = steps(ITEM.type, now, {key: wanted[key] for key in order}, [[key] for key in order])
        assert not isinstance(found, RefusalReason), (before, after)
        held = dict(now)
        for (key,) in found:
            held[key] = wanted[key]
            assert held["f112"] <= held["frequency_setpoint"] <= held["f111"], (before, after, found)
        assert held == wanted


def test_where_no_order_keeps_a_check_the_set_is_refused_but_taken_at_once_it_is_not() -> None:
    tied = kind("f114 == f115")
    now, wanted = {"f114": 5.0, "f115": 5.0}, {"f114": 6.0, "f115": 6.0}
    refused = steps(tied, now, wanted, [["f114"], ["f115"]])
    assert isinstance(refused, RefusalReason) and (refused.key, refused.label) == ("why.set_order", "point.f114")
    assert steps(tied, now, wanted, [["f114", "f115"]]) == (("f114", "f115"),)


def test_a_check_that_is_broken_already_does_not_keep_a_set_from_mending_it() -> None:
    tied = kind("f114 == f115")
    assert steps(tied, {"f114": 5.0, "f115": 7.0}, {"f114": 6.0, "f115": 6.0}, [["f114"], ["f115"]]) == (
        ("f114",), ("f115",),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("values", "known", "broken"),
    [
        ({"f114": 6.0}, True, True),
        ({"f114": 6.0, "f115": 6.0}, True, False),
        ({"f116": 6.0}, True, False),
        ({"f114": 5.0}, False, True),
        ({"f114": 5.0, "f115": 5.0}, False, False),
    ],
)
def test_a_check_over_a_value_must_be_known_to_hold(values: dict[str, float], known: bool, broken: bool) -> None:
    found = value_set.broken(kind("f114 == f115"), values, lambda key: (5.0 if known else None, GOOD))
    assert (found is not None) is broken


@pytest.mark.parametrize(
    ("found", "stands"),
    [(6.0, Stands.NEW), (5.0, Stands.OLD), (5.5, Stands.OTHER), (None, Stands.UNKNOWN), (6.04, Stands.NEW)],
)
def test_what_is_found_is_told_apart(found: float | None, stands: Stands) -> None:
    change = Change("f114", "F114", "point.f114", 5.0, 6.0, "s", 1)
    judged = value_set.judged(change, PARTS["f114"], found)
    assert (judged.stands, judged.found) == (stands, found)
    assert value_set.found_text([judged]) == f"F114 = {'?' if found is None else f'{found:g}'} ({stands})"
    assert "".join(value_set.found_texts([judged])).endswith(f"(@set.{stands})")


def test_a_set_needs_what_its_parts_need() -> None:
    joined = value_set.joined([PARTS["frequency_setpoint"], PARTS["f106"], PARTS["f114"]])
    assert joined.roles == ("operator", "engineer")
    assert joined.command.level == "C2" and "stopped" in [one.key for one in joined.permissives]
    assert {"f111", "f112", "f106"} <= set(joined.used)
