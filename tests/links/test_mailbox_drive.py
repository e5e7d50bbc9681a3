"""All parameters of a virtual SINAMICS through its mailbox, over every road, while it runs and is scanned."""

import asyncio
from dataclasses import replace

import pytest

from app.plant.definitions import Equipment
from app.plant.loader import read_plant
from app.profidrive.parameter_access.messages import Address, Failed, Values, Written
from app.settings import bundled
from app.sim.sinamics.drive import VirtualSinamics
from app.sim.training import REG_POWER
from tests.links.devices import until
from tests.links.plc_devices import KINDS, plant
from tests.sim.sinamics.mailbox_stand import PARAMETERS, powered


def machine() -> Equipment:
    found, problems = read_plant(bundled("plants/sinamics"))
    assert found is not None and not problems
    return replace(next(iter(found.equipment.values())), link="hall", unit=1)


def drive() -> VirtualSinamics:
    return powered(start="forward", setpoint=50)  # type: ignore[arg-type]


@pytest.mark.sweep(8)
@pytest.mark.parametrize("kind", KINDS)
async def test_every_parameter_is_read_and_changes_are_saved(kind: str) -> None:
    device, item = drive(), machine()
    async with plant(device, kind, equipment=[item]) as (line, _):  # type: ignore[arg-type]
        await until(lambda: line.link.up)
        box = line.link.parameters(item.id)
        for object in (1, 2):
            there = [one for one in PARAMETERS.values() if object in one.objects]
            told = await box.read(
                object, [Address(one.number, 0, one.count) for one in there], [one.format for one in there]
            )
            for one, result in zip(there, told, strict=True):
                assert isinstance(result, Values) and len(result.values) == one.elements, (one.code, result)
        assert await box.change(2, [(Address(1120), Values(PARAMETERS["p1120"].format, (12.5,)))]) == [Written()]
        assert await box.change(2, [(Address(2000), Values(PARAMETERS["p2000"].format, (900,)))]) == [Failed(0x6B)]
        assert await box.change(1, [(Address(971), Values(PARAMETERS["p0971"].format, (1,)))]) == [Written()]
        for _ in range(20):
            await asyncio.sleep(0.1)
            (saving,) = await box.read(1, [Address(971)])
            if saving == Values(PARAMETERS["p0971"].format, (0,)):
                break
        await line.link.raw_write(1, REG_POWER, [1])
        await until(lambda: device.speed < 1400 and device.read(3, 40110 - 40001, 1)[0] & 0x40)
        (kept,) = await box.read(2, [Address(1120)])
        assert kept == Values(PARAMETERS["p1120"].format, (12.5,))
