"""What is asked of the coil car, by hand or by a sequence, as a movement with an end; whether it can be done, and when it is."""

from dataclasses import dataclass
from math import isnan, nan

from app.sim.coil_car.interlock import InterlockedCar
from app.sim.coil_car.register_map import BACK, COLLAPSE, DOWN, EXPAND, FORWARD, GEOMETRY, UP, Block

ARRIVED = 1.0
"""A positioned axis is there [mm]."""


@dataclass(frozen=True, slots=True)
class Demand:
    """What is asked: a movement, and where an axis shall end."""

    movement: int
    speed: float = 0.0
    target: float = nan
    """NaN = as far as it may."""
    block: Block = Block.FREE
    """It makes no sense now."""

    @property
    def horizontal(self) -> bool:
        """Of the car, not of its table."""
        return self.movement in (FORWARD, BACK)


def jogged(car: InterlockedCar) -> Demand | None:
    """Of hold-to-run; two bits at a time are none."""
    bits = car.hold & (1 << EXPAND + 2) - 1
    if not bits or bits & bits - 1:
        return None
    movement = bits.bit_length() - 1
    return Demand(movement, car.values["manual_horizontal" if movement in (FORWARD, BACK) else "manual_vertical"])


def demand_of(car: InterlockedCar, action: str) -> Demand:
    """Of an action (`ACTIONS`)."""
    machine, m = car.machine, car.geometry
    if action == "expand":
        return Demand(EXPAND)
    if action == "collapse":
        return Demand(COLLAPSE)
    if action == "lift_to_coil" and not (machine.coil or machine.load):
        return Demand(UP, block=Block.COIL_THERE)
    target = {
        "lower": 0.0,
        "drive_to_mandrel": m.mandrel_position,
        "lift_to_coil": m.contact(machine.coil or machine.load),
        "drive_out": m.out_position,
        "lift_over_saddle": m.saddle_height + m.clearance,
        "drive_to_saddle": m.saddle(car.target),
        "lower_onto_saddle": m.saddle_height - m.clearance,
    }[action]
    if action.startswith("drive"):
        return Demand(FORWARD if target >= machine.x else BACK, car.values["automatic_horizontal"], target)
    return Demand(UP if target >= machine.v else DOWN, car.values["automatic_vertical"], target)


def block_of(car: InterlockedCar, demand: Demand) -> Block:
    """Why it cannot be done; an axis that can go on for a part of its way, but not to the end, is blocked as well."""
    if demand.block:
        return demand.block
    block = car.interlock.block(demand.movement)
    if demand.movement >= EXPAND or isnan(demand.target) or _oversees(block):
        return block
    here = car.machine.x if demand.horizontal else car.machine.v
    if abs(demand.target - here) <= ARRIVED:
        return Block.THERE
    way = car.interlock.way(demand.horizontal)
    if demand.target > way.high + ARRIVED:
        return way.above
    if demand.target < way.low - ARRIVED:
        return way.below
    return Block.FREE


def is_there(car: InterlockedCar, demand: Demand) -> bool:
    """It is done."""
    machine = car.machine
    if demand.movement == EXPAND:
        return machine.expansion >= 1.0
    if demand.movement == COLLAPSE:
        return machine.expansion <= 0.0
    here, standing = (
        (machine.x, car.horizontal_standstill) if demand.horizontal else (machine.v, car.vertical_standstill)
    )
    return standing and abs(demand.target - here) <= ARRIVED


def _oversees(block: Block) -> bool:
    """A block that has nothing to do with how far it may go."""
    return block is not Block.FREE and block not in GEOMETRY and block not in (Block.LIMIT, Block.WINDING)
