"""What of tracking survives a power cycle, as plain numbers, lists and dicts."""

from collections.abc import Mapping
from dataclasses import fields
from math import inf, isfinite
from typing import Any

from app.blocks.product_tracking.product import Product, ProductState
from app.blocks.product_tracking.table import LAST_ID, ProductTable

_COUNTERS = (
    "entered",
    "unloaded",
    "lost",
    "unexpected",
    "corrections",
    "withdrawn",
    "left",
    "deleted",
    "inserted",
    "found",
    "refused",
)


def retain(table: ProductTable) -> dict[str, Any]:
    """All that must survive; JSON can hold it."""
    return {
        "next_id": table.next_id,
        "counters": {name: getattr(table, name) for name in _COUNTERS},
        "diverted": list(table.diverted),
        "merged": list(table.merged),
        "greatest_correction": table.greatest_correction,
        "sensor_faults": table.sensor_faults,
        "misses": [sensor.misses for sensor in table.sensors],
        "strangers": [sensor.strangers for sensor in table.sensors],
        "products": [_row(product) for product in table.slots if product],
    }


def take_back(table: ProductTable, retained: Mapping[str, Any]) -> None:
    """Puts what was retained in place of all that is in the table.

    Raises:
        ValueError: something is missing, or does not fit this line; says what. Nothing was changed.
    """
    try:
        products = [_product(row) for row in retained["products"]]
        counters = {name: int(retained["counters"][name]) for name in _COUNTERS}
        next_id, faults = int(retained["next_id"]), int(retained["sensor_faults"])
        greatest = float(retained["greatest_correction"])
        diverted = [int(x) for x in retained["diverted"]]
        merged = [int(x) for x in retained["merged"]]
        misses, strangers = [int(x) for x in retained["misses"]], [int(x) for x in retained["strangers"]]
    except (KeyError, TypeError) as error:
        raise ValueError(f"retained tracking data is not whole: {error}") from None
    count = len(table.sensors)
    if len(misses) != count or len(strangers) != count:
        raise ValueError(f"retained data has {len(misses)} sensors, the line {count}")
    if len(diverted) != len(table.line.gates):
        raise ValueError(f"retained data has {len(diverted)} gates, the line {len(table.line.gates)}")
    if len(merged) != len(table.line.merges):
        raise ValueError(f"retained data has {len(merged)} merging gates, the line {len(table.line.merges)}")
    slots: list[Product | None] = [None] * table.line.slots
    for product in products:
        if not 0 <= product.slot < table.line.slots or slots[product.slot]:
            raise ValueError(f"product {product.id} has slot {product.slot}, a free one of {table.line.slots} expected")
        if (
            product.lane > len(diverted)
            or product.coming > len(merged)
            or product.open_at >= count
            or not (isfinite(product.right) and 0 <= product.length < inf)
        ):
            raise ValueError(f"product {product.id} does not fit this line")
        slots[product.slot] = product
    if not 1 <= next_id <= LAST_ID or len({product.id for product in products}) != len(products):
        raise ValueError(f"next_id is {next_id} or an id is there twice")
    for name, value in counters.items():
        setattr(table, name, value)
    table.diverted, table.merged = diverted, merged
    table.next_id, table.sensor_faults, table.greatest_correction = next_id, faults, greatest
    for sensor in table.sensors:
        sensor.misses, sensor.strangers, sensor.stuck = misses[sensor.n], strangers[sensor.n], False
    table.slots = slots
    table.products = [product for product in products if not table.past_the_end(product)]
    table.put_in_order()


def _row(product: Product) -> dict[str, Any]:
    row = {field.name: getattr(product, field.name) for field in fields(Product)}
    row["state"], row["settled"] = int(product.state), int(product.settled)
    return row


def _product(row: Mapping[str, Any]) -> Product:
    return Product(**{**row, "state": ProductState(row["state"]), "settled": ProductState(row["settled"])})
