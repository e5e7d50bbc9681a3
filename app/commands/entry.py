"""What a person typed as a number, read in the person's language; anything that can mean two things is asked, never guessed.

Rules: reference/i18n.md section 6 and hmi-design.md section 13. The decimal sign of the language counts; the other one only when it stands
alone and not before exactly three digits. Groups of three may be set apart by spaces or by the other sign.
"""

import re
from collections.abc import Mapping

from app.errors import Refused

DECIMAL: Mapping[str, str] = {"hr": ",", "de": ",", "cs": ",", "en": "."}
"""Language → decimal sign."""
SPACES = " \u00a0\u202f\u2009"
MINUS = "-\u2212\u2013"
LONGEST = 40


def parse_number(text: str, language: str, unit: str = "") -> float:
    """`text` as a number; a trailing `unit` of the field itself is allowed.

    Raises:
        Refused: 422 `why.ambiguous` with both readings as `a` and `b`; `why.not_a_number` for anything else that is no number
            (letters, exponents, infinity, other units).
    """
    typed = text.strip(SPACES + "\t\r\n")
    body = typed.removesuffix(unit).rstrip(SPACES) if unit else typed
    negative = body[:1] in tuple(MINUS)
    body = body[1:].lstrip(SPACES) if negative or body[:1] == "+" else body
    own = DECIMAL.get(language, ".")
    other = "." if own == "," else ","
    if not body.isascii():
        body = "".join(" " if sign in SPACES else sign for sign in body)
    digits = _digits(body, own, other) if len(body) <= LONGEST else None
    if digits is None:
        raise Refused("why.not_a_number", 422, text=typed[:LONGEST])
    sign = -1 if negative else 1
    if isinstance(digits, tuple):
        raise Refused("why.ambiguous", 422, text=typed, a=sign * float(digits[0]), b=sign * float(digits[1]))
    return sign * float(digits)


def _digits(body: str, own: str, other: str) -> str | tuple[str, str] | None:
    """`body` as Python writes numbers; both readings when there are two; None when there is none."""
    d, o = re.escape(own), re.escape(other)
    if re.fullmatch(rf"[0-9]+(?:{d}[0-9]+)?|{d}[0-9]+", body):
        return body.replace(own, ".")
    if re.fullmatch(rf"[0-9]*{o}[0-9]{{3}}", body):
        return (body.replace(other, ""), body.replace(other, "."))
    if re.fullmatch(rf"[0-9]*{o}[0-9]+", body):
        return body.replace(other, ".")
    for group in (" ", o):
        if re.fullmatch(rf"[0-9]{{1,3}}(?:{group}[0-9]{{3}})+(?:{d}[0-9]+)?", body):
            return body.replace(" ", "").replace(other, "").replace(own, ".")
    return None
