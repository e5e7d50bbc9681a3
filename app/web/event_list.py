"""What the lists of events and of records have in common: fields of the filter, the span of time, pages."""

from collections.abc import Mapping, Sequence

from fastapi import Request

from app.errors import Refused
from app.historian.export import meant
from app.web.audit import read_time
from app.web.signin import zone_of

RANGE = "history.range"
"""Why a span is refused whose end is not after its beginning."""


def fields(request: Request, names: Sequence[str], longest: int) -> dict[str, str]:
    """The fields of the filter as typed, cut after `longest` characters.

    Raises:
        Refused: 422, one is there twice.
    """
    given = request.query_params
    for name in names:
        if len(given.getlist(name)) > 1:
            raise Refused("access.form_field", 422, field=name)
    return {name: given.get(name, "").strip()[:longest] for name in names}


def span(request: Request, typed: Mapping[str, str]) -> tuple[int | None, int | None]:
    """Beginning and end that `since` and `until` say; None = open.

    Raises:
        Refused: 422, one cannot be read; `RANGE`, the end is not after the beginning.
    """
    begin, end = read_time(request, typed["since"], "since"), read_time(request, typed["until"], "until")
    in_order(request, (begin, end), (typed["since"], typed["until"]))
    return begin, end


def in_order(request: Request, span: tuple[int | None, int | None], written: tuple[str, str]) -> None:
    """Refuse a span [µs UTC] in which nothing can be; `written` is how somebody said it.

    Raises:
        Refused: 422, `RANGE`; it tells what is meant where that is another time: an hour that the clock leaves out, another offset.
    """
    begin, end = span
    if begin is not None and end is not None and end <= begin:
        zone = zone_of(request)
        raise Refused(RANGE, 422, begin=meant(written[0], begin, zone), end=meant(written[1], end, zone))


def amount(text: str, field: str, below: float) -> float | None:
    """A number from 0 on, with the decimal sign of either language; None = empty.

    Raises:
        Refused: 422, it is none, or not below `below`.
    """
    if not text:
        return None
    try:
        value = float(text.replace(",", ".")) if len(text) <= 12 and text.isascii() else -1.0
    except ValueError:
        value = -1.0
    if not 0 <= value < below:
        raise Refused("access.form_field", 422, field=field)
    return value


def place(text: str) -> tuple[int, int] | None:
    """Where a page begins: `time-id` of the last line before it; None = with the newest.

    Raises:
        Refused: 422, it says no place.
    """
    if not text:
        return None
    time, _, number = text.partition("-")
    if not all(one.isascii() and one.isdecimal() and len(one) <= 18 for one in (time, number)):
        raise Refused("access.form_field", 422, field="before")
    return int(time), int(number)


def set_filters(typed: Mapping[str, str]) -> dict[str, str]:
    """What filters, without the page."""
    return {name: value for name, value in typed.items() if value and name != "before"}
