"""The planner: every readable point in exactly one block, and no telegram more than needed."""

import itertools

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.links import planner
from app.links.planner import NETWORK_OVERHEAD, Learned, overhead, plan
from app.plant.definitions import Device, Link, Scan
from app.registers.register import Type
from tests.links.devices import point

Spans = list[tuple[int, int]]


def blocks(spans: Spans, device: Device, cost: float = NETWORK_OVERHEAD, learned: Learned | None = None) -> Spans:
    points = [point("m", f"p{n}", first, words=width) for n, (first, width) in enumerate(spans)]
    return [(r.block.address, r.block.count) for r in plan(points, device, cost, learned).readings]


@pytest.mark.parametrize(
    ("spans", "device", "cost", "expected"),
    [
        ([(0, 1), (1, 1), (2, 1)], Device(), NETWORK_OVERHEAD, [(0, 3)]),
        ([(0, 1), (100, 1)], Device(), NETWORK_OVERHEAD, [(0, 101)]),
        ([(0, 1), (125, 1)], Device(), NETWORK_OVERHEAD, [(0, 1), (125, 1)]),
        ([(0, 1), (9, 1)], Device(), 10.0, [(0, 10)]),
        ([(0, 1), (12, 1)], Device(), 10.0, [(0, 1), (12, 1)]),
        ([(n, 1) for n in range(20)], Device(max_read=9), NETWORK_OVERHEAD, [(0, 2), (2, 9), (11, 9)]),
        ([(8, 2), (10, 1)], Device(max_read=2), NETWORK_OVERHEAD, [(8, 2), (10, 1)]),
        ([(0, 1), (4, 1)], Device(holes=[(2, 3)]), NETWORK_OVERHEAD, [(0, 1), (4, 1)]),
        ([(0, 1), (4, 1)], Device(write_only=[(2, 2)]), NETWORK_OVERHEAD, [(0, 1), (4, 1)]),
        ([(5, 1), (5, 1), (4, 2)], Device(), NETWORK_OVERHEAD, [(4, 2)]),
        ([(0, 4)], Device(max_read=3), NETWORK_OVERHEAD, []),
    ],
)
def test_blocks_of_a_plan(spans: Spans, device: Device, cost: float, expected: Spans) -> None:
    found = blocks(spans, device, cost)
    assert len(found) == len(expected)
    assert sum(count for _, count in found) == sum(count for _, count in expected)
    if device.max_read != 9:  # twenty in nines can be cut in several ways of equal cost
        assert found == expected


@pytest.mark.parametrize(
    ("baud", "turnaround", "gap"),
    [(9600, 0.0, 10), (9600, 0.005, 12), (9600, 0.02, 18), (19200, 0.0, 10), (115200, 0.0, 24), (115200, 0.02, 129)],
)
def test_break_even_gap_is_that_of_the_sheet(baud: int, turnaround: float, gap: int) -> None:
    cost = overhead(Link("line", "rtu", baud=baud), Device(turnaround=turnaround))
    assert int(cost) == gap
    device = Device(turnaround=turnaround)
    if gap < 120:
        assert len(blocks([(0, 1), (gap + 1, 1)], device, cost)) == 1
        assert len(blocks([(0, 1), (gap + 2, 1)], device, cost)) == 2


def test_the_drive_is_read_with_25_registers_and_its_parameters_by_six() -> None:
    device = Device(max_read=25, group_read={"once": 6})
    points = [point("m", f"v{n}", 0x1000 + n) for n in range(25)]
    points += [point("m", f"f{n}", 0x10B + n, Scan.ONCE) for n in range(12)]
    readings = plan(points, device, NETWORK_OVERHEAD).readings
    assert [(r.block.address, r.block.count, r.scan) for r in readings] == [
        (0x1000, 25, Scan.FAST),
        (0x10B, 6, Scan.ONCE),
        (0x111, 6, Scan.ONCE),
    ]


def test_a_slow_point_inside_a_fast_block_is_read_with_it() -> None:
    points = [point("m", "a", 0), point("m", "b", 4), point("m", "slow", 2, Scan.SLOW), point("m", "far", 9, Scan.SLOW)]
    readings = plan(points, Device(), NETWORK_OVERHEAD).readings
    assert [(r.block.address, r.block.count, [p.key for p in r.points]) for r in readings] == [
        (0, 5, ["a", "b", "slow"]),
        (9, 1, ["far"]),
    ]


def test_tables_are_read_with_their_own_function_and_only_if_the_device_knows_it() -> None:
    points = [point("m", "a", 0), point("m", "b", 0, table="input")]
    both = plan(points, Device(read_functions=(3, 4)), NETWORK_OVERHEAD)
    assert [r.block.function for r in both.readings] == [3, 4]
    one = plan(points, Device(), NETWORK_OVERHEAD)
    assert [r.block.function for r in one.readings] == [3]
    assert [p.key for p in one.unreadable] == ["b"]


def test_command_registers_are_never_read_and_points_in_a_hole_are_told() -> None:
    points = [point("m", "command", 0x2000, readable=False), point("m", "lost", 50), point("m", "a", 0)]
    result = plan(points, Device(holes=[(40, 60)]), NETWORK_OVERHEAD)
    assert [[p.key for p in r.points] for r in result.readings] == [["a"]]
    assert [p.key for p in result.unreadable] == ["lost"]


spans_strategy = st.lists(st.tuples(st.integers(0, 300), st.sampled_from([1, 1, 1, 2, 4])), min_size=1, max_size=40)
ranges = st.lists(st.tuples(st.integers(0, 300), st.integers(0, 5)).map(lambda r: (r[0], r[0] + r[1])), max_size=4)


@pytest.mark.sweep(8)
@given(spans_strategy, st.integers(4, 125), ranges, ranges, st.sampled_from([NETWORK_OVERHEAD, 10.0, 18.0]))
@settings(max_examples=200, deadline=None)
def test_every_readable_point_is_in_one_block_within_limits_and_outside_holes(
    spans: Spans, limit: int, holes: Spans, bad: Spans, cost: float
) -> None:
    device = Device(max_read=limit, holes=holes)
    learned = Learned(bad={(3, a, b) for a, b in bad})
    points = [point("m", f"p{n}", first, words=width) for n, (first, width) in enumerate(spans)]
    result = plan(points, device, cost, learned)
    placed = [p.key for reading in result.readings for p in reading.points] + [p.key for p in result.unreadable]
    assert sorted(placed) == sorted(p.key for p in points)
    for reading in result.readings:
        assert 1 <= reading.block.count <= limit
        assert not any(reading.block.address <= b and a <= reading.block.last for a, b in (*holes, *bad))
        for p in reading.points:
            assert p.register is not None
            assert reading.block.address <= p.register.address
            assert p.register.address + p.register.words - 1 <= reading.block.last
    for p in result.unreadable:
        assert p.register is not None
        last = p.register.address + p.register.words - 1
        assert any(p.register.address <= b and a <= last for a, b in (*holes, *bad))


@pytest.mark.sweep(8)
@given(st.sets(st.integers(0, 40), min_size=1, max_size=8), st.integers(1, 12), st.sampled_from([2.0, 5.0, 1000.0]))
@settings(max_examples=200, deadline=None)
def test_no_other_cut_is_cheaper(addresses: set[int], limit: int, cost: float) -> None:
    ordered = sorted(addresses)
    cuts = (c for n in range(len(ordered)) for c in itertools.combinations(range(1, len(ordered)), n))
    least = float("inf")
    for cut in cuts:
        edges = [0, *cut, len(ordered)]
        parts = [ordered[a:b] for a, b in itertools.pairwise(edges)]
        if all(part[-1] - part[0] < limit for part in parts):
            least = min(least, sum(cost + part[-1] - part[0] + 1 for part in parts))
    found = blocks([(address, 1) for address in addresses], Device(max_read=limit), cost)
    assert sum(cost + count for _, count in found) == least


def test_a_block_may_be_read_in_two_telegrams_only_where_no_value_is_torn() -> None:
    points = [point("m", "a", 0), point("m", "wide", 1, type="f32", words=2), point("m", "b", 5)]
    points.append(point("m", "slow", 3, Scan.SLOW, type="u32", words=2))
    (reading,) = plan(points, Device(), NETWORK_OVERHEAD).readings
    assert (reading.block.address, reading.block.count, reading.block.cuts) == (0, 6, (1, 3, 5))


def test_thousands_of_bits_are_planned_in_one_pass(monkeypatch: pytest.MonkeyPatch) -> None:
    looks = itertools.count()
    between = planner._between
    monkeypatch.setattr(planner, "_between", lambda *given: (next(looks), between(*given))[1])
    points = [point("m", f"c{n}", n, type=Type.BIT, table="coil") for n in range(10_000)]
    result = plan(points, Device(read_functions=(1,)), NETWORK_OVERHEAD, Learned())
    assert sum(len(reading.points) for reading in result.readings) == 10_000
    assert next(looks) < 3 * len(points), "a plan is made while everybody waits"
    assert result.readings[0].block.cuts == tuple(range(16, 2000, 16)), "as a late answer is told from its like"
