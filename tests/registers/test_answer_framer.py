"""What a master hears, cut into answers however it arrives."""

from itertools import pairwise

from hypothesis import example, given
from hypothesis import strategies as st

from app.registers.pdu import Request, build_answer, exception_answer, read_request, write_request
from app.registers.rtu import AnswerFramer, build_frame, read_time, write_time

WORDS = st.lists(st.integers(0, 0xFFFF), min_size=1, max_size=125)
READ = st.builds(lambda words: build_answer(Request(3, 0, len(words)), words), WORDS)
WRITE = st.builds(lambda at, word: write_request(at, [word]), st.integers(0, 0xFFFF), st.integers(0, 0xFFFF))
BITS = st.builds(lambda data: bytes((1, len(data))) + data, st.binary(min_size=1, max_size=250))
REFUSAL = st.builds(exception_answer, st.sampled_from([1, 3, 5, 6, 15, 16]), st.integers(1, 11))
FRAME = st.tuples(st.integers(1, 247), st.one_of(READ, WRITE, BITS, REFUSAL))


def heard(framer: AnswerFramer, data: bytes, cuts: list[int]) -> list[tuple[int, bytes]]:
    edges = [0, *sorted(at % (len(data) + 1) for at in cuts), len(data)]
    return [frame for a, b in pairwise(edges) for frame in framer.feed(data[a:b])]


@given(st.lists(FRAME, min_size=1, max_size=4), st.lists(st.integers(0, 10_000), max_size=6))
def test_answers_are_found_in_whatever_pieces_they_come(frames: list[tuple[int, bytes]], cuts: list[int]) -> None:
    framer = AnswerFramer()
    assert heard(framer, b"".join(build_frame(*frame) for frame in frames), cuts) == frames
    assert (framer.damaged, framer.pending) == (0, False)


@given(FRAME, st.binary(min_size=1, max_size=12), st.lists(st.integers(0, 10_000), max_size=4))
def test_an_answer_behind_noise_is_found_when_the_line_falls_silent_at_the_latest(
    frame: tuple[int, bytes], noise: bytes, cuts: list[int]
) -> None:
    framer = AnswerFramer()
    found = heard(framer, noise + build_frame(*frame), cuts)
    found += framer.silent()[0]
    assert found[-1:] == [frame]
    assert framer.damaged >= 1 and not framer.pending


@example((1, bytes.fromhex("0306ffff00000000")), 0, 1)
@given(FRAME, st.integers(0, 10_000), st.integers(1, 255))
def test_a_damaged_answer_is_none(frame: tuple[int, bytes], at: int, by: int) -> None:
    whole = bytearray(build_frame(*frame))
    whole[at % len(whole)] ^= by
    framer = AnswerFramer()
    assert framer.feed(bytes(whole)) + framer.silent()[0] == []
    assert framer.damaged == 1


def test_what_the_adapter_hears_of_its_own_read_shows_that_it_does_and_is_left_out_from_then_on() -> None:
    framer, answer = AnswerFramer(), build_frame(1, bytes((3, 2, 0, 7)))
    request = build_frame(1, read_request(0x1000, 1))
    framer.asked(request)
    assert framer.feed(request[:5]) == []
    assert framer.feed(request[5:] + answer) == [(1, bytes((3, 2, 0, 7)))]
    assert framer.echo
    write = build_frame(1, write_request(0x2000, [3]))
    framer.asked(write)
    assert framer.feed(write) == []
    assert framer.feed(write) == [(1, write_request(0x2000, [3]))]


def test_without_such_an_adapter_the_first_echo_of_a_write_is_the_answer() -> None:
    framer, write = AnswerFramer(), build_frame(1, write_request(0x2000, [3]))
    framer.asked(build_frame(1, read_request(0, 1)))
    assert framer.feed(build_frame(1, bytes((3, 2, 0, 7)))) == [(1, bytes((3, 2, 0, 7)))]
    framer.asked(write)
    assert framer.feed(write) == [(1, write_request(0x2000, [3]))]


def test_an_answer_that_looks_like_its_read_is_no_adapter_that_hears_itself() -> None:
    request = build_frame(1, read_request(0x0305, 17, 1))
    answer = build_answer(Request(1, 0x0305, 17), [1, 0, 1, 0, 0, 0, 0, 0, *[0] * 8, 1])
    same = build_frame(1, answer[:-1] + bytes((17,)))
    assert same == request, "three bytes of bits at 0x03…: address and count of the one are the bits of the other"
    framer = AnswerFramer()
    framer.asked(request)
    assert framer.feed(same) == [(1, same[1:-2])] and not framer.echo
    framer.asked(build_frame(1, read_request(0x0305, 8, 1)))
    assert framer.feed(build_frame(1, read_request(0x0305, 8, 1))) == [] and framer.echo
    framer.asked(request)
    assert framer.feed(request + same) == [(1, same[1:-2])], "such an adapter is known by then"


def test_times_are_those_of_the_sheet() -> None:
    assert round(1000 * read_time(9600, 25), 2) == 80.21
    assert round(1000 * write_time(9600), 1) == 26.4
    assert round(1000 * write_time(19200), 1) == 13.2
    assert read_time(9600, 16, 1) == read_time(9600, 1) and read_time(9600, 2000, 2) == read_time(9600, 125)
    assert write_time(9600, 1, 5) == write_time(9600) and write_time(9600, 16, 15) == write_time(9600, 1, 16)
