"""What must hold in a crane after every scan, whatever was done to it."""

from app.profidrive.words import Status
from app.sim.crane import training as own
from app.sim.crane.configuration import AXES
from app.sim.crane.program import VirtualCrane

CREEP: dict[str, float] = {"hoist": 30.0, "trolley": 120.0, "bridge": 120.0}
"""Farthest beyond a stop switch from the slow speed, a trip and its brake's way included [mm]."""
SWITCH_FAULTS = range(own.STOP_DEAD, own.SLOW_DEAD + 6)


class Guard:
    """Looks at one crane; `look` after every scan of its PLC."""

    def __init__(self, crane: VirtualCrane) -> None:
        self.crane = crane
        self.moved = 0.0
        """Of all axes [mm]."""
        self.dead: set[int] = set()
        """Switches that ever did not answer."""
        self.before = {name: axis.axis.position for name, axis in crane.axes.items()}
        self.held = {name: True for name in AXES}
        self.speed = dict.fromkeys(AXES, 0.0)
        self.stopped = False
        self.against = dict.fromkeys(AXES, 0.0)
        self.status = dict.fromkeys(range(1, 5), 0)

    def look(self) -> None:
        crane = self.crane
        if crane._since:  # not a scan of the program
            return
        if crane.fault in SWITCH_FAULTS:
            self.dead.add(crane.fault)
        for name, axis in crane.axes.items():
            mechanics = axis.axis
            self.moved += abs(mechanics.position - self.before[name])
            opened = [motor.out.open_brakes for motor in axis.active]
            for motor in axis.motors:
                if motor.out.open_brakes:
                    assert self.status[motor.number] & Status.OPERATION_ENABLED, f"{name}: no torque"
                self.status[motor.number] = motor.drive.status
                if motor.out.setpoint and axis.running:
                    assert all(axis.brakes_open) and all(opened), f"{name}: a reference with a closed brake"
                    assert motor.selected and not motor.control.alarms, name
                    assert axis.setpoint * motor.out.setpoint > 0, name
            if mechanics.held and self.held[name]:
                assert abs(mechanics.speed) <= abs(self.speed[name]) + 1e-9, f"{name}: speeds up against its brake"
            self.held[name], self.speed[name] = mechanics.held, mechanics.speed
            pulls = axis.running and axis.setpoint != 0 and mechanics.held
            self.against[name] = self.against[name] + crane._dt if pulls else 0.0
            assert self.against[name] <= 0.1, f"{name}: the drive pulls against its brake"
            assert abs(mechanics.speed) < 1.25 * axis.max_speed, f"{name}: falls"
            self.look_at_ends(name)
        self.before = {name: axis.axis.position for name, axis in crane.axes.items()}
        if self.stopped:
            assert not any(axis.setpoint for axis in crane.axes.values()), "goes on after an emergency stop"
        self.stopped = crane.emergency or crane.held

    def look_at_ends(self, name: str) -> None:
        crane, number = self.crane, AXES.index(name)
        axis, places = crane.axes[name], crane.places
        for n, at in enumerate((f"{name}_lower_stop_at", f"{name}_upper_stop_at")):
            place = getattr(places, at)
            beyond = axis.axis.position - place if n else place - axis.axis.position
            room = CREEP[name]
            if own.STOP_DEAD + 2 * number + n in self.dead:
                room += axis.limits.places.tolerance + axis.max_speed
            if own.SLOW_DEAD + 2 * number + n in self.dead:
                room += axis.max_speed**2 / axis.axis.data.deceleration + axis.max_speed
            assert beyond <= room, f"{name} is {beyond:g} mm beyond {at}"
