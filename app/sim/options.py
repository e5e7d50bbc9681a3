"""What a plant file says of one machine, as the factories of virtual devices read it."""

from collections.abc import Mapping

from app.errors import ConfigurationError
from app.plant.definitions import Equipment
from app.plant.said import any_of, not_as, said


def table(item: Equipment, key: str) -> dict[str, object]:
    table = item.options.get(key, {})
    if not isinstance(table, Mapping):
        raise ConfigurationError(_expected(key, table, said("mistake.table_such", example='{ start = "forward" }')))
    return dict(table)


def check_parameters(given: Mapping[str, float], limits: Mapping[str, tuple[float, float]]) -> None:
    """Refuse parameters by code, other than those with `limits` (lowest, highest) and within them.

    Raises:
        ConfigurationError: an unknown code, or a value out of its range.
    """
    for code, value in given.items():
        what = said("mistake.parameter", code=code)
        if code not in limits:
            raise ConfigurationError(not_as(what, any_of(limits)))
        low, high = limits[code]
        if not low <= value <= high:
            raise ConfigurationError(
                said("mistake.takes", what=what, low=f"{low:.10g}", high=f"{high:.10g}", value=f"{value:.10g}")
            )


def number(key: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ConfigurationError(_expected(key, value, said("mistake.number")))
    return float(value)


def _expected(key: str, value: object, expected: str) -> str:
    return not_as(f"{key} = {value!r}", expected)
