"""TOML within limits: what nobody writes by hand is refused in one line, before it costs anything."""

import pytest

from app.plant.toml import DEEPEST, LONGEST_TEXT, LONGEST_WORD, MOST_VALUES, TomlRefused, parse


@pytest.mark.parametrize(
    ("text", "tables"),
    [
        ("", {}),
        ("a = 1\n[b.c]\nd = [1, 2]", {"a": 1, "b": {"c": {"d": [1, 2]}}}),
        ("a = 'x # = [ . '  # [[[[[[[[[[[[[[[[[[[[[", {"a": "x # = [ . "}),
        ('a = """one\n"two" . = [\n"""', {"a": 'one\n"two" . = [\n'}),
        (f"a = '{'x' * LONGEST_TEXT}'", {"a": "x" * LONGEST_TEXT}),
        (f"a = {2**63 - 1}", {"a": 2**63 - 1}),
        (f"a = {'[' * DEEPEST}{']' * DEEPEST}", None),
        (f"{'.'.join('a' * (DEEPEST + 1))} = 1", None),
        (f"{'k' * LONGEST_WORD} = 1", {"k" * LONGEST_WORD: 1}),
    ],
)
def test_what_people_write_is_read(text: str, tables: dict[str, object] | None) -> None:
    found = parse(text)
    assert tables is None or found == tables


@pytest.mark.parametrize(
    ("text", "line", "expected"),
    [
        ("a = ", 1, "TOML"),
        ("a = 1\n\nb = = 2", 3, "TOML"),
        (f"x = 1\na = {'[' * (DEEPEST + 1)}{']' * (DEEPEST + 1)}", 2, f"at most {DEEPEST} in each other"),
        (f"{'.'.join('a' * (DEEPEST + 2))} = 1", 1, f"at most {DEEPEST} parts"),
        (f"x = 1\n{'k' * (LONGEST_WORD + 1)} = 1", 2, f"at most {LONGEST_WORD} characters"),
        (f"a = {'9' * (LONGEST_WORD + 1)}", 1, f"at most {LONGEST_WORD} characters"),
        (f"a = '{'x' * (LONGEST_TEXT + 1)}'", 1, f"at most {LONGEST_TEXT} characters"),
        ('b = 1\na = "x\\u0007"', 2, "can be printed"),
        (f"a = {2**63}", 1, "64 bits"),
        ("a = [" + "1," * MOST_VALUES + "1]", 0, f"at most {MOST_VALUES}"),
    ],
)
def test_anything_beyond_is_refused_with_its_line(text: str, line: int, expected: str) -> None:
    with pytest.raises(TomlRefused, match=expected) as refused:
        parse(text)
    assert refused.value.line == line


def test_the_same_text_is_read_once() -> None:
    assert parse("once = 1") is parse("once = 1")
