"""How a language counts and what it calls the days, of the CLDR as Babel has it."""

from functools import lru_cache
from typing import NamedTuple

from babel import Locale, UnknownLocaleError, localedata
from babel.plural import PluralRule


class Conventions(NamedTuple):
    """What is used of a language."""

    plural: PluralRule
    """Number → `one`, `few`, `many`, `other`."""
    days: tuple[str, ...]
    """Short names from Monday on: `Mo`, `pon`."""


@lru_cache(maxsize=64)
def conventions(lang: str) -> Conventions:
    """What the CLDR says of `lang`, as `de` or `pt-BR`; in one that it does not know all numbers are alike, and days have English names."""
    try:
        locale = Locale.parse(lang, sep="-")
        days = locale.days["format"]["abbreviated"]
        return Conventions(locale.plural_form, tuple(str(days[day]).rstrip(".") for day in range(7)))
    except (ValueError, UnknownLocaleError):
        return Conventions(PluralRule({}), conventions("en").days)
    finally:
        localedata._cache.clear()  # Babel keeps all that it knows of a language for good, 2 MB each, and offers no way to give it back
