"""Modbus telegrams without their envelope: function code and data, built and parsed on both ends.

A PDU is what RTU (unit, PDU, check sum) and TCP (header, PDU) have in common, at most 253 bytes. Function codes 03, 04, 06, 16 and 23;
limits from the Modbus application protocol 1.1b3 (reference/modbus.md section 2).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from struct import Struct, error, pack

from app.errors import BadAnswer, DeviceException

READ_HOLDING = 3
READ_INPUT = 4
WRITE_SINGLE = 6
WRITE_MULTIPLE = 16
READ_WRITE = 23
READS = (READ_HOLDING, READ_INPUT, READ_WRITE)
WRITES = (WRITE_SINGLE, WRITE_MULTIPLE, READ_WRITE)

MAX_PDU = 253
MAX_READ = 125
MAX_WRITE = 123
MAX_READ_WRITE = 121
"""Registers that function 23 writes."""

ILLEGAL_FUNCTION = 1
ILLEGAL_ADDRESS = 2
ILLEGAL_VALUE = 3
SERVER_FAILURE = 4

_PAIR = Struct(">HH")
_WRITE_HEAD = Struct(">HHB")
_READ_WRITE_HEAD = Struct(">HHHHB")


@dataclass(frozen=True, slots=True)
class Request:
    """What a master asks: registers to read, words to write, or both (function 23)."""

    function: int
    address: int = 0
    """First register to read."""
    count: int = 0
    """Registers to read; 0 when the function only writes."""
    write_address: int = 0
    words: tuple[int, ...] = ()
    """Raw words to write from `write_address` on; empty when the function only reads."""

    @property
    def addresses(self) -> tuple[int, ...]:
        """First address of each range that the request touches."""
        return (*((self.address,) if self.count else ()), *((self.write_address,) if self.words else ()))


def read_request(address: int, count: int, function: int = READ_HOLDING) -> bytes:
    """PDU that reads `count` registers from the 0-based `address`."""
    return build_request(Request(function, address, count))


def write_request(address: int, words: Sequence[int], *, multiple: bool | None = None) -> bytes:
    """PDU that writes `words` from `address` on: function 06 for one word, else 16; `multiple` True forces 16."""
    function = WRITE_MULTIPLE if multiple or len(words) != 1 else WRITE_SINGLE
    return build_request(Request(function, write_address=address, words=tuple(words)))


def build_request(request: Request) -> bytes:
    """The PDU of `request`.

    Raises:
        ValueError: a function, address, word or count that a telegram cannot carry.
    """
    if not request.words and not request.write_address:
        return _built(request.function, request.address, request.count)  # a scan sends the same ones for ever
    return _build(request)


@lru_cache(4096)
def _built(function: int, address: int, count: int) -> bytes:
    return _build(Request(function, address, count))


def _build(request: Request) -> bytes:
    check = _fault_of(request)
    if check:
        raise ValueError(f"{request} is no telegram: exception {check:02d} would be the answer")
    words = pack(f">{len(request.words)}H", *request.words)
    head = bytes((request.function,))
    if request.function == WRITE_SINGLE:
        return head + _PAIR.pack(request.write_address, request.words[0])
    if request.function == WRITE_MULTIPLE:
        return head + _WRITE_HEAD.pack(request.write_address, len(request.words), len(words)) + words
    if request.function == READ_WRITE:
        spans = (request.address, request.count, request.write_address, len(request.words))
        return head + _READ_WRITE_HEAD.pack(*spans, len(words)) + words
    return head + _PAIR.pack(request.address, request.count)


def parse_request(pdu: bytes) -> Request:
    """The request in `pdu`, as a slave reads it.

    Raises:
        DeviceException: 01 for a function that is none of 03, 04, 06, 16, 23; 03 for a wrong length or count; 02 for a
            range that ends behind 0xFFFF.
    """
    function = pdu[0] if pdu else 0
    if function not in READS and function not in WRITES:
        raise DeviceException(ILLEGAL_FUNCTION, f"function {function}")
    try:
        request = _parse(function, pdu[1:])
    except error as cause:
        raise DeviceException(ILLEGAL_VALUE, f"{len(pdu)} bytes for function {function}") from cause
    fault = _fault_of(request)
    if fault:
        raise DeviceException(fault, f"{request}")
    return request


def _parse(function: int, data: bytes) -> Request:
    if function == WRITE_SINGLE:
        address, word = _PAIR.unpack(data)
        return Request(function, write_address=address, words=(word,))
    if function == WRITE_MULTIPLE:
        address, count, size = _WRITE_HEAD.unpack_from(data)
        return Request(function, write_address=address, words=_words(data[_WRITE_HEAD.size :], count, size))
    if function == READ_WRITE:
        address, count, write_address, write_count, size = _READ_WRITE_HEAD.unpack_from(data)
        words = _words(data[_READ_WRITE_HEAD.size :], write_count, size)
        return Request(function, address, count, write_address, words)
    address, count = _PAIR.unpack(data)
    return Request(function, address, count)


def _words(data: bytes, count: int, size: int) -> tuple[int, ...]:
    if not size == len(data) == 2 * count:
        raise error(f"{len(data)} bytes, announced {size}, for {count} registers")
    return Struct(f">{count}H").unpack(data)


def _fault_of(request: Request) -> int:
    """Exception code that the bare protocol demands for `request`; 0 = none."""
    function, words = request.function, len(request.words)
    if function not in READS and function not in WRITES:
        return ILLEGAL_FUNCTION
    most = {WRITE_SINGLE: 1, WRITE_MULTIPLE: MAX_WRITE, READ_WRITE: MAX_READ_WRITE}.get(function, 0)
    if not (1 if most else 0) <= words <= most or any(not 0 <= word <= 0xFFFF for word in request.words):
        return ILLEGAL_VALUE
    reads = function in READS
    if not (1 if reads else 0) <= request.count <= (MAX_READ if reads else 0):
        return ILLEGAL_VALUE
    for first, span in ((request.address, request.count), (request.write_address, words)):
        if not 0 <= first <= 0x10000 - max(span, 1):
            return ILLEGAL_ADDRESS
    return 0


def build_answer(request: Request, words: Sequence[int] = ()) -> bytes:
    """The answer to `request`: the `words` read, or the echo of what was written."""
    head = bytes((request.function,))
    if request.function in READS:
        return head + bytes((2 * len(words),)) + pack(f">{len(words)}H", *words)
    if request.function == WRITE_SINGLE:
        return head + _PAIR.pack(request.write_address, request.words[0])
    return head + _PAIR.pack(request.write_address, len(request.words))


def exception_answer(function: int, code: int) -> bytes:
    """The answer "no": `function` with its high bit, and why."""
    return bytes((function & 0x7F | 0x80, code & 0xFF))


def parse_answer(request: Request, pdu: bytes) -> list[int]:
    """The words that `pdu` brings for `request`, as a master reads it: exactly `request.count`, none for a pure write.

    Raises:
        DeviceException: the device refused, with its code.
        BadAnswer: function, length, byte count or echo are not those of this request.
    """
    if len(pdu) == 2 and pdu[0] == request.function | 0x80:
        raise DeviceException(pdu[1])
    if not pdu or pdu[0] != request.function:
        raise BadAnswer(f"answer {pdu[:1].hex() or 'without a byte'}: expected function {request.function:02x}")
    if request.function not in READS:
        expected = build_answer(request)
        if pdu != expected:
            raise BadAnswer(f"echo {pdu.hex(' ')}: expected {expected.hex(' ')}")
        return []
    size = 2 * request.count
    if len(pdu) != 2 + size or pdu[1] != size:
        raise BadAnswer(f"{len(pdu) - 2} bytes, announced {pdu[1] if len(pdu) > 1 else 0}: expected {size}")
    return list(_struct(request.count).unpack_from(pdu, 2))


@lru_cache(256)
def _struct(count: int) -> Struct:
    return Struct(f">{count}H")
