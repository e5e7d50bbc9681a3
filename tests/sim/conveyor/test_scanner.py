"""The scanner of a line: what it reads stands in the row of the right product, in the ring, and stays."""

import pytest

from app.plant import types
from app.registers.codec import decode
from app.registers.plc_map import TABLE_HEAD, long_words
from app.sim.conveyor import register_map as map
from app.sim.conveyor.machine import Geometry
from app.sim.conveyor.program import VirtualConveyor
from app.sim.conveyor.register_map import ConveyorEvent
from tests.sim.conveyor.bench import QUICK
from tests.sim.conveyor.layouts import layout
from tests.sim.conveyor.line import TestLine, value


def scanning(sensor: int = 2, geometry: Geometry | None = None, **options: object) -> VirtualConveyor:
    given = {"start": "automatic", "interval": 3.0, "settings": QUICK, "scanner": sensor, "not_read": 0.0, **options}
    return VirtualConveyor(geometry, **given)  # type: ignore[arg-type]


def rows(plc: VirtualConveyor) -> dict[int, dict[str, float]]:
    """Product → its reading, from the registers."""
    head = plc.read(3, map.READINGS, TABLE_HEAD)
    assert head[3] == map.READING_WORDS
    found = {}
    for slot in range(head[2]):
        at = map.READINGS + TABLE_HEAD + slot * map.READING_WORDS
        words = plc.read(3, at, map.READING_WORDS)
        assert words[2] == words[-1] and words[2] % 2 == 0
        cells = {name: value(place, words, 0) for name, place in map.READING.items()}
        if cells["id"]:
            found[int(cells["id"])] = cells
    return found


@pytest.mark.sweep(8)
async def test_what_is_printed_on_each_product_stands_in_its_row_once_it_has_passed_the_scanner() -> None:
    for seed in (1, 2):
        plc = scanning(3, layout(seed, belts=4, sensors=6), seed=seed, slots=30)
        x, checked = plc.geometry.sensors[2], 0
        for scan in range(12_000):
            plc.step()
            if scan % 200:
                continue
            readings = rows(plc)
            true = [product for product in plc.machine.products if product.head > plc.geometry.sensors[0] + 10]
            records = sorted(plc.tracking.products, key=lambda one: -one.right)
            for product, record in zip(true, records, strict=False):
                reading = readings[record.id]
                if product.head < x - 10:
                    assert (reading["state"], reading["order"]) == (0, 0), "nobody has read it yet"
                elif product.head > x + 10:
                    assert (reading["state"], reading["order"]) == (1, product.label.order)
                    assert (reading["category"], round(reading["weight"], 2)) == product.label[1:3]
                    checked += 1
        assert checked > 20


async def test_a_reading_is_told_once_with_order_class_and_weight() -> None:
    line = TestLine(scanning())
    for _ in range(30):
        line.go(1)
        await line.fetch()
    told = [event for event in line.events if event.code == ConveyorEvent.READ]
    assert len(told) > 4 and {event.source for event in told} == {2}
    assert [event.snapshot[1] for event in told] == list(range(1, len(told) + 1)), "each product once, in their order"
    first = told[0]
    orders = [event.snapshot[2] << 16 | event.snapshot[3] for event in told]
    assert orders == sorted(orders) and orders[0] > 24_000_000
    assert 1 <= first.snapshot[4] <= 3 and 0.5 < first.value < 3.0
    assert not [event for event in line.events if event.code == ConveyorEvent.NOT_READ]


@pytest.mark.sweep(8)
async def test_what_cannot_be_read_is_told_and_shown_as_that() -> None:
    line = TestLine(scanning(not_read=40.0))
    states: set[float] = set()
    for _ in range(90):
        line.go(1)
        await line.fetch()
        states |= {row["state"] for row in rows(line.device).values()}
        assert all((row["order"] > 0) == (row["state"] == 1) for row in rows(line.device).values())
    codes = [event.code for event in line.events]
    read, blank = codes.count(ConveyorEvent.READ), codes.count(ConveyorEvent.NOT_READ)
    assert states == {0, 1, 2} and read > 5 and blank > 3
    blanks = [event for event in line.events if event.code == ConveyorEvent.NOT_READ]
    assert all(event.snapshot[2:5] == (0, 0, 0) for event in blanks), "no order is invented"


async def test_readings_outlive_the_supply_and_go_with_their_products() -> None:
    line = TestLine(scanning())
    line.go(25)
    before = {id: row["order"] for id, row in rows(line.device).items() if row["state"]}
    assert before
    await line.train(0xE031, 1)
    line.go(0.5)
    after = rows(line.device)
    assert {id: after[id]["order"] for id in before if id in after} == {
        id: n for id, n in before.items() if id in after
    }
    assert set(line.device.scanner.readings) <= {product.id for product in line.device.tracking.products}


@pytest.mark.sweep(8)
def test_the_same_seed_prints_the_same_labels() -> None:
    def orders(seed: int) -> list[int]:
        plc = scanning(seed=seed)
        for _ in range(3000):
            plc.step()
        return [reading.label.order for reading in plc.scanner.readings.values()]

    assert orders(5) == orders(5) != orders(6)


def test_the_type_has_the_same_cells_at_the_same_words_and_a_line_without_a_scanner_has_no_such_table() -> None:
    data, problems = types.read_type("conveyor", ["en"], given={"scanner": 2})
    assert problems == []
    table = data.type.tables["marking"]
    assert (table.address, table.row, table.since) == (map.READINGS, map.READING_WORDS, 4)
    first = table.address + TABLE_HEAD
    cells = {
        key: (cell.point.register.address - first, cell.point.register.type)
        for key, cell in data.columns["marking"].items()
        if cell.point.register
    }
    assert cells == {key: (place.address, place.type) for key, place in map.READING.items()}
    assert "marking" not in types.read_type("conveyor", ["en"])[0].type.tables
    register = data.type.points["device_scanner"].register
    plc = scanning()
    plc.step()
    assert register and decode(register, plc.read(3, register.address, register.words)) == 2
    assert map.reading_words(7, 24_000_001, 3) == (*long_words(7), *long_words(24_000_001), 3, 0)
