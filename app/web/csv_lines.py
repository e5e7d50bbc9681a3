"""Lines of a CSV file that a page hands out: in the separators of a language, and no text of it is a formula to a spreadsheet."""

import csv
import io
import re
from collections.abc import Iterable
from typing import Any

from fastapi import Request

from app.errors import Refused
from app.historian.export import FORMATS, defused

NUMBER = re.compile(r"-?(?:0|[1-9][0-9]{0,14})(?:\.[0-9]{1,15})?")
"""As Python writes one."""


def number_in(text: str) -> str | int | float:
    """The number that was kept as `text`, so that a cell of it has the reader's decimal sign: 30.5 is a date elsewhere. Else the text."""
    if not NUMBER.fullmatch(text):
        return text
    number = float(text) if "." in text else int(text)
    return text if "e" in str(number) else number


def locale_of(request: Request) -> str:
    """In whose separators a file is asked for (`locale`): hr, en, de, cs; else, and for programs, those of `machine`.

    Raises:
        Refused: 422, it is none of these.
    """
    locale = request.query_params.get("locale", "") or "machine"
    if locale not in FORMATS:
        raise Refused("history.locale", 422, value=locale[:40], expected=", ".join(FORMATS))
    return locale


def cells(values: Iterable[Any], locale: str = "machine") -> bytes:
    """One line; numbers have the decimal sign of `locale`."""
    separator, decimal = FORMATS[locale]
    out = io.StringIO()
    csv.writer(out, delimiter=separator, lineterminator="\r\n").writerow([_cell(one, decimal) for one in values])
    return out.getvalue().encode()


def _cell(value: Any, decimal: str) -> Any:
    if isinstance(value, float):
        return str(value).replace(".", decimal)
    return defused(value) if isinstance(value, str) else value
