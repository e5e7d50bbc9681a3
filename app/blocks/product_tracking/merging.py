"""Merging gates: products that come onto the line from a lane beside it, piece by piece, the mirror of `diverting`.

A product that comes in has its left end at the gate: `length` is what is on the line already and `away` what is still in the lane. Its
record begins when the lane lets it go, with the length that the lane has measured, in its place between those on the line. Backwards it
goes into the lane again, and its record with it. Nobody is told to come in here unless there is a gap for it: `room`.
"""

from collections.abc import Iterable

from app.blocks.product_tracking.product import Code, Product, TrackingEvent
from app.blocks.product_tracking.table import TRACKED, ProductTable


def let_in(table: ProductTable, n: int, length: float, waited: float, time_us: int) -> list[TrackingEvent]:
    """The lane of gate `n` (index) lets a product go, between two scans: a record of `length` [mm] that begins at the gate, after it has
    `waited` [s]; what happened. With no free slot it is told and counted as an arrival that could not be stored.
    """
    events: list[TrackingEvent] = []
    table.events = events
    x = table.line.merges[n]
    slot = table.free_slot()
    if slot is None:
        table.refused += 1
        table.tell(Code.BUFFER_FULL, 0, 0, 0, float(table.refused))
        return events
    product = table.record(slot, x, 0.0, TRACKED, time_us)
    product.origin = product.coming = n + 1
    product.away = length
    product.passed_right = product.passed_left = sum(1 << i for i, at in enumerate(table.line.sensors) if at < x)
    table.put_in_order()
    table.merged[n] += 1
    table.tell(Code.MERGED, n + 1, product.id, 0, waited, length)
    if table.buffer_full:
        table.tell(Code.BUFFER_FULL, 0, product.id, 0, float(table.refused))
    return events


def come_in(table: ProductTable) -> None:
    """After a movement or a correction: the left end of what comes in is at its gate until the whole of it is on the line."""
    if not table.line.merges:
        return
    for product in list(table.products):
        if product.coming:
            _keep_at_gate(table, product, table.line.merges[product.coming - 1])


def room(
    products: Iterable[Product], x: float, length: float, gap: float, first_sensor: float, rate: float = 1.0
) -> bool:
    """Whether a product so long may come in at `x` now, with `gap` before and behind it [mm].

    While it comes in, what is behind it goes `rate` times as far as it does, if its belt is the faster one: so much more room it needs.
    Before the first sensor there may be somebody whom nobody knows.
    """
    behind = x - gap - length * max(1.0, rate)
    if behind < first_sensor:
        return False
    for product in products:
        if not product.may_be_there:
            continue
        if product.right > behind and product.right - product.whole < x + gap:
            return False
    return True


def _keep_at_gate(table: ProductTable, product: Product, x: float) -> None:
    whole, on_line = product.whole, product.right - x
    if on_line < 0.0 or (on_line == 0.0 and product.moving < 0):
        table.withdrawn += 1
        table.tell(Code.WITHDRAWN, 0, product.id, 0, product.furthest)
        table.remove(product)
        return
    product.furthest = max(product.furthest, min(on_line, whole))
    if on_line >= whole:
        product.coming, product.away, product.length = 0, 0.0, whole
        return
    product.length, product.away = on_line, whole - on_line
