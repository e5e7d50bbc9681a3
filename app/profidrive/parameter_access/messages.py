"""Requests and answers of base-mode parameter access as bytes.

    request  reference, 1 read | 2 change, drive object, n; n x (attribute, elements, number, subindex); of a change n x block
    answer   reference, id | 0x80 when one failed, drive object, n; blocks (none when everything was written)
    block    format, count, values, one byte 0 where the length would be odd

Source: reference/profidrive.md section 9, its worked examples included.
"""

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

from app.errors import TelegramError
from app.profidrive.parameter_access.error_numbers import ErrorNumber
from app.profidrive.parameter_access.formats import (
    LAYOUTS,
    Format,
    Number,
    decode_values,
    encode_values,
    format_of,
)

LONGEST = 240
"""Request or answer, header included [bytes]."""
MOST_PARAMETERS = 39
MOST_ELEMENTS = 234
"""Of one parameter in one message."""
HEADER, ADDRESS, BLOCK = 4, 6, 2
"""[bytes]"""
NEGATIVE = 0x80
REFERENCES = range(1, 256)
WORD = range(0x10000)


class RequestId(IntEnum):
    """What is asked."""

    READ = 1
    CHANGE = 2


class Attribute(IntEnum):
    """What of a parameter is meant."""

    VALUE = 0x10
    DESCRIPTION = 0x20
    TEXT = 0x30


@dataclass(frozen=True, slots=True)
class Address:
    """A parameter, or some elements of it."""

    number: int
    subindex: int = 0
    """First element."""
    count: int = 1
    """Elements; 0 where the parameter is no array (1 is taken as well)."""
    attribute: Attribute = Attribute.VALUE

    @property
    def elements(self) -> int:
        """So many values."""
        return self.count or 1

    def __str__(self) -> str:
        return f"parameter {self.number}[{self.subindex}]"


@dataclass(frozen=True, slots=True)
class Values:
    """A block of values."""

    format: Format
    values: tuple[Number, ...]


@dataclass(frozen=True, slots=True)
class Failed:
    """A parameter that was not read or not written."""

    number: int | None
    """Error number (`error_numbers.py`); None when the device told none."""
    info: tuple[int, ...] = ()
    """What follows it: 0, or the first subindex in error."""


@dataclass(frozen=True, slots=True)
class Written:
    """In the answer to a change: this one was written (0x40)."""


Result = Values | Written | Failed


@dataclass(frozen=True, slots=True)
class Request:
    """One request; with `values`, one per address, it changes them."""

    reference: int
    """1 to 255, new for every request."""
    drive_object: int
    addresses: tuple[Address, ...]
    values: tuple[Values, ...] | None = None

    @property
    def id(self) -> RequestId:
        """Whether it reads or changes."""
        return RequestId.READ if self.values is None else RequestId.CHANGE


@dataclass(frozen=True, slots=True)
class Answer:
    """One answer as it came."""

    reference: int
    id: RequestId
    negative: bool
    """At least one parameter failed."""
    drive_object: int
    count: int
    """Parameters that it counts."""
    results: tuple[Result, ...]
    """One per parameter; none when everything was written."""


def encode_request(request: Request) -> bytes:
    """The bytes of `request`.

    Raises:
        TelegramError: a field or a value does not fit, other than 1 to 39 parameters, more than 240 bytes.
    """
    count = len(request.addresses)
    _within("reference", request.reference, REFERENCES)
    _within("drive object", request.drive_object, range(256))
    _within("number of parameters", count, range(1, MOST_PARAMETERS + 1))
    parts = [bytes((request.reference, request.id, request.drive_object, count))]
    for place, address in enumerate(request.addresses):
        where = f"parameter {place + 1} of {count}"
        _within(f"{where}, number", address.number, WORD)
        _within(f"{where}, subindex", address.subindex, WORD)
        _within(f"{where}, elements", address.count, range(MOST_ELEMENTS + 1))
        parts.append(
            struct.pack(">BBHH", Attribute(address.attribute), address.count, address.number, address.subindex)
        )
    if request.values is not None:
        if len(request.values) != count:
            raise TelegramError("request", f"{len(request.values)} blocks of values", f"{count}, one per parameter")
        for address, block in zip(request.addresses, request.values, strict=True):
            if len(block.values) != address.elements and not _is_octets(block.format):
                raise TelegramError(str(address), f"{len(block.values)} values", f"{address.elements}")
            parts.append(encode_block(block, str(address)))
    return _whole(parts, "request")


def decode_request(data: bytes) -> Request:
    """The request that `data` is.

    Raises:
        TelegramError: it is none.
    """
    reference, id, drive_object, count = _header(data, "request")
    if id not in tuple(RequestId):
        raise TelegramError("byte 1, request id", f"0x{id:02X}", "0x01 or 0x02", ErrorNumber.NO_SUCH_REQUEST)
    _within("byte 0, reference", reference, REFERENCES)
    _within("byte 3, number of parameters", count, range(1, MOST_PARAMETERS + 1))
    end = HEADER + count * ADDRESS
    if len(data) < end:
        raise TelegramError("request", f"{len(data)} bytes", f"at least {end} for {count} parameters")
    addresses = []
    for offset in range(HEADER, end, ADDRESS):
        attribute, elements, number, subindex = struct.unpack_from(">BBHH", data, offset)
        if attribute not in tuple(Attribute):
            found, illegal = f"0x{attribute:02X}", ErrorNumber.ILLEGAL_ADDRESS
            raise TelegramError(f"byte {offset}, attribute", found, "0x10, 0x20 or 0x30", illegal)
        _within(f"byte {offset + 1}, elements", elements, range(MOST_ELEMENTS + 1), ErrorNumber.ILLEGAL_ADDRESS)
        addresses.append(Address(number, subindex, elements, Attribute(attribute)))
    if id == RequestId.READ:
        _ends(data, end, "request")
        return Request(reference, drive_object, tuple(addresses))
    blocks = []
    for _ in addresses:
        block, end = _decode_values(data, end)
        blocks.append(block)
    _ends(data, end, "request")
    return Request(reference, drive_object, tuple(addresses), tuple(blocks))


def encode_answer(answer: Answer) -> bytes:
    """The bytes of `answer`.

    Raises:
        TelegramError: a field or a value does not fit, or it is longer than 240 bytes.
    """
    _within("reference", answer.reference, REFERENCES)
    _within("drive object", answer.drive_object, range(256))
    _within("number of parameters", answer.count, range(256))
    if answer.results and len(answer.results) != answer.count:
        raise TelegramError("answer", f"{len(answer.results)} results", f"{answer.count}")
    id = answer.id | (NEGATIVE if answer.negative else 0)
    parts = [bytes((answer.reference, id, answer.drive_object, answer.count))]
    parts += (encode_result(result) for result in answer.results)
    return _whole(parts, "answer")


def decode_answer(data: bytes) -> Answer:
    """The answer that `data` is.

    Raises:
        TelegramError: it is none.
    """
    reference, id, drive_object, count = _header(data, "answer")
    _within("byte 0, reference", reference, REFERENCES)
    if id & ~NEGATIVE not in tuple(RequestId):
        raise TelegramError("byte 1, response id", f"0x{id:02X}", "0x01, 0x02, 0x81 or 0x82")
    asked, negative = RequestId(id & ~NEGATIVE), bool(id & NEGATIVE)
    results: list[Result] = []
    offset = HEADER
    if asked is RequestId.READ or negative:
        for _ in range(count):
            result, offset = _decode_result(data, offset)
            results.append(result)
    _ends(data, offset, "answer")
    if not negative and any(not isinstance(result, Values) for result in results):
        raise TelegramError("answer", "a block without values", "values: response id 0x01 says that all were read")
    if negative and not any(isinstance(result, Failed) for result in results):
        raise TelegramError("answer", "no error block", f"one: response id 0x{id:02X} says that something failed")
    return Answer(reference, asked, negative, drive_object, count, tuple(results))


def results_of(request: Request, answer: Answer) -> tuple[Result, ...]:
    """What became of each parameter of `request`.

    Raises:
        TelegramError: it is the answer to another request, or tells something else of a parameter than it was asked.
    """
    asked = (request.reference, int(request.id), request.drive_object, len(request.addresses))
    came = (answer.reference, int(answer.id), answer.drive_object, answer.count)
    for name, wanted, found in zip(("reference", "id", "drive object", "parameters"), asked, came, strict=True):
        if wanted != found:
            raise TelegramError(f"answer, {name}", str(found), str(wanted))
    if not answer.results:
        return (Written(),) * answer.count
    for address, result in zip(request.addresses, answer.results, strict=True):
        if request.id is RequestId.CHANGE and isinstance(result, Values):
            raise TelegramError(str(address), "values in the answer to a change", "an error, or none (0x40)")
        if request.id is RequestId.READ and isinstance(result, Written):
            raise TelegramError(str(address), "no value (0x40)", "values or an error")
        if isinstance(result, Values) and address.attribute is Attribute.VALUE and not _is_octets(result.format):
            _within(f"{address}, number of values", len(result.values), range(address.elements, address.elements + 1))
    return answer.results


def answered(request: Request, results: Sequence[Result]) -> Answer:
    """The answer of a device that has done `request` with `results`."""
    negative = any(isinstance(result, Failed) for result in results)
    told = tuple(results) if negative or request.id is RequestId.READ else ()
    return Answer(request.reference, request.id, negative, request.drive_object, len(request.addresses), told)


def encode_block(block: Values, place: str) -> bytes:
    """Format, count, values and filling.

    Raises:
        TelegramError: a value does not fit, or there are none or too many.
    """
    _within(f"{place}, number of values", len(block.values), range(1, MOST_ELEMENTS + 1))
    data = encode_values(block.format, block.values, place)
    return bytes((block.format, len(block.values))) + data + b"\0" * (len(data) % 2)


def encode_result(result: Result) -> bytes:
    """The block of one parameter in an answer.

    Raises:
        TelegramError: it does not fit.
    """
    if isinstance(result, Values):
        return encode_block(result, "answer")
    if isinstance(result, Written):
        return bytes((Format.ZERO, 0))
    words = result.info if result.number is None else (result.number, *result.info)
    for word in words:
        _within("error block", word, WORD)
    return bytes((Format.ERROR, len(words))) + struct.pack(f">{len(words)}H", *words)


def block_length(size: int, count: int) -> int:
    """Of a block of `count` values of `size` bytes each, filling included [bytes]."""
    return BLOCK + size * count + size * count % 2


def texts_of(block: Values) -> tuple[str, ...]:
    """The texts of attribute TEXT: 16 characters each (unconfirmed); what is no letter becomes a question mark.

    Raises:
        TelegramError: the block holds no octets.
    """
    if not _is_octets(block.format):
        raise TelegramError("text", block.format.name.lower(), "octets")
    data = bytes(int(value) for value in block.values)
    pieces = (data[at : at + 16] for at in range(0, len(data), 16))
    return tuple(piece.decode("latin-1").rstrip("\0 ") for piece in pieces)


def _decode_result(data: bytes, offset: int) -> tuple[Result, int]:
    format, count = _block_head(data, offset)
    if format == Format.ZERO:
        _within(f"byte {offset + 1}, number of values", count, range(1))
        return Written(), offset + BLOCK
    if format != Format.ERROR:
        return _decode_values(data, offset)
    end = offset + BLOCK + 2 * count
    if end > len(data):
        raise TelegramError(f"byte {offset}, error block", f"{len(data) - offset} bytes", f"{end - offset}")
    words = struct.unpack_from(f">{count}H", data, offset + BLOCK)
    return Failed(words[0] if words else None, tuple(words[1:])), end


def _decode_values(data: bytes, offset: int) -> tuple[Values, int]:
    number, count = _block_head(data, offset)
    format = format_of(number, f"byte {offset}")
    _within(f"byte {offset + 1}, number of values", count, range(1, MOST_ELEMENTS + 1), ErrorNumber.WRONG_COUNT)
    size = LAYOUTS[format].size
    begin, end = offset + BLOCK, offset + block_length(size, count)
    if end > len(data):
        raise TelegramError(f"byte {offset}, block of values", f"{len(data) - offset} bytes", f"{end - offset}")
    return Values(format, decode_values(format, data[begin : begin + size * count])), end


def _block_head(data: bytes, offset: int) -> tuple[int, int]:
    if offset + BLOCK > len(data):
        raise TelegramError(f"byte {offset}", "the end", "a block of format, count and values")
    return data[offset], data[offset + 1]


def _header(data: bytes, what: str) -> tuple[int, int, int, int]:
    if not HEADER <= len(data) <= LONGEST:
        raise TelegramError(what, f"{len(data)} bytes", f"{HEADER} to {LONGEST}")
    if len(data) % 2:
        raise TelegramError(what, f"{len(data)} bytes", "an even number")
    return data[0], data[1], data[2], data[3]


def _ends(data: bytes, offset: int, what: str) -> None:
    if offset != len(data):
        raise TelegramError(what, f"{len(data)} bytes", str(offset))


def _whole(parts: list[bytes], what: str) -> bytes:
    data = b"".join(parts)
    if len(data) > LONGEST:
        raise TelegramError(what, f"{len(data)} bytes", f"at most {LONGEST}")
    return data


def _within(place: str, value: int, allowed: range, refusal: int | None = None) -> None:
    if value not in allowed:
        expected = f"{allowed.start}" if len(allowed) == 1 else f"{allowed.start} to {allowed.stop - 1}"
        raise TelegramError(place, str(value), expected, refusal)


def _is_octets(format: Format) -> bool:
    return format in (Format.OCTET_STRING, Format.OCTET_STRING_10, Format.VISIBLE_STRING)
