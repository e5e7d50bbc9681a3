"""A virtual PLC that runs a ladle crane: its program, over `plc_axis`, `travel`, `sequence` and `ladle`; its registers: `register_map`.

Type code 40. The program runs every 20 ms on a circle, every 40 ms while anything else moves, else every 50 ms.

| subject | rule |
| --- | --- |
| manual | hold-to-run, one axis at a time, at the speed step that is selected |
| automatic | the sequence; hold-to-run suspends a cycle, and then moves an axis as in manual |
| stop | all axes by their ramps, mode off, a cycle is suspended |
| emergency stop | quick stop of every drive, the hoist's safety brakes fall in; latched until a reset |
| power lost | the hoist's safety brakes fall in; latched until a reset |
| alarm of a drive, limit switch, encoder, scale, rope, overload, host | suspends a cycle with its reason |
| settings | not changed while an axis moves |
"""

from collections.abc import Callable, Mapping
from math import nan

from app.blocks.arc_positioner.circle import Circle, Point
from app.blocks.arc_positioner.following import ArcPhase
from app.blocks.joystick import Joystick, Lever
from app.blocks.positioner.positioner import MovePhase
from app.plant.said import not_as, said
from app.registers import plc_map
from app.registers.plc_map import Request
from app.sim import training
from app.sim.crane import signals
from app.sim.crane import training as own
from app.sim.crane.commands import CommandedCrane
from app.sim.crane.configuration import AXES, FIRST_STAND, SETTINGS, STANDS, Places, faulty
from app.sim.crane.edges import Edges
from app.sim.crane.ladle import Load
from app.sim.crane.orders import Orders
from app.sim.crane.plc_axis import Asked, PlcAxis, Surroundings
from app.sim.crane.register_map import (
    AXIS_AT,
    AXIS_WORDS,
    CONFIGURATION,
    CONFIGURATION_WORDS,
    DRIVES,
    SETTINGS_AT,
    STAGING,
    STATUS,
    STATUS_WORDS,
    CraneEvent,
    CraneReason,
    DriveChoice,
    Mode,
    SafetyTrip,
    StepState,
    Suspension,
)
from app.sim.crane.sequence import CraneSequence, Cycle
from app.sim.crane.travel import Travel
from app.sim.plc import EVENT_CAPACITY, Image, Setting, Verdict, check_given
from app.sim.plc import rejected as no

CIRCLE, BUSY, IDLE = 2, 4, 5
"""Scans of the PLC from one of the program to the next: on a circle, while something else moves, and while nothing does."""
STARTS = {"stopped": Mode.OFF, "automatic": Mode.AUTOMATIC, "manual": Mode.MANUAL}
"""Mode that a crane may be switched on in for the first time."""
STILL = Asked()
RELEASED = dict.fromkeys(AXES, Lever(0, 1))
"""Nobody holds a lever."""


class VirtualCrane(CommandedCrane):
    """The PLC of one crane."""

    type = "crane"
    TYPE_CODE = own.TYPE_CODE

    edges: Edges
    _joystick: Joystick
    _start_mode: Mode
    _seen: StepState
    _since: int
    """Scans of the PLC since the last one of the program."""
    _dt: float
    """Of the present scan of the program [s]."""
    _period: int
    """Scans of the PLC until the next one of the program."""
    _busy: bool
    _silent: bool

    def __init__(
        self,
        places: Places | None = None,
        *,
        start: str = "stopped",
        orders: bool = False,
        pause: float = 20.0,
        ladle: float = 210.0,
        stand: int = FIRST_STAND,
        settings: Mapping[str, float] | None = None,
    ) -> None:
        """A crane just switched on for the first time, at its safe height over stand 1.

        `start`: automatic, manual or stopped; `orders`: it orders its own cycles, `pause` [s] between them; `ladle` [t] on `stand`;
        `settings`: initial setpoints by name.

        Raises:
            ValueError: a number or a setting that cannot be.
        """
        self.places = places or Places()
        if start not in STARTS:
            raise ValueError(not_as(f"start = {start}", ", ".join(STARTS)))
        for name, value, low, high in (
            ("pause", pause, 0, 3600),
            ("ladle", ladle, 0, 400),
            ("stand", stand, FIRST_STAND, STANDS),
        ):
            if not low <= value <= high:
                raise ValueError(
                    not_as(f"{name} = {value:g}", said("mistake.from_to", low=f"{low:g}", high=f"{high:g}"))
                )
        given = dict(settings or {})
        check_given(given, SETTINGS)
        initial = [Setting(s.name, given.get(s.name, s.default), s.low, s.high) for s in SETTINGS]
        if number := faulty({s.name: s.default for s in initial}, self.places):
            raise ValueError(
                said("mistake.does_not_go", name=initial[number - 1].name, value=f"{initial[number - 1].default:g}")
            )
        self._start_in, self._ladle, self._stand = STARTS[start], ladle, stand
        self.orders = Orders(self, active=orders, pause=pause)
        super().__init__(
            settings=initial,
            settings_at=SETTINGS_AT,
            staging_at=STAGING,
            images=(
                Image(STATUS, STATUS_WORDS, lambda: signals.status(self)),
                Image(CONFIGURATION, CONFIGURATION_WORDS, lambda: signals.configuration(self.places)),
                *(Image(AXIS_AT[name], AXIS_WORDS, self._image(name)) for name in AXES),
            ),
            configuration=CONFIGURATION,
            capacities=(len(AXES), len(DRIVES), len(SETTINGS), STANDS, EVENT_CAPACITY),
            faults=own.FAULTS,
            words={own.REG_ORDERS: int(orders), own.REG_PAUSE: round(pause), own.REG_LADLE: round(ladle * 10)},
            limits=own.LIMITS,
        )
        self._start_up()

    def _image(self, name: str) -> Callable[[], bytes]:
        return lambda: signals.axis(self, self.axes[name])

    # ---- what the sequence uses

    def stand(self, number: int) -> Mapping[str, float]:
        """Where the lock of a stand is."""
        return self.places.stand(number)

    def position(self, axis: str) -> float:
        """As measured [mm]."""
        return self.axes[axis].position

    def positioning(self, axis: str, target: float, fine: bool) -> MovePhase:
        """Bring an axis there."""
        return self.travel.position(axis, target, self._dt, fine=fine)

    def circling(self, angles: tuple[float, float]) -> bool:
        """Circular move; whether it is there."""
        travel = self.travel
        done = travel.circle_to(angles, bool(self.path_mode), self._dt)
        if done:
            self.event(CraneEvent.PATH_DONE, self.cycle.step, travel.worst)
        elif travel.phase is ArcPhase.FAULT:
            self.event(CraneEvent.PATH_FAULT, signals.FAULT_WORDS[travel.fault], travel.worst)
            self.sequence.suspend(Suspension.PATH)
        return done

    def load_place(self) -> Point:
        """Where the load is, by encoders and scale."""
        return self.travel.load_at

    def lay_circle(self, circle: Circle) -> None:
        """The circle of the next circular move."""
        self.travel.lay(circle)

    def weighed(self) -> float:
        """What the scale says [t]."""
        return self.weight

    def sway(self) -> float:
        """How far the load swings now, of trolley and bridge the one that is farther [mm]."""
        return self.load.sway(self.axes["hoist"].axis.position)

    # ---- one scan

    def _scan(self) -> None:
        self._since += 1
        if self._since < self._period and not self._hurry:
            return
        self._dt, self._since, self._hurry = self._since * self.dt, 0, False
        dt = self._dt
        self.travel.begin(self.load_part if self.scale_ok and not self.overload else nan, dt)
        self._judge()
        self.orders.step(dt)
        levers = self._levers()
        if self.cycle.open and not self.stopping:
            self.sequence.step(dt)
        self.travel.end(dt)
        asked = {} if self.stopping or self.held or self.emergency else {**self.travel.asked, **levers}
        self._move(asked, dt)
        self.edges.look()
        if self.cycle.state is not self._seen:
            self._seen = self.cycle.state
            self.cycles_done += self._seen is StepState.DONE
            self.cycles_aborted += self._seen is StepState.ABORTED
        self._busy = bool(asked) or any(axis.awake for axis in self.axes.values())
        self._period = (CIRCLE if self.travel.circles else BUSY) if self._busy else IDLE
        if self.stopping and not self.moving:
            self.stopping = False

    def _move(self, asked: Mapping[str, Asked], dt: float) -> None:
        safe = not self.emergency and not self.held
        up = self.scale_ok and not self.overload and not self.rope_overlap
        speeds = {name: axis.speed for name, axis in self.axes.items()}
        travels = Surroundings(safe, True, True, self._acknowledge, self.fault, self.load.rope.load)
        hoists = travels._replace(up_ok=up, down_ok=not self.slack_rope)
        for name, axis in self.axes.items():
            axis.step(asked.get(name, STILL), hoists if name == "hoist" else travels, dt)
        self._acknowledge = False
        if self._busy or any(asked) or any(self.load.swing.values()):
            at = {name: axis.axis.position for name, axis in self.axes.items()}
            now = {name: axis.speed for name, axis in self.axes.items()}
            self.load.step(at, now, {name: now[name] - speeds[name] for name in now}, dt)
        self.weight = self.load.scale(self.fault, self.settings["overload_limit"])

    def _judge(self) -> None:
        """What ends a cycle's way, and what latches."""
        if self.emergency:
            self.latched = True
            self.axes["hoist"].trip(SafetyTrip.EMERGENCY_STOP)
        if self.host_silent != self._silent:
            self._silent = self.host_silent
            if self._silent:
                self.sequence.suspend(Suspension.HOST)
                self.mode = Mode.OFF
        if self.cycle.runs:
            why = self._reason()
            if why is not Suspension.NONE:
                self.sequence.suspend(why)

    def _reason(self) -> Suspension:
        """Why a cycle cannot go on."""
        axes = self.axes.values()
        if self.emergency or self.held:
            return Suspension.EMERGENCY_STOP
        if not all(axis.drives_ok for axis in axes):
            return Suspension.DRIVE
        if any(any(axis.limits.alarms.values()) for axis in axes):
            return Suspension.LIMIT
        if not all(axis.encoder_ok for axis in axes):
            return Suspension.ENCODER
        if not self.scale_ok:
            return Suspension.SCALE
        if self.overload:
            return Suspension.OVERLOAD
        return Suspension.ROPE if self.rope_overlap or self.slack_rope else Suspension.NONE

    def _levers(self) -> Mapping[str, Asked]:
        """What hold-to-run asks; in automatic it suspends first."""
        bits = self.hold
        if bits and self.mode is Mode.AUTOMATIC:
            self.sequence.suspend(Suspension.JOG)
        if not bits:
            self._joystick.step(RELEASED, -1, self._dt, allowed=self._by_hand)
            return {}
        levers = {
            name: Lever((bits >> 2 * n & 1) - (bits >> 2 * n + 1 & 1), self.speed_step) for n, name in enumerate(AXES)
        }
        both = any(bits >> 2 * n & 3 == 3 for n in range(len(AXES)))
        moved = self._joystick.step(levers, self.steps, self._dt, allowed=self._by_hand and not both)
        if not moved.axis or any(axis.moving for name, axis in self.axes.items() if name != moved.axis):
            return {}
        return {moved.axis: Asked(moved.speed, True)}

    @property
    def _by_hand(self) -> bool:
        """Hold-to-run counts."""
        suspended = self.mode is Mode.AUTOMATIC and self.cycle.state is StepState.SUSPENDED
        stays = self.held or self.emergency or self.stopping
        return (self.mode is Mode.MANUAL or suspended) and not stays

    # ---- settings, training, power

    @property
    def host_timeout(self) -> float:
        return self.settings["host_timeout"]

    def _host_deaf(self) -> bool:
        return self.fault == own.HOST_OFF

    def _settings_fault(self, values: Mapping[str, float]) -> int:
        return faulty(values, self.places)

    def _judged(self, request: Request) -> Verdict:
        if request.code == plc_map.COMMIT_SETTINGS and self.moving:
            return no(CraneReason.MOVING)
        if request.code == plc_map.COMMIT_SETTINGS and self.fault == own.MEMORY:
            return no(CraneReason.NOT_KEPT)
        return super()._judged(request)

    def _settings_changed(self) -> None:
        for axis in self.axes.values():
            axis.take(self.settings)
        self._take_settings()
        self.event(CraneEvent.SETTINGS)

    def _take_settings(self) -> None:
        self.travel.take(self.settings)
        if self.cycle.laid:
            self.travel.lay(self.cycle.laid)
        self._joystick = Joystick({name: axis.steps for name, axis in self.axes.items()})

    def _trained(self, address: int, word: int) -> None:
        if address == own.REG_ORDERS:
            self.orders.active = bool(word)
        elif address == own.REG_PAUSE:
            self.orders.pause = float(word)
        elif address == own.REG_LADLE:
            self.load.weight = word / 10
        elif address == training.REG_MACHINE_FAULT:
            self.fault = word
        self._hurry = True

    def _forget(self) -> None:
        start = {**self.places.stand(FIRST_STAND), "hoist": self.settings["safe_height"]}
        self.axes = {name: PlcAxis(name, self.settings, self.places, start[name]) for name in AXES}
        self.load = Load(self.places, self._ladle, self._stand)
        self.sequence = CraneSequence(self, Cycle())
        self.speed_step, self.drives_selected, self.path_mode = 1, DriveChoice.BOTH, 0
        self.cycles_done = self.cycles_aborted = 0
        self._start_mode = self._start_in
        self.fault = 0
        self.orders.reset()

    def power_cycle(self) -> None:
        fell = not self.safety_brake
        self.axes["hoist"].trip(SafetyTrip.POWER)
        super().power_cycle()
        if fell:
            self.edges.tell_safety_brake()

    def _power_up(self) -> None:
        self.mode, self._start_mode = self._start_mode, Mode.OFF
        for axis in self.axes.values():
            axis.start_up(self.settings)
        self.travel = Travel(self.axes, self.settings, BUSY * self.dt)
        self.latched = self.stopping = self._acknowledge = self._silent = self._busy = False
        self._hurry, self._since, self._dt, self._period = True, 0, BUSY * self.dt, BUSY
        self.weight = self.load.scale(self.fault, self.settings["overload_limit"])
        self._take_settings()
        self.edges = Edges(self)
        self.edges.take_stock()
        self.sequence.suspend(Suspension.POWER_UP)
        self._seen = self.cycle.state
        self.event(CraneEvent.POWER_UP, value=self.boots)
