"""The small grammar: what it says, what it does not know, what it refuses."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.errors import ConfigurationError
from app.plant.expression import DEEPEST, LONGEST, Reading, number, parse
from app.tags.batch import Value
from app.tags.quality import COMM_FAILURE, GOOD, NO_DATA, STALE, Origin


@pytest.mark.parametrize(
    ("text", "result"),
    [
        ("1 + 2 * 3", 7),
        ("-(a - 10) / 4", 1.5),
        ("a > 3 and b <= 2", True),
        ("0 < b <= 2", True),
        ("0 < b <= 1 or not a", False),
        ("a in (1, 4)", True),
        ("a not in (1, 4)", False),
        ("abs(-a) + min(a, b) + max(1, a, b)", 10),
        ("120 * 50 / a - 1450 > 0.02 * 1500", True),
        ("a == 4 and not (b != 2)", True),
        ("a / 0 > 1", None),
        ("true_ > 1", None),
    ],
)
def test_sentences(text: str, result: object) -> None:
    assert parse(text).evaluate({"a": 4, "b": 2}) == result


@pytest.mark.parametrize(
    ("text", "result"),
    [
        ("bad_ > 1", None),
        ("bad_ > 1 and no", False),
        ("no and bad_ > 1", False),
        ("bad_ > 1 and yes", None),
        ("bad_ > 1 or yes", True),
        ("bad_ > 1 or no", None),
        ("not bad_", None),
        ("3 < bad_ < 1", None),
        ("2 < 1 < bad_", False),
        ("bad_ in (1, 2)", None),
        ("yes in (bad_, 1)", True),
        ("yes in (bad_, 2)", None),
        ("min(bad_, 1)", None),
        ("good(bad_)", False),
        ("bad(bad_)", True),
        ("bad(missing)", True),
        ("good(yes) and not bad(yes)", True),
        ("good(old) or bad(old)", False),
        ("old == 7", True),
        ("word", None),
        ("nan_ < 1", None),
    ],
)
def test_what_is_not_known_stays_unknown_until_it_no_longer_matters(text: str, result: object) -> None:
    values: dict[str, Value | Reading] = {
        "bad_": (5, COMM_FAILURE),
        "yes": (1, GOOD | Origin.SIMULATED),
        "no": 0,
        "old": (7, STALE),
        "word": "text",
        "nan_": float("nan"),
    }
    assert parse(text).evaluate(values) is result if result is None else parse(text).evaluate(values) == result


def test_names_argument_and_age_are_told() -> None:
    sentence = parse("abs(setpoint - argument) < 0.006 and age(status) < 3")
    assert (sentence.names, sentence.ages, sentence.needs_argument) == (
        frozenset({"setpoint", "status"}),
        frozenset({"status"}),
        True,
    )
    assert sentence.evaluate({"setpoint": 40.001}, argument=40, age=lambda key: 1.0) is True
    assert sentence.evaluate({"setpoint": 40.001}, argument=40, age=lambda key: 4.0) is False
    assert sentence.evaluate({"setpoint": 40.001}, argument=40) is None
    assert sentence.evaluate(lambda key: (None, NO_DATA), argument=40, age=lambda key: 1.0) is None


def test_a_limit_may_be_a_number_or_a_sentence() -> None:
    assert number("650") == 650.0
    assert number(3) == 3.0
    assert number("f111 * 2", {"f111": 50}) == 100.0
    assert number("f111") is None


@pytest.mark.parametrize(
    "text",
    [
        "",
        "   ",
        "a +",
        "9" * 310,
        "a > -" + "9" * 3_000,
        ".".join(["a"] * 1_900),
        "a = 1",
        "a.b",
        "a[0]",
        "a ** 2",
        "a // 2",
        "a % 2",
        "a & 1",
        "~a",
        "a if b else c",
        "lambda: 1",
        "__import__('os')",
        "open('x')",
        "abs(a, b)",
        "abs()",
        "abs",
        "good(1)",
        "good(a + b)",
        "good(a, b)",
        "min(*a)",
        "max(a, key=b)",
        "'text' == a",
        "a is b",
        "a in 3",
        "a in ()",
        "a in [1]",
        "[1, 2]",
        "1e999",
        "1j",
        "None",
        "f'{a}'",
        "(a := 1)",
        "a; b",
        "a\nb",
        "1 + " * LONGEST + "1",
        "(" * (DEEPEST + 300) + "a" + ")" * (DEEPEST + 300),
        "-" * (DEEPEST + 2) + "a",
        "not " * (DEEPEST + 2) + "a",
        "a\0",
    ],
)
def test_everything_else_is_refused_with_text_position_and_expectation(text: str) -> None:
    with pytest.raises(ConfigurationError, match=r"(?s)expression .*position \d+: found .*, expected "):
        parse(text)


def test_a_mistake_is_named_where_it_stands() -> None:
    with pytest.raises(ConfigurationError, match=r"position 9: found `b \*\* 2`"):
        parse("a > 1 + b ** 2")


@pytest.mark.sweep(8)
@given(st.text(max_size=60))
def test_no_text_does_anything_but_parse_or_be_refused(text: str) -> None:
    try:
        sentence = parse(text)
    except ConfigurationError:
        return
    sentence.evaluate({})
