"""How a read is asked for while older answers may still come."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.links.contract import Block
from app.links.late_answers import LATEST, LateAnswers, pattern_of_answer, pattern_of_request
from app.registers.pdu import Request, build_answer

SIZES = st.lists(st.integers(1, 125), max_size=30)


@st.composite
def blocks(draw: st.DrawFn) -> Block:
    count = draw(st.integers(1, 125))
    cuts = draw(st.sets(st.integers(1, count - 1))) if count > 1 else set()
    return Block(draw(st.integers(0, 60_000)), count, cuts=tuple(sorted(cuts)))


def owing(sizes: list[int], now: float) -> LateAnswers:
    late = LateAnswers()
    for size in sizes:
        late.unanswered(pattern_of_request(1, Request(3, 0, size)), now)
    return late


@pytest.mark.sweep(8)
@given(blocks(), SIZES, st.lists(st.tuples(st.integers(0, 60_000), st.integers(1, 125)), max_size=4))
def test_the_telegrams_bring_all_words_in_lengths_that_nobody_owes_and_tear_no_value(
    block: Block, sizes: list[int], spans: list[tuple[int, int]]
) -> None:
    late = owing(sizes, 0.0)
    for address, count in spans:
        late.proven(1, Block(address, count))
    pieces, wait = late.pieces(1, block, 1.0)
    if not pieces:
        assert block.count in sizes and wait == LATEST - 1.0
        return
    assert wait == 0.0
    got = [p.block.address + p.skip + at for p in pieces for at in range(p.count)]
    assert got == list(range(block.address, block.address + block.count))
    assert not {p.block.count for p in pieces} & set(sizes)
    assert all(p.skip + p.count <= p.block.count <= 125 for p in pieces)
    begins = [p.block.address - block.address for p in pieces[1:]]
    assert set(begins) <= set(block.cuts)
    if block.count not in sizes:
        assert [p.block for p in pieces] == [block]


@given(blocks(), SIZES)
def test_what_is_owed_is_forgotten_in_the_end_and_never_concerns_others(block: Block, sizes: list[int]) -> None:
    late = owing(sizes, 0.0)
    whole = [block]
    assert [p.block for p in late.pieces(2, block, 1.0)[0]] == whole
    inputs = Block(block.address, block.count, 4)
    assert [p.block for p in late.pieces(1, inputs, 1.0)[0]] == [inputs]
    assert [p.block for p in late.pieces(1, block, LATEST + 0.1)[0]] == whole


@pytest.mark.sweep(8)
@given(st.integers(1, 2000), st.lists(st.integers(1, 2000), max_size=12), st.integers(0, 60_000))
def test_bits_are_asked_for_in_as_many_bytes_as_nobody_owes(count: int, sizes: list[int], address: int) -> None:
    late = LateAnswers()
    for size in sizes:
        late.unanswered(pattern_of_request(1, Request(1, 0, size)), 0.0)
    owed = {(size + 7) // 8 for size in sizes}
    pieces, wait = late.pieces(1, Block(address, count, 1, tuple(range(1, count))), 1.0)
    if not pieces:
        assert (count + 7) // 8 in owed and wait == LATEST - 1.0
        return
    got = [p.block.address + p.skip + at for p in pieces for at in range(p.count)]
    assert got == list(range(address, address + count))
    assert not {(p.block.count + 7) // 8 for p in pieces} & owed
    assert all(p.block.function == 1 and p.block.count <= 2000 and p.block.last <= 0xFFFF for p in pieces)
    assert [p.block for p in late.pieces(1, Block(address, 1, 3), 1.0)[0]] == [Block(address, 1, 3)]


def test_an_answer_that_comes_after_all_pays_for_one_request() -> None:
    late = owing([25, 25], 0.0)
    pattern = pattern_of_answer(1, build_answer(Request(3, 0, 25), [0] * 25))
    assert [late.settle(pattern, 1.0) for _ in range(3)] == [True, True, False]


def test_echoes_of_writes_differ_by_register_and_value() -> None:
    late = LateAnswers()
    late.unanswered(pattern_of_request(1, Request(6, write_address=0x2000, words=(3,))), 0.0)
    other = pattern_of_request(1, Request(6, write_address=0x2000, words=(1,)))
    assert not late.settle(other, 1.0)
    assert late.owes(1, 6, 1.0) and not late.owes(1, 3, 1.0)


def test_a_span_that_is_refused_later_is_not_grown_into_any_more() -> None:
    late = owing([1], 0.0)
    late.proven(1, Block(100, 10))
    assert late.pieces(1, Block(105, 1), 1.0)[0][0].block.count == 2
    late.refused(1, Block(108, 1))
    assert late.pieces(1, Block(105, 1), 1.0) == ([], LATEST - 1.0)


def test_only_an_earlier_read_of_the_same_registers_may_stand_for_a_newer_one() -> None:
    late, block = LateAnswers(), Block(0x100, 96)
    pattern = pattern_of_request(1, Request(3, 0x100, 96))
    late.unanswered(pattern, 0.0, 0x100)
    assert late.only(1, block, 1.0) and not late.only(1, Block(0x200, 96), 1.0)
    late.unanswered(pattern, 2.0, 0x200)
    assert not late.only(1, block, 3.0)
    assert late.settled(pattern, 3.0) == LATEST and late.settled(pattern, 3.0) == LATEST + 2.0
    late.unanswered(pattern, 5.0, 0x100, until=6.0)
    assert late.settled(pattern, 7.0) == 0.0
