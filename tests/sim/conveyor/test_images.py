"""What the images of the conveyor say."""

import tomllib
from pathlib import Path

import pytest

from app.plant.type_files.repeats import read_repeats, written_out
from app.sim.conveyor import training as own
from app.sim.conveyor.machine import Geometry
from app.sim.conveyor.register_map import (
    ROW,
    places,
)
from app.sim.plc import RegisterPlace
from tests.sim.conveyor.bench import SIMULATION, line


@pytest.mark.parametrize(("belts", "sensors"), [(3, 4), (1, 1), (2, 5), (5, 3), (11, 17), (16, 32)])
def test_registers_agree_with_the_type(belts: int, sensors: int) -> None:
    folder = Path("app/equipment/conveyor")
    device = tomllib.loads((folder / "device.toml").read_text("utf-8"))
    numbers = read_repeats(device, {"belts": belts, "sensors": sensors}).numbers
    data = {
        key: row
        for file in ("points.toml", "setpoints.toml")
        for key, row in written_out(tomllib.loads((folder / file).read_text("utf-8")), numbers).data.items()
    }
    told = {
        key: RegisterPlace(row["address"], row.get("type", "u16"), row.get("shift", 0), row.get("mask", 0))
        for key, row in data.items()
        if "address" in row
    }
    known = places(belts, sensors)
    assert told
    assert {key: known[key] for key in told} == told
    assert {key for key in known if key[-1].isdigit()} <= told.keys()
    columns = tomllib.loads((folder / "tables.toml").read_text("utf-8"))["product"]["columns"]
    assert {key: (row["offset"], row.get("type", "u16")) for key, row in columns.items()} == {
        key: (ROW[key].address, ROW[key].type) for key in columns
    }


async def test_the_configuration_is_that_of_the_preset() -> None:
    for geometry, full in ((Geometry(), 62.83), (SIMULATION, 94.25)):
        status = await line(geometry=geometry).status()
        assert [status[f"sensor_position_{n}"] for n in (1, 2, 3, 4)] == list(geometry.sensors)
        assert [status[f"area_end_{n}"] for n in (1, 2, 3, 4)] == [215.0, 445.0, 560.0, 660.0]
        assert status["pulse_length"] == pytest.approx(geometry.pulse_length)
        assert status["device_intact_is_one"] == geometry.intact_is_one
        assert geometry.full_speed == pytest.approx(full, abs=0.01)
    one, other = await line().get("config_crc"), await line(geometry=SIMULATION).get("config_crc")
    assert one != other and one == await line(seed=7).get("config_crc")


async def test_beams_are_told_alike_whatever_the_wiring() -> None:
    for geometry, free, pressed in ((Geometry(), 0b1111, 0b1010), (SIMULATION, 0, 0b0101)):
        on = line(geometry=geometry)
        on.step()
        assert await on.port.read(0x0105, 2) == [0, free]
        await on.train(own.REG_SENSORS, 0b0101)
        assert await on.port.read(0x0105, 2) == [0b0101, pressed]
        status = await on.status()
        assert (status["beam_1"], status["beam_2"], status["sensors_forced"]) == (1, 0, 1)
