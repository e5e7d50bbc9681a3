"""The table that tracking works on: records of products, what is known of every sensor, counts, and what happened in this scan."""

from bisect import bisect_left, bisect_right
from typing import NamedTuple

from app.blocks.product_tracking.product import (
    Code,
    Gap,
    GatePosition,
    LineLayout,
    Product,
    ProductState,
    Settings,
    TrackingEvent,
)

LAST_ID = (1 << 32) - 1
NEVER = -(1 << 60)
RECENT_US = 500_000
"""An edge can only come from a product that moved within this time."""
TOUCH = 1e-6
"""Overlap that is rounding [mm]."""
TO_AND_FRO = 0.2
"""So much way [mm] to and fro is the pulses of the encoders, not a movement."""

TRACKED, ENTERING, UNCERTAIN = ProductState.TRACKED, ProductState.ENTERING, ProductState.UNCERTAIN
OUTSIDE, LOST, UNLOADING = ProductState.OUTSIDE, ProductState.LOST, ProductState.UNLOADING


class Held(NamedTuple):
    """Who interrupts a beam."""

    product: Product
    risen: int
    """End that did it: 1 right, −1 left."""
    since: float
    """Its displacement then [mm]."""
    sure: bool = True
    """False: the edge came where it was not expected, the beam may have been late."""


class Cut(NamedTuple):
    """A beam that became free before the product could be through."""

    held: Held
    measured: float
    travel: float


class Sensor:
    """What is known of one light barrier."""

    __slots__ = ("apart", "before", "behind", "held", "lead", "misses", "n", "risen", "strangers", "stuck", "x")

    def __init__(self, n: int, x: float, belt_ends: tuple[float, ...]) -> None:
        self.n = n
        """Index; an operator counts from 1."""
        self.x = x
        """[mm]"""
        self.before = bisect_left(belt_ends, x)
        """Belt that carries what comes to it from the left."""
        self.behind = min(bisect_right(belt_ends, x), len(belt_ends) - 1)
        """Belt that carries what has passed it to the right; another one where the sensor is at a border."""
        self.risen = 0.0
        """Way of the belts beside it when its beam was interrupted last [mm]."""
        self.apart = 0.0
        """By so much they went differently since then, whichever was ahead [mm]."""
        self.lead = 0.0
        """By so much the one before has gone further than the one behind, as far as it is in `apart` [mm]."""
        self.held: Held | None = None
        self.misses = 0
        """Products in a row that were lost here."""
        self.strangers = 0
        """Products in a row that nobody knew here."""
        self.stuck = False
        """Interrupted for longer than the longest product."""


class ProductTable:
    """The records of one line and all that the parts of tracking keep between two scans."""

    def __init__(self, line: LineLayout, settings: Settings | None = None) -> None:
        self.line = line
        self.settings = settings or Settings()
        """May be replaced between two scans."""
        self.products: list[Product] = []
        """On the line, front-most (greatest position) first."""
        self.slots: list[Product | None] = [None] * line.slots
        """All records by slot, the lost ones past the end of the line too."""
        self.next_id = 1
        self.entered = 0
        """Arrivals at S1 that got a record."""
        self.unloaded = 0
        self.lost = 0
        """Times a product was declared lost."""
        self.unexpected = 0
        """Edges that no product explained."""
        self.corrections = 0
        self.withdrawn = 0
        self.left = 0
        """Products that left the line backwards."""
        self.deleted = 0
        self.inserted = 0
        self.found = 0
        """Unexpected products that got a record."""
        self.diverted = [0] * len(line.gates)
        """Products that turned off, by gate."""
        self.merged = [0] * len(line.merges)
        """Products that came in from a lane, by merging gate."""
        self.gates = [GatePosition.STRAIGHT] * len(line.gates)
        """Where each gate stands by its feedback; to be set before a scan."""
        self.refused = 0
        """Products that could not be stored."""
        self.greatest_correction = 0.0
        """Greatest |correction| [mm]."""
        self.areas = 0
        """Bit n: a product that is not lost has its head on area n + 1."""
        self.sensor_faults = 0
        """Bit n: sensor n + 1 is suspected blind or stuck."""
        self.brake = False
        """The last belt must stop (or stay): a product is being unloaded, or a lost one that may be there waits for a person."""
        self.gap: Gap | None = None
        """Adjacent pair with the least reserve; None with fewer than two products."""
        self.gap_stop = False
        """Latched until `release_gap_stop`: the whole line must stop."""
        self.sensors = [Sensor(n, x, line.belt_ends) for n, x in enumerate(line.sensors)]
        self.at_borders = [sensor for sensor in self.sensors if sensor.before != sensor.behind]
        self.beams: tuple[bool, ...] | None = None
        """Of the last scan; None = not looked at since power-up."""
        self.cuts: dict[int, Cut] = {}
        """By index of the sensor."""
        self.odometers = [0.0] * len(line.belt_ends)
        """Way of every belt since power-up [mm]."""
        self.ways = [0] * len(line.belt_ends)
        """Sign of every belt's last movement."""
        self.now = 0
        """Time of this scan [µs]."""
        self.events: list[TrackingEvent] = []
        """Of this scan."""
        self.changed = True
        """Records have changed without any movement."""
        self.braking = 0
        """Id of the product that `brake` is for."""
        self.stands_since = NEVER
        """It has stood at the end since [µs]."""

    @property
    def buffer_full(self) -> bool:
        """No slot is free: feed nothing more."""
        return None not in self.slots

    @property
    def uncertain(self) -> bool:
        """The position of a product is uncertain."""
        return self._any(UNCERTAIN)

    @property
    def outside_present(self) -> bool:
        """A product's last correction was above the alarm tolerance."""
        return self._any(OUTSIDE)

    @property
    def lost_present(self) -> bool:
        """A lost product is in the table."""
        return self._any(LOST)

    def tell(
        self, code: Code, source: int = 0, id: int = 0, second: int = 0, value: float = 0.0, value2: float = 0.0
    ) -> None:
        """One happening of this scan."""
        self.events.append(TrackingEvent(code, source, id, second, value, value2))

    # records

    def record(self, slot: int, right: float, length: float, state: ProductState, time_us: int) -> Product:
        """A new record in a free slot, not yet in order."""
        product = Product(self._take_id(), slot, right, length, state, time_us, moved_us=time_us)
        self.pass_gates(product, right)
        self.slots[slot] = product
        self.products.append(product)
        self.changed = True
        return product

    def free_slot(self) -> int | None:
        """The lowest one."""
        return self.slots.index(None) if None in self.slots else None

    def remove(self, product: Product) -> None:
        """Take a record out of the table."""
        if product.id == self.braking:
            self.end_unloading()
        self.slots[product.slot] = None
        if product in self.products:
            self.products.remove(product)
        self.forget_beams(product)
        self.changed = True

    def withdraw(self, product: Product, n: int) -> None:
        """What was at sensor `n` (index) was no product, or has gone back."""
        self.withdrawn += 1
        self.tell(Code.WITHDRAWN, n + 1, product.id, 0, product.furthest)
        self.remove(product)

    def forget_beams(self, product: Product) -> None:
        """No beam is interrupted by it any more."""
        for sensor in self.sensors:
            cut = self.cuts.get(sensor.n)
            if sensor.held and sensor.held.product is product:
                sensor.held = None
            if cut and cut.held.product is product:
                del self.cuts[sensor.n]

    def put_in_order(self) -> None:
        """Front-most first."""
        self.products.sort(key=_place, reverse=True)

    def end_unloading(self) -> None:
        """Let the last belt go."""
        self.brake, self.braking = False, 0
        self.changed = True
        for product in self.products:
            if product.state is UNLOADING:
                product.state = product.settled

    def past_the_end(self, product: Product) -> bool:
        """It only keeps its slot."""
        return product.state is LOST and (product.left >= self.line.length or product.right <= 0.0)

    def pass_gates(self, product: Product, x: float) -> None:
        """It is known to be at `x` [mm]: it has gone straight on at every gate before."""
        for n, gate in enumerate(self.line.gates):
            if gate < x:
                product.gates |= 1 << n

    def put_on_line(self, product: Product) -> None:
        """A person says where it is: in no lane, and past the gates before its right end."""
        product.lane = product.coming = product.gates = 0
        product.away = 0.0
        self.pass_gates(product, product.right)

    # which end has passed which sensor

    def set_passed(self, product: Product) -> None:
        """From the position alone; an end within the tolerance of a free beam may still come to it."""
        near = self.settings.sensor_tolerance
        product.passed_right = product.passed_left = 0
        for n, x in enumerate(self.line.sensors):
            interrupted = bool(self.beams and self.beams[n])
            if product.right > (x if interrupted else x + near):
                product.passed_right |= 1 << n
            if product.left > (x if interrupted else x - near):
                product.passed_left |= 1 << n

    def predicted(self) -> tuple[bool, ...]:
        """What the beams should show."""
        return tuple(
            any(
                product.open_at == n or (product.state is not LOST and product.left < x < product.right)
                for product in self.products
            )
            for n, x in enumerate(self.line.sensors)
        )

    # belts beside a sensor

    def travel(self, sensor: Sensor) -> float:
        """Way of the belts beside it so far [mm]."""
        return (self.odometers[sensor.before] + self.odometers[sensor.behind]) / 2

    def compare_belts(self) -> None:
        """Adds up by how much the belts beside a sensor go differently: the one ahead now may be behind later, and make up for nothing."""
        for sensor in self.at_borders:
            lead = self._lead(sensor)
            further = abs(lead - sensor.lead)
            if further > TO_AND_FRO:
                sensor.apart += further
                sensor.lead = lead

    def apart(self, sensor: Sensor) -> float:
        """By so much the belts beside it went differently since its beam was interrupted [mm]; a product on both may have gone half of
        it further than their mean, or less far."""
        return sensor.apart + abs(self._lead(sensor) - sensor.lead)

    def begin(self, sensor: Sensor) -> None:
        """Its beam is interrupted now."""
        sensor.risen, sensor.apart, sensor.lead = self.travel(sensor), 0.0, self._lead(sensor)

    def way_at(self, sensor: Sensor) -> int:
        """Which way something comes to it: 1 forward, −1 backwards."""
        return -1 if self.ways[sensor.behind] < 0 and self.ways[sensor.before] <= 0 else 1

    def _lead(self, sensor: Sensor) -> float:
        return self.odometers[sensor.before] - self.odometers[sensor.behind]

    def _take_id(self) -> int:
        id = self.next_id
        used = {product.id for product in self.slots if product}
        self.next_id = id % LAST_ID + 1
        while self.next_id in used:
            self.next_id = self.next_id % LAST_ID + 1
        return id

    def _any(self, state: ProductState) -> bool:
        return any(product is not None and product.state is state for product in self.slots)


def set_state(product: Product, state: ProductState) -> None:
    """Its state, or the one after entering or unloading."""
    if product.state in (ENTERING, UNLOADING):
        product.settled = state
    else:
        product.state = state


def call_uncertain(product: Product) -> None:
    """Its position is uncertain; a lost one stays lost."""
    if product.state is not LOST:
        set_state(product, UNCERTAIN)


def note_passed(product: Product, n: int, way: int, end: int = 0) -> None:
    """The end (1 right, −1 left; 0 = the leading one) passes sensor `n` in this direction, the trailing one last."""
    if end == -way:
        note_passed(product, n, way)
    if (end or way) > 0:
        product.passed_right = product.passed_right | 1 << n if way > 0 else product.passed_right & ~(1 << n)
    else:
        product.passed_left = product.passed_left | 1 << n if way > 0 else product.passed_left & ~(1 << n)


def _place(product: Product) -> float:
    return product.right - product.length / 2
