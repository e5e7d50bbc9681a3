"""The virtual coil car and the type's data were each written from the manual: here they are laid side by side, word by word."""

import math
from collections.abc import Sequence

from app.plant import types
from app.plant.definitions import EquipmentType
from app.plant.plant_files.languages import LANGUAGES
from app.registers import plc_map
from app.registers.codec import Value, decode
from app.sim.coil_car import register_map as coil_car
from app.sim.coil_car.machine import MEASURES, Geometry, Hit
from app.sim.coil_car.program import VirtualCoilCar
from app.sim.coil_car.register_map import ACTIONS, PRESETS, SETTINGS, SIGNALS, STARTS

_data, _problems = types.read_type("coil_car", LANGUAGES)


def car() -> EquipmentType:
    assert _problems == []
    return _data.type


def value(plc: VirtualCoilCar, key: str) -> Value:
    register = car().points[key].register
    assert register
    return decode(register, plc.read(3, register.address, register.words))


def test_each_knows_what_the_other_knows_at_the_same_place() -> None:
    mine = {key: point.register for key, point in car().points.items() if point.register}
    assert set(mine) == set(coil_car.REGISTERS)
    for key, register in mine.items():
        place = coil_car.REGISTERS[key]
        assert register
        assert (register.address, register.type, register.shift, register.mask or 0) == (
            place.address,
            place.type,
            place.shift,
            place.mask,
        ), key
        assert (register.scale, register.offset, register.order) == (1, 0, "abcd"), key


def test_a_line_reads_as_a_sequence_sees_it() -> None:
    """What stands in the registers is what the sentences of a sequence read."""
    plc = VirtualCoilCar(start="automatic", coil=True)
    plc.preset({"saddle_1": 1, "pressure": 90.5, "vertical": 20})
    plc.step()
    for key in SIGNALS:
        there, seen = value(plc, key), plc.signal(key)
        if math.isnan(seen):
            assert there is None or (isinstance(there, float) and math.isnan(there)), key
        else:
            assert isinstance(there, int | float) and math.isclose(there, seen, rel_tol=1e-6, abs_tol=1e-6), key


def test_images_and_settings_lie_where_the_type_says() -> None:
    plc, plc_of = VirtualCoilCar(), car().device.plc
    assert plc_of and plc_of.settings
    plc.step()
    for image in (*plc_of.images, plc_of.settings):
        assert plc_map.is_whole(plc.read(3, image.address, image.words)), f"0x{image.address:04X}"
    assert plc.read(3, plc_map.AT_TYPE, 1) == [plc_of.type_code]
    assert plc.read(3, plc_of.settings.address + 1, 1) == [len(SETTINGS)]
    assert plc_of.staging == coil_car.STAGING


def test_settings_have_the_same_names_order_defaults_and_limits() -> None:
    kind = car()
    assert list(kind.setpoints) == [setting.name for setting in SETTINGS]
    for setting in SETTINGS:
        mine = kind.setpoints[setting.name]
        assert mine.default == setting.default, setting.name
        for bound, theirs in ((mine.low, setting.low), (mine.high, setting.high)):
            assert bound.startswith(("min", "max")) or float(bound) == theirs, setting.name
        assert _data.numbers["simulation"][setting.name] == (setting.low, setting.high)
    assert list(_data.choices["simulation"]["start"]) == list(STARTS)


def test_a_new_line_shows_its_settings_and_its_measures() -> None:
    plc, kind = VirtualCoilCar(), car()
    plc.step()
    for key, setpoint in kind.setpoints.items():
        assert value(plc, key) == setpoint.default, key
    for key in MEASURES:
        assert value(plc, f"device_{key}") == kind.options[key] == getattr(Geometry(), key), key


def test_actions_and_presets_of_tests_are_those_of_the_machine() -> None:
    kind = car()
    assert tuple(kind.actions) == tuple(ACTIONS)
    assert dict(kind.simulation_presets) == dict(PRESETS)


def test_events_reasons_and_commands_of_the_program_have_a_name() -> None:
    kind = car()

    def codes(enum: type) -> Sequence[int]:
        return [int(code) for code in enum]  # type: ignore[attr-defined]

    assert set(kind.events) == set(codes(coil_car.CoilCarEvent))
    assert set(codes(coil_car.CoilCarReason)) <= set(kind.reasons)
    assert {command.code for command in kind.commands.values() if command.code} == set(codes(coil_car.CoilCarCommand))
    jogs = [key.removeprefix("jog_") for key, command in kind.commands.items() if command.hold]
    assert jogs == list(coil_car.MOVEMENTS[:6])


def test_every_state_word_has_a_text() -> None:
    kind = car()
    for key, enum in (
        ("state", coil_car.CoilCarState),
        ("mode", coil_car.Mode),
        ("fault", coil_car.Fault),
        ("action_state", coil_car.ActionState),
        ("collision_kind", Hit),
        *((f"block_{name}", coil_car.Block) for name in coil_car.MOVEMENTS),
    ):
        assert set(kind.points[key].texts) == {int(word) for word in enum}, key
    assert set(kind.points["action"].texts) == set(range(len(ACTIONS) + 1))
