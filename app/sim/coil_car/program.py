"""A virtual PLC that runs a coil car under a recoiler: its program, 10 ms a scan, over `machine`; its registers: `register_map`.

The transport itself is a sequence in another device (`VirtualSequence`, app/sim/sequence/program.py): it asks `ACTIONS` of this one and reads its
signals, which are the points of this map by name. Type code 30. Measures and numbers are taken here; thesis 001 gives the steps only.

The parts of the program: `commands`, `movements`, `interlock`, `edges`, `recoiler`; what they share is `state`.

| subject | rule |
| --- | --- |
| one movement at a time | an axis or the mandrel; another waits until it stands |
| interlock | an axis may go as far as its S-ramp can still stop before the next obstacle, in manual as in automatic; there is no override |
| emergency stop, guard, tripped drive, stuck mandrel | brake, mode off, held until the cause is gone and a reset |
| pressure, oil | block lifting, the mandrel and the begin of winding for as long as they last |
| limit switches | at the ends of the ways, where the PLC stops by its position; one that is actuated elsewhere blocks its direction |
| actions | only in automatic, for as long as they are asked; withdrawn = ramp to a stop |
| recoiler | in automatic, when `automatic_winding` is set, with an empty mandrel and no car in its zone it expands and winds to `order_diameter`; told to stop winding it waits for automatic or winding being commanded again; a stop, too, stops it |
"""  # noqa: E501

from collections.abc import Callable, Mapping, Sequence

from app.plant.said import not_as, said
from app.registers.plc_map import Request
from app.sim import training
from app.sim.coil_car import presets, signals
from app.sim.coil_car import training as own
from app.sim.coil_car.axis import Axis
from app.sim.coil_car.commands import CarCommands
from app.sim.coil_car.edges import Edges
from app.sim.coil_car.interlock import Interlock, InterlockedCar
from app.sim.coil_car.machine import FAULTS, HOST_OFF, CoilCar, Geometry, Hit
from app.sim.coil_car.movements import Movements
from app.sim.coil_car.recoiler import Recoiler
from app.sim.coil_car.register_map import (
    ACTIONS,
    CONFIGURATION,
    CONFIGURATION_WORDS,
    SADDLES,
    SETTINGS,
    SETTINGS_AT,
    SIGNALS,
    STAGING,
    STARTS,
    STATUS,
    STATUS_WORDS,
    ActionState,
    Block,
    CoilCarEvent,
    Fault,
    Mode,
)
from app.sim.plc import EVENT_CAPACITY, Image, Setting, Verdict, check_given


class VirtualCoilCar(InterlockedCar):
    """The PLC of one coil-car line."""

    type = "coil_car"
    TYPE_CODE = own.TYPE_CODE
    signals: Sequence[str] = SIGNALS
    actions: Sequence[str] = ACTIONS

    edges: Edges
    recoiler: Recoiler
    _movements: Movements
    _commands: CarCommands
    _start_mode: Mode
    _silent: float
    _getters: Mapping[str, Callable[[], float]]

    def __init__(
        self,
        geometry: Geometry | None = None,
        *,
        start: str = "stopped",
        coil: bool = False,
        growth: float = 20.0,
        crane: float = 0.0,
        settings: Mapping[str, float] | None = None,
    ) -> None:
        """A line just switched on for the first time: car in the free zone, mandrel expanded.

        `start`: automatic, manual or stopped; `coil`: a finished one is on the mandrel; `growth` of its diameter [mm/s]; `crane` [s], see
        the table above; `settings`: initial setpoints by name.

        Raises:
            ValueError: a measure, a number or a setting that cannot be.
        """
        self.geometry = geometry or Geometry()
        if start not in STARTS:
            raise ValueError(not_as(f"start = {start}", ", ".join(STARTS)))
        for name, value, low, high in (("growth", growth, 0.1, 6000.0), ("crane", crane, 0.0, 6000.0)):
            if not low <= value <= high:
                raise ValueError(
                    not_as(f"{name} = {value:g}", said("mistake.from_to", low=f"{low:g}", high=f"{high:g}"))
                )
        given = dict(settings or {})
        check_given(given, SETTINGS)
        self._start_in, self._coil_there = STARTS[start], coil
        self._growth, self._crane = growth, crane
        super().__init__(
            settings=[Setting(s.name, given.get(s.name, s.default), s.low, s.high) for s in SETTINGS],
            settings_at=SETTINGS_AT,
            staging_at=STAGING,
            images=(
                Image(STATUS, STATUS_WORDS, lambda: signals.status(self._getters)),
                Image(CONFIGURATION, CONFIGURATION_WORDS, lambda: signals.configuration(self.geometry)),
            ),
            configuration=CONFIGURATION,
            capacities=(SADDLES, len(SETTINGS), EVENT_CAPACITY),
            faults=FAULTS,
            words={
                own.REG_STRIP: 1,
                own.REG_GROWTH: round(growth * 10),
                own.REG_CRANE: round(crane),
            },
            limits=own.LIMITS,
        )
        self._start_up()

    # ---- what a sequence uses

    def signal(self, name: str) -> float:
        """The value of a point of the map now, as a sequence reads it.

        Raises:
            KeyError: no such signal.
        """
        return self._getters[name]()

    def ask(self, actions: Sequence[str]) -> None:
        """Ask for `actions` in the next scan; to be repeated in every scan for as long as they shall go on."""
        self._movements.ask(actions)

    @property
    def takes_actions(self) -> bool:
        """Whether it does what a sequence asks."""
        return self.mode is Mode.AUTOMATIC

    def preset(self, values: Mapping[str, float]) -> None:
        """Put the line into a state, as `given` and `set` of a test do (`PRESETS`); all of them or none.

        Raises:
            ValueError: no such preset, a value out of its range, or values that would have the car touch something.
        """
        presets.put(self, values)
        self.edges.take_stock()
        self._map.forget()

    # ---- one scan

    def _scan(self) -> None:
        machine = self.machine
        powered = (
            not self.fault and not self.horizontal.cut,
            not self.fault and not self.vertical.cut and self.interlock.oil_pressure() is Block.FREE,
        )
        machine.step(
            self.horizontal.ramp.speed,
            self.vertical.ramp.speed,
            powered,
            0 if self.fault else self.mandrel_drive,
            self.dt,
        )
        if machine.winding and machine.coil >= self.settings["order_diameter"]:
            machine.winding, machine.finished = False, True
        self._crane_takes()
        self.interlock.renew()
        self.edges.look()
        self._hold_when_unsafe()
        self._host()
        self.choose_target()
        self._movements.step()

    def _crane_takes(self) -> None:
        machine = self.machine
        if machine.crane:
            for n, there in enumerate(machine.saddles):
                if there and machine.laid[n] >= machine.crane and not machine.below(n + 1):
                    machine.saddles[n] = 0.0

    def _hold_when_unsafe(self) -> None:
        machine = self.machine
        if self.fault:
            return
        if machine.emergency_stop:
            self.trip(Fault.EMERGENCY_STOP)
        elif not all(machine.guard(n) for n in (1, 2, 3)):
            self.trip(Fault.GUARD)
        elif not machine.drive_ready(1):
            self.trip(Fault.DRIVE_HORIZONTAL)
        elif not machine.drive_ready(2):
            self.trip(Fault.DRIVE_VERTICAL)
        elif self.interlocks and machine.hit is not Hit.NONE:
            self.trip(Fault.COLLISION)

    def _host(self) -> None:
        silent, before = float(self.host_silent), self._silent
        if silent != before:
            self._silent = silent
            self.event(CoilCarEvent.HOST_SILENT if silent else CoilCarEvent.HOST_BACK)
            if silent:
                self.mode = Mode.OFF

    def _execute(self, request: Request) -> Verdict:
        return self._commands.execute(request)

    # ---- settings, training, power

    @property
    def host_timeout(self) -> float:
        return self.settings["host_timeout"]

    def _host_deaf(self) -> bool:
        return self.machine.fault == HOST_OFF

    def _settings_fault(self, values: Mapping[str, float]) -> int:
        if not self.geometry.coil_smallest < values["order_diameter"] <= self.geometry.coil_largest:
            return [setting.name for setting in SETTINGS].index("order_diameter") + 1
        return 0

    def _settings_changed(self) -> None:
        self._take_settings()
        self.event(CoilCarEvent.SETTINGS)

    def _take_settings(self) -> None:
        values = self.settings
        for axis, name in ((self.horizontal, "horizontal"), (self.vertical, "vertical")):
            axis.ramp.acceleration_limit = values[f"acceleration_{name}"]
            axis.ramp.jerk = values[f"jerk_{name}"]

    def _trained(self, address: int, word: int) -> None:
        machine = self.machine
        if address == own.REG_STRIP:
            machine.strip = bool(word)
        elif address == own.REG_GROWTH:
            machine.growth = word / 10
        elif address == own.REG_CRANE:
            machine.crane = float(word)
        elif address == training.REG_MACHINE_FAULT:
            machine.fault = word

    def _forget(self) -> None:
        machine = self.machine = CoilCar(self.geometry)
        machine.growth, machine.crane = self._growth, self._crane
        self.preset_diameter = self.settings["order_diameter"]
        if self._coil_there:
            machine.coil, machine.finished = self.preset_diameter, True
        self.target_selected = self.coils_done = self.coils_wound = 0
        self._start_mode = self._start_in
        self._getters = signals.name_signals(self)

    def _power_up(self) -> None:
        values = self.settings
        self.mode, self._start_mode = self._start_mode, Mode.OFF
        self.fault = Fault.NONE
        self.horizontal = Axis(values["acceleration_horizontal"], values["jerk_horizontal"])
        self.vertical = Axis(values["acceleration_vertical"], values["jerk_vertical"])
        self.horizontal.cut = self.vertical.cut = True
        self.machine.winding = False
        self.action, self.action_state = 0, ActionState.NONE
        self.target = self.mandrel_drive = 0
        self.held_back = Block.FREE
        self._silent = 0.0
        self.stopping = False
        self.interlock, self.edges, self.recoiler = Interlock(self), Edges(self), Recoiler(self)
        self._movements, self._commands = Movements(self, self.recoiler), CarCommands(self, self.recoiler)
        self.edges.take_stock()
        self.choose_target()
        self.event(CoilCarEvent.POWER_UP, value=self.boots)
