"""records.toml of an equipment type: what it may say, and how a mistake in it is told."""

import shutil
import tomllib
from pathlib import Path

import pytest

from app.plant import types
from app.plant.loader import read_plant
from app.plant.problems import Problem
from app.plant.record_kinds import read_kinds
from app.plant.tables import Source
from app.records.kind import RecordKind

EVENTS = {1: "begun", 2: "filled", 3: "ended"}
WORDS = ["number", "size"]
GOOD = """
[thing]
number = "number"
begin = ["begun"]
alarms = true
[[thing.end]]
outcome = "gone"
events = ["ended"]
[thing.fields.size]
rules = [{ verb = "largest", of = "size", events = ["filled"] }]
[thing.filters]
size = { of = "size", how = "above" }
[thing.csv.columns]
size_mm = "size"
"""


def read(folder: Path, text: str) -> tuple[dict[str, RecordKind], list[Problem]]:
    (folder / "records.toml").write_text(text, "utf-8")
    source = Source(folder / "records.toml", "type/records.toml")
    return read_kinds(source.table(), folder, "app.equipment", EVENTS, WORDS), source.problems


def test_a_kind_is_read(tmp_path: Path) -> None:
    kinds, problems = read(tmp_path, GOOD)
    assert problems == []
    kind = kinds["thing"]
    assert (kind.begin, kind.number, kind.outcomes) == (frozenset({1}), "number", ("open", "gone", "unknown"))
    assert kind.fields["size"].rules[0].when.codes == {2}
    assert kind.implied == frozenset(), "nothing begins one that nobody saw begin"


@pytest.mark.parametrize(
    ("was", "becomes", "key", "expected"),
    [
        ('begin = ["begun"]', "", "thing.begin", "at least one event"),
        (
            'begin = ["begun"]',
            'begin = ["begin"]',
            "thing.begin.0",
            "an event of events.toml: one of begun, filled, ended (perhaps begun)",
        ),
        ('begin = ["begun"]', "begin = 1", "thing.begin", "a list of events"),
        ('number = "number"', 'number = "nmber"', "thing.number", "one of number, size (perhaps number)"),
        ("alarms = true", "alarms = 1", "thing.alarms", "true or false"),
        ("alarms = true", "alarm = true", "thing.alarm", "no such key"),
        ("alarms = true", 'lasts = "forever"', "thing.lasts", "one of value, source, time, number, size"),
        ("alarms = true", 'key = "length"', "thing.key", "a field: one of size"),
        ("alarms = true", 'columns = ["begun", "colour"]', "thing.columns.1", "one of begun, ended"),
        ("alarms = true", "reopen = { lost = [] }", "thing.reopen.lost", "one of open, gone, unknown"),
        ("alarms = true", 'pause = { begin = ["begun"] }', "thing.pause.end", "a list of events"),
        ("alarms = true", "late = -1", "thing.late", "a number from 0 to 86400"),
        ('outcome = "gone"', 'outcome = "Gone!"', "thing.end.0.outcome", "a key of small letters"),
        (
            'events = ["ended"]',
            'events = ["ended"]\nseconds = "long"',
            "thing.end.0.seconds",
            "one of elapsed, value, unknown",
        ),
        ('events = ["ended"]', 'events = ["ended"]\nafter = ["gon"]', "thing.end.0.after", "(perhaps gone)"),
        (
            'verb = "largest"',
            'verb = "bigest"',
            "thing.fields.size.rules.0.verb",
            "one of set, first, count, sum, largest, smallest",
        ),
        ('of = "size", events', 'of = "sise", events', "thing.fields.size.rules.0.of", "(perhaps size)"),
        ("[thing.fields.size]", "[thing.fields.number]", "thing.fields.number", "a name of small letters"),
        (
            "[thing.fields.size]",
            '[thing.fields.size]\ntype = "colour"',
            "thing.fields.size.type",
            "one of number, time, word, name, identity, part, person",
        ),
        (
            "[thing.fields.size]",
            '[thing.fields.size]\nwords = ["a"]',
            "thing.fields.size.words",
            "the type of the field is not word",
        ),
        (
            "[thing.fields.size]",
            '[thing.fields.size]\noverlapping = "other"',
            "thing.fields.size.overlapping",
            "one of thing",
        ),
        ('how = "above"', 'how = "over"', "thing.filters.size.how", "one of is, above, any, choice, alarm"),
        ('size_mm = "size"', 'size_mm = "length"', "thing.csv.columns.size_mm", "one of begun.utc"),
        (
            'size_mm = "size"',
            'size_mm = "size"\n[thing.csv.repeat.columns]\nmm = "time"',
            "thing.csv.repeat.columns.mm",
            "a name with {n}",
        ),
        ("[thing]", "[Thing]", "Thing", "a name of small letters"),
    ],
)
def test_a_mistake_names_key_value_and_what_was_expected(
    tmp_path: Path, was: str, becomes: str, key: str, expected: str
) -> None:
    assert was in GOOD
    _, problems = read(tmp_path, GOOD.replace(was, becomes))
    told = [problem for problem in problems if problem.key == key]
    assert told, list(map(str, problems))
    assert any(expected in problem.expected for problem in told), list(map(str, told))
    assert all(problem.file == "type/records.toml" and problem.line for problem in told)


@pytest.mark.sweep(8)
@pytest.mark.parametrize("name", types.names())
def test_the_kinds_of_every_type_are_without_mistakes_and_say_everything(name: str) -> None:
    data, problems = types.read_type(name, ["en", "hr", "de", "cs"])
    assert list(map(str, problems)) == []
    file = data.type.folder / "records.toml"
    assert list(data.type.records) == (list(tomllib.loads(file.read_text("utf-8"))) if file.is_file() else [])
    for texts in data.type.texts.values():
        assert {key for key in types.text_keys(data) if key.startswith("record.")} <= set(texts)


TWO_TYPES = """
[plant]
name = "Hall"
timezone = "UTC"
languages = ["en"]
[links.line]
transport = "memory"
[equipment.c1]
type = "conveyor"
link = "line"
unit = 1
label = "One"
[equipment.c2]
type = "belt"
link = "line"
unit = 2
label = "Two"
"""


@pytest.mark.sweep(8)
@pytest.mark.parametrize("renamed", [False, True])
def test_two_types_of_a_plant_cannot_name_a_kind_of_records_alike(tmp_path: Path, renamed: bool) -> None:
    """One list, one address, one table of texts and columns would be of both."""
    for name in ("conveyor", "belt"):
        shutil.copytree(types.EQUIPMENT / "conveyor", tmp_path / "types" / name)
    if renamed:
        for file in (tmp_path / "types" / "belt").glob("*.toml"):
            file.write_text(file.read_text("utf-8").replace("passage", "transfer"), "utf-8")
    (tmp_path / "plant").mkdir()
    (tmp_path / "plant" / "plant.toml").write_text(TWO_TYPES, "utf-8")
    plant, problems = read_plant(tmp_path / "plant", type_folder=tmp_path / "types")
    if renamed:
        assert problems == []
        assert plant is not None
        assert list(plant.records) == ["passage", "transfer"]
        assert sorted(plant.lessons) == ["belt_conveyor", "conveyor"]
        assert plant.records is plant.records, "computed once"
    else:
        assert [str(one) for one in problems] == [
            "belt/records.toml: passage = a kind of records of conveyor, too: expected a name that no other type of the plant has"
        ]
