"""How numbers, times and qualities are written. That the live script writes the same is in tests/browser/test_live.py."""

import json
from datetime import UTC, datetime
from functools import partial
from zoneinfo import ZoneInfo

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.clock import to_micros
from app.plant.texts import Texts, read_product
from app.tags import quality as q
from app.tags.quality import Origin
from app.web import format as fmt
from app.web.points import REASONS, live_texts

LANGUAGES = ("hr", "en", "de", "cs")
ZAGREB = ZoneInfo("Europe/Zagreb")
TEXTS = Texts(read_product())


def text(lang: str) -> fmt.Text:
    return partial(TEXTS.text, lang)


@pytest.mark.parametrize(
    ("value", "decimals", "english", "others"),
    [
        (0, 0, "0", "0"),
        (1180, 0, "1 180", "1 180"),
        (999, 0, "999", "999"),
        (1000, 0, "1 000", "1 000"),
        (1234567.891, 3, "1 234 567.891", "1 234 567,891"),
        (-5.25, 2, "-5.25", "-5,25"),
        (-0.04, 1, "0.0", "0,0"),
        (-0.0, 0, "0", "0"),
        (-0.05, 1, "-0.1", "-0,1"),
        (0.5, 0, "1", "1"),
        (1.5, 0, "2", "2"),
        (2.5, 0, "3", "3"),
        (-2.5, 0, "-3", "-3"),
        (1.005, 2, "1.01", "1,01"),
        (2.675, 2, "2.68", "2,68"),
        (999.95, 1, "1 000.0", "1 000,0"),
        (9.995, 2, "10.00", "10,00"),
        (0.004, 2, "0.00", "0,00"),
        (2**53, 0, "9 007 199 254 740 992", "9 007 199 254 740 992"),
        (2**53 + 1, 2, "9 007 199 254 740 992.00", "9 007 199 254 740 992,00"),
        (2**53 + 2, 0, "9.007199E15", "9,007199E15"),
        (1e21, 0, "1.000000E21", "1,000000E21"),
        (9.9999999e20, 3, "1.000000E21", "1,000000E21"),
        (2**64 - 1, 0, "1.844674E19", "1,844674E19"),
        (-(2**63), 0, "-9.223372E18", "-9,223372E18"),
        (1.7e308, 3, "1.700000E308", "1,700000E308"),
        (5e-324, 3, "0.000", "0,000"),
    ],
)
def test_a_number_has_fixed_decimals_groups_of_three_and_the_sign_of_its_language(
    value: float, decimals: int, english: str, others: str
) -> None:
    def written(plain: str) -> str:
        return plain.replace(" ", "\u202f").replace("-", "\u2212")

    assert fmt.number(value, decimals, "en") == written(english)
    assert {fmt.number(value, decimals, lang) for lang in ("hr", "de", "cs")} == {written(others)}


@pytest.mark.parametrize("value", [float("nan"), float("inf"), float("-inf")])
def test_what_is_no_number_is_written_as_a_bad_value(value: float) -> None:
    assert fmt.number(value, 2, "de") == "----"


@pytest.mark.sweep(8)
@given(st.floats(allow_nan=False, allow_infinity=False, min_value=-1e15, max_value=1e15), st.integers(0, 4))
def test_a_written_number_is_at_most_half_a_last_digit_away(value: float, decimals: int) -> None:
    written = fmt.number(value, decimals, "en").replace("\u202f", "").replace("\u2212", "-")
    assert abs(float(written) - value) <= 0.5 * 10.0**-decimals * (1 + 1e-9) + abs(value) * 1e-15
    assert len(written.partition(".")[2]) == decimals


@pytest.mark.parametrize(("lang", "unit"), [("hr", "o/min"), ("en", "rpm"), ("de", "1/min"), ("cs", "ot/min")])
def test_revolutions_have_a_unit_of_each_language_and_symbols_stay(lang: str, unit: str) -> None:
    assert fmt.unit_symbol("rpm", text(lang)) == unit
    assert [fmt.unit_symbol(symbol, text(lang)) for symbol in ("Hz", "kW", "°C", "%")] == ["Hz", "kW", "°C", "%"]


@pytest.mark.parametrize("lang", LANGUAGES)
def test_every_unit_reason_and_origin_has_words(lang: str) -> None:
    words = [fmt.unit_words(unit, text(lang)) for unit in fmt.SPOKEN_UNITS]
    words += [
        fmt.quality_words(q.BAD | why << 2 | flag, text(lang)) for why in q.QualityReason for flag in (0, *Origin)
    ]
    assert not [word for word in words if not word or "[" in word or "{" in word]
    assert "[" not in json.dumps(live_texts(text(lang))).replace("[", "", 1)


def test_the_reasons_of_the_live_script_are_those_of_the_quality_word() -> None:
    assert tuple(reason.name.lower() for reason in q.QualityReason if reason) == REASONS


def test_parameters_of_a_reason_are_written_for_people() -> None:
    given = {
        "min": 1.0,
        "max": 1250.5,
        "value": -0.25,
        "unit": "rpm",
        "seconds": 2.0,
        "age": 90.0,
        "since": 5,
        "code": 3,
    }
    assert fmt.parameters(given, "hr", text("hr")) == {
        "min": "1",
        "max": f"1{fmt.GROUP}250,5",
        "value": f"{fmt.MINUS}0,25",
        "unit": "o/min",
        "seconds": "2",
        "age": f"1{fmt.SPACE}min",
        "since": 5,
        "code": 3,
    }
    assert fmt.parameters({"max": 1.5, "unit": "mm"}, "en", text("en")) == {"max": "1.5", "unit": "mm"}
    assert fmt.parameters({"value": float("inf"), "a": True, "b": "2.0"}, "en", text("en")) == {
        "value": fmt.NO_VALUE,
        "a": True,
        "b": "2.0",
    }


def test_what_was_typed_is_repeated_without_signs_that_are_none() -> None:
    typed = {"text": "a\x00b\u202ec\nd", "at": "š – ’ 5\u00a0%", "missing": ["x"]}
    assert fmt.parameters(typed, "en", text("en")) == typed | {"text": r"a\x00b\u202ec\x0ad"}


def test_a_percentage_has_a_space_in_every_language() -> None:
    assert {fmt.percent(26, 0, lang) for lang in LANGUAGES} == {"26\u00a0%"}


@pytest.mark.parametrize(
    ("seconds", "written"),
    [
        (0, "0 s"),
        (0.9, "0 s"),
        (12, "12 s"),
        (59.99, "59 s"),
        (60, "1 min"),
        (3599, "59 min"),
        (7300, "2 h"),
        (86400 * 4, "4 d"),
    ],
)
def test_an_age_is_told_in_its_largest_unit(seconds: float, written: str) -> None:
    assert fmt.age(seconds) == written.replace(" ", "\u00a0")


@pytest.mark.parametrize(
    ("seconds", "written"),
    [
        (0.44, "0,4_s"),
        (9.94, "9,9_s"),
        (9.96, "10_s"),
        (42, "42_s"),
        (185, "3_min 05_s"),
        (7620, "2_h 07_min"),
        (356400, "4_d 03_h"),
    ],
)
def test_a_duration_has_two_units_at_most(seconds: float, written: str) -> None:
    assert fmt.duration(seconds, "de") == written.replace("_", "\u00a0")


def test_times_are_those_of_the_plant_in_24_hours_with_their_nought() -> None:
    moment = to_micros(datetime(2026, 3, 9, 6, 5, 4, 120_999, tzinfo=UTC))
    assert fmt.clock_time(moment, ZAGREB) == "07:05:04"
    assert fmt.clock_time(moment, ZAGREB, seconds=False) == "07:05"
    assert fmt.clock_time(moment, ZAGREB, milliseconds=True) == "07:05:04.120"
    assert fmt.clock_time(moment, ZAGREB, milliseconds=True, lang="hr") == "07:05:04,120"
    assert fmt.date_time(moment, ZAGREB, "de", moment, milliseconds=True) == "09.03. 07:05:04,120"
    assert [fmt.date(moment, ZAGREB, lang) for lang in LANGUAGES] == [
        "09.03.2026",
        "09/03/2026",
        "09.03.2026",
        "09.03.2026",
    ]
    assert fmt.date_time(moment, ZAGREB, "hr", moment) == "09.03. 07:05:04"
    assert fmt.date_time(moment, ZAGREB, "en", moment) == "09/03 07:05:04"
    assert fmt.date_time(moment, ZAGREB, "hr", moment + 400 * 86_400_000_000) == "09.03.2026 07:05:04"
    assert fmt.moment_or_time(moment, ZAGREB, "hr", moment) == "07:05:04"
    assert fmt.iso(moment, ZAGREB) == "2026-03-09T07:05:04.120+01:00"


def test_the_hour_that_comes_twice_in_autumn_is_told_apart() -> None:
    first = to_micros(datetime(2026, 10, 25, 0, 30, tzinfo=UTC))
    second = first + 3_600_000_000
    assert fmt.date_time(first, ZAGREB, "hr", first) == "25.10. 02:30:00 +02:00"
    assert fmt.date_time(second, ZAGREB, "hr", first) == "25.10. 02:30:00 +01:00"
    assert fmt.date_time(second + 3_600_000_000, ZAGREB, "hr", first) == "25.10. 03:30:00"
    assert fmt.moment_or_time(first, ZAGREB, "hr", second) == "02:30:00 +02:00"
    assert fmt.clock_time(first, ZAGREB, seconds=False) == "02:30 +02:00"
    assert fmt.clock_time(second, ZAGREB, milliseconds=True) == "02:30:00.000 +01:00"
    assert fmt.clock_time(second, ZAGREB, offset=False) == "02:30:00", "of now, which the page goes on with"
    assert fmt.moment_or_time(second, ZAGREB, "hr", second) == "02:30:00 +01:00"
    assert fmt.moment_or_time(second + 3_600_000_000, ZAGREB, "hr", second) == "03:30:00"
    assert fmt.moment_or_time(first + 7_000, ZAGREB, "hr", second, milliseconds=True) == "02:30:00,007 +02:00"


@pytest.mark.parametrize(
    ("quality", "state", "source"),
    [
        (q.GOOD, "good", "field"),
        (q.OUT_OF_RANGE, "uncertain", "field"),
        (q.STALE, "stale", "field"),
        (q.COMM_FAILURE, "bad", "field"),
        (q.NO_DATA, "none", "field"),
        (q.GOOD | Origin.SIMULATED, "good", "sim"),
        (q.GOOD | Origin.FORCED | Origin.SIMULATED, "good", "forced"),
        (q.GOOD | Origin.LOCAL, "good", "manual"),
        (q.STALE | Origin.SUBSTITUTED, "stale", "manual"),
    ],
)
def test_a_quality_has_its_look(quality: int, state: str, source: str) -> None:
    assert (fmt.quality_state(quality), fmt.source_state(quality)) == (state, source)


def test_quality_is_told_with_reason_and_origin() -> None:
    assert fmt.quality_words(q.GOOD, text("en")) == "good"
    assert fmt.quality_words(q.COMM_FAILURE, text("en")) == "bad: no communication with the device"
    assert fmt.quality_words(q.STALE, text("de")) == "veraltet"
    assert fmt.quality_words(q.GOOD | Origin.SIMULATED, text("hr")) == "ispravno, simulirana vrijednost"
