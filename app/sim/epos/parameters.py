"""The parameters that the virtual axis works with, and what a plant file may set of them."""

from collections.abc import Mapping
from types import MappingProxyType

from app.errors import ConfigurationError
from app.plant.said import said
from app.sim.options import check_parameters

DEFAULTS: Mapping[str, tuple[float, float, float]] = MappingProxyType(
    {
        "p1082": (3000, 0, 210000),
        "p1135": (0.2, 0, 600),
        "p2000": (3000, 6, 210000),
        "p2040": (1000, 0, 1999999),
        "p2506": (10000, 1, 2147483647),
        "p2534": (100, 0, 100),
        "p2538": (1, 0, 300),
        "p2544": (40, 0, 2147483647),
        "p2546": (5000, 0, 2147483647),
        "p2571": (20000, 1, 40000000),
        "p2572": (1000, 1, 2000000),
        "p2573": (1000, 1, 2000000),
        "p2580": (0, -2147482648, 2147482647),
        "p2581": (800000, -2147482648, 2147482647),
        "p2585": (-300, -40000000, 40000000),
        "p2586": (300, -40000000, 40000000),
        "p2587": (1000, 0, 2147482647),
        "p2588": (1000, 0, 2147482647),
        "p2599": (0, -2147482648, 2147482647),
    }
)
"""Code → value as commissioned, least, greatest. p2585, p2586 and p2599 by the reference, defaults of p2585 to p2588 too; every
other number, range and default is unconfirmed. Lengths [LU], velocities [1000 LU/min], accelerations [1000 LU/s²], p1082 and p2000 [rpm],
p1135 [s], p2040 [ms], p2538 [1000/min]."""


def commissioned(given: Mapping[str, float]) -> dict[str, float]:
    """The parameters of an axis, with the values `given` by code.

    Raises:
        ConfigurationError: an unknown code, or a value out of its range.
    """
    values = {code: default for code, (default, _, _) in DEFAULTS.items()}
    check_parameters(given, {code: limit[1:] for code, limit in DEFAULTS.items()})
    values |= given
    if not values["p2580"] < values["p2581"]:
        raise ConfigurationError(
            said(
                "mistake.takes_below",
                what=said("mistake.parameter", code="p2580"),
                high=f"p2581 = {values['p2581']:.10g}",
                value=f"{values['p2580']:.10g}",
            )
        )
    return values
