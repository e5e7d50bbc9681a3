"""What should have been seen and was not: missed products, beams that stay interrupted, and the sensors that are suspected for it."""

from bisect import bisect_left, bisect_right

from app.blocks.product_tracking.movement import separate
from app.blocks.product_tracking.product import BLIND, STUCK, Code, Product
from app.blocks.product_tracking.table import ENTERING, LOST, TRACKED, UNCERTAIN, ProductTable, Sensor, call_uncertain


def look_for_missed(table: ProductTable) -> None:
    """Ends that are past a sensor by the way after which a product is lost."""
    sensors, after = table.line.sensors, table.settings.lost_after
    for product in table.products:
        right = product.right
        left = right - product.length
        if product.moving > 0:
            missed = ((1 << bisect_left(sensors, right - after)) - 1) & ~product.passed_right
            gone = ((1 << bisect_left(sensors, left - after)) - 1) & ~product.passed_left
            if missed:
                product.passed_right |= missed
                _miss(table, product, missed)
            if gone:
                product.passed_left |= gone
        elif product.moving < 0:
            missed = product.passed_left & ~((1 << bisect_right(sensors, left + after)) - 1)
            gone = product.passed_right & ~((1 << bisect_right(sensors, right + after)) - 1)
            if missed:
                product.passed_left &= ~missed
                _miss(table, product, missed)
            if gone:
                product.passed_right &= ~gone


def look_for_stuck(table: ProductTable, beams: tuple[bool, ...]) -> None:
    """Beams that are interrupted for more than the longest product."""
    limit = table.settings.longest + table.settings.lost_after
    for sensor in table.sensors:
        if not beams[sensor.n] or sensor.stuck or abs(table.travel(sensor) - sensor.risen) <= limit:
            continue
        sensor.stuck = True
        suspect(table, sensor, STUCK)
        sensor.held = None
        for product in table.products:
            if product.open_at == sensor.n:
                _give_up_length(table, product, sensor.n)


def suspect(table: ProductTable, sensor: Sensor, of: int) -> None:
    """Of being `BLIND` or `STUCK`."""
    if not table.sensor_faults & 1 << sensor.n:
        table.sensor_faults |= 1 << sensor.n
        table.tell(Code.SENSOR_SUSPECTED, sensor.n + 1, 0, 0, float(of))


def note_working(table: ProductTable, sensor: Sensor) -> None:
    """An edge of it fits: it is not suspected any more."""
    sensor.misses = 0
    if sensor.n + 1 < len(table.sensors):
        table.sensors[sensor.n + 1].strangers = 0
    if table.sensor_faults & 1 << sensor.n and not sensor.stuck:
        table.sensor_faults &= ~(1 << sensor.n)
        table.tell(Code.SENSOR_OK, sensor.n + 1)


def note_seen(table: ProductTable, product: Product, sensor: Sensor) -> None:
    """It is not lost any more; the sensors that missed it are suspected."""
    sensor.strangers = 0
    note_working(table, sensor)
    elsewhere = product.missed & ~(1 << sensor.n)
    if product.state is LOST:
        for other in table.sensors:
            if elsewhere & 1 << other.n:
                suspect(table, other, BLIND)
        arriving = product.open_at == 0 and not product.open_right
        product.state = ENTERING if arriving else TRACKED
    product.missed = product.lost_at = 0


def _miss(table: ProductTable, product: Product, bits: int) -> None:
    beams = table.beams or ()
    for sensor in table.sensors:
        bit = 1 << sensor.n
        if not bits & bit:
            continue
        if beams[sensor.n] or table.sensor_faults & bit:
            call_uncertain(product)
            if sensor.held and sensor.held.product is not product:
                sensor.held = None
            continue
        product.missed |= bit
        product.lost_at = sensor.n + 1
        if product.state is LOST:
            continue
        product.state = LOST
        table.lost += 1
        table.tell(Code.LOST, sensor.n + 1, product.id, 0, product.head)
        sensor.misses += 1
        if sensor.misses > 1:
            suspect(table, sensor, BLIND)


def _give_up_length(table: ProductTable, product: Product, n: int) -> None:
    """Its trailing end will not be seen: it has the greatest length that may be, to be measured at the next sensor."""
    length = table.settings.longest
    if product.open_right:
        right = product.left + length
        product.shifted += right - product.right
        product.right = right
    table.tell(Code.LENGTH_DIFFERS, n + 1, product.id, 0, product.length - length, product.length)
    product.length, product.length_known, product.measured, product.open_at = length, False, False, -1
    if product.state is not LOST:
        product.state = UNCERTAIN
    table.set_passed(product)
    separate(table, None)
