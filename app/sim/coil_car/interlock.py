"""What holds the coil car back: obstacles that its positions must keep away from, the way that is left, and why a movement is blocked."""

from dataclasses import dataclass
from math import inf

from app.sim.coil_car.machine import BRAKE_X, CORRIDOR, LOWERED, MARGIN, RISE, TOUCH, Obstacle
from app.sim.coil_car.register_map import BACK, DOWN, EXPAND, FORWARD, UP, WIND, Block
from app.sim.coil_car.state import DEPTH, CarState

AT_REST = 1.0
"""A movement that has less room than this is blocked [mm]."""
IMPLAUSIBLE = 3.0
"""A limit switch contradicts the position by more than this [mm]."""


@dataclass(frozen=True, slots=True)
class Way:
    """How far an axis may go [mm], and what is at both ends."""

    low: float
    high: float
    below: Block
    above: Block


class Interlock:
    """Judges for one car; what it found holds until something has moved."""

    def __init__(self, car: CarState) -> None:
        self._car = car
        self._blocks: dict[int, Block] = {}
        self._rectangles: list[Obstacle] | None = None

    def renew(self) -> None:
        """What was judged before does not hold any more."""
        self._blocks.clear()
        self._rectangles = None

    def way(self, horizontal: bool) -> Way:
        """How far an axis may go while the other stands where it is."""
        machine, m = self._car.machine, self._car.geometry
        here, across = (machine.x, machine.v) if horizontal else (machine.v, machine.x)
        low, high = 0.0, m.travel if horizontal else m.lift
        below = above = Block.END
        for one in self._obstacles() if self._car.interlocks else ():
            begin, end, first, last = one.left, one.right, one.low, one.high
            if not horizontal:
                begin, end, first, last = first, last, begin, end
            if not first + DEPTH < across < last - DEPTH:
                continue
            if begin + DEPTH < here < end - DEPTH:
                return Way(here, here, Block(one.kind), Block(one.kind))
            if end - DEPTH <= here:
                if end > low:
                    low, below = end, Block(one.kind)
            elif begin < high:
                high, above = begin, Block(one.kind)
        first_switch, second_switch = (1, 2) if horizontal else (4, 3)
        if machine.limit(first_switch) and here > low and not machine.limit_expected(first_switch, -IMPLAUSIBLE):
            low, below = here, Block.LIMIT
        if machine.limit(second_switch) and here < high and not machine.limit_expected(second_switch, -IMPLAUSIBLE):
            high, above = here, Block.LIMIT
        return Way(min(low, here), max(high, here), below, above)

    def block(self, movement: int) -> Block:
        """Why a movement (place in `MOVEMENTS`) cannot begin or go on now."""
        found = self._blocks.get(movement)
        if found is None:
            found = self._blocks[movement] = self._judge(movement)
        return found

    def oil_pressure(self) -> Block:
        """What the hydraulics lack."""
        machine, values = self._car.machine, self._car.values
        if machine.pressure < values["least_pressure"]:
            return Block.PRESSURE
        return Block.OIL if machine.oil < values["least_oil_temperature"] else Block.FREE

    @property
    def safety(self) -> Block:
        """What holds everything."""
        machine = self._car.machine
        if machine.emergency_stop:
            return Block.EMERGENCY_STOP
        if not all(machine.guard(n) for n in (1, 2, 3)):
            return Block.GUARD
        return Block.HELD if self._car.fault else Block.FREE

    @property
    def in_zone(self) -> bool:
        """The car is, or comes to a stop, where the mandrel matters to it."""
        machine = self._car.machine
        nearest = machine.x + min(0.0, self._car.horizontal.ramp.stop_distance(), -_braking(machine.speed_x))
        return nearest < self._car.geometry.free_from + DEPTH

    def plausible(self, number: int) -> bool:
        """Whether a limit switch agrees with the position."""
        machine = self._car.machine
        if machine.limit(number):
            return machine.limit_expected(number, -IMPLAUSIBLE)
        return not machine.limit_expected(number, IMPLAUSIBLE)

    def _obstacles(self) -> list[Obstacle]:
        """Of this scan."""
        if self._rectangles is None:
            self._rectangles = self._around()
        return self._rectangles

    def _around(self) -> list[Obstacle]:
        """Positions that the interlock keeps the car away from; `kind` is the block."""
        machine, m = self._car.machine, self._car.geometry
        half, near = m.coil_width / 2, m.position_tolerance
        free, middle = m.free_from, m.mandrel_position
        out: list[Obstacle] = []
        if machine.load:
            if machine.coil:
                out.append(Obstacle(-inf, free, -inf, inf, Block.COIL))
            elif machine.mandrel:
                out.append(Obstacle(-inf, free, -inf, inf, Block.NOT_COLLAPSED))
            else:
                centre, slack = m.contact(machine.load), (m.eye_diameter - m.collapsed_diameter) / 5
                out.append(Obstacle(-inf, free, -inf, centre - slack, Block.IN_THE_EYE))
                out.append(Obstacle(-inf, free, centre + slack, inf, Block.IN_THE_EYE))
            for n, there in enumerate(machine.saddles, 1):
                at = m.saddle(n)
                if there:
                    reach = m.coil_width + MARGIN
                    out.append(Obstacle(at - reach, at + reach, -inf, m.saddle_height + there + RISE, Block.COIL))
                else:
                    reach, seat = half + m.saddle_length / 2 + MARGIN, m.saddle_height + RISE
                    out.append(Obstacle(at - reach, at - near, -inf, seat, Block.SADDLE))
                    out.append(Obstacle(at + near, at + reach, -inf, seat, Block.SADDLE))
            return out
        out.append(Obstacle(-inf, middle - near, LOWERED, inf, Block.NOT_LOWERED))
        out.append(Obstacle(middle + near, free, LOWERED, inf, Block.NOT_LOWERED))
        if machine.winding:
            top, block = LOWERED, Block.WINDING
        elif machine.coil:
            top, block = m.contact(machine.coil) + TOUCH - 1, Block.COIL
        else:
            top, block = m.mandrel_height - m.eye_diameter / 2 - CORRIDOR, Block.MANDREL
        wide = near + 2 * DEPTH  # overlaps its neighbours, so that no position lies between them
        out.append(Obstacle(middle - wide, middle + wide, top, inf, block))
        reach = (m.coil_width + m.table_width) / 2 + MARGIN
        for n, there in enumerate(machine.saddles, 1):
            if there:
                at, seat = m.saddle(n), m.saddle_height - RISE
                out.append(Obstacle(at - reach, at - near, seat, inf, Block.COIL))
                out.append(Obstacle(at + near, at + reach, seat, inf, Block.COIL))
        return out

    def _judge(self, movement: int) -> Block:
        machine = self._car.machine
        safety = self.safety
        if safety is not Block.FREE:
            return safety
        if movement in (FORWARD, BACK):
            if not machine.drive_ready(1):
                return Block.DRIVE
            if not self._car.vertical_standstill or (self._car.mandrel_drive and self.in_zone):
                return Block.OTHER_MOVEMENT
        elif movement in (UP, DOWN):
            if not machine.drive_ready(2):
                return Block.DRIVE
            if (hydraulic := self.oil_pressure()) is not Block.FREE:
                return hydraulic
            if not self._car.horizontal_standstill or (self._car.mandrel_drive and self.in_zone):
                return Block.OTHER_MOVEMENT
        elif movement == WIND:
            return self._judge_winding()
        else:
            if (hydraulic := self.oil_pressure()) is not Block.FREE:
                return hydraulic
            return self._judge_mandrel(movement)
        way = self.way(movement in (FORWARD, BACK))
        here = machine.x if movement in (FORWARD, BACK) else machine.v
        if movement in (FORWARD, UP):
            return way.above if way.high - here < AT_REST else Block.FREE
        return way.below if here - way.low < AT_REST else Block.FREE

    def _judge_mandrel(self, movement: int) -> Block:
        machine, m = self._car.machine, self._car.geometry
        if machine.expansion >= 1.0 if movement == EXPAND else machine.expansion <= 0.0:
            return Block.THERE
        if not self._car.interlocks:
            return Block.FREE
        if machine.winding:
            return Block.WINDING
        if self.in_zone and not (self._car.horizontal_standstill and self._car.vertical_standstill):
            return Block.OTHER_MOVEMENT
        centred = abs(machine.x - m.mandrel_position) <= m.position_tolerance + DEPTH
        if movement == EXPAND:
            if machine.load and self.in_zone:
                at_height = abs(machine.v - m.contact(machine.load)) <= TOUCH - 1
                return Block.FREE if centred and at_height and not machine.coil else Block.NOT_CENTRED
            return Block.FREE
        if machine.coil and not (centred and machine.contact):
            return Block.NOT_SUPPORTED
        return Block.FREE

    def _judge_winding(self) -> Block:
        machine = self._car.machine
        if machine.winding:
            return Block.WINDING
        if machine.finished:
            return Block.COIL_THERE
        if (hydraulic := self.oil_pressure()) is not Block.FREE:
            return hydraulic
        if machine.expansion < 1.0:
            return Block.NOT_COLLAPSED if machine.coil else Block.MANDREL
        lowered = not machine.load and max(machine.v, machine.v + self._car.vertical.ramp.stop_distance()) <= LOWERED
        return Block.CAR if self._car.interlocks and self.in_zone and not lowered else Block.FREE


def _braking(speed: float) -> float:
    """Way to a stop of a car that moves back at `speed` [mm/s], not less than with its brake [mm]."""
    return speed * speed / (2 * BRAKE_X) if speed < 0 else 0.0


class InterlockedCar(CarState):
    """What the PLC knows of its line, with what holds the car back."""

    interlock: Interlock
