"""Whatever belts, beams and people do: order kept, nothing overlaps, nothing vanishes, every millimetre accounted for."""

import itertools
import json
from math import isfinite

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from app.blocks.product_tracking import Code, EditRefused, LineLayout, Product, ProductState, ProductTracking, Settings

from .belt_line import BeltLine

LINES = (
    LineLayout(),
    LineLayout(slots=3),
    LineLayout(belt_ends=(400.0,), sensors=(50.0, 300.0), area_ends=(200.0, 400.0), slots=6),
    LineLayout((100.0, 200.0, 300.0, 400.0, 500.0), (40.0, 100.0, 250.0, 480.0, 490.0), (250.0, 500.0), 5),
)
MOVES = st.one_of(st.just(0.0), st.floats(-3, 3).map(lambda x: round(x, 3)), st.sampled_from([0.6, -0.6, 12.0, -12.0]))
STOPS = st.one_of(st.just(0.0), st.floats(-60, 60).map(lambda x: round(x, 2)))


@st.composite
def cycles(draw: st.DrawFn, belts: int, sensors: int) -> tuple[list[float], int, list[float], int, str]:
    """Movements (often all belts alike), beams to toggle, distances to stop, how often, and what a person does."""
    same = draw(st.booleans())
    moved = [draw(MOVES)] * belts if same else draw(st.lists(MOVES, min_size=belts, max_size=belts))
    stops = [draw(STOPS)] * belts if same else draw(st.lists(STOPS, min_size=belts, max_size=belts))
    toggle = draw(st.one_of(st.just(0), st.integers(0, 2**sensors - 1), st.sampled_from([1, 2, 1 << (sensors - 1)])))
    act = draw(st.sampled_from(["", "", "", "", "delete", "edit", "insert", "confirm", "power", "restore", "release"]))
    return moved, toggle, stops, draw(st.sampled_from([1, 1, 5, 40, 120])), act


def held_together(tracking: ProductTracking) -> None:
    """What must be true after every scan and every edit."""
    inside = [product for product in tracking.slots if product]
    on_line = tracking.products
    for front, rear in itertools.pairwise(on_line):
        assert rear.right <= front.left + 1e-5, (front, rear)
    for product in inside:
        assert isfinite(product.right) and product.length >= 0.0
        assert product.right >= product.left
        ahead = product.tail - product.head if product.swapped else product.head - product.tail
        assert ahead >= 0.0
        assert tracking.slots[product.slot] is product
        assert product.state is not ProductState.EMPTY
    assert len({product.id for product in inside}) == len(inside)
    assert {id(product) for product in on_line} <= {id(product) for product in inside}
    for product in inside:
        assert product in on_line or product.state is ProductState.LOST
    came = tracking.entered + tracking.found + tracking.inserted
    went = tracking.unloaded + tracking.deleted + tracking.withdrawn + tracking.left
    assert came == len(inside) + went
    assert tracking.buffer_full is (len(inside) == tracking.line.slots)
    unloading = [product for product in inside if product.state is ProductState.UNLOADING]
    assert len(unloading) <= tracking.brake and (inside or not tracking.brake)


def way_of(left: float, right: float, ends: tuple[float, ...], moved: list[float]) -> float:
    """What the belts under a product move it, by their share of its length."""
    lying = [max(0.0, min(right, end) - max(left, begin)) for begin, end in zip((0.0, *ends), ends, strict=False)]
    return sum(part * way for part, way in zip(lying, moved, strict=True)) / sum(lying) if sum(lying) else 0.0


def act_on(tracking: ProductTracking, act: str, number: int, time_us: int) -> ProductTracking:
    ids = [product.id for product in tracking.slots if product]
    chosen = ids[number % len(ids)] if ids else 99
    try:
        match act:
            case "delete":
                tracking.delete(chosen)
            case "edit":
                tracking.edit(chosen, float(number % int(tracking.line.length)), 20.0)
            case "insert":
                tracking.insert(float(number % int(tracking.line.length)), 25.0, time_us)
            case "confirm":
                tracking.confirm(chosen if number % 2 else 0)
            case "power":
                tracking.power_up()
            case "release":
                tracking.release_gap_stop()
            case "restore":
                retained = tracking.snapshot()
                fresh = ProductTracking(tracking.line, tracking.settings)
                fresh.restore(json.loads(json.dumps(retained)))
                again = fresh.snapshot()
                assert [row["id"] for row in again["products"]] == [row["id"] for row in retained["products"]]
                assert again["counters"] == retained["counters"] and again["next_id"] == retained["next_id"]
                tracking = fresh
    except EditRefused:
        pass
    return tracking


@pytest.mark.sweep(8)
@settings(max_examples=300, deadline=None)
@given(st.data())
def test_any_scan_and_any_edit_keeps_the_table_whole(data: st.DataObject) -> None:
    line = data.draw(st.sampled_from(LINES))
    tracking = ProductTracking(line, Settings(unload_dwell=data.draw(st.sampled_from([0.0, 0.05]))))
    beams = [False] * len(line.sensors)
    time_us = 0
    steps = data.draw(st.lists(cycles(len(line.belt_ends), len(line.sensors)), min_size=1, max_size=25))
    for number, (moved, toggle, stops, times, act) in enumerate(steps):
        tracking = act_on(tracking, act, number * 37, time_us)
        held_together(tracking)
        beams = [beam ^ bool(toggle >> n & 1) for n, beam in enumerate(beams)]
        for _ in range(times):
            time_us += 10_000
            before = {p.id: (p.right - p.displacement - p.shifted, p.slot, p.entered_us) for p in tracking.slots if p}
            gone = {p.id for p in tracking.slots if p}
            ways = {
                p.id: p.displacement + way_of(p.left, p.right, line.belt_ends, moved)
                for p in tracking.products
                if p.length > 0 and p.open_at < 0
            }
            events = tracking.scan(moved, beams, stops, time_us)
            held_together(tracking)
            for product in filter(None, tracking.slots):
                gone.discard(product.id)
                if product.id in before:
                    origin, slot, entered = before[product.id]
                    assert abs(product.right - product.displacement - product.shifted - origin) < 1e-6
                    assert (product.slot, product.entered_us) == (slot, entered)
                assert abs(product.displacement - ways.get(product.id, product.displacement)) < 1e-6
            told = {event.id for event in events if event.code in (Code.UNLOADED, Code.WITHDRAWN, Code.LEFT_BACKWARDS)}
            assert gone <= told, "a record vanished without an event"


@pytest.mark.sweep(8)
@settings(max_examples=100, deadline=None)
@given(st.lists(st.tuples(st.sampled_from([0.6, -0.6, 0.0, 1.1, -0.3]), st.integers(1, 150)), min_size=1, max_size=12))
def test_displacement_of_a_product_is_what_the_encoder_counted(course: list[tuple[float, int]]) -> None:
    tracking = ProductTracking(LineLayout(), Settings(lost_after=100.0))
    tracking.insert(330.0, 30.0, 0)
    product = tracking.products[0]
    start, odometer = product.right, 0.0
    for moved, times in course:
        for n in range(times):
            if not product.left + moved > 60 or product.right + moved > 650:
                return
            odometer += moved
            tracking.scan([moved] * 3, [False] * 4, [0.0] * 3, n)
            assert abs(product.displacement - odometer) < 1e-6
            assert abs(product.right - start - odometer - product.shifted) < 1e-6


@pytest.mark.sweep(8)
@settings(max_examples=60, deadline=None)
@given(
    st.floats(11, 80),
    st.floats(1, 30),
    st.lists(st.tuples(st.sampled_from([(0, 0), (1, 0), (0, 1), (1, 1)]), st.integers(5, 150)), max_size=12),
    st.sampled_from([0, 1]),
)
@example(11.0, 9.0, [((1, 0), 72), ((0, 1), 32)], 0)  # one belt ahead, then the other: both went 9 mm, the product 11
def test_a_product_that_nobody_knows_is_never_withdrawn_at_a_border_of_belts(
    length: float, before: float, course: list[tuple[tuple[int, int], int]], border: int
) -> None:
    line = BeltLine()
    line.run(30.0, 0.1)
    line.put(line.tracking.line.belt_ends[border] - before, length)
    for running, times in [*course, ((1, 1), 800)]:
        speeds = [0.0, 0.0, 0.0]
        speeds[border], speeds[border + 1] = 30.0 * running[0], 30.0 * running[1]
        for _ in range(times):
            line.step(speeds)
            if line.tracking.gap_stop:
                line.events += line.tracking.release_gap_stop()
            held_together(line.tracking)
    assert line.tracking.withdrawn == 0
    assert line.tracking.unexpected > 0


def true_and_tracked(line: BeltLine) -> list[tuple[float, float, Product]]:
    """Pairs of real and tracked products, front-most first (right end, length)."""
    known = [product for product in line.tracking.products if product.open_at < 0]
    pairs = []
    for product in known:
        thing = min(line.things, key=lambda thing: abs(thing.right - product.right))
        pairs.append((thing.right, thing.length, product))
    return pairs


@pytest.mark.sweep(8)
@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.tuples(st.sampled_from([30.0, 60.0, 100.0, -20.0, 0.0]), st.integers(5, 200)), min_size=1, max_size=12),
    st.lists(st.tuples(st.floats(12, 140), st.floats(8, 120)), min_size=1, max_size=12),
    st.sampled_from([0.0, 0.003, -0.003]),
    st.sampled_from([0.005, 0.01, 0.02]),
)
def test_position_is_within_the_sensor_tolerance_of_the_truth(
    course: list[tuple[float, int]], arrivals: list[tuple[float, float]], slip: float, dt: float
) -> None:
    line = BeltLine(dt=dt, slip=slip)
    tracking = line.tracking
    line.tracking.settings = Settings(unload_dwell=0.1)
    waiting = list(arrivals)
    for target, times in [*course, (50.0, 400)]:
        for _ in range(times):
            if waiting and all(thing.left > waiting[0][1] for thing in line.things):
                line.put(0.5, waiting.pop(0)[0])
            line.step([target] * 3)
            if tracking.gap_stop and all(ramp.speed == 0 for ramp in line.ramps):
                line.events += tracking.release_gap_stop()
            held_together(tracking)
            for right, length, product in true_and_tracked(line):
                assert abs(product.right - right) <= tracking.settings.sensor_tolerance, product
                assert abs(product.length - length) <= 2.0, product
    assert tracking.lost == tracking.unexpected == 0
    seen = sum(1 for event in line.events if event.code is Code.ARRIVED)
    assert tracking.entered == seen
    order = [product.id for product in tracking.products]
    assert order == sorted(order)
