"""Places of machines in the picture of a plant: nobody is lost, nobody covers another, flow goes to the right."""

import itertools

import pytest

from app.plant.picture import MOST_COLUMNS, arrange


def test_a_plant_without_flow_stands_in_rows_in_its_order() -> None:
    picture = arrange(["a", "b", "c", "d"], [])
    assert (picture.columns, list(picture.cells)) == (3, ["a", "b", "c", "d", "", ""])
    assert not picture.lines and not picture.entries
    assert arrange([], []).rows == 0


def test_flow_goes_to_the_right_and_what_is_loose_fills_what_is_empty() -> None:
    picture = arrange(["m1", "cc", "seq"], [("seq", "cc")])
    assert list(picture.cells) == ["seq", "cc", "m1"]
    assert picture.lines == {("seq", "cc"): "M50 50L150 50"}
    assert picture.entries == {"cc": {"left"}}


def test_two_ways_that_meet_stand_below_one_another() -> None:
    picture = arrange(["a", "b", "c"], [("a", "c"), ("b", "c")])
    assert list(picture.cells) == ["a", "c", "", "b", "", ""]
    assert picture.lines["b", "c"] == "M50 150H100V50H150"


def test_a_circle_leads_back() -> None:
    picture = arrange(["a", "b", "c"], [("a", "b"), ("b", "c"), ("c", "a")])
    assert list(picture.cells) == ["a", "b", "c"]
    assert picture.entries["a"] == {"right"}


def test_a_pair_with_somebody_else_or_with_itself_does_not_count() -> None:
    assert not arrange(["a", "b"], [("a", "x"), ("a", "a")]).lines


@pytest.mark.parametrize("count", range(1, 7))
def test_everybody_has_a_place_of_their_own_whatever_leads_where(count: int) -> None:
    machines = [f"m{n}" for n in range(count)]
    every = list(itertools.combinations(machines, 2))
    for chosen in range(min(2 ** len(every), 512)):
        pairs = [pair for at, pair in enumerate(every) if chosen >> at & 1]
        picture = arrange(machines, pairs)
        assert sorted(filter(None, picture.cells)) == machines
        assert len(picture.cells) == picture.columns * picture.rows
        column = {id: at % picture.columns for at, id in enumerate(picture.cells)}
        assert all(column[a] < column[b] for a, b in pairs)


def test_a_long_way_keeps_within_the_columns() -> None:
    machines = [f"m{n:02}" for n in range(20)]
    picture = arrange(machines, itertools.pairwise(machines))
    assert picture.columns == MOST_COLUMNS and sorted(filter(None, picture.cells)) == machines
