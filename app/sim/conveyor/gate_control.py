"""The diverting gates in the conveyor's program: which way the next product has to go, the way of the gate there, and what must wait.

| subject | rule |
| --- | --- |
| next product | the front-most one whose head is before the gate and that no gate before is to divert; nothing is decided twice |
| not read | goes straight on, as does what the rule does not name |
| on its way | a gate is moved only when no product is in it, or so near behind it that the sensor tolerance counts |
| waiting | in automatic the belts up to the product wait for a gate that is not where this product needs it |
| too near | a product that cannot stand before the gate any more goes the way of the one before it; it is told as gone the wrong way |
| fault | not at its end within its time; the product for which it moves waits; it ends when the gate arrives |
| by hand | in manual mode, or a gate whose rule is "by hand" at any time; not while a product is in it |
"""

from bisect import bisect_left, bisect_right

from app.blocks.mode_control import Mode
from app.blocks.product_tracking import Product
from app.sim.conveyor.blades import Rule
from app.sim.conveyor.gates import Gate
from app.sim.conveyor.register_map import ConveyorEvent, ConveyorReason, words_of
from app.sim.conveyor.scanner import ReadingState
from app.sim.conveyor.state import LineState

_CLEAR = 1.0
"""What is so far behind the gate has left it [mm]."""
_ROOM = 2.0
"""Before the gate a product must be able to stand with so much room [mm], else the gate is not moved any more."""


class GateControl:
    """Decides for the gates of one line, from a power-up on."""

    def __init__(self, line: LineState) -> None:
        self._line = line
        self._all = line.gates.all

    def step(self, *, automatic: bool, supplied: bool) -> None:
        """One scan, after tracking."""
        for n, gate in enumerate(self._all):
            self._supervise(n, gate, supplied)
            gate.held = False
            self._judge(n, gate)
            if automatic:
                self._steer(gate)
        self._line.gates.held_belt = self._held_belt()

    def _held_belt(self) -> int:
        found = -1
        for gate in self._all:
            if gate.held and (product := self._next(gate)):
                ends = self._line.geometry.belt_ends
                found = max(found, min(bisect_left(ends, product.right), len(ends) - 1))
        return found

    def order(self, number: int, lane: bool) -> int:
        """What an operator asks of gate `number` (from 1): the reason why not, 0 = done."""
        line = self._line
        if not 1 <= number <= len(self._all):
            return ConveyorReason.UNKNOWN
        gate = self._all[number - 1]
        if line.held:
            return ConveyorReason.EMERGENCY_STOP
        if line.modes.mode is not Mode.MANUAL and gate.plan.rule != Rule.HAND:
            return ConveyorReason.NOT_MANUAL
        if not line.modes.running:
            if lane is not gate.lane and self._in_it(gate):
                return ConveyorReason.GATE_OCCUPIED
            gate.lane = lane
        gate.by_hand = lane
        line.event(ConveyorEvent.GATE_LANE if lane else ConveyorEvent.GATE_STRAIGHT, number)
        return 0

    def _supervise(self, n: int, gate: Gate, supplied: bool) -> None:
        if gate.arrived:
            gate.moving = 0.0
            if gate.fault:
                gate.fault = False
                self._line.event(ConveyorEvent.GATE_OK, n + 1)
        elif supplied:
            gate.moving += self._line.dt
            if gate.moving > gate.plan.time and not gate.fault:
                gate.fault = True
                self._line.event(ConveyorEvent.GATE_FAULT, n + 1, float(gate.lane))

    def _judge(self, n: int, gate: Gate) -> None:
        """Products that have come to the gate: whether they went the way that was decided."""
        if not gate.decided:
            return
        there = {product.id: product for product in self._line.tracking.products}
        for id, lane in list(gate.decided.items()):
            product = there.get(id)
            if product is None:
                del gate.decided[id]
            elif product.gates & 1 << n:
                del gate.decided[id]
                if (product.lane == n + 1) is not lane:
                    gate.misrouted += 1
                    self._line.event(ConveyorEvent.MISROUTED, n + 1, float(lane), words_of(id))

    def _steer(self, gate: Gate) -> None:
        product = self._next(gate)
        if product is None:
            if gate.plan.rule == Rule.HAND and not self._in_it(gate):
                gate.lane = gate.by_hand
            return
        wanted = self._decide(gate, product)
        if wanted is None:
            return
        room = gate.plan.at - product.right - self._stop_way(product)
        if wanted is not gate.lane:
            if room <= _ROOM or self._in_it(gate):
                return
            gate.lane = wanted
        gate.held = not gate.arrived and room <= self._line.settings["sensor_tolerance"]

    def _decide(self, gate: Gate, product: Product) -> bool | None:
        """Into the lane or not; None = its label may still be read."""
        plan, line = gate.plan, self._line
        if plan.rule == Rule.HAND:
            return gate.by_hand
        if product.id in gate.decided:
            return gate.decided[product.id]
        if plan.rule == Rule.ALTERNATING:
            lane = gate.other = not gate.other
        else:
            state, label, _ = line.scanner.of(product.id)
            if state == ReadingState.NONE and product.right < self._read_at():
                return None
            told = {Rule.CLASS: label.category == plan.value, Rule.ORDER: label.order == plan.value}
            lane = state == ReadingState.READ and told.get(Rule(plan.rule), label.weight > plan.value)
        gate.decided[product.id] = lane
        return lane

    def _read_at(self) -> float:
        """Behind this the scanner has read what it can [mm]."""
        sensor = self._line.scanner.sensor
        return self._line.geometry.sensors[sensor - 1] + self._line.settings["lost_after"] if sensor else 0.0

    def _next(self, gate: Gate) -> Product | None:
        at, number = gate.plan.at, self._all.index(gate)
        for product in self._line.tracking.products:
            if not product.may_be_there or product.lane or product.gates & 1 << number or product.right > at:
                continue
            ways = [self._way(n, product) for n in range(number) if not product.gates & 1 << n]
            if None in ways:
                return None
            if True not in ways:
                return product
        return None

    def _way(self, number: int, product: Product) -> bool | None:
        """Into the lane or not, as was decided for it at the gate `number`; None = not yet."""
        gate = self._all[number]
        return gate.by_hand if gate.plan.rule == Rule.HAND else gate.decided.get(product.id)

    def _in_it(self, gate: Gate) -> bool:
        """A product is in it, by its record, or has hardly left it."""
        x, n = gate.plan.at, self._all.index(gate)
        products = self._line.tracking.products
        bit, behind = 1 << n, x + _CLEAR
        return any(p.may_be_there and p.gates & bit and (p.lane == n + 1 or p.left < behind) for p in products)

    def _stop_way(self, product: Product) -> float:
        """On which the belts under it come to a stop, at most [mm]."""
        line, ends = self._line, self._line.geometry.belt_ends
        last = len(ends) - 1
        first = min(bisect_right(ends, max(product.left, 0.0)), last)
        behind = min(bisect_left(ends, product.right), last)
        return max(line.belts[n].stop_distance() for n in range(first, max(first, behind) + 1)) * line.scale
