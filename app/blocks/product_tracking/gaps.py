"""Gap supervision: whether two adjacent products would collide if the line were not stopped now."""

from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Sequence

from app.blocks.product_tracking.product import Gap, Product

SMALL_CLOSING = 0.5
"""Pairs that come nearer by less than this [mm] get a margin in proportion: equal speeds that differ by a hair do not stop a line."""
_BEHIND = 1e-6
"""What interrupts a beam is behind it, if only by this [mm]."""


def nearest(
    products: Iterable[Product],
    belt_ends: Sequence[float],
    stop_distances: Sequence[float],
    margin: float,
    shortest: float = 0.0,
) -> Gap | None:
    """The pair of adjacent products with the least reserve (gap − limit); None with fewer than two products.

    `products` front-most first, `stop_distances` of the belts [mm, signed: + forward], `margin` and `shortest` product [mm].

    The reference stops the line when (tail of the one ahead − head of the one behind) ≤ distance to stop of the belt of the rear
    product. Taken by the letter that would forbid two products nearer than that on one running belt, where they cannot meet. What
    counts is how much nearer they come until both stand, and the line stops as a whole:

        closing = distance to stop of the rear − distance to stop of the front (the same way: both signed)
        limit   = closing + margin

    With the front one at rest that is the reference's rule and the margin. With both at one speed closing is 0 and nothing stops; when
    the front one brakes, closing grows while it slows down, so the stop comes in time for both. Belts against each other add up. A
    product that lies on several belts, or gets onto another one before it stands, may go as little or as far as any of them: the worst
    of both counts. What a beam still holds reaches back behind its sensor: it lies on the belt before it, too, and is at least as long
    as the shortest product. Adjacent products on any belts are compared (decision 15); a product that two sensors missed is not.

    Source: thesis 003, spacing; reference/theses-facts.md section 3 and conflict 15.
    """
    found: Gap | None = None
    reserve = 0.0
    front: Product | None = None
    front_least = front_most = front_left = 0.0
    least = most = stop_distances[0]
    uniform = all(distance == least for distance in stop_distances)
    end = belt_ends[-1]
    for rear in products:
        if rear.missed and not rear.may_be_there:
            continue
        right = rear.right
        left = right - rear.length
        if rear.open_at >= 0:
            left, right = _known(rear, shortest)
        if not uniform or left >= end or right <= 0.0:
            least, most = _stop_range(left, right, belt_ends, stop_distances)
        # what turns off into a lane has nobody before it any more
        if front is not None and not rear.lane:
            gap = front_left - right
            closing = most - front_least
            if closing <= 0.0:
                closing = limit = 0.0
            elif closing >= SMALL_CLOSING:
                limit = closing + margin
            else:
                limit = closing + margin * closing / SMALL_CLOSING
            if found is None or gap - limit < reserve:
                reserve = gap - limit
                way = least + most + front_least + front_most
                backwards = way < 0.0 or (way == 0.0 and rear.swapped)
                first, second = (front.id, rear.id) if backwards else (rear.id, front.id)
                found = Gap(gap, closing, limit, first, second)
        # what comes in from a lane holds the place that the whole of it will take
        held = left - rear.away if rear.coming else left
        front, front_least, front_most, front_left = rear, least, most, held
        if uniform:
            least = most = stop_distances[0]
    return found


def _known(product: Product, shortest: float) -> tuple[float, float]:
    """Where a product surely is whose other end a beam still holds."""
    length = max(product.length, shortest) + _BEHIND
    return (product.left, product.left + length) if product.open_right else (product.right - length, product.right)


def _stop_range(
    left: float, right: float, belt_ends: Sequence[float], stop_distances: Sequence[float]
) -> tuple[float, float]:
    """Least and greatest distance to stop of the belts that a product lies on, or comes to before it stands."""
    last = len(belt_ends) - 1
    if left >= belt_ends[last] or right <= 0.0:
        return 0.0, 0.0
    low = min(bisect_right(belt_ends, left), last)
    if right <= belt_ends[low]:
        # the usual case: on one belt, and it stands before it comes to the next
        stop = stop_distances[low]
        begin = belt_ends[low - 1] if low else left
        if (stop >= 0.0 or left + stop >= begin) and (stop <= 0.0 or low == last or right + stop <= belt_ends[low]):
            return stop, stop
    high = min(bisect_left(belt_ends, right), last)
    least = most = stop_distances[low]
    for belt in range(low + 1, high + 1):
        least, most = min(least, stop_distances[belt]), max(most, stop_distances[belt])
    while high < last and most > 0.0 and right + most > belt_ends[high]:
        high += 1
        least, most = min(least, stop_distances[high]), max(most, stop_distances[high])
    while low > 0 and least < 0.0 and left + least < belt_ends[low - 1]:
        low -= 1
        least, most = min(least, stop_distances[low]), max(most, stop_distances[low])
    return least, most
