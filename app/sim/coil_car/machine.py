"""The coil-car line as it really is: recoiler with mandrel, a coil that grows, a car with two axes, saddles, hydraulics, switches.

Where the car may be is a plane: its position x and the height v of its table. What stands around it are rectangles in that plane, other
ones for a car with a coil than for an empty one. A collision is a car inside one of them; the interlock of the PLC keeps away from them.

| subject | taken here; no source gives it |
| --- | --- |
| drives | follow their setpoint, at most 1500 mm/s²; without supply brakes stop them with 800 and 600 mm/s² |
| hydraulics | 160 bar; the table and the mandrel move from 20 bar on; without pressure the table stays where it is |
| mandrel | 3 s; collapsed it leaves a coil that the table touches to the car, and drops any other |
| saddle | takes the coil when the table goes below the seat, gives it back when it comes up |
| collision | more than 5 mm pressed into a coil; any depth into anything else; a dropped coil; an end stop |
"""

from dataclasses import dataclass, fields
from enum import IntEnum
from itertools import pairwise
from math import inf, isfinite
from typing import NamedTuple

MARGIN = 50.0
"""Horizontal distance that the interlock keeps [mm]."""
RISE = 50.0
"""Vertical distance that the interlock keeps from saddles and coils [mm]."""
LOWERED = 50.0
"""A table no higher than this is lowered [mm]."""
CORRIDOR = 30.0
"""A car this near to the middle of a saddle or of the mandrel passes between the arms, or below the coil in its middle [mm]."""
TOUCH, PRESSED = 3.0, 5.0
"""Between table and coil on the mandrel: touching up to, pressed in from [mm]."""
FOLLOWS, BRAKE_X, BRAKE_V = 1500.0, 800.0, 600.0
"""[mm/s²]"""
LIMIT_X, LIMIT_V = 10.0, 5.0
"""Where the limit switches are, from the ends of the ways [mm]."""
STOP_X, STOP_V = 50.0, 10.0
"""Where the end stops are, beyond the ends of the ways [mm]."""
PRESSURE, LOW_PRESSURE, LEAST_PRESSURE = 160.0, 45.0, 20.0
"""[bar]"""
PRESSURE_UP, PRESSURE_DOWN, PRESSURE_LEAK = 1.5, 2.0, 0.5
"""Time constants [s]."""
OIL, COLD, OIL_LAG = 38.0, 8.0, 3.0
"""[°C], [s]"""
MANDREL_TIME = 3.0
"""[s]"""
GROWTH = 20.0
"""[mm/s]"""

STUCK_ON, STUCK_OFF, GUARD = 10, 20, 40
PRESSURE_LOW, PUMP_OFF, OIL_COLD = 31, 32, 33
EMERGENCY_STOP, MANDREL_STUCK, HOST_OFF = 50, 51, 60
FAULTS = (1, 2, 11, 12, 13, 14, 21, 22, 23, 24, 31, 32, 33, 41, 42, 43, EMERGENCY_STOP, MANDREL_STUCK, HOST_OFF)
"""Machine faults that the instructor can cause (`training`)."""


@dataclass(frozen=True, slots=True)
class Geometry:
    """Measures of a line [mm]; these are the options of the type `coil_car`."""

    mandrel_position: float = 1000.0
    """Middle of the coil on the mandrel."""
    mandrel_reach: float = 1600.0
    """End of the mandrel."""
    mandrel_height: float = 1200.0
    """Its axis over the lowered table."""
    out_position: float = 2700.0
    """In the free zone, where the car lifts."""
    saddle_1_position: float = 9000.0
    saddle_2_position: float = 6600.0
    saddle_3_position: float = 4200.0
    saddle_height: float = 700.0
    """Lowest point of a coil that lies there."""
    saddle_length: float = 800.0
    clearance: float = 150.0
    """Between a coil and the seat when the car drives over the saddles."""
    travel: float = 10000.0
    """Horizontal way, from 0."""
    lift: float = 1400.0
    """Vertical way, from 0."""
    coil_width: float = 1200.0
    coil_smallest: float = 600.0
    """Diameter that a coil begins with."""
    coil_largest: float = 1900.0
    eye_diameter: float = 508.0
    """Of the expanded mandrel, too."""
    collapsed_diameter: float = 460.0
    table_width: float = 600.0
    position_tolerance: float = 20.0
    """Within which the car is at a place."""

    def __post_init__(self) -> None:
        for name in MEASURES:
            value = getattr(self, name)
            if not (isfinite(value) and value >= 0):
                raise ValueError(f"{name} = {value}: expected millimetres from 0 up")
        self._order("collapsed_diameter", "eye_diameter", "coil_smallest", "coil_largest")
        self._order("mandrel_position", "mandrel_reach", "out_position", "saddle_3_position", "saddle_2_position")
        self._order("saddle_2_position", "saddle_1_position", "travel")
        if self.out_position < self.free_from:
            raise ValueError(
                f"out_position = {self.out_position:g}: expected at least {self.free_from:g}, clear of the mandrel"
            )
        first = self.saddle_3_position - self.coil_width - MARGIN
        if self.out_position > first:
            raise ValueError(
                f"out_position = {self.out_position:g}: expected at most {first:g}, clear of saddle 3 with its coil"
            )
        for near, far in ((3, 2), (2, 1)):
            least = self.saddle(near) + self.coil_width + MARGIN + self.position_tolerance
            if self.saddle(far) < least:
                raise ValueError(f"saddle_{far}_position = {self.saddle(far):g}: expected at least {least:g}")
        if self.clearance < 2 * RISE:
            raise ValueError(f"clearance = {self.clearance:g}: expected at least {2 * RISE:g}")
        if self.saddle_height < self.clearance:
            raise ValueError(f"saddle_height = {self.saddle_height:g}: expected at least {self.clearance:g}")
        highest = max(self.saddle_height + self.clearance, self.contact(self.coil_smallest))
        if self.lift < highest:
            raise ValueError(f"lift = {self.lift:g}: expected at least {highest:g}")
        if self.contact(self.coil_largest) <= LOWERED:
            raise ValueError(
                f"coil_largest = {self.coil_largest:g}: expected less than {2 * (self.mandrel_height - LOWERED):g}, "
                "for the lowered car to pass below"
            )
        if not 0 < self.position_tolerance < CORRIDOR:
            raise ValueError(
                f"position_tolerance = {self.position_tolerance:g}: expected more than 0, less than {CORRIDOR:g}"
            )

    def _order(self, *names: str) -> None:
        for low, high in pairwise(names):
            if getattr(self, low) >= getattr(self, high):
                raise ValueError(f"{high} = {getattr(self, high):g}: expected more than {low} = {getattr(self, low):g}")

    def saddle(self, number: int) -> float:
        """Position of saddle `number` [mm], from 1."""
        return (self.saddle_1_position, self.saddle_2_position, self.saddle_3_position)[number - 1]

    def contact(self, diameter: float) -> float:
        """Height of the table at which it touches a coil of `diameter` on the mandrel [mm]."""
        return self.mandrel_height - diameter / 2

    @property
    def free_from(self) -> float:
        """From here on a car with a coil is clear of the mandrel and of a coil on it [mm]."""
        return max(self.mandrel_reach + self.coil_width / 2, self.mandrel_position + self.coil_width) + MARGIN

    @property
    def saddles_from(self) -> float:
        """From here on a car with a coil is over the saddles [mm]."""
        return self.saddle_3_position - (self.coil_width + self.saddle_length) / 2 - MARGIN


MEASURES = tuple(field.name for field in fields(Geometry))
"""In the order of the configuration image."""


class Hit(IntEnum):
    """What the car ran into."""

    NONE = 0
    COIL_ON_MANDREL = 1
    MANDREL = 2
    COIL_ON_SADDLE = 3
    SADDLE = 4
    DROPPED = 5
    END_STOP = 6


class Obstacle(NamedTuple):
    """Positions (x, v) of the car that are not possible: all strictly between the bounds [mm]."""

    left: float
    right: float
    low: float
    high: float
    kind: int


class CoilCar:
    """Recoiler, car, saddles, hydraulics and switches. No interlock is in here: it does what it is told, and may collide."""

    def __init__(self, geometry: Geometry) -> None:
        self.geometry = geometry
        self.x = geometry.out_position
        """Middle of the car [mm]."""
        self.v = 0.0
        """Height of the table [mm]."""
        self.speed_x = 0.0
        """[mm/s]"""
        self.speed_v = 0.0
        self.expansion = 1.0
        """0 = collapsed, 1 = expanded."""
        self.coil = 0.0
        """Diameter of the coil on the mandrel [mm], 0 = none."""
        self.finished = False
        """The coil on the mandrel has its diameter and its end is cut."""
        self.winding = False
        self.load = 0.0
        """Diameter of the coil on the car [mm], 0 = none."""
        self.saddles = [0.0, 0.0, 0.0]
        """Diameters of the coils on saddles 1 to 3 [mm], 0 = none."""
        self.laid = [0.0, 0.0, 0.0]
        """How long they lie there [s]."""
        self.pressure = PRESSURE
        """[bar]"""
        self.oil = OIL
        """[°C]"""
        self.held: dict[str, float] = {}
        """Values that a test or the instructor holds: pressure, oil_temperature, pump, guard_<n>, emergency_stop."""
        self.fault = 0
        """One of `FAULTS`, 0 = none."""
        self.growth = GROWTH
        """Of the coil's diameter while it is wound [mm/s]."""
        self.crane = 0.0
        """The crane takes a coil so long after it was laid [s]; 0 = never."""
        self.strip = True
        """The recoiler has strip to wind."""
        self.hit = Hit.NONE
        """First collision; nothing undoes it."""

    # ---- switches and sensors

    @property
    def emergency_stop(self) -> bool:
        """Pressed."""
        return self.fault == EMERGENCY_STOP or bool(self.held.get("emergency_stop"))

    def guard(self, number: int) -> bool:
        """Whether guard `number`, from 1, is closed."""
        return self.fault != GUARD + number and (not self.held or bool(self.held.get(f"guard_{number}", 1.0)))

    @property
    def pump(self) -> bool:
        """Whether it runs: always, but for an emergency stop or a fault."""
        return self.fault != PUMP_OFF and not self.emergency_stop and bool(self.held.get("pump", 1.0))

    def drive_ready(self, number: int) -> bool:
        """Drive 1 (horizontal) or 2 (vertical)."""
        return self.fault != number

    def limit(self, number: int) -> bool:
        """Limit switch 1 left, 2 right, 3 up, 4 down: actuated."""
        if self.fault == STUCK_ON + number:
            return True
        return self.fault != STUCK_OFF + number and self.limit_expected(number, 0.0)

    def limit_expected(self, number: int, margin: float) -> bool:
        """Whether the position lies `margin` inside the switch's range, or beyond [mm]."""
        if number == 1:
            return self.x <= LIMIT_X - margin
        if number == 2:
            return self.x >= self.geometry.travel - LIMIT_X + margin
        if number == 3:
            return self.v >= self.geometry.lift - LIMIT_V + margin
        return self.v <= LIMIT_V - margin

    @property
    def mandrel(self) -> int:
        """0 collapsed, 1 between, 2 expanded."""
        return 0 if self.expansion <= 0.0 else 2 if self.expansion >= 1.0 else 1

    @property
    def contact(self) -> bool:
        """The table touches the coil on the mandrel."""
        measures = self.geometry
        return (
            self.coil > 0
            and not self.load
            and abs(self.x - measures.mandrel_position) <= CORRIDOR
            and abs(self.v - measures.contact(self.coil)) <= TOUCH
        )

    # ---- one step

    def step(self, horizontal: float, vertical: float, powered: tuple[bool, bool], mandrel: int, dt: float) -> None:
        """`dt` [s] with setpoints [mm/s] of the drives that are `powered` (the others brake) and the mandrel told to collapse (−1), stay
        or expand (1)."""
        self._hydraulics(dt)
        hydraulic = self.pressure >= LEAST_PRESSURE
        self.speed_x, self.x = self._axis(
            self.speed_x, self.x, horizontal, powered[0] and self.drive_ready(1), BRAKE_X, dt
        )
        self.speed_v, self.v = self._axis(
            self.speed_v, self.v, vertical, powered[1] and self.drive_ready(2) and hydraulic, BRAKE_V, dt
        )
        self._stops()
        if mandrel and hydraulic and self.fault != MANDREL_STUCK:
            self._move_mandrel(mandrel, dt)
        if self.winding:
            self.coil += self.growth * dt
        self._saddles(dt)
        if self.hit is Hit.NONE:
            self.look_for_a_hit()

    def _axis(
        self, speed: float, position: float, target: float, powered: bool, brake: float, dt: float
    ) -> tuple[float, float]:
        change = (FOLLOWS if powered else brake) * dt
        wanted = target if powered else 0.0
        after = min(max(wanted, speed - change), speed + change)
        return after, position + (speed + after) / 2 * dt

    def _stops(self) -> None:
        measures = self.geometry
        for position, low, high in (
            (self.x, -STOP_X, measures.travel + STOP_X),
            (self.v, -STOP_V, measures.lift + STOP_V),
        ):
            if low <= position <= high:
                continue
            if self.hit is Hit.NONE:
                self.hit = Hit.END_STOP
        self.x = min(max(self.x, -STOP_X), measures.travel + STOP_X)
        self.v = min(max(self.v, -STOP_V), measures.lift + STOP_V)

    def _hydraulics(self, dt: float) -> None:
        aim, lag = (PRESSURE, PRESSURE_UP) if self.pump else (0.0, PRESSURE_DOWN)
        if self.fault == PRESSURE_LOW:
            aim, lag = LOW_PRESSURE, PRESSURE_LEAK
        self.pressure = self.held.get("pressure", self.pressure + (aim - self.pressure) * min(1.0, dt / lag))
        warmth = COLD if self.fault == OIL_COLD else OIL
        self.oil = self.held.get("oil_temperature", self.oil + (warmth - self.oil) * min(1.0, dt / OIL_LAG))

    def _move_mandrel(self, way: int, dt: float) -> None:
        before = self.expansion
        after = self.expansion = min(1.0, max(0.0, before + way * dt / MANDREL_TIME))
        measures = self.geometry
        if before > 0.0 and after <= 1e-9:
            self.expansion = 0.0
            if self.coil:
                if self.contact:
                    self.load = self.coil
                elif self.hit is Hit.NONE:
                    self.hit = Hit.DROPPED
                self.coil, self.winding, self.finished = 0.0, False, False
        elif before < 1.0 and after >= 1.0 - 1e-9:
            self.expansion = 1.0
            around = abs(self.x - measures.mandrel_position) <= CORRIDOR
            if self.load and around and abs(self.v - measures.contact(self.load)) <= TOUCH:
                self.coil, self.load, self.finished = self.load, 0.0, True

    def _saddles(self, dt: float) -> None:
        measures = self.geometry
        for number, there in enumerate(self.saddles, 1):
            if abs(self.x - measures.saddle(number)) <= CORRIDOR:
                if self.load and not there and self.v <= measures.saddle_height:
                    self.saddles[number - 1], self.load = self.load, 0.0
                    self.laid[number - 1] = 0.0
                    continue
                if there and not self.load and self.v > measures.saddle_height:
                    self.load, self.saddles[number - 1] = there, 0.0
                    continue
            if there:
                self.laid[number - 1] += dt

    def below(self, number: int) -> bool:
        """Whether the table is so near to the coil on saddle `number` that the crane must not lift it."""
        measures = self.geometry
        reach = (measures.coil_width + measures.table_width) / 2 + MARGIN
        near = abs(self.x - measures.saddle(number)) < (reach if not self.load else measures.coil_width + MARGIN)
        return near and self.v > measures.saddle_height - 2 * RISE

    # ---- collisions

    def obstacles(self) -> list[Obstacle]:
        """Where the car cannot be now without touching something."""
        measures, inf_, out = self.geometry, inf, []
        half = measures.coil_width / 2
        middle = measures.mandrel_position
        if self.load:
            if self.coil:
                out.append(Obstacle(-inf_, middle + 2 * half, -inf_, inf_, Hit.COIL_ON_MANDREL))
            centre = measures.contact(self.load)
            slack = (measures.eye_diameter - measures.collapsed_diameter) / 2 * (1 - self.expansion) + PRESSED
            end = measures.mandrel_reach + half
            if self.expansion >= 1.0:
                out.append(Obstacle(-inf_, end, -inf_, inf_, Hit.MANDREL))
            out.append(Obstacle(-inf_, end, -inf_, centre - slack, Hit.MANDREL))
            out.append(Obstacle(-inf_, end, centre + slack, inf_, Hit.MANDREL))
            for number, there in enumerate(self.saddles, 1):
                at = measures.saddle(number)
                if there:
                    top = measures.saddle_height + there
                    out.append(Obstacle(at - 2 * half, at + 2 * half, -inf_, top, Hit.COIL_ON_SADDLE))
                else:
                    reach, seat = half + measures.saddle_length / 2, measures.saddle_height
                    out.append(Obstacle(at - reach, at - CORRIDOR, -inf_, seat, Hit.SADDLE))
                    out.append(Obstacle(at + CORRIDOR, at + reach, -inf_, seat, Hit.SADDLE))
            return out
        table = measures.table_width / 2
        reach = half + table
        if self.coil:
            under = measures.contact(self.coil) + PRESSED
            out.append(Obstacle(middle - reach, middle + reach, under, inf_, Hit.COIL_ON_MANDREL))
        thick = measures.collapsed_diameter + (measures.eye_diameter - measures.collapsed_diameter) * self.expansion
        out.append(
            Obstacle(-inf_, measures.mandrel_reach + table, measures.mandrel_height - thick / 2, inf_, Hit.MANDREL)
        )
        for number, there in enumerate(self.saddles, 1):
            at = measures.saddle(number)
            if there:
                seat = measures.saddle_height
                out.append(Obstacle(at - reach, at - CORRIDOR, seat, inf_, Hit.COIL_ON_SADDLE))
                out.append(Obstacle(at + CORRIDOR, at + reach, seat, inf_, Hit.COIL_ON_SADDLE))
        return out

    def look_for_a_hit(self) -> None:
        """Note a collision when there is one now."""
        for one in self.obstacles():
            if one.left < self.x < one.right and one.low < self.v < one.high:
                self.hit = Hit(one.kind)
                return
