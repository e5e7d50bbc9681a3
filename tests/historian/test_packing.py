"""What is packed comes out as it was, to the bit."""

import math
import struct
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.historian.packing import Sample, columns, pack, unpack

BEGIN = 1_773_036_000_000_000

numbers = st.one_of(
    st.floats(allow_nan=False, allow_infinity=False),
    st.integers(-(2**60), 2**60).map(float),
    st.integers(-32768, 65535).map(lambda n: n / 100),
    st.sampled_from([0.0, -0.0, 0.1 + 0.2, 2.0**53, -(2.0**53) - 2, 5e-324, 1.7976931348623157e308]),
)


@st.composite
def series(draw: st.DrawFn) -> list[Sample]:
    time, rows = draw(st.integers(0, 2**61)), list[Sample]()
    kinds = draw(st.sampled_from([("number",), ("number", "none"), ("text", "none"), ("number", "text", "none")]))
    for step, kind, number, text, quality in draw(
        st.lists(
            st.tuples(st.integers(1, 2**40), st.sampled_from(kinds), numbers, st.text(), st.integers(0, 2**31)),
            min_size=1,
            max_size=60,
        )
    ):
        time += step
        rows.append((time, number if kind == "number" else None, text if kind == "text" else None, quality))
    return rows


def bits(rows: list[Sample]) -> list[object]:
    return [(t, None if v is None else struct.pack("d", v), s, q) for t, v, s, q in rows]


@pytest.mark.sweep(8)
@settings(max_examples=300, deadline=None)
@given(series(), st.data())
def test_samples_come_out_as_they_were(rows: list[Sample], data: st.DataObject) -> None:
    packed = unpack(pack(rows))
    assert bits(packed.rows()) == bits(rows)
    assert len(packed) == len(rows)
    begin = data.draw(st.integers(0, len(rows)))
    end = data.draw(st.integers(begin, len(rows)))
    assert bits(packed.part(begin, end).rows()) == bits(rows[begin:end])
    assert columns(rows).rows() == rows
    assert [packed.number(at) for at in range(len(rows))] == [row[1] for row in rows]
    low, high = data.draw(st.integers(0, 2**62)), data.draw(st.integers(0, 2**62))
    assert packed.within(low, high).rows() == [row for row in rows if low <= row[0] < high]


def walk(count: int) -> list[Sample]:
    """A register that walks, asked once a second as well as a poll does it."""
    chance, value, rows = Random(1), 5_000, list[Sample]()
    for i in range(count):
        value += chance.randrange(-5, 6)
        rows.append((BEGIN + i * 1_000_000 + chance.randrange(-300, 301), value / 100, None, 0))
    return rows


@pytest.mark.parametrize(
    ("most", "rows"),
    [
        (1.0, [(BEGIN + i * 1_000_000, math.floor(50 * math.sin(i / 50)) / 10, None, 0) for i in range(3600)]),
        (2.0, [(BEGIN + i * 1_000_000 + i * i % 401, i * 7919 % 1000 / 5, None, 0) for i in range(3600)]),
        (1.0, [(BEGIN + i * 600_000_000, 5.0, None, 0) for i in range(144)]),
        (1.0, [(BEGIN + i * 1_000_000, float(i // 100 % 2), None, 0) for i in range(3600)]),
        (0.5, [(BEGIN + i * 1_000_000, None, ("run", "stop")[i // 60 % 2], 256) for i in range(3600)]),
        (7.0, [(BEGIN + i * 1_000_000, math.sin(i), None, 0) for i in range(3600)]),
        (2.0, walk(3600)),
    ],
    ids=["ramp", "noise", "beats", "switch", "text", "any", "walk"],
)
def test_what_plants_record_takes_a_tenth_of_its_rows(most: float, rows: list[Sample]) -> None:
    """A row takes 21 to 24 bytes."""
    assert len(pack(rows)) / len(rows) < most
