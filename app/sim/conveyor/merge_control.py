"""The merging gates in the conveyor's program: who goes first, and when a product of a lane is let in.

| subject | rule |
| --- | --- |
| gap | a product is let in only where the line is free for its length and the gap of the plan on both sides (`merging.room`) |
| line first | the lane takes the gaps that come |
| lane first | while something is in the lane, what the line brings waits at the end of the belt before |
| in turn | after each product of the lane one of the line, if one is on its belt or the one before, and after that the lane first |
| too near | what cannot stand at the end of that belt any more passes first; so does what is on the lane's own belt |
| no room there | a belt whose end is nearer to the gate than the product needs is not held: the lane takes the gaps that come |
| too long | a product that cannot come in without reaching before the first sensor, or into a diverting gate behind, stays in its lane |
| by hand | open: into any gap, whoever's turn it is, in manual too, while its belt goes forward; closed: nobody goes in |
| blocked | it has waited for longer than the limit, while the line ran; told once, and once when it is over; then the line waits no more |
| buffer full | nobody is let in |
"""

from bisect import bisect_left

from app.blocks.product_tracking import Product
from app.blocks.product_tracking.merging import let_in, room
from app.sim.conveyor.lanes import Mode
from app.sim.conveyor.merges import GateOrder, Merge
from app.sim.conveyor.register_map import ConveyorEvent, ConveyorReason
from app.sim.conveyor.state import LineState

_CLEAR = 5.0
"""What has come in reaches at most so near to a diverting gate behind [mm]."""


class MergeControl:
    """Decides for the merging gates of one line, from a power-up on."""

    def __init__(self, line: LineState) -> None:
        self._line = line
        self._all = line.merges.all

    def order(self, number: int, what: int) -> int:
        """What an operator asks of gate `number` (from 1): the reason why not, 0 = done."""
        line = self._line
        if not 1 <= number <= len(self._all):
            return ConveyorReason.UNKNOWN
        if line.held and what != GateOrder.CLOSED:
            return ConveyorReason.EMERGENCY_STOP
        self._all[number - 1].order = GateOrder(what)
        events = (ConveyorEvent.MERGE_AUTOMATIC, ConveyorEvent.MERGE_OPEN, ConveyorEvent.MERGE_CLOSED)
        line.event(events[what], number)
        return 0

    def measure(self) -> None:
        """Read the eyes of the lanes; what has begun to go in gets its record. Before tracking."""
        lanes = self._line.machine.lanes
        for n, merge in enumerate(self._all):
            merge.present = lanes.present[n]
            if lanes.started[n] > merge.started:
                self._begin(n, merge)
            merge.started = lanes.started[n]
            merge.length = lanes.measured(n)

    def step(self, *, automatic: bool) -> None:
        """One scan, after tracking."""
        for n, merge in enumerate(self._all):
            merge.merging = any(product.coming == n + 1 for product in self._line.tracking.products)
            self._take_turns(merge)
            merge.open = not merge.merging and self._may_go(merge, automatic=automatic)
            merge.holds = self._held_belt(merge) if automatic else -1
            self._watch(n, merge, automatic=automatic)

    def _begin(self, n: int, merge: Merge) -> None:
        line = self._line
        for event in let_in(line.tracking, n, merge.length, merge.waited, line.time):
            line.report(event)
        line.renew_table()
        merge.waited, merge.turn, merge.passing = 0.0, False, 0

    def _take_turns(self, merge: Merge) -> None:
        """Whether a product of the line has passed since the lane's last one; with none of it near it is the lane's turn, too."""
        x = merge.plan.at
        if merge.passing:
            product = next((one for one in self._line.tracking.products if one.id == merge.passing), None)
            if product is None or product.left >= x:
                merge.turn, merge.passing = True, 0
        if not merge.passing:
            product = next((one for one in self._line.tracking.products if self._near(one, x)), None)
            merge.passing = product.id if product else 0
            if product is None and not merge.merging:
                merge.turn = True

    def _near(self, product: Product, x: float) -> bool:
        """It comes to the gate from its belt, or from the one before."""
        belts = (0.0, 0.0, *self._line.geometry.belt_ends)
        begin = belts[self._belt(x)]
        return self._of_the_line(product) and product.left < x and product.right > begin

    def _of_the_line(self, product: Product) -> bool:
        return product.may_be_there and not product.lane and not product.coming

    def _may_go(self, merge: Merge, *, automatic: bool) -> bool:
        line, x = self._line, merge.plan.at
        if not merge.length or merge.order is GateOrder.CLOSED or line.tracking.buffer_full:
            return False
        belt = line.belts[self._belt(x)]
        forward = belt.ramp.speed > 0 and belt.target > 0
        if not forward or (merge.order is GateOrder.AUTOMATIC and not automatic):
            return False
        in_turn = merge.plan.mode == Mode.IN_TURN and merge.order is GateOrder.AUTOMATIC
        if in_turn and merge.passing and not merge.turn:
            return False
        return self._fits(merge) and self._has_room(merge)

    def _has_room(self, merge: Merge) -> bool:
        line, plan = self._line, merge.plan
        near = line.settings["sensor_tolerance"]
        return room(
            line.tracking.products,
            plan.at,
            merge.length,
            plan.gap + near,
            line.geometry.sensors[0],
            self._rate(plan.at),
        )

    def _rate(self, x: float) -> float:
        """By so much a belt before the gate may go faster than the one that it is on."""
        shares = self._line.geometry.speed_shares
        own = self._belt(x)
        return max(shares[: own + 1]) / shares[own]

    def _belt(self, x: float) -> int:
        return bisect_left(self._line.geometry.belt_ends, x)

    def _fits(self, merge: Merge) -> bool:
        line, plan = self._line, merge.plan
        gates = [gate.at for gate in line.geometry.gates if gate.at > plan.at]
        behind = self._needs(merge)
        return plan.at - behind >= line.geometry.sensors[0] and all(plan.at + merge.length + _CLEAR <= x for x in gates)

    def _needs(self, merge: Merge) -> float:
        """Free way before the gate [mm]."""
        plan = merge.plan
        near = self._line.settings["sensor_tolerance"]
        return plan.gap + near + merge.length * max(1.0, self._rate(plan.at))

    def _held_belt(self, merge: Merge) -> int:
        """The last belt that waits, so that the lane can go first."""
        own = self._belt(merge.plan.at)
        if merge.plan.mode == Mode.LINE or not merge.present or not own or merge.order is not GateOrder.AUTOMATIC:
            return -1
        line = self._line
        if merge.blocked or (merge.length and not self._fits(merge)):
            return -1
        end = line.geometry.belt_ends[own - 1]
        near = line.settings["sensor_tolerance"]
        if end > merge.plan.at - (self._needs(merge) if merge.length else 0.0) - near:
            return -1
        products = line.tracking.products
        one_passes = any(self._of_the_line(one) and one.left < merge.plan.at and one.right > end for one in products)
        if merge.plan.mode == Mode.IN_TURN and not merge.turn and not one_passes:
            return -1
        if any(one.may_be_there and one.left < end < one.right for one in products):
            return -1
        way = line.belts[own - 1].stop_distance() * line.scale
        comes = next((one for one in products if one.may_be_there and not one.lane and one.right <= end), None)
        way_left = end - comes.right - way if comes else near + 1
        if way_left > near or (way_left < 0.0 and merge.holds < 0):
            return -1
        return own - 1

    def _watch(self, n: int, merge: Merge, *, automatic: bool) -> None:
        line = self._line
        if not merge.length:
            merge.waited = 0.0
        elif automatic or line.moving:
            merge.waited += line.dt
        late = merge.waited > merge.plan.limit
        if late is not merge.blocked:
            merge.blocked = late
            line.event(ConveyorEvent.MERGE_BLOCKED if late else ConveyorEvent.MERGE_FREE, n + 1, merge.waited)
