"""The machines on a link by name, and by unit."""

import pytest

from app.errors import LinkError
from app.links.machines import Machines, by_unit, wiring
from tests.links.devices import QUICK, row


def test_what_is_not_there_is_an_error_that_says_what_is() -> None:
    machines = Machines("hall", [row("m1", 1, 2), row("m2", 2, 1)])
    assert machines.get("m3") is None and machines.named("m2").unit == 2
    with pytest.raises(LinkError, match=r"link hall: no equipment m3, expected one of \['m1', 'm2'\]"):
        machines.named("m3")
    assert machines.point(machines.named("m1"), "v1").name == "m1.v1"
    with pytest.raises(LinkError, match="m1 has no point v9"):
        machines.point(machines.named("m1"), "v9")


def test_others_take_the_place_of_those_that_were_there() -> None:
    machines = Machines("hall", [row("m1", 1, 2)])
    machines.take([row("m3", 3, 1), row("m2", 2, 1)])
    assert [item.id for item in machines.all] == ["m3", "m2"]
    assert machines.get("m1") is None


def test_units_come_in_their_order_and_machines_of_one_unit_in_that_of_the_plant_file() -> None:
    found = by_unit([row("b", 5, 1), row("c", 2, 1), row("a", 5, 1)])
    assert {unit: [item.id for item in items] for unit, items in found.items()} == {2: ["c"], 5: ["b", "a"]}
    assert list(found) == [2, 5]


def test_a_unit_is_read_as_before_only_when_points_and_device_are_the_same() -> None:
    same = wiring([row("m1", 1, 2, QUICK)])
    assert wiring([row("m1", 1, 2, QUICK)]) == same
    for other in (row("m1", 1, 3, QUICK), row("m2", 1, 2, QUICK), row("m1", 1, 2), row("m1", 1, 2, QUICK, scale=0.1)):
        assert wiring([other]) != same
