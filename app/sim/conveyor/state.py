"""What the conveyor's PLC knows of its line, as its images show it."""

from dataclasses import dataclass

from app.blocks import product_tracking as tracking
from app.blocks.mode_control import Mode, ModeControl
from app.blocks.product_tracking import ProductTracking
from app.sim.conveyor.belt import Belt
from app.sim.conveyor.machine import Conveyor, Geometry
from app.sim.conveyor.register_map import ConveyorState
from app.sim.plc import VirtualPlc


@dataclass(slots=True)
class FirstOut:
    """What stopped the line first."""

    code: int = 0
    source: int = 0
    rear: int = 0
    front: int = 0
    time: int = 0
    value: float = 0.0
    ended: int = 0
    """When it ended by itself; 0 = it has not."""


class LineState(VirtualPlc):
    """State of one line; what happens to it is decided in `program`."""

    geometry: Geometry
    line: tracking.LineLayout
    machine: Conveyor
    """The line as it really is; only tests and screens of the class room look here."""
    tracking: ProductTracking
    belts: tuple[Belt, ...]
    modes: ModeControl
    first_out: FirstOut
    _next_out: FirstOut
    """What stops the line, too; first when a gap stop has ended by itself."""
    moving: bool
    pressed: bool
    """The emergency stop is."""
    _stopping: bool
    _held: bool
    """After an emergency stop, until reset."""
    _faulty: bool
    _direction: int

    @property
    def state(self) -> int:
        """State word."""
        if self._held:
            return ConveyorState.EMERGENCY_STOP
        if self._faulty:
            return ConveyorState.FAULT
        if self.tracking.gap_stop:
            return ConveyorState.GAP
        if self._stopping:
            return ConveyorState.STOPPING
        if self.modes.mode is Mode.AUTOMATIC:
            return ConveyorState.AUTOMATIC if all(belt.target for belt in self.belts) else ConveyorState.WAITING
        if self.moving:
            return ConveyorState.MANUAL if self._direction else ConveyorState.STOPPING
        return ConveyorState.STOPPED

    @property
    def stop_active(self) -> bool:
        """Something holds the line, or is about to."""
        return self._stopping or self._held or self._faulty
