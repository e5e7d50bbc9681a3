"""Diverting gates: each product goes where its label or its turn says, none is lost or doubled, and a gate that does not arrive is told."""

from itertools import pairwise

import pytest

from app.blocks.product_tracking import Code, GatePosition
from app.plant import types
from app.registers.codec import decode
from app.registers.plc_map import AnswerState
from app.sim import training
from app.sim.conveyor.blades import GATE_FAULTS, GatePlan, Rule
from app.sim.conveyor.machine import Geometry
from app.sim.conveyor.program import VirtualConveyor
from app.sim.conveyor.register_map import GATE_COMMANDS, ConveyorCommand, ConveyorEvent, ConveyorReason, Source
from app.sim.conveyor.scanner import ReadingState
from tests.sim.conveyor.bench import QUICK, put
from tests.sim.conveyor.layouts import layout_with_gates
from tests.sim.conveyor.line import TestLine

LINE = Geometry(gates=(GatePlan(330.0, Rule.CLASS, 2.0),))
"""A gate on belt 2, between S2 and S3; the scanner stands at S2."""


def sorting(geometry: Geometry = LINE, **options: object) -> VirtualConveyor:
    given = {"start": "automatic", "interval": 4.0, "settings": QUICK, "scanner": 2, "not_read": 5.0, **options}
    return VirtualConveyor(geometry, **given)  # type: ignore[arg-type]


class Watch:
    """Which way every true product and every record went at each gate."""

    def __init__(self, plc: VirtualConveyor) -> None:
        self.plc = plc
        self.true: dict[int, tuple[int, int]] = {}
        """Number → (class, lane that it went into, 0 = none)."""
        self.told: list[tuple[int, int]] = []
        """(record, gate) of `DIVERTED`."""
        self.read: dict[int, tuple[ReadingState, int]] = {}
        report = plc.report

        def heard(event):  # type: ignore[no-untyped-def]
            if event.code == Code.DIVERTED:
                self.told.append((event.id, event.source))
            report(event)

        plc.report = heard  # type: ignore[method-assign]

    def go(self, seconds: float) -> None:
        plc = self.plc
        for _ in range(round(seconds * 100)):
            plc.step()
            for product in plc.machine.products:
                self.true[product.number] = (product.label.category, product.lane)
            for id, reading in plc.scanner.readings.items():
                self.read[id] = (reading.state, reading.label.category)


def whole(plc: VirtualConveyor) -> None:
    """Every product and every record has gone exactly one way."""
    machine, follow = plc.machine, plc.tracking
    gone = machine.unloaded + machine.removed + machine.fallen + machine.backed_out + machine.blades.diverted
    assert machine.entered + machine.put == len(machine.products) + gone
    gone = follow.unloaded + follow.deleted + follow.withdrawn + follow.left + sum(follow.diverted)
    records = sum(1 for one in follow.slots if one)
    assert follow.entered + follow.found + follow.inserted == records + gone


@pytest.mark.sweep(8)
def test_a_gate_diverts_the_class_that_the_scanner_read_and_no_other() -> None:
    watch = Watch(sorting())
    watch.go(300)
    plc = watch.plc
    whole(plc)
    assert sum(plc.tracking.diverted) == plc.machine.blades.diverted > 5
    assert plc.tracking.unloaded > 5
    assert (plc.tracking.lost, plc.tracking.found, plc.machine.collisions, plc.machine.fallen) == (0, 0, 0, 0)
    assert plc.gates.all[0].misrouted == 0
    diverted = {id for id, _ in watch.told}
    assert diverted == {
        id
        for id, (state, category) in watch.read.items()
        if state is ReadingState.READ and category == 2 and id <= max(diverted) and id in diverted | passed(watch)
    }
    for id in passed(watch):
        assert watch.read[id] != (ReadingState.READ, 2)
    assert any(state is ReadingState.NOT_READ for state, _ in watch.read.values()), "what is not read goes straight on"
    assert all(category == 2 for category, lane in watch.true.values() if lane)


def passed(watch: Watch) -> set[int]:
    """Records that are behind the gate, or were."""
    here = {one.id for one in watch.plc.tracking.slots if one and not one.gates}
    return (
        set(watch.read)
        - {id for id, _ in watch.told}
        - here
        - {one.id for one in watch.plc.tracking.slots if one and one.lane}
    )


@pytest.mark.sweep(8)
def test_an_alternating_gate_takes_every_second_one() -> None:
    watch = Watch(sorting(Geometry(gates=(GatePlan(330.0, Rule.ALTERNATING),)), scanner=0, not_read=0.0))
    watch.go(200)
    ids = [id for id, _ in watch.told]
    assert len(ids) > 8 and ids == list(range(1, ids[-1] + 1, 2))
    whole(watch.plc)


@pytest.mark.sweep(8)
def test_a_gate_counts_only_products_that_come_to_it() -> None:
    """The second of two alternating gates takes every second one of those that the first leaves."""
    plans = GatePlan(300.0, Rule.ALTERNATING), GatePlan(330.0, Rule.ALTERNATING)
    watch = Watch(sorting(Geometry(gates=plans), scanner=0, not_read=0.0))
    watch.go(240)
    lanes = dict(watch.told)
    first, second = ([id for id, gate in lanes.items() if gate == n] for n in (1, 2))
    assert len(second) > 4
    assert first == list(range(1, first[-1] + 1, 2)) and second == list(range(2, second[-1] + 1, 4))
    assert [gate.misrouted for gate in watch.plc.gates.all] == [0, 0]
    whole(watch.plc)


def sweep(seed: int, seconds: float) -> int:
    geometry = layout_with_gates(seed)
    plc = sorting(geometry, seed=seed, scanner=1, not_read=2.0, slots=60, settings={**QUICK, "longest": 80.0})
    watch = Watch(plc)
    for _ in range(round(seconds)):
        watch.go(1)
        whole(plc)
        records = plc.tracking.products
        for front, rear in pairwise(records):
            assert rear.right <= front.left + 1e-6, "records do not overlap"
    machine, follow = plc.machine, plc.tracking
    assert (follow.lost, follow.found, follow.refused, follow.uncertain) == (0, 0, 0, False)
    assert (machine.fallen, machine.backed_out, machine.collisions) == (0, 0, 0)
    assert abs(sum(follow.diverted) - machine.blades.diverted) <= 1
    assert abs(follow.unloaded - machine.unloaded) <= 1
    # a record of a lane is the product that went there
    lanes = {number: lane for number, (_, lane) in watch.true.items() if lane}
    told = dict(watch.told)
    assert all(lanes[id] == lane for id, lane in told.items()), "products are numbered as they come, as records are"
    return sum(follow.diverted)


@pytest.mark.sweep(8)
@pytest.mark.parametrize("seed", range(4))
def test_none_is_lost_or_doubled_on_any_line_with_gates(seed: int) -> None:
    assert sweep(seed, 90) > 3


@pytest.mark.soak
@pytest.mark.parametrize("seed", range(100, 140))
def test_none_is_lost_or_doubled_on_forty_lines_with_gates(seed: int) -> None:
    sweep(seed, 900)


@pytest.mark.sweep(8)
async def test_a_gate_that_does_not_arrive_holds_the_product_and_is_told_until_it_does() -> None:
    line = TestLine(sorting(Geometry(gates=(GatePlan(330.0, Rule.ALTERNATING, 0.0, 0.8),)), scanner=0))
    await line.train(training.REG_MACHINE_FAULT, GATE_FAULTS + 1)
    await line.until_event(ConveyorEvent.GATE_FAULT, 1)
    line.go(20)
    plc = line.device
    gate = plc.gates.all[0]
    assert gate.fault and gate.held and not gate.arrived
    first = next(one for one in plc.tracking.products if one.id == 1)
    assert 320 < first.right < 330 and not plc.belts[0].ramp.speed
    assert plc.belts[1].source == Source.GATE and plc.belts[2].source == Source.AUTOMATIC
    assert sum(plc.tracking.diverted) == plc.tracking.unloaded == 0
    await line.train(training.REG_MACHINE_FAULT, 0)
    await line.until_event(ConveyorEvent.GATE_OK, 1)
    line.go(20)
    assert plc.tracking.diverted == [1] or plc.tracking.diverted[0] > 1
    assert gate.misrouted == 0
    whole(plc)


async def test_by_hand_a_gate_moves_in_manual_only_and_never_under_a_product() -> None:
    line = TestLine(sorting(start="stopped", arrivals=False))
    plc = line.device
    gate, code = plc.gates.all[0], GATE_COMMANDS
    refused = await line.order(code + 1)
    assert (refused.state, refused.reason) == (AnswerState.REJECTED, ConveyorReason.NOT_MANUAL)
    await line.done(ConveyorCommand.MANUAL)
    await line.done(code + 1)
    line.go(1)
    assert gate.position is GatePosition.LANE
    assert (await line.order(code + 3)).reason == ConveyorReason.UNKNOWN, "there is one gate"

    id = await put(line, 325.0, 40.0)
    await line.hold(1, 1.2, 20.0)
    await line.stand()
    product = next(one for one in plc.tracking.products if one.id == id)
    assert product.lane == 1 and product.right == 330.0 and 0 < product.away < 40 and product.whole == pytest.approx(40)
    refused = await line.order(code)
    assert refused.reason == ConveyorReason.GATE_OCCUPIED
    await line.hold(2, 3.0, 20.0)
    await line.stand()
    assert product.lane == 0 and product.right < 330 and product.length == pytest.approx(40, abs=0.5), "out again"
    assert abs(plc.machine.products[0].head - product.right) < 2
    await line.hold(1, 12.0, 20.0)
    await line.stand()
    assert plc.tracking.diverted == [1] and plc.machine.blades.diverted == 1 and not plc.tracking.products
    await line.until_event(Code.DIVERTED, 1)
    await line.done(code)
    line.go(1)
    assert gate.position is GatePosition.STRAIGHT
    whole(plc)


@pytest.mark.sweep(8)
async def test_a_gate_by_hand_is_turned_while_the_line_runs() -> None:
    line = TestLine(sorting(Geometry(gates=(GatePlan(330.0, Rule.HAND),)), scanner=0))
    line.go(40)
    plc = line.device
    assert plc.tracking.diverted == [0] and plc.tracking.unloaded
    await line.done(GATE_COMMANDS + 1)
    line.go(60)
    assert plc.tracking.diverted[0] > 5
    whole(plc)
    assert plc.machine.collisions == plc.tracking.lost == 0


async def test_gates_and_what_is_in_them_outlive_the_supply() -> None:
    line = TestLine(sorting(Geometry(gates=(GatePlan(330.0, Rule.HAND),)), scanner=0, start="stopped", arrivals=False))
    await line.done(ConveyorCommand.MANUAL)
    await line.done(GATE_COMMANDS + 1)
    line.go(1)
    id = await put(line, 325.0, 40.0)
    await line.hold(1, 1.2, 20.0)
    await line.stand()
    away = line.device.tracking.products[0].away
    await line.train(0xE031, 1)
    line.go(0.5)
    product = line.device.tracking.products[0]
    assert (product.id, product.lane, product.away) == (id, 1, away) and line.device.gates.all[0].lane
    whole(line.device)


@pytest.mark.sweep(8)
def test_the_type_reads_what_the_plc_says_of_its_gates() -> None:
    geometry = Geometry(gates=(GatePlan(270.0, Rule.ALTERNATING, 0.0, 0.7), GatePlan(330.5, Rule.CLASS, 2.0)))
    plc = sorting(geometry)
    for _ in range(9000):
        plc.step()
    data, problems = types.read_type("conveyor", ["en"], given={"gates": 2, "scanner": 2})
    assert problems == []

    def value(key: str) -> float:
        register = data.type.points[key].register
        assert register, key
        found = decode(register, plc.read(3, register.address, register.words))
        assert isinstance(found, int | float), key
        return found

    assert value("device_gates") == 2
    for n, (gate, plan) in enumerate(zip(plc.gates.all, geometry.gates, strict=True), 1):
        assert value(f"gate_position_{n}") == gate.position
        assert value(f"gate_target_{n}") == gate.lane
        assert (value(f"gate_fault_{n}"), value(f"gate_waiting_{n}")) == (gate.fault, gate.held)
        assert value(f"diverted_{n}") == plc.tracking.diverted[n - 1]
        assert value(f"misrouted_{n}") == gate.misrouted
        told = [value(f"device_gate_{n}_{key}") for key in ("at", "rule", "value", "time")]
        assert told == pytest.approx([plan.at, plan.rule, plan.value, plan.time])
    assert plc.tracking.diverted[0] > 2
    assert data.type.device.plc and {image.address: image.since for image in data.type.device.plc.images}[0x2600] == 5
