"""A virtual PLC that runs a coil car under a recoiler: its program, 10 ms a scan, over `machine`; its registers: `register_map`.

The transport itself is a sequence in another device (`VirtualSequence`, app/sim/sequence/program.py): it asks `ACTIONS` of this one and reads its
signals, which are the points of this map by name. Type code 30. Measures and numbers are taken here; thesis 001 gives the steps only.

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
from math import isnan, nan
from types import MappingProxyType

from app.registers.plc_map import AnswerState, Request
from app.sim import training
from app.sim.coil_car import presets, signals
from app.sim.coil_car import training as own
from app.sim.coil_car.actions import ARRIVED, Demand, block_of, demand_of, is_there, jogged
from app.sim.coil_car.axis import Axis
from app.sim.coil_car.edges import Edges
from app.sim.coil_car.interlock import Interlock, InterlockedCar
from app.sim.coil_car.machine import FAULTS, HOST_OFF, CoilCar, Geometry, Hit
from app.sim.coil_car.recoiler import Recoiler
from app.sim.coil_car.register_map import (
    ACTIONS,
    CONFIGURATION,
    CONFIGURATION_WORDS,
    DOWN,
    EXPAND,
    FORWARD,
    SADDLES,
    SETTINGS,
    SETTINGS_AT,
    SIGNALS,
    STAGING,
    STARTS,
    STATUS,
    STATUS_WORDS,
    UP,
    WIND,
    ActionState,
    Block,
    CoilCarCommand,
    CoilCarEvent,
    CoilCarReason,
    Fault,
    Mode,
    checked_settings,
)
from app.sim.plc import EVENT_CAPACITY, Image, Setting, Verdict
from app.sim.plc import rejected as no

STUCK_AFTER = 6.0
"""The mandrel must have arrived in this time [s]."""


class VirtualCoilCar(InterlockedCar):
    """The PLC of one coil-car line."""

    type = "coil_car"
    TYPE_CODE = own.TYPE_CODE
    signals: Sequence[str] = SIGNALS
    actions: Sequence[str] = ACTIONS

    edges: Edges
    recoiler: Recoiler
    _asked: tuple[str, ...]
    _demand: Demand | None
    _action_since: int
    _mandrel_age: float
    _told: tuple[int, int]
    _start_mode: Mode
    _acting: int
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
            raise ValueError(f"start = {start}: expected {', '.join(STARTS)}")
        for name, value, low, high in (("growth", growth, 0.1, 6000.0), ("crane", crane, 0.0, 6000.0)):
            if not low <= value <= high:
                raise ValueError(f"{name} = {value:g}: expected {low:g} to {high:g}")
        given = checked_settings(dict(settings or {}))
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
        self._asked = (*self._asked, *actions)

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
        self._move()

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
            self._trip(Fault.EMERGENCY_STOP)
        elif not all(machine.guard(n) for n in (1, 2, 3)):
            self._trip(Fault.GUARD)
        elif not machine.drive_ready(1):
            self._trip(Fault.DRIVE_HORIZONTAL)
        elif not machine.drive_ready(2):
            self._trip(Fault.DRIVE_VERTICAL)
        elif self.interlocks and machine.hit is not Hit.NONE:
            self._trip(Fault.COLLISION)

    def _trip(self, fault: Fault) -> None:
        """Brakes on, mode off, until a reset."""
        self.fault, self.mode = fault, Mode.OFF
        self.machine.winding = False

    def _host(self) -> None:
        silent, before = float(self.host_silent), self._silent
        if silent != before:
            self._silent = silent
            self.event(CoilCarEvent.HOST_SILENT if silent else CoilCarEvent.HOST_BACK)
            if silent:
                self.mode = Mode.OFF

    # ---- movements

    def _move(self) -> None:
        self._judge_cut(self.horizontal, True)
        self._judge_cut(self.vertical, False)
        demand = self._demanded()
        self._demand = demand
        self.held_back = Block.FREE
        mandrel = 0
        horizontal = vertical = False
        if demand is not None:
            block = block_of(self, demand)
            if block not in (Block.FREE, Block.THERE):
                self.held_back = block
            elif demand.horizontal:
                horizontal = self._go(self.horizontal, demand)
            elif demand.movement in (UP, DOWN):
                vertical = self._go(self.vertical, demand)
            elif block is Block.FREE:
                mandrel = 1 if demand.movement == EXPAND else -1
        if not horizontal:
            self.horizontal.stop(self.dt)
            self.horizontal.target = nan
        if not vertical:
            self.vertical.stop(self.dt)
            self.vertical.target = nan
        if not mandrel:
            mandrel = self.recoiler.step()
        self._watch_mandrel(mandrel)
        self.mandrel_drive = mandrel
        self._tell_blocks(demand)
        self._follow_action(demand)
        if self.stopping and not self.moving:
            self.stopping = False

    def _judge_cut(self, axis: Axis, horizontal: bool) -> None:
        """Brake when there is no more supply, or less room than the ramp needs."""
        machine = self.machine
        speed = machine.speed_x if horizontal else machine.speed_v
        if self.fault or axis.cut or (not horizontal and self.interlock.oil_pressure() is not Block.FREE):
            axis.ramp.reset()
            axis.cut = axis.cut and speed != 0.0
            axis.braking = False
            return
        if not speed and not axis.ramp.speed:
            return
        way = self.interlock.way(horizontal)
        here = machine.x if horizontal else machine.v
        end = here + axis.ramp.stop_distance()
        if not way.low - 1 <= end <= way.high + 1:
            axis.cut = True
            axis.ramp.reset()

    def _go(self, axis: Axis, demand: Demand) -> bool:
        """Move; False when there is nothing to move."""
        machine = self.machine
        here = machine.x if demand.horizontal else machine.v
        way, up = self.interlock.way(demand.horizontal), demand.movement in (FORWARD, UP)
        end = way.high if up else way.low
        if not isnan(demand.target):
            end = min(max(demand.target, way.low), way.high)
        axis.target = end
        standing = self.standing_x if demand.horizontal else self.standing_v
        if axis.cut or (standing and abs(end - here) <= ARRIVED):
            return False
        axis.go(1 if up else -1, demand.speed, (end - here) * (1 if up else -1), self.dt)
        return True

    def _demanded(self) -> Demand | None:
        asked, self._asked = self._asked, ()
        self._acting = 0
        if self.mode is Mode.MANUAL and not self.stopping:
            return jogged(self)
        if self.mode is Mode.AUTOMATIC and not self.stopping:
            for name in asked:
                if name in ACTIONS:
                    self._acting = ACTIONS.index(name) + 1
                    return demand_of(self, name)
        return None

    def _watch_mandrel(self, mandrel: int) -> None:
        if mandrel and mandrel == self.mandrel_drive:
            self._mandrel_age += self.dt
            if self._mandrel_age > STUCK_AFTER and not self.fault:
                self.event(CoilCarEvent.MANDREL_STUCK)
                self._trip(Fault.MANDREL)
        else:
            self._mandrel_age = 0.0

    def _tell_blocks(self, demand: Demand | None) -> None:
        if demand is None:
            self._told = (-1, 0)
            return
        told = (demand.movement, int(self.held_back))
        if told != self._told:
            self._told = told
            if self.held_back is not Block.FREE:
                self.event(CoilCarEvent.INTERLOCK, demand.movement + 1, float(self.held_back))

    def _follow_action(self, demand: Demand | None) -> None:
        if self._acting != self.action:
            self.action, self._action_since = self._acting, self.time
            self.action_state = ActionState.RUNNING if self.action else ActionState.NONE
            if self.action:
                self.event(CoilCarEvent.ACTION_BEGUN, self.action)
        if not self.action or demand is None:
            return
        if self.held_back is not Block.FREE:
            self.action_state = ActionState.BLOCKED
        elif is_there(self, demand):
            if self.action_state is not ActionState.DONE:
                self.action_state = ActionState.DONE
                self.event(CoilCarEvent.ACTION_DONE, self.action, (self.time - self._action_since) / 1e6)
        else:
            self.action_state = ActionState.RUNNING

    # ---- commands

    def _execute(self, request: Request) -> Verdict:
        code, first = request.code, request.arguments[0]
        self.interlock.renew()
        if code == CoilCarCommand.STOP:
            return self._stop()
        if code == CoilCarCommand.RESET:
            return self._reset()
        if code in (CoilCarCommand.AUTOMATIC, CoilCarCommand.MANUAL):
            return self._change_mode(Mode.AUTOMATIC if code == CoilCarCommand.AUTOMATIC else Mode.MANUAL)
        if code == CoilCarCommand.TARGET:
            if not 0 <= first <= SADDLES:
                return no(CoilCarReason.NO_SUCH_SADDLE)
            if self.machine.load and self._asked_to_move():
                return no(CoilCarReason.MOVING)
            self.target_selected = first
            self.choose_target()
            self.event(CoilCarEvent.TARGET, first)
            return Verdict()
        if code == CoilCarCommand.REMOVED:
            return self._removed(first)
        if code in (CoilCarCommand.WIND, CoilCarCommand.STOP_WINDING):
            return self._winding(code)
        return no(CoilCarReason.UNKNOWN)

    def _asked_to_move(self) -> bool:
        return not self.standing_x

    def _stop(self) -> Verdict:
        self.event(CoilCarEvent.STOP)
        self.mode = Mode.OFF
        self.machine.winding = False
        if not self.moving:
            return Verdict()
        self.stopping = True

        def standing() -> AnswerState:
            return AnswerState.RUNNING if self.moving else AnswerState.DONE

        return Verdict(AnswerState.RUNNING, until=standing)

    def _reset(self) -> Verdict:
        machine = self.machine
        if machine.emergency_stop:
            return no(CoilCarReason.EMERGENCY_STOP)
        if not all(machine.guard(n) for n in (1, 2, 3)):
            return no(CoilCarReason.GUARD)
        if self.moving:
            return no(CoilCarReason.MOVING)
        if machine.hit is not Hit.NONE and self.interlocks:
            return no(CoilCarReason.HELD, Fault.COLLISION)
        self.event(CoilCarEvent.RESET)
        self.fault = Fault.NONE
        return Verdict()

    def _change_mode(self, mode: Mode) -> Verdict:
        machine = self.machine
        if machine.emergency_stop:
            return no(CoilCarReason.EMERGENCY_STOP)
        if not all(machine.guard(n) for n in (1, 2, 3)):
            return no(CoilCarReason.GUARD)
        if self.fault:
            return no(CoilCarReason.HELD, self.fault)
        if mode is self.mode and not self.stopping:
            return Verdict()
        if self.moving or self.hold:
            return no(CoilCarReason.MOVING)
        if mode is Mode.AUTOMATIC and self.host_silent:
            return no(CoilCarReason.WRONG_STATE, self.state)
        self.mode, self.recoiler.told_not_to = mode, False
        self.event(CoilCarEvent.AUTOMATIC if mode is Mode.AUTOMATIC else CoilCarEvent.MANUAL)
        return Verdict()

    def _removed(self, number: int) -> Verdict:
        machine = self.machine
        if not 1 <= number <= SADDLES:
            return no(CoilCarReason.NO_SUCH_SADDLE)
        if not machine.saddles[number - 1]:
            return no(CoilCarReason.SADDLE_EMPTY, number)
        if machine.below(number):
            return no(CoilCarReason.CRANE_BLOCKED, number)
        machine.saddles[number - 1] = 0.0
        return Verdict(detail=number)

    def _winding(self, code: int) -> Verdict:
        machine = self.machine
        if code == CoilCarCommand.STOP_WINDING:
            if not machine.winding:
                return no(CoilCarReason.NOT_WINDING)
            machine.winding, self.recoiler.told_not_to = False, True
            return Verdict()
        if self.mode is Mode.OFF and not self.fault:
            return no(CoilCarReason.WRONG_STATE, self.state)
        block = self.interlock.block(WIND)
        if block is not Block.FREE:
            return no(_WINDING_REASONS[block])
        self.recoiler.wind, self.recoiler.told_not_to = True, False
        return Verdict()

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
        self._acting = self._action_since = self.target = self.mandrel_drive = 0
        self._asked = ()
        self._demand = None
        self.held_back = Block.FREE
        self._mandrel_age = self._silent = 0.0
        self.stopping = False
        self._told = (-1, 0)
        self.interlock, self.edges, self.recoiler = Interlock(self), Edges(self), Recoiler(self)
        self.edges.take_stock()
        self.choose_target()
        self.event(CoilCarEvent.POWER_UP, value=self.boots)


_WINDING_REASONS: Mapping[Block, CoilCarReason] = MappingProxyType(
    {
        Block.EMERGENCY_STOP: CoilCarReason.EMERGENCY_STOP,
        Block.GUARD: CoilCarReason.GUARD,
        Block.HELD: CoilCarReason.HELD,
        Block.PRESSURE: CoilCarReason.HYDRAULICS,
        Block.OIL: CoilCarReason.HYDRAULICS,
        Block.WINDING: CoilCarReason.WINDING,
        Block.COIL_THERE: CoilCarReason.COIL_ON_MANDREL,
        Block.NOT_COLLAPSED: CoilCarReason.NOT_EXPANDED,
        Block.MANDREL: CoilCarReason.NOT_EXPANDED,
        Block.CAR: CoilCarReason.CAR_IN_THE_WAY,
    }
)
