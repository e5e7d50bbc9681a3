"""The virtual conveyor and the type's data were each written from the manual: here they are laid side by side, word by word."""

import math
from collections.abc import Mapping, Sequence

import pytest

from app.blocks import product_tracking as tracking
from app.blocks.mode_control import Mode
from app.plant import types
from app.plant.definitions import EquipmentType
from app.plant.plant_files.languages import LANGUAGES
from app.registers import plc_map
from app.registers.codec import Value, decode
from app.sim.conveyor import register_map as conveyor
from app.sim.conveyor.program import VirtualConveyor
from app.sim.conveyor.register_map import SETTINGS

_data, _problems = types.read_type("conveyor", LANGUAGES)
ONLY_THERE = {
    "buffer_alarm": "bit 8 of the alarm word says once more what `buffer_full` says",
}
"""Places that the data have no point for, and why."""


def line() -> EquipmentType:
    assert _problems == []
    return _data.type


def read(plc: VirtualConveyor, address: int, words: int) -> list[int]:
    return plc.read(3, address, words)


def value(plc: VirtualConveyor, kind: EquipmentType, key: str) -> Value:
    register = kind.points[key].register
    assert register
    return decode(register, read(plc, register.address, register.words))


def test_each_knows_what_the_other_knows_at_the_same_place() -> None:
    kind = line()
    mine = {key: point.register for key, point in kind.points.items() if point.register}
    heads = {f"{table}_{name}" for table in kind.tables for name in ("generation", "capacity", "count")}
    assert set(conveyor.REGISTERS) - set(mine) == set(ONLY_THERE)
    assert set(mine) - set(conveyor.REGISTERS) == heads
    for key in set(mine) & set(conveyor.REGISTERS):
        register, place = mine[key], conveyor.REGISTERS[key]
        assert register
        assert (register.address, register.type, register.shift, register.mask or 0) == (
            place.address,
            place.type,
            place.shift,
            place.mask,
        ), key
        assert (register.scale, register.offset, register.order) == (1, 0, "abcd"), key


@pytest.mark.parametrize(("table", "cells"), [("product", conveyor.ROW), ("ramp", conveyor.RAMP)])
def test_a_row_has_the_same_cells_at_the_same_words(table: str, cells: Mapping[str, conveyor.RegisterPlace]) -> None:
    first = line().tables[table].address + plc_map.TABLE_HEAD
    mine = {key: cell.point.register for key, cell in _data.columns[table].items()}
    assert set(mine) == set(cells)
    for key, register in mine.items():
        place = cells[key]
        assert register
        assert (register.address - first, register.type, register.mask or 0) == (place.address, place.type, place.mask)
        assert register.scale == (0.001 if key == "age" else 1), f"{key}: only the age is told in ms and shown in s"


def test_a_product_reads_as_it_is() -> None:
    """The row is packed in one go, so what is read from a row that holds a product must be that product."""
    plc = VirtualConveyor(arrivals=False)
    plc.step()
    arguments = (plc_map.real(300.0), plc_map.real(40.0))
    plc.write(16, plc_map.COMMAND, plc_map.request_words(plc_map.Request(8, arguments=arguments, id=1)))
    plc.step()
    kind = line()
    table = kind.tables["product"]
    head = read(plc, table.address, plc_map.TABLE_HEAD)
    assert (head[1], head[2], head[3]) == (20, 1, table.row)
    row = read(plc, table.address + plc_map.TABLE_HEAD, table.row)
    assert row[2] == row[-1] and row[2] % 2 == 0
    cells = {}
    for key, cell in _data.columns["product"].items():
        register = cell.point.register
        assert register
        at = register.address - table.address - plc_map.TABLE_HEAD
        cells[key] = decode(register, row[at : at + register.words])
    assert (cells["id"], cells["head"], cells["tail"], cells["length"], cells["area"]) == (1, 300.0, 260.0, 40.0, 2)
    assert (cells["corrected_at"], cells["direction"], cells["displacement"]) == (0, 0, 0.0)
    assert isinstance(cells["entered"], int) and 0 < cells["entered"] <= 20_000


def test_images_and_settings_lie_where_the_type_says() -> None:
    plc, plc_of = VirtualConveyor(arrivals=False), line().device.plc
    assert plc_of and plc_of.settings
    plc.step()
    for image in (*plc_of.images, plc_of.settings):
        words = read(plc, image.address, image.words)
        assert plc_map.is_whole(words), f"0x{image.address:04X}"
    assert plc.read(3, plc_map.AT_TYPE, 1) == [plc_of.type_code]
    assert read(plc, plc_of.settings.address + 1, 1) == [len(SETTINGS)]


def test_settings_have_the_same_names_order_defaults_and_limits() -> None:
    kind = line()
    assert list(kind.setpoints) == [setting.name for setting in SETTINGS]
    for setting in SETTINGS:
        mine = kind.setpoints[setting.name]
        assert mine.default == setting.default, setting.name
        for bound, theirs in ((mine.low, setting.low), (mine.high, setting.high)):
            assert str(bound).startswith(("min", "max")) or float(bound) == theirs, setting.name


def test_a_new_line_shows_its_settings_and_its_measures() -> None:
    plc, kind = VirtualConveyor(arrivals=False), line()
    plc.step()
    for key, setpoint in kind.setpoints.items():
        assert value(plc, kind, key) == setpoint.default, key
    for key, wanted in (
        ("belt_end_1", 215.0),
        ("belt_end_3", 660.0),
        ("sensor_position_1", 100.0),
        ("sensor_position_4", 560.0),
        ("area_end_3", 560.0),
        ("device_resolution", 1650),
        ("slots", 20),
        ("device_belts", 3),
        ("device_sensors", 4),
        ("device_areas", 4),
        ("device_intact_is_one", 1),
        ("pulse_length", 2 * math.pi * 15 / 1650),
    ):
        found = value(plc, kind, key)
        assert isinstance(found, int | float) and math.isclose(found, wanted, rel_tol=1e-6), key


def test_events_and_reasons_of_the_program_have_a_name() -> None:
    kind = line()

    def codes(*enums: type) -> Sequence[int]:
        return [int(code) for enum in enums for code in enum]  # type: ignore[attr-defined]

    assert set(codes(conveyor.ConveyorEvent, tracking.Code)) <= set(kind.events)
    assert set(codes(conveyor.ConveyorReason, tracking.EditReason)) <= set(kind.reasons)
    assert {command.code for command in kind.commands.values() if command.code} == set(codes(conveyor.ConveyorCommand))


def test_every_state_word_has_a_text() -> None:
    kind = line()
    for key, enum in (
        ("state", conveyor.ConveyorState),
        ("mode", Mode),
        ("motor_1", conveyor.Motor),
        ("speed_source_3", conveyor.Source),
    ):
        assert set(kind.points[key].texts) == {int(word) for word in enum}, key
    assert set(_data.columns["product"]["state"].point.texts) == {int(word) for word in tracking.ProductState}


def test_a_simulated_line_begins_with_settings_within_their_limits() -> None:
    numbers = dict(_data.numbers["simulation"])
    world = {"arrivals", "interval", "shortest", "longest", "not_read", "lane_interval"}
    assert world <= set(numbers), "of the products that arrive"
    limits = {setting.name: (setting.low, setting.high) for setting in SETTINGS}
    for key in set(numbers) - world:
        assert numbers[key] == limits[key], key
    assert set(limits) - set(numbers) == set(), "every setting can be given"
