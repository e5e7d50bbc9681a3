"""Modbus telegrams without their envelope: function code and data, built and parsed on both ends.

A PDU is what RTU (unit, PDU, check sum) and TCP (header, PDU) have in common, at most 253 bytes. Function codes 03, 04, 06, 16, 22
and 23 of registers, 01, 02, 05 and 15 of bits, of which a "word" is 0 or 1; limits from the Modbus application protocol 1.1b3
(reference/modbus.md section 2).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from struct import Struct, error, pack

from app.errors import BadAnswer, DeviceException

READ_COILS = 1
READ_DISCRETE = 2
READ_HOLDING = 3
READ_INPUT = 4
WRITE_COIL = 5
WRITE_SINGLE = 6
WRITE_COILS = 15
WRITE_MULTIPLE = 16
MASK_WRITE = 22
"""The device itself keeps the bits of one register that a mask covers: nothing that it changes meanwhile is lost."""
READ_WRITE = 23
READS = (READ_COILS, READ_DISCRETE, READ_HOLDING, READ_INPUT, READ_WRITE)
WRITES = (WRITE_COIL, WRITE_SINGLE, WRITE_COILS, WRITE_MULTIPLE, MASK_WRITE, READ_WRITE)
FUNCTIONS: Mapping[str, int] = {
    "holding": READ_HOLDING,
    "input": READ_INPUT,
    "coil": READ_COILS,
    "discrete": READ_DISCRETE,
}
"""Table → function that reads it."""
BITS = (READ_COILS, READ_DISCRETE, WRITE_COIL, WRITE_COILS)
"""Functions of coils and discrete inputs."""

MAX_PDU = 253
MAX_READ = 125
MAX_WRITE = 123
MAX_READ_WRITE = 121
"""Registers that function 23 writes."""
MAX_READ_BITS = 2000
MAX_WRITE_BITS = 1968
COIL_ON = 0xFF00
"""What function 05 carries for 1."""

_MOST_READ = dict.fromkeys(READS, MAX_READ) | dict.fromkeys((READ_COILS, READ_DISCRETE), MAX_READ_BITS)
_MOST_WRITTEN = {
    WRITE_COIL: 1,
    WRITE_SINGLE: 1,
    WRITE_COILS: MAX_WRITE_BITS,
    WRITE_MULTIPLE: MAX_WRITE,
    MASK_WRITE: 2,
    READ_WRITE: MAX_READ_WRITE,
}

ILLEGAL_FUNCTION = 1
ILLEGAL_ADDRESS = 2
ILLEGAL_VALUE = 3
SERVER_FAILURE = 4

_PAIR = Struct(">HH")
_TRIPLE = Struct(">HHH")
_WRITE_HEAD = Struct(">HHB")
_READ_WRITE_HEAD = Struct(">HHHHB")


@dataclass(frozen=True, slots=True)
class Request:
    """What a master asks: registers to read, words to write, or both (function 23). Of bits a word is 0 or 1."""

    function: int
    address: int = 0
    """First register to read."""
    count: int = 0
    """Registers to read; 0 when the function only writes."""
    write_address: int = 0
    words: tuple[int, ...] = ()
    """Raw words to write from `write_address` on; empty when the function only reads. Of function 22 the mask of the bits that stay and
    what the others become, both for the one register there."""

    @property
    def addresses(self) -> tuple[int, ...]:
        """First address of each range that the request touches."""
        return (*((self.address,) if self.count else ()), *((self.write_address,) if self.words else ()))


def read_request(address: int, count: int, function: int = READ_HOLDING) -> bytes:
    """PDU that reads `count` registers from the 0-based `address`."""
    return build_request(Request(function, address, count))


def most_read(function: int) -> int:
    """Most registers, or bits, that one telegram with `function` reads."""
    return _MOST_READ[function]


def size_of(function: int, count: int) -> int:
    """Bytes that carry `count` registers, or bits where `function` is one of bits."""
    return (count + 7) // 8 if function in BITS else 2 * count


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
    words = _data(request.function, request.words)
    head = bytes((request.function,))
    if request.function in (WRITE_SINGLE, WRITE_COIL):
        return head + _PAIR.pack(request.write_address, _single(request))
    if request.function == MASK_WRITE:
        return head + _TRIPLE.pack(request.write_address, *request.words)
    if request.function in (WRITE_MULTIPLE, WRITE_COILS):
        return head + _WRITE_HEAD.pack(request.write_address, len(request.words), len(words)) + words
    if request.function == READ_WRITE:
        spans = (request.address, request.count, request.write_address, len(request.words))
        return head + _READ_WRITE_HEAD.pack(*spans, len(words)) + words
    return head + _PAIR.pack(request.address, request.count)


def parse_request(pdu: bytes) -> Request:
    """The request in `pdu`, as a slave reads it.

    Raises:
        DeviceException: 01 for a function that is none of 01 to 06, 15, 16, 22, 23; 03 for a wrong length or count, or a coil that
            is neither on nor off; 02 for a range that ends behind 0xFFFF.
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
    if function == WRITE_COIL:
        address, word = _PAIR.unpack(data)
        # what is neither on nor off stays itself, and so is no bit
        return Request(function, write_address=address, words=({COIL_ON: 1, 1: COIL_ON}.get(word, word),))
    if function == MASK_WRITE:
        address, stay, become = _TRIPLE.unpack(data)
        return Request(function, write_address=address, words=(stay, become))
    if function in (WRITE_MULTIPLE, WRITE_COILS):
        address, count, size = _WRITE_HEAD.unpack_from(data)
        return Request(function, write_address=address, words=_words(data[_WRITE_HEAD.size :], count, size, function))
    if function == READ_WRITE:
        address, count, write_address, write_count, size = _READ_WRITE_HEAD.unpack_from(data)
        words = _words(data[_READ_WRITE_HEAD.size :], write_count, size)
        return Request(function, address, count, write_address, words)
    address, count = _PAIR.unpack(data)
    return Request(function, address, count)


def _words(data: bytes, count: int, size: int, function: int = WRITE_MULTIPLE) -> tuple[int, ...]:
    if not size == len(data) == size_of(function, count):
        raise error(f"{len(data)} bytes, announced {size}, for {count} {'bits' if function in BITS else 'registers'}")
    if function not in BITS:
        return Struct(f">{count}H").unpack(data)
    if count % 8 and data[-1] >> count % 8:
        raise error(f"bits behind the last of {count}, expected 0")
    return _bits(data, count)


def _bits(data: bytes, count: int) -> tuple[int, ...]:
    """The first `count` bits, the lowest of each byte first; what fills up the last byte means nothing."""
    return tuple(data[at >> 3] >> (at & 7) & 1 for at in range(count))


def _data(function: int, words: Sequence[int]) -> bytes:
    """`words` as a telegram carries them."""
    if function not in BITS:
        return pack(f">{len(words)}H", *words)
    whole = sum(1 << at for at, bit in enumerate(words) if bit)
    return whole.to_bytes(size_of(function, len(words)), "little")


def _single(request: Request) -> int:
    word = request.words[0]
    return (COIL_ON if word else 0) if request.function == WRITE_COIL else word


def _fault_of(request: Request) -> int:
    """Exception code that the bare protocol demands for `request`; 0 = none."""
    function, words = request.function, len(request.words)
    if function not in READS and function not in WRITES:
        return ILLEGAL_FUNCTION
    most, largest = _MOST_WRITTEN.get(function, 0), 1 if function in BITS else 0xFFFF
    fewest = most if function == MASK_WRITE else min(most, 1)
    if not fewest <= words <= most or any(not 0 <= word <= largest for word in request.words):
        return ILLEGAL_VALUE
    reads = _MOST_READ.get(function, 0)
    if not (1 if reads else 0) <= request.count <= reads:
        return ILLEGAL_VALUE
    written = 1 if function == MASK_WRITE else words
    for first, span in ((request.address, request.count), (request.write_address, written)):
        if not 0 <= first <= 0x10000 - max(span, 1):
            return ILLEGAL_ADDRESS
    return 0


def build_answer(request: Request, words: Sequence[int] = ()) -> bytes:
    """The answer to `request`: the `words` read, or the echo of what was written."""
    head = bytes((request.function,))
    if request.function in READS:
        data = _data(request.function, words)
        return head + bytes((len(data),)) + data
    if request.function in (WRITE_SINGLE, WRITE_COIL):
        return head + _PAIR.pack(request.write_address, _single(request))
    if request.function == MASK_WRITE:
        return head + _TRIPLE.pack(request.write_address, *request.words)
    return head + _PAIR.pack(request.write_address, len(request.words))


def masked(now: int, words: Sequence[int]) -> int:
    """What a register that holds `now` holds after function 22 with `words`: (now AND stay) OR (become AND NOT stay)."""
    stay, become = words
    return now & stay | become & ~stay & 0xFFFF


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
    size = size_of(request.function, request.count)
    if len(pdu) != 2 + size or pdu[1] != size:
        raise BadAnswer(f"{len(pdu) - 2} bytes, announced {pdu[1] if len(pdu) > 1 else 0}: expected {size}")
    if request.function in BITS:
        return list(_bits(pdu[2:], request.count))
    return list(_struct(request.count).unpack_from(pdu, 2))


@lru_cache(256)
def _struct(count: int) -> Struct:
    return Struct(f">{count}H")
