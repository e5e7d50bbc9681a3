"""Gap supervision: whether two adjacent products would collide if the line were not stopped now."""

from collections.abc import Iterable, Sequence

from .tracked import Gap, Product, share

SMALL_CLOSING = 0.5
"""Pairs that come nearer by less than this [mm] get a margin in proportion: equal speeds that differ by a hair do not stop a line."""


def nearest(
    products: Iterable[Product], belt_ends: Sequence[float], stop_distances: Sequence[float], margin: float
) -> Gap | None:
    """The pair of adjacent products with the least reserve (gap − limit); None with fewer than two products.

    `products` front-most first, `stop_distances` of the belts [mm, signed: + forward], `margin` [mm].

    The reference stops the line when (tail of the one ahead − head of the one behind) ≤ distance to stop of the belt of the rear
    product. Taken by the letter that would forbid two products nearer than that on one running belt, where they cannot meet. What
    counts is how much nearer they come until both stand, and the line stops as a whole:

        closing = distance to stop of the rear − distance to stop of the front (the same way: both signed)
        limit   = closing + margin

    With the front one at rest that is the reference's rule and the margin. With both at one speed closing is 0 and nothing stops; when
    the front one brakes, closing grows while it slows down, so the stop comes in time for both. Belts against each other add up. A
    product on two belts has the mean by its share on each. Adjacent products on any belts are compared (decision 15); a product that
    two sensors missed is not.

    Source: thesis 003, spacing; reference/theses-facts.md section 3 and conflict 15.
    """
    found: Gap | None = None
    reserve = 0.0
    front: Product | None = None
    front_stop = front_left = 0.0
    first = stop_distances[0]
    uniform = all(distance == first for distance in stop_distances)
    end = belt_ends[-1]
    for rear in products:
        if rear.missed.bit_count() > 1:
            continue
        right = rear.right
        left = right - rear.length
        stop = first if uniform and left < end and right > 0.0 else share(left, right, belt_ends, stop_distances)
        if front is not None:
            gap = front_left - right
            closing = stop - front_stop
            limit = 0.0
            if closing > 0.0:
                limit = closing + (margin if closing >= SMALL_CLOSING else margin * closing / SMALL_CLOSING)
            else:
                closing = 0.0
            if found is None or gap - limit < reserve:
                reserve = gap - limit
                way = stop + front_stop
                backwards = way < 0.0 or (way == 0.0 and rear.swapped)
                found = (
                    Gap(gap, closing, limit, front.id, rear.id)
                    if backwards
                    else Gap(gap, closing, limit, rear.id, front.id)
                )
        front, front_stop, front_left = rear, stop, left
    return found
