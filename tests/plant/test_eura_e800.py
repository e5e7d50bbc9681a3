"""The drive's data say what reference sheet and virtual drive say."""

import tomllib
from pathlib import Path

import pytest

from app import bundled
from app.plant import types
from app.plant.definitions import EquipmentType, Point
from app.plant.expression import parse
from app.plant.loader import read_plant
from app.plant.plant_files.languages import LANGUAGES
from app.sim.eura_e800.faults import FAULTS
from app.sim.eura_e800.parameters import PARAMETERS
from app.sim.eura_e800.registers import REGISTERS

LIVE = {"status", "frequency", "voltage", "current"}
OUTPUTS = ("set_ao1", "set_ao2", "output_1_on", "output_1_off", "output_2_on", "output_2_off", "relay_on", "relay_off")
_data, _problems = types.read_type("eura_e800", LANGUAGES)


@pytest.fixture
def drive() -> EquipmentType:
    assert _problems == []
    return _data.type


def registers(drive: EquipmentType) -> dict[str, Point]:
    return {key: point for key, point in drive.points.items() if point.register}


def test_25_registers_and_eight_commands_are_the_ones_of_the_sheet(drive: EquipmentType) -> None:
    read = {
        p.register.address for p in registers(drive).values() if p.register and 0x1000 <= p.register.address < 0x2000
    }
    written = {p.register.address: key for key, p in registers(drive).items() if p.register and not p.register.readable}
    assert read == set(range(0x1000, 0x1019))
    assert written == {
        0x2000: "command",
        0x2001: "lock",
        0x2002: "ao1_command",
        0x2003: "ao2_command",
        0x2005: "do1_token",
        0x2006: "do2_token",
        0x2007: "relay_token",
    }


def test_a_parameter_stands_where_its_name_says(drive: EquipmentType) -> None:
    for setpoint in drive.setpoints.values():
        register = drive.points[setpoint.key].register
        assert register
        assert register.address == int(setpoint.code[1], 16) << 8 | int(setpoint.code[2:]), setpoint.code
    wanted = {106, *range(111, 120), 131, 137, 138, 139, 200, 201, 202, 203, 209, 277, 278, 279, 280, 706, 707}
    wanted |= {*range(800, 806), 810, *range(900, 906)}
    assert {int(setpoint.code[1:]) for setpoint in drive.setpoints.values()} == wanted


def test_the_virtual_drive_agrees_on_address_scale_and_unit(drive: EquipmentType) -> None:
    for key, point in registers(drive).items():
        register = point.register
        assert register
        if register.address in REGISTERS:
            _, scale, unit = REGISTERS[register.address]
            assert (key, register.scale, point.unit) == (key, scale, unit)
    for setpoint in drive.setpoints.values():
        mine, theirs = drive.points[setpoint.key], PARAMETERS[setpoint.code]
        assert mine.register
        assert (setpoint.code, mine.register.address, mine.register.scale, mine.unit) == (
            setpoint.code,
            theirs.address,
            theirs.scale,
            theirs.unit,
        )
        assert not set(setpoint.options) - set(theirs.choices or range(int(theirs.low), int(theirs.high) + 1))
    assert set(REGISTERS) <= {p.register.address for p in registers(drive).values() if p.register}
    assert set(FAULTS) <= set(drive.points["status"].texts)


def test_no_point_lies_where_the_device_does_not_answer(drive: EquipmentType) -> None:
    for key, point in registers(drive).items():
        register = point.register
        assert register
        assert not any(first <= register.address <= last for first, last in drive.device.holes), key
        assert register.readable != any(first <= register.address <= last for first, last in drive.device.write_only), (
            key
        )
    assert not any(first <= drive.device.training <= last for first, last in drive.device.holes)


def test_limits_of_the_device_are_the_decided_ones(drive: EquipmentType) -> None:
    device = drive.device
    assert (device.max_read, device.fallback_read, device.group_read) == (25, 9, {"once": 6})
    assert (tuple(device.read_functions), tuple(device.write_functions), device.max_write) == ((3,), (6,), 1)
    assert device.connections == 1


def test_codes_written_are_the_ones_of_the_manual_and_5_is_never_sent(drive: EquipmentType) -> None:
    codes = {
        key: [w.value for w in (*c.writes, *c.release) if w.point == "command"] for key, c in drive.commands.items()
    }
    assert codes == {
        "forward": ["1"],
        "reverse": ["2"],
        "stop": ["3"],
        "coast": ["4"],
        "jog_forward": ["1", "3"],
        "jog_reverse": ["2", "3"],
        "put_back": [],
        "reset": ["9"],
        "set_frequency": [],
        **{key: [] for key in OUTPUTS},
    }


def test_outputs_are_written_where_the_manual_says_and_read_back_where_they_show(drive: EquipmentType) -> None:
    written = {}
    for key in OUTPUTS:
        (write,) = drive.commands[key].writes
        register = drive.points[write.point].register
        assert register and not drive.commands[key].moves
        written[key] = register.address, write.value, drive.commands[key].feedback
    assert written == {
        "set_ao1": (0x2002, "argument", "abs(ao1 - argument) < 0.06"),
        "set_ao2": (0x2003, "argument", "abs(ao2 - argument) < 0.06"),
        "output_1_on": (0x2005, "1", "output_1 == 1"),
        "output_1_off": (0x2005, "0", "output_1 == 0"),
        "output_2_on": (0x2006, "1", "output_2 == 1"),
        "output_2_off": (0x2006, "0", "output_2 == 0"),
        "relay_on": (0x2007, "1", "relay == 1"),
        "relay_off": (0x2007, "0", "relay == 0"),
    }


@pytest.mark.parametrize("key", ["jog_forward", "jog_reverse"])
def test_a_jog_keeps_its_frequency_out_of_the_eeprom_and_gives_the_former_one_back_last(
    drive: EquipmentType, key: str
) -> None:
    jog = drive.commands[key]
    assert [(write.point, write.value) for write in jog.writes][:2] == [
        ("lock", "4"), ("frequency_setpoint", "option:jog_frequency"),
    ]  # fmt: skip
    assert [(write.point, write.value) for write in jog.release] == [
        ("command", "3"), ("frequency_setpoint", "previous"), ("lock", "3"),
    ]  # fmt: skip
    assert drive.commands["put_back"].puts_back and not jog.puts_back


def test_stop_asks_nothing_and_nothing_guards_it(drive: EquipmentType) -> None:
    stop = drive.commands["stop"]
    assert (stop.stop, stop.level, stop.moves) == (True, "C0", False)
    guarded = [guard.key for guard in (*drive.permissives, *drive.interlocks) if "stop" in guard.commands]
    assert guarded == []
    assert [command.key for command in drive.commands.values() if command.stop] == ["stop"]


def test_reverse_while_running_forward_is_confirmed_twice(drive: EquipmentType) -> None:
    condition, level = drive.commands["reverse"].level_when or ("", "")
    assert level == "C2"
    assert parse(condition).true({"status": 1}) is True
    assert parse(condition).true({"status": 0}) is False


@pytest.mark.parametrize(("timeout", "allowed"), [(0, False), (0.1, True), (2, True), (2.1, False), (None, None)])
def test_hold_to_run_needs_a_watchdog_in_the_drive(
    drive: EquipmentType, timeout: float | None, allowed: bool | None
) -> None:
    guard = next(guard for guard in drive.permissives if guard.key == "hold_watchdog")
    assert set(guard.commands) == {key for key, command in drive.commands.items() if command.hold}
    assert parse(guard.expression).true({"f905": timeout}) is allowed


def test_jogging_is_allowed_at_standstill_and_stays_allowed_while_it_jogs(drive: EquipmentType) -> None:
    guard = parse(next(guard for guard in drive.permissives if guard.key == "hold_standstill").expression)
    assert guard.true({"status": 0, "frequency": 0, "jog_frequency": 5}) is True
    assert guard.true({"status": 1, "frequency": 5, "jog_frequency": 5}) is True
    assert guard.true({"status": 1, "frequency": 40, "jog_frequency": 5}) is False


def test_a_drive_that_does_not_listen_to_modbus_is_named_and_not_started(drive: EquipmentType) -> None:
    alarm = parse(next(alarm for alarm in drive.alarms if alarm.key == "not_listening").expression)
    guards = [parse(guard.expression) for guard in drive.permissives if guard.key.endswith("_source")]
    for f200, f201, f203, listens in (
        (4, 4, 0, True),
        (3, 3, 10, True),
        (0, 4, 0, False),
        (4, 1, 0, False),
        (4, 4, 1, False),
    ):
        values = {"f200": f200, "f201": f201, "f203": f203}
        assert alarm.true(values) is not listens
        assert all(guard.true(values) for guard in guards) is listens


def test_every_fault_is_one_alarm_and_no_state_without_fault_is(drive: EquipmentType) -> None:
    faults = [parse(alarm.expression) for alarm in drive.alarms if alarm.alarm_class == "drive"]
    for code in range(256):
        raised = sum(alarm.true({"status": code}) is True for alarm in faults)
        assert raised == (0 if code in (0, 1, 2) else 1), code


def test_lost_communication_raises_one_alarm_and_leaves_the_others_as_they_are(drive: EquipmentType) -> None:
    known = {alarm.key: parse(alarm.expression).true({}) for alarm in drive.alarms}
    assert [key for key, raised in known.items() if raised is not None] == ["communication"]
    assert known["communication"] is True


def test_speed_deviation_waits_for_the_ramp_and_allows_slip(drive: EquipmentType) -> None:
    alarm = next(alarm for alarm in drive.alarms if alarm.key == "speed_deviation")
    base = {"status": 1, "frequency_setpoint": 40, "f804": 4, "f810": 50}
    raised = parse(alarm.expression)
    assert raised.true({**base, "frequency": 40, "speed_magnitude": 1120}) is False
    assert raised.true({**base, "frequency": 20, "speed_magnitude": 0}) is False
    assert raised.true({**base, "frequency": 40, "speed_magnitude": 0}) is True
    assert parse(alarm.clear).true({**base, "frequency": 40, "speed_magnitude": 1120}) is True


def test_alarms_clear_below_their_dead_band(drive: EquipmentType) -> None:
    current = next(alarm for alarm in drive.alarms if alarm.key == "current_high")
    value = {"rated_current": 2.0}
    assert parse(current.expression).true({**value, "current": 2.0}) is True
    assert parse(current.clear).true({**value, "current": 1.95}) is False
    assert parse(current.clear).true({**value, "current": 1.89}) is True


def test_every_text_key_of_the_data_exists_in_every_language(drive: EquipmentType) -> None:
    wanted = {drive.label, "area"}
    for point in drive.points.values():
        wanted |= {point.label, *point.texts.values()}
    for setpoint in drive.setpoints.values():
        wanted |= {setpoint.group, *setpoint.options.values(), *([setpoint.warning] if setpoint.warning else [])}
    for command in drive.commands.values():
        wanted.add(command.label)
    for guard in (*drive.permissives, *drive.interlocks):
        wanted.add(guard.label)
    for alarm in drive.alarms:
        wanted |= {alarm.label, alarm.consequence, alarm.cause, alarm.response}
    for language in LANGUAGES:
        assert wanted - set(drive.texts[language]) == set(), language
    assert len({frozenset(texts) for texts in drive.texts.values()}) == 1


def test_alarm_texts_name_the_object_and_fit_a_row(drive: EquipmentType) -> None:
    for language in LANGUAGES:
        for alarm in drive.alarms:
            text = drive.texts[language][alarm.label]
            assert ": " in text
            assert len(text) <= 60
            assert "!" not in text


def test_what_nobody_confirmed_is_marked_and_warned_of(drive: EquipmentType) -> None:
    assert drive.setpoints["f801"].certainty == "G?"
    assert drive.setpoints["f801"].warning == "warning.scaling"
    assert {key for key, s in drive.setpoints.items() if s.warning == "warning.line"} == {
        "f900",
        "f901",
        "f903",
        "f904",
    }


def broken(folder: Path, file: str, old: str, new: str) -> list[str]:
    target = folder / "eura_e800"
    target.mkdir()
    for source in (types.EQUIPMENT / "eura_e800").glob("*.toml"):
        text = source.read_text("utf-8")
        if source.name == file:
            assert old in text
            text = text.replace(old, new, 1)
        (target / source.name).write_text(text, "utf-8")
    return [str(problem) for problem in types.read_type("eura_e800", LANGUAGES, folder)[1]]


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("file", "old", "new", "told"),
    [
        ("points.toml", "address = 0x1001", "address = 0x1000", "words that frequency does not use"),
        (
            "points.toml",
            'mask = 0xFF\nkind = "enum"',
            'mask = 0x1FF\nkind = "enum"',
            "words that drive_ratio does not use",
        ),
        ("points.toml", 'when = "status == 2"', 'when = "state == 2"', "it has no state"),
        ("points.toml", '"0.3 * rated_current"', '"0.3 * speed"', "speed is none"),
        ("points.toml", 'kind = "signed"', 'kind = "squared"', "one of option, signed"),
        ("points.toml", "[frequency]", "[Frequency]", "a key of small letters"),
        ("points.toml", "[frequency]", "[age]", "not a word of the grammar"),
        ("points.toml", "scale = 0.01", "scale = 0", "a number other than 0"),
        ("points.toml", "decimals = 2", "decimal = 2", "perhaps decimals"),
        ("setpoints.toml", 'high = "f111"', 'high = "f999"', "it has no f999"),
        ("setpoints.toml", "options = [0, 2, 3, 6]", 'options = ["a"]', "a list of values"),
        ("commands.toml", 'point = "command", value = 1', 'point = "status", value = 1', "with a writable register"),
        ("commands.toml", '"option:jog_frequency"', '"option:jog"', "an option of eura_e800"),
        ("commands.toml", 'timeout = "f114', 'timeout = "f114 +', "position"),
        ("commands.toml", "hold = true", "hold = false", "for a hold-to-run only"),
        ("commands.toml", 'level = "C0"', 'level = "C9"', "one of C0, C1"),
        ("interlocks.toml", '["forward", "reverse", "jog', '["forwards", "reverse", "jog', "a command of eura_e800"),
        ("interlocks.toml", 'expression = "status < 4"', 'expression = "status.x"', "position 1"),
        ("alarms.toml", "priority = 2", "priority = 0", "from 1 to 4"),
        ("device.toml", "holes = [", "holes = [[9, 1],", "0 <= first <= last"),
    ],
)
def test_a_mistake_in_the_data_of_a_type_is_told(tmp_path: Path, file: str, old: str, new: str, told: str) -> None:
    problems = broken(tmp_path, file, old, new)
    assert any(told in problem and problem.startswith(f"eura_e800/{file}:") for problem in problems), problems


def test_texts_are_toml_that_names_no_key_twice() -> None:
    for language in LANGUAGES:
        assert tomllib.loads((types.EQUIPMENT / "eura_e800" / f"texts.{language}.toml").read_text("utf-8"))


def test_live_values_are_read_with_every_fast_scan(drive: EquipmentType) -> None:
    assert {drive.points[key].scan.value for key in LIVE} == {"fast"}


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    "key",
    ["frequency", "voltage", "current", "bus_voltage", "torque", "heatsink_temperature", "speed_magnitude", "power"],
)
def test_a_register_full_of_ones_is_no_measured_value(key: str) -> None:
    """What a broken line or another device's register gives is not shown as good."""
    plant, _ = read_plant(bundled("plants/demo"))
    assert plant
    point = plant.points[f"m1.{key}"]
    assert point.register and point.high is not None
    assert point.register.scale * 0xFFFF > point.high
