"""The reads of a Pogon PLC: header, images, ring and tables, each cut where the device swaps it and nowhere else.

One image is one telegram even where two would cost less, and a row is never cut. What lies in none of them is planned as plain registers.
"""

from collections.abc import Iterable, Sequence

from app.links.contract import Block
from app.links.planner import Learned, Part, Plan, Reading, Rows, limit_of, plan, span_of
from app.plant.definitions import Device, Equipment, Image, PlcMap, Point, Scan
from app.registers.plc_map import (
    AT_TIME_QUALITY,
    EVENTS,
    EVENTS_WORDS,
    HEADER,
    HEADER_WORDS,
    TABLE_HEAD,
)

_ORDER = tuple(Scan)


def plan_map(
    equipment: Sequence[Equipment], device: Device, map: PlcMap, cost: float, learned: Learned | None = None
) -> Plan:
    """The reads of one unit. The header comes first: its first word is what a silent unit is asked for."""
    learned = learned or Learned()
    fast, slow = limit_of(device, Scan.FAST, learned), limit_of(device, Scan.SLOW, learned)
    rest = [point for item in equipment for point in item.points.values()]
    unreadable: list[Point] = []

    header = max(min(HEADER_WORDS, slow), AT_TIME_QUALITY + 1)
    inside, rest = _inside(rest, HEADER, header)
    cuts = _cuts(inside, HEADER, header)
    readings = [Reading(Block(HEADER, header, cuts=cuts), _fastest(inside, Scan.SLOW), inside, Part.HEADER)]

    for image in (*map.images, *((map.settings,) if map.settings else ())):
        inside, rest = _inside(rest, image.address, image.words)
        if inside and image.words > limit_of(device, _fastest(inside), learned):
            unreadable += inside
        elif inside:
            readings.append(_image(image, inside))
    if map.events:
        inside, rest = _inside(rest, EVENTS, EVENTS_WORDS)
        readings.append(Reading(Block(EVENTS, EVENTS_WORDS, again=True), Scan.FAST, inside, Part.RING))
    for item in equipment:
        for key, slots in item.tables.items():
            table = item.type.tables[key]
            words = TABLE_HEAD + slots * table.row
            cells, rest = _inside(rest, table.address, words)
            most = fast if table.scan is Scan.FAST else slow
            if TABLE_HEAD + table.row > most:
                unreadable += cells
                continue
            first, others = 0, list(cells)
            while first < slots:
                head = TABLE_HEAD if first == 0 else 0
                rows = Rows(item.id, table, slots, first, min((most - head) // table.row, slots - first))
                begin = table.address + TABLE_HEAD - head + first * table.row
                count = head + rows.rows * table.row
                cells, others = _inside(others, begin, count)
                cuts = tuple(head + row * table.row for row in range(rows.rows) if head + row)
                readings.append(Reading(Block(begin, count, cuts=cuts, again=True), table.scan, cells, rows))
                first += rows.rows
            rest += others
    plain = plan(rest, device, cost, learned)
    return Plan((*readings, *plain.readings), (*unreadable, *plain.unreadable))


def _image(image: Image, points: Sequence[Point]) -> Reading:
    return Reading(Block(image.address, image.words, again=True), _fastest(points), tuple(points), Part.IMAGE)


def _inside(points: Iterable[Point], address: int, words: int) -> tuple[tuple[Point, ...], list[Point]]:
    """Readable points whose registers lie all in the range, and the other points."""
    inside: list[Point] = []
    others: list[Point] = []
    for point in points:
        register = point.register
        if register is None or not register.readable or register.table != "holding":
            others.append(point)
            continue
        first, last = span_of(register)
        (inside if address <= first and last < address + words else others).append(point)
    return tuple(inside), others


def _fastest(points: Iterable[Point], default: Scan = Scan.ONCE) -> Scan:
    return min((default, *(point.scan for point in points)), key=_ORDER.index)


def _cuts(points: Iterable[Point], address: int, words: int) -> tuple[int, ...]:
    """Where plain registers may be read in two telegrams without tearing a value."""
    torn = {at for p in points if p.register for at in range(p.register.address + 1, span_of(p.register)[1] + 1)}
    return tuple(at for at in range(1, words) if address + at not in torn)
