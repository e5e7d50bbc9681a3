"""Automatic cycles of the crane with faults by seed, through the whole house: each ends in a safe state that has a name."""

from pathlib import Path

import pytest

from tests.crane_shift import shift

EACH = 5
"""Cycles of a seed in `make soak`; with two hundred seeds a thousand."""


@pytest.mark.sweep(20)
@pytest.mark.parametrize(("seed", "carrier"), [(1002, "memory"), pytest.param(1, "tcp", marks=pytest.mark.soak)])
def test_a_cycle_with_faults_ends_in_a_safe_state(seed: int, carrier: str, tmp_path: Path) -> None:
    world = shift(seed, 1, tmp_path, carrier)
    assert world.outcomes.total() == 1 and world.made


@pytest.mark.soak
@pytest.mark.parametrize("seed", range(1000, 1200))
def test_a_thousand_cycles_do_so(seed: int, tmp_path: Path) -> None:
    assert shift(seed, EACH, tmp_path, ("memory", "tcp")[seed % 2]).outcomes.total() == EACH
