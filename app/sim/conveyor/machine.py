"""The conveyor as it really is: belts with inertia, products that slip, bump and arrive by chance, light barriers, encoders.

The program behind the virtual PLC sees none of this but pulses, beams and the torque limit of each drive.

| subject | taken here; no source gives it |
| --- | --- |
| drive | follows its setpoint with a time constant of 30 ms, at most 400 %/s: its torque is limited, and says so |
| without supply | friction stops a belt with 150 %/s |
| slip | each product loses 0–0.4 % of its way; while a belt slips, 3 mm more, once in 300 mm of belt, so 1 or 2 % |
| two belts | a product on both moves by each belt's part of its length |
| infeed | runs with belt 1 forward and keeps 30 mm between products; what backs out at the start is gone |
| end | what hangs over the end of the last belt by more than half falls off |
| unloader | takes the front-most product within 15 mm of the end, only while told to and while the last belt stands |
| unloader, reach | less than the shortest product (20 mm): were the front-most gone, the next one would be out of reach |
| label | products of one order come one after the other, 3 to 8 of them; each order has a class, and a product weighs by its length |
| scanner | what it cannot read of a product it cannot read however often that passes |
| products | cannot pass through one another: the moving one is held back, both are marked |
"""

from bisect import bisect_left, bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import exp, floor, inf, pi
from random import Random
from typing import NamedTuple

from app.sim.conveyor.blades import GATE_FAULTS, Blades, GatePlan
from app.sim.conveyor.lanes import MERGE_FAULTS, Lanes, MergePlan, come_in

MOST_BELTS, MOST_SENSORS = 16, 32

DRIVE_TIME = 0.03
"""Time constant of a drive with its belt [s]."""
TORQUE_LIMIT = 400.0
"""Steepest change of speed that a drive can make [%/s]."""
FRICTION = 150.0
"""Change of speed of a belt without drive [%/s]."""
LEAST_SLIP, MOST_SLIP = 0.0, 0.004
"""Part of its way that a product loses on any belt."""
BURST, BURST_EVERY, BURST_LENGTH = 3.0, 300.0, 12.0
"""A slipping belt: way lost in a burst, way of the belt between two bursts, way of the belt in which it is lost [mm]."""
INFEED_GAP = 30.0
"""Least distance that the infeed keeps [mm]."""
UNLOAD_ZONE = 15.0
"""Reach of the unloader from the end of the line [mm]."""
FIRST_ORDER, CATEGORIES = 24_000_000, 3
"""Orders are counted from here; classes."""
WEIGHT = 0.04
"""Of a product [kg/mm]."""
STANDS = 1.0
"""The unloader takes from a belt that is slower [%]."""

EMERGENCY_STOP, HOST_OFF = 50, 60
BELT_FAULTS: Mapping[str, tuple[int, int]] = {"jam": (0, 100), "slip": (10, 200), "encoder": (40, 500)}
"""Kind → code of belt n less n: of the first three belts, of the others."""
SENSOR_FAULTS: Mapping[str, tuple[int, int]] = {"blind": (20, 300), "stuck": (30, 400)}
"""Kind → code of sensor n less n: of the first four sensors, of the others."""
FEW_BELTS, FEW_SENSORS = 3, 4


def fault_names(belts: int, sensors: int, gates: int = 0, merges: int = 0) -> dict[str, int]:
    """Machine faults that the instructor can cause on such a line (`training`), by name."""
    found: dict[str, int] = {}
    for table, count, few in ((BELT_FAULTS, belts, FEW_BELTS), (SENSOR_FAULTS, sensors, FEW_SENSORS)):
        for kind, (first, more) in table.items():
            found |= {f"{kind}_{n}": n + (first if n <= few else more) for n in range(1, count + 1)}
    found |= {f"gate_{n}": GATE_FAULTS + n for n in range(1, gates + 1)}
    found |= {f"merge_{n}": MERGE_FAULTS + n for n in range(1, merges + 1)}
    return {**found, "emergency_stop": EMERGENCY_STOP, "host_off": HOST_OFF}


FAULT_NAMES = fault_names(FEW_BELTS, FEW_SENSORS)
"""Of the line of the thesis."""
FAULTS = tuple(FAULT_NAMES.values())


@dataclass(frozen=True, slots=True)
class Geometry:
    """Measures of a line [mm] and its drives."""

    belt_ends: tuple[float, ...] = (215.0, 445.0, 660.0)
    sensors: tuple[float, ...] = (100.0, 215.0, 445.0, 560.0)
    roller_radius: float = 15.0
    rated_speed: float = 40.0
    """Of the rollers at 100 % [rpm]."""
    resolution: int = 1650
    """Pulses per revolution of a roller."""
    intact_is_one: bool = True
    """Polarity of the light barriers."""
    shares: tuple[float, ...] = ()
    """What each belt goes in automatic, as part of the automatic speed [%]; empty = all of it."""
    gates: tuple[GatePlan, ...] = ()
    """Diverting gates, from the beginning of the line."""
    merges: tuple[MergePlan, ...] = ()
    """Merging gates, likewise."""

    @property
    def belts(self) -> int:
        return len(self.belt_ends)

    @property
    def speed_shares(self) -> tuple[float, ...]:
        """One for each belt [%]."""
        return self.shares or (100.0,) * self.belts

    @property
    def length(self) -> float:
        """Of the line [mm]."""
        return self.belt_ends[-1]

    @property
    def full_speed(self) -> float:
        """Of a belt at 100 % [mm/s]: 2πr·n/60."""
        return 2 * pi * self.roller_radius * self.rated_speed / 60

    @property
    def pulse_length(self) -> float:
        """Way of a belt per pulse [mm]: 2πr/resolution."""
        return 2 * pi * self.roller_radius / self.resolution

    @property
    def area_ends(self) -> tuple[float, ...]:
        """An area for each belt; that of the last one ends at the last sensor, and what remains is one more, for unloading."""
        return (*self.belt_ends[:-1], self.sensors[-1], self.belt_ends[-1])


class Label(NamedTuple):
    """What is printed on a product, and what it weighs."""

    order: int
    category: int
    weight: float
    """[kg]"""
    legible: float
    """0 to 100: the scanner reads it while fewer per cent than this are not read."""


NO_LABEL = Label(0, 0, 0.0, 0.0)


class Labels:
    """Prints the labels of the products in the order in which they come."""

    def __init__(self, random: Random) -> None:
        self._random = random
        self._order = FIRST_ORDER + random.randrange(1000)
        self._category = random.randint(1, CATEGORIES)
        self._left = 0

    def label(self, length: float) -> Label:
        """For the next product, so long [mm]."""
        chance = self._random
        if not self._left:
            self._order += 1
            self._category, self._left = chance.randint(1, CATEGORIES), chance.randint(3, 8)
        self._left -= 1
        weight = round(length * WEIGHT * chance.uniform(0.9, 1.1), 2)
        return Label(self._order, self._category, weight, chance.uniform(0, 100))


@dataclass(slots=True)
class TrueProduct:
    """A product where it really is."""

    number: int
    """Rises by one with every product that comes onto the line, by the infeed or by hand."""
    head: float
    """Right end [mm]."""
    length: float
    slip: float
    """Part of its way that it loses."""
    collided: bool = False
    """It has been pushed against another."""
    by_hand: bool = False
    label: Label = NO_LABEL
    lane: int = 0
    """Gate that it turns off at, from 1; its head is at the gate then, and its length what is still on the line."""
    away: float = 0.0
    """What of it is in the lane [mm]."""
    asked: int = 0
    """Bit n: it has come to gate n + 1."""
    coming: int = 0
    """Merging gate that it comes in by, from 1, while a part of it, `away`, is still in the lane; its tail is at the gate then."""
    origin: int = 0
    """Merging gate that it came in by; 0 = by the infeed or by hand."""

    @property
    def tail(self) -> float:
        """Left end [mm]."""
        return self.head - self.length


class Conveyor:
    """Belts, products, barriers and encoders. The same seed and the same setpoints give the same run."""

    def __init__(
        self,
        geometry: Geometry,
        random: Random,
        *,
        arrivals: bool = True,
        interval: float = 6.0,
        shortest: float = 20.0,
        longest: float = 60.0,
        labels: Labels | None = None,
        not_read: float = 0.0,
        lane_interval: float = 0.0,
        lane_chance: Random | None = None,
    ) -> None:
        """`interval`: mean time between two products while belt 1 runs forward [s]; `shortest`, `longest` [mm]; `labels`: what is printed
        on them; `not_read`: of so many the scanner cannot read it [%];
        `lane_interval`: mean time between two products of a lane [s], 0 = none comes by itself."""
        self.geometry = geometry
        self.arrivals, self.interval, self.shortest, self.longest = arrivals, interval, shortest, longest
        belts = geometry.belts
        self.not_read = not_read
        self._labels = labels or Labels(Random(0))
        self.blades = Blades([gate.at for gate in geometry.gates])
        self.lanes = Lanes(geometry.merges, lane_chance or Random(0), lane_interval, shortest, longest)
        self.merged = self.returned = 0
        """Products that began to come in from a lane; that went back into it."""
        names = fault_names(belts, len(geometry.sensors), len(geometry.gates), len(geometry.merges))
        self._faults = {code: name for name, code in names.items()}
        self.fault = 0
        self.pressed = 0
        """Sensors interrupted by hand: bit n = sensor n + 1."""
        self.products: list[TrueProduct] = []
        """Front-most first."""
        self.speeds = [0.0] * belts
        """Of the belts [%], negative to the left."""
        self.limited = [False] * belts
        """Whether a drive is at its torque limit: an input of the PLC."""
        self.pulses = [0] * belts
        """Of the encoders: an input of the PLC."""
        self.beams = 0
        """Bit n: something is in the beam of sensor n + 1 (or it says so)."""
        self.entered = self.unloaded = self.removed = self.fallen = self.backed_out = self.put = 0
        """What became of products, counted: by the infeed, the unloader, by hand, over the end, back over the start, put by hand."""
        self.collisions = 0
        self._random = random
        self._travel = [0.0] * belts
        self._burst = [0.0] * belts
        self._begins = (-inf, *geometry.belt_ends[:-1])
        self._ends = (*geometry.belt_ends[:-1], inf)
        self._next = self._interval()

    @property
    def fault(self) -> int:
        """One of `fault_names`, 0 = none."""
        return self._fault

    @fault.setter
    def fault(self, code: int) -> None:
        self._fault = code
        kind, _, number = self._faults.get(code, "").rpartition("_")
        of = {name: int(number) - 1 if name == kind else -1 for name in (*BELT_FAULTS, *SENSOR_FAULTS, "gate", "merge")}
        self.blades.stuck, self.lanes.stuck = of["gate"], of["merge"]
        self._jammed, self._slipping, self._dead = of["jam"], of["slip"], of["encoder"]
        self._blind, self._stuck = of["blind"], of["stuck"]

    # ---- by hand

    def remove(self, number: int) -> bool:
        """Take the `number`-th product off, 1 = front-most."""
        if not 1 <= number <= len(self.products):
            return False
        del self.products[number - 1]
        self.removed += 1
        self._look()
        return True

    def place(self, head: float, length: float) -> bool:
        """Put a product with its right end at `head` [mm]; False when there is no room."""
        if head > self.geometry.length or head - length < 0:
            return False
        if any(head > other.tail and head - length < other.head for other in self.products):
            return False
        self.put += 1
        self._add(head, length, by_hand=True)
        self.products.sort(key=lambda product: -product.head)
        self._look()
        return True

    # ---- one step

    def step(
        self,
        setpoints: list[float],
        enabled: bool,
        unload: bool,
        dt: float,
        gates: Sequence[bool] = (),
        stops: Sequence[bool] = (),
    ) -> None:
        """Advance by `dt` [s]; `setpoints` of the drives [%], `enabled`: they have supply, `unload`: the unloader may take, `gates`: which
        are to open their lanes, `stops`: which lanes are to let a product in."""
        ways = self._drive(setpoints, enabled, dt)
        if gates and enabled:
            self.blades.step(gates, self.products, dt)
        if unload and abs(self.speeds[-1]) < STANDS:
            self._unload()
        if stops:
            self._let_in(stops, enabled, dt)
        if self.products and any(ways):
            self._move(ways)
        if self.arrivals and self.speeds[0] > 1.0:
            self._feed(dt)
        self._look()

    def _drive(self, setpoints: list[float], enabled: bool, dt: float) -> list[float]:
        """Turn the rollers; the way of each belt [mm]."""
        full, pulse = self.geometry.full_speed / 100, self.geometry.pulse_length
        follow, most, brake = 1 - exp(-dt / DRIVE_TIME), TORQUE_LIMIT * dt, FRICTION * dt
        ways = []
        for belt, setpoint in enumerate(setpoints):
            speed = self.speeds[belt]
            if not enabled:
                speed = max(speed - brake, 0.0) if speed > 0 else min(speed + brake, 0.0)
                self.limited[belt] = False
            elif speed != setpoint:
                change = (setpoint - speed) * follow
                limited = change > most or change < -most
                if limited:
                    change = most if change > 0 else -most
                speed += change
                if -0.001 < setpoint - speed < 0.001:
                    speed = setpoint
                self.limited[belt] = limited
            else:
                self.limited[belt] = False
            if belt == self._jammed:
                speed = 0.0
                self.limited[belt] = enabled and abs(setpoint) > 0.5
            self.speeds[belt] = speed
            way = speed * full * dt
            if way:
                before = floor(self._travel[belt] / pulse)
                self._travel[belt] += way
                if belt != self._dead:
                    self.pulses[belt] += floor(self._travel[belt] / pulse) - before
            ways.append(way)
        return ways

    def _move(self, ways: list[float]) -> None:
        belt = self._slipping
        if belt >= 0:
            ways[belt] *= 1 - self._burst_part(belt, ways[belt])
        begins, ends, last = self._begins, self._ends, len(ways) - 1
        moved = False
        for product in self.products:
            head = product.head
            tail = head - product.length
            # the belts under its two ends
            rear, front = bisect_right(ends, tail), bisect_left(ends, head)
            if rear >= front:
                way = ways[front if front < last else last]
            else:
                way = (
                    sum(
                        (min(head, ends[belt]) - max(tail, begins[belt])) * ways[belt]
                        for belt in range(rear, front + 1)
                    )
                    / product.length
                )
            if way:
                product.head = head + way * (1 - product.slip)
                moved = True
                if product.coming:
                    come_in(product, self.geometry.merges[product.coming - 1].at)
        if moved:
            self._turn()
            self._keep_apart(ways)
            self._turn()
            self._leave()

    def _let_in(self, stops: Sequence[bool], enabled: bool, dt: float) -> None:
        coming = {product.coming for product in self.products}
        self.lanes.step(dt, supplied=enabled, busy=[n + 1 in coming for n in range(len(stops))])
        for n, (plan, go) in enumerate(zip(self.geometry.merges, stops, strict=True)):
            if not go or n + 1 in coming or self.speeds[bisect_left(self.geometry.belt_ends, plan.at)] <= 0:
                continue
            if length := self.lanes.let_go(n):
                self.merged += 1
                self._add(plan.at, length)
                product = self.products[-1]
                product.coming, product.origin, product.away, product.length = n + 1, n + 1, length, 0.0
                self.products.sort(key=lambda one: -one.head)

    def _burst_part(self, belt: int, way: float) -> float:
        """Part of `way` that is lost to slip."""
        at = self._burst[belt] % BURST_EVERY
        self._burst[belt] += abs(way)
        return BURST / BURST_LENGTH if at < BURST_LENGTH else 0.0

    def _keep_apart(self, ways: list[float]) -> None:
        """Nothing passes through anything: what comes from behind is held back, to the left likewise."""
        products = self.products
        if len(products) < 2:
            return
        if max(ways) > 0:
            for front, rear in pairwise(products):
                if rear.head > front.head - front.length:
                    rear.head = front.head - front.length
                    self._bump(front, rear)
        if min(ways) < 0:
            for n in range(len(products) - 1, 0, -1):
                rear, front = products[n], products[n - 1]
                if front.head - front.length < rear.head:
                    front.head = rear.head + front.length
                    self._bump(front, rear)

    def _bump(self, front: TrueProduct, rear: TrueProduct) -> None:
        if not (front.collided and rear.collided):
            self.collisions += 1
        front.collided = rear.collided = True

    def _turn(self) -> None:
        if self.blades.places:
            self.products[:] = self.blades.turn(self.products)

    def _leave(self) -> None:
        for product in [
            one for one in self.products if one.coming and one.head < self.geometry.merges[one.coming - 1].at
        ]:
            self.products.remove(product)
            self.lanes.take_back(product.coming - 1, product.away)
            self.returned += 1
        if not self.products:
            return
        front = self.products[0]
        if front.head - front.length / 2 > self.geometry.length:
            del self.products[0]
            self.fallen += 1
        if self.products and self.products[-1].head < 0:
            del self.products[-1]
            self.backed_out += 1

    def _unload(self) -> None:
        if self.products and self.products[0].head >= self.geometry.length - UNLOAD_ZONE:
            del self.products[0]
            self.unloaded += 1

    def _feed(self, dt: float) -> None:
        self._next -= dt
        if self._next > 0 or (self.products and self.products[-1].tail < INFEED_GAP):
            return
        self._next = self._interval()
        self.entered += 1
        self._add(0.0, self._length())

    def _add(self, head: float, length: float, *, by_hand: bool = False) -> None:
        slip = self._random.uniform(LEAST_SLIP, MOST_SLIP)
        number, label = self.entered + self.put + self.merged, self._labels.label(length)
        product = TrueProduct(number, head, length, slip, by_hand=by_hand, label=label)
        self.blades.place(product)
        self.products.append(product)

    def scanned(self, sensor: int) -> Label | None:
        """What the scanner at a sensor (from 1) reads of the product in its beam, an input of the PLC; None: nothing that it can read."""
        x = self.geometry.sensors[sensor - 1]
        for product in self.products:
            if product.tail <= x <= product.head:
                return product.label if product.label.legible >= self.not_read else None
        return None

    def _interval(self) -> float:
        return self.interval * self._random.uniform(0.5, 1.5)

    def _length(self) -> float:
        return round(self._random.uniform(self.shortest, max(self.shortest, self.longest)), 1)

    def _look(self) -> None:
        """What the light barriers say."""
        sensors = self.geometry.sensors
        beams = self.pressed
        for product in self.products:
            head = product.head
            first, behind = bisect_right(sensors, head - product.length), bisect_right(sensors, head)
            if first < behind:
                beams |= (1 << behind) - (1 << first)
        if self._blind >= 0:
            beams &= ~(1 << self._blind)
        elif self._stuck >= 0:
            beams |= 1 << self._stuck
        self.beams = beams

    @property
    def raw_inputs(self) -> int:
        """The beams as wired: bit n of sensor n + 1."""
        return self.beams ^ (1 << len(self.geometry.sensors)) - 1 if self.geometry.intact_is_one else self.beams
