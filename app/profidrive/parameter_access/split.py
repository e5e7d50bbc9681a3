"""Many parameters cut into requests that keep the limits: 39 parameters, 240 bytes each way.

An answer's length is judged before it is there: of a value whose format nobody knows 4 bytes are assumed, the most that a number has.
An error block has 6 bytes, as much as a single value of 4.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from app.errors import TelegramError
from app.profidrive.parameter_access.formats import LAYOUTS, Format, size_of
from app.profidrive.parameter_access.messages import (
    ADDRESS,
    BLOCK,
    HEADER,
    LONGEST,
    MOST_ELEMENTS,
    MOST_PARAMETERS,
    WORD,
    Address,
    Failed,
    Result,
    Values,
    Written,
    block_length,
)

ERROR_BLOCK = BLOCK + 4


@dataclass(frozen=True, slots=True)
class Part:
    """A parameter, or the piece of an array that one request carries."""

    place: int
    """In the list that was cut."""
    address: Address
    values: Values | None = None


def read_parts(addresses: Sequence[Address], formats: Sequence[Format | None] = ()) -> list[list[Part]]:
    """One list per request that reads `addresses`, in their order; `formats` where they are known.

    Raises:
        TelegramError: an address that no request can hold.
    """
    known = [*formats, *(None,) * (len(addresses) - len(formats))]
    parts: list[tuple[Part, int, int]] = []
    for place, (address, format) in enumerate(zip(addresses, known, strict=True)):
        _check(address)
        size = size_of(format)
        for piece in _pieces(address, min(MOST_ELEMENTS, (LONGEST - HEADER - BLOCK) // size)):
            parts.append((Part(place, piece), ADDRESS, max(ERROR_BLOCK, block_length(size, piece.elements))))
    return _packed(parts)


def change_parts(changes: Sequence[tuple[Address, Values]]) -> list[list[Part]]:
    """One list per request that writes `changes`, in their order.

    Raises:
        TelegramError: an address that no request can hold, or other than one value per element.
    """
    parts: list[tuple[Part, int, int]] = []
    for place, (address, block) in enumerate(changes):
        _check(address)
        if block.format not in LAYOUTS or len(block.values) != address.elements:
            found = f"{len(block.values)} values of format 0x{block.format:02X}"
            raise TelegramError(str(address), found, f"{address.elements} in a format of values")
        size = size_of(block.format)
        done = 0
        for piece in _pieces(address, min(MOST_ELEMENTS, (LONGEST - HEADER - ADDRESS - BLOCK) // size)):
            values = Values(block.format, block.values[done : done + piece.elements])
            done += piece.elements
            parts.append((Part(place, piece, values), ADDRESS + block_length(size, piece.elements), ERROR_BLOCK))
    return _packed(parts)


def halves(part: Part) -> list[Part]:
    """A part to read in two, for a device that says that the answer gets too long; empty where it is one element."""
    count = part.address.count // 2
    if not count:
        return []
    address = part.address
    first = replace(address, count=count)
    second = replace(address, subindex=address.subindex + count, count=address.count - count)
    return [Part(part.place, first), Part(part.place, second)]


def joined(results: Sequence[Result]) -> Result:
    """What became of a parameter from what became of its pieces: the first failure, else all values."""
    failed = next((result for result in results if isinstance(result, Failed)), None)
    if failed is not None:
        return failed
    blocks = [result for result in results if isinstance(result, Values)]
    if not blocks:
        return Written()
    return Values(blocks[0].format, tuple(value for block in blocks for value in block.values))


def _check(address: Address) -> None:
    last = address.subindex + address.elements - 1
    if not (0 <= address.count <= len(WORD) and address.subindex in WORD and last in WORD and address.number in WORD):
        raise TelegramError(
            str(address), f"{address.count} elements", "number, subindex and last subindex of 0 to 65535"
        )


def _pieces(address: Address, most: int) -> Iterator[Address]:
    if address.count <= most:
        yield address
        return
    for first in range(0, address.count, most):
        count = min(most, address.count - first)
        yield replace(address, subindex=address.subindex + first, count=count)


def _packed(parts: Sequence[tuple[Part, int, int]]) -> list[list[Part]]:
    requests: list[list[Part]] = []
    asked = answered = LONGEST
    for part, request, answer in parts:
        if asked + request > LONGEST or answered + answer > LONGEST or len(requests[-1]) == MOST_PARAMETERS:
            requests.append([])
            asked = answered = HEADER
        requests[-1].append(part)
        asked, answered = asked + request, answered + answer
    return requests
