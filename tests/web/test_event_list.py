"""Filters of the lists of events and records: numbers and places as typed, and what makes no sense is refused by its field."""

import pytest
from starlette.requests import Request

from app.errors import Refused
from app.web.event_list import amount, fields, place, set_filters


def asked(query: str) -> Request:
    return Request({"type": "http", "query_string": query.encode(), "headers": []})


@pytest.mark.parametrize(
    ("text", "value"), [("", None), ("0", 0.0), ("2.5", 2.5), ("2,5", 2.5), ("1e3", 1000.0), ("999999", 999999.0)]
)
def test_a_number_has_the_decimal_sign_of_either_language(text: str, value: float | None) -> None:
    assert amount(text, "longer", 1e6) == value


@pytest.mark.parametrize("text", ["-1", "1000000", "nan", "inf", "²", "5" * 13, "a", "1.2.3", "１"])
def test_what_is_no_number_or_too_large_is_refused(text: str) -> None:
    with pytest.raises(Refused) as refused:
        amount(text, "longer", 1e6)
    assert (refused.value.status, refused.value.params) == (422, {"field": "longer"})


@pytest.mark.parametrize(("text", "found"), [("", None), ("17-3", (17, 3)), ("999999999999999999-0", (10**18 - 1, 0))])
def test_a_page_begins_where_it_says(text: str, found: tuple[int, int] | None) -> None:
    assert place(text) == found


@pytest.mark.parametrize("text", ["17", "17-", "-3", "17-3-1", "²-1", "1-²", f"{'1' * 19}-1", "a-b", "1 -2"])
def test_a_place_that_is_none_is_refused(text: str) -> None:
    with pytest.raises(Refused) as refused:
        place(text)
    assert refused.value.params == {"field": "before"}


def test_fields_are_cut_and_each_is_there_once() -> None:
    request = asked("machine=%20m1%20&text=abcdefgh&more=x")
    assert fields(request, ("machine", "text", "code"), 5) == {"machine": "m1", "text": "abcde", "code": ""}
    with pytest.raises(Refused) as refused:
        fields(asked("code=1&code=2"), ("code",), 5)
    assert refused.value.params == {"field": "code"}
    assert set_filters({"machine": "m1", "text": "", "before": "17-3"}) == {"machine": "m1"}
