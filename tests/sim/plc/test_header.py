"""The header of a PLC: who it is, its time, its check sum."""

from struct import pack
from zlib import crc32

from app.registers import plc_map
from app.registers.plc_map import time_of
from tests.sim.fake_plc import FakePlc
from tests.sim.plc.stand import go


def test_the_header_says_what_it_is() -> None:
    plc = FakePlc()
    go(plc, 3)
    header = plc.read(3, 0, 32)
    assert header[:4] == [plc_map.MAGIC, plc_map.MAJOR, plc_map.MINOR, 99]
    configuration = plc.read(3, 0x0180, 4)
    assert header[4] << 16 | header[5] == crc32(pack(">2H", *configuration[1:3]))
    assert header[6:9] == [plc_map.SIMULATED | plc_map.WRITABLE, 1, 3]
    assert time_of(header[11:15]) == 30_000
    assert header[15:19] == [0, 0, 0, 0]
    assert time_of(header[19:23]) == 3
    assert header[23:] == [7, 0, 0, 0, 0, 0, 0, 0, 0]
