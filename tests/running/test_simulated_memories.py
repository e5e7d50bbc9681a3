"""What a simulated drive has saved outlives the server, what it holds in RAM does not."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from app.errors import StorageError
from app.running.simulated_memories import PREFIX, SimulatedMemories
from app.settings import Settings
from app.sim.sinamics.drive import VirtualSinamics
from tests.sim.sinamics.mailbox_stand import powered
from tests.sim.sinamics.test_permanent import saved
from tests.virtual import house, pass_time
from tests.web.test_encoder_adjustment import plant_with_an_axis

PLACE = "sinamics drives 1"


def drive(browser: Any) -> VirtualSinamics:
    found = browser.app.state.runtime.sim.devices["d1"]
    assert isinstance(found, VirtualSinamics)
    return found


@pytest.mark.sweep(8)
def test_the_rom_outlives_the_server_and_the_ram_does_not(tmp_path: Path) -> None:
    plant, data = plant_with_an_axis(tmp_path), tmp_path / "data"
    with house(Settings(plant=plant, data=data)) as browser:
        pass_time(1)
        it = drive(browser)
        it._value["p2599"], it._value["p2507"] = 12_000.0, 2.0
        pass_time(2)
        assert it.model.values("r2521")[0] == 12_000
        saved(it)
        it._value["p2585"] = -999.0  # in RAM alone
        pass_time(1)
    with house(Settings(plant=plant, data=data)) as browser:
        it = drive(browser)
        assert it.model.values("p2507") == [3] and it.model.values("r2521")[0] == 12_000
        assert it.model.values("p2585") == [-300]
        it._to_initial_state()  # an instructor builds it anew
        pass_time(1)
    with house(Settings(plant=plant, data=data)) as browser:
        assert drive(browser).model.values("p2507") == [1]


class Disk:
    """Retained states without a disk."""

    def __init__(self) -> None:
        self.states: dict[str, Any] = {"m1.running": {"value": 1}}
        self.full = False
        self.writes = 0

    async def read(self) -> dict[str, Any]:
        return dict(self.states)

    async def write(self, states: Mapping[str, Any]) -> None:
        if self.full:
            raise StorageError("full")
        self.states |= states
        self.writes += 1


class Plant:
    """One device."""

    def __init__(self) -> None:
        self.device = powered()

    def permanent(self) -> dict[str, Any]:
        return {PLACE: self.device}


async def test_only_what_was_written_is_kept_and_a_full_disk_is_tried_again() -> None:
    disk, plant = Disk(), Plant()
    memories = SimulatedMemories(disk, lambda: plant)  # type: ignore[arg-type, return-value]
    await memories.read()
    await memories.keep()
    assert memories.found == {} and disk.writes == 0
    memory = saved(plant.device, p2585=-450.0)
    disk.full = True
    with pytest.raises(StorageError):
        await memories.keep()
    disk.full = False
    await memories.keep()
    await memories.keep()
    assert disk.states[PREFIX + PLACE] == memory == memories.found[PLACE] and disk.writes == 1
    plant.device = powered()  # built anew: nothing is saved in it
    await memories.keep()
    assert disk.states[PREFIX + PLACE] == {} and disk.writes == 2
    again = SimulatedMemories(disk, lambda: None)  # type: ignore[arg-type]
    await again.read()
    await again.keep()
    assert again.found == {}
