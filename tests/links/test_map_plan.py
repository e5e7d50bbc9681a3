"""The reads of a Pogon PLC: every image is one telegram, no row is cut."""

from dataclasses import replace

from app.links.map_plan import plan_map
from app.links.planner import NETWORK_OVERHEAD, Part, Rows
from app.plant.definitions import Scan
from app.registers import plc_map
from tests.links.plc_devices import (
    CONFIGURATION,
    DEVICE,
    MAP,
    ROWS,
    SETTINGS,
    SETTINGS_WORDS,
    STATUS,
    STATUS_WORDS,
    TABLE,
    small,
)


def test_every_image_is_one_read_and_no_row_is_cut() -> None:
    readings = plan_map([small()], DEVICE, MAP, NETWORK_OVERHEAD).readings
    blocks = {(r.block.address, r.block.count): r for r in readings}
    assert blocks[(0, 32)].part is Part.HEADER and blocks[(0, 32)].scan is Scan.SLOW
    assert blocks[(STATUS, STATUS_WORDS)].scan is Scan.FAST
    assert blocks[(CONFIGURATION, 6)].scan is Scan.ONCE
    assert blocks[(SETTINGS, SETTINGS_WORDS)].scan is Scan.SLOW
    assert blocks[(plc_map.EVENTS, plc_map.EVENTS_WORDS)].part is Part.RING
    rows = [r for r in readings if isinstance(r.part, Rows)]
    assert [(r.block.address, r.block.count) for r in rows] == [
        (TABLE, 4 + 15 * 8),
        (TABLE + 4 + 15 * 8, 15 * 8),
        (TABLE + 4 + 30 * 8, 10 * 8),
    ]
    seldom = replace(small(), type=replace(small().type, tables={"thing": replace(ROWS, scan=Scan.SLOW)}))
    slow = [r.scan for r in plan_map([seldom], DEVICE, MAP, NETWORK_OVERHEAD).readings if isinstance(r.part, Rows)]
    assert [r.scan for r in rows] == 3 * [Scan.FAST] and slow == 3 * [Scan.SLOW]
    placed = [p.name for r in readings for p in r.points]
    assert sorted(placed) == sorted(p.name for p in small().points.values())
    assert readings[0].part is Part.HEADER, "a silent unit is asked for its first word"
