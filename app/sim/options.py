"""What a plant file says of one machine, as the factories of virtual devices read it."""

from collections.abc import Mapping

from app.errors import ConfigurationError
from app.plant.definitions import Equipment


def table(item: Equipment, key: str) -> dict[str, object]:
    table = item.options.get(key, {})
    if not isinstance(table, Mapping):
        raise ConfigurationError(f'{key} = {table!r}: expected a table such as {{ start = "forward" }}')
    return dict(table)


def number(key: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ConfigurationError(f"{key} = {value!r}: expected a number")
    return float(value)
