"""What moves in the coil car's line in a scan: what is asked, how far it may go, what drives it, and what is told of it."""

from collections.abc import Sequence
from math import isnan, nan

from app.sim.coil_car.actions import ARRIVED, Demand, block_of, demand_of, is_there, jogged
from app.sim.coil_car.axis import Axis
from app.sim.coil_car.interlock import InterlockedCar
from app.sim.coil_car.recoiler import Recoiler
from app.sim.coil_car.register_map import (
    ACTIONS,
    DOWN,
    EXPAND,
    FORWARD,
    UP,
    ActionState,
    Block,
    CoilCarEvent,
    Fault,
    Mode,
)

STUCK_AFTER = 6.0
"""The mandrel must have arrived in this time [s]."""


class Movements:
    """Moves one car and its mandrel, from a power-up on."""

    def __init__(self, car: InterlockedCar, recoiler: Recoiler) -> None:
        self._car, self._recoiler = car, recoiler
        self._asked: tuple[str, ...] = ()
        """Actions that a sequence asks for in the next scan."""
        self._acting = 0
        """Number of the action of this scan."""
        self._action_since = 0
        self._mandrel_age = 0.0
        """For so long the mandrel has been driven one way [s]."""
        self._reported = (-1, 0)
        """Movement and its block, as of the last event."""

    def ask(self, actions: Sequence[str]) -> None:
        """Ask for `actions` in the next scan."""
        self._asked = (*self._asked, *actions)

    def step(self) -> None:
        """One scan."""
        car = self._car
        self._judge_cut(car.horizontal, True)
        self._judge_cut(car.vertical, False)
        demand = self._demanded()
        car.held_back = Block.FREE
        mandrel = 0
        horizontal = vertical = False
        if demand is not None:
            block = block_of(car, demand)
            if block not in (Block.FREE, Block.THERE):
                car.held_back = block
            elif demand.horizontal:
                horizontal = self._go(car.horizontal, demand)
            elif demand.movement in (UP, DOWN):
                vertical = self._go(car.vertical, demand)
            elif block is Block.FREE:
                mandrel = 1 if demand.movement == EXPAND else -1
        if not horizontal:
            car.horizontal.stop(car.dt)
            car.horizontal.target = nan
        if not vertical:
            car.vertical.stop(car.dt)
            car.vertical.target = nan
        if not mandrel:
            mandrel = self._recoiler.step()
        self._watch_mandrel(mandrel)
        car.mandrel_drive = mandrel
        self._report_block(demand)
        self._follow_action(demand)
        if car.stopping and not car.moving:
            car.stopping = False

    def _judge_cut(self, axis: Axis, horizontal: bool) -> None:
        """Brake when there is no more supply, or less room than the ramp needs."""
        car, machine = self._car, self._car.machine
        speed = machine.speed_x if horizontal else machine.speed_v
        if car.fault or axis.cut or (not horizontal and car.interlock.oil_pressure() is not Block.FREE):
            axis.ramp.reset()
            axis.cut = axis.cut and speed != 0.0
            axis.braking = False
            return
        if not speed and not axis.ramp.speed:
            return
        way = car.interlock.way(horizontal)
        here = machine.x if horizontal else machine.v
        end = here + axis.ramp.stop_distance()
        if not way.low - 1 <= end <= way.high + 1:
            axis.cut = True
            axis.ramp.reset()

    def _go(self, axis: Axis, demand: Demand) -> bool:
        """Move; False when there is nothing to move."""
        car, machine = self._car, self._car.machine
        here = machine.x if demand.horizontal else machine.v
        way, up = car.interlock.way(demand.horizontal), demand.movement in (FORWARD, UP)
        end = way.high if up else way.low
        if not isnan(demand.target):
            end = min(max(demand.target, way.low), way.high)
        axis.target = end
        standing = car.horizontal_standstill if demand.horizontal else car.vertical_standstill
        if axis.cut or (standing and abs(end - here) <= ARRIVED):
            return False
        axis.go(1 if up else -1, demand.speed, (end - here) * (1 if up else -1), car.dt)
        return True

    def _demanded(self) -> Demand | None:
        car = self._car
        asked, self._asked = self._asked, ()
        self._acting = 0
        if car.mode is Mode.MANUAL and not car.stopping:
            return jogged(car)
        if car.mode is Mode.AUTOMATIC and not car.stopping:
            for name in asked:
                if name in ACTIONS:
                    self._acting = ACTIONS.index(name) + 1
                    return demand_of(car, name)
        return None

    def _watch_mandrel(self, mandrel: int) -> None:
        car = self._car
        if mandrel and mandrel == car.mandrel_drive:
            self._mandrel_age += car.dt
            if self._mandrel_age > STUCK_AFTER and not car.fault:
                car.event(CoilCarEvent.MANDREL_STUCK)
                car.trip(Fault.MANDREL)
        else:
            self._mandrel_age = 0.0

    def _report_block(self, demand: Demand | None) -> None:
        if demand is None:
            self._reported = (-1, 0)
            return
        held_back = self._car.held_back
        now = (demand.movement, int(held_back))
        if now != self._reported:
            self._reported = now
            if held_back is not Block.FREE:
                self._car.event(CoilCarEvent.INTERLOCK, demand.movement + 1, float(held_back))

    def _follow_action(self, demand: Demand | None) -> None:
        car = self._car
        if self._acting != car.action:
            car.action, self._action_since = self._acting, car.time
            car.action_state = ActionState.RUNNING if car.action else ActionState.NONE
            if car.action:
                car.event(CoilCarEvent.ACTION_BEGUN, car.action)
        if not car.action or demand is None:
            return
        if car.held_back is not Block.FREE:
            car.action_state = ActionState.BLOCKED
        elif is_there(car, demand):
            if car.action_state is not ActionState.DONE:
                car.action_state = ActionState.DONE
                car.event(CoilCarEvent.ACTION_DONE, car.action, (car.time - self._action_since) / 1e6)
        else:
            car.action_state = ActionState.RUNNING
