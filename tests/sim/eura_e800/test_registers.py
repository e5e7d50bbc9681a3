"""The register table of the virtual drive is what it serves."""

from app.sim.eura_e800.parameters import PARAMETERS
from app.sim.eura_e800.registers import REGISTERS
from tests.sim.eura_e800.stand import (
    drive,
    image,
)


def test_every_table_row_is_readable() -> None:
    device = drive()
    assert list(REGISTERS) == list(range(0x1000, 0x1019))
    assert image(device) == [device.read(3, address, 1)[0] for address in REGISTERS]
    for parameter in PARAMETERS.values():
        raw = device.read(3, parameter.address, 1)[0]
        assert parameter.decode(raw) == device.parameter(parameter.code)
