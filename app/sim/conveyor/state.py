"""What the conveyor's PLC knows of its line, as its images show it."""

from app.blocks import product_tracking as tracking
from app.blocks.mode_control import ModeControl
from app.blocks.product_tracking import ProductTracking, TrackingEvent
from app.sim.conveyor.belt import Belt
from app.sim.conveyor.first_out import FirstOut, StopCause
from app.sim.conveyor.gates import Gates
from app.sim.conveyor.machine import Conveyor, Geometry
from app.sim.conveyor.merges import Merges
from app.sim.conveyor.register_map import ConveyorEvent, ConveyorState, reading_words, words_of
from app.sim.conveyor.scanner import ReadingState, Scanner
from app.sim.plc import Table, VirtualPlc


class LineState(VirtualPlc):
    """State of one line; what happens to it is decided in `program`."""

    geometry: Geometry
    line: tracking.LineLayout
    machine: Conveyor
    """The line as it really is; only tests and screens of the class room look here."""
    tracking: ProductTracking
    belts: tuple[Belt, ...]
    modes: ModeControl
    first_out: FirstOut
    moving: bool
    pressed: bool
    """The emergency stop is."""
    stopping: bool
    """A stop, or the end of automatic, is not over."""
    held: bool
    """After an emergency stop, until reset."""
    faulty: bool
    """A drive or an encoder, until reset."""
    direction: int
    """In which the belts are driven by hand: 1 forward, −1 reverse, 0 not at all."""
    table: Table
    """The products."""
    readings: Table
    """What the scanner read of them, in the same slots."""
    scanner: Scanner
    gates: Gates
    merges: Merges
    origins: Table
    """Where the products came from, in the same slots."""
    ramps: Table
    """The last start and stop of every belt."""
    scale: float
    """Speed of a belt at one per cent [mm/s per %]."""

    @property
    def state(self) -> int:
        """State word."""
        if self.held:
            return ConveyorState.EMERGENCY_STOP
        if self.faulty:
            return ConveyorState.FAULT
        if self.tracking.gap_stop:
            return ConveyorState.GAP
        if self.stopping:
            return ConveyorState.STOPPING
        if self.modes.running:
            return ConveyorState.AUTOMATIC if all(belt.target for belt in self.belts) else ConveyorState.WAITING
        if self.moving:
            return ConveyorState.MANUAL if self.direction else ConveyorState.STOPPING
        return ConveyorState.STOPPED

    @property
    def stop_active(self) -> bool:
        """Something holds the line, or is about to."""
        return self.stopping or self.held or self.faulty

    def stopped_by(self, code: int, source: int = 0, value: float = 0.0, *, rear: int = 0, front: int = 0) -> None:
        """Something stops the line now; the first one is shown until a reset."""
        self.first_out.add(StopCause(code, source, rear, front, self.time, value))

    def report(self, event: TrackingEvent) -> None:
        """Put what tracking found into the ring."""
        self.event(event.code, event.source, event.value, words_of(event.id, event.second, event.value2))

    def scan_label(self, event: TrackingEvent) -> None:
        """Let the scanner read the label of the product that has come to it."""
        scanner = self.scanner
        if not scanner.sees(event) or not scanner.take(event.id, self.machine.scanned(scanner.sensor), self.time):
            return
        state, label, _ = scanner.of(event.id)
        code = ConveyorEvent.READ if state == ReadingState.READ else ConveyorEvent.NOT_READ
        self.event(code, scanner.sensor, label.weight, reading_words(event.id, label.order, label.category))

    def name_ramps(self) -> None:
        """A belt has started or stopped for the first time since power-up: its row is there."""
        for number, belt in enumerate(self.belts):
            for slot, record in ((2 * number, belt.record.start), (2 * number + 1, belt.record.stop)):
                if record and not self.ramps.ids[slot]:
                    self.ramps.ids[slot] = slot + 1
                    self.ramps.generation = self.ramps.generation + 2 & 0xFFFE

    def renew_table(self) -> None:
        """Products have come, gone or changed places."""
        ids = [product.id if product else 0 for product in self.tracking.slots]
        if ids != self.table.ids:
            self.scanner.keep(ids)
            for table in (self.table, self.readings, self.origins):
                table.ids = list(ids)
                table.generation = table.generation + 2 & 0xFFFE
