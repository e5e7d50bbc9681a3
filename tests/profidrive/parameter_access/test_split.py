"""However many parameters are asked for, every request and every answer keeps the limits, and nothing is lost or asked twice."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.errors import TelegramError
from app.profidrive.parameter_access.formats import LAYOUTS, Format
from app.profidrive.parameter_access.messages import (
    LONGEST,
    Address,
    Failed,
    Request,
    Values,
    Written,
    answered,
    encode_answer,
    encode_request,
)
from app.profidrive.parameter_access.split import Part, change_parts, halves, joined, read_parts

ARRAY = st.tuples(st.integers(0, 300), st.sampled_from([None, *sorted(LAYOUTS)]))
U16, U32 = Format.UNSIGNED16, Format.UNSIGNED32


def element(parts: list[list[Part]]) -> list[tuple[int, int]]:
    """(place, subindex) of everything asked for, in order."""
    found = []
    for part in (part for request in parts for part in request):
        found += [(part.place, part.address.subindex + n) for n in range(part.address.elements)]
    return found


@settings(max_examples=60)
@given(st.lists(ARRAY, min_size=1, max_size=60))
def test_reads_keep_the_limits_and_ask_for_everything_once(wanted: list[tuple[int, Format | None]]) -> None:
    addresses = [Address(n, 5, count) for n, (count, _) in enumerate(wanted)]
    formats = [format for _, format in wanted]
    requests = read_parts(addresses, formats)
    assert element(requests) == [(n, 5 + i) for n, (count, _) in enumerate(wanted) for i in range(count or 1)]
    for parts in requests:
        request = Request(1, 2, tuple(part.address for part in parts))
        assert len(encode_request(request)) <= LONGEST
        for fails in (False, True):  # the longest answer that may come: all values, or all errors
            results = [
                Failed(2, (1,)) if fails else Values(formats[part.place] or U32, (1,) * part.address.elements)
                for part in parts
            ]
            assert len(encode_answer(answered(request, results))) <= LONGEST


@settings(max_examples=60)
@given(st.lists(st.tuples(st.integers(0, 300), st.sampled_from(sorted(LAYOUTS))), min_size=1, max_size=60))
def test_changes_keep_the_limits_and_write_everything_once_in_order(wanted: list[tuple[int, Format]]) -> None:
    changes = [
        (
            Address(n, 5, count),
            Values(format, tuple(range(count or 1)) if LAYOUTS[format].size > 1 else (1,) * (count or 1)),
        )
        for n, (count, format) in enumerate(wanted)
    ]
    requests = change_parts(changes)
    assert element(requests) == [(n, 5 + i) for n, (count, _) in enumerate(wanted) for i in range(count or 1)]
    for place, (_, block) in enumerate(changes):
        pieces = [part.values for request in requests for part in request if part.place == place and part.values]
        assert joined(pieces) == block
    for parts in requests:
        addresses, blocks = tuple(part.address for part in parts), tuple(part.values for part in parts if part.values)
        request = Request(1, 2, addresses, blocks)
        assert len(encode_request(request)) <= LONGEST
        assert len(encode_answer(answered(request, (Failed(2, (1,)),) * len(parts)))) <= LONGEST


def test_as_few_requests_as_the_limits_allow() -> None:
    assert [len(parts) for parts in read_parts([Address(n) for n in range(100)])] == [39, 39, 22]
    assert [part.address.count for (part,) in read_parts([Address(945, count=64)])] == [58, 6]
    assert [part.address.count for (part,) in read_parts([Address(945, count=64)], [U16])] == [64]
    changes = [(Address(n), Values(U32, (n,))) for n in range(40)]
    assert [len(parts) for parts in change_parts(changes)] == [19, 19, 2]
    assert read_parts([]) == change_parts([]) == []


def test_an_answer_that_gets_too_long_is_asked_for_in_halves_down_to_one_element() -> None:
    (whole,) = read_parts([Address(945, 3, 7)])[0]
    assert [half.address for half in halves(whole)] == [Address(945, 3, 3), Address(945, 6, 4)]
    assert halves(Part(0, Address(1, 0, 1))) == halves(Part(0, Address(1, 0, 0))) == []


def test_pieces_are_joined_and_a_failure_of_one_is_that_of_all() -> None:
    assert joined([Values(U16, (1, 2)), Values(U16, (3,))]) == Values(U16, (1, 2, 3))
    assert joined([Values(U16, (1,)), Failed(3, (58,)), Failed(0)]) == Failed(3, (58,))
    assert joined([Written(), Written()]) == Written()


@pytest.mark.parametrize(
    "address", [Address(0x10000), Address(-1), Address(1, 0x10000), Address(1, 0xFFFF, 2), Address(1, 0, -1)]
)
def test_what_no_request_can_hold_is_refused(address: Address) -> None:
    with pytest.raises(TelegramError, match=r"parameter .*expected number, subindex"):
        read_parts([address])
    with pytest.raises(TelegramError):
        change_parts([(address, Values(U16, (1,)))])
    with pytest.raises(TelegramError, match="2 values of format 0x06, expected 1"):
        change_parts([(Address(1), Values(U16, (1, 2)))])
