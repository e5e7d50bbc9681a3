"""Product tracking with the numbers of the thesis: identity, movement, correction, gaps, unloading, and what it does not have."""

import math
from dataclasses import replace

import pytest

from app.blocks.product_tracking import (
    STUCK,
    Code,
    LineLayout,
    ProductState,
    Settings,
    TrackingEvent,
)
from tests.blocks.product_tracking.stand import SIMULATION, STANDING, Bench, put

from .belt_line import BeltLine, codes, line_with

# identity


def test_first_in_first_out() -> None:
    bench = Bench(lost_after=100.0)
    for length in (20, 30, 40):
        bench.arrive(length)
        bench.move(20)
    products = bench.tracking.products
    assert [product.id for product in products] == [1, 2, 3]
    assert [product.length for product in products] == [20, 30, 40]
    assert [product.tail for product in products] == [100 + 20 + 31 + 20 + 41 + 20, 100 + 20 + 41 + 20, 100 + 20]


def test_arrival_that_backs_out_is_withdrawn_and_comes_again_as_a_new_one() -> None:
    bench = Bench()
    bench.beam(1, True)
    bench.move(25)
    bench.move(-24)
    assert bench.tracking.products[0].length == 1
    events = bench.beam(1, False, -1.0)
    assert [(e.code, e.id, e.value) for e in events] == [(Code.WITHDRAWN, 1, 25.0)]
    assert not bench.tracking.products and bench.tracking.withdrawn == 1
    bench.move(-20)
    bench.move(20)
    assert bench.beam(1, True)[0] == TrackingEvent(Code.ARRIVED, 1, 2, 0, 100.0)
    bench.move(39)
    bench.beam(1, False)
    assert bench.tracking.products[0].length == 40


def test_a_hand_at_s1_is_no_product() -> None:
    bench = Bench()
    bench.beam(1, True, 0.0)
    assert [e.code for e in bench.beam(1, False, 0.0)] == [Code.WITHDRAWN]
    bench.beam(1, True)
    bench.move(4)
    assert [e.code for e in bench.beam(1, False)] == [Code.WITHDRAWN]
    assert not bench.tracking.products and bench.tracking.withdrawn == 2


# movement


# correction


# backwards


def test_backwards_past_s1_it_keeps_its_identity_until_position_0() -> None:
    bench = Bench()
    product = bench.arrive(30)
    bench.move(10)
    bench.move(-9)
    assert Code.HEAD_AT_SENSOR in codes(bench.beam(1, True, -1.0))
    bench.move(-29)
    assert Code.TAIL_AT_SENSOR in codes(bench.beam(1, False, -1.0))
    assert product.right == 100.0
    bench.move(-50)
    bench.move(49)
    assert [e.id for e in bench.beam(1, True) if e.code is Code.HEAD_AT_SENSOR] == [product.id]
    assert bench.tracking.entered == 1
    bench.move(-1)
    bench.beam(1, False, -1.0)
    events = bench.move(-120)
    assert [(e.code, e.id) for e in events] == [(Code.LEFT_BACKWARDS, product.id)]
    assert not bench.tracking.products and bench.tracking.left == 1


# lost and unexpected


def test_an_unknown_product_gets_a_record_that_is_uncertain_until_a_sensor_agrees() -> None:
    bench = Bench()
    bench.move(1)
    events = bench.beam(2, True)
    assert [(e.code, e.source, e.id) for e in events] == [(Code.UNEXPECTED, 2, 1)]
    bench.move(39)
    assert codes(bench.beam(2, False)) == [Code.IDENTIFIED]
    product = bench.tracking.products[0]
    assert (product.head, product.length, product.state) == (255.0, 40.0, ProductState.UNCERTAIN)
    assert bench.tracking.uncertain and bench.tracking.unexpected == bench.tracking.found == 1
    bench.move(189)
    bench.beam(3, True)
    assert product.state is ProductState.TRACKED


def test_a_product_that_is_off_by_more_than_the_tolerance_is_taken_again_and_uncertain() -> None:
    bench = Bench(sensor_tolerance=5.0, lost_after=10.0)
    product = put(bench, 207.0, 30.0)
    events = bench.beam(2, True)
    assert [(e.code, e.id, e.value) for e in events] == [(Code.UNEXPECTED, product.id, 7.0)]
    assert (product.head, product.state, len(bench.tracking.products)) == (215.0, ProductState.UNCERTAIN, 1)
    bench.move(20)
    assert bench.tracking.lost == 0


def test_an_overdue_product_found_under_the_sensor_is_that_product() -> None:
    bench = Bench()
    product = put(bench, 214.0, 40.0)
    bench.move(21)
    assert product.state is ProductState.LOST
    events = bench.beam(2, True)
    assert [(e.code, e.id, e.value) for e in events] == [(Code.UNEXPECTED, product.id, -21.0)]
    assert (product.head, product.state, len(bench.tracking.products)) == (215.0, ProductState.UNCERTAIN, 1)


def test_a_shorter_one_followed_by_another_is_cut_and_the_other_found() -> None:
    bench = Bench()
    product = put(bench, 214.0, 100.0)
    bench.beam(2, True)
    bench.move(39)
    assert not bench.beam(2, False)
    assert [(e.code, e.value) for e in bench.move(10)] == [(Code.LENGTH_DIFFERS, -60.0)]
    bench.move(9)
    events = bench.beam(2, True)
    assert codes(events) == [Code.UNEXPECTED] and events[0].id != product.id
    assert (product.length, product.tail) == (40.0, 235.0)


def test_a_product_that_touches_a_measured_one_from_behind_gets_a_record() -> None:
    bench = Bench()
    product = bench.arrive(40)
    bench.move(74)
    bench.beam(2, True)
    bench.move(59)
    events = bench.beam(2, False)
    assert codes(events) == [Code.LENGTH_DIFFERS, Code.UNEXPECTED]
    assert (events[0].id, events[0].value) == (product.id, 20.0)
    other = bench.tracking.products[1]
    assert (events[1].id, events[1].second, events[1].value2) == (other.id, product.id, 20.0)
    assert (product.left, product.right, product.state) == (235.0, 275.0, ProductState.UNCERTAIN)
    assert (other.left, other.right, other.state) == (215.0, 235.0, ProductState.UNCERTAIN)
    bench.move(170 - 1)
    bench.beam(3, True)
    bench.move(59)
    assert codes(bench.beam(3, False)) == [Code.TAIL_AT_SENSOR], "two in touch, both known: one beam, one tail"
    assert (other.left, product.left) == (445.0, 465.0)


def test_with_no_slot_left_a_product_that_touches_another_is_told_and_counted() -> None:
    bench = Bench(LineLayout(slots=1))
    product = bench.arrive(40)
    bench.move(74)
    bench.beam(2, True)
    bench.move(59)
    assert codes(bench.beam(2, False)) == [Code.LENGTH_DIFFERS, Code.UNEXPECTED, Code.BUFFER_FULL]
    assert bench.tracking.refused == 1 and bench.tracking.products == [product]


def test_what_two_of_a_chain_hide_between_them_gets_a_record() -> None:
    bench = Bench()
    front = bench.arrive(40)
    bench.move(1)
    rear = bench.arrive(30)
    bench.move(44)
    bench.beam(2, True)
    bench.move(89)
    events = bench.beam(2, False)
    assert Code.UNEXPECTED in codes(events), "20 mm more than both"
    assert [p.length for p in bench.tracking.products] == [40.0, 30.0, pytest.approx(18.0, abs=2.0)]
    assert rear.state is ProductState.UNCERTAIN and front in bench.tracking.products


def test_stuck_beam_is_suspected_and_its_ghost_found_out() -> None:
    bench = Bench(longest=150.0, lost_after=10.0)
    bench.beam(1, True)
    events = bench.move(161)
    assert (Code.SENSOR_SUSPECTED, 1, float(STUCK)) in [(e.code, e.source, e.value) for e in events]
    ghost = bench.tracking.products[0]
    assert (ghost.length, ghost.state) == (150.0, ProductState.LOST), "S2 did not see it"
    assert bench.tracking.sensor_faults == 1
    assert Code.SENSOR_OK in codes(bench.beam(1, False))
    assert bench.tracking.sensor_faults == 0


def test_products_inside_a_record_of_a_stuck_beam_are_told() -> None:
    bench = Bench(SIMULATION)
    bench.beam(1, True)
    record = bench.tracking.products[0]
    bench.move(75)
    told = []
    for _ in range(2):
        told += bench.beam(2, True)
        bench.move(19)
        told += bench.beam(2, False)
        bench.move(9)
    unexpected = [(e.source, e.id) for e in told if e.code is Code.UNEXPECTED]
    assert unexpected == [(2, record.id)] * 2, "both came while S1 was stuck, and have no record of their own"
    assert bench.tracking.products == [record]
    bench.beam(1, False)
    assert record.state is ProductState.UNCERTAIN


@pytest.mark.parametrize("state", [ProductState.TRACKED, ProductState.OUTSIDE])
def test_what_passes_a_stuck_sensor_is_uncertain(state: ProductState) -> None:
    bench = Bench()
    bench.beam(2, True, 0.0)
    bench.tracking.delete(bench.tracking.products[0].id)
    product = put(bench, 200.0, 30.0)
    product.state = state
    bench.move(100)
    assert product.state is ProductState.UNCERTAIN


@pytest.mark.parametrize(("length", "seconds"), [(20.0, 1.0), (20.0, 2.0), (30.0, 2.0), (45.0, 1.5)])
def test_an_unknown_product_across_a_border_keeps_its_record_while_the_belt_ahead_stands(
    length: float, seconds: float
) -> None:
    line = line_with()
    line.run(30.0, 0.1)
    thing = line.put(443.0, length)
    for _ in range(round(seconds * 100)):
        line.step([30.0, 30.0, 0.0])
    (product,) = line.tracking.products
    assert product.right == pytest.approx(thing.right, abs=5.0)
    events = line.run(30.0, 9.0)
    assert line.tracking.products == [product] and Code.WITHDRAWN not in codes(line.events)
    (closed,) = [event for event in events if event.code is Code.IDENTIFIED]
    assert closed.value == pytest.approx(length, abs=7.0), "a guess: nobody saw how much of it was on which belt"
    measured = [event for event in events if event.code is Code.LENGTH_DIFFERS]
    assert [(event.source, round(event.value2)) for event in measured] == [(4, length)]
    assert (product.length, product.right) == (pytest.approx(length, abs=0.3), pytest.approx(thing.right, abs=0.5))
    assert product.state is ProductState.UNCERTAIN


def test_backwards_an_unknown_product_across_a_border_keeps_its_record_too() -> None:
    line = line_with()
    line.run(-30.0, 0.1)
    thing = line.put(447.0 + 30.0, 30.0)
    for _ in range(150):
        line.step([0.0, 0.0, -30.0])
    line.run(-30.0, 3.0)
    (product,) = line.tracking.products
    assert (product.left, product.length) == (pytest.approx(thing.left, abs=5.0), pytest.approx(30.0, abs=5.0))
    assert Code.WITHDRAWN not in codes(line.events)


def test_what_may_be_longer_than_it_moved_at_a_border_is_not_withdrawn() -> None:
    bench = Bench()
    bench.beams[2] = True
    bench.scan(0.0, 1.0, 1.0)
    for _ in range(120):
        bench.scan(0.0, 0.0, 0.1)
    for _ in range(2):
        bench.scan(0.0, 1.0, 0.0)
    bench.beams[2] = False
    events = bench.scan(0.0, 1.0, 0.0)
    (product,) = bench.tracking.products
    assert codes(events) == [Code.IDENTIFIED] and not bench.tracking.withdrawn
    assert (product.length, product.length_known, product.state) == (10.0, False, ProductState.UNCERTAIN)


def test_two_unknown_in_a_row_make_the_sensor_before_suspected() -> None:
    bench = Bench()
    bench.move(1)
    for _ in range(2):
        bench.beam(2, True)
        bench.move(29)
        bench.beam(2, False)
        events = bench.move(20)
    assert bench.tracking.sensor_faults == 0b0001
    assert not events


def test_a_ghost_of_a_stuck_beam_ends_where_a_known_product_is() -> None:
    bench = Bench()
    product = put(bench, 190.0, 30.0)
    bench.move(1)
    bench.beam(2, True)
    bench.move(60)
    ghost = bench.tracking.products[0]
    assert (product.head, product.state) == (252.0, ProductState.UNCERTAIN), "nobody held it back"
    assert ghost.left >= product.right and ghost.open_at < 0 and ghost.state is ProductState.UNCERTAIN


def test_a_ghost_that_had_no_room_is_withdrawn() -> None:
    bench = Bench(lost_after=3.0)
    put(bench, 205.0, 30.0)
    bench.move(1)
    bench.beam(2, True)
    ghosts = [e.id for e in bench.move(20) if e.code is Code.WITHDRAWN]
    assert ghosts == [2] and len(bench.tracking.products) == 1


def test_a_beam_that_becomes_free_late_does_not_lengthen_what_is_already_past() -> None:
    bench = Bench()
    first, second = put(bench, 214.0, 30.0), put(bench, 174.0, 30.0)
    bench.beam(2, True)
    bench.move(55)
    bench.beam(2, False)
    assert (first.length, first.left, second.length) == (30.0, 241.0, 30.0)
    assert second.right == 231.0


def test_a_beam_that_came_late_is_put_right_by_its_falling_edge() -> None:
    bench = Bench()
    product = put(bench, 214.0, 40.0)
    bench.move(14)
    assert product.state is ProductState.LOST
    bench.beam(2, True)
    assert product.head == 215.0, "it may have slipped"
    bench.move(25)
    events = bench.beam(2, False)
    assert codes(events)[0] is Code.TAIL_AT_SENSOR
    assert (product.tail, product.head, product.state) == (215.0, 255.0, ProductState.UNCERTAIN)


# capacity


# gaps


def test_a_real_line_stops_in_time_behind_a_product_that_is_unloaded() -> None:
    line = line_with(unload_dwell=3.0, gap_margin=5.0)
    for head in (600.0, 412.0, 360.0):
        line.put(head, 30.0)
        line.tracking.insert(head, 30.0, 0)
    line.run(100.0, 4.0)
    assert [(e.id, e.second) for e in line.events if e.code is Code.GAP_STOP] == [(3, 2)]
    assert all(ramp.speed == 0.0 for ramp in line.ramps)
    for ahead, behind in zip(line.things, line.things[1:], strict=False):
        assert ahead.left - behind.right >= 4.0
    assert len(line.things) == 3


# unloading


# people


# power cycle


# contact, configuration, input


def test_running_into_a_standing_product_is_contact_and_uncertain() -> None:
    bench = Bench(lost_after=100.0)
    front, rear = put(bench, 500.0, 20.0), put(bench, 440.0, 20.0)
    rear.right = 444.0
    front.right, front.length = 470.0, 20.0
    for _ in range(12):
        bench.scan(1.0, 1.0, 0.0)
    assert front.left == 450.0 and rear.right <= 450.0
    assert rear.state is ProductState.UNCERTAIN and front.state is ProductState.TRACKED
    assert rear.right == pytest.approx(444.0 + rear.displacement + rear.shifted)


@pytest.mark.parametrize(
    ("what", "change"),
    [
        ("belt_ends", {"belt_ends": ()}),
        ("belt_ends", {"belt_ends": (100.0, 100.0)}),
        ("sensors", {"sensors": (0.0, 100.0)}),
        ("sensors", {"sensors": (200.0, 100.0)}),
        ("sensors", {"sensors": (700.0,)}),
        ("area_ends", {"area_ends": (math.nan,)}),
        ("slots", {"slots": 0}),
    ],
)
def test_a_line_that_cannot_be_built_is_named(what: str, change: dict[str, object]) -> None:
    with pytest.raises(ValueError, match=what):
        replace(LineLayout(), **change)


@pytest.mark.parametrize(
    "name", ["sensor_tolerance", "alarm_tolerance", "shortest", "longest", "lost_after", "gap_margin", "unload_dwell"]
)
@pytest.mark.parametrize("bad", [-1.0, math.nan, math.inf])
def test_settings_that_make_no_sense_are_named(name: str, bad: float) -> None:
    with pytest.raises(ValueError, match=name):
        replace(Settings(), **{name: bad})


def test_a_scan_with_bad_numbers_changes_nothing() -> None:
    bench = Bench()
    product = put(bench, 300.0, 20.0)
    for moved, beams, stops in (
        ((math.nan, 0.0, 0.0), [False] * 4, STANDING),
        ((0.0, 0.0, 0.0), [False] * 4, (0.0, math.inf, 0.0)),
        ((1.0, 1.0), [False] * 4, STANDING),
        ((1.0, 1.0, 1.0), [False] * 3, STANDING),
        ((1.0, 1.0, 1.0), [False] * 4, (0.0,)),
    ):
        with pytest.raises(ValueError):
            bench.tracking.scan(moved, beams, stops, 10)
    assert product.right == 300.0


def test_a_line_may_have_one_belt_one_sensor_and_one_area() -> None:
    bench = Bench(LineLayout((500.0,), (50.0,), (500.0,), 4), unload_dwell=0.0)
    product = bench.arrive(30)
    bench.move(419)
    assert product.head == 499.0
    bench.stops = (2.0,)
    bench.move(1)
    assert bench.tracking.brake
    bench.stops = (0.0,)
    assert codes(bench.scan(0.0)) == [Code.UNLOADED]


# a real line with faults


def test_a_product_taken_away_is_lost_and_a_product_put_is_found() -> None:
    line = BeltLine()
    line.put(60.0, 40.0)
    line.run(50.0, 2.5)
    line.things.clear()
    line.put(300.0, 50.0)
    events = line.run(50.0, 8.0)
    assert (Code.LOST, 2) in [(e.code, e.source) for e in events]
    assert (Code.UNEXPECTED, 3) in [(e.code, e.source) for e in events]
    found = line.tracking.products[0]
    assert found.length == pytest.approx(50.0, abs=1.0)
    assert found.right == pytest.approx(line.things[0].right, abs=1.0)


def test_every_position_is_right_with_a_slip_that_the_sensors_take_out() -> None:
    line = BeltLine(slip=0.01)
    thing = line.put(60.0, 40.0)
    line.run(50.0, 5.0)
    line.run(50.0, 9.0)
    product = line.tracking.products[0]
    assert product.right == pytest.approx(thing.right, abs=2.0)
    assert 0.5 < line.tracking.greatest_correction < 3.0


def test_blind_sensor_is_found_out_by_the_next_one() -> None:
    line = BeltLine(blind={1})
    line.put(60.0, 40.0)
    line.run(50.0, 16.0)
    assert [(e.code, e.source) for e in line.events if e.code in (Code.LOST, Code.SENSOR_SUSPECTED)] == [
        (Code.LOST, 2),
        (Code.SENSOR_SUSPECTED, 2),
    ]
    assert line.tracking.products[0].state is ProductState.TRACKED
