"""SEL_5R: who sets the speed."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.blocks.speed_selector import SEL_5R, SpeedSelector

VALUES = (0.0, 30.0, 10.0, -10.0, 5.0)


def on(*numbers: int) -> list[bool]:
    return [number in numbers for number in range(1, 6)]


def test_none_active_gives_the_default() -> None:
    assert SEL_5R().step(on(), VALUES, 7.0) == (7.0, 0)


def test_first_active_holds_until_released() -> None:
    selector = SpeedSelector(first_wins=False)
    assert selector.step(on(3), VALUES) == (10.0, 3)
    assert selector.step(on(2, 3, 5), VALUES) == (10.0, 3)
    assert selector.step(on(1, 3), VALUES) == (10.0, 3)
    assert selector.step(on(2, 5), VALUES) == (30.0, 2)
    assert selector.step(on(), VALUES, 1.0) == (1.0, 0)


def test_sel1_wins_always_with_sel1hp() -> None:
    selector = SpeedSelector(first_wins=True)
    assert selector.step(on(2), VALUES) == (30.0, 2)
    assert selector.step(on(1, 2), VALUES) == (0.0, 1)
    assert selector.step(on(1), VALUES) == (0.0, 1)
    assert selector.step(on(), VALUES, 9.0) == (9.0, 0)


def test_what_sel1_overrode_holds_again_afterwards() -> None:
    selector = SpeedSelector()
    selector.step(on(4), VALUES)
    selector.step(on(1, 2, 4), VALUES)
    assert selector.step(on(2, 4), VALUES) == (-10.0, 4)


def test_of_several_at_once_the_lowest_number() -> None:
    assert SpeedSelector(first_wins=False).step(on(5, 2, 4), VALUES).selection == 2


def test_value_follows_while_held() -> None:
    selector = SpeedSelector()
    selector.step(on(2), VALUES)
    assert selector.step(on(2), (0.0, 55.0, 0.0, 0.0, 0.0)) == (55.0, 2)


@given(st.booleans(), st.lists(st.tuples(*[st.booleans()] * 5), max_size=40))
def test_what_counts_is_always_active_or_the_default(hp: bool, cycles: list[tuple[bool, ...]]) -> None:
    selector = SpeedSelector(first_wins=hp)
    before = 0
    for active in cycles:
        value, number = selector.step(active, VALUES, 99.0)
        assert (number == 0) == (not any(active))
        assert value == (VALUES[number - 1] if number else 99.0)
        assert not number or active[number - 1]
        if hp and active[0]:
            assert number == 1
        elif not hp and before and active[before - 1]:
            assert number == before
        before = number


def test_five_of_each_are_expected() -> None:
    with pytest.raises(ValueError, match="4 selections"):
        SpeedSelector().step([True] * 4, VALUES)
