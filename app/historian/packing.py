"""Samples of one point packed together, exactly as they were: about a tenth of what they take as rows, and less.

Times are kept as their distances, numbers as whole numbers of the decimal place that they all share (what a register gives), else
as they are; then come quality words and texts. Each column's bytes are sorted by their place, which makes long runs of equal ones, and
deflated.
"""

import zlib
from array import array
from bisect import bisect_left
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import accumulate, pairwise

import orjson

Sample = tuple[int, float | None, str | None, int]
"""time [µs UTC], number, text, quality word"""

PLACES = (1.0, 10.0, 100.0, 1000.0, 10000.0)
"""Factors that make whole numbers of values; tried in this order."""
WHOLE = 2.0**53
"""Above it floating numbers have gaps between whole ones."""
LEVEL, MEMORY = 6, 3
"""Of zlib. The memory says how many symbols share one table of codes, written before them: 512, so that each column, and each place
in a number, has codes of its own (an hour of a walking register takes 1.88 B a sample; 2.19 B with the 16 384 that zlib takes itself)."""
NUMBER, NOTHING, TEXT = 0, 1, 2
HEAD = 7 * 8
"""Bytes of the head: count, place, length of each column."""


@dataclass(frozen=True, slots=True)
class Packed:
    """Samples in order of time, column by column."""

    times: "array[int]"
    numbers: "array[float]"
    """0 where there is none."""
    qualities: "array[int]"
    kinds: bytes
    """Per sample NUMBER, NOTHING or TEXT; empty: all are numbers."""
    texts: tuple[str, ...]
    """Those of the samples that are texts, in their order."""

    def __len__(self) -> int:
        return len(self.times)

    def rows(self) -> list[Sample]:
        """All samples."""
        columns = zip(self.times, self.numbers, self.qualities, strict=True)
        if not self.kinds:
            return [(time, number, None, quality) for time, number, quality in columns]
        texts = iter(self.texts)
        return [
            (time, number if kind == NUMBER else None, next(texts) if kind == TEXT else None, quality)
            for (time, number, quality), kind in zip(columns, self.kinds, strict=True)
        ]

    def number(self, at: int) -> float | None:
        """The number of the sample at a place, None: it has none."""
        return None if self.kinds and self.kinds[at] != NUMBER else self.numbers[at]

    def place(self, time: int) -> int:
        """Where the first sample at or after `time` is [µs UTC]."""
        return bisect_left(self.times, time)

    def part(self, begin: int, end: int) -> "Packed":
        """The samples from place `begin` to place `end`."""
        before, within = self.kinds.count(TEXT, 0, begin), self.kinds.count(TEXT, begin, end)
        kinds = self.kinds[begin:end]
        return Packed(
            self.times[begin:end],
            self.numbers[begin:end],
            self.qualities[begin:end],
            kinds if any(kinds) else b"",
            self.texts[before : before + within],
        )

    def within(self, begin: int, end: int) -> "Packed":
        """The samples with begin <= time < end."""
        return self.part(self.place(begin), self.place(end))


def columns(samples: Sequence[Sample]) -> Packed:
    """Samples, which are in order of time, column by column."""
    kinds = bytes(NUMBER if s[1] is not None else TEXT if s[2] is not None else NOTHING for s in samples)
    return Packed(
        array("q", [sample[0] for sample in samples]),
        array("d", [0.0 if sample[1] is None else sample[1] for sample in samples]),
        array("q", [sample[3] for sample in samples]),
        kinds if any(kinds) else b"",
        tuple(sample[2] for sample in samples if sample[1] is None and sample[2] is not None),
    )


def pack(samples: Sequence[Sample]) -> bytes:
    """Pack samples that are in order of time."""
    made = columns(samples)
    place, numbers = _whole(made.numbers)
    packed = (
        _bytes(array("q", _changes(made.times))),
        _bytes(numbers),
        _bytes(array("q", _changes(made.qualities))),
        made.kinds,
        orjson.dumps(made.texts) if made.texts else b"",
    )
    head = array("q", (len(made), place, *map(len, packed)))
    deflated = zlib.compressobj(LEVEL, memLevel=MEMORY, strategy=zlib.Z_FILTERED)
    return deflated.compress(head.tobytes() + b"".join(packed)) + deflated.flush()


@lru_cache(maxsize=8)
def unpack(data: bytes) -> Packed:
    """What `pack` packed. The last few are remembered: who reads page by page asks for the same again."""
    whole = zlib.decompress(data)
    head = array("q", whole[:HEAD])
    place, parts, at = head[1], list[bytes](), HEAD
    for length in head[2:]:
        parts.append(whole[at : at + length])
        at += length
    times, numbers, qualities, kinds, texts = parts
    return Packed(
        _sums(times),
        array("d", _together(numbers) if place < 0 else [n / PLACES[place] for n in _signed_sums(numbers)]),
        _sums(qualities),
        kinds,
        tuple(orjson.loads(texts)) if texts else (),
    )


def _whole(exact: "array[float]") -> "tuple[int, array[int] | array[float]]":
    """The place (an index of PLACES) that makes whole numbers of all of them, and their changes; −1 and the values when there is none."""
    if all(-WHOLE < value * PLACES[-1] < WHOLE for value in exact):
        for place, factor in enumerate(PLACES):
            whole = [round(value * factor) for value in exact]
            if (
                array("d", [n / factor for n in whole]).tobytes() == exact.tobytes()
            ):  # to the bit: there is a negative zero
                return place, array(
                    "q", [2 * n if n >= 0 else -2 * n - 1 for n in _changes(whole)]
                )  # small, whatever the sign
    return -1, exact


def _sums(changes: bytes) -> "array[int]":
    return array("q", accumulate(array("q", _together(changes))))


def _signed_sums(changes: bytes) -> Iterator[int]:
    return accumulate(n >> 1 if n & 1 == 0 else ~(n >> 1) for n in array("q", _together(changes)))


def _changes(values: Sequence[int]) -> list[int]:
    """The first value, then by how much each differs from the one before."""
    return [*values[:1], *(b - a for a, b in pairwise(values))]


def _bytes(values: "array[int] | array[float]") -> bytes:
    """All first bytes, all second ones…"""
    raw = values.tobytes()
    return b"".join(raw[place::8] for place in range(8))


def _together(data: bytes) -> bytes:
    """What `_bytes` took apart."""
    raw, count = bytearray(len(data)), len(data) // 8
    for place in range(8):
        raw[place::8] = data[place * count : (place + 1) * count]
    return bytes(raw)
