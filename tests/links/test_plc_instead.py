"""A Pogon PLC at the address of a drive: nothing of it is shown as the drive's, until the drive is there."""

import pytest

from app.errors import LinkError
from app.links.statistics import LinkState
from app.plant.definitions import Device
from app.plant.types import read_type
from app.registers import plc_map
from app.sim.bus import Answer, Bus
from app.tags.quality import CONFIGURATION, is_good
from tests.links.devices import SIMULATED, RegisterDevice, row, until
from tests.links.plc_devices import SmallPlc
from tests.links.test_outages import KINDS, line
from tests.plant.test_conditions import TYPES

DRIVE = Device(timeout=0.25, fast=0.1, makers_map=True)
OTHER = {n: n for n in range(0x20, 0x40)}
HEADER = (plc_map.MAGIC, plc_map.MAJOR, plc_map.MINOR, 77)


def test_every_type_of_ours_has_the_header_or_says_that_it_has_none() -> None:
    for name in TYPES:
        device = read_type(name, ("en",))[0].type.device
        assert device.makers_map is (device.plc is None), name


@pytest.mark.parametrize("kind", KINDS)
async def test_its_values_are_no_values_of_the_drive(kind: str, caplog: pytest.LogCaptureFixture) -> None:
    bus = Bus({1: SmallPlc()})
    async with line(kind, bus, equipment=[row("m", 1, 4, DRIVE)]) as made:
        await until(lambda: made.quality("m.v0") & ~SIMULATED == CONFIGURATION)
        await until(lambda: made.link.statistics.state is LinkState.CONFIGURATION)
        with pytest.raises(LinkError):
            await made.link.write("m", "v3", 1)
        told = [record.getMessage() for record in caplog.records if "Pogon PLC" in record.getMessage()]
        assert told == [
            "device is not that of the plant file link=hall unit=1: a Pogon PLC of type 77 answers, expected plc"
        ]
        bus.devices[1] = RegisterDevice({n: 7 for n in range(4)})
        await until(lambda: made.value("m.v0") == 7 and is_good(made.quality("m.v0")), 2.0)


@pytest.mark.parametrize(("at", "word"), [(0, 0x5048), (1, plc_map.MAJOR + 1)])
async def test_what_only_looks_a_little_like_one_is_read(at: int, word: int) -> None:
    words = dict(enumerate(HEADER)) | {at: word}
    async with line("tcp", Bus({1: RegisterDevice(words)}), equipment=[row("m", 1, 4, DRIVE)]) as made:
        await until(lambda: is_good(made.quality("m.v0")))


async def test_a_type_that_does_not_say_so_may_read_a_plc_by_points_of_its_own() -> None:
    device = Device(timeout=0.25, fast=0.1)
    async with line(
        "tcp", Bus({1: RegisterDevice(dict(enumerate(HEADER)))}), equipment=[row("m", 1, 4, device)]
    ) as made:
        await until(lambda: is_good(made.quality("m.v0")) and made.value("m.v0") == plc_map.MAGIC)


async def test_a_drive_that_is_silent_there_is_asked_once_and_read() -> None:
    asked = 0

    class Terse(Bus):
        def answer(self, unit: int, pdu: bytes) -> Answer:
            nonlocal asked
            if pdu[1:5] == bytes((0, 0, 0, 4)):
                asked += 1
                return Answer(unit, None)
            return super().answer(unit, pdu)

    bus = Terse({1: RegisterDevice({n: 7 for n in range(6)})})
    async with line("tcp", bus, equipment=[row("m", 1, 6, DRIVE)]) as made:
        await until(lambda: is_good(made.quality("m.v0")), 2.0)
        bus.devices.clear()
        await until(lambda: not is_good(made.quality("m.v0")))
        bus.devices[1] = RegisterDevice({n: 8 for n in range(6)})
        await until(lambda: is_good(made.quality("m.v0")) and made.value("m.v0") == 8, 2.0)
        assert asked == 1
