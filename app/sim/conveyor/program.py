"""A virtual PLC that runs the conveyor: its program, 10 ms a scan, over `machine`; its registers: `register_map`.

The parts of the program: `commands`, `drives`, `gap_stop`, `gate_control`, `first_out`, `plausibility`; what they share is `state`.

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
| modes | choosing one starts nothing; a start counts in automatic only; stop ends the run and keeps the mode |
| buffer full | in automatic belt 1 waits until a slot is free |
| speed | each belt has its part of the automatic speed; by hand all go alike |
| host silent | ends automatic with a ramp; a start is refused as long as it lasts |
| length | two sensors that differ by more than the sensor tolerance leave a product uncertain until one agrees with the record |
| sensor that was suspected, S1 when it missed a product | the product of its first edge stays uncertain until the next sensor |
| first-out | first of gap stop, emergency stop, jam, encoder, host, until reset; a gap stop that ended: 10 s or until the next cause |
| unloading | the unloader takes the product when tracking lets it go; an empty grip is told as lost, source 0 |
| slip | deviation of a head as part of the way from the sensor before, of a tail as part of the length; warning 0 = off |
| gates | see `gate_control` and `merge_control` |
| edit, insert | only while the belts stand |
"""

from collections.abc import Mapping
from random import Random

from app.blocks import product_tracking as tracking
from app.blocks.mode_control import Mode, ModeControl, ModeInputs
from app.blocks.product_tracking import ProductTracking, TrackingEvent
from app.registers.plc_map import Request
from app.sim.conveyor import images
from app.sim.conveyor import training as own
from app.sim.conveyor.belt import Belt
from app.sim.conveyor.commands import LineCommands
from app.sim.conveyor.drives import BeltDrives
from app.sim.conveyor.first_out import FirstOut
from app.sim.conveyor.gap_stop import GapStop
from app.sim.conveyor.gate_control import GateControl
from app.sim.conveyor.gates import Gates
from app.sim.conveyor.machine import EMERGENCY_STOP, FEW_BELTS, HOST_OFF, Conveyor, Geometry, Labels, fault_names
from app.sim.conveyor.merge_control import MergeControl
from app.sim.conveyor.merges import Merges
from app.sim.conveyor.plausibility import UncertainProducts, slip_of
from app.sim.conveyor.register_map import (
    CONFIGURATION,
    FORWARD,
    MORE_RAMPS,
    ORIGIN_WORDS,
    ORIGINS,
    RAMP_WORDS,
    RAMPS,
    READING_WORDS,
    READINGS,
    REVERSE,
    ROW_WORDS,
    SETTINGS,
    SETTINGS_AT,
    STAGING,
    STATUS,
    TABLE,
    ConveyorEvent,
    words_of,
)
from app.sim.conveyor.scanner import Scanner
from app.sim.conveyor.state import LineState
from app.sim.plc import EVENT_CAPACITY, Image, Setting, Table, Verdict, check_given


class VirtualConveyor(LineState):
    """The PLC of one line."""

    type = "conveyor"
    TYPE_CODE = own.TYPE_CODE

    _drives: BeltDrives
    _gap_stop: GapStop
    _gate_control: GateControl
    _merge_control: MergeControl
    _commands: LineCommands
    _uncertain: UncertainProducts
    _unload: bool
    """The unloader may take a product now."""
    _unloading: int
    _taken: int
    _start_automatic: bool
    _silent: bool

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
        scanner: int = 0,
        not_read: float = 2.0,
        lane_interval: float = 8.0,
    ) -> None:
        """A line just switched on for the first time. `slots` 5–250; `start`: automatic or stopped; `arrivals`, `interval` [s], `shortest`,
        `longest` [mm]: what the infeed gives; `settings`: initial setpoints by name; `scanner`: sensor that it stands at, 0 = none, and
        of how many products it cannot read the label: `not_read` [%];
        `lane_interval`: what the lanes of merging gates give [s], 0 = nothing.

        Raises:
            ValueError: a measure of the line that cannot be, or settings that do not go together.
        """
        self.geometry = geometry or Geometry()
        measures = self.geometry
        places = tuple(gate.at for gate in measures.gates)
        joins = tuple(merge.at for merge in measures.merges)
        self.line = tracking.LineLayout(measures.belt_ends, measures.sensors, measures.area_ends, slots, places, joins)
        self._seed, self._start_in = seed, start
        self._beam_bits = tuple(1 << sensor for sensor in range(len(self.geometry.sensors)))
        given = dict(settings or {})
        check_given(given, SETTINGS)
        self.table = Table(TABLE, ROW_WORDS, slots, lambda slot: images.row(self, slot))
        belts, sensors = self.geometry.belts, len(self.geometry.sensors)
        self.readings = Table(READINGS, READING_WORDS, slots, lambda slot: images.reading(self, slot))
        self.origins = Table(ORIGINS, ORIGIN_WORDS, slots, lambda slot: images.origin(self, slot))
        ramps, rows = (MORE_RAMPS, 2 * belts) if belts > FEW_BELTS else (RAMPS, 2 * FEW_BELTS)
        self.ramps = Table(ramps, RAMP_WORDS, rows, lambda slot: images.ramp(self, slot))
        self.scale = self.geometry.full_speed / 100
        self._scanner_at = scanner
        self._machine_options = {"shortest": shortest, "longest": longest, "interval": interval, "not_read": not_read}
        self._machine_options["lane_interval"] = lane_interval
        super().__init__(
            settings=[Setting(s.name, given.get(s.name, s.default), s.low, s.high) for s in SETTINGS],
            settings_at=SETTINGS_AT,
            staging_at=STAGING,
            images=(
                Image(STATUS, 96, lambda: images.status(self)),
                Image(CONFIGURATION, 64, lambda: images.configuration(self)),
                *images.more(self),
            ),
            configuration=CONFIGURATION,
            tables=(self.ramps, self.table, *([self.readings] if scanner else []), *([self.origins] if joins else [])),
            capacities=(belts, sensors, slots, EVENT_CAPACITY, len(SETTINGS)),
            faults=tuple(fault_names(belts, sensors, len(places), len(joins)).values()),
            words={
                own.REG_ARRIVALS: int(arrivals),
                own.REG_INTERVAL: round(interval * 10),
                own.REG_SHORTEST: round(shortest),
                own.REG_LONGEST: round(longest),
                **({own.REG_LANE_INTERVAL: round(lane_interval * 10)} if joins else {}),
            },
            limits=own.limits(sensors, len(joins)),
            triggers=(own.REG_REMOVE, own.REG_PUT, *([own.REG_LANE_PUT] if joins else [])),
        )
        self._start_up()

    # ---- one scan

    def _scan(self) -> None:
        machine = self.machine
        machine.step(
            self._drives.setpoints, self._drives.enabled, self._unload, self.dt, self.gates.wanted, self.merges.open
        )
        if self._unload:
            self._unload = False
            self._look_at_the_gripper()
        self._emergency(machine.fault == EMERGENCY_STOP)
        self._host()
        self._measure()
        self._merge_control.measure()
        self._track()
        self._drives.supervise()
        self._choose_mode()
        automatic = self.modes.running and not self.stop_active
        self._gate_control.step(automatic=automatic, supplied=self._drives.enabled)
        self._merge_control.step(automatic=automatic)
        self.first_out.age(self.time)
        if self.tracking.gap_stop:
            self._gap_stop.watch()
        self._drives.follow()

    def _measure(self) -> None:
        """Read the encoders."""
        length = self.geometry.pulse_length
        for belt, pulses in zip(self.belts, self.machine.pulses, strict=True):
            belt.measure(pulses, length, self.steps)
        self.gates.measure(self.machine.blades.open)

    def _track(self) -> None:
        scale, beams = self.scale, self.machine.beams
        self.tracking.gates = self.gates.positions
        happened = self.tracking.scan(
            [belt.moved for belt in self.belts],
            [beams & bit != 0 for bit in self._beam_bits],
            [belt.stop_distance() * scale for belt in self.belts],
            self.time,
        )
        for event in happened:
            self.report(event)
            self.scan_label(event)
            if event.code == tracking.Code.GAP_STOP:
                self.stopped_by(event.code, 0, event.value, rear=event.id, front=event.second)
            elif event.code == tracking.Code.UNLOADED:
                self._unload, self._unloading = True, event.id
            else:
                self._watch_slip(event)
        if happened:
            self._uncertain.look(self.tracking, happened, self.settings["sensor_tolerance"])
            self.renew_table()

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
        self.stopped_by(ConveyorEvent.EMERGENCY_STOP)
        self.held = True
        self._drives.enabled = False

    def _host(self) -> None:
        if self.host_silent == self._silent:
            return
        self._silent = self.host_silent
        self.event(ConveyorEvent.HOST_SILENT if self._silent else ConveyorEvent.HOST_BACK)
        if self._silent and self.modes.running:
            self.stopped_by(ConveyorEvent.HOST_SILENT)
            self.stopping = True

    def _choose_mode(self) -> None:
        bits, asked = self.hold, self._commands.modes_asked()
        before, ran = self.modes.mode, self.modes.running
        out = self.modes.step(ModeInputs(*asked, self.stop_active, bool(bits & FORWARD), bool(bits & REVERSE)))
        if ran and not out.automatic:
            self.event(ConveyorEvent.ENDED)
        if out.mode is not before:
            self.event(ConveyorEvent.MANUAL if out.mode is Mode.MANUAL else ConveyorEvent.AUTOMATIC)
        if out.automatic and not ran:
            self.event(ConveyorEvent.STARTED)
        self.direction = out.forward - out.reverse
        self.moving = any(belt.moves(self.steps) for belt in self.belts)
        if self.stopping and not self.moving:
            self.stopping = False

    def _execute(self, request: Request) -> Verdict:
        return self._commands.execute(request)

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
        self._gap_stop.settings_changed()

    def _trained(self, address: int, word: int) -> None:
        own.trained(self.machine, self.training, address, word)

    def _forget(self) -> None:
        self.machine = Conveyor(
            self.geometry,
            Random(self._seed),
            arrivals=bool(self.training[own.REG_ARRIVALS]),
            labels=Labels(Random(f"{self._seed} labels")),
            lane_chance=Random(f"{self._seed} lanes"),
            **self._machine_options,
        )
        self.scanner = Scanner(self._scanner_at)
        self.gates, self.merges = Gates(self.geometry.gates), Merges(self.geometry.merges)
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
        self.first_out = FirstOut()
        self._uncertain = UncertainProducts()
        self._drives, self._gap_stop = BeltDrives(self), GapStop(self)
        self._gate_control, self._merge_control = GateControl(self), MergeControl(self)
        self._commands = LineCommands(
            self,
            self._drives,
            self._gap_stop,
            self._uncertain,
            self._gate_control,
            self._merge_control,
            start=self._start_automatic,
        )
        self._start_automatic = False
        self.stopping = self.held = self.faulty = False
        self.pressed = self._silent = self.moving = self._unload = False
        self.direction = self._unloading = 0
        self._taken = self.machine.unloaded
        self.gates.measure(self.machine.blades.open)
        self.gates.power_up()
        self.merges.power_up(self.machine.lanes.started)
        self._take_settings()
        self.renew_table()
        self.ramps.clear()
        self.event(ConveyorEvent.POWER_UP, value=self.boots)
