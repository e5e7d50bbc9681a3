"""How a drive is commissioned from a plant file."""

import re

import pytest

from app.errors import ConfigurationError
from app.sim.sinamics.parameters import DEFAULTS, commissioned
from app.sim.sinamics.registers import REGISTERS


@pytest.mark.parametrize("code", DEFAULTS)
def test_each_parameter_is_taken_at_its_edges_and_refused_beyond(code: str) -> None:
    default, low, high = DEFAULTS[code]
    assert commissioned(15, {})[code] == default
    for value in (low, high):
        assert commissioned(15, {code: value})[code] == value
    for value in (low - 1, high + 1, float("nan"), float("inf")):
        with pytest.raises(ConfigurationError, match=re.escape(f"{code} takes {low} to {high}, not {value}")):
            commissioned(15, {code: value})


def test_an_unknown_code_is_told_what_there_is() -> None:
    with pytest.raises(ConfigurationError, match="p9999: expected one of p0346"):
        commissioned(15, {"p9999": 1})


@pytest.mark.parametrize(("rated", "limit"), [(1, 10.0), (15, 22.5), (100, 150.0), (400, 400.0)])
def test_the_current_limit_is_one_and_a_half_of_the_motor_within_its_register(rated: float, limit: float) -> None:
    assert commissioned(rated, {})["p0640"] == limit


def test_the_greatest_speed_follows_the_reference_speed_unless_it_is_given() -> None:
    assert commissioned(15, {"p2000": 3000})["p1082"] == 3000
    assert commissioned(15, {"p2000": 3000, "p1082": 1200})["p1082"] == 1200


def test_every_writable_register_has_a_value_that_it_can_hold() -> None:
    values = commissioned(15, {})
    for register in REGISTERS.values():
        if register.writable:
            assert register.low <= values[register.parameter] <= register.high
