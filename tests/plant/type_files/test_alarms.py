"""alarms.toml: a mistake is named."""

from pathlib import Path

import pytest

from tests.plant.line import problem

MISTAKES = [
    ("alarms", 'event = "jam"', 'event = "jamm"', "jam.event", "one of arrived, jam, jam_over (perhaps jam)"),
    ("alarms", 'event = "jam"', "event = 20", "jam.event", 'the key of the event, "jam", not its number'),
    (
        "alarms",
        'event = "jam"',
        "event = 22",
        "jam.event",
        "the key of an event in events.toml: one of arrived, jam, jam_over",
    ),
    ("alarms", 'event = "jam"', "event = true", "jam.event", "the key of an event"),
    ("alarms", 'event = "jam"', 'event = ["jam"]', "jam.event", "the key of an event"),
    (
        "alarms",
        'event_clear = "jam_over"',
        'event_clear = "cleared"',
        "jam.event_clear",
        "one of arrived, jam, jam_over",
    ),
    ("alarms", 'event_clear = "jam_over"', "event_clear = 21", "jam.event_clear", '"jam_over", not its number'),
    ("alarms", 'event_clear = "jam_over"', 'event_clear = "jam"', "jam.event_clear", "another event"),
    ("alarms", 'event_clear = "jam_over"', 'clear = "count == 0"', "jam.clear", "an `expression`"),
    ("alarms", 'event = "jam"', 'event = "jam"\nexpression = "1 == 2"', "jam.expression", "this one never changes"),
    ("alarms", "source = 2", "source = -1", "jam.source", "from 0 to 65535"),
    ("alarms", 'event = "arrived"\n', "source = 1\n", "late.source", "an `event`"),
]


@pytest.mark.parametrize(("file", "old", "new", "key", "expected"), MISTAKES)
def test_a_mistake_is_named(tmp_path: Path, file: str, old: str, new: str, key: str, expected: str) -> None:
    found = problem(tmp_path, file, old, new)
    assert found.key == key
    assert expected in found.expected
