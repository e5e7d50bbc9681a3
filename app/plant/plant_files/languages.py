"""Languages of the product and of a plant, its labels in them, and its time zone."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from zoneinfo import ZoneInfo, available_timezones

from app.plant.said import said
from app.plant.tables import Table, near_to, one_of, read_label

LOCALE = Path(__file__).resolve().parents[2] / "locale"
LANGUAGES = ("hr", "en", "de", "cs")


def languages() -> tuple[str, ...]:
    """Languages the product speaks: a folder of app/locale each."""
    found = [path.name for path in LOCALE.iterdir() if path.is_dir()] if LOCALE.is_dir() else []
    return tuple(dict.fromkeys((*LANGUAGES, *sorted(found))))


@dataclass(slots=True)
class PlantLanguages:
    """The languages of a plant; before its `[plant]` is read, those of the product."""

    known: Sequence[str]
    """Those of the product."""
    named: Sequence[str]
    """Those of the plant."""
    spoken: Sequence[str] = LANGUAGES
    """Languages in which a type must have its texts: those that the plant names, else the product's own."""

    def read(self, head: Table) -> None:
        """`languages` of `[plant]`."""
        given = head.items("languages", list(self.known), said("mistake.list_of_languages"))
        for index, language in enumerate(given):
            if language not in self.known:
                head.note(f"languages.{index}", language, one_of(self.known, language))
            elif language in given[:index]:
                head.note(f"languages.{index}", language, said("mistake.language_once"))
        if not given:
            head.note("languages", given, said("mistake.a_language"))
        self.named = [language for language in given if language in self.known] or self.known
        self.spoken = self.named if head.has("languages") else LANGUAGES

    def label(self, table: Table, key: str, *, required: bool = False, default: str = "") -> dict[str, str]:
        """A text for every language of the plant, or one for each."""
        return read_label(table, key, self.named, self.known, required=required, default=default)


def read_timezone(head: Table) -> str:
    """`timezone` of `[plant]`; UTC when there is no such zone."""
    name = head.text("timezone")
    if not name:
        return "UTC"
    zones = _zones()
    try:
        if name not in zones:
            raise ValueError(name)
        ZoneInfo(name)
    except (ValueError, OSError):
        head.note("timezone", name, said("mistake.time_zone", near=near_to(sorted(zones), name)))
        return "UTC"
    return name


@cache
def _zones() -> frozenset[str]:
    """Those of this machine; to look for them reads hundreds of folders."""
    return frozenset(available_timezones())
