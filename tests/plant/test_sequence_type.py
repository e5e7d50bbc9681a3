"""The data of the type `sequence` say what its manual says, and nothing in them contradicts the rest."""

import re
from pathlib import Path
from string import Formatter

import pytest

from app.blocks.sequence import Cause, SequenceEvent, SequenceState, StepState
from app.plant import types
from app.plant.definitions import EquipmentType, Point
from app.plant.expression import parse
from app.plant.loader import read_plant
from app.plant.plant_files.languages import LANGUAGES

_data, _problems = types.read_type("sequence", LANGUAGES)
PLANT = """
[plant]
name = "Hall"
timezone = "Europe/Zagreb"
languages = ["en"]
[links.hall]
transport = "memory"
[equipment.seq1]
type = "sequence"
link = "hall"
unit = 1
definition = "three"
"""
DEFINITION = """
[sequence]
label = "Three"
[[steps]]
key = "one"
label = "One"
[[steps]]
key = "two"
label = "Two"
[[steps]]
key = "three"
label = "Three"
"""
IDLE = {
    "state": 0,
    "step": 0,
    "needs_acknowledge": 0,
    "machine_manual": 0,
    "start_possible": 1,
    "single_step": 0,
    "first_out_cause": 0,
    "forces": 0,
    "configuration_differs": 0,
}
RUNNING = {**IDLE, "state": 1, "step": 2, "start_possible": 0}


@pytest.fixture
def kind() -> EquipmentType:
    assert _problems == []
    return _data.type


def points(folder: Path) -> dict[str, Point]:
    (folder / "sequences").mkdir()
    (folder / "sequences" / "three.toml").write_text(DEFINITION, "utf-8")
    (folder / "plant.toml").write_text(PLANT, "utf-8")
    plant, problems = read_plant(folder)
    assert plant, problems
    return dict(plant.equipment["seq1"].points)


@pytest.mark.parametrize(
    ("key", "address", "type"),
    [
        ("state", 0x0101, "u16"),
        ("abort_forceable", 0x0109, "u16"),
        ("run_time", 0x010A, "f32"),
        ("runs_timed_out", 0x0112, "u32"),
        ("longest_run", 0x0118, "f32"),
        ("first_out_bit", 0x011E, "u16"),
        ("first_out_time", 0x0120, "u64"),
        ("run_start", 0x0128, "u64"),
        ("falls", 0x012C, "u16"),
        ("longest_force", 0x0182, "f32"),
        ("stall_after", 0x0202, "f32"),
    ],
)
def test_a_value_stands_where_the_manual_says(kind: EquipmentType, key: str, address: int, type: str) -> None:
    register = kind.points[key].register
    assert register and (register.address, register.type) == (address, type)


def test_a_sequence_has_a_row_for_each_of_its_steps_and_sixteen_falls_and_32_forces(tmp_path: Path) -> None:
    found = points(tmp_path)
    assert {key.split("_")[1] for key, point in found.items() if point.table == "step"} == {"1", "2", "3"}
    assert {key.split("_")[1] for key, point in found.items() if point.table == "fall"} == {
        str(n) for n in range(1, 17)
    }
    assert {key.split("_")[1] for key, point in found.items() if point.table == "force"} == {
        str(n) for n in range(1, 33)
    }
    elapsed, back, remaining = (found[key].register for key in ("step_3_elapsed", "fall_16_back", "force_32_remaining"))
    assert elapsed and elapsed.address == 0x0804 + 2 * 32 + 12
    assert back and back.address == 0x3004 + 15 * 16 + 10
    assert remaining and remaining.address == 0x4004 + 31 * 12 + 6


def test_states_causes_and_events_of_the_block_have_a_text(kind: EquipmentType) -> None:
    assert set(kind.points["state"].texts) == {int(state) for state in SequenceState}
    assert set(kind.points["first_out_cause"].texts) == {int(cause) for cause in Cause}
    assert set(_data.columns["step"]["state"].point.texts) == {int(state) for state in StepState}
    assert {code: kind.events[code] for code in map(int, SequenceEvent)} == {
        int(event): event.name.lower() for event in SequenceEvent
    }


def guards(kind: EquipmentType, command: str, now: dict[str, float]) -> set[str]:
    """Keys of the sentences that are not met."""
    every = [
        guard
        for guard in (*kind.permissives, *kind.interlocks)
        if command in guard.commands or (not guard.commands and kind.commands[command].moves)
    ]
    return {guard.key for guard in every if parse(guard.expression).true(now) is not True}


def test_suspend_asks_nothing_and_nothing_guards_it(kind: EquipmentType) -> None:
    suspend = kind.commands["suspend"]
    assert (suspend.stop, suspend.level, suspend.role, suspend.code) == (True, "C0", "operator", 2)
    assert [guard.key for guard in (*kind.permissives, *kind.interlocks) if "suspend" in guard.commands] == []
    assert [key for key, command in kind.commands.items() if command.stop] == ["suspend"]


def test_times_are_set_at_rest_by_an_engineer_and_while_it_runs_only_by_an_administrator_who_says_why(
    kind: EquipmentType,
) -> None:
    plain, running = kind.commands["set_times"], kind.commands["set_times_running"]
    assert (plain.code, plain.role, plain.level) == (11, "engineer", "C3")
    assert (running.code, running.role, running.level, running.needs_reason) == (11, "admin", "C3", True)
    assert guards(kind, "set_times", IDLE) == set()
    assert guards(kind, "set_times", RUNNING) == guards(kind, "set_times", {**RUNNING, "state": 2}) == {"not_running"}
    assert guards(kind, "set_times_running", RUNNING) == set()
    override = running.arguments[3]
    assert (override.name, override.low, override.high) == ("override", "1", "1")
    assert len(plain.arguments) == 3, "the override is 0"


def test_a_force_needs_an_engineer_a_password_and_a_reason_and_ends(kind: EquipmentType) -> None:
    force = kind.commands["force"]
    assert (force.role, force.level, force.needs_reason) == ("engineer", "C4", True)
    step, bit, duration = force.arguments
    assert (step.low, step.high, bit.low, bit.high) == ("0", "steps", "0", "15")
    assert (duration.low, duration.high) == ("1", "longest_force")
    assert guards(kind, "force", {**RUNNING, "configuration_differs": 1}) == {"same_definition"}, "else another bit"
    assert guards(kind, "release", IDLE) == guards(kind, "release_all", IDLE) == {"forced"}


@pytest.mark.parametrize(
    ("command", "now", "unmet"),
    [
        ("start", {}, set()),
        ("start", {"start_possible": 0}, {"start_possible"}),
        ("start", {"machine_manual": 1, "start_possible": 0}, {"machine_automatic", "start_possible"}),
        ("start", {"state": 5, "needs_acknowledge": 1, "start_possible": 0}, {"acknowledged", "start_possible"}),
        ("start", {"state": 1, "start_possible": 0}, {"not_running", "start_possible"}),
        ("abort", {}, {"running"}),
        ("abort", {"state": 2}, set()),
        ("resume", {"state": 1}, {"suspended"}),
        ("resume", {"state": 2}, set()),
        ("advance", {"state": 1}, {"single_step"}),
        ("advance", {"state": 1, "single_step": 1}, set()),
        ("acknowledge", {}, {"first_out"}),
        ("acknowledge", {"state": 4, "needs_acknowledge": 1, "first_out_cause": 4}, set()),
        ("acknowledge", {"state": 1, "first_out_cause": 5}, {"first_out"}),
        ("automatic_on", {"start_possible": 0}, set()),
    ],
)
def test_what_stands_in_the_way_is_named(
    kind: EquipmentType, command: str, now: dict[str, float], unmet: set[str]
) -> None:
    assert guards(kind, command, {**IDLE, **now}) == unmet


def test_lost_communication_raises_one_alarm_and_leaves_the_others_as_they_are(kind: EquipmentType) -> None:
    known = {alarm.key: parse(alarm.expression).true({}) for alarm in kind.alarms if alarm.expression}
    assert [key for key, raised in known.items() if raised is not None] == ["communication"]


def test_the_order_of_alarms_comes_from_the_ring(kind: EquipmentType) -> None:
    assert {alarm.key: (alarm.event, alarm.event_clear) for alarm in kind.alarms if alarm.event} == {
        "timed_out": (11, 0),
        "aborted": (12, 0),
        "stalled": (7, 8),
    }
    for alarm in kind.alarms:
        if alarm.event:
            assert alarm.expression and alarm.on_delay > 0, f"{alarm.key}: the event comes first"


def test_an_active_force_is_an_alarm_of_the_lowest_priority(kind: EquipmentType) -> None:
    (force,) = (alarm for alarm in kind.alarms if alarm.key == "force_active")
    assert (force.priority, force.value) == (4, "forces")
    assert parse(force.expression).true({"forces_active": 1}) is True


def test_texts_of_alarms_name_the_object_fit_a_row_and_help(kind: EquipmentType) -> None:
    for language in LANGUAGES:
        texts = kind.texts[language]
        for alarm in kind.alarms:
            label = texts[alarm.label]
            assert ": " in label and len(label) <= 60 and "!" not in label, label
            for key in (alarm.consequence, alarm.cause, alarm.response):
                assert len(texts[key]) > 15, key
            named = {name for _, name, _, _ in Formatter().parse(label) if name}
            assert named <= ({"source"} if alarm.event else set()), label


def test_every_text_key_of_the_data_exists_in_every_language(kind: EquipmentType) -> None:
    product = {f"table.{name}" for name in ("generation", "capacity", "count")}
    wanted = set(types.text_keys(_data)) | {"area", *(setpoint.group for setpoint in kind.setpoints.values())}
    for language in LANGUAGES:
        assert wanted - product - set(kind.texts[language]) == set(), language
        assert {
            key for key in kind.texts[language] if not re.search(r"(^screen|^training|^help|\.page)\.", key)
        } - wanted == set(), f"{language}: nobody asks for these"


SAME = {
    "device_steps": 8,
    "definition_steps": 8,
    "config_crc": 0xDEADBEEF,
    "definition_crc": float(0xDEADBEEF),
    "longest_force": 3600,
    "definition_longest_force": 3600,
    "keep_forces": 0,
    "definition_keep_forces": 0,
}


@pytest.mark.parametrize(
    "other", [{"device_steps": 7}, {"config_crc": 0xDEADBEEE}, {"longest_force": 28800}, {"keep_forces": 1}]
)
def test_a_plc_with_another_sequence_is_told(kind: EquipmentType, other: dict[str, float]) -> None:
    derived = kind.points["configuration_differs"].derived
    assert derived
    assert parse(derived.when).true(SAME) is False
    assert parse(derived.when).true(SAME | other) is True
