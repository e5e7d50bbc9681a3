"""How numbers, times and qualities are written for a person, in their language.

static/js/format.js says the same to the same numbers, character for character: what the server draws first and what the live script
writes later is one text (tests/browser/test_live.py sweeps both). Decisions: reference/i18n.md section 6.
"""

import math
from collections.abc import Callable, Mapping
from datetime import datetime
from decimal import ROUND_HALF_UP, Context, Decimal
from zoneinfo import ZoneInfo

from app.access.audit.line import printable
from app.clock import to_datetime
from app.errors import EXCEPTION_NAMES
from app.tags.quality import BAD, GOOD, Origin, QualityReason, level, origin, reason

Text = Callable[..., str]
"""Looks a key up in the language of the page and fills its placeholders."""

GROUP = "\u202f"
"""Between groups of three digits, from 1 000 upward, in every language."""
MINUS = "\u2212"
SPACE = "\u00a0"
"""Between number and unit."""
NO_VALUE = "----"
"""Of bad quality: the last value is never shown."""
NO_DATA_YET = "\u2013\u00a0\u2013"
DECIMAL_POINT = frozenset({"en"})
"""Languages that write a point; all others a comma."""

TRANSLATED_UNITS = frozenset({"rpm"})
"""Units that differ by language, `unit.<key>` of the product texts; all others are symbols of the SI and stay as they are."""
SPOKEN_UNITS: dict[str, str] = {
    "Hz": "hertz",
    "A": "ampere",
    "V": "volt",
    "kW": "kilowatt",
    "W": "watt",
    "%": "percent",
    "°C": "celsius",
    "rpm": "rpm",
    "h": "hour",
    "min": "minute",
    "s": "second",
    "ms": "millisecond",
    "mm": "millimetre",
    "m": "metre",
    "mm/s": "millimetre_per_second",
    "m/s": "metre_per_second",
    "t": "tonne",
    "kg": "kilogram",
    "Nm": "newton_metre",
    "°": "degree",
}
"""Unit → `unit.spoken.<key>`: the words for a screen reader."""

VALUES = frozenset({"value", "current", "expected", "min", "max", "asked", "a", "b", "old", "new"})
"""Parameters of a reason that are values with the reason's unit."""
MOST_DECIMALS = 4
"""Of such a value; noughts at its end are left out."""

WHOLE = 2.0**53
"""Beyond it a browser does not have every whole number, and the last digits are none of the device: it is written by its power of ten."""
POWER_DECIMALS = 6

_EXACT = Context(prec=400)
"""Digits enough for every float."""

ORIGINS: tuple[tuple[Origin, str], ...] = (
    (Origin.FORCED, "forced"),
    (Origin.SUBSTITUTED, "manual"),
    (Origin.LOCAL, "manual"),
    (Origin.SIMULATED, "sim"),
)
"""Which origin is shown when there are several."""


def number(value: float, decimals: int, lang: str) -> str:
    """`value` with fixed `decimals`, half a last digit rounded away from zero on the digits that Python prints, never "−0".

    What is not finite is written as a bad value; what is beyond `WHOLE` as `1.844674E19`.
    """
    if not math.isfinite(value):
        return NO_VALUE
    mark = "." if lang in DECIMAL_POINT else ","
    if abs(float(value)) > WHOLE:
        return _by_power(float(value)).replace("-", MINUS).replace(".", mark)
    rounded = _round(value, decimals)
    whole, _, rest = f"{rounded.copy_abs():f}".partition(".")
    head = len(whole) % 3
    groups = [whole[:head]] if head else []
    groups += [whole[i : i + 3] for i in range(head, len(whole), 3)]
    sign = MINUS if rounded < 0 else ""
    return sign + GROUP.join(groups) + (mark + rest if rest else "")


def quantity(value: float, decimals: int, unit: str, lang: str) -> str:
    """Number and unit, `unit` as drawn (see `unit_symbol`)."""
    return f"{number(value, decimals, lang)}{SPACE}{unit}" if unit else number(value, decimals, lang)


def percent(value: float, decimals: int, lang: str) -> str:
    """`value` in percent; the sign stands after a no-break space in every language, also in English."""
    return quantity(value, decimals, "%", lang)


def span(low: float, high: float, decimals: int, lang: str) -> str:
    """A range of numbers: `900 – 1 250`."""
    return f"{number(low, decimals, lang)}{SPACE}\u2013{SPACE}{number(high, decimals, lang)}"


def shortest(value: float, decimals: int) -> int:
    """How many of `decimals` the number needs: limits are drawn without noughts at their end."""
    return max(0, -int(_round(value, decimals).normalize().as_tuple().exponent))


def hexadecimal(value: float, digits: int = 4) -> str:
    """A word of the device: `0x0001`."""
    return f"0x{round(value):0{digits}X}"


def unit_symbol(unit: str, text: Text) -> str:
    """The unit as drawn beside a number: rpm is o/min, rpm, 1/min, ot/min."""
    return text(f"unit.{unit}") if unit in TRANSLATED_UNITS else unit


def unit_words(unit: str, text: Text) -> str:
    """The unit as a screen reader says it, or its symbol where we have no words."""
    return text(f"unit.spoken.{SPOKEN_UNITS[unit]}") if unit in SPOKEN_UNITS else unit


def age(seconds: float) -> str:
    """An age in its largest whole unit: `12 s`, `3 min`, `2 h`, `4 d`."""
    whole = max(0, math.floor(seconds)) if math.isfinite(seconds) else 0
    for size, unit in ((86400, "d"), (3600, "h"), (60, "min")):
        if whole >= size:
            return f"{whole // size}{SPACE}{unit}"
    return f"{whole}{SPACE}s"


def duration(seconds: float, lang: str) -> str:
    """A duration: `0,4 s` below ten seconds, `42 s`, then with its next smaller unit: `3 min 05 s`, `2 h 07 min`, `4 d 03 h`."""
    if seconds < 9.95:
        return quantity(max(0.0, seconds), 1, "s", lang)
    whole = math.floor(seconds + 0.5)
    for size, unit, small, below in ((86400, "d", 3600, "h"), (3600, "h", 60, "min"), (60, "min", 1, "s")):
        if whole >= size:
            return f"{whole // size}{SPACE}{unit} {whole % size // small:02d}{SPACE}{below}"
    return f"{whole}{SPACE}s"


def clock_time(
    micros: int,
    zone: ZoneInfo,
    *,
    milliseconds: bool = False,
    seconds: bool = True,
    lang: str = "en",
    offset: bool = True,
) -> str:
    """Time of day in the plant's zone, 24 h with leading nought: `07:05:04`; milliseconds after the decimal sign of `lang`.

    The repeated hour of autumn with its offset, `02:30:00 +02:00`, unless without `offset`.
    """
    moment = _floor(micros, zone)
    text = f"{moment:%H:%M:%S}" if seconds or milliseconds else f"{moment:%H:%M}"
    if milliseconds:
        mark = "." if lang in DECIMAL_POINT else ","
        text += f"{mark}{moment.microsecond // 1000:03d}"
    return f"{text} {_offset(moment)}" if offset and repeated(moment) else text


def date(micros: int, zone: ZoneInfo, lang: str, *, year: bool = True) -> str:
    """Date in the plant's zone: `09.03.2026`, in English `09/03/2026`."""
    moment = to_datetime(micros).astimezone(zone)
    if lang in DECIMAL_POINT:
        return f"{moment:%d/%m/}{moment.year:04d}" if year else f"{moment:%d/%m}"
    return f"{moment:%d.%m.}{moment.year:04d}" if year else f"{moment:%d.%m.}"


def date_time(micros: int, zone: ZoneInfo, lang: str, now: int, *, milliseconds: bool = False) -> str:
    """Date and time for lists: the year only when it is not that of `now`; the repeated hour of autumn with its offset."""
    moment = to_datetime(micros).astimezone(zone)
    same_year = moment.year == to_datetime(now).astimezone(zone).year
    time = clock_time(micros, zone, milliseconds=milliseconds, lang=lang)
    return f"{date(micros, zone, lang, year=not same_year)} {time}"


def moment_or_time(micros: int, zone: ZoneInfo, lang: str, now: int, *, milliseconds: bool = False) -> str:
    """Time of day, if asked for to the ms, when it is of today, else date and time; the repeated hour of autumn with its offset."""
    moment, today = to_datetime(micros).astimezone(zone), to_datetime(now).astimezone(zone).date()
    if moment.date() != today:
        return date_time(micros, zone, lang, now)
    return clock_time(micros, zone, milliseconds=milliseconds, lang=lang)


def iso(micros: int, zone: ZoneInfo) -> str:
    """ISO 8601 with offset and milliseconds, for exports and titles."""
    return _floor(micros, zone).isoformat(timespec="milliseconds")


def repeated(moment: datetime) -> bool:
    """Whether the wall clock shows this time twice (autumn)."""
    return moment.replace(fold=0).utcoffset() > moment.replace(fold=1).utcoffset()  # type: ignore[operator]


def quality_state(quality: int) -> str:
    """How a value of this quality is drawn: good, uncertain, stale, bad, or none (never received)."""
    why = reason(quality)
    match level(quality):
        case 0:
            return "good"
        case 1:
            return "stale" if why is QualityReason.STALE else "uncertain"
        case _:
            return "none" if why is QualityReason.NO_DATA else "bad"


def source_state(quality: int) -> str:
    """Where the value comes from, as drawn: field, manual, forced, sim."""
    flags = origin(quality)
    return next((name for flag, name in ORIGINS if flags & flag), "field")


def quality_words(quality: int, text: Text) -> str:
    """Quality in words, with its reason and where the value comes from."""
    why, source = reason(quality), source_state(quality)
    words = text("quality." + {GOOD: "good", BAD: "bad"}.get(level(quality), "uncertain"))
    if why is QualityReason.STALE or why is QualityReason.NO_DATA:
        words = text(f"quality.reason.{why.name.lower()}")
    elif why:
        words = text("quality.because", quality=words, reason=text(f"quality.reason.{why.name.lower()}"))
    if source != "field":
        words = text("quality.from", quality=words, origin=text(f"quality.origin.{source}"))
    return words


def exception_key(code: int) -> str:
    """Key of the product text that names the Modbus exception `code`."""
    return f"communication.exception.{code if code in EXCEPTION_NAMES else 'other'}"


def parameters(params: Mapping[str, object], lang: str, text: Text) -> dict[str, object]:
    """`params` of a reason as a person reads them: values and units in the language, ages and seconds short, what a line says (`cause`) as
    `because`, and no sign of a text that cannot be read or turns the writing round; others as they are."""
    written = dict(params)
    for name, value in params.items():
        if isinstance(value, str):  # it may have been typed
            written[name] = printable(value, 8 * len(value))
        if not isinstance(value, int | float) or isinstance(value, bool):
            continue
        if name in VALUES or name in ("seconds", "limit"):
            most = MOST_DECIMALS if name in VALUES else 1
            written[name] = number(value, shortest(value, most) if math.isfinite(value) else 0, lang)
        elif name == "age":
            written[name] = age(value)
    if isinstance(unit := params.get("unit"), str):
        written["unit"] = unit_symbol(unit, text)
    if isinstance(cause := params.get("cause"), str) and cause.startswith("link.error."):
        written["because"] = text(cause)
    return written


def _round(value: float, decimals: int) -> Decimal:
    return Decimal(repr(float(value))).quantize(Decimal(1).scaleb(-decimals), ROUND_HALF_UP, _EXACT)


def _by_power(value: float) -> str:
    """`-9.223372E18`."""
    digits = Context(prec=POWER_DECIMALS + 1, rounding=ROUND_HALF_UP).create_decimal(repr(value))
    return f"{digits.scaleb(-digits.adjusted()):.{POWER_DECIMALS}f}E{digits.adjusted()}"


def _floor(micros: int, zone: ZoneInfo) -> datetime:
    return to_datetime(micros - micros % 1000).astimezone(zone)


def _offset(moment: datetime) -> str:
    text = f"{moment:%z}"
    return f"{text[:3]}:{text[3:5]}"
