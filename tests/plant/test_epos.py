"""The axis' data say what the reference sheet, the words of the profile and the virtual axis say."""

import importlib
import re
from pathlib import Path

import pytest

from app.plant import types
from app.plant.definitions import EquipmentType, Type
from app.plant.expression import parse
from app.plant.loader import read_plant
from app.plant.plant_files.languages import LANGUAGES
from app.profidrive import position_words as words
from app.settings import bundled
from app.sim.epos import registers
from app.sim.epos.messages import ALARMS, FAULTS
from app.sim.plant import read_simulated
from app.sim.sinamics.registers import FIRST_NUMBER, MAILBOX

_data, _problems = types.read_type("epos", LANGUAGES)
PROCESS = {
    40100: "control_word", 40101: "position_control", 40102: "position_options", 40103: "control_word_2", 40104: "override",
    40105: "target", 40107: "velocity", 40109: "acceleration", 40110: "status_word", 40111: "position_status",
    40112: "position_status_2", 40113: "status_word_2", 40114: "message_word", 40115: "position", 40117: "speed_percent",
    40119: "fault_code", 40120: "deceleration", 40122: "warning_code",
}  # fmt: skip


@pytest.fixture
def kind() -> EquipmentType:
    assert _problems == []
    return _data.type


def wholes(kind: EquipmentType) -> dict[int, str]:
    """Points by register number, parts of words aside."""
    return {
        point.register.address + FIRST_NUMBER: key
        for key, point in kind.points.items()
        if point.register and not _data.points[key].part
    }


def test_every_register_of_the_map_is_a_point_and_every_point_one_of_the_map(kind: EquipmentType) -> None:
    free = {40121, 40123}
    assert set(wholes(kind)) == (set(registers.REGISTERS) | set(PROCESS)) - free
    assert {number: wholes(kind)[number] for number in PROCESS} == PROCESS
    assert {key for number, key in PROCESS.items() if kind.points[key].register.type is Type.I32} == {  # type: ignore[union-attr]
        "target", "velocity", "position", "speed_percent"}  # fmt: skip


@pytest.mark.parametrize("number", registers.REGISTERS)
def test_a_point_has_the_scale_unit_and_access_of_its_register(kind: EquipmentType, number: int) -> None:
    if number not in wholes(kind):
        return
    point, theirs = kind.points[wholes(kind)[number]], registers.REGISTERS[number]
    # the firmware is drawn as the map prints it, 470, which is r0018 / 10000
    assert point.register and point.register.scale == pytest.approx(1 if number == 40301 else 1 / theirs.factor)
    assert (point.unit, point.register.writable) == (theirs.unit, theirs.writable)


@pytest.mark.parametrize(
    ("prefix", "bits"),
    [("stw1", words.STW1), ("pstw1", words.POS_STW1), ("pstw2", words.POS_STW2), ("zsw1", words.ZSW1),
     ("pzsw1", words.POS_ZSW1), ("pzsw2", words.POS_ZSW2)],
)  # fmt: skip
def test_bits_stand_where_the_profile_has_them(kind: EquipmentType, prefix: str, bits: words.Word) -> None:
    places = {bit.name: bit.number for bit in bits}
    found = {
        key.removeprefix(f"{prefix}_"): point for key, point in kind.points.items() if key.startswith(f"{prefix}_")
    }
    assert found
    for name, point in found.items():
        assert point.register and (point.register.shift, point.register.mask) == (places[name], 1), name


def test_no_request_reaches_over_a_register_that_the_drive_lacks(kind: EquipmentType) -> None:
    there = {number - FIRST_NUMBER for number in (*registers.REGISTERS, *range(40100, 40120), *MAILBOX)}
    for address in range(0, 0x300):
        assert (address in there) is not any(low <= address <= high for low, high in kind.device.holes), address


def test_what_stops_waits_for_nothing(kind: EquipmentType) -> None:
    assert [key for key, command in kind.commands.items() if command.stop] == ["stop"]
    for key in ("stop", "quick_stop", "coast", "reject_task", "intermediate_stop"):
        assert not any(write.after or write.when for write in kind.commands[key].writes)
        assert not kind.commands[key].moves


def test_every_fault_and_alarm_is_an_alarm_of_its_own(kind: EquipmentType) -> None:
    alarms = {alarm.key: alarm for alarm in kind.alarms}
    quiet = {"zsw1_fault": 1, "zsw1_alarm": 1, "alarm_number": 0, "alarm_code": 0} | {
        f"fault_{n}": 0 for n in range(1, 9)
    }
    for number in FAULTS:
        alarm = parse(alarms[f"f{number:05d}"].expression)
        assert all(alarm.true({**quiet, f"fault_{n}": number}) for n in range(1, 9)) and not alarm.true(quiet)
        assert not parse(alarms["unknown_fault"].expression).true({**quiet, "fault_1": number})
    for number in ALARMS:
        alarm = parse(alarms[f"a{number:05d}"].expression)
        assert alarm.true({**quiet, "alarm_code": number}) and not alarm.true(quiet)
    assert parse(alarms["unknown_fault"].expression).true({**quiet, "fault_1": 12345})
    assert parse(alarms["unknown_alarm"].expression).true({**quiet, "alarm_code": 12345})
    for language in LANGUAGES:
        for number in (*FAULTS, *ALARMS):
            assert kind.texts[language][f"message.{number}.name"].startswith(
                f"{'A' if number in ALARMS else 'F'}{number:05d} – "
            )


def test_it_has_the_parameters_and_texts_of_its_kin_and_its_own_win(kind: EquipmentType) -> None:
    kin = types.read_type("sinamics", LANGUAGES)[0].type
    assert kind.kin == "sinamics" and kind.drive_parameters == kin.drive_parameters and len(kind.drive_parameters) > 250
    for language in LANGUAGES:
        assert kind.texts[language]["parameter.p2599"] == kin.texts[language]["parameter.p2599"]
        assert kind.texts[language]["type"] != kin.texts[language]["type"]


def test_the_package_of_the_virtual_axis_offers_the_same_messages() -> None:
    package = importlib.import_module("app.sim.epos")
    assert set(package.FAULTS) == {*FAULTS, *ALARMS} and len(package.FAULTS) == len(FAULTS) + len(ALARMS)


def test_its_plant_has_no_mistakes_and_a_travel_the_wrong_way_is_one(tmp_path: Path) -> None:
    plant, problems = read_simulated(bundled("plants/epos"))
    assert plant and problems == []
    text = (bundled("plants/epos") / "plant.toml").read_text("utf-8")
    (tmp_path / "plant.toml").write_text(text.replace("travel_low = 0", "travel_low = 900"), "utf-8")
    _, problems = read_plant(tmp_path)
    assert [problem for problem in problems if "travel_low" in str(problem) and "800" in str(problem)]


def test_kin_that_is_not_there_is_told(tmp_path: Path) -> None:
    folder = tmp_path / "lonely"
    folder.mkdir()
    (folder / "device.toml").write_text('label = "type"\narea = "drives"\nkin = "nobody"\n[device]\n', "utf-8")
    (folder / "points.toml").write_text("", "utf-8")
    _, problems = types.read_type("lonely", ["en"], tmp_path)
    assert any("kin" in str(problem) and "nobody" in str(problem) for problem in problems)


def test_the_page_names_the_words_that_are_sent_and_its_plant_file_is_read(kind: EquipmentType, tmp_path: Path) -> None:
    page = (bundled("docs") / "epos.md").read_text("utf-8")
    for key, command in kind.commands.items():
        for write in (*command.writes, *command.release):
            if write.point == "control_word":
                assert f"0x{int(float(write.value)):04X}" in page, key
        last = [int(float(write.value)) for write in command.writes if write.point == "control_word"][-1:]
        rows = [
            row for row in page.splitlines() if row.startswith("| ") and all(f"0x{word:04X}" in row for word in last)
        ]
        for mode in {int(float(write.value)) for write in command.writes if write.point == "position_control"}:
            told = f"POS_STW1 0x{mode:04X}" if mode else r"POS_STW1 0\b(?!x)"
            assert any(re.search(told, row) for row in rows), key
    (block,) = re.findall(r"```toml\n(.*?)```", page, re.S)
    head = '[plant]\nname = "x"\ntimezone = "UTC"\nlanguages = ["hr", "en", "de", "cs"]\n'
    (tmp_path / "plant.toml").write_text(head + block, "utf-8")
    plant, problems = read_plant(tmp_path)
    assert plant and problems == [] and not plant.links["axes"].may_write
