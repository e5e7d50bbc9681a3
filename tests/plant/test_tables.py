"""TOML read key by key: every mistake is noted with its line, and what is read in its place can be gone on with."""

from pathlib import Path

import pytest

from app.plant.tables import STOP_AT, Enough, Source, Table, one_of, read_label, span


def table(folder: Path, text: str) -> Table:
    file = folder / "x.toml"
    file.write_text(text, "utf-8")
    return Source(file, "x.toml").table()


def told(read: Table) -> list[tuple[str, str, str, int | None]]:
    return [(one.key, one.value, one.expected, one.line) for one in read.source.problems]


@pytest.mark.parametrize(
    ("method", "given", "good", "instead", "expected"),
    [
        ("text", {}, '"a"', "", "a text"),
        ("text", {"default": "d"}, '"a"', "d", "a text"),
        ("text", {"choices": ("a", "b")}, '"a"', "a", "one of a, b"),
        ("number", {"low": 1, "high": 9}, "2.5", 0.0, "a number from 1 to 9"),
        ("number", {"default": 5, "low": 1}, "2.5", 5, "a number from 1 up"),
        ("whole", {"low": 1, "high": 9}, "2", 1, "a whole number from 1 to 9"),
        ("whole", {"default": 7}, "2", 7, "a whole number from 0 to 65535"),
        ("flag", {}, "true", False, "true or false"),
        ("items", {}, "[1]", [], "a list"),
    ],
)
@pytest.mark.parametrize("bad", ["[[]]", "{ a = [] }"])
def test_a_wrong_value_is_told_and_something_that_fits_read(
    tmp_path: Path, method: str, given: dict[str, object], good: str, instead: object, expected: str, bad: str
) -> None:
    read = table(tmp_path, f"\nkey = {good}")
    assert getattr(read, method)("key", **given) == {"true": True, '"a"': "a", "[1]": [1]}.get(
        good, float(good) if good[0].isdigit() else None
    )
    assert told(read) == []
    bad = "5" if method in ("items", "flag") else bad
    read = table(tmp_path, f"\nkey = {bad}")
    assert getattr(read, method)("key", **given) == instead
    ((key, _, said, line),) = told(read)
    assert (key, said, line) == ("key", expected, 2)


@pytest.mark.parametrize("number", ["nan", "inf", "true", "0", "10", '"5"'])
def test_a_number_is_finite_no_flag_and_within(tmp_path: Path, number: str) -> None:
    read = table(tmp_path, f"n = {number}")
    assert read.number("n", low=1, high=9) == 0.0 and len(told(read)) == 1
    read = table(tmp_path, f"n = {number}")
    assert read.whole("n", low=1, high=9) == 1 and len(told(read)) == 1


@pytest.mark.parametrize(
    ("low", "expected"), [(float("-inf"), "a number from -1e+100 to 1e+100"), (0, "a number from 0 to 1e+100")]
)
def test_a_number_with_which_nobody_can_reckon_is_told_with_what_can_be(
    tmp_path: Path, low: float, expected: str
) -> None:
    read = table(tmp_path, "n = 1e308")
    assert read.number("n", low=low) == 0.0
    ((_, _, said, _),) = told(read)
    assert said == expected


def test_what_is_missing_is_told_only_where_it_must_be_there(tmp_path: Path) -> None:
    read = table(tmp_path, "[a]\nx = 1")
    inner = read.table("a")
    assert inner.text("label", "") == "" and inner.number("n", None) is None and not inner.flag("f")
    assert told(read) == []
    inner.text("name")
    assert told(read) == [("a.name", "missing", "a text", 1)]


def test_a_key_that_nobody_asked_for_is_told_with_the_one_that_was_meant(tmp_path: Path) -> None:
    read = table(tmp_path, "speed = 1\nsped = 2")
    read.number("speed")
    read.done()
    assert told(read) == [("sped", "2", "no such key; one of speed (perhaps speed)", 2)]


def test_rows_of_a_list_have_their_own_lines(tmp_path: Path) -> None:
    read = table(tmp_path, "[[a]]\nx = 1\n[[a]]\nx = true\n")
    assert [row.whole("x") for row in read.rows("a")] == [1, 0]
    assert told(read) == [("a.1.x", "true", "a whole number from 0 to 65535", 4)]


def test_a_file_of_nothing_but_mistakes_is_not_read_to_its_end(tmp_path: Path) -> None:
    read = table(tmp_path, "x = 1")
    with pytest.raises(Enough):
        for number in range(STOP_AT + 1):
            read.note(f"x{number}", 1, "2")
    assert len(told(read)) == STOP_AT


@pytest.mark.parametrize(
    ("value", "texts", "keys"),
    [
        ('"Fan"', {"hr": "Fan", "de": "Fan"}, []),
        ('{ hr = "V", de = "L" }', {"hr": "V", "de": "L"}, []),
        ('{ hr = "V" }', {"hr": "V"}, []),
        ('{ hr = "V", fr = "F" }', {"hr": "V"}, ["label.fr"]),
        ('{ hr = "" }', {}, ["label.hr"]),
        ('""', {"hr": "d", "de": "d"}, ["label"]),
        ("5", {"hr": "d", "de": "d"}, ["label"]),
    ],
)
def test_a_label_is_a_text_or_one_for_each_language(
    tmp_path: Path, value: str, texts: dict[str, str], keys: list[str]
) -> None:
    read = table(tmp_path, f"label = {value}")
    assert read_label(read, "label", ("hr", "de"), ("hr", "en", "de", "cs"), default="d") == texts
    assert [key for key, *_ in told(read)] == keys


def test_choices_and_ranges_are_told_in_words() -> None:
    assert one_of(["rtu", "tcp"], "rtv") == "one of rtu, tcp (perhaps rtu)"
    assert one_of([]) == "one of none"
    assert one_of([f"c{n}" for n in range(45)]).endswith("c39 and 5 more")
    assert [span("number", *ends) for ends in ((1, 2), (1, float("inf")), (float("-inf"), 2), (float("-inf"), float("inf")))] == [
        "a number from 1 to 2", "a number from 1 up", "a number up to 2", "a number",
    ]  # fmt: skip


@pytest.mark.parametrize(
    "written",
    [
        "true",
        '["x", false]',
        '{ en = ["x"], "a b" = 1 }',
        "[{ a = 1.5 }, {}]",
        '"say \\"so\\""',
        "2026-03-09",
        "06:05:00",
    ],
)
def test_a_wrong_value_is_shown_as_the_file_writes_it(tmp_path: Path, written: str) -> None:
    read = table(tmp_path, f"key = [{written}]")
    read.whole("key")
    ((_, shown, _, _),) = told(read)
    assert shown == f"[{written}]"


def test_of_a_long_value_a_line_is_shown(tmp_path: Path) -> None:
    read = table(tmp_path, "key = [[[[[[1]]]]]]\nmany = { " + ", ".join(f"k{n} = true" for n in range(40)) + " }")
    read.whole("key")
    read.whole("many")
    first, second = told(read)
    assert first[1] == "[[[[[...]]]]]"
    assert second[1].startswith("{ k0 = true, k1 = true, ") and len(second[1]) <= 120


def test_the_line_of_a_mistake_is_found_in_a_file_of_lines_that_look_like_headers(tmp_path: Path) -> None:
    """To look for the end of each took half an hour: the third power of its blanks, for 2 000 lines of them."""
    read = table(tmp_path, "rows = [\n" + ("[" + " " * 900 + "1,\n],\n") * 2_000 + "]\nname = 1\n")
    assert read.text("name") == ""
    assert [problem.line for problem in read.source.problems] == [4_003]
