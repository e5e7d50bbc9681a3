"""Merging gates: products of a lane come in where there is a gap, by the mode of the gate, and every record is the product that it was."""

from dataclasses import replace
from itertools import pairwise

import pytest

from app.blocks.product_tracking import Code
from app.plant import types
from app.registers.codec import decode
from app.registers.plc_map import AnswerState
from app.sim import training
from app.sim.conveyor import training as own
from app.sim.conveyor.lanes import MERGE_FAULTS, MergePlan, Mode
from app.sim.conveyor.machine import Geometry
from app.sim.conveyor.merges import GateOrder, MergeState
from app.sim.conveyor.program import VirtualConveyor
from app.sim.conveyor.register_map import (
    MERGE_COMMANDS,
    MERGE_PLANS,
    MERGES,
    ConveyorCommand,
    ConveyorEvent,
    ConveyorReason,
    Source,
)
from tests.sim.conveyor.bench import QUICK
from tests.sim.conveyor.layouts import NEAR, layout_with_lanes
from tests.sim.conveyor.line import TestLine

AT = 400.0
"""On belt 2, 185 mm behind its beginning, 45 mm before S3."""


def joined(mode: Mode = Mode.LINE, at: float = AT, **options: object) -> VirtualConveyor:
    plan = MergePlan(at, mode, 15.0, 20.0)
    given = {"start": "automatic", "interval": 4.0, "settings": QUICK, "longest": 40.0, **options}
    return VirtualConveyor(Geometry(merges=(plan,)), **given)  # type: ignore[arg-type]


class Watch:
    """Where every product and every record came from, in the order in which they leave the line."""

    def __init__(self, plc: VirtualConveyor) -> None:
        self.plc = plc
        self.told: list[tuple[Code, int, int]] = []
        """Code, source and product."""
        report = plc.report

        def heard(event):  # type: ignore[no-untyped-def]
            self.told.append((event.code, event.source, event.id))
            report(event)

        plc.report = heard  # type: ignore[method-assign]

    def go(self, seconds: float) -> None:
        """Let it run; records stand where their products are, in their order, and know where those came from."""
        plc = self.plc
        for scan in range(round(seconds * 100)):
            plc.step()
            if scan % 10 == 0:
                self.compare()

    def compare(self) -> None:
        plc = self.plc
        first = plc.geometry.sensors[0] + NEAR
        true = [one for one in plc.machine.products if one.head > first]
        known = [one for one in plc.tracking.products if one.right > first]
        if len(true) != len(known):  # one that is just being taken, or stands at the border
            assert abs(len(true) - len(known)) <= 1, (true, known)
            return
        for product, record in zip(true, known, strict=True):
            assert abs(product.head - record.right) < NEAR, (product, record)
            assert product.origin == record.origin
        for front, rear in pairwise(known):
            assert rear.right <= front.left + 1e-6, "records do not overlap"

    def came(self) -> dict[int, int]:
        """Record → lane that it came from, of those that were unloaded or diverted."""
        gone = {id for code, _, id in self.told if code in (Code.UNLOADED, Code.DIVERTED)}
        return {id: source if code is Code.MERGED else 0 for code, source, id in self.told
                if id in gone and code in (Code.ARRIVED, Code.MERGED)}  # fmt: skip

    def passed(self) -> list[int]:
        """Lane of each product in the order in which they were unloaded."""
        lanes = self.came()
        return [lanes[id] for code, _, id in self.told if code is Code.UNLOADED]


def whole(plc: VirtualConveyor) -> None:
    """Every product and every record is there once."""
    machine, follow, lanes = plc.machine, plc.tracking, plc.machine.lanes
    gone = machine.unloaded + machine.removed + machine.fallen + machine.backed_out + machine.blades.diverted
    assert machine.entered + machine.put + machine.merged - machine.returned == len(machine.products) + gone
    waiting = sum(len(queue) for queue in lanes.waiting)
    assert sum(lanes.arrived) == waiting + machine.merged - machine.returned
    records = sum(1 for one in follow.slots if one)
    gone = follow.unloaded + follow.deleted + follow.withdrawn + follow.left + sum(follow.diverted)
    assert follow.entered + follow.found + follow.inserted + sum(follow.merged) == records + gone


def sound(plc: VirtualConveyor) -> None:
    """Nothing was lost, found, pushed or refused."""
    machine, follow = plc.machine, plc.tracking
    whole(plc)
    assert (follow.lost, follow.found, follow.refused, follow.unexpected) == (0, 0, 0, 0)
    assert (machine.fallen, machine.backed_out, machine.collisions) == (0, 0, 0)
    assert sum(follow.merged) == machine.merged
    assert abs(follow.unloaded - machine.unloaded) <= 1


@pytest.mark.sweep(8)
@pytest.mark.parametrize("mode", Mode)
def test_products_of_a_lane_come_in_between_those_of_the_line(mode: Mode) -> None:
    watch = Watch(joined(mode, interval=6.0, lane_interval=8.0))
    watch.go(300)
    sound(watch.plc)
    lanes = watch.came()
    assert sum(lanes.values()) > 8 and list(lanes.values()).count(0) > 8
    ids = [id for code, _, id in watch.told if code is Code.UNLOADED]
    assert ids != sorted(ids), "a later record that came in before an earlier one leaves before it"


@pytest.mark.sweep(8)
def test_with_the_line_first_the_lane_waits_as_long_as_there_is_no_gap() -> None:
    watch = Watch(joined(Mode.LINE, interval=0.6, lane_interval=0.0))
    plc = watch.plc
    watch.go(30)
    plc.write(6, own.REG_LANE_PUT, [1])
    watch.go(10)
    merge = plc.merges.all[0]
    assert merge.state is MergeState.WAITING and plc.tracking.merged == [0] and merge.waited > 8
    plc.machine.arrivals = False
    watch.go(20)
    assert plc.tracking.merged == [1] and merge.state is MergeState.FREE and merge.waited == 0
    sound(plc)


@pytest.mark.sweep(8)
def test_with_the_lane_first_the_line_waits_at_the_end_of_the_belt_before() -> None:
    watch = Watch(joined(Mode.LANE, interval=1.0, lane_interval=0.0))
    plc = watch.plc
    watch.go(20)
    for _ in range(3):
        plc.write(6, own.REG_LANE_PUT, [1])
        plc.step()
    held = 0
    for _ in range(200):
        watch.go(0.1)
        if plc.belts[0].source == Source.GATE:
            held += 1
            assert plc.belts[1].source != Source.GATE, "the lane's own belt runs on"
    assert held > 5 and plc.tracking.merged == [3]
    watch.go(60)
    sound(plc)
    assert plc.merges.held_belt == -1
    lanes = watch.passed()
    first = lanes.index(1)
    assert lanes[first : first + 3].count(1) >= 2, lanes


@pytest.mark.sweep(8)
def test_in_turn_they_go_one_by_one() -> None:
    watch = Watch(joined(Mode.IN_TURN, interval=1.0, lane_interval=1.0))
    watch.go(240)
    sound(watch.plc)
    lanes = watch.passed()[4:]
    assert len(lanes) > 20
    # now and then one cannot stand at the end of its belt any more
    assert sum(a != b for a, b in pairwise(lanes)) > 0.9 * (len(lanes) - 1), lanes


async def test_a_product_of_the_lane_has_its_length_its_lane_and_its_place() -> None:
    line = TestLine(joined(start="automatic", arrivals=False, lane_interval=0.0))
    plc = line.device
    line.go(2)
    await line.train(own.REG_LANE_PUT, 1)
    line.go(0.3)
    assert plc.merges.all[0].state is MergeState.WAITING
    event = await line.until_event(Code.MERGED, 1)
    length = plc.machine.products[0].length + plc.machine.products[0].away
    (record,) = plc.tracking.products
    assert (record.whole, record.origin, record.coming) == (pytest.approx(length), 1, 1)
    assert record.left == AT and record.right < AT + 2 and event.value < 1
    assert plc.merges.all[0].state is MergeState.MERGING
    line.go(0.4)
    assert record.coming and record.left == AT and 0 < record.away < length
    line.go(1.2)
    assert not record.coming and record.left > AT and record.length == pytest.approx(length)
    await line.until(lambda: plc.tracking.unloaded == 1)
    assert [code for code, _ in await line.codes() if code in (Code.UNEXPECTED, Code.LENGTH_DIFFERS)] == []


async def test_closed_by_hand_nobody_goes_in_and_the_wait_is_told_once() -> None:
    line = TestLine(joined(arrivals=False, lane_interval=0.0))
    plc = line.device
    await line.done(MERGE_COMMANDS + GateOrder.CLOSED)
    await line.train(own.REG_LANE_PUT, 1)
    event = await line.until_event(ConveyorEvent.MERGE_BLOCKED, 1)
    assert event.value == pytest.approx(20, abs=0.1)
    merge = plc.merges.all[0]
    assert merge.state is MergeState.BLOCKED and plc.tracking.merged == [0]
    await line.done(MERGE_COMMANDS + GateOrder.AUTOMATIC)
    await line.until_event(ConveyorEvent.MERGE_FREE, 1)
    line.go(3)
    assert plc.tracking.merged == [1] and merge.state is MergeState.FREE
    assert (await line.order(MERGE_COMMANDS + 3)).reason == ConveyorReason.UNKNOWN, "there is one gate"
    sound(plc)


async def test_by_hand_a_product_comes_in_and_goes_back_into_its_lane() -> None:
    line = TestLine(joined(start="stopped", arrivals=False, lane_interval=0.0))
    plc = line.device
    await line.done(ConveyorCommand.MANUAL)
    await line.train(own.REG_LANE_PUT, 1)
    line.go(2)
    await line.hold(1, 2.0, 20.0)
    await line.stand()
    assert plc.tracking.merged == [0], "in manual only an open gate lets in"
    await line.done(MERGE_COMMANDS + GateOrder.OPEN)
    await line.hold(1, 1.2, 20.0)
    await line.stand()
    (record,) = plc.tracking.products
    assert record.coming == 1 and 0 < record.length < record.whole
    await line.done(MERGE_COMMANDS + GateOrder.CLOSED)
    await line.hold(2, 4.0, 20.0)
    await line.stand()
    assert plc.tracking.products == [] and plc.machine.products == [] and plc.machine.returned == 1
    assert (Code.WITHDRAWN, 0) in await line.codes()
    whole(plc)
    line.go(1)
    assert plc.merges.all[0].state is MergeState.WAITING, "it stands at its stop again"


async def test_a_stop_that_does_not_open_is_told_and_holds_no_record() -> None:
    line = TestLine(joined(arrivals=False, lane_interval=0.0))
    plc = line.device
    await line.train(training.REG_MACHINE_FAULT, MERGE_FAULTS + 1)
    await line.train(own.REG_LANE_PUT, 1)
    await line.until_event(ConveyorEvent.MERGE_BLOCKED, 1)
    assert plc.tracking.products == []
    await line.train(training.REG_MACHINE_FAULT, 0)
    await line.until_event(ConveyorEvent.MERGE_FREE, 1)
    await line.until(lambda: plc.tracking.unloaded == 1)
    sound(plc)


async def test_what_comes_in_outlives_the_supply() -> None:
    line = TestLine(joined(start="stopped", arrivals=False, lane_interval=0.0))
    await line.done(ConveyorCommand.MANUAL)
    await line.done(MERGE_COMMANDS + GateOrder.OPEN)
    await line.train(own.REG_LANE_PUT, 1)
    line.go(2)
    await line.hold(1, 1.2, 20.0)
    await line.stand()
    before = line.device.tracking.products[0]
    await line.train(0xE031, 1)
    line.go(0.5)
    after = line.device.tracking.products[0]
    assert (after.id, after.coming, after.origin, after.away) == (before.id, 1, 1, before.away)
    assert line.device.merges.all[0].order is GateOrder.OPEN and line.device.tracking.merged == [1]
    refused = await line.order(MERGE_COMMANDS + 7)
    assert refused.state is AnswerState.REJECTED
    whole(line.device)


def test_one_that_is_too_long_for_its_place_stays_in_its_lane() -> None:
    plc = joined(at=150.0, shortest=60.0, longest=60.0, arrivals=False, lane_interval=5.0)
    watch = Watch(plc)
    watch.go(30)
    assert plc.tracking.merged == [0] and plc.merges.all[0].state is MergeState.BLOCKED


def sweep(seed: int, seconds: float) -> tuple[int, int]:
    geometry = layout_with_lanes(seed)
    plc = VirtualConveyor(
        geometry, seed=seed, start="automatic", interval=4.0, lane_interval=6.0, slots=60, scanner=1, not_read=2.0,
        settings={**QUICK, "longest": 80.0},
    )  # fmt: skip
    watch = Watch(plc)
    for _ in range(round(seconds)):
        watch.go(1)
        whole(plc)
    sound(plc)
    assert not plc.tracking.uncertain
    return sum(plc.tracking.merged), plc.tracking.entered


@pytest.mark.sweep(8)
@pytest.mark.parametrize("seed", range(4))
def test_none_is_lost_or_doubled_on_any_line_with_lanes(seed: int) -> None:
    merged, entered = sweep(seed, 90)
    assert merged > 2 and entered > 3


@pytest.mark.soak
@pytest.mark.parametrize("seed", range(100, 140))
def test_none_is_lost_or_doubled_on_forty_lines_with_lanes(seed: int) -> None:
    sweep(seed, 900)


@pytest.mark.sweep(8)
def test_the_type_reads_what_the_plc_says_of_its_merging_gates() -> None:
    plans = (MergePlan(250.0, Mode.LINE, 12.0, 30.0), MergePlan(400.5, Mode.IN_TURN, 20.0, 45.0))
    plc = VirtualConveyor(
        replace(Geometry(), merges=plans), start="automatic", settings=QUICK, longest=40.0, lane_interval=5.0
    )
    for _ in range(9000):
        plc.step()
    data, problems = types.read_type("conveyor", ["en"], given={"merges": 2})
    assert problems == []

    def value(key: str) -> float:
        register = data.type.points[key].register
        assert register, key
        found = decode(register, plc.read(3, register.address, register.words))
        assert isinstance(found, int | float), key
        return found

    assert value("device_merges") == 2
    for n, (merge, plan) in enumerate(zip(plc.merges.all, plans, strict=True), 1):
        assert (value(f"merge_state_{n}"), value(f"merge_gate_{n}")) == (merge.state, merge.order)
        assert (value(f"merge_ready_{n}"), value(f"merge_holds_{n}")) == (merge.length > 0, merge.holds >= 0)
        assert value(f"merged_{n}") == plc.tracking.merged[n - 1]
        assert value(f"merge_waited_{n}") == pytest.approx(merge.waited)
        told = [value(f"device_merge_{n}_{key}") for key in ("at", "mode", "gap", "limit")]
        assert told == pytest.approx([plan.at, plan.mode, plan.gap, plan.limit])
    assert sum(plc.tracking.merged) > 2
    assert data.type.device.plc
    since = {image.address: image.since for image in data.type.device.plc.images}
    assert (since[MERGES], since[MERGE_PLANS], data.type.tables["infeed"].since) == (6, 6, 6)
