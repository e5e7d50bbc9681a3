"""A virtual PLC that runs the conveyor: its program, 10 ms a scan, over `machine`; its registers: `register_map`.

Written from the thesis' program, never from the equipment type's points. Decided here:

| subject | rule |
| --- | --- |
| emergency stop | cuts the drives at once; after it is released the line stays held until a reset |
| jam | driven with the drive at its torque limit and without a pulse for the jam time; the belt's drive goes off, the others ramp down |
| jam, position | what lies across the jammed belt and another one is uncertain |
| encoder | what it counted differs from what the ramp must have moved; the products on its belt are uncertain from 1 mm on |
| faults | stay until reset, which tries again: a fault whose cause is still there comes back |
| gap stop, automatic | released when the belts stood for the restart delay (reset: at once) and a start would not bring a pair too near |
| gap stop, manual | released when nothing is held |
| buffer full | in automatic belt 1 waits until a slot is free |
| host silent | ends automatic with a ramp; a start is refused as long as it lasts |
| length | two sensors that differ by more than the sensor tolerance leave a product uncertain until one agrees with the record |
| sensor that was suspected, S1 when it missed a product | the product of its first edge stays uncertain until the next sensor |
| first-out | first of gap stop, emergency stop, jam, encoder, host, until reset; a gap stop that ended: 10 s or until the next cause |
| unloading | the unloader takes the product when tracking lets it go; an empty grip is told as lost, source 0 |
| slip | deviation of a head as part of the way from the sensor before, of a tail as part of the length; warning 0 = off |
| edit, insert | only while the belts stand |
"""

from collections.abc import Mapping
from math import inf, isfinite, nan
from random import Random

from app.blocks import product_tracking as tracking
from app.blocks.mode_control import Mode, ModeControl, ModeInputs
from app.blocks.product_tracking import EditRefused, ProductTracking, TrackingEvent
from app.blocks.s_ramp import SRamp
from app.registers.plc_map import AnswerState, Request, real_of
from app.sim import training
from app.sim.conveyor import images
from app.sim.conveyor import training as own
from app.sim.conveyor.belt import Belt, Finding
from app.sim.conveyor.machine import BELTS, EMERGENCY_STOP, FAULTS, HOST_OFF, SENSORS, Conveyor, Geometry
from app.sim.conveyor.plausibility import Doubts, doubt_belt, slip_of
from app.sim.conveyor.register_map import (
    BELT_BITS,
    CONFIGURATION,
    FORWARD,
    REVERSE,
    ROW_WORDS,
    SETTINGS,
    SETTINGS_AT,
    STAGING,
    STATUS,
    TABLE,
    ConveyorCommand,
    ConveyorEvent,
    ConveyorReason,
    Source,
    require_settings,
    words_of,
)
from app.sim.conveyor.state import FirstOut, LineState
from app.sim.plc import EVENT_CAPACITY, Image, Setting, Table, Verdict
from app.sim.plc import rejected as no

SELECTIONS = (Source.NONE, Source.STOP, Source.GAP, Source.UNLOADING, Source.MANUAL, Source.AUTOMATIC)
"""Selection of SEL_5R → source; the first wins always."""
FORGOTTEN = 10_000_000
"""A first-out that ended by itself is shown for so long [µs]."""


class VirtualConveyor(LineState):
    """The PLC of one line."""

    type = "conveyor"
    TYPE_CODE = own.TYPE_CODE

    _setpoints: list[float]
    """Of the drives [%]."""
    _enabled: bool
    """The drives have supply."""
    _unload: bool
    """The unloader may take a product now."""
    _unloading: int
    _taken: int
    _start: bool
    _start_automatic: bool
    _select_manual: bool
    _silent: bool
    _gap_age: float
    _doubts: Doubts
    _restart_speed: float
    _restart_way: float

    def __init__(
        self,
        geometry: Geometry | None = None,
        *,
        seed: int = 1,
        slots: int = 20,
        start: str = "stopped",
        arrivals: bool = True,
        interval: float = 6.0,
        shortest: float = 20.0,
        longest: float = 60.0,
        settings: Mapping[str, float] | None = None,
    ) -> None:
        """A line just switched on for the first time. `slots` 5–250; `start`: automatic or stopped; `arrivals`, `interval` [s], `shortest`,
        `longest` [mm]: what the infeed gives; `settings`: initial setpoints by name.

        Raises:
            ValueError: a measure of the line that cannot be, or settings that do not go together.
        """
        self.geometry = geometry or Geometry()
        self.line = tracking.LineLayout(self.geometry.belt_ends, self.geometry.sensors, self.geometry.area_ends, slots)
        self._seed, self._start_in = seed, start
        given = dict(settings or {})
        require_settings(given)
        self._table = Table(TABLE, ROW_WORDS, slots, lambda slot: images.row(self, slot))
        self._millimetres = self.geometry.full_speed / 100
        self._machine_options = {"shortest": shortest, "longest": longest, "interval": interval}
        super().__init__(
            settings=[Setting(s.name, given.get(s.name, s.default), s.low, s.high) for s in SETTINGS],
            settings_at=SETTINGS_AT,
            staging_at=STAGING,
            images=(
                Image(STATUS, 96, lambda: images.status(self)),
                Image(CONFIGURATION, 64, lambda: images.configuration(self)),
            ),
            configuration=CONFIGURATION,
            tables=(self._table,),
            capacities=(BELTS, SENSORS, slots, EVENT_CAPACITY, len(SETTINGS)),
            faults=FAULTS,
            words={
                own.REG_ARRIVALS: int(arrivals),
                own.REG_INTERVAL: round(interval * 10),
                own.REG_SHORTEST: round(shortest),
                own.REG_LONGEST: round(longest),
            },
            limits=own.LIMITS,
            triggers=(own.REG_REMOVE, own.REG_PUT),
        )
        self._start_up()

    # ---- one scan

    def _scan(self) -> None:
        machine = self.machine
        machine.step(self._setpoints, self._enabled, self._unload, self.dt)
        if self._unload:
            self._unload = False
            self._look_at_the_gripper()
        self._emergency(machine.fault == EMERGENCY_STOP)
        self._host()
        self._measure()
        self._track()
        self._supervise()
        self._modes_and_gaps()
        self._drive()

    def _measure(self) -> None:
        """Read the encoders."""
        length = self.geometry.pulse_length
        for belt, pulses in zip(self.belts, self.machine.pulses, strict=True):
            belt.measure(pulses, length, self.steps)

    def _track(self) -> None:
        first, second, third = self.belts
        scale, beams = self._millimetres, self.machine.beams
        happened = self.tracking.scan(
            (first.moved, second.moved, third.moved),
            (bool(beams & 1), bool(beams & 2), bool(beams & 4), bool(beams & 8)),
            (first.stop_distance() * scale, second.stop_distance() * scale, third.stop_distance() * scale),
            self.time,
        )
        for event in happened:
            self._tell(event)
            if event.code == tracking.Code.GAP_STOP:
                self._first(event.code, 0, event.value, rear=event.id, front=event.second)
            elif event.code == tracking.Code.UNLOADED:
                self._unload, self._unloading = True, event.id
            else:
                self._watch_slip(event)
        if happened:
            self._doubts.look(self.tracking, happened, self.settings["sensor_tolerance"])
            self._renew_table()

    def _watch_slip(self, event: TrackingEvent) -> None:
        warning = self.settings["slip_warning"]
        found = slip_of(event, self.tracking, self.geometry) if warning else None
        if found and found[1] > warning:
            belt, slip = found
            self.event(ConveyorEvent.SLIP, belt, slip, words_of(event.id))

    def _look_at_the_gripper(self) -> None:
        if self.machine.unloaded == self._taken:
            self.event(ConveyorEvent.LOST, 0, self.geometry.length, words_of(self._unloading))
            self.tracking.lost += 1
            self.tracking.unloaded -= 1
        self._taken = self.machine.unloaded

    def _emergency(self, pressed: bool) -> None:
        if pressed == self.pressed:
            return
        self.pressed = pressed
        if not pressed:
            self.event(ConveyorEvent.EMERGENCY_STOP_OFF)
            return
        self.event(ConveyorEvent.EMERGENCY_STOP)
        self._first(ConveyorEvent.EMERGENCY_STOP)
        self._held = True
        self._enabled = False

    def _host(self) -> None:
        if self.host_silent == self._silent:
            return
        self._silent = self.host_silent
        self.event(ConveyorEvent.HOST_SILENT if self._silent else ConveyorEvent.HOST_BACK)
        if self._silent and self.modes.mode is Mode.AUTOMATIC:
            self._first(ConveyorEvent.HOST_SILENT)
            self._stopping = True

    def _supervise(self) -> None:
        """Drives and encoders."""
        jam_time, limited = self.settings["jam_time"], self.machine.limited
        for number, belt in enumerate(self.belts):
            found = belt.supervise(self._setpoints[number], self._millimetres, limited[number], self._enabled, jam_time)
            if found is Finding.NONE:
                continue
            begin, end = (0.0, *self.geometry.belt_ends)[number : number + 2]
            doubt_belt(self.tracking.products, begin, end, across=found is Finding.JAM)
            if found is not Finding.DOUBT:
                self._fail(ConveyorEvent.JAM if found is Finding.JAM else ConveyorEvent.ENCODER, number)

    def _fail(self, code: ConveyorEvent, belt: int) -> None:
        value = self.belts[belt].ramp.speed
        self.event(code, belt + 1, value)
        self._first(code, belt + 1, value)
        self._faulty = True

    def _modes_and_gaps(self) -> None:
        bits = self.hold
        inputs = ModeInputs(
            self._start,
            self._select_manual,
            self.stop_active,
            bool(bits & FORWARD),
            bool(bits & REVERSE),
        )
        self._start = self._select_manual = False
        before = self.modes.mode
        out = self.modes.step(inputs)
        if out.mode is not before:
            if before is Mode.AUTOMATIC:
                self.event(ConveyorEvent.AUTOMATIC_ENDED)
            if out.mode is Mode.AUTOMATIC:
                self.event(ConveyorEvent.AUTOMATIC)
            elif out.mode is Mode.MANUAL:
                self.event(ConveyorEvent.MANUAL)
        self._direction = out.forward - out.reverse
        self.moving = any(belt.moves(self.steps) for belt in self.belts)
        if self._stopping and not self.moving:
            self._stopping = False
        if self.first_out.ended and self.time - self.first_out.ended > FORGOTTEN:
            self.first_out = FirstOut()
        if self.tracking.gap_stop:
            self._hold_the_gap()

    def _hold_the_gap(self) -> None:
        if self.moving:
            self._gap_age = 0.0
            return
        self._gap_age += self.dt
        if self.modes.mode is Mode.AUTOMATIC:
            speed = self.settings["automatic_speed"]
            if speed != self._restart_speed:
                ramp = SRamp(self.settings["acceleration"], self.settings["jerk"], speed)
                self._restart_speed, self._restart_way = speed, ramp.stop_distance() * self._millimetres
            way = self._restart_way
            if self._gap_age + 1e-9 < self.settings["restart_delay"]:
                return
            ways = (0.0 if self.tracking.buffer_full else way, way, 0.0 if self.tracking.brake else way)
            gap = self.tracking.gap_with(ways)
            if gap is not None and gap.stop:
                return
        elif self._direction:
            return
        self._release_gap()

    def _release_gap(self) -> None:
        self._gap_age = 0.0
        for event in self.tracking.release_gap_stop():
            self._tell(event)
        if self.first_out.code == tracking.Code.GAP_STOP:
            self.first_out.ended = self.time
            if self._next_out.code:
                self.first_out, self._next_out = self._next_out, FirstOut()

    def _drive(self) -> None:
        """Choose every belt's speed and follow it with the ramp."""
        values, follow = self.settings, self.tracking
        stop = self.stop_active
        automatic = self.modes.mode is Mode.AUTOMATIC and not stop
        gap = follow.gap_stop
        manual = 0.0
        if self._direction:
            asked = self.hold_argument
            manual = self._direction * (min(asked, 50.0) if asked > 0 else values["manual_speed"])
        chosen = self.hold // (1 << BELT_BITS) & 7 or 7
        waits = (follow.buffer_full, False, follow.brake)
        for number, belt in enumerate(self.belts):
            ramp = belt.ramp
            hold = automatic and waits[number]
            by_hand = manual if chosen >> number & 1 else 0.0
            active = (stop, gap, hold, by_hand != 0.0, automatic and not gap and not hold)
            selected = belt.selector.step(active, (0.0, 0.0, 0.0, by_hand, values["automatic_speed"]))
            belt.source, belt.target = SELECTIONS[selected.selection], selected.value
            if not self._enabled or belt.jammed:
                ramp.reset()
            elif ramp.speed != belt.target or ramp.acceleration:
                ramp.step(belt.target, self.dt)
            self._setpoints[number] = ramp.speed

    # ---- commands

    def _execute(self, request: Request) -> Verdict:
        code, first = request.code, request.arguments[0]
        if code == ConveyorCommand.STOP:
            return self._stop()
        if code == ConveyorCommand.RESET:
            return self._reset()
        if code in (ConveyorCommand.START, ConveyorCommand.MANUAL):
            return self._change_mode(code)
        if code not in (ConveyorCommand.DELETE, ConveyorCommand.EDIT, ConveyorCommand.CONFIRM, ConveyorCommand.INSERT):
            return no(ConveyorReason.UNKNOWN)
        if code in (ConveyorCommand.EDIT, ConveyorCommand.INSERT) and self.moving:
            return no(ConveyorReason.MOVING)
        try:
            if code == ConveyorCommand.DELETE:
                event = self.tracking.delete(first)
            elif code == ConveyorCommand.CONFIRM:
                event = self.tracking.confirm(first)
            else:
                at = 1 if code == ConveyorCommand.EDIT else 0
                head, length = real_of(request.arguments[at]), real_of(request.arguments[at + 1])
                if not isfinite(length):
                    return no(ConveyorReason.LENGTH)
                if not isfinite(head):
                    return no(ConveyorReason.OUTSIDE_LINE)
                edit = code == ConveyorCommand.EDIT
                event = self.tracking.edit(first, head, length) if edit else self._insert(head, length)
        except EditRefused as refusal:
            return no(refusal.reason)
        self._tell(event)
        if first or code == ConveyorCommand.CONFIRM:
            self._doubts.vouched_for(first)
        self._renew_table()
        return Verdict(detail=event.id)

    def _insert(self, head: float, length: float) -> TrackingEvent:
        return self.tracking.insert(head, length, self.time)

    def _stop(self) -> Verdict:
        self.event(ConveyorEvent.STOP)
        if not self.moving and self.modes.mode is not Mode.AUTOMATIC:
            return Verdict()
        self._stopping = True

        def standing() -> AnswerState:
            return AnswerState.RUNNING if self._stopping else AnswerState.DONE

        return Verdict(AnswerState.RUNNING, until=standing)

    def _reset(self) -> Verdict:
        self.event(ConveyorEvent.RESET)
        if self._held and not self.pressed:
            self._held, self._enabled = False, True
        for number, belt in enumerate(self.belts, 1):
            if belt.jammed:
                self.event(ConveyorEvent.JAM_OFF, number)
            if belt.encoder_fault:
                self.event(ConveyorEvent.ENCODER_OK, number)
            belt.reset(self._millimetres)
        self._faulty = False
        if self.tracking.gap_stop:
            self._gap_age = inf
            if self.modes.mode is not Mode.AUTOMATIC:
                self._release_gap()
        self.first_out, self._next_out = FirstOut(), FirstOut()
        if self.pressed:
            self._first(ConveyorEvent.EMERGENCY_STOP)
        elif self.tracking.gap_stop and (gap := self.tracking.gap):
            self._first(tracking.Code.GAP_STOP, 0, gap.gap, rear=gap.rear, front=gap.front)
        return Verdict()

    def _change_mode(self, code: int) -> Verdict:
        if self._held:
            return no(ConveyorReason.EMERGENCY_STOP)
        if self._faulty:
            return no(ConveyorReason.FAULT)
        if code == ConveyorCommand.START and self.modes.mode is Mode.AUTOMATIC and not self._stopping:
            return Verdict()
        if self.moving or self._stopping or self.hold:
            return no(ConveyorReason.MOVING)
        if code == ConveyorCommand.START:
            if self.host_silent:
                return no(ConveyorReason.WRONG_STATE, self.state)
            self._start = True
            self.causes(ConveyorEvent.AUTOMATIC)
        else:
            self._select_manual = True
            self.causes(ConveyorEvent.AUTOMATIC_ENDED, ConveyorEvent.MANUAL)
        return Verdict()

    def _tell(self, event: TrackingEvent) -> None:
        self.event(event.code, event.source, event.value, words_of(event.id, event.second, event.value2))

    def _first(self, code: int, source: int = 0, value: float = 0.0, *, rear: int = 0, front: int = 0) -> None:
        cause = FirstOut(code, source, rear, front, self.time, value)
        if not self.first_out.code or self.first_out.ended:
            self.first_out = cause
        elif not self._next_out.code:
            self._next_out = cause

    # ---- settings, training, power

    @property
    def host_timeout(self) -> float:
        return self.settings["host_timeout"]

    def _host_deaf(self) -> bool:
        return self.machine.fault == HOST_OFF

    def _settings_fault(self, values: Mapping[str, float]) -> int:
        names = [setting.name for setting in SETTINGS]
        if values["longest"] < values["shortest"]:
            return names.index("longest") + 1
        return 0

    def _settings_changed(self) -> None:
        self._take_settings()
        self.event(ConveyorEvent.SETTINGS)

    def _take_settings(self) -> None:
        values = self.settings
        self.tracking.settings = tracking.Settings(
            **{
                name: values[name]
                for name in (
                    "sensor_tolerance",
                    "alarm_tolerance",
                    "gap_margin",
                    "shortest",
                    "longest",
                    "lost_after",
                    "unload_dwell",
                )
            }
        )
        for belt in self.belts:
            belt.ramp.acceleration_limit, belt.ramp.jerk = values["acceleration"], values["jerk"]
        self._restart_speed = nan

    def _trained(self, address: int, word: int) -> None:
        machine, words = self.machine, self.training
        if address == own.REG_REMOVE:
            machine.remove(word)
        elif address == own.REG_PUT:
            machine.place(float(word), float(words[own.REG_SHORTEST]))
        elif address == own.REG_ARRIVALS:
            machine.arrivals = bool(word)
        elif address == own.REG_INTERVAL:
            machine.interval = word / 10
        elif address == own.REG_SHORTEST:
            machine.shortest = float(word)
        elif address == own.REG_LONGEST:
            machine.longest = float(word)
        elif address == own.REG_SENSORS:
            machine.pressed = word
        elif address == training.REG_MACHINE_FAULT:
            machine.fault = word

    def _forget(self) -> None:
        self.machine = Conveyor(
            self.geometry,
            Random(self._seed),
            arrivals=bool(self.training[own.REG_ARRIVALS]),
            **self._machine_options,
        )
        self.tracking = ProductTracking(self.line)
        self._start_automatic = self._start_in == "automatic"

    def _power_up(self) -> None:
        retained = self.tracking.snapshot()
        self.tracking = ProductTracking(self.line)
        self.tracking.restore(retained)
        self.tracking.power_up()
        values = self.settings
        self.belts = tuple(Belt(pulses, values["acceleration"], values["jerk"]) for pulses in self.machine.pulses)
        self.modes = ModeControl()
        self.modes.step(ModeInputs())
        self._setpoints = [0.0] * BELTS
        self._enabled = True
        self.first_out, self._next_out = FirstOut(), FirstOut()
        self._start, self._start_automatic = self._start_automatic, False
        self._select_manual = self._stopping = self._held = self._faulty = False
        self.pressed = self._silent = self.moving = self._unload = False
        self._direction = self._unloading = 0
        self._taken = self.machine.unloaded
        self._gap_age = 0.0
        self._doubts = Doubts()
        self._restart_speed = nan
        self._restart_way = 0.0
        self._take_settings()
        self._renew_table()
        self.event(ConveyorEvent.POWER_UP, value=self.boots)

    def _renew_table(self) -> None:
        ids = [product.id if product else 0 for product in self.tracking.slots]
        if ids != self._table.ids:
            self._table.ids = ids
            self._table.generation = self._table.generation + 2 & 0xFFFE
