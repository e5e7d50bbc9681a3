"""What an instructor may do is data of the type: it agrees with the virtual device, has its words, and its mistakes are told."""

from importlib import import_module
from pathlib import Path

import pytest

from app.plant import types
from app.plant.definitions import EquipmentType
from app.plant.plant_files.languages import LANGUAGES
from app.plant.tables import Source
from app.plant.training import read_training, text_of_code
from app.sim.machines import MACHINE_FAULTS

POINTS = ("state", "speed")


def kind(name: str) -> EquipmentType:
    data, problems = types.read_type(name, LANGUAGES)
    assert not problems
    return data.type


@pytest.mark.parametrize("name", types.names())
def test_the_virtual_device_takes_what_the_type_offers(name: str) -> None:
    training, limits = kind(name).training, import_module(f"app.sim.{name}.training").LIMITS
    assert sorted(training.faults.values()) == sorted(MACHINE_FAULTS[name])
    for word in (*training.world.values(), *training.acts.values(), *training.switches.values()):
        assert limits[word.register] == (word.low, word.high)


@pytest.mark.parametrize("name", types.names())
def test_every_fault_has_a_name_and_says_what_a_trainee_sees(name: str) -> None:
    it = kind(name)
    for language in LANGUAGES:
        own = {language: it.texts[language]}
        for code in it.training.faults.values():
            if it.training.names:
                assert it.points[it.training.names].texts[code] in it.texts[language]
            else:
                assert text_of_code(own, "training.fault", code)
            assert text_of_code(own, "training.sees", code)


@pytest.mark.parametrize(
    ("text", "key", "expected"),
    [
        ("live = ['sped']", "live.0", "perhaps speed"),
        ("names = 'sped'", "names", "perhaps speed"),
        ("[faults]\njam = 0", "faults.jam", "1 to 65535"),
        ("[faults]\njam = 'x'", "faults.jam", "a whole number"),
        ("[faults]\njam = 1\nslip = 1", "faults.jam", "each code once"),
        ("[world.load]\nlimits = [0, 1]", "world.load.register", "a whole number"),
        ("[world.load]\nregister = 0xE010\nlimits = [0, 1]", "world.load.register", "57376 to 57407"),
        ("[acts.put]\nregister = 0xE020\nlimits = [2, 1]", "acts.put.limits", "lowest <= highest"),
        ("[acts.put]\nregister = 0xE020\nlimits = [0, 70000]", "acts.put.limits", "65535"),
        ("[switches.beam]\nregister = 0xE020\nlimits = [0, 15]\nbit = 1", "switches.beam.bit", "no such key"),
        ("wrold = 1", "wrold", "no such key"),
    ],
)
def test_a_mistake_is_named_with_what_was_expected(tmp_path: Path, text: str, key: str, expected: str) -> None:
    (tmp_path / "training.toml").write_text(text)
    source = Source(tmp_path / "training.toml", "training.toml")
    read_training(source.table(), POINTS)
    assert key in [problem.key for problem in source.problems]
    assert any(expected in problem.expected for problem in source.problems if problem.key == key)


def test_a_text_of_a_code_is_its_own_or_that_of_its_tens_or_of_any() -> None:
    texts = {"en": {"sees.11": "", "sees.1x": "", "sees.any": ""}, "hr": {"fault.2x": ""}}
    assert [text_of_code(texts, "sees", code) for code in (11, 12, 30)] == ["sees.11", "sees.1x", "sees.any"]
    assert [text_of_code(texts, "fault", code) for code in (21, 11)] == ["fault.2x", ""]
