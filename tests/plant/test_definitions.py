"""What the definitions of a plant say of themselves."""

from dataclasses import replace

import pytest

from app.plant.definitions import Link
from app.plant.loader import read_plant
from tests.conftest import ROOT

PLANT, _ = read_plant(ROOT / "plants" / "demo")


@pytest.mark.parametrize(
    ("transport", "writes", "simulated", "may_write"),
    [
        ("memory", None, True, True),
        ("memory", False, True, False),
        ("tcp", None, False, False),
        ("tcp", True, False, True),
        ("rtu", None, False, False),
        ("rtu", False, False, False),
    ],
)
@pytest.mark.parametrize("believe", [False, True])
def test_a_link_is_written_to_when_the_file_says_so_or_nothing_is_behind_it(
    transport: str, writes: bool | None, simulated: bool, may_write: bool, believe: bool
) -> None:
    link = Link("hall", transport, writes=writes, believe_simulated=believe)
    assert (link.simulated, link.may_write) == (simulated, may_write)


def test_a_plant_knows_its_points_by_name_and_its_machines_by_link() -> None:
    assert PLANT is not None
    assert all(point.name == name and name.startswith(point.equipment + ".") for name, point in PLANT.points.items())
    assert sorted(item.id for name in PLANT.links for item in PLANT.on_link(name)) == sorted(PLANT.equipment)
    assert PLANT.on_link("nowhere") == []


def test_a_plant_keeps_the_kinds_of_records_of_the_machines_that_it_has() -> None:
    assert PLANT is not None
    assert {"passage", "run", "force", "coil"} <= set(PLANT.records)
    drives = {id: item for id, item in PLANT.equipment.items() if item.type.name == "eura_e800"}
    assert replace(PLANT, equipment=drives).records == {}


def test_a_renamed_machine_keeps_its_first_name_for_what_lasts() -> None:
    assert PLANT is not None
    machine = next(iter(PLANT.equipment.values()))
    assert machine.lasting == machine.id and replace(machine, was="old").lasting == "old"
