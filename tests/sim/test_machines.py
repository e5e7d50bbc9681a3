"""Every machine that can be simulated is a folder, and what it says of itself holds."""

import subprocess
import sys
from pathlib import Path

import pytest

from app.errors import DeviceException
from app.plant.loader import read_plant
from app.settings import Settings
from app.sim.device import VirtualDevice
from app.sim.machines import MACHINE_FAULTS, VIRTUAL_DEVICES
from app.sim.training import REG_MACHINE_FAULT
from tests.conftest import ROOT

PLANT, _ = read_plant(Settings().plant)
MACHINES = {item.type.name: item for item in (PLANT.equipment.values() if PLANT else ())}


def test_every_type_of_the_demo_plant_can_be_simulated() -> None:
    assert set(MACHINES) <= set(VIRTUAL_DEVICES)
    assert set(MACHINE_FAULTS) == set(VIRTUAL_DEVICES)


@pytest.mark.parametrize("kind", MACHINES)
def test_it_takes_each_fault_that_it_names(kind: str) -> None:
    device: VirtualDevice = VIRTUAL_DEVICES[kind](MACHINES[kind], 1)
    assert device.type == kind and MACHINE_FAULTS[kind]
    for code in (*MACHINE_FAULTS[kind], 0):
        device.write(6, REG_MACHINE_FAULT, [code])
        device.step()
        assert device.read(3, REG_MACHINE_FAULT, 1) == [code]


@pytest.mark.parametrize("address", [0x0000, 0x1000, 0x2000, 0x3000, 40100, 0xE010])
@pytest.mark.parametrize("kind", MACHINES)
def test_masks_that_its_device_does_not_know_change_nothing(kind: str, address: int) -> None:
    device: VirtualDevice = VIRTUAL_DEVICES[kind](MACHINES[kind], 1)
    assert 22 not in MACHINES[kind].type.device.write_functions
    with pytest.raises(DeviceException) as refused:
        device.write(22, address, [0, 1])
    assert refused.value.code == 1


@pytest.mark.parametrize("kind", MACHINES)
def test_the_seed_decides_and_nothing_else(kind: str) -> None:
    def run(seed: int) -> list[list[int]]:
        device = VIRTUAL_DEVICES[kind](MACHINES[kind], seed)
        words = []
        for _ in range(20):
            device.step()
            words.append(device.read(3, 0xE000, 5))
        return words

    assert run(4) == run(4)


@pytest.mark.real_time
def test_a_machine_that_takes_no_fault_names_none(tmp_path: Path) -> None:
    (tmp_path / "scale").mkdir()
    (tmp_path / "scale" / "__init__.py").write_text("def build(item, seed): ...\n", "utf-8")
    asked = f"""
import app.sim
app.sim.__path__.append({str(tmp_path)!r})
from app.sim.machines import MACHINE_FAULTS, VIRTUAL_DEVICES
print("scale" in VIRTUAL_DEVICES, MACHINE_FAULTS["scale"])
"""
    done = subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True, cwd=ROOT, timeout=60)
    assert (done.stdout, done.stderr) == ("True ()\n", "")
