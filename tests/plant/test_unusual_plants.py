"""Plant files as an integrator writes them: unusual ones that are taken, and wrong ones of which each mistake is one line."""

import re
from pathlib import Path

import pytest

from app.plant.loader import read_plant
from tests.conftest import ROOT

PLANT = '[plant]\nname = "Hall 1"\ntimezone = "Europe/Berlin"\nlanguages = ["de"]\n'
MEMORY = '[links.a]\ntransport = "memory"\n'
TCP = '[links.t]\ntransport = "tcp"\nhost = "10.0.0.7"\n'
RTU = '[links.r]\ntransport = "rtu"\nport = "/dev/ttyS9"\nbaud = 19200\nparity = "none"\nstop_bits = 2\n'
SEQUENCES = {
    name: (ROOT / "plants" / plant / "sequences" / f"{name}.toml").read_text("utf-8")
    for plant, name in (("demo", "coil_transport"), ("feeding", "feed"))
}
PAGE = (ROOT / "docs" / "own-machine.md").read_text("utf-8")
METER = dict(
    zip(
        ("device", "points", "commands", "interlocks", "setpoints", "alarms", "texts.en", "plant", "simulation"),
        re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL),
        strict=True,
    )
)


def machine(id: str, unit: object = 1, kind: str = "eura_e800", link: str = "a", more: str = "") -> str:
    return f'[equipment.{id}]\ntype = "{kind}"\nlink = "{link}"\nunit = {unit}\nlabel = "{id}"\n{more}\n'


def sequence(id: str, unit: int, definition: str, used: str = "") -> str:
    return machine(id, unit, "sequence", more=f'definition = "{definition}"\n' + f'machine = "{used}"\n' * bool(used))


def told(folder: Path, plant: str | bytes) -> list[str]:
    """What is wrong with it, a line for each, without the folder."""
    (folder / "sequences").mkdir()
    for name, text in SEQUENCES.items():
        (folder / "sequences" / f"{name}.toml").write_text(text, "utf-8")
    (folder / "plant.toml").write_bytes(plant if isinstance(plant, bytes) else plant.encode())
    found, problems = read_plant(folder)
    assert (found is None) is bool(problems)
    return [str(problem).removeprefix(f"{folder}/") for problem in problems]


NAMES = """[equipment.m1]
type = "eura_e800"
link = "a"
unit = 1
label = { de = 'Lüfter "ß" <b>&amp;', cs = "Ventilátor č" }
"""
SIZES = (
    machine("a1", 1, link="r", more='preset = "e800_0040t3"\nrated_current = 8.5')
    + machine("a2", 17, link="r", more='preset = "e800_0110t3"')
    + machine("a3", 247, link="r", more='preset = "e800_0022s2"\npole_pairs = 1\nrated_frequency = 87')
)


@pytest.mark.parametrize(
    "plant",
    [
        PLANT + RTU + SIZES,
        PLANT + MEMORY + machine("c1", 1, "conveyor", more="belts = 16\nsensors = 17"),
        PLANT + MEMORY + machine("m1"),
        PLANT.replace("Hall 1", "Straße č " * 40) + MEMORY + NAMES,
        PLANT.replace('"Hall 1"', "'„Süd“ \"1\"'") + MEMORY + NAMES.replace("Lüfter", "Lüfter " * 60),
        PLANT + MEMORY + "".join(machine(f"m{n}", n) for n in range(1, 61)),
        PLANT + MEMORY + machine("m", 100, more="repeat = 60"),
        PLANT + TCP + machine("m1", 0, link="t") + machine("m2", 255, link="t") + machine("m3", 0xF7, link="t"),
        'links.a.transport = "memory"\nequipment.m1 = { type = "eura_e800", link = "a", unit = 0x0A, label = "m" }\n' + PLANT,
        ("\ufeff" + PLANT + MEMORY + machine("m1")).replace("\n", "\r\n").encode(),
        PLANT + MEMORY + machine("m1") + machine("c1", 11, "conveyor", more="belts = 5") + sequence("s1", 21, "feed"),
        PLANT + MEMORY + machine("k1", 1, "coil_car") + sequence("s1", 2, "coil_transport", "k1")
        + sequence("s2", 3, "coil_transport", "k1"),
    ],
)  # fmt: skip
def test_an_unusual_plant_is_taken(tmp_path: Path, plant: str | bytes) -> None:
    assert told(tmp_path, plant) == []


ONE = PLANT + MEMORY + machine("m1")
BOTH = PLANT + RTU + machine("m1", 5, link="r")
WRONG = {
    "unit_text": (PLANT + MEMORY + machine("m1", '"1"'), 10, 'equipment.m1.unit = "1"', "a whole number from 1 to 247"),
    "unit_over_tcp": (
        PLANT + TCP + machine("m1", 256, link="t"),
        11,
        "equipment.m1.unit = 256",
        "a whole number from 1 to 247, or 0 or 255",
    ),
    "unit_0_on_a_line": (PLANT + RTU + machine("m1", 0, link="r"), 14, "equipment.m1.unit = 0", "from 1 to 247"),
    "unit_twice": (BOTH + machine("m2", 5, link="r"), 20, "equipment.m2.unit = 5", "no other equipment on r has; m1"),
    "units_run_out": (
        PLANT + RTU + machine("m", 240, link="r", more="repeat = 20"), 16, "equipment.m.repeat = 20", "at most 8"),
    "unclosed": (PLANT + MEMORY + '[equipment.m1\ntype = "x"\n', 7, "(file) = [equipment.m1", "TOML"),
    "twice": (ONE + "[equipment.m1]\nunit = 2\n", 13, "(file) = [equipment.m1]", "The same key or table twice"),
    "comma": (ONE.rstrip() + "\nrated_current = 2,5\n", 12, "(file) = rated_current = 2,5", "TOML"),
    "python": (PLANT + MEMORY + "writes = True\n" + machine("m1"), 7, "(file) = writes = True", "TOML"),
    "latin": (ONE.encode() + b"# \xfc\n", 13, "(file) = byte 0xfc", "UTF-8"),
    "type": (ONE.replace("eura_e800", "eura_e80"), 8, 'equipment.m1.type = "eura_e80"', "(perhaps eura_e800)"),
    "key": (ONE + "rated_curent = 2\n", 13, "equipment.m1.rated_curent = 2", "(perhaps rated_current)"),
    "link": (ONE + 'preset = "e800_0040t4"\n', 13, 'equipment.m1.preset = "e800_0040t4"', "(perhaps e800_0040t3)"),
    "table": (ONE + "[equipmnt.m2]\nunit = 2\n", 13, "equipmnt = { m2 = { unit = 2 } }", "(perhaps equipment)"),
    "transport": (ONE.replace("memory", "memry"), 6, 'links.a.transport = "memry"', "(perhaps memory)"),
    "zone": (ONE.replace("Berlin", "Berln"), 3, 'plant.timezone = "Europe/Berln"', "(perhaps Europe/Berlin)"),
    "not_a_number": (ONE + "rated_current = nan\n", 13, "equipment.m1.rated_current = nan", "a number from 0.1 to 60"),
    "low_above_high": (
        PLANT + MEMORY + machine("x1", 1, "epos", more="travel_low = 800\ntravel_high = 100"),
        12,
        "equipment.x1.travel_low = 800",
        "less than travel_high = 100 mm",
    ),
    "belts": (
        PLANT + MEMORY + machine("c1", 1, "conveyor", more="belts = 2.5"), 12, "equipment.c1.belts = 2.5", "whole"),
    "sequence_of_itself": (
        PLANT + MEMORY + sequence("s1", 2, "feed", "s1"),
        13,
        'equipment.s1.machine = "s1"',
        "a machine; this is itself a sequence",
    ),
    "sequence_of_a_motor": (
        ONE + sequence("s1", 2, "coil_transport", "m1"),
        19,
        'equipment.s1.machine = "m1"',
        "a machine that takes actions; eura_e800 takes none",
    ),
    "serial_device_twice": (
        BOTH + RTU.replace("links.r", "links.s") + machine("m2", 6, link="s"),
        19,
        'links.s.port = "/dev/ttyS9"',
        "a serial device that no other link has; r has it",
    ),
}  # fmt: skip


@pytest.mark.parametrize("mistake", WRONG)
def test_a_mistake_is_one_line_with_file_line_key_value_and_what_was_expected(tmp_path: Path, mistake: str) -> None:
    plant, line, given, expected = WRONG[mistake]
    (said,) = told(tmp_path, plant)
    assert said.startswith(f"plant.toml:{line}: {given}: expected "), said
    assert expected in said


def test_a_cycle_of_sequences_is_a_line_for_each_that_is_in_it(tmp_path: Path) -> None:
    found = told(tmp_path, PLANT + MEMORY + sequence("s1", 2, "feed", "s2") + sequence("s2", 3, "feed", "s1"))
    assert [re.sub(r":\d+:.*=", "", line) for line in found] == [
        'plant.toml "s2": expected a machine; this is itself a sequence',
        'plant.toml "s1": expected a machine; this is itself a sequence',
    ]


@pytest.mark.parametrize(
    ("file", "right", "wrong", "line", "given", "expected"),
    [
        ("points", "address = 12", "address = 11", 14, 'energy.address = "0x000B"', "words that power does not use"),
        ("points", '"f32"', '"f23"', 3, 'power.type = "f23"', "(perhaps f32)"),
        ("points", '"cdab"', '"cdba"', 4, 'power.order = "cdba"', "one of abcd, cdab, badc, dcba"),
        ("points", "address = 10", "address = 65535", 2, 'power.address = "0xFFFF"', "no word is above 65535"),
        ("points", '"2 * rated_power"', '"2 * rated_powr"', 8, 'power.high = "2 * rated_powr"', "rated_powr is none"),
        ("setpoints", "low = 0", "low = 200", 4, "limit.low = 200", "low, high with low <= high"),
        ("setpoints", "address = 21", "address = 12", 2, 'limit.address = "0x000C"', "words that energy does not use"),
        ("commands", "state == 1", "stat == 1", 3, 'on.feedback = "stat == 1"', "it has no stat"),
        ("commands", '"switch", value = 1', '"swich", value = 1', 2, 'on.writes.0.point = "swich"', "writable register"),
        ("alarms", "rated_power", "rated_powr", 2, 'too_much.expression = "power > rated_powr"', "it has no rated_powr"),
        ("simulation", "limit = 50", "limt = 50", 3, "start.limt = 50", "(perhaps limit)"),
    ],
)  # fmt: skip
def test_a_mistake_in_a_type_of_ones_own_is_one_line_too(
    tmp_path: Path, file: str, right: str, wrong: str, line: int, given: str, expected: str
) -> None:
    folder = tmp_path / "equipment" / "meter"
    folder.mkdir(parents=True)
    for name, text in METER.items():
        target = tmp_path / "plant.toml" if name == "plant" else folder / f"{name}.toml"
        assert name != file or right in text
        target.write_text(text.replace(right, wrong, 1) if name == file else text, "utf-8")
    found, problems = read_plant(tmp_path)
    (said,) = (str(problem) for problem in problems)
    assert found is None
    assert said.removeprefix(f"{tmp_path}/").startswith(f"equipment/meter/{file}.toml:{line}: {given}: expected "), said
    assert expected in said
