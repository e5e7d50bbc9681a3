"""What the crane's PLC knows of its crane: mode, load, axes, what is permitted; what happens to it is decided in `program`."""

from collections.abc import Mapping, Sequence
from math import isnan

from app.blocks.arc_positioner.circle import Point
from app.sim.crane import training
from app.sim.crane.configuration import Places
from app.sim.crane.ladle import FULL, Load
from app.sim.crane.plc_axis import PlcAxis
from app.sim.crane.register_map import CraneState as State
from app.sim.crane.register_map import DriveChoice, Mode, SafetyTrip, StepState
from app.sim.crane.sequence import CraneSequence, Cycle
from app.sim.crane.travel import Travel
from app.sim.plc import VirtualPlc


class CraneView(VirtualPlc):
    """State of one crane."""

    places: Places
    axes: Mapping[str, PlcAxis]
    load: Load
    travel: Travel
    sequence: CraneSequence
    mode: Mode
    speed_step: int
    drives_selected: DriveChoice
    path_mode: int
    cycles_done: int
    cycles_aborted: int
    fault: int
    """Code of the instructor's fault."""
    latched: bool
    """An emergency stop was pressed and not yet reset."""
    stopping: bool
    """A stop is not over."""
    weight: float
    """What the scale says [t]; NaN while it is bad."""

    @property
    def cycle(self) -> Cycle:
        """The last one."""
        return self.sequence.cycle

    @property
    def emergency(self) -> bool:
        """The button is pressed."""
        return self.fault == training.EMERGENCY_STOP

    @property
    def safety_brake(self) -> bool:
        """It has fallen in."""
        return self.axes["hoist"].axis.safety_brake

    @property
    def safety_trip(self) -> SafetyTrip:
        """Why it has."""
        return self.axes["hoist"].safety_trip

    @property
    def held(self) -> bool:
        """Nothing moves before a reset."""
        return self.latched or self.safety_brake

    @property
    def moving(self) -> bool:
        """An axis moves, or its brakes are held open."""
        return any(axis.moving for axis in self.axes.values())

    @property
    def scale_ok(self) -> bool:
        return not isnan(self.weight)

    @property
    def overload(self) -> bool:
        """More hangs on the hook than it may carry; unknown is not more."""
        return self.weight > self.settings["overload_limit"]

    @property
    def rope_overlap(self) -> bool:
        return self.fault == training.ROPE_OVERLAP

    @property
    def slack_rope(self) -> bool:
        return self.fault == training.SLACK_ROPE

    @property
    def weight_asked(self) -> bool:
        """A person has to confirm what the scale says."""
        return self.cycle.state is StepState.WAITING

    @property
    def load_part(self) -> float:
        """What hangs on the rope, as the PLC knows it [1 = full load]."""
        return 0.0 if isnan(self.weight) else min(self.weight, FULL) / FULL

    @property
    def load_at(self) -> Point:
        """Where the load is, by encoders and scale [mm]."""
        return self.travel.load_at

    @property
    def facts(self) -> Mapping[str, bool]:
        """Bits of the status image by name."""
        cycle = self.cycle
        return {
            "moving": self.moving,
            "emergency_stop": self.emergency,
            "scale_ok": self.scale_ok,
            "overload": self.overload,
            "rope_overlap": self.rope_overlap,
            "slack_rope": self.slack_rope,
            "locked": self.load.locked,
            "loaded": self.load.stand == 0,
            "weight_asked": self.weight_asked,
            "weight_confirmed": not isnan(cycle.confirmed),
            "weight_fits": cycle.fits,
            "cycle_open": cycle.open,
            "held": self.held,
            "host_silent": self.host_silent,
            "safety_brake": self.safety_brake,
            "emergency_latched": self.latched,
        }

    @property
    def start_permissives(self) -> Mapping[str, bool]:
        """What a cycle needs to start and to go on, by name."""
        axes = self.axes.values()
        return {
            "emergency_ok": not self.emergency,
            "acknowledged": not self.held,
            "drives_ok": all(axis.drives_ok for axis in axes),
            "encoders_ok": all(axis.encoder_ok for axis in axes),
            "limits_ok": not any(axis.limits.active for axis in axes),
            "scale_ok": self.scale_ok,
            "rope_ok": not (self.rope_overlap or self.slack_rope),
            "not_overloaded": not self.overload,
            "host_heard": not self.host_silent,
            "standstill": not self.moving,
        }

    def permissives(self, axis: PlcAxis) -> tuple[Sequence[bool], Sequence[bool]]:
        """Bits of both directions of an axis, in the order of the map."""
        safe = not self.emergency and not self.held
        up, down = axis.allowed.high > 0, axis.allowed.low > 0
        if axis.name != "hoist":
            rest = (axis.allowed.healthy, safe, axis.drives_ok)
            return (up, *rest), (down, *rest)
        every = (bool(axis.active), axis.allowed.healthy, safe, axis.drives_ok)
        return (
            (up, self.scale_ok, not self.overload, not self.rope_overlap, *every),
            (down, not self.slack_rope, *every),
        )

    @property
    def state(self) -> int:
        """State word."""
        if self.emergency or self.latched:
            return State.EMERGENCY_STOP
        if self.held:
            return State.HELD
        if self.stopping:
            return State.STOPPING
        if self.mode is Mode.AUTOMATIC:
            if self.cycle.runs:
                return State.RUNNING
            return State.SUSPENDED if self.cycle.open else State.AUTOMATIC
        if self.mode is Mode.MANUAL:
            return State.MANUAL_MOVING if self.moving else State.MANUAL
        return State.OFF
