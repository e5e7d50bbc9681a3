"""Changes to a TOML text: what they do not touch stays as it was written."""

import tomllib

import pytest

from app import bundled
from app.plant.toml_text import CannotEdit, Change, Insert, Put, Remove, Rename, Swap, edited, pieces

FILES = ["plants/demo/sequences/coil_transport.toml", "plants/feeding/sequences/feed.toml"]
TEXT = """# About the file.

[sequence]
label = { en = "Coil", hr = "Kolut" }  # of the thesis
stall_after = 10.0           # s

# The first step.
[[steps]]
key = "one"
minimum = 1
actions = [
    "lower",  # down
    "lift",
]
colour = "red"               # a key that nobody knows

[steps.permissives.3]
when = "a > 1"

# The second one.
[[steps]]
key = "two"
label.en = "Two"
label.hr = "Dva"
"""


def lines(changes: list[Change], text: str = TEXT) -> list[str]:
    """Lines that are only in one of both texts: - of the old, + of the new."""
    old, new = text.splitlines(), edited(text, changes).splitlines()
    return [f"-{line}" for line in old if line not in new] + [f"+{line}" for line in new if line not in old]


@pytest.mark.parametrize("name", FILES)
def test_the_pieces_of_a_text_are_the_text(name: str) -> None:
    text = bundled(name).read_text("utf-8")
    assert "".join(piece.text for piece in pieces(text)) == text


def test_a_value_changes_alone_and_keeps_its_comment() -> None:
    assert lines([Put(("sequence", "stall_after"), 12)]) == [
        "-stall_after = 10.0           # s",
        "+stall_after = 12           # s",
    ]
    assert lines([Put(("steps", "0", "actions"), ["lift"])])[-1] == '+actions = ["lift"]'
    assert lines([Put(("steps", "1", "label"), {"en": "2", "de": "Zwei"})]) == [
        '-label.en = "Two"',
        '-label.hr = "Dva"',
        '+label.en = "2"',
        '+label.de = "Zwei"',
    ]


def test_a_new_key_stands_in_its_table_and_a_removed_one_takes_its_line() -> None:
    assert lines([Put(("steps", "1", "maximum"), 30)]) == ["+maximum = 30"]
    assert lines([Put(("steps", "0", "minimum"), None)]) == ["-minimum = 1"]


def test_rows_move_with_their_comments_and_come_back() -> None:
    moved = edited(TEXT, [Swap(("steps",), 0)])
    assert moved.index("# The second one.") < moved.index("# The first step.") < moved.index('colour = "red"')
    assert tomllib.loads(edited(moved, [Swap(("steps",), 0)])) == tomllib.loads(TEXT)
    assert "# The first step." not in edited(TEXT, [Remove(("steps",), 0)])


def test_rows_and_tables_are_added_where_they_belong() -> None:
    text = edited(TEXT, [Insert(("steps",), 1, {"key": "new", "permissives": {"0": {"when": "b == 1"}}})])
    assert [row["key"] for row in tomllib.loads(text)["steps"]] == ["one", "new", "two"]
    assert "[steps.permissives.0]" in text
    text = edited(TEXT, [Put(("steps", "1", "permissives", "0"), {"when": 'x == "ž\\n"'})])
    assert tomllib.loads(text)["steps"][1]["permissives"]["0"]["when"] == 'x == "ž\\n"'
    text = edited(TEXT, [Rename(("steps", "0", "permissives", "3"), "5")])
    assert "[steps.permissives.5]" in text and "[steps.permissives.3]" not in text


def test_what_is_written_otherwise_is_left_to_people() -> None:
    inline = 'steps = [{ key = "one", minimum = 1 }]\n'
    for change in (Put(("steps", "0", "minimum"), 2), Insert(("steps",), 1, {"key": "b"}), Remove(("steps",), 0)):
        with pytest.raises(CannotEdit):
            edited(inline, [change])


@pytest.mark.sweep(8)
@pytest.mark.parametrize("name", FILES)
def test_every_step_of_a_shipped_sequence_can_be_moved_and_removed(name: str) -> None:
    text = bundled(name).read_text("utf-8")
    keys = [row["key"] for row in tomllib.loads(text)["steps"]]
    for number in range(len(keys) - 1):
        assert edited(edited(text, [Swap(("steps",), number)]), [Swap(("steps",), number)]) == text
        left = tomllib.loads(edited(text, [Remove(("steps",), number)]))["steps"]
        assert [row["key"] for row in left] == keys[:number] + keys[number + 1 :]
