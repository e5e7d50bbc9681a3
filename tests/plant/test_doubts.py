"""What is no mistake and seldom meant is a warning of `pogon check`: with its place, in four languages, and never of our plants."""

from functools import partial
from pathlib import Path

import pytest

from app.links.forecast import doubts, load_of
from app.plant.loader import read_plant
from app.plant.said import in_words
from app.plant.texts import Texts
from tests.conftest import ROOT
from tests.own_types import METER, PUMPS, write_own

STOP = '[stop]\nwrites = [{ point = "command_1", value = 2 }]\nfeedback = "state_1 == 0"\nlevel = "C0"\nstop = true\nmoves = false\n'
ALARM = '[[alarms]]\nequipment = "v1"\nkey = "wide"\nlabel = "Wide open"\nexpression = "position > 90"\npriority = 3\n'


def told(folder: Path, **files: tuple[str, str, str]) -> list[str]:
    """The warnings of the plant of five types; files: name → (type, old, new)."""
    for file, (name, old, new) in files.items():
        path = folder / "plant.toml" if file == "plant" else folder / "equipment" / name / f"{file}.toml"
        text = path.read_text("utf-8")
        assert old in text
        path.write_text(text.replace(old, new, 1), "utf-8")
    plant, problems = read_plant(folder)
    assert plant, problems
    return [str(doubt) for doubt in (*plant.doubts, *doubts(plant))]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A plant without a doubt."""
    found = write_own(tmp_path)
    commands = found / "equipment" / "pumps" / "commands.toml"
    commands.write_text(PUMPS["commands"] + STOP, "utf-8")
    texts = found / "equipment" / "pumps" / "texts.en.toml"
    texts.write_text(PUMPS["texts.en"].replace("[command]", '[command]\nstop = "Stop"'), "utf-8")
    return found


def test_there_is_none_where_all_is_said(folder: Path) -> None:
    assert told(folder) == []


@pytest.mark.parametrize("plant", sorted(path.name for path in (ROOT / "plants").iterdir()))
def test_our_own_plants_have_none(plant: str) -> None:
    found, problems = read_plant(ROOT / "plants" / plant)
    assert found, problems
    assert [str(doubt) for doubt in (*found.doubts, *doubts(found))] == []


SPARE_OPTION = "[options.spare]\ndefault = 1\nlow = 0\nhigh = 2\n[options.rated_power]"
SPARE_POINT = '[spare]\naddress = 30\nreadable = false\nwritable = true\nlabel = "point.switch"\n[switch]'
ROW = ALARM + 'cause = "a"\nresponse = "b"\n[equipment.l1]'


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("file", "name", "old", "new", "place", "expected"),
    [
        ("commands", "valve", "stop = true\n", "", "valve/commands.toml:2: open.moves = true", "move it: open, close; or moves = false"),
        ("commands", "pumps", "stop = true\n", "", "pumps/commands.toml:2: start_1.moves = true", "a Stop of the machine"),
        ("setpoints", "meter", "high = 100\n", "", "meter/setpoints.toml:2: limit.high = missing", "without high limit takes whatever"),
        ("setpoints", "scale", "low = -50\n", "", "scale/setpoints.toml:2: load.low = missing", "a limit"),
        ("device", "valve", 'area = "water"\n', "", "plant.toml:9: equipment.v1.area = missing", "nor type valve names one"),
        ("device", "meter", "[options.rated_power]", SPARE_OPTION, 'meter/device.toml:10: options.spare = "spare"', "that use spare"),
        ("points", "meter", "[switch]", SPARE_POINT, "meter/points.toml:26: spare.readable = false", "that writes spare"),
        ("points", "meter", "address = 18", 'address = 18\norder = "cdab"', 'order = "cdab"', "badc, where its two bytes are exchanged"),
        ("points", "meter", "address = 18", 'address = 18\norder = "badc"', "", ""),
        ("simulation", "scale", "set = { zeroed = 1, command = 0 }", "set = { command = 0 }", "", ""),
        ("simulation", "logger", "every = 1", "every = 2", "", ""),
        ("plant", "", "[equipment.l1]", ROW, "alarms.0.consequence = missing", "a text for the operator, who reads a dash"),
    ],
)  # fmt: skip
def test_a_doubt_is_told_with_its_place(
    folder: Path, file: str, name: str, old: str, new: str, place: str, expected: str
) -> None:
    found = told(folder, **{file: (name, old, new)})
    if not expected:
        assert found == []
    else:
        assert len(found) == 1 and f"{place}: expected" in found[0] and expected in found[0], found


def test_a_command_that_its_simulated_machine_never_confirms_is_one(folder: Path) -> None:
    text = (
        METER["simulation"]
        .replace("set = { state = 1 }", "set = { life = 1 }")
        .replace("set = { state = 0 }", "set = { life = 0 }")
    )
    (folder / "equipment" / "meter" / "simulation.toml").write_text(text, "utf-8")
    found = told(folder)
    assert [one.partition(": expected")[0] for one in found] == [
        'equipment/meter/commands.toml:4: on.feedback = "state == 1"',
        'equipment/meter/commands.toml:8: off.feedback = "state == 0"',
    ]


def test_what_no_page_offers_an_instructor_is_one(folder: Path) -> None:
    act = "[faults]\nfuse = 7\n[acts.knock]\nregister = 0xE020\nlimits = [1, 1]\n"
    (found,) = told(
        folder,
        **{
            "training": ("meter", "[faults]\nfuse = 7\n", act),
            "texts.en": ("meter", "[training.fault]", '[training]\nknock = "Knock"\n[training.fault]'),
        },
    )
    assert found.startswith('equipment/meter/training.toml:5: acts.knock = "knock": expected a row of [world]')


@pytest.mark.parametrize(("drives", "doubtful"), [(1, 0), (2, 1)])
def test_one_drive_on_a_line_as_its_maker_delivers_it_is_none(tmp_path: Path, drives: int, doubtful: int) -> None:
    text = '[plant]\nname = "Hall"\ntimezone = "UTC"\n[links.line]\ntransport = "rtu"\nport = "/dev/ttyUSB0"\n'
    text += "".join(
        f'[equipment.m{unit}]\ntype = "eura_e800"\nlink = "line"\nunit = {unit}\n' for unit in range(1, drives + 1)
    )
    (tmp_path / "plant.toml").write_text(text, "utf-8")
    plant, problems = read_plant(tmp_path)
    assert plant, problems
    assert len(list(doubts(plant))) == doubtful


def test_a_line_that_cannot_carry_its_reads_is_one(tmp_path: Path) -> None:
    folder = write_own(tmp_path, "rtu", "/dev/ttyUSB0")
    path = folder / "plant.toml"
    path.write_text(path.read_text("utf-8").replace("115200", "115200\nfast = 0.5\nslow = 2"), "utf-8")
    plant, problems = read_plant(folder)
    assert plant, problems
    assert [one.key for one in doubts(plant)] == []
    path.write_text(path.read_text("utf-8").replace("115200", "2400"), "utf-8")
    plant, _ = read_plant(folder)
    assert plant
    (doubt,) = doubts(plant)
    load = load_of(plant, plant.links["line"])
    assert load.share > 1 and load.cycle > load.asked == 0.5
    assert (doubt.key, doubt.value, doubt.line) == ("links.line.baud", "2400", None)
    assert f"2400 baud are asked for {100 * load.share:.0f} % of their time" in doubt.expected
    assert f"every {load.cycle:.2g} s and not every 0.5 s" in doubt.expected


@pytest.mark.sweep(8)
@pytest.mark.parametrize("language", ["hr", "en", "de", "cs"])
def test_it_is_told_in_every_language(folder: Path, language: str) -> None:
    told(folder, commands=("valve", "stop = true\n", ""), setpoints=("meter", "high = 100\n", ""))
    plant, _ = read_plant(folder)
    assert plant
    texts = Texts.read()
    found = [in_words(partial(texts.text, language), one.expected, language) for one in plant.doubts]
    assert len(set(found)) == 2 and all("[" not in one and "{" not in one for one in found), found
    assert (found != [one.expected for one in plant.doubts]) == (language != "en")
