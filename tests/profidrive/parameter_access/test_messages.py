"""Parameter messages are those of the reference byte for byte, and whatever comes in, only our own error goes out."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.errors import TelegramError
from app.profidrive.parameter_access.formats import INTEGERS, LAYOUTS, Format
from app.profidrive.parameter_access.messages import (
    LONGEST,
    Address,
    Answer,
    Attribute,
    Failed,
    Request,
    RequestId,
    Result,
    Values,
    Written,
    answered,
    decode_answer,
    decode_request,
    encode_answer,
    encode_request,
    results_of,
    texts_of,
)

U8, U16, U32, I16, I32 = (
    Format.UNSIGNED8, Format.UNSIGNED16, Format.UNSIGNED32, Format.INTEGER16, Format.INTEGER32,
)  # fmt: skip
READ, CHANGE = RequestId.READ, RequestId.CHANGE


def one(format: Format, *values: float) -> Values:
    return Values(format, values)


FAULTS = (7452, 30021, *(0,) * 62)
REQUESTS = [
    ("01 01 01 01  10 01 00 12 00 00", Request(1, 1, (Address(18),))),
    ("02 01 02 01  10 40 03 B1 00 00", Request(2, 2, (Address(945, count=64),))),
    (
        "03 02 02 02  10 01 0A 19 00 00  10 01 0A 1A 00 00  04 01 FF FF FE D4  04 01 00 00 01 2C",
        Request(3, 2, (Address(2585), Address(2586)), (one(I32, -300), one(I32, 300))),
    ),
    ("05 02 02 01  10 01 0A 27 00 00  04 01 00 00 2E E0", Request(5, 2, (Address(2599),), (one(I32, 12000),))),
    ("04 02 02 01  10 01 09 CB 00 00  03 01 00 02", Request(4, 2, (Address(2507),), (one(I16, 2),))),
    ("06 02 01 01  10 01 03 CB 00 00  06 01 00 01", Request(6, 1, (Address(971),), (one(U16, 1),))),
    ("07 02 02 01  10 01 00 0A 00 00  05 01 03 00", Request(7, 2, (Address(10),), (one(U8, 3),))),
    (
        "80 02 01 01  10 01 D8 9A 00 00  08 01 00 00 00 00",
        Request(128, 1, (Address(55450),), (one(Format.FLOAT32, 0),)),
    ),
    ("05 01 02 01  10 01 27 0F 00 00", Request(5, 2, (Address(9999),))),
]
"""Every request of the reference, and the maker's own one as far as it is printed."""
ANSWERS = [
    ("01 01 01 01  07 01 00 47 C5 0C", 0, Answer(1, READ, False, 1, 1, (one(U32, 4703500),))),
    ("02 01 02 01  06 40  1D 1C 75 45" + " 00 00" * 62, 1, Answer(2, READ, False, 2, 1, (one(U16, *FAULTS),))),
    ("03 02 02 02", 2, Answer(3, CHANGE, False, 2, 2, ())),
    ("03 82 02 02  40 00  44 02 00 02 00 00", 2, Answer(3, CHANGE, True, 2, 2, (Written(), Failed(2, (0,))))),
    ("05 81 02 01  44 01 00 00", 8, Answer(5, READ, True, 2, 1, (Failed(0),))),
]
"""Every answer of the reference, with the place of its request above."""


@pytest.mark.parametrize(("text", "request_"), REQUESTS)
def test_requests_are_those_of_the_reference(text: str, request_: Request) -> None:
    assert encode_request(request_) == bytes.fromhex(text)
    assert decode_request(bytes.fromhex(text)) == request_


@pytest.mark.parametrize(("text", "asked", "answer"), ANSWERS)
def test_answers_are_those_of_the_reference(text: str, asked: int, answer: Answer) -> None:
    assert encode_answer(answer) == bytes.fromhex(text)
    assert decode_answer(bytes.fromhex(text)) == answer
    request = REQUESTS[asked][1]
    results = results_of(request, answer)
    assert len(results) == len(request.addresses)
    assert answered(request, results) == answer


def test_the_largest_messages_are_240_bytes_with_39_parameters_and_not_one_more() -> None:
    many = tuple(Address(n) for n in range(39))
    assert len(encode_request(Request(1, 2, many))) == 4 + 6 * 39
    with pytest.raises(TelegramError, match="number of parameters: 40, expected 1 to 39"):
        encode_request(Request(1, 2, (*many, Address(1))))
    full = Request(1, 2, (Address(1, count=57),), (one(I32, *range(57)),))
    assert len(encode_request(full)) == LONGEST
    with pytest.raises(TelegramError, match="request: 242 bytes, expected at most 240"):
        encode_request(Request(1, 2, (Address(1, count=115),), (one(U16, *range(115)),)))
    fits_just = Answer(1, READ, False, 2, 1, (one(U16, *range(117)),))
    assert len(encode_answer(fits_just)) == LONGEST and decode_answer(encode_answer(fits_just)) == fits_just
    with pytest.raises(TelegramError, match="number of parameters: 0, expected"):
        encode_request(Request(1, 2, ()))


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("", "request: 0 bytes"),
        ("01 01 01", "request: 3 bytes"),
        ("01 01 01 01 10", "request: 5 bytes, expected an even number"),
        ("00 01 01 01  10 01 00 12 00 00", "byte 0, reference: 0"),
        ("01 03 01 01  10 01 00 12 00 00", "byte 1, request id: 0x03"),
        ("01 01 01 28" + "10 01 00 12 00 00" * 39, "byte 3, number of parameters: 40"),
        ("01 01 01 02  10 01 00 12 00 00", "request: 10 bytes, expected at least 16"),
        ("01 01 01 01  11 01 00 12 00 00", "byte 4, attribute: 0x11"),
        ("01 01 01 01  10 EB 00 12 00 00", "byte 5, elements: 235"),
        ("01 01 01 01  10 01 00 12 00 00  00 00", "request: 12 bytes, expected 10"),
        ("06 02 01 01  10 01 03 CB 00 00", "byte 10: the end, expected a block"),
        ("06 02 01 01  10 01 03 CB 00 00  06 02 00 01", "byte 10, block of values: 4 bytes, expected 6"),
        ("06 02 01 01  10 01 03 CB 00 00  06 00", "byte 11, number of values: 0"),
        ("06 02 01 01  10 01 03 CB 00 00  44 01 00 01", "byte 10: format 0x44"),
    ],
)
def test_what_is_no_request_is_refused_by_its_place(text: str, place: str) -> None:
    with pytest.raises(TelegramError) as caught:
        decode_request(bytes.fromhex(text))
    assert str(caught.value).startswith(place)


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("01 03 01 00", "byte 1, response id: 0x03"),
        ("01 01 01 01  44 01 00 00", "answer: a block without values"),
        ("01 81 01 01  06 01 00 00", "answer: no error block"),
        ("01 81 01 01  44 02 00 00", "byte 4, error block: 4 bytes, expected 6"),
        ("01 81 01 01  40 01", "byte 5, number of values: 1, expected 0"),
        ("01 02 01 01  40 00", "answer: 6 bytes, expected 4"),
        ("01 01 01 01  07 02 00 47 C5 0C", "byte 4, block of values: 6 bytes, expected 10"),
    ],
)
def test_what_is_no_answer_is_refused_by_its_place(text: str, place: str) -> None:
    with pytest.raises(TelegramError) as caught:
        decode_answer(bytes.fromhex(text))
    assert str(caught.value).startswith(place)


@pytest.mark.parametrize(
    ("answer", "says"),
    [
        (Answer(2, READ, False, 2, 1, (one(U16, 1),)), "reference: 2, expected 1"),
        (Answer(1, CHANGE, False, 2, 1, ()), "id: 2, expected 1"),
        (Answer(1, READ, False, 1, 1, (one(U16, 1),)), "drive object: 1, expected 2"),
        (Answer(1, READ, False, 2, 2, (one(U16, 1), one(U16, 1))), "parameters: 2, expected 1"),
        (Answer(1, READ, False, 2, 1, (one(U16, 1, 2),)), "number of values: 2, expected 1"),
        (Answer(1, READ, True, 2, 1, (Written(),)), "no value"),
    ],
)
def test_the_answer_to_another_request_is_none(answer: Answer, says: str) -> None:
    with pytest.raises(TelegramError, match=says):
        results_of(Request(1, 2, (Address(945),)), answer)


def test_octets_texts_and_an_error_without_number() -> None:
    text = b"Ramp-up time".ljust(16, b"\0") + "Größe".encode("latin-1").ljust(16)
    request = Request(9, 2, (Address(1120, attribute=Attribute.TEXT), Address(9)))
    answer = Answer(9, READ, True, 2, 2, (one(Format.OCTET_STRING, *text), Failed(None)))
    came = decode_answer(encode_answer(answer))
    block, failed = results_of(request, came)
    assert isinstance(block, Values) and texts_of(block) == ("Ramp-up time", "Größe")
    assert failed == Failed(None)
    with pytest.raises(TelegramError, match="text: unsigned16"):
        texts_of(one(U16, 1))


@st.composite
def blocks(draw: st.DrawFn, most: int = 8) -> Values:
    format = draw(st.sampled_from(sorted(LAYOUTS)))
    code = LAYOUTS[format].code
    number = st.floats(width=32, allow_nan=False, allow_infinity=False) if code == "f" else st.integers(*INTEGERS[code])
    return Values(format, tuple(draw(st.lists(number, min_size=1, max_size=most))))


ADDRESSES = st.builds(
    Address, st.integers(0, 0xFFFF), st.integers(0, 0xFFFF), st.integers(0, 234), st.sampled_from(Attribute)
)


@st.composite
def requests(draw: st.DrawFn) -> Request:
    head = draw(st.integers(1, 255)), draw(st.integers(0, 255))
    if draw(st.booleans()):
        return Request(*head, tuple(draw(st.lists(ADDRESSES, min_size=1, max_size=39))))
    changes = draw(st.lists(blocks(4), min_size=1, max_size=6))
    return Request(*head, tuple(Address(n, count=len(each.values)) for n, each in enumerate(changes)), tuple(changes))


@st.composite
def answers(draw: st.DrawFn) -> Answer:
    failed = st.builds(Failed, st.integers(0, 0xFFFF), st.lists(st.integers(0, 0xFFFF), max_size=2).map(tuple))
    id = draw(st.sampled_from(RequestId))
    other: st.SearchStrategy[Result] = blocks(4) if id is READ else st.just(Written())
    results = draw(st.lists(st.one_of(failed, other), min_size=1, max_size=6))
    request = Request(draw(st.integers(1, 255)), draw(st.integers(0, 255)), (Address(1),) * len(results))
    if id is CHANGE:
        request = Request(request.reference, request.drive_object, request.addresses, (one(U16, 1),) * len(results))
    return answered(request, results)


@settings(max_examples=60)
@given(requests())
def test_a_request_comes_out_as_it_went_in(request_: Request) -> None:
    assert decode_request(encode_request(request_)) == request_


@settings(max_examples=60)
@given(answers())
def test_an_answer_comes_out_as_it_went_in(answer: Answer) -> None:
    assert decode_answer(encode_answer(answer)) == answer


WHOLE = [bytes.fromhex(row[0]) for row in (*REQUESTS, *ANSWERS)]


@st.composite
def damaged(draw: st.DrawFn) -> bytes:
    data = bytearray(draw(st.sampled_from(WHOLE)))
    for _ in range(draw(st.integers(1, 3))):
        data[draw(st.integers(0, len(data) - 1))] = draw(st.integers(0, 255))
    return bytes(data[: draw(st.integers(0, len(data)))]) if draw(st.booleans()) else bytes(data)


@settings(max_examples=150)
@given(st.one_of(st.binary(max_size=260), damaged()))
def test_whatever_comes_in_only_our_own_error_goes_out(data: bytes) -> None:
    for decode, encode in ((decode_request, encode_request), (decode_answer, encode_answer)):
        try:
            message = decode(data)  # type: ignore[operator]
        except TelegramError as error:
            assert error.place and error.found and error.expected
            continue
        if decode is decode_answer:
            assert len(encode(message)) == len(data)  # type: ignore[operator]
            for _, request in REQUESTS:
                try:
                    results_of(request, message)
                except TelegramError as error:
                    assert error.expected
