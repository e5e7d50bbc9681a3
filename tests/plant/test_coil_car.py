"""The coil car's data say what its manual says, and nothing in them contradicts the rest."""

import re
from pathlib import Path
from string import Formatter

import pytest

from app.plant import types
from app.plant.definitions import EquipmentType
from app.plant.definitions import Type as Words
from app.plant.expression import parse
from app.plant.loader import read_plant
from app.plant.plant_files.languages import LANGUAGES

_data, _problems = types.read_type("coil_car", LANGUAGES)
PLANT = """
[plant]
name = "Hall"
timezone = "Europe/Zagreb"
languages = ["en"]
[links.hall]
transport = "memory"
[equipment.cc1]
type = "coil_car"
link = "hall"
unit = 1
label = "Car"
"""
MOVEMENTS = ("forward", "back", "up", "down", "expand", "collapse")
READY = {
    "state": 3,
    "mode": 2,
    "held": 0,
    "moving": 0,
    "winding": 0,
    "collision": 0,
    "emergency_stop": 0,
    "guards_closed": 1,
    "host_silent": 0,
    **{f"saddle_{n}": 0 for n in (1, 2, 3)},
    **{f"interlock_{name}": 0 for name in (*MOVEMENTS, "winding")},
}


@pytest.fixture
def car() -> EquipmentType:
    assert _problems == []
    return _data.type


def guards(car: EquipmentType, command: str, **values: float) -> set[str]:
    """Keys of the sentences that are not met."""
    now = {**READY, **values}
    every = [
        guard
        for guard in (*car.permissives, *car.interlocks)
        if command in guard.commands or (not guard.commands and car.commands[command].moves)
    ]
    return {guard.key for guard in every if parse(guard.expression).true(now) is not True}


def test_settings_fill_their_image_in_order_and_their_defaults_are_within_limits(car: EquipmentType) -> None:
    plc = car.device.plc
    assert plc and plc.settings
    values = {key: setpoint.default for key, setpoint in car.setpoints.items()}
    values |= {"device_coil_smallest": 600.0, "device_coil_largest": 1900.0}
    for number, (key, setpoint) in enumerate(car.setpoints.items()):
        register = car.points[key].register
        assert register
        where = (register.address, register.type, register.writable)
        assert where == (plc.settings.address + 2 + 2 * number, Words.F32, True)
        assert parse(f"{setpoint.low} <= {key} <= {setpoint.high}").true(values) is True, key
        low, high = setpoint.normal or (setpoint.default, setpoint.default)
        assert low is not None and high is not None and setpoint.default is not None
        assert low <= setpoint.default <= high, key
        assert setpoint.certainty == "G", "no source gives these numbers"


def test_commands_have_the_codes_of_the_manual(car: EquipmentType) -> None:
    assert {key: command.code for key, command in car.commands.items() if command.code} == {
        "start_automatic": 1,
        "stop": 2,
        "select_manual": 3,
        "reset": 4,
        "select_target": 5,
        "remove_coil": 6,
        "start_winding": 7,
        "stop_winding": 8,
    }
    held = {key: command.hold_bits for key, command in car.commands.items() if command.hold}
    assert held == {f"jog_{name}": 1 << n for n, name in enumerate(MOVEMENTS)}


def test_stop_asks_nothing_and_nothing_guards_it(car: EquipmentType) -> None:
    stop = car.commands["stop"]
    assert (stop.stop, stop.level, stop.role) == (True, "C0", "operator")
    assert [guard.key for guard in (*car.permissives, *car.interlocks) if "stop" in guard.commands] == []


@pytest.mark.parametrize(
    ("command", "values", "unmet"),
    [
        ("start_automatic", {}, set()),
        ("start_automatic", {"emergency_stop": 1}, {"emergency_stop"}),
        ("start_automatic", {"guards_closed": 0, "held": 1}, {"guards", "acknowledged"}),
        ("start_automatic", {"host_silent": 1}, {"host"}),
        ("select_manual", {"moving": 1}, {"standstill"}),
        ("reset", {"held": 1}, set()),
        ("reset", {"held": 1, "collision": 1}, {"collision"}),
        ("jog_forward", {"moving": 1}, set()),
        ("jog_forward", {"mode": 1}, {"manual"}),
        ("jog_up", {"interlock_up": 1}, {"up_free"}),
        ("jog_up", {"interlock_forward": 1}, set()),
        ("jog_collapse", {"interlock_collapse": 1}, {"collapse_free"}),
        ("start_winding", {"mode": 0}, {"switched_on"}),
        ("stop_winding", {}, {"winding"}),
        ("remove_coil", {}, {"coil_on_saddle"}),
        ("remove_coil", {"saddle_2": 1, "emergency_stop": 1}, set()),
        ("select_target", {"emergency_stop": 1, "held": 1}, set()),
    ],
)
def test_what_stands_in_the_way_is_named(
    car: EquipmentType, command: str, values: dict[str, float], unmet: set[str]
) -> None:
    assert guards(car, command, **values) == unmet


def test_lost_communication_raises_one_alarm_and_leaves_the_others_as_they_are(car: EquipmentType) -> None:
    known = {alarm.key: parse(alarm.expression).true({}) for alarm in car.alarms if alarm.expression}
    assert [key for key, raised in known.items() if raised is not None] == ["communication"]


def test_an_emergency_stop_raises_one_alarm(car: EquipmentType) -> None:
    """The pump goes off with it and the pressure falls; that says nothing new."""
    now = {
        **{name: 0.0 for point in car.alarms if point.expression for name in parse(point.expression).names},
        **{key: 1.0 for key in ("emergency_stop", "guard_1", "guard_2", "guard_3", "oil_ok", "limits_plausible")},
        **{key: 1.0 for key in ("drive_horizontal", "drive_vertical")},
        "fault": 1.0,
    }
    raised = {alarm.key for alarm in car.alarms if alarm.expression and parse(alarm.expression).true(now)}
    assert raised == {"emergency_stop"}


def test_an_event_raises_the_alarm_of_its_own_guard_or_drive(car: EquipmentType) -> None:
    by_source = {(alarm.event, alarm.source): alarm.key for alarm in car.alarms if alarm.source is not None}
    assert by_source == {
        (7, 1): "guard_1",
        (7, 2): "guard_2",
        (7, 3): "guard_3",
        (9, 1): "drive_horizontal",
        (9, 2): "drive_vertical",
    }
    for alarm in car.alarms:
        if alarm.event:
            assert alarm.expression and alarm.on_delay > 0, f"{alarm.key}: the event comes first"


def test_texts_of_alarms_name_the_object_fit_a_row_and_help(car: EquipmentType) -> None:
    for language in LANGUAGES:
        texts = car.texts[language]
        for alarm in car.alarms:
            label = texts[alarm.label]
            assert ": " in label and len(label) <= 60 and "!" not in label, label
            for key in (alarm.consequence, alarm.cause, alarm.response):
                assert len(texts[key]) > 15, key
            named = {name for _, name, _, _ in Formatter().parse(label) if name}
            assert named <= ({"source"} if alarm.event else set()), label


def test_every_text_key_of_the_data_exists_in_every_language(car: EquipmentType) -> None:
    wanted = set(types.text_keys(_data)) | {"area", *(setpoint.group for setpoint in car.setpoints.values())}
    for language in LANGUAGES:
        assert wanted - set(car.texts[language]) == set(), language
        assert {
            key for key in car.texts[language] if not re.search(r"(^screen|^training|^help|\.page)\.", key)
        } - wanted == set(), f"{language}: nobody asks for these"


def test_a_machine_that_is_built_otherwise_than_drawn_is_told(car: EquipmentType) -> None:
    measures = [key.removeprefix("device_") for key in car.points if key.startswith("device_")]
    same = {f"device_{key}": 100.0 for key in measures} | {key: 100.0 for key in measures}
    groups = {key: derived.when for key in ("positions_differ", "heights_differ", "sizes_differ")
              if (derived := car.points[key].derived)}  # fmt: skip
    assert len(groups) == 3
    assert not any(parse(when).true(same) for when in groups.values())
    for key in measures:
        if key == "saddles":
            continue
        told = [group for group, when in groups.items() if parse(when).true({**same, f"device_{key}": 101.0})]
        assert len(told) == 1, key
    whole = car.points["configuration_differs"].derived
    assert whole
    for group in groups:
        assert parse(whole.when).true({**dict.fromkeys(groups, 0), group: 1}) is True


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ("mandrel_reach = 900", "mandrel_reach = 900: expected a position behind mandrel_position, which is 1000 mm"),
        ("out_position = 2000", "out_position = 2000: expected a position clear of the mandrel at 1600 mm"),
        ("out_position = 3000", "out_position = 3000: expected a position clear of saddle 3 at 4200 mm"),
        ("saddle_2_position = 5000", "saddle_2_position = 5000: expected a position behind saddle 3"),
        ("coil_largest = 2350", "coil_largest = 2350: expected a coil under which the lowered car passes"),
        ("clearance = 60", "clearance = 60: expected at least 100 mm"),
        ("lift = 800", "lift = 800: expected a way up to the saddles at 700 mm"),
        ("position_tolerance = 30", "position_tolerance = 30: expected more than 0, less than 30 mm"),
        ("travel = 9000", "travel = 9000: expected more than saddle_1_position, which is 9000 mm"),
    ],
)
def test_a_line_that_nobody_could_build_is_told(tmp_path: Path, options: str, told: str) -> None:
    (tmp_path / "plant.toml").write_text(PLANT + options, "utf-8")
    plant, problems = read_plant(tmp_path)
    assert plant is None
    assert any(f"equipment.cc1.{told}" in str(problem) for problem in problems), list(map(str, problems))


def test_what_a_sequence_may_ask_and_what_its_tests_may_set_is_said(car: EquipmentType) -> None:
    assert len(car.actions) == 9 and car.simulation_presets["pressure"] == (-1, 250)
