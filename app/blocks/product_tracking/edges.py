"""Edges of the light barriers: whose they are, and what they say of identity, position and length."""

from app.blocks.product_tracking.absence import note_seen, note_working, suspect
from app.blocks.product_tracking.movement import separate, shift
from app.blocks.product_tracking.product import BLIND, Code, Product
from app.blocks.product_tracking.table import (
    ENTERING,
    LOST,
    OUTSIDE,
    RECENT_US,
    TOUCH,
    TRACKED,
    UNCERTAIN,
    Cut,
    Held,
    ProductTable,
    Sensor,
    call_uncertain,
    note_passed,
    set_state,
)


def rising(table: ProductTable, sensor: Sensor) -> None:
    """The beam is interrupted: by the product that is expected next, by one that is known to be there, or by one that nobody knows."""
    table.begin(sensor)
    n, x = sensor.n, sensor.x
    near = max(table.settings.sensor_tolerance, table.settings.lost_after)
    best = over = None
    best_by = 0.0
    for product in table.products:
        way = product.moving or 1
        by = x - (product.right if way > 0 else product.left)
        if product.lane and x > product.right:
            continue
        if (
            _is_expected(product, n, way)
            and product.open_at != n
            and abs(by) <= near
            and (best is None or abs(by) < abs(best_by))
        ):
            best, best_by = product, by
        if way > 0:
            if product.left + TOUCH < x <= product.right + TOUCH:
                over = product
        elif product.left - TOUCH <= x < product.right - TOUCH:
            over = product
    if best:
        _expected_edge(table, best, sensor, best_by)
    elif over:
        _edge_inside(table, over, sensor)
    else:
        _stranger(table, sensor)


def falling(table: ProductTable, sensor: Sensor) -> None:
    """The beam is free again."""
    stuck = sensor.stuck
    if stuck:
        sensor.stuck = False
        note_working(table, sensor)
    opened = next((product for product in table.products if product.open_at == sensor.n), None)
    if opened:
        _close(table, opened, sensor)
        return
    held, sensor.held = sensor.held, None
    if held:
        _trailing_edge(table, sensor, held)
        return
    for product in table.products:
        end = -(product.moving or 1)
        by = sensor.x - (product.right if end > 0 else product.left)
        if abs(by) <= table.settings.sensor_tolerance and table.now - product.moved_us <= RECENT_US:
            doubtful = not product.measured and product.state is UNCERTAIN
            _correct(table, product, sensor, by, Code.TAIL_AT_SENSOR, end)
            if doubtful:
                # its head was not seen here, and its length may be wrong
                call_uncertain(product)
            return
    if not stuck:
        _part(table, sensor)


def look_for_short(table: ProductTable, beams: tuple[bool, ...]) -> None:
    """A beam has been free for the shortest product's way although a product should be in it: that one is shorter."""
    for n in sorted(table.cuts):
        cut = table.cuts[n]
        if not beams[n] and abs(table.travel(table.sensors[n]) - cut.travel) >= table.settings.shortest:
            del table.cuts[n]
            _shorten(table, cut.held.product, n, cut.measured)


# the beam is interrupted


def _expected_edge(table: ProductTable, product: Product, sensor: Sensor, by: float) -> None:
    if table.now - product.moved_us > RECENT_US:
        table.unexpected += 1
        table.tell(Code.UNEXPECTED, sensor.n + 1, product.id, 0, by)
    elif abs(by) <= table.settings.sensor_tolerance:
        _correct(table, product, sensor, by, Code.HEAD_AT_SENSOR, product.moving or 1)
    else:
        _find(table, product, sensor, by)


def _edge_inside(table: ProductTable, product: Product, sensor: Sensor) -> None:
    """The record of a product is over the sensor, and its head was here before."""
    by = sensor.x - (product.right if (product.moving or 1) > 0 else product.left)
    if product.state is LOST and product.lost_at == sensor.n + 1:
        _find(table, product, sensor, by)
        return
    cut = table.cuts.pop(sensor.n, None)
    if cut and cut.held.product is product:
        sensor.held = cut.held
    elif product.open_at >= 0 or not product.length_known:
        # how far it reaches is a guess, the sensor that saw it may be stuck: it, or another one behind it
        table.unexpected += 1
        table.tell(Code.UNEXPECTED, sensor.n + 1, product.id, 0, by)
        call_uncertain(product)


def _find(table: ProductTable, product: Product, sensor: Sensor, by: float) -> None:
    """The edge was not where it was expected, and there is room for no other product: take its position from the sensor, uncertain."""
    way = product.moving or 1
    table.unexpected += 1
    table.tell(Code.UNEXPECTED, sensor.n + 1, product.id, 0, by)
    note_seen(table, product, sensor)
    note_passed(product, sensor.n, way)
    sensor.held = Held(product, way, product.displacement, False)
    _place_at(table, product, sensor, by)
    set_state(product, UNCERTAIN)


def _correct(table: ProductTable, product: Product, sensor: Sensor, by: float, code: Code, end: int) -> None:
    """Sets an end (1 right, −1 left) of a product to the sensor."""
    number = sensor.n + 1
    note_seen(table, product, sensor)
    if code is Code.HEAD_AT_SENSOR:
        sensor.held = Held(product, end, product.displacement)
    note_passed(product, sensor.n, product.moving or 1, end)
    _place_at(table, product, sensor, by)
    table.corrections += 1
    table.tell(code, number, product.id, 0, by, product.head)
    if abs(by) > table.settings.alarm_tolerance:
        table.tell(Code.OUTSIDE_TOLERANCE, number, product.id, 0, by)
        set_state(product, OUTSIDE)
    elif (
        code is Code.HEAD_AT_SENSOR or (product.settled if product.state is ENTERING else product.state) is not OUTSIDE
    ):
        set_state(product, TRACKED)


def _place_at(table: ProductTable, product: Product, sensor: Sensor, by: float) -> None:
    product.corrected_at, product.correction = sensor.n + 1, by
    table.pass_gates(product, sensor.x)
    table.greatest_correction = max(table.greatest_correction, abs(by))
    shift(product, by)
    separate(table, product)


def _stranger(table: ProductTable, sensor: Sensor) -> None:
    """An edge that no record explains: an arrival at S1, elsewhere (or backwards) an unexpected product."""
    n, x = sensor.n, sensor.x
    way = table.way_at(sensor)
    arrival = n == 0 and way > 0
    slot = table.free_slot()
    if slot is None:
        if not arrival:
            table.unexpected += 1
            table.tell(Code.UNEXPECTED, n + 1)
        _refuse(table, n)
        return
    product = table.record(slot, x, 0.0, ENTERING if arrival else UNCERTAIN, table.now)
    product.open_at, product.open_right = n, way < 0
    product.swapped = way < 0
    product.moving = way
    product.passed_left = (1 << n) - 1
    product.passed_right = (1 << n + 1) - 1
    table.put_in_order()
    if arrival:
        table.entered += 1
        table.tell(Code.ARRIVED, 1, product.id, 0, x)
        note_working(table, sensor)
    else:
        product.settled = UNCERTAIN
        table.found += 1
        table.unexpected += 1
        table.tell(Code.UNEXPECTED, n + 1, product.id, 0, x)
        sensor.strangers += 1
        before = n - way
        if sensor.strangers > 1 and 0 <= before < len(table.sensors):
            suspect(table, table.sensors[before], BLIND)
    _tell_when_full(table, n, product)


def _refuse(table: ProductTable, n: int) -> None:
    table.refused += 1
    table.tell(Code.BUFFER_FULL, n + 1, 0, 0, float(table.refused))


def _tell_when_full(table: ProductTable, n: int, product: Product) -> None:
    if table.buffer_full:
        table.tell(Code.BUFFER_FULL, n + 1, product.id, 0, float(table.refused))


# the beam is free


def _close(table: ProductTable, product: Product, sensor: Sensor) -> None:
    """The unknown end has passed it, or what came has gone back. Where the belts beside the sensor went different ways meanwhile, the
    length is a guess: it is measured anew at the next sensor, and nothing that may have been long enough is withdrawn."""
    limits, n = table.settings, sensor.n
    back = product.moving == (1 if product.open_right else -1)
    apart = table.apart(sensor)
    guessed = apart > limits.alarm_tolerance
    length = product.whole
    lacks = limits.shortest - length
    if guessed and not back and lacks > 0.0 and limits.shortest <= abs(table.travel(sensor) - sensor.risen) + apart / 2:
        shift(product, -lacks if product.open_right else lacks)
        separate(table, None)
    length = product.whole
    if length < limits.shortest or (back and length <= limits.lost_after):
        table.withdraw(product, n)
        return
    product.open_at = -1
    if product.state is ENTERING:
        product.state = UNCERTAIN if back else product.settled
    product.measured = not back and length <= limits.longest
    note_passed(product, n, product.moving or 1, 1 if product.open_right else -1)
    table.tell(Code.IDENTIFIED, n + 1, product.id, 0, length, product.head)
    if length > limits.longest:
        table.tell(Code.LENGTH_DIFFERS, n + 1, product.id, 0, length - limits.longest, length)
        call_uncertain(product)
    if guessed:
        product.length_known = product.measured = False
        call_uncertain(product)


def _trailing_edge(table: ProductTable, sensor: Sensor, held: Held) -> None:
    """The beam is free of the product that interrupted it."""
    product, limits, n = held.product, table.settings, sensor.n
    end = -(product.moving or 1)
    by = sensor.x - (product.right if end > 0 else product.left)
    if table.now - product.moved_us > RECENT_US:
        return
    whole = end != held.risen
    measured = abs(product.displacement - held.since)
    near = abs(by) <= max(limits.sensor_tolerance, limits.lost_after)
    if whole and not product.length_known and limits.shortest <= measured <= limits.longest:
        _take_length(table, product, sensor, measured, end)
    elif near or (whole and not held.sure and measured >= limits.shortest):
        _correct(table, product, sensor, by, Code.TAIL_AT_SENSOR, end)
        if whole and abs(measured - product.whole) > limits.alarm_tolerance:
            table.tell(Code.LENGTH_DIFFERS, n + 1, product.id, 0, measured - product.whole, measured)
        elif whole and held.sure and product.length_known:
            product.measured = True
        if not near:
            set_state(product, UNCERTAIN)
    elif not whole or measured < limits.shortest:
        return
    elif by * end < 0:
        # the end is not at the sensor yet: shorter than tracked, or a hole in it; the way that the beam stays free will tell
        table.cuts[n] = Cut(held, measured, table.travel(sensor))
    elif not _part(table, sensor) and measured <= limits.longest and not _covered(table, sensor.x, product):
        _take_length(table, product, sensor, measured, end)


def _part(table: ProductTable, sensor: Sensor) -> bool:
    """The beam stayed interrupted behind the last product that it knows, for at least the shortest product's way: another one
    touches it there, and gets a record. True when it was so."""
    limits, n, x = table.settings, sensor.n, sensor.x
    last: Product | None = None
    behind = 0.0
    for product in table.products:
        way = product.moving or 1
        past = ((product.left if way > 0 else product.right) - x) * way
        if past > 0.0 and (last is None or past < behind):
            last, behind = product, past
        elif product.left < x < product.right:
            return False
    if last is None or last.state is LOST or not last.measured or table.now - last.moved_us > RECENT_US:
        return False
    interrupted = abs(table.travel(sensor) - sensor.risen)
    if not limits.shortest <= behind <= limits.longest or interrupted < behind + limits.sensor_tolerance:
        return False
    way = last.moving or 1
    table.tell(Code.LENGTH_DIFFERS, n + 1, last.id, 0, behind, last.length + behind)
    call_uncertain(last)
    table.unexpected += 1
    slot = table.free_slot()
    if slot is None:
        table.tell(Code.UNEXPECTED, n + 1)
        _refuse(table, n)
        return True
    product = table.record(slot, x + behind if way > 0 else x, behind, UNCERTAIN, table.now)
    product.settled = UNCERTAIN
    product.swapped, product.moving = last.swapped, way
    table.set_passed(product)
    note_passed(product, n, way, -way)
    table.put_in_order()
    table.found += 1
    table.tell(Code.UNEXPECTED, n + 1, product.id, last.id, product.head, behind)
    _tell_when_full(table, n, product)
    return True


def _take_length(table: ProductTable, product: Product, sensor: Sensor, measured: float, end: int) -> None:
    """The trailing end (1 right, −1 left) is at the sensor, the length is what was measured there."""
    n = sensor.n
    table.tell(Code.LENGTH_DIFFERS, n + 1, product.id, 0, measured - product.whole, measured)
    product.away = 0.0
    right = sensor.x if end > 0 else sensor.x + measured
    product.shifted += right - product.right
    product.right, product.length, product.length_known, product.measured = right, measured, True, False
    product.corrected_at = n + 1
    note_passed(product, n, product.moving or 1, end)
    set_state(product, UNCERTAIN)
    separate(table, product)


def _shorten(table: ProductTable, product: Product, n: int, length: float) -> None:
    """Its leading end is right; what was behind the measured length is not there."""
    table.tell(Code.LENGTH_DIFFERS, n + 1, product.id, 0, length - product.whole, length)
    set_state(product, UNCERTAIN)
    if length >= product.whole:
        return
    length = max(0.0, length - product.away)
    if (product.moving or 1) < 0:
        right = product.left + length
        product.shifted += right - product.right
        product.right = right
    product.length, product.measured = length, False
    table.set_passed(product)


def _is_expected(product: Product, n: int, way: int) -> bool:
    """Its leading end has not passed sensor `n` yet."""
    return not product.passed_right & 1 << n if way > 0 else bool(product.passed_left & 1 << n)


def _covered(table: ProductTable, x: float, but: Product) -> bool:
    """Another product is at `x`, so what a beam says there is about that one."""
    return any(other is not but and other.left < x < other.right for other in table.products)
