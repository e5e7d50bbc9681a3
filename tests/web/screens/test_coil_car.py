"""The page of a coil car: what looks missing there is wrong with the machine, and no part of its normal running."""

import re
from pathlib import Path

import pytest

from app.sim.training import REG_MACHINE_FAULT
from tests import coil_plant
from tests.virtual import until
from tests.web.conftest import Start
from tests.web.operating import runtime_of

UNSUPPORTED, STOPPED = 15, 1
"""Why the mandrel may not collapse: no car carries the coil on it; the emergency stop is pressed."""
EMERGENCY_STOP = 50


@pytest.mark.sweep(8)
def test_what_holds_a_movement_in_normal_running_does_not_look_missing(start: Start, tmp_path: Path) -> None:
    client = start(plant=coil_plant.write(tmp_path / "plant"))
    runtime = runtime_of(client)

    def missing(because: int) -> set[str]:
        assert until(lambda: runtime.tags.sample("cc1.block_collapse").value == because)
        return set(re.findall(r'<li data-tag="cc1\.(\w+)"[^>]*class="cc-no"', client.get("/equipment/cc1").text))

    assert missing(UNSUPPORTED) == set()
    runtime.sim.devices["cc1"].write(6, REG_MACHINE_FAULT, [EMERGENCY_STOP])
    assert missing(STOPPED) >= {"emergency_stop", "block_forward", "block_collapse"}
