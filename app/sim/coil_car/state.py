"""What the coil car's PLC knows of its line: what is set, where the car is and whether it stands, where it shall go."""

from collections.abc import Mapping

from app.sim.coil_car.axis import Axis
from app.sim.coil_car.machine import CoilCar, Geometry
from app.sim.coil_car.register_map import SADDLES, ActionState, Block, CoilCarState, Fault, Mode
from app.sim.plc import VirtualPlc

DEPTH = 0.5
"""What a position may lie inside an obstacle of the interlock before it counts [mm]."""


class CarState(VirtualPlc):
    """State of one line; what happens to it is decided in `program`."""

    geometry: Geometry
    interlocks: bool = True
    """Only a test that wants to see collisions switches them off."""
    machine: CoilCar
    """The line as it really is; only tests and screens of the class room look here."""
    mode: Mode
    fault: Fault
    action: int
    """Number in `ACTIONS`, from 1; 0 = none."""
    action_state: ActionState
    target_selected: int
    coils_done: int
    coils_wound: int
    target: int
    """Saddle."""
    horizontal: Axis
    vertical: Axis
    mandrel_drive: int
    """Way that the mandrel is driven now: 1 expands, −1 collapses."""
    held_back: Block
    """What holds back what is asked now."""
    stopping: bool
    """A stop is not over."""
    preset_diameter: float
    """Of the coils that presets put [mm]."""

    @property
    def values(self) -> Mapping[str, float]:
        """Settings in effect, by name."""
        return self.settings

    def trip(self, fault: Fault) -> None:
        """Brakes on, mode off, until a reset."""
        self.fault, self.mode = fault, Mode.OFF
        self.machine.winding = False

    def choose_target(self) -> None:
        """The saddle that is selected, else the farthest that a coil can be laid on."""
        machine, measures = self.machine, self.geometry
        if self.target_selected:
            self.target = self.target_selected
            return
        # Who stands at a saddle is at it, also when the coil lies there: the next target is that of who drives away.
        if self.target and (self.is_free(self.target) if machine.load else self.is_at(measures.saddle(self.target))):
            return
        free = [n for n in (1, 2, 3) if self.is_free(n)]
        self.target = free[0] if free else 1

    def is_free(self, number: int) -> bool:
        """Whether a coil can be laid on saddle `number`: it is empty and so are those before it."""
        return number > 0 and not any(self.machine.saddles[n - 1] for n in range(number, SADDLES + 1))

    def can_lay(self) -> bool:
        """Whether there is a saddle for the coil on the car, or for the next one."""
        if self.machine.load or self.target_selected:
            return self.is_free(self.target)
        return self.is_free(SADDLES)

    def is_at(self, position: float) -> bool:
        """The car is at `position` [mm]."""
        return abs(self.machine.x - position) <= self.geometry.position_tolerance + DEPTH

    @property
    def horizontal_standstill(self) -> bool:
        """The car stands."""
        return not (self.machine.speed_x or self.horizontal.ramp.speed or self.horizontal.ramp.acceleration)

    @property
    def vertical_standstill(self) -> bool:
        """Its table stands."""
        return not (self.machine.speed_v or self.vertical.ramp.speed or self.vertical.ramp.acceleration)

    @property
    def moving(self) -> bool:
        """Whether anything of the car or the mandrel moves."""
        return not (self.horizontal_standstill and self.vertical_standstill and not self.mandrel_drive)

    @property
    def state(self) -> int:
        """State word."""
        if self.machine.emergency_stop or self.fault is Fault.EMERGENCY_STOP:
            return CoilCarState.EMERGENCY_STOP
        if self.fault:
            return CoilCarState.HELD
        moving = self.moving
        if self.mode is Mode.AUTOMATIC and not self.stopping:
            return CoilCarState.AUTOMATIC_MOVING if moving else CoilCarState.AUTOMATIC
        if self.mode is Mode.MANUAL and not self.stopping:
            return CoilCarState.MANUAL_MOVING if moving else CoilCarState.MANUAL
        return CoilCarState.STOPPING if moving else CoilCarState.OFF
