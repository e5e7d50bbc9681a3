"""Interconnections (BICO): the value of a parameter that names where a bit or a value comes from.

    bits 31–16 parameter number, 15–10 drive object (63 = the same), 9–0 bit or index; 0 and 1 alone are constants

Written `r0722.0` (binector: parameter and bit), `r2050[1]` (connector: parameter and index), `1:r0722.0` of another drive object.
General knowledge (G): no source at hand confirms the layout.
"""

import re
from collections.abc import Mapping

from app.profidrive.parameter_access.parameter import DriveParameter, Kind

OWN = 63
"""Drive object: the one of the parameter itself."""
NUMBER, OBJECT, INDEX = 0xFFFF, 0x3F, 0x3FF
CONSTANTS = (0, 1)
LARGEST = 0xFFFFFFFF
_FORM = re.compile(r"(?:(\d{1,2}):)?([pr]?)(\d{1,5})(?:\.(\d{1,4})|\[(\d{1,4})\])?", re.IGNORECASE)


def is_source(kind: Kind) -> bool:
    """Whether values of this kind name a source."""
    return kind in (Kind.BINECTOR, Kind.CONNECTOR)


def number_of(value: int) -> int:
    """The parameter that `value` names; 0 = a constant."""
    return 0 if value in CONSTANTS else value >> 16 & NUMBER


def source_text(kind: Kind, value: float, codes: Mapping[int, str]) -> str:
    """`value` as people write it; `codes`: number → code of the parameters that are known."""
    if not float(value).is_integer() or not 0 <= value <= LARGEST:
        return f"{value:g}"
    word = int(value)
    if word in CONSTANTS:
        return str(word)
    number, object, index = word >> 16 & NUMBER, word >> 10 & OBJECT, word & INDEX
    name = codes.get(number, f"{number:04d}")
    place = "" if object == OWN else f"{object}:"
    return f"{place}{name}.{index}" if kind is Kind.BINECTOR else f"{place}{name}[{index}]"


def parse_source(text: str) -> int | None:
    """The value that `text` names; None when it is no source."""
    typed = text.strip()
    if typed in map(str, CONSTANTS):
        return int(typed)
    found = _FORM.fullmatch(typed)
    if found is None or not typed.isascii():
        return None
    object, letter, number, bit, index = found.groups()
    if not letter and bit is None and index is None:
        return None  # a number alone is more likely a slip
    values = int(number), OWN if object is None else int(object), int(bit or index or 0)
    if not 1 <= values[0] <= NUMBER or values[1] > OBJECT or values[2] > INDEX:
        return None
    return values[0] << 16 | values[1] << 10 | values[2]


def names_known(parameter: DriveParameter, value: float, numbers: Mapping[int, object]) -> bool:
    """Whether a source of `parameter` is a constant or a parameter among `numbers`; true of what is no source."""
    if not is_source(parameter.kind):
        return True
    number = number_of(int(value))
    return number in numbers if number else value in CONSTANTS
