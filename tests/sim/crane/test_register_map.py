"""The virtual crane and the type's data: here they are laid side by side, word by word."""

import math

import pytest

from app.plant import types
from app.plant.definitions import EquipmentType
from app.plant.plant_files.languages import LANGUAGES
from app.registers import plc_map
from app.registers.codec import Value, decode
from app.sim.crane import register_map as crane
from app.sim.crane import training
from app.sim.crane.configuration import PLACES, SETTINGS, Places, faulty
from app.sim.crane.program import STARTS, VirtualCrane

_data, _problems = types.read_type("crane", LANGUAGES)


def kind() -> EquipmentType:
    assert _problems == []
    return _data.type


def value(plc: VirtualCrane, key: str) -> Value:
    register = kind().points[key].register
    assert register
    return decode(register, plc.read(3, register.address, register.words))


def test_each_knows_what_the_other_knows_at_the_same_place() -> None:
    mine = {key: point.register for key, point in kind().points.items() if point.register}
    assert set(mine) == set(crane.REGISTERS)
    for key, register in mine.items():
        place = crane.REGISTERS[key]
        assert register
        assert (register.address, register.type, register.shift, register.mask or 0) == (
            place.address,
            place.type,
            place.shift,
            place.mask,
        ), key
        assert (register.scale, register.offset, register.order) == (1, 0, "abcd"), key


def test_no_two_values_lie_on_the_same_bit() -> None:
    taken: dict[tuple[int, int], str] = {}
    whole = {
        key
        for key, place in crane.REGISTERS.items()
        if key.endswith(("_permissives", "_status_word", "_control_word", "_alarms"))
    }
    for key, place in crane.REGISTERS.items():
        if key in whole:
            continue
        words = 1 if place.type == "u16" else 2
        bits = [place.shift] if place.mask else range(16)
        for at in range(place.address, place.address + words):
            for bit in bits:
                assert taken.setdefault((at, bit), key) == key, f"{key} and {taken[at, bit]} at 0x{at:04X}.{bit}"


def test_images_and_settings_lie_where_the_type_says() -> None:
    plc, plc_of = VirtualCrane(), kind().device.plc
    assert plc_of and plc_of.settings
    plc.step()
    for image in (*plc_of.images, plc_of.settings):
        assert plc_map.is_whole(plc.read(3, image.address, image.words)), f"0x{image.address:04X}"
    assert plc.read(3, plc_map.AT_TYPE, 1) == [plc_of.type_code]
    assert plc.read(3, plc_of.settings.address + 1, 1) == [len(SETTINGS)]
    assert plc_of.staging == crane.STAGING


def test_settings_have_the_same_names_order_defaults_and_limits() -> None:
    type_ = kind()
    assert list(type_.setpoints) == [setting.name for setting in SETTINGS]
    for setting in SETTINGS:
        mine = type_.setpoints[setting.name]
        assert mine.default == setting.default, setting.name
        assert (float(mine.low), float(mine.high)) == (setting.low, setting.high), setting.name
        assert _data.numbers["simulation"][setting.name] == (setting.low, setting.high)
    assert list(_data.choices["simulation"]["start"]) == list(STARTS)


def test_the_checks_of_the_type_refuse_what_the_device_refuses() -> None:
    from app.plant.expression import parse

    type_ = kind()
    device = {f"device_{name}": getattr(Places(), name) for name in PLACES}
    usual = {setting.name: setting.default for setting in SETTINGS}

    def both(values: dict[str, float]) -> tuple[bool, bool]:
        now = {**usual, **values}
        by_type = all(parse(check.expression).true({**now, **device}) is True for check in type_.checks)
        return by_type, faulty(now, Places()) == 0

    assert both({}) == (True, True)
    refused = 0
    for setting in SETTINGS:
        for part in (0.0, 0.02, 0.1, 0.2, 0.3, 0.5, 0.7, 0.9, 1.0):
            given = setting.low + part * (setting.high - setting.low)
            one, other = both({setting.name: given})
            assert one == other, f"{setting.name} = {given}"
            refused += not one
    assert refused > 60


def test_a_new_crane_shows_its_settings_and_its_places() -> None:
    plc, type_ = VirtualCrane(), kind()
    plc.step()
    for key, setpoint in type_.setpoints.items():
        shown = value(plc, key)
        assert isinstance(shown, float | int) and shown == pytest.approx(setpoint.default, rel=1e-6), key
    for key in PLACES:
        assert value(plc, f"device_{key}") == type_.options[key] == getattr(Places(), key), key


def test_events_reasons_and_commands_of_the_program_have_a_name() -> None:
    type_ = kind()
    assert set(type_.events) == {int(code) for code in crane.CraneEvent}
    assert {int(code) for code in crane.CraneReason} <= set(type_.reasons)
    codes = {command.code for command in type_.commands.values() if command.code}
    assert codes == {int(code) for code in crane.CraneCommand}
    held = {key: command.hold_bits for key, command in type_.commands.items() if command.hold}
    assert held == {
        f"jog_{axis}_{way}": 1 << 2 * n + m for n, axis in enumerate(crane.AXES) for m, way in enumerate(("up", "down"))
    }


def test_every_enumeration_has_a_text_for_every_word() -> None:
    type_ = kind()
    for key, enum in (
        ("state", crane.CraneState),
        ("mode", crane.Mode),
        ("step", crane.Step),
        ("step_state", crane.StepState),
        ("suspension", crane.Suspension),
        ("drives_selected", crane.DriveChoice),
        ("path_phase", crane.PathPhase),
        ("path_fault", crane.PathFault),
        *((f"{name}_state", crane.DriveState) for name in (*crane.AXES, *crane.DRIVES)),
    ):
        assert set(type_.points[key].texts) == {int(word) for word in enum}, key


def test_every_fault_of_the_instructor_is_one_of_the_device() -> None:
    training_of = kind().training
    assert training_of
    assert sorted(training_of.faults.values()) == sorted(training.FAULTS)
    assert {word.register for word in training_of.world.values()} == {
        training.REG_ORDERS,
        training.REG_PAUSE,
        training.REG_LADLE,
    }


def test_every_event_of_a_drive_and_of_an_end_raises_an_alarm_of_its_own() -> None:
    by_source = {(alarm.event, alarm.source) for alarm in kind().alarms if alarm.source is not None}
    for event in crane.DRIVE_EVENTS.values():
        assert {(int(event), n) for n in range(1, len(crane.DRIVES) + 1)} <= by_source
    for event in (crane.CraneEvent.STOP_HIT, crane.CraneEvent.SWITCH_FAILED, crane.CraneEvent.SWITCH_STUCK):
        assert {(int(event), n) for n in range(1, 7)} <= by_source


def test_nothing_is_shown_that_is_no_number() -> None:
    plc = VirtualCrane()
    for _ in range(20):
        plc.step()
    empty = {
        *("planned_load", "confirmed_load", "angle", "target_angle", "path_error", "radial_error"),
        *("circle_x", "circle_y", "plan_x", "plan_y", *(f"{axis}_target" for axis in crane.AXES)),
    }
    for key in crane.REGISTERS:
        shown = value(plc, key)
        if key in empty:
            assert shown is None or (isinstance(shown, float) and math.isnan(shown)), key
        else:
            assert shown is not None and not (isinstance(shown, float) and math.isnan(shown)), key
