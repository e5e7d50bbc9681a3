"""What is known of parameters that are registers comes from data, and of the others nothing is said."""

from dataclasses import replace
from pathlib import Path

import pytest

from app.plant import register_parameters, types
from app.plant.definitions import Device, ParameterMap
from app.plant.plant_files.languages import LANGUAGES
from app.plant.register_parameters import address_of, codes_in, has_code, read_known, read_parameter_map, unknown
from app.plant.tables import Source
from app.profidrive.parameter_access.parameter import DriveParameter, When
from app.sim.eura_e800.parameters import PARAMETERS

TYPE = types.read_type("eura_e800", LANGUAGES)[0].type
MAP = TYPE.device.parameters


def source(folder: Path, text: str) -> Source:
    (folder / "file.toml").write_text(text)
    return Source(folder / "file.toml", "file.toml")


def told(source: Source) -> list[str]:
    return [f"{problem.key}: {problem.value}, expected {problem.expected}" for problem in source.problems]


def test_a_map_is_read_and_one_that_is_not_there_is_none(tmp_path: Path) -> None:
    text = '[parameters]\npermanent = { address = 0x2001, value = 3 }\nranges = [["F100", "F160"]]\n'
    text += 'individual = ["F900"]\n'
    file = source(tmp_path, text)
    found = read_parameter_map(file.table(), Device(group_read={"once": 6}))
    assert found == ParameterMap(6, (0x2001, 3), (("F100", "F160"),), frozenset({"F900"})) and told(file) == []
    assert read_parameter_map(source(tmp_path, "[device]\n").table(), Device()) is None


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "parameters.ranges: missing"),
        ('ranges = [["F100"]]', "parameters.ranges"),
        ('ranges = [["F160", "F100"]]', "parameters.ranges"),
        ('ranges = [["F100", "F230"]]', "parameters.ranges"),
        ('ranges = [["F100", "F1"]]', 'first and last code of a group: ["F100", "F160"]'),
        ("ranges = [7]", "parameters.ranges: 7"),
        ("ranges = []\npermanent = { address = 70000, value = 3 }", "parameters.permanent.address: 70000"),
        ("ranges = []\nunlock = 3", "parameters.unlock"),
        ('ranges = []\nindividual = ["p0918"]', "parameters.individual"),
    ],
)
def test_what_cannot_be_a_map_is_told(tmp_path: Path, text: str, says: str) -> None:
    file = source(tmp_path, f"[parameters]\n{text}\n")
    read_parameter_map(file.table(), Device())
    assert len(told(file)) == 1 and says in told(file)[0], told(file)


@pytest.mark.parametrize(
    ("row", "says"),
    [
        ('F431 = { certainty = "M", options = [70000] }', "F431.options"),
        ('F431 = { certainty = "Z" }', "F431.certainty"),
        ('F431 = { certainty = "M", high = 70000 }', "F431.high"),
        ('F431 = { certainty = "M", meaning = "?" }', "F431.meaning"),
        ('F113 = { certainty = "M" }', "a code like F431 that no setpoint has"),
        ('p1120 = { certainty = "M" }', "a code like F431 that no setpoint has"),
    ],
)
def test_what_cannot_be_a_parameter_is_told(tmp_path: Path, row: str, says: str) -> None:
    file = source(tmp_path, row + "\n")
    read_known(file.table(), TYPE.setpoints, TYPE.points)
    assert len(told(file)) == 1 and says in told(file)[0], told(file)


def test_a_setpoint_whose_point_is_wrong_is_none_of_what_is_known(tmp_path: Path) -> None:
    first, second, *rest = (key for key, one in TYPE.setpoints.items() if address_of(one.code) is not None)
    points = {key: point for key, point in TYPE.points.items() if key != first}
    points[second] = replace(points[second], register=None)
    file = source(tmp_path, "")
    found = read_known(file.table(), TYPE.setpoints, points)
    assert rest and found.keys() == {TYPE.setpoints[key].code for key in rest}, told(file)


def test_everything_known_is_told_as_the_setpoint_has_it() -> None:
    for setpoint in TYPE.setpoints.values():
        parameter, point = TYPE.drive_parameters[setpoint.code], TYPE.points[setpoint.key]
        assert (parameter.number, parameter.scale, parameter.unit) == (
            point.register.address,  # type: ignore[union-attr]
            point.register.scale,  # type: ignore[union-attr]
            point.unit,
        )
        assert parameter.has_default is (setpoint.default is not None)
        assert (parameter.when is When.STOPPED) is setpoint.stopped_only
        assert parameter.label == point.label and parameter.point == setpoint.key
    assert TYPE.drive_parameters["F113"].bounds == ("F112", "F111") and TYPE.drive_parameters["F114"].bounds == ("", "")


@pytest.mark.parametrize("parameter", TYPE.drive_parameters.values(), ids=lambda one: one.code)
def test_the_virtual_drive_has_every_known_parameter_with_the_same_scale_and_default(parameter: DriveParameter) -> None:
    virtual = PARAMETERS[parameter.code]
    assert (virtual.address, virtual.scale, virtual.unit) == (parameter.number, parameter.scale, parameter.unit)
    assert virtual.default == parameter.default or not parameter.has_default


def test_a_code_is_there_when_a_range_has_it() -> None:
    codes = set(codes_in(MAP))
    every = {f"F{group}{number:02d}" for group in "0123456789ABF" for number in range(100)}
    for code in (*every, "F1140", "F11", "f114", "", "P114", "F1x4"):
        assert has_code(MAP, code) == (code in codes), code


def test_of_every_other_code_there_is_the_number_and_nothing_else() -> None:
    assert MAP is not None
    codes = list(codes_in(MAP))
    assert len(codes) == len(set(codes)) == 550 and codes[0] == "F100" and codes[-1] == "FA70"
    for code in codes:
        parameter = unknown(code)
        assert parameter is not None and parameter.code == code and not parameter.known and not parameter.has_default
        assert (parameter.unit, parameter.scale, parameter.certainty) == ("", 1.0, "")
        assert parameter.when is When.STOPPED, "nobody knows what it does to a motor that turns"
    assert unknown("F000") is None and unknown("p1120") is None


def test_groups_have_texts_in_every_language() -> None:
    assert MAP is not None
    assert list(register_parameters.text_keys(MAP)) == [f"parameter.group.f{digit}" for digit in "123456789a"]


@pytest.mark.parametrize(
    ("name", "codes"), [("eura_e800", {"F900"}), ("sinamics", {"p0918", "p2021", "p2507", "p2525"})]
)
def test_the_address_of_a_drive_is_its_own(name: str, codes: set[str]) -> None:
    known = types.read_type(name, LANGUAGES)[0].type.drive_parameters
    assert {code for code, one in known.items() if one.individual} == codes
