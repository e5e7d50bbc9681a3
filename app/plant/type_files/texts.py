"""texts.<lang>.toml: the words of a type in one language."""

from collections.abc import Iterator, Mapping
from typing import Any

from app.plant.said import said
from app.plant.tables import Table


def flatten(table: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, str]]:
    """Texts by dotted key; plural forms keep their category as last part (`rows.few`)."""
    for key, value in table.items():
        if isinstance(value, dict):
            yield from flatten(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", str(value)


def check_texts(file: Table) -> None:
    """Note what is no text and what a screen would draw as a list of signs; one that is blank is a doubt."""
    for path, value in _leaves(file.data):
        if isinstance(value, bool) or not isinstance(value, str | int | float):
            file.note(path, value, said("mistake.text"))
        elif not str(value).strip():
            file.doubt(path, value, said("mistake.doubt_blank"))


def _leaves(table: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in table.items():
        if isinstance(value, dict):
            yield from _leaves(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value
