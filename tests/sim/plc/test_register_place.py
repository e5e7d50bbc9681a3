"""Places of the header that every type shows are those where a PLC has these values."""

from dataclasses import replace
from struct import pack, unpack

import pytest

from app.links.contract import Block
from app.links.planner import Reading
from app.links.scan_block import ScanBlock
from app.plant import types
from app.plant.definitions import Scan
from app.sim.plc.register_place import HEADER_PLACES
from app.tags.quality import GOOD, OUT_OF_RANGE
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


@pytest.mark.parametrize("kind", ["coil_car", "conveyor", "crane", "sequence"])
def test_a_scan_time_that_its_word_cannot_hold_is_doubtful(kind: str) -> None:
    """The word stays at 65535 then: it says "at least"."""
    plc = FakePlc()
    plc.scan_time.stopwatch = iter([0.0, 0.065534, 1.0, 1.2]).__next__
    points = types.read_type(kind, ("hr", "en", "de", "cs"))[0].type.points
    words = [replace(points[key], name=key) for key in ("scan_time", "scan_time_max")]
    scan = ScanBlock("link.hall", 1, 1, Reading(Block(0x0010, 2), Scan.SLOW, tuple(words)), 1.0)
    scan.bind({"scan_time": 0, "scan_time_max": 1}, 1)
    found = []
    for _ in range(2):
        go(plc, 1)
        told = scan.seen(plc.read(3, 0x0010, 2), 1, GOOD)
        found.append((list(told.values), list(told.qualities or [GOOD, GOOD])))
    assert found == [([65534, 65534], [GOOD, GOOD]), ([65535, 65535], [OUT_OF_RANGE, OUT_OF_RANGE])]
