"""What the crane's PLC tells of its crane: everything that has changed since the last scan, as events."""

from app.blocks.drive_control import DriveAlarm
from app.blocks.limit_switches import End, LimitAlarm
from app.sim.crane.plc_axis import HOT, Motor
from app.sim.crane.register_map import DRIVE_EVENTS, CraneEvent, SafetyTrip
from app.sim.crane.state import CraneView

_PAIRS = (
    ("emergency", CraneEvent.EMERGENCY_STOP, CraneEvent.EMERGENCY_STOP_OFF),
    ("overload", CraneEvent.OVERLOAD, CraneEvent.OVERLOAD_OVER),
    ("rope_overlap", CraneEvent.ROPE_OVERLAP, CraneEvent.ROPE_OVERLAP_OVER),
    ("slack_rope", CraneEvent.SLACK_ROPE, CraneEvent.SLACK_ROPE_OVER),
    ("scale_ok", CraneEvent.SCALE_BACK, CraneEvent.SCALE_FAULT),
    ("host_silent", CraneEvent.HOST_SILENT, CraneEvent.HOST_BACK),
)
_LIMITS = {
    LimitAlarm.STOP_HIT: CraneEvent.STOP_HIT,
    LimitAlarm.SLOW_FAILED: CraneEvent.SWITCH_FAILED,
    LimitAlarm.STOP_FAILED: CraneEvent.SWITCH_FAILED,
    LimitAlarm.SWITCH_STUCK: CraneEvent.SWITCH_STUCK,
}


class Edges:
    """What was seen of one crane in the last scan."""

    def __init__(self, crane: CraneView) -> None:
        self._crane = crane
        self._facts: tuple[bool, ...] = ()
        self._load: tuple[bool, int] = (False, 0)
        self._alarms: dict[int, frozenset[DriveAlarm]] = {}
        self._hot: dict[int, bool] = {}
        self._limits: dict[str, frozenset[tuple[End, LimitAlarm]]] = {}
        self._encoders: dict[str, bool] = {}
        self._safety = False

    def take_stock(self) -> None:
        """What is so now is not news."""
        crane = self._crane
        self._facts = tuple(bool(getattr(crane, name)) for name, _, _ in _PAIRS)
        self._load = (crane.load.locked, crane.load.stand)
        self._safety = crane.safety_brake
        for axis in crane.axes.values():
            self._encoders[axis.name] = axis.encoder_ok
            self._limits[axis.name] = frozenset(axis.limits.active)
            for motor in axis.motors:
                self._alarms[motor.number] = frozenset(motor.control.alarms)
                self._hot[motor.number] = motor.temperature >= HOT

    def look(self) -> None:
        """Tell what has changed since the last scan."""
        crane = self._crane
        facts = tuple(bool(getattr(crane, name)) for name, _, _ in _PAIRS)
        if facts != self._facts:
            for (name, rise, fall), before, now in zip(_PAIRS, self._facts, facts, strict=True):
                if before != now:
                    crane.event(rise if now else fall, 0, crane.weight if name == "overload" else 0.0)
            self._facts = facts
        if crane.safety_brake != self._safety:
            self._safety = crane.safety_brake
            if self._safety:
                self.tell_safety_brake()
        self._look_at_load()
        for number, axis in enumerate(crane.axes.values(), 1):
            if axis.encoder_ok != self._encoders[axis.name]:
                self._encoders[axis.name] = axis.encoder_ok
                crane.event(CraneEvent.ENCODER_BACK if axis.encoder_ok else CraneEvent.ENCODER_FAULT, number)
            for motor in axis.motors:
                self._look_at_motor(motor)
            if any(axis.limits.alarms.values()) or self._limits[axis.name]:
                active = frozenset(axis.limits.active)
                said = set()
                for end, alarm in axis.limits.active:
                    what = (_LIMITS[alarm], 2 * number - (end is End.LOW))
                    if (end, alarm) not in self._limits[axis.name] and what not in said:
                        said.add(what)
                        crane.event(*what, axis.position)
                self._limits[axis.name] = active

    def tell_safety_brake(self) -> None:
        """Why the safety brakes have fallen in."""
        why = self._crane.safety_trip
        code = CraneEvent.SAFETY_BRAKE_STOP if why is SafetyTrip.EMERGENCY_STOP else CraneEvent.SAFETY_BRAKE
        self._crane.event(code, why)

    def _look_at_motor(self, motor: Motor) -> None:
        number, alarms, hot = motor.number, motor.control.alarms, motor.temperature >= HOT
        if alarms != self._alarms[number]:
            for alarm in DriveAlarm:
                if alarm in alarms and alarm not in self._alarms[number]:
                    self._crane.event(DRIVE_EVENTS[alarm], number)
            self._alarms[number] = frozenset(alarms)
        if hot != self._hot[number]:
            self._hot[number] = hot
            self._crane.event(CraneEvent.HOT if hot else CraneEvent.COOL, number, motor.temperature)

    def _look_at_load(self) -> None:
        load = self._crane.load
        now = (load.locked, load.stand)
        if now == self._load:
            return
        locked, stand = self._load
        self._load = now
        if load.locked and not locked:
            self._crane.event(CraneEvent.LOCKED, load.at)
        if stand and not load.stand:
            self._crane.event(CraneEvent.LIFTED, stand, load.weight)
        elif load.stand and not stand:
            self._crane.event(CraneEvent.SET_DOWN, load.stand, load.weight)
        if locked and not load.locked:
            self._crane.event(CraneEvent.UNLOCKED, load.at)
