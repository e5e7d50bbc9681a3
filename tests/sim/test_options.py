"""What a plant file says of a simulated machine, as factories read it."""

from types import SimpleNamespace
from typing import Any

import pytest

from app.errors import ConfigurationError
from app.sim.options import number, table


@pytest.mark.parametrize(("value", "read"), [(3, 3.0), (2.5, 2.5), (-1, -1.0)])
def test_a_number_is_one(value: object, read: float) -> None:
    found = number("x", value)
    assert found == read and isinstance(found, float)


@pytest.mark.parametrize("value", [True, "3", None, [1]])
def test_anything_else_is_named(value: object) -> None:
    with pytest.raises(ConfigurationError, match=r"simulation\.start = .*: expected a number"):
        number("simulation.start", value)


def machine(**options: object) -> Any:
    return SimpleNamespace(options=options)


def test_a_table_is_a_copy_and_one_that_is_not_there_is_empty() -> None:
    given = {"start": "forward"}
    item = machine(simulation=given)
    table(item, "simulation").pop("start")
    assert given == {"start": "forward"} and table(item, "other") == {}


@pytest.mark.parametrize("value", ["forward", 1, ["x"]])
def test_what_is_no_table_is_named(value: object) -> None:
    with pytest.raises(ConfigurationError, match=r"simulation = .*: expected a table"):
        table(machine(simulation=value), "simulation")
