"""Products that leave the line: unloaded at the end, over it, or backwards out of the beginning."""

from app.blocks.product_tracking.product import Code, Product
from app.blocks.product_tracking.table import LOST, NEVER, UNLOADING, ProductTable

_STANDS = 0.05
"""A belt with less distance to stop stands [mm]."""


def leave(table: ProductTable) -> None:
    """Products past either end of the line."""
    end = table.line.length
    products = table.products
    while products and products[0].left >= end:
        product = products[0]
        if product.state is LOST:
            table.forget_beams(products.pop(0))
        else:
            _unloaded(table, product)
    while products and products[-1].right <= 0.0:
        product = products[-1]
        if product.state is LOST:
            table.forget_beams(products.pop())
        else:
            table.left += 1
            table.tell(Code.LEFT_BACKWARDS, 0, product.id, 0, product.age(table.now))
            table.remove(product)


def unload(table: ProductTable, moved: float, stop: float) -> None:
    """Brake the last belt for the front-most product, and let it go when it has stood for the dwell time. `moved` of the last belt
    in this scan, `stop` its distance to stop [mm, signed]."""
    product = next((product for product in table.products if product.may_be_there and not product.lane), None)
    if table.brake and (product is None or product.id != table.braking):
        table.end_unloading()
    if product is None:
        return
    remaining = table.line.length - product.right
    stands = moved == 0.0 and abs(stop) < _STANDS
    if not table.brake:
        due = remaining <= 0.0 if stands else moved >= 0.0 and stop >= 0.0 and remaining <= stop + moved
        if not due or product.right <= _last_part(table):
            return
        table.brake, table.braking = True, product.id
        table.stands_since = NEVER
    elif moved < 0.0 or (stands and remaining > table.settings.sensor_tolerance):
        table.end_unloading()
        return
    if product.state is LOST:
        table.stands_since = NEVER
        return
    if product.state is not UNLOADING:
        product.settled, product.state = product.state, UNLOADING
        table.changed = True
    if not stands:
        table.stands_since = NEVER
        return
    if table.stands_since == NEVER:
        table.stands_since = table.now
    if table.now - table.stands_since >= table.settings.unload_dwell * 1e6:
        _unloaded(table, product)


def _unloaded(table: ProductTable, product: Product) -> None:
    table.unloaded += 1
    table.tell(Code.UNLOADED, 0, product.id, 0, product.age(table.now), product.head)
    table.remove(product)


def _last_part(table: ProductTable) -> float:
    """Where the last belt or the last area begins [mm], what comes first."""
    belts, areas = table.line.belt_ends, table.line.area_ends
    return min(belts[-2] if len(belts) > 1 else 0.0, areas[-2] if len(areas) > 1 else 0.0)
