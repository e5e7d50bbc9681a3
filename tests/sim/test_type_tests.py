"""A type whose folder has tests runs them; any other has none."""

import pytest

from app.sim.machines import VIRTUAL_DEVICES
from app.sim.sequence.tests import run_tests
from app.sim.type_tests import tests_of as runner_of


@pytest.mark.parametrize("kind", [*VIRTUAL_DEVICES, "nothing", "plc"])
def test_only_a_sequence_has_tests(kind: str) -> None:
    assert runner_of(kind) is (run_tests if kind == "sequence" else None)
