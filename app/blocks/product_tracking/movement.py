"""Movement of tracked products: with the belts under them, apart from each other, and growing while a beam holds their unknown end."""

from itertools import pairwise

from app.blocks.product_tracking.product import Code, Product, share
from app.blocks.product_tracking.table import ENTERING, LOST, TO_AND_FRO, TOUCH, UNCERTAIN, ProductTable, call_uncertain


def move(table: ProductTable, moved: tuple[float, ...]) -> None:
    """All products with their belts; what turned round is told once, what ran into another is held apart.

    How much of a product is still behind the beam that holds its end nobody knows: as much as the shortest product is long is taken.
    """
    first = moved[0]
    uniform = True
    for belt, way in enumerate(moved):
        if way:
            table.odometers[belt] += way
            table.ways[belt] = 1 if way > 0 else -1
        if way != first:
            uniform = False
    if not uniform:
        table.compare_belts()
    ends, unseen = table.line.belt_ends, table.settings.shortest
    end, now = ends[-1], table.now
    ahead = float("inf")
    contact = False
    turned: list[Product] = []
    for product in table.products:
        right = product.right
        left = right - product.length
        if uniform and right > 0.0 and left < end:
            delta = first
        elif product.open_at < 0:
            delta = share(left, right, ends, moved)
        elif product.open_right:
            delta = share(left, right + unseen, ends, moved)
        else:
            delta = share(left - unseen, right, ends, moved)
        if delta:
            product.displacement += delta
            product.moved_us = now
            if product.open_at < 0:
                product.right = right = right + delta
            else:
                _grow(table, product, delta)
                right = product.right
            product.moving = 1 if delta > 0 else -1
            if (delta < 0) is not product.swapped:
                product.back += abs(delta)
                if product.back > TO_AND_FRO:
                    product.swapped = not product.swapped
                    product.back = 0.0
                    turned.append(product)
            elif product.back:
                product.back = 0.0
        if right > ahead:
            contact = True
        ahead = right - product.length
        if product.coming:
            # its left end stays at the gate
            ahead -= delta
    if turned:
        head = turned[0]
        table.tell(Code.REVERSED, int(head.swapped), head.id, 0, float(len(turned)), head.head)
    if contact:
        separate(table, None)


def shift(product: Product, by: float) -> None:
    """Another position; the end that a beam holds stays."""
    if product.open_at >= 0 and product.open_right:
        product.length = max(0.0, product.length - by)
        return
    if product.open_at >= 0:
        by = max(by, -product.length)
        product.length += by
    product.right += by
    product.shifted += by


def separate(table: ProductTable, fixed: Product | None) -> None:
    """No two products overlap: hold back what ran in, else push what is ahead, else cut; `fixed` was seen by a sensor and stays."""
    products = table.products
    for front, rear in list(pairwise(products)):
        if rear.right - front.left > TOUCH:
            if front.open_at >= 0 and not front.open_right and rear.open_at < 0:
                _end_of_open(table, front, rear.right)
            elif rear.open_at >= 0 and rear.open_right and front.open_at < 0:
                _end_of_open(table, rear, front.left)
    for front, rear in pairwise(products):
        over = rear.right - front.left
        if over <= TOUCH or rear is fixed or front.state is LOST:
            continue
        if front.moving < 0 and rear.moving <= 0 and front is not fixed:
            continue
        if rear.open_at < 0 or not rear.open_right:
            shift(rear, -over)
            call_uncertain(rear)
    for rear, front in pairwise(reversed(products)):
        over = rear.right - front.left
        if over > TOUCH and front is not fixed and front.open_at < 0:
            shift(front, over)
            call_uncertain(front)
    for front, rear in pairwise(products):
        over = rear.right - front.left
        if over > 0.0:
            rear.right -= over
            rear.shifted -= over
            if over > TOUCH:
                rear.length = max(0.0, rear.length - over)
                call_uncertain(rear)


def _grow(table: ProductTable, product: Product, delta: float) -> None:
    """One end is held by the beam, the other moves; at no length the side turns with the movement."""
    right, length = product.right, product.length
    if product.open_right:
        length -= delta
    else:
        length += delta
        right += delta
    if length < 0.0:
        product.open_right = not product.open_right
        length, right = 0.0, table.line.sensors[product.open_at]
    product.shifted += right - product.right - delta
    product.right, product.length = right, length
    if length > product.furthest:
        product.furthest = length


def _end_of_open(table: ProductTable, product: Product, end: float) -> None:
    """A known product is where the unknown end was thought to be: there it ends, whatever the beam says (it may be stuck)."""
    n = product.open_at
    if product.open_right:
        left = product.left
        product.shifted += end - product.right
        product.right, product.length = end, max(0.0, end - left)
    else:
        product.length = max(0.0, product.right - end)
    if product.whole < table.settings.shortest:
        table.withdraw(product, n)
        return
    product.open_at, product.length_known, product.measured = -1, False, False
    call_uncertain(product)
    if product.state is ENTERING:
        product.state = UNCERTAIN
    table.set_passed(product)
    table.tell(Code.IDENTIFIED, n + 1, product.id, 0, product.length, product.head)
