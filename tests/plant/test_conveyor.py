"""The conveyor's data say what its manual says, and nothing in them contradicts the rest."""

import re
import tomllib
from pathlib import Path
from string import Formatter

import pytest

from app.plant import types
from app.plant.definitions import EquipmentType, Point, Register
from app.plant.definitions import Type as Words
from app.plant.expression import parse
from app.plant.loader import read_plant
from app.plant.plant_files.languages import LANGUAGES

_data, _problems = types.read_type("conveyor", LANGUAGES)
PLANT = """
[plant]
name = "Hall"
timezone = "Europe/Zagreb"
languages = ["en"]
[links.hall]
transport = "memory"
[equipment.c1]
type = "conveyor"
link = "hall"
unit = 1
label = "Line"
"""
IDLE = {
    "state": 0,
    "mode": 0,
    "automatic": 0,
    "moving": 0,
    "emergency_stop": 0,
    "gap_stop": 0,
    "host_silent": 0,
    "stop_active": 0,
    "products": 0,
    "slots": 20,
    **{f"{key}_{belt}": 0 for belt in (1, 2, 3) for key in ("jam", "encoder_fault")},
}


@pytest.fixture
def line() -> EquipmentType:
    assert _problems == []
    return _data.type


def register(line: EquipmentType, key: str) -> Register:
    found = line.points[key].register
    assert found
    return found


@pytest.mark.parametrize(
    ("key", "address", "kind"),
    [
        ("state", 0x0101, "u16"),
        ("next_id", 0x010A, "u32"),
        ("smallest_gap", 0x010C, "f32"),
        ("first_out_time", 0x011A, "u64"),
        ("entered", 0x0120, "u32"),
        ("line_speed", 0x012A, "f32"),
        ("speed_setpoint_1", 0x0130, "f32"),
        ("encoder_2", 0x0144, "i32"),
        ("speed_source_3", 0x0157, "u16"),
        ("belt_end_3", 0x0188, "f32"),
        ("sensor_position_4", 0x0190, "f32"),
        ("pulse_length", 0x01A4, "f32"),
        ("automatic_speed", 0x0202, "f32"),
        ("host_timeout", 0x021E, "f32"),
    ],
)
def test_a_value_stands_where_the_manual_says(line: EquipmentType, key: str, address: int, kind: str) -> None:
    assert (register(line, key).address, register(line, key).type) == (address, kind)


def test_bits_of_one_word_are_a_value_each(line: EquipmentType) -> None:
    found = {
        (found.address, found.shift): key
        for key, point in line.points.items()
        if (found := point.register) and found.mask
    }
    assert found[0x0103, 0] == "automatic"
    assert found[0x0103, 9] == "reverse"
    assert [found[0x0104, bit] for bit in (0, 3, 6, 7, 9, 12)] == [
        "jam_1",
        "encoder_fault_1",
        "tolerance_present",
        "lost_present",
        "sensor_fault_1",
        "sensor_fault_4",
    ]
    assert [found[0x0105, bit] for bit in range(4)] == [f"beam_{n}" for n in (1, 2, 3, 4)]
    assert all(line.points[key].kind == "bool" for key in found.values())


def test_settings_fill_their_image_in_order(line: EquipmentType) -> None:
    plc = line.device.plc
    assert plc and plc.settings
    assert len(line.setpoints) == 15
    for number, key in enumerate(line.setpoints):
        found = register(line, key)
        assert (found.address, found.type, found.writable) == (plc.settings.address + 2 + 2 * number, Words.F32, True)
    last = [setpoint.role for setpoint in line.setpoints.values() if setpoint.role != "engineer"]
    assert last == ["operator", "operator"], "automatic and manual speed"


def test_defaults_of_the_settings_are_within_their_limits_and_normal_bands(line: EquipmentType) -> None:
    values = {key: setpoint.default for key, setpoint in line.setpoints.items()}
    for key, setpoint in line.setpoints.items():
        assert setpoint.default is not None
        assert parse(f"{setpoint.low} <= {key} <= {setpoint.high}").true(values) is True, key
        low, high = setpoint.normal or (setpoint.default, setpoint.default)
        assert low <= setpoint.default <= high, key


def test_what_no_source_gives_is_marked(line: EquipmentType) -> None:
    """Only the 30 % stand in the thesis, as the example of its ramp."""
    assert {key for key, setpoint in line.setpoints.items() if setpoint.certainty != "G"} == {"automatic_speed"}


def test_commands_have_the_codes_of_the_manual(line: EquipmentType) -> None:
    assert {key: command.code for key, command in line.commands.items() if command.code} == {
        "start_automatic": 1,
        "stop": 2,
        "select_manual": 3,
        "reset": 4,
        "delete_product": 5,
        "edit_product": 6,
        "confirm_positions": 7,
        "insert_product": 8,
        "select_automatic": 9,
    }
    assert {key: command.hold_bits for key, command in line.commands.items() if command.hold} == {
        "jog_forward": 1,
        "jog_reverse": 2,
        **{f"jog_forward_{n}": 1 | 1 << n + 3 for n in (1, 2, 3)},
        **{f"jog_reverse_{n}": 2 | 1 << n + 3 for n in (1, 2, 3)},
    }
    assert [argument.name for argument in line.commands["edit_product"].arguments] == ["product", "head", "length"]
    assert [argument.name for argument in line.commands["insert_product"].arguments] == ["head", "length"]


def test_choosing_a_mode_moves_nothing_and_asks_nothing(line: EquipmentType) -> None:
    for key in ("select_automatic", "select_manual"):
        assert (line.commands[key].moves, line.commands[key].level) == (False, "C1"), key
    assert line.commands["start_automatic"].level == "C2"


def test_stop_asks_nothing_and_nothing_guards_it(line: EquipmentType) -> None:
    stop = line.commands["stop"]
    assert (stop.stop, stop.level, stop.moves, stop.role) == (True, "C0", False, "operator")
    assert [guard.key for guard in (*line.permissives, *line.interlocks) if "stop" in guard.commands] == []
    assert [key for key, command in line.commands.items() if command.stop] == ["stop"]


def test_the_product_table_is_changed_by_engineers_who_say_why(line: EquipmentType) -> None:
    for key in ("delete_product", "edit_product", "insert_product"):
        command = line.commands[key]
        assert (command.role, command.level, command.needs_reason) == ("engineer", "C3", True), key


def guards(line: EquipmentType, command: str, **values: float) -> set[str]:
    """Keys of the sentences that are not met."""
    now = {**IDLE, **values}
    every = [
        guard
        for guard in (*line.permissives, *line.interlocks)
        if command in guard.commands or (not guard.commands and line.commands[command].moves)
    ]
    return {guard.key for guard in every if parse(guard.expression).true(now) is not True}


def test_what_guards_all_belts_guards_one(line: EquipmentType) -> None:
    for key in (key for key, command in line.commands.items() if command.hold):
        for values in (
            {},
            {"mode": 2},
            {"mode": 2, "stop_active": 1},
            {"mode": 2, "state": 7},
            {"mode": 2, "jam_1": 1},
        ):
            assert guards(line, key, **values) == guards(line, "jog_forward", **values), key


def test_a_line_at_rest_starts_and_a_moving_belt_in_manual_can_be_driven(line: EquipmentType) -> None:
    assert guards(line, "start_automatic", mode=1) == set()
    assert guards(line, "select_automatic") == set()
    assert guards(line, "jog_forward", mode=2) == set()
    assert guards(line, "jog_reverse", mode=2, moving=1, state=3) == set()


@pytest.mark.parametrize(
    ("command", "values", "unmet"),
    [
        ("start_automatic", {"mode": 1, "emergency_stop": 1}, {"emergency_stop"}),
        ("start_automatic", {"mode": 1, "jam_2": 1}, {"jam"}),
        ("start_automatic", {"mode": 1, "encoder_fault_3": 1}, {"encoders"}),
        ("start_automatic", {"mode": 1, "gap_stop": 1}, {"gap"}),
        ("start_automatic", {"mode": 1, "state": 6, "stop_active": 1}, {"acknowledged", "no_stop"}),
        ("start_automatic", {"mode": 1, "host_silent": 1}, {"host"}),
        ("start_automatic", {}, {"automatic"}),
        ("start_automatic", {"mode": 2}, {"automatic"}),
        ("select_automatic", {"mode": 2, "moving": 1, "state": 3}, {"standstill"}),
        ("select_manual", {"moving": 1, "state": 1, "mode": 1, "automatic": 1}, {"standstill"}),
        ("jog_forward", {}, {"manual"}),
        ("edit_product", {"moving": 1}, {"standstill"}),
        ("insert_product", {"products": 20}, {"room"}),
    ],
)
def test_what_stands_in_the_way_is_named(
    line: EquipmentType, command: str, values: dict[str, float], unmet: set[str]
) -> None:
    assert guards(line, command, **values) == unmet


def test_a_full_memory_does_not_keep_the_line_from_unloading(line: EquipmentType) -> None:
    assert guards(line, "start_automatic", mode=1, products=20, buffer_full=1) == set()


def test_automatic_may_follow_manual(line: EquipmentType) -> None:
    assert guards(line, "select_automatic", mode=2) == set()


def test_a_gap_stop_leaves_the_way_out_by_hand(line: EquipmentType) -> None:
    assert guards(line, "jog_forward", mode=2, gap_stop=1) == set()


def test_lost_communication_raises_one_alarm_and_leaves_the_others_as_they_are(line: EquipmentType) -> None:
    known = {alarm.key: parse(alarm.expression).true({}) for alarm in line.alarms if alarm.expression}
    assert [key for key, raised in known.items() if raised is not None] == ["communication"]


def test_an_alarm_whose_event_can_get_lost_is_raised_by_its_bit(line: EquipmentType) -> None:
    by_edge = {alarm.key for alarm in line.alarms if alarm.event and not alarm.expression}
    assert by_edge == {
        *(f"tolerance_{n}" for n in (2, 3, 4)),
        *(f"unexpected_{n}" for n in (1, 2, 3, 4)),
        *(f"slip_{n}" for n in (1, 2, 3)),
    }
    for alarm in line.alarms:
        if alarm.event and alarm.expression:
            assert alarm.on_delay > 0, f"{alarm.key}: the event comes first"


def test_an_event_raises_the_alarm_of_its_own_belt_or_sensor(line: EquipmentType) -> None:
    seen = set()
    for alarm in line.alarms:
        if alarm.event:
            assert (alarm.event, alarm.source) not in seen, alarm.key
            seen.add((alarm.event, alarm.source))
            if alarm.key[-1].isdigit():
                assert alarm.source == int(alarm.key[-1]), alarm.key


def test_a_text_names_only_what_an_event_brings(line: EquipmentType) -> None:
    brought = {"product", "products", "second", "source", "second_value", "value"}
    for language in LANGUAGES:
        for alarm in line.alarms:
            for key in (alarm.label, alarm.consequence, alarm.cause, alarm.response):
                named = {name for _, name, _, _ in Formatter().parse(line.texts[language][key]) if name}
                assert named <= (brought if alarm.event else set()), key


def test_texts_of_alarms_name_the_object_fit_a_row_and_help(line: EquipmentType) -> None:
    for language in LANGUAGES:
        texts = line.texts[language]
        for alarm in line.alarms:
            label = texts[alarm.label]
            assert ": " in label and len(label) <= 60 and "!" not in label, label
            for key in (alarm.consequence, alarm.cause, alarm.response):
                assert len(texts[key]) > 15, key


@pytest.mark.sweep(8)
def test_every_text_key_of_the_data_exists_in_every_language(line: EquipmentType) -> None:
    product = {f"table.{name}" for name in ("generation", "capacity", "count")}
    most, problems = types.read_type(
        "conveyor", LANGUAGES, given={"belts": 16, "sensors": 32, "scanner": 2, "gates": 8, "merges": 4}
    )
    assert problems == []
    wanted = {"area", *types.text_keys(_data), *types.text_keys(most)}
    wanted |= {setpoint.group for setpoint in line.setpoints.values()}
    for language in LANGUAGES:
        assert wanted - product - set(line.texts[language]) == set(), language
        assert {
            key for key in line.texts[language] if not re.search(r"(^screen|^training|^help|(^|\.)page)\.", key)
        } - wanted == set(), f"{language}: nobody asks for these"


def test_texts_are_toml_that_names_no_key_twice() -> None:
    for language in LANGUAGES:
        assert tomllib.loads((types.EQUIPMENT / "conveyor" / f"texts.{language}.toml").read_text("utf-8"))


def points(tmp_path: Path, more: str = "") -> dict[str, Point]:
    (tmp_path / "plant.toml").write_text(PLANT + more, "utf-8")
    plant, problems = read_plant(tmp_path)
    assert plant, problems
    return dict(plant.equipment["c1"].points)


def test_a_product_has_a_row_of_cells_in_every_slot(tmp_path: Path) -> None:
    found = points(tmp_path, "product_slots = 7")
    columns = [
        "id",
        "state",
        "head",
        "tail",
        "length",
        "area",
        "corrected_at",
        "correction",
        "age",
        "displacement",
        "direction",
        "entered",
    ]
    assert {key for key, point in found.items() if point.table == "product"} == {
        f"product_{slot}_{column}" for slot in range(1, 8) for column in columns
    }
    assert {point.row for point in found.values() if point.table == "ramp"} == set(range(6)), (
        "a start and a stop per belt"
    )
    head = found["product_7_head"].register
    assert head and head.address == 0x0804 + 6 * 24 + 4
    assert found["product_7_head"].row == 6
    assert not any(point.history for point in found.values() if point.table)


def test_the_presets_are_the_two_machines_of_the_thesis(tmp_path: Path) -> None:
    (tmp_path / "plant.toml").write_text(PLANT + 'preset = "simulation"\n', "utf-8")
    plant, problems = read_plant(tmp_path)
    assert plant, problems
    options = plant.equipment["c1"].options
    assert (options["sensor_1"], options["rated_speed"], options["resolution"], options["intact_is_one"]) == (
        150,
        60,
        1024,
        0,
    )
    assert (options["sensor_2"], options["line_length"]) == (215, 660), "those of the model: its text gives none"


def test_a_machine_that_is_built_otherwise_than_drawn_is_told(line: EquipmentType) -> None:
    derived = line.points["configuration_differs"].derived
    assert derived
    same = {
        "belt_end_1": 215.0,
        "belt_1_end": 215,
        "belt_end_2": 445.0,
        "belt_2_end": 445,
        "device_line_length": 660.0,
        "line_length": 660,
        "device_roller_radius": 15.0,
        "roller_radius": 15,
        "device_resolution": 1650,
        "resolution": 1650,
        "slots": 20,
        "product_slots": 20,
        **{"belts": 3, "device_belts": 3, "sensors": 4, "device_sensors": 4, "scanner": 0, "device_scanner": 0},
        "gates": 0,
        "device_gates": 0,
        "merges": 0,
        "device_merges": 0,
        "merges_differ": 0,
        **{f"sensor_position_{n}": 100.0 * n for n in (1, 2, 3, 4)},
        **{f"sensor_{n}": 100 * n for n in (1, 2, 3, 4)},
    }
    assert parse(derived.when).true(same) is False
    for key in (
        "belt_end_2",
        "device_line_length",
        "sensor_position_3",
        "device_resolution",
        "slots",
        "device_scanner",
        "device_gates",
        "device_merges",
        "merges_differ",
    ):
        assert parse(derived.when).true({**same, key: same[key] + 1}) is True, key


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("options", "told"),
    [
        ("sensor_2 = 90", "sensor_2 = 90: expected a position behind sensor_1, which is 100 mm"),
        ("sensor_1 = 300", "sensor_2 = 215: expected a position behind sensor_1, which is 300 mm"),
        ("belt_1_end = 500", "belt_2_end = 445: expected a position behind belt_1_end, which is 500 mm"),
        ("line_length = 400", "line_length = 400: expected a position behind belt_2_end, which is 445 mm"),
        ("sensor_4 = 700", "sensor_4 = 700: expected a position on belt 3, between 445 and 660 mm"),
        ("sensor_4 = 660", "sensor_4 = 660: expected a position on belt 3"),
        ("gates = 9", "gates = 9: expected a number from 0 to 8"),
        ("gates = 1\ngate_1_at = 650", "gate_1_at = 650: expected a position between the first and the last sensor"),
        (
            "gates = 1\ngate_1_at = 440",
            "gate_1_at = 440: expected a position at least 10 mm away from sensor_3, which is 445",
        ),
        (
            "gates = 2\ngate_1_at = 330\ngate_2_at = 340",
            "gate_2_at = 340: expected a position at least 20 mm behind gate_1_at, which is 330",
        ),
        ("gates = 1\ngate_1_rule = 1", "gate_1_rule = 1: expected 0 or 4 on a line without a scanner"),
        (
            "gates = 1\ngate_1_rule = 1\nscanner = 3\ngate_1_at = 330",
            "gate_1_at = 330: expected a position at least 20 mm behind sensor 3, where the scanner stands",
        ),
        ("gates = 1\ngate_1_rule = 5", "gate_1_rule = 5: expected a number from 0 to 4"),
        ("merges = 5", "merges = 5: expected a number from 0 to 4"),
        (
            "merges = 1\nmerge_1_at = 190",
            "merge_1_at = 190: expected a position at least 100 mm behind the first sensor",
        ),
        (
            "merges = 1\nmerge_1_at = 550",
            "merge_1_at = 550: expected a position at least 100 mm behind the first sensor",
        ),
        (
            "merges = 1\nmerge_1_at = 440",
            "merge_1_at = 440: expected a position at least 10 mm away from sensor_3, which is 445",
        ),
        (
            "merges = 2\nmerge_1_at = 400\nmerge_2_at = 410",
            "merge_2_at = 410: expected a position at least 20 mm behind merge_1_at, which is 400",
        ),
        (
            "merges = 1\ngates = 1\ngate_1_at = 430",
            "merge_1_at = 400: expected a position 20 mm behind gate_1_at or 50 mm before it, which is 430 mm",
        ),
        ("merges = 1\nmerge_1_mode = 3", "merge_1_mode = 3: expected a number from 0 to 2"),
        (
            "merges = 1\nmerge_1_at = 240\nmerge_1_mode = 1",
            "merge_1_mode = 1: expected 0 for a lane that joins before or less than 50 mm behind the end of belt 1",
        ),
        (
            "belts = 1\nsensors = 2\nline_length = 660\nsensor_2 = 600\nmerges = 1\nmerge_1_mode = 2",
            "merge_1_mode = 2: expected 0 on a line of one belt",
        ),
        ("merges = 1\nmerge_1_limit = 0", "merge_1_limit = 0: expected a number from 1 to 3600"),
        ("product_slots = 3", "product_slots = 3: expected a number from 5 to 250"),
        ("product_slots = 7.5", "product_slots = 7.5: expected a whole number"),
        ("intact_is_one = 0.5", "intact_is_one = 0.5: expected 0 or 1"),
        ('preset = "wood"', 'preset = "wood": expected one of model, simulation'),
    ],
)
def test_a_line_that_nobody_could_build_is_told(tmp_path: Path, options: str, told: str) -> None:
    (tmp_path / "plant.toml").write_text(PLANT + options, "utf-8")
    plant, problems = read_plant(tmp_path)
    assert plant is None
    assert any(f"equipment.c1.{told}" in str(problem) for problem in problems), list(map(str, problems))


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("belts", "sensors", "places"),
    [
        (3, 4, [100, 215, 445, 560]),
        (5, 8, [100, 215, 445, 560, 675, 790, 905, 1020]),
        (1, 1, [100]),
        (1, 2, [100, 215]),
        (2, 2, [100, 560]),
        (5, 4, [100, 1220 / 3, 2140 / 3, 1020]),
        (16, 1, [3550]),
        (16, 32, [100 + 3450 * n / 31 for n in range(32)]),
    ],
)
def test_a_line_of_which_only_the_numbers_are_said_can_be_built(
    tmp_path: Path, belts: int, sensors: int, places: list[float]
) -> None:
    (tmp_path / "plant.toml").write_text(f"{PLANT}belts = {belts}\nsensors = {sensors}\n", "utf-8")
    plant, problems = read_plant(tmp_path)
    assert plant, problems
    options = plant.equipment["c1"].options
    assert [options[f"sensor_{n}"] for n in range(1, sensors + 1)] == pytest.approx(places)


def test_a_merge_that_is_built_otherwise_than_drawn_is_told() -> None:
    data, problems = types.read_type("conveyor", LANGUAGES, given={"merges": 1})
    derived = data.type.points["merges_differ"].derived
    assert problems == [] and derived
    plan = {"at": 400.0, "mode": 1, "gap": 15.0, "limit": 60.0}
    same = {f"{who}merge_1_{key}": value for key, value in plan.items() for who in ("", "device_")}
    same |= {"merges": 1, "device_merges": 1}
    assert parse(derived.when).true(same) is False
    for key in ("device_merges", *(f"device_merge_1_{key}" for key in plan)):
        assert parse(derived.when).true({**same, key: same[key] + 1}) is True, key


def test_a_line_of_other_measures_is_fine_when_they_go_together(tmp_path: Path) -> None:
    more = (
        "belt_1_end = 2000\nbelt_2_end = 5000\nline_length = 9000\nsensor_1 = 300\nsensor_2 = 2000\nsensor_3 = 5000\n"
    )
    assert points(tmp_path, more + "sensor_4 = 8000")["smallest_gap"].scale_high == 9000


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('"sensor_{later-1} < sensor_{later}"', '"sensor_1 < sensor_9"', "sensor_9 is none"),
        ('"sensor_{later-1} < sensor_{later}"', '"sensor_1 > sensor_{later}"', "holds for the options of default"),
        ('option = "sensor_{later}"', 'option = "sensor_9"', "sensor_2"),
        ("which is {sensor_{later-1}} mm", "which is {sensor_9} mm", "options in braces only"),
        ("sensor_1 = 150 ", "sensor_1 = 250 ", "holds for the options of simulation"),
    ],
)
def test_a_mistake_in_the_checks_of_a_type_is_told(tmp_path: Path, old: str, new: str, told: str) -> None:
    folder = tmp_path / "conveyor"
    folder.mkdir()
    for source in (types.EQUIPMENT / "conveyor").glob("*.toml"):
        text = source.read_text("utf-8")
        if source.name == "device.toml":
            assert old in text
            text = text.replace(old, new, 1)
        (folder / source.name).write_text(text, "utf-8")
    problems = [str(problem) for problem in types.read_type("conveyor", LANGUAGES, tmp_path)[1]]
    assert any(told in problem and problem.startswith("conveyor/device.toml:") for problem in problems), problems
