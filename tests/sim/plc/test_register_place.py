"""Places of the header that every type shows are those where a PLC has these values."""

from struct import pack, unpack

from app.sim.plc.register_place import HEADER_PLACES
from tests.sim.fake_plc import FakePlc
from tests.sim.plc.stand import go


def test_each_place_shows_its_value() -> None:
    plc = FakePlc()
    plc.scan_time.stopwatch = iter([0.0, 0.0005, 1.0, 1.012, 2.0, 2.0001]).__next__
    go(plc, 3)
    found = {}
    for name, place in HEADER_PLACES.items():
        words = plc.read(3, place.address, 2 if place.type == "u32" else 1)
        found[name] = unpack({"u16": ">H", "u32": ">I"}[place.type], pack(f">{len(words)}H", *words))[0]
    assert found.pop("config_crc") == plc._configuration_crc()
    assert found == {"boots": 1, "scan_time": 100, "scan_time_max": 12_000, "overruns": 1}
