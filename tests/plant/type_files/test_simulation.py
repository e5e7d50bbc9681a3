"""simulation.toml: what is wrong in it is told with file, line, key, value and what was expected; nothing is taken and then never true."""

from pathlib import Path

import pytest

from app.plant.loader import read_plant
from app.plant.problems import Problem
from app.plant.simulation import Movement, Rule, WriteRow
from tests.own_types import METER, TYPES, VALVE, write_own


def read(folder: Path, name: str, text: str, **files: str) -> list[Problem]:
    write_own(folder)
    own = folder / "equipment" / name
    for file, given in {"simulation": text, **files}.items():
        (own / f"{file}.toml").write_text(given, "utf-8")
    return read_plant(folder)[1]


def test_what_stands_in_it_is_read(tmp_path: Path) -> None:
    plant, problems = read_plant(write_own(tmp_path))
    assert plant, problems
    meter, pumps = (plant.equipment[id].type.simulation for id in ("e1", "p1"))
    assert meter and pumps
    assert meter.start == {"limit": 50, "energy": "1000 * rated_power"}
    assert meter.writes[0] == WriteRow("switch", 1, "fault == 0", 4, {"state": 1})
    assert meter.rules == (Rule("fault == 7", 0.0, {"state": 0}),)
    assert meter.values["power"] == Movement("min(0.8 * rated_power, limit) * state", 2.0, noise=0.01)
    assert meter.values["life"] == Movement(every=0.5, modulo=1000)
    assert [rule.when for rule in pumps.rules] == [f"state_{pump} == 1" for pump in (1, 2, 3)], (
        "as many as the machine has"
    )


def test_without_the_file_there_is_none_and_an_empty_one_is_a_mistake(tmp_path: Path) -> None:
    (problem,) = read(tmp_path, "logger", "")
    assert (problem.file, problem.value) == ("equipment/logger/simulation.toml", "an empty file")
    (tmp_path / "equipment/logger/simulation.toml").unlink()
    plant, problems = read_plant(tmp_path)
    assert plant and plant.equipment["l1"].type.simulation is None, problems


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("name", "old", "new", "key", "value", "expected"),
    [
        ("meter", "[start]", "[begin]", "begin", "limit", "no such key; one of rules, start, values, writes"),
        ("meter", "limit = 50", "limt = 50", "start.limt", "50", "(perhaps limit)"),
        ("meter", "limit = 50", "limit = 500", "start.limit", "500", "a number from 1 to 100"),
        ("meter", "limit = 50", "", "start.limit", "missing", "a number from 1 to 100"),
        ("meter", "limit = 50", "limit = true", "start.limit", "true", "a number or an expression over options"),
        ("meter", '"1000 * rated_power"', '"1000 * power"', "start.energy", "1000 * power", "options of meter"),
        ("meter", '"1000 * rated_power"', "-1", "start.energy", "-1", "a number from 0 to "),
        ("meter", "limit = 50", "limit = 50\nstate = 2", "start.state", "2", "one of 0, 1"),
        ("meter", 'point = "switch"\nvalue = 1', 'point = "swich"\nvalue = 1', "writes.0.point", "swich", "(perhaps switch)"),
        ("meter", 'point = "switch"\nvalue = 1', 'point = "state"\nvalue = 1', "writes.0.point", "state", "state is only read"),
        ("meter", "value = 1\n", "value = 70000\n", "writes.0.value", "70000", "a number from 0 to 65535"),
        ("meter", 'when = "fault == 0"', 'when = "falt == 0"', "writes.0.when", "falt == 0", "or fault; not falt"),
        ("meter", 'when = "fault == 0"', 'when = "fault = 0"', "writes.0.when", "fault = 0", "expected"),
        ("meter", 'when = "fault == 0"\n', "", "writes.0.refuse", "4", "`when` beside it"),
        ("meter", "refuse = 4", "refuse = 11", "writes.0.refuse", "11", "a whole number from 1 to 6"),
        ("meter", "set = { state = 1 }", "set = { state = 5 }", "writes.0.set.state", "5", "one of 0, 1"),
        ("meter", "set = { state = 1 }", "set = { stat = 1 }", "writes.0.set.stat", "1", "(perhaps state)"),
        ("meter", "set = { state = 1 }", "set = { state = [1] }", "writes.0.set.state", "[1]", "a number or a sentence"),
        ("meter", "set = { state = 1 }", "sets = { state = 1 }", "writes.0.sets", "state", "(perhaps set)"),
        ("meter", "value = 0\nset = { state = 0 }", "value = 0", "writes.1.set", "missing", "a table of points"),
        ("meter", '7"\nset = { state = 0 }', '7"\nset = { state = "argument" }', "rules.0.set.state", "argument", "nobody enters one"),
        ("meter", 'when = "fault == 7"', "", "rules.0.when", "missing", "a text"),
        ("meter", 'when = "fault == 7"', 'when = "age(state) > 3"', "rules.0.when", "age(state) > 3", "no age(…)"),
        ("meter", 'when = "fault == 7"', 'when = "fault == 7"\nafter = -1', "rules.0.after", "-1", "a number from 0 to 86400"),
        ("meter", "[values.power]", "[values.powr]", "values.powr", "powr", "(perhaps power)"),
        ("meter", "[values.power]", "[values.switch]", "values.switch.noise", "0.01", "an analog value only"),
        ("meter", "lag = 2", "lag = 2\nrate = 1", "values.power.rate", "1", "lag or rate, not both"),
        ("meter", "lag = 2", "lag = 0", "values.power.lag", "0", "a number above 0"),
        ("meter", "lag = 2", 'lag = "soon"', "values.power.lag", "soon", "not soon"),
        ("meter", "lag = 2", "low = 2", "values.power.low", "2", "no low: it belongs to integral"),
        ("meter", "noise = 0.01", "noise = -1", "values.power.noise", "-1", "a number from 0 up"),
        ("meter", 'integral = "power', 'to = 1\nintegral = "power', "values.energy", "to, integral", "one of to, integral, every"),
        ("meter", 'integral = "power / 3600"', "", "values.energy", "missing", "one of to, integral, every"),
        ("meter", 'integral = "power / 3600"', "integral = 1\nlow = 5\nhigh = 5", "values.energy.low", "5", "low < high"),
        ("meter", "every = 0.5", "every = 0.001", "values.life.every", "0.001", "a number from 0.02 to 86400"),
        ("meter", "modulo = 1000", "modulo = 70000", "values.life.modulo", "70000", "a whole number from 2 to 65536"),
        ("scale", '[values.weight]', '[values.name]\nto = 1\n[values.weight]', "values.name", "name", "one of "),
        ("scale", 'name = "W-1"', 'name = "a scale by the door"', "start.name", "a scale by the door", "at most 8 letters"),
        ("scale", 'name = "W-1"', "name = 3", "start.name", "3", "a text"),
        ("scale", "set = { zeroed = 1, command = 0 }", "set = { name = 1 }", "writes.0.set.name", "1", "one of "),
        ("scale", 'when = "abs(weight - load) < 0.01"', 'when = "name == 1"', "rules.0.when", "name == 1", "not name"),
        (
            "scale", "[values.weight]", "[values.stable]\nto = 1\n[values.status]\nto = 1\n[values.weight]",
            "values.status", "status", "bits of its own; stable moves them, too",
        ),
        ("scale", "lag = 0.5", "", "", "", ""),
        ("valve", "rate = \"100 / stroke\"", "", "", "", ""),
        ("valve", "set = { opened = 1, open = 0 }", "set = { opened = 1, position = 5 }", "", "", ""),
        (
            "valve", 'rate = "100 / stroke"\n[[rules]]\nwhen = "position >= 100"\nset = { opened = 1, open = 0 }',
            '[[rules]]\nwhen = "position >= 100"\nset = { position = 5 }',
            "rules.0.set.position", "5", "a point that keeps what it gets",
        ),
        ("pumps", "level = 3", "level = 7", "start.level", "7", "a number from 0 to 6"),
        ("pumps", "[values.level]\nintegral", "[values.command_1]\nto", "values.command_1.to", "0.02", "a point that keeps what it gets"),
        ("logger", "temperature = -12.5", "temperature = -3276.8", "start.temperature", "-3276.8", "not the raw value 0x8000"),
    ],
)  # fmt: skip
def test_a_mistake_is_told_with_its_place(
    tmp_path: Path, name: str, old: str, new: str, key: str, value: str, expected: str
) -> None:
    text = TYPES[name]["simulation"]
    assert old in text
    problems = read(tmp_path, name, text.replace(old, new, 1))
    if not key:
        assert problems == []
        return
    found = [one for one in problems if one.key == key and value in one.value and expected in str(one)]
    assert found, [str(one) for one in problems]
    assert all(one.file == f"equipment/{name}/simulation.toml" for one in problems)
    assert all(one.line for one in problems), [str(one) for one in problems]


def test_a_word_of_a_training_starts_as_the_file_says_and_sentences_name_it(tmp_path: Path) -> None:
    training = METER["training"] + "[world.load]\nregister = 0xE020\nlimits = [10, 100]\n"
    texts = METER["texts.en"].replace("[training.fault]", '[training]\nload = "Load"\n[training.fault]')
    text = METER["simulation"].replace("limit = 50", "limit = 50\nload = 60")
    text = text.replace("0.8 * rated_power", "load / 100 * rated_power")
    files = {"training": training, "texts.en": texts}
    assert read(tmp_path, "meter", text, **files) == []
    (problem,) = read(tmp_path, "meter", text.replace("load = 60", 'load = "rated_power"'), **files)
    assert (problem.key, problem.expected) == ("start.load", "a whole number from 10 to 100")


def test_a_type_with_more_than_registers_has_none(tmp_path: Path) -> None:
    device = METER["device"] + '[parameters]\nranges = [["F100", "F160"]]\n'
    problems = read(tmp_path, "meter", METER["simulation"], device=device)
    assert any("type meter has more than registers" in str(one) for one in problems), [str(one) for one in problems]


def test_its_points_are_not_where_the_instructor_writes(tmp_path: Path) -> None:
    points = METER["points"].replace("address = 19", "address = 0xE010")
    problems = read(tmp_path, "meter", METER["simulation"], points=points)
    assert any(one.value == "life" and "0xE000–0xE03F" in one.expected for one in problems)


def test_a_start_that_no_text_says_is_asked_for(tmp_path: Path) -> None:
    points = VALVE["points"].replace('address = "10001"\ntexts = [0, 1]', 'address = "10001"\ntexts = [1]')
    text = VALVE["simulation"].replace("set = { opened = 0 }", "set = { opened = 1 }")
    (problem,) = read(tmp_path, "valve", text, points=points)
    assert (problem.key, problem.value, problem.expected) == ("start.opened", "missing", "one of 1")


def test_a_link_out_of_the_plant_folder_is_not_followed(tmp_path: Path) -> None:
    write_own(tmp_path / "plant")
    file = tmp_path / "plant/equipment/logger/simulation.toml"
    file.rename(tmp_path / "elsewhere.toml")
    file.symlink_to(tmp_path / "elsewhere.toml")
    (problem,) = read_plant(tmp_path / "plant")[1]
    assert "a link that leads out" in str(problem)
    (tmp_path / "elsewhere.toml").unlink()
    assert read_plant(tmp_path / "plant")[1] != [], "a link to nothing is no type without the file"
