"""The drives of the conveyor: which speed each belt is given, the ramp to it, and what their supervision finds."""

from app.sim.conveyor.belt import Finding
from app.sim.conveyor.plausibility import make_belt_uncertain
from app.sim.conveyor.register_map import BELT_BITS, BELT_NUMBER, ConveyorEvent, Source
from app.sim.conveyor.state import LineState

SELECTIONS = (Source.NONE, Source.STOP, Source.GAP, Source.UNLOADING, Source.MANUAL, Source.AUTOMATIC)
"""Selection of SEL_5R → source; the first wins always."""
FASTEST_BY_HAND = 50.0
"""Hold-to-run may ask for so much [%]."""


class BeltDrives:
    """The drives of one line, from a power-up on."""

    def __init__(self, line: LineState) -> None:
        self._line = line
        self.setpoints = [0.0] * line.geometry.belts
        """Of the drives [%]."""
        self.enabled = True
        """They have supply."""

    def supervise(self) -> None:
        """Compare drives and encoders; a finding makes products uncertain or is a fault."""
        line = self._line
        jam_time, limited = line.settings["jam_time"], line.machine.limited
        for number, belt in enumerate(line.belts):
            found = belt.supervise(self.setpoints[number], line.scale, limited[number], self.enabled, jam_time)
            if found is Finding.NONE:
                continue
            begin, end = (0.0, *line.geometry.belt_ends)[number : number + 2]
            make_belt_uncertain(line.tracking.products, begin, end, across=found is Finding.JAM)
            if found is not Finding.DEVIATION:
                self._fail(ConveyorEvent.JAM if found is Finding.JAM else ConveyorEvent.ENCODER, number)

    def follow(self) -> None:
        """Choose every belt's speed and follow it with the ramp."""
        line = self._line
        values, follow = line.settings, line.tracking
        stop = line.stop_active
        automatic = line.modes.running and not stop
        gap = follow.gap_stop
        manual = 0.0
        if line.direction:
            asked = line.hold_argument
            manual = line.direction * (min(asked, FASTEST_BY_HAND) if asked > 0 else values["manual_speed"])
        few, other = line.hold >> BELT_BITS & 7, line.hold >> BELT_NUMBER & 31
        chosen = few | 1 << other >> 1 or -1
        speed, shares = values["automatic_speed"] / 100, line.geometry.speed_shares
        last = len(line.belts) - 1
        waiting = max(line.gates.held_belt, line.merges.held_belt) if automatic else -1
        for number, belt in enumerate(line.belts):
            hold = automatic and ((number == 0 and follow.buffer_full) or (number == last and follow.brake))
            at_gate = number <= waiting and not hold
            by_hand = manual if chosen >> number & 1 else 0.0
            active = (stop, gap, hold or at_gate, by_hand != 0.0, automatic and not (gap or hold or at_gate))
            selected = belt.selector.step(active, (0.0, 0.0, 0.0, by_hand, speed * shares[number]))
            belt.source, belt.target = SELECTIONS[selected.selection], selected.value
            if at_gate and belt.source is Source.UNLOADING:
                belt.source = Source.GATE
            belt.follow(line.dt, line.time, supplied=self.enabled)
            self.setpoints[number] = belt.ramp.speed
        if line.moving or not self.enabled or line.faulty:
            line.name_ramps()

    def reset(self) -> None:
        """Try again what a jam or an encoder stopped, and tell that it is over."""
        line = self._line
        for number, belt in enumerate(line.belts, 1):
            if belt.jammed:
                line.event(ConveyorEvent.JAM_OFF, number)
            if belt.encoder_fault:
                line.event(ConveyorEvent.ENCODER_OK, number)
            belt.reset(line.scale)
        line.faulty = False

    def _fail(self, code: ConveyorEvent, belt: int) -> None:
        line = self._line
        value = line.belts[belt].ramp.speed
        line.event(code, belt + 1, value)
        line.stopped_by(code, belt + 1, value)
        line.faulty = True
