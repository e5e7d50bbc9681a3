"""Diverting gates: products whose head comes to an open gate turn off into its lane, and leave the line there piece by piece.

What has turned off is on the line no more: the right end of the record stays at the gate, `length` is what still lies before it and `away`
what is in the lane. So it makes no edges behind the gate, and nobody runs into it there; when nothing of it is on the line any more it has
left it (`DIVERTED`). Backwards it comes out again. Which way a product goes is decided once, when its head comes to the gate. While that is
at neither end nobody knows: it is taken to go straight on, uncertain. A lost one is not diverted. A product that a sensor sees has passed
the gates before that sensor.
"""

from app.blocks.product_tracking.product import Code, GatePosition, Product
from app.blocks.product_tracking.table import LOST, ProductTable, call_uncertain

_BACK = 0.2
"""What has gone back so far before a gate has not come to it [mm]: what trembles there, or is corrected, is asked once."""


def divert(table: ProductTable) -> None:
    """Heads that have come to a gate since the last scan go where it stands, and what has gone into a lane whole leaves the table."""
    if not table.gates:
        return
    for product in list(table.products):
        if product.lane:
            _follow_lane(table, product)
            continue
        right = product.right
        for n, x in enumerate(table.line.gates):
            bit = 1 << n
            if right <= x - _BACK and product.moving < 0:
                product.gates &= ~bit
            elif right > x and not product.gates & bit:
                product.gates |= bit
                if product.state is LOST:
                    continue
                if table.gates[n] is GatePosition.BETWEEN:
                    call_uncertain(product)
                elif table.gates[n] is GatePosition.LANE:
                    product.lane = n + 1
                    _follow_lane(table, product)
                    break


def stay_in_lanes(table: ProductTable) -> None:
    """After corrections."""
    if table.gates:
        for product in table.products:
            if product.lane:
                _keep_in_lane(product, table.line.gates[product.lane - 1])


def _follow_lane(table: ProductTable, product: Product) -> None:
    """The way that it moved, into the lane or out of it; with nothing of it left on the line it is gone."""
    n = product.lane - 1
    _keep_in_lane(product, table.line.gates[n])
    if product.lane and product.length <= 0.0 and product.open_at < 0:
        table.diverted[n] += 1
        table.tell(Code.DIVERTED, n + 1, product.id, 0, product.age(table.now))
        table.remove(product)


def _keep_in_lane(product: Product, x: float) -> None:
    """Its right end is at the gate at `x` [mm], whatever it was moved or corrected by, unless it has come out of the lane again."""
    whole, away = product.whole, product.away + product.right - x
    if away <= 0.0:
        product.shifted += product.away
        product.away, product.right, product.length = 0.0, x + away, whole
        if away <= -_BACK and product.moving < 0:
            product.lane = 0
        return
    product.shifted -= product.right - x
    product.right, product.length, product.away = x, max(0.0, whole - away), min(away, whole)
