"""Products that come in from a lane: their place and length in numbers, and where there is room for one."""

import json
from dataclasses import replace

import pytest

from app.blocks.product_tracking import Code, EditRefused, LineLayout, ProductState, ProductTracking, TrackingEvent
from app.blocks.product_tracking.merging import let_in, room

LINE = LineLayout(belt_ends=(1000.0,), sensors=(100.0, 500.0, 900.0), area_ends=(900.0, 1000.0), merges=(300.0,))


class Stand:
    """A line whose belt is moved by hand."""

    def __init__(self, line: LineLayout = LINE) -> None:
        self.tracking = ProductTracking(line)
        self.time = 0

    def move(self, way: float, step: float = 0.5) -> list[TrackingEvent]:
        told: list[TrackingEvent] = []
        count = round(abs(way) / step)
        for _ in range(count):
            self.time += 10_000
            beams = [any(p.left < x < p.right for p in self.tracking.products) for x in LINE.sensors]
            told += self.tracking.scan([way / count], beams, [0.0], self.time)
        return told


def test_its_left_end_stays_at_the_gate_until_the_whole_of_it_is_on_the_line() -> None:
    stand = Stand()
    (event,) = let_in(stand.tracking, 0, 40.0, 2.5, 0)
    assert (event.code, event.source, event.value, event.value2) == (Code.MERGED, 1, 2.5, 40.0)
    (product,) = stand.tracking.products
    seen = []
    for _ in range(5):
        stand.move(10.0)
        seen.append((product.left, product.right, product.length, product.away, product.coming))
    assert seen == [
        pytest.approx(row)
        for row in (
            (300, 310, 10, 30, 1),
            (300, 320, 20, 20, 1),
            (300, 330, 30, 10, 1),
            (300, 340, 40, 0, 0),
            (310, 350, 40, 0, 0),
        )
    ]
    assert product.origin == 1 and product.state is ProductState.TRACKED


def test_it_takes_its_place_between_those_of_the_line_though_its_number_is_later() -> None:
    stand = Stand()
    for head in (420.0, 200.0):
        stand.tracking.insert(head, 30.0, 0)
    let_in(stand.tracking, 0, 40.0, 0.0, 0)
    assert [one.id for one in stand.tracking.products] == [1, 3, 2]
    stand.move(60.0)
    assert [(one.id, round(one.left), round(one.right)) for one in stand.tracking.products] == [
        (1, 450, 480),
        (3, 320, 360),
        (2, 230, 260),
    ]


def test_the_next_sensor_sees_it_whole() -> None:
    stand = Stand()
    let_in(stand.tracking, 0, 40.0, 0.0, 0)
    told = stand.move(250.0, step=0.1)
    assert [(one.code, one.source) for one in told] == [(Code.HEAD_AT_SENSOR, 2), (Code.TAIL_AT_SENSOR, 2)]
    assert max(abs(one.value) for one in told) < 0.25
    assert stand.tracking.lost == stand.tracking.unexpected == 0


def test_backwards_it_goes_into_its_lane_and_its_record_with_it() -> None:
    stand = Stand()
    let_in(stand.tracking, 0, 40.0, 0.0, 0)
    stand.move(25.0)
    told = stand.move(-30.0)
    assert [(one.code, one.value) for one in told if one.code is not Code.REVERSED] == [
        (Code.WITHDRAWN, pytest.approx(25))
    ]
    follow = stand.tracking
    assert follow.products == [] and (follow.merged, follow.withdrawn) == ([1], 1)


def test_gaps_are_supervised_as_if_the_whole_of_it_were_on_the_line() -> None:
    stand = Stand()
    stand.tracking.insert(240.0, 30.0, 0)
    let_in(stand.tracking, 0, 40.0, 0.0, 0)
    stand.move(10.0)
    gap = stand.tracking.gap_with([0.0])
    assert gap and gap.gap == pytest.approx(300 - 30 - 250)
    stand.move(50.0)
    after = stand.tracking.gap_with([0.0])
    assert after and after.gap == pytest.approx(gap.gap)


def test_what_is_on_its_way_in_is_retained() -> None:
    stand = Stand()
    let_in(stand.tracking, 0, 40.0, 0.0, 0)
    stand.move(15.0)
    again = ProductTracking(LINE)
    again.restore(json.loads(json.dumps(stand.tracking.snapshot())))
    (product,) = again.products
    assert (product.coming, product.origin, product.away, again.merged) == (1, 1, 25.0, [1])
    with pytest.raises(ValueError, match="1 merging gates, the line 0"):
        ProductTracking(replace(LINE, merges=())).restore(stand.tracking.snapshot())


def test_without_a_free_slot_it_is_told_and_gets_no_record() -> None:
    stand = Stand(
        LineLayout(belt_ends=(1000.0,), sensors=(100.0, 900.0), area_ends=(900.0, 1000.0), slots=1, merges=(300.0,))
    )
    stand.tracking.insert(700.0, 30.0, 0)
    assert [(one.code, one.value) for one in let_in(stand.tracking, 0, 40.0, 0.0, 0)] == [(Code.BUFFER_FULL, 1.0)]
    assert stand.tracking.merged == [0] and len(stand.tracking.products) == 1


def test_a_person_may_not_put_another_one_where_it_is() -> None:
    stand = Stand()
    let_in(stand.tracking, 0, 40.0, 0.0, 0)
    stand.move(20.0)
    with pytest.raises(EditRefused):
        stand.tracking.insert(315.0, 20.0, 0)


@pytest.mark.parametrize(
    ("head", "length", "rate", "free"),
    [
        (240.0, 30.0, 1.0, True),
        (246.0, 30.0, 1.0, False),  # 245 = 300 - 15 - 40
        (240.0, 30.0, 1.2, False),  # it comes nearer: 237 = 300 - 15 - 48
        (345.0, 30.0, 1.0, True),
        (344.0, 30.0, 1.0, False),  # 15 mm before the gate must be free
        (310.0, 30.0, 1.0, False),
        (900.0, 30.0, 1.0, True),
    ],
)
def test_there_is_room_with_the_gap_before_and_behind(head: float, length: float, rate: float, free: bool) -> None:
    stand = Stand()
    stand.tracking.insert(head, length, 0)
    assert room(stand.tracking.products, 300.0, 40.0, 15.0, 100.0, rate) is free


def test_there_is_no_room_where_somebody_may_be_whom_nobody_knows() -> None:
    assert room([], 300.0, 40.0, 15.0, 245.0)
    assert not room([], 300.0, 40.0, 15.0, 245.1)


def test_a_gate_stands_between_the_first_and_the_last_sensor() -> None:
    with pytest.raises(ValueError, match=r"merges is \(50.0,\)"):
        LineLayout(merges=(50.0,))
