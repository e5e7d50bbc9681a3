"""Dates and times as people type them: day, month, year in the order of our languages, whatever the browser's own language is.

All of our languages write the day first, so what is typed in one is read in each: `23.11.2026 14:05`, `23/11/2026`,
`23. 11. 2026. 14:05:30`. ISO 8601 is read, too: links and programs have it.
"""

import re
from datetime import datetime, timedelta
from zoneinfo import ZoneInfo

from app.clock import to_datetime, to_micros
from app.historian.calendar import utc
from app.web.format import DECIMAL_POINT, repeated

PATTERN = r"\s*(\d{1,2}[.\/\-] ?\d{1,2}[.\/\-] ?\d{4}\.?([ ,]+\d{1,2}[:.]\d{2}([:.]\d{2})?)?|\d{4}-\d\d-\d\d.*)?\s*"
"""What a browser lets through, as the attribute of a field."""
LONGEST = 40
_TYPED = re.compile(
    r"(\d{1,2})[./-] ?(\d{1,2})[./-] ?(\d{4})\.?(?:[ ,]+(\d{1,2})[:.](\d{2})(?:[:.](\d{2}))?)?", re.ASCII
)


def read(text: str, *, end: bool = False) -> datetime:
    """What `text` says; without zone unless it names an offset. A day alone is its beginning, or with `end` the end of it.

    Raises:
        ValueError: it says no time.
    """
    found = _TYPED.fullmatch(text.strip())
    if found is None:
        return datetime.fromisoformat(text.strip())
    day, month, year, hour, minute, second = (int(part or 0) for part in found.groups())
    moment = datetime(year, month, day, hour, minute, second)
    return moment + timedelta(days=1) if end and found[4] is None else moment


def micros(text: str, zone: ZoneInfo, *, end: bool = False) -> int:
    """What `text` says, in `zone` unless it names an offset [µs UTC]. Of a time that the clock shows twice in autumn the first is meant, of
    an `end` the second; of one that it skips in spring the moment at which it jumps: so nothing between is left out.

    Raises:
        ValueError, OverflowError: it says no time, or none that can be written in UTC and in `zone`.
    """
    typed = read(text, end=end)
    if typed.tzinfo is not None:
        found = to_micros(typed)
    elif end and repeated(local := typed.replace(tzinfo=zone)):
        found = to_micros(local.replace(fold=1))
    else:
        found = utc(typed, zone)
    to_datetime(found).astimezone(zone)
    return found


def shown(text: str, lang: str) -> str:
    """`text` as a field shows it in `lang`: what is understood in the usual form, anything else as it was typed."""
    try:
        moment = read(text)
    except (ValueError, OverflowError):
        return text
    if moment.tzinfo is not None or moment.microsecond:
        return text
    day, typed = written_day(moment, lang), _TYPED.fullmatch(text.strip())
    if typed is not None and typed[4] is None:
        return day
    return f"{day} {moment:%H:%M:%S}" if moment.second else f"{day} {moment:%H:%M}"


def written_day(moment: datetime, lang: str) -> str:
    """The day of `moment`: `23.11.2026`, in English `23/11/2026`."""
    mark = "/" if lang in DECIMAL_POINT else "."
    return mark.join((f"{moment.day:02d}", f"{moment.month:02d}", f"{moment.year:04d}"))
