"""What a plant file says of one machine, as the factories of virtual devices read it."""

from collections.abc import Mapping

from app.errors import ConfigurationError
from app.plant.definitions import Equipment
from app.plant.said import not_as, said


def table(item: Equipment, key: str) -> dict[str, object]:
    table = item.options.get(key, {})
    if not isinstance(table, Mapping):
        raise ConfigurationError(_expected(key, table, said("mistake.table_such", example='{ start = "forward" }')))
    return dict(table)


def number(key: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ConfigurationError(_expected(key, value, said("mistake.number")))
    return float(value)


def _expected(key: str, value: object, expected: str) -> str:
    return not_as(f"{key} = {value!r}", expected)
