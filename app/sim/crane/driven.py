"""One axis as it is driven: limit switches, drive control, virtual drive, brake and motion, scan by scan."""

from dataclasses import dataclass, field

from app.blocks.drive_control import DriveControl, DriveInputs, Outputs, Times
from app.blocks.limit_switches import Allowed, LimitSwitches, Switches, SwitchPlaces
from app.profidrive.scaling import Scaling
from app.sim.crane.axis import Axis, AxisData
from app.sim.sinamics.axis_drive import VirtualDrive


@dataclass(slots=True)
class Faults:
    """What an instructor or a test does to the axis."""

    no_communication: bool = False
    emergency: bool = False
    no_permissive: bool = False
    hot: bool = False
    feedback: bool | None = None
    """What the brake's feedback says instead of the truth."""
    encoder: bool = False
    slow_dead: bool = False
    """The slow-down switches do not answer."""
    stop_dead: bool = False
    """The stop switches do not answer."""


@dataclass(slots=True)
class DrivenAxis:
    """A crane axis with everything that moves and stops it; `step` is one scan of the PLC."""

    data: AxisData
    places: SwitchPlaces
    position: float
    """Where it begins [mm]."""
    times: Times = field(default_factory=Times)
    faults: Faults = field(default_factory=Faults)
    axis: Axis = field(init=False)
    drive: VirtualDrive = field(init=False)
    control: DriveControl = field(init=False)
    limits: LimitSwitches = field(init=False)
    out: Outputs = field(init=False)
    allowed: Allowed = field(init=False)
    seen: DriveInputs = field(init=False)
    """What the drive control saw in the last scan."""

    def __post_init__(self) -> None:
        scaling = Scaling(self.data.max_speed)
        self.axis = Axis(self.data, position=self.position)
        self.drive = VirtualDrive(scaling)
        self.control = DriveControl(scaling, self.times)
        self.limits = LimitSwitches(self.places)
        self.out = self.control.safe()

    def step(self, speed: float, dt: float, *, run: bool | None = None, acknowledge: bool = False) -> Outputs:
        """One scan of `dt` [s] in which `speed` [mm/s] is asked for; `run` unless it is 0."""
        faults, axis, places = self.faults, self.axis, self.places
        low, high = (
            Switches(not faults.slow_dead and slow, not faults.stop_dead and stop)
            for slow, stop in (
                (axis.position <= places.low_slow, axis.position <= places.low_stop),
                (axis.position >= places.high_slow, axis.position >= places.high_stop),
            )
        )
        self.allowed = self.limits.step(low, high, None if faults.encoder else axis.measured, acknowledge=acknowledge)
        wanted = self.allowed.limit(speed)
        self.seen = DriveInputs(
            None if faults.no_communication else self.drive.status,
            axis.speed,
            (axis.is_open if faults.feedback is None else faults.feedback,),
            bool(wanted) if run is None else run,
            wanted,
            not faults.emergency,
            not faults.no_permissive,
            not faults.hot,
            acknowledge,
        )
        self.out = self.control.step(self.seen, dt)
        driven = self.drive.step(0 if faults.no_communication else self.out.control, self.out.setpoint, axis.speed, dt)
        axis.step(driven.setpoint, self.out.open_brakes, dt, torque=driven.torque, quick_stop=driven.quick_stop)
        return self.out
