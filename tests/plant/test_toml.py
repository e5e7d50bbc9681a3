"""TOML within limits: what nobody writes by hand is refused in one line, before it costs anything."""

import contextlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.plant.toml import (
    DEEPEST,
    LONGEST_TEXT,
    LONGEST_WORD,
    MOST_VALUES,
    TomlRefused,
    check_outline,
    is_plain,
    parse,
)


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


PIECES = ("a", "=", ",", " ", "\n", ".", "[", "]", "{", "}", "#", '"', "'", '"""', "'''", "\\", "ž")
MANY = st.tuples(
    st.sampled_from(PIECES), st.sampled_from((1, 1, 1, 2, DEEPEST, DEEPEST + 1, LONGEST_WORD + 1, MOST_VALUES + 1))
)


@given(st.lists(MANY, max_size=12))
def test_nothing_beyond_the_outline_passes_for_plain(pieces: list[tuple[str, int]]) -> None:
    text = "".join(piece * number for piece, number in pieces)
    if is_plain(text):
        check_outline(text)


def test_a_plain_file_is_one_whatever_its_texts_hold() -> None:
    assert is_plain('key.of.parts = ["' + "[{.,=" * 50_000 + '", 1.5] # ' + "[" * 50)
    assert not is_plain("[" * (DEEPEST + 1) + "]" * (DEEPEST + 1))


@pytest.mark.parametrize("begin", ['a = "', "a = '", 'a = """', "a = '''", "a = [", "# "])
@pytest.mark.parametrize("sign", ['\\"', "\\'", '"\\', "' ", '""', "''", '" \n', "' \n", "\\"])
def test_a_text_that_does_not_end_is_looked_through_once(begin: str, sign: str) -> None:
    """Each sign may look like the begin of one; to look for the end of each took hours in a file of 2 MB."""
    text = begin + sign * 100_000
    with contextlib.suppress(TomlRefused):
        check_outline(text)
    is_plain(text)
    with contextlib.suppress(TomlRefused):
        parse(text)
