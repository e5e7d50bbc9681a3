"""The drive's data say what the reference sheet, the words of the profile and the virtual drive say."""

import importlib
import re
from itertools import product
from pathlib import Path

import pytest

from app.plant import types
from app.plant.definitions import EquipmentType, Point, Type
from app.plant.expression import parse
from app.plant.loader import read_plant
from app.plant.plant_files.languages import LANGUAGES
from app.profidrive.words import CONTROL_BITS, ENABLES, RUN, STATUS_BITS, Control, Status
from app.settings import bundled
from app.sim.plant import read_simulated
from app.sim.sinamics import registers
from app.sim.sinamics.messages import ALARMS, FAULTS

_data, _problems = types.read_type("sinamics", LANGUAGES)
PROCESS = {registers.CONTROL: "control_word", registers.SETPOINT: "setpoint", registers.STATUS: "status_word",
           registers.ACTUAL: "speed_percent"}  # fmt: skip


@pytest.fixture
def drive() -> EquipmentType:
    assert _problems == []
    return _data.type


def wholes(drive: EquipmentType) -> dict[int, tuple[str, Point]]:
    """Points by register number, parts of words aside."""
    return {
        point.register.address + registers.FIRST_NUMBER: (key, point)
        for key, point in drive.points.items()
        if point.register and not _data.points[key].part
    }


def test_every_register_of_the_map_is_a_point_and_every_point_one_of_the_map(drive: EquipmentType) -> None:
    assert set(wholes(drive)) == set(registers.REGISTERS) | set(PROCESS)
    assert {number: wholes(drive)[number][0] for number in PROCESS} == PROCESS


@pytest.mark.parametrize("number", registers.REGISTERS)
def test_a_point_has_the_scale_unit_range_sign_and_access_of_its_register(drive: EquipmentType, number: int) -> None:
    key, point = wholes(drive)[number]
    register, theirs = point.register, registers.REGISTERS[number]
    assert register
    # the firmware is drawn as the map prints it, 470, which is r0018 / 10000
    assert register.scale == pytest.approx(1 if number == 40301 else 1 / theirs.factor)
    assert (point.unit, register.writable) == (theirs.unit, theirs.writable)
    assert (register.type is Type.I16) is (theirs.low < 0)
    assert (key in drive.setpoints) is theirs.writable
    if theirs.writable:
        setpoint = drive.setpoints[key]
        assert (float(setpoint.low), float(setpoint.high), setpoint.code) == (theirs.low, theirs.high, theirs.parameter)
    assert ("G" in point.certainty) is (theirs.certainty == "G" or key == "priority")


@pytest.mark.parametrize(("word", "names", "bits"), [("stw1", Control, CONTROL_BITS), ("zsw1", Status, STATUS_BITS)])
def test_all_16_bits_of_both_words_are_points_with_their_own_texts(
    drive: EquipmentType, word: str, names: type[Control] | type[Status], bits: tuple[object, ...]
) -> None:
    keys = [f"{word}_{name.name.lower()}" for name in names]
    assert len(keys) == len(bits) == 16
    for number, key in enumerate(keys):
        register = drive.points[key].register
        assert register and (register.shift, register.mask, register.writable) == (number, 1, False)
    for language in LANGUAGES:
        said = [drive.texts[language][f"point.{key}"] for key in keys]
        assert len(set(said)) == 16, language


def test_the_state_is_told_by_every_word_the_status_can_have(drive: EquipmentType) -> None:
    state = drive.points["state"]
    assert state.register and state.register.mask is not None
    for bits in product((0, 1), repeat=16):
        word = sum(bit << n for n, bit in enumerate(bits))
        name = state.texts[word & state.register.mask]
        if word & Status.FAULT:
            assert name in ("state.fault", "state.stopping_by_fault")
        elif word & Status.SWITCHING_ON_INHIBITED:
            assert name == "state.inhibited"
        elif word & Status.OPERATION_ENABLED:
            assert name == ("state.operation" if word & Status.NO_QUICK_STOP else "state.quick_stop")


def test_no_request_reaches_over_a_register_that_the_drive_lacks(drive: EquipmentType) -> None:
    there = {number - registers.FIRST_NUMBER for number in (*wholes(drive), *registers.MAILBOX)}
    for address in range(0, 0x300):
        assert (address in there) is not any(low <= address <= high for low, high in drive.device.holes), address
    assert not any(low <= drive.device.training <= high for low, high in drive.device.holes)


def words(drive: EquipmentType, command: str) -> list[int]:
    return [int(float(w.value)) for w in drive.commands[command].writes if w.point == "control_word"]


def test_the_words_written_are_those_of_the_profile(drive: EquipmentType) -> None:
    assert {key: words(drive, key) for key in drive.commands} == {
        "forward": [ENABLES, RUN],
        "reverse": [ENABLES, RUN | Control.INVERT],
        "stop": [ENABLES],
        "quick_stop": [ENABLES & ~Control.NO_QUICK_STOP],
        "coast": [ENABLES & ~Control.NO_COAST_STOP],
        "reset": [ENABLES, ENABLES | Control.ACKNOWLEDGE, ENABLES],
        "set_setpoint": [],
    }


def test_what_stops_waits_for_nothing_and_nothing_but_communication_guards_it(drive: EquipmentType) -> None:
    stop = drive.commands["stop"]
    assert (stop.stop, stop.level, stop.moves) == (True, "C0", False)
    assert [key for key, command in drive.commands.items() if command.stop] == ["stop"]
    for key in ("stop", "quick_stop", "coast"):
        assert not any(write.after or write.when for write in drive.commands[key].writes)
    guarded = {guard.key for guard in (*drive.permissives, *drive.interlocks) if "quick_stop" in guard.commands}
    assert guarded == {"communication", "control_requested"}


@pytest.mark.parametrize(("running", "inverted", "asked"), [(0, 0, False), (1, 0, True), (1, 1, False)])
def test_turning_a_running_drive_round_is_confirmed_twice(
    drive: EquipmentType, running: int, inverted: int, asked: bool
) -> None:
    condition, level = drive.commands["reverse"].level_when or ("", "")
    assert level == "C2" and parse(condition).true({"running": running, "stw1_invert": inverted}) is asked
    condition, _ = drive.commands["forward"].level_when or ("", "")
    assert parse(condition).true({"running": running, "stw1_invert": 1 - inverted}) is asked


def test_every_fault_and_alarm_is_an_alarm_of_its_own_wherever_it_stands(drive: EquipmentType) -> None:
    alarms = {alarm.key: alarm for alarm in drive.alarms}
    quiet = {"zsw1_fault": 1, "zsw1_alarm": 1, "alarm_number": 0, "alarm_code": 0} | {
        f"fault_{n}": 0 for n in range(1, 9)
    }
    for number in FAULTS:
        alarm = parse(alarms[f"f{number:05d}"].expression)
        assert all(alarm.true({**quiet, f"fault_{n}": number}) for n in range(1, 9))
        assert not alarm.true(quiet) and not alarm.true({**quiet, "fault_1": number, "zsw1_fault": 0})
        assert not parse(alarms["unknown_fault"].expression).true({**quiet, "fault_1": number})
    for number in ALARMS:
        alarm = parse(alarms[f"a{number:05d}"].expression)
        assert all(alarm.true({**quiet, place: number}) for place in ("alarm_number", "alarm_code"))
        assert not alarm.true(quiet) and not parse(alarms["unknown_alarm"].expression).true(
            {**quiet, "alarm_code": number}
        )
    assert parse(alarms["unknown_fault"].expression).true({**quiet, "fault_1": 12345})
    assert {alarm.alarm_class for alarm in drive.alarms if alarm.key.startswith("f")} == {"drive"}


def test_every_message_has_its_texts_and_shows_its_number(drive: EquipmentType) -> None:
    for language in LANGUAGES:
        texts = drive.texts[language]
        for number in (*FAULTS, *ALARMS):
            assert texts[f"message.{number}.name"].startswith(f"{'A' if number in ALARMS else 'F'}{number:05d} – ")
            for part in ("cause", "remedy"):
                assert texts[f"message.{number}.{part}"]
    assert all(set(drive.points[f"fault_{n}"].texts) == {0, *FAULTS, *ALARMS} for n in range(1, 9))


def test_the_package_of_the_virtual_drive_offers_the_same_messages() -> None:
    package = importlib.import_module("app.sim.sinamics")
    assert set(package.FAULTS) == {*FAULTS, *ALARMS} and len(package.FAULTS) == len(FAULTS) + len(ALARMS)


def test_its_plant_has_no_mistakes_and_its_virtual_drives_take_it() -> None:
    plant, problems = read_simulated(bundled("plants/sinamics"))
    assert plant and problems == []
    assert {item.type.name for item in plant.equipment.values()} == {"sinamics"}


def test_the_plant_file_of_the_page_is_read_and_sends_nothing(tmp_path: Path) -> None:
    page = (bundled("docs") / "sinamics.md").read_text("utf-8")
    (block,) = re.findall(r"```toml\n(.*?)```", page, re.S)
    head = '[plant]\nname = "x"\ntimezone = "UTC"\nlanguages = ["hr", "en", "de", "cs"]\n'
    (tmp_path / "plant.toml").write_text(head + block, "utf-8")
    plant, problems = read_plant(tmp_path)
    assert plant and problems == [] and not plant.links["drives"].may_write


def test_the_page_names_the_words_that_are_sent(drive: EquipmentType) -> None:
    page = (bundled("docs") / "sinamics.md").read_text("utf-8")
    for key in drive.commands:
        for word in words(drive, key):
            assert f"0x{word:04X}" in page, key
