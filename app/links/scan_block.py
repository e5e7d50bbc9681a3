"""One block of registers as it is scanned: words in, a batch of changed values out. No input or output of its own.

Unchanged words are not decoded, unchanged values not published; an empty batch says that the whole block was seen.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from math import inf

from app.links.contract import Block
from app.links.planner import Reading
from app.plant.definitions import Point, Register, Scan, Type
from app.registers.codec import Decoder, decoder
from app.registers.register import Order
from app.tags.batch import Batch, Value
from app.tags.quality import IMPLAUSIBLE, NOT_CONNECTED, OUT_OF_RANGE

WordDecoder = Callable[[int], float]
_Quick = tuple[int, int, WordDecoder, float, float, Point]
"""Offset in the block, handle, decoder of one word, least and greatest good value, point."""
_Entry = tuple[int, int, int, Decoder, float, float, Point]
"""Offset in the block, words, handle, decoder, least and greatest good value, point."""


_DIVISORS = {1 / divisor: divisor for divisor in (10, 100, 1000, 10_000)}


def good_range(point: Point) -> tuple[float, float]:
    """Least and greatest value of `point` [EU] that is good: within what the device can report, and plausible."""
    first, last = point.plausible or (-inf, inf)
    return max(first, -inf if point.low is None else point.low), min(last, inf if point.high is None else point.high)


def beyond(point: Point, number: float) -> int:
    """Quality of a `number` [EU] outside the good range of `point`: bad where it is not plausible either, else uncertain."""
    first, last = point.plausible or (-inf, inf)
    return OUT_OF_RANGE if point.plausible is None or first <= number <= last else IMPLAUSIBLE


class ScanBlock:
    """A planned reading with its number, its schedule and what was last seen in it."""

    def __init__(self, source: str, number: int, unit: int, reading: Reading, period: float) -> None:
        """`number` of the block within `source`; `period`: time between two scans [s], infinite for what is read once."""
        self.source = source
        self.number = number
        self.unit = unit
        self.reading = reading
        self.block: Block = reading.block
        self.scan: Scan = reading.scan
        self.part = reading.part
        """None for plain registers; else `links.plc` looks at what was read before it is published."""
        self.points: tuple[Point, ...] = reading.points
        self.names = frozenset(point.name for point in reading.points)
        self.period = period
        self.words: list[int] | None = None
        """Last raw words; None before the first and while there are none."""
        self.last: list[int] | None = None
        """The same, also of a device that fell silent."""
        self.answered = False
        """Whether there ever were some."""
        self.quality: int | None = None
        """Quality last published for the whole block."""
        self.attempts = 0
        """Failed tries of the scan that is due."""
        self.unheard = False
        """Whether nothing came back at the last of them."""
        self.failures = 0
        """Scans in a row that the device refused."""
        self.started = 0.0
        """When the telegram was sent whose answer was published last [s]."""
        self.scanned = 0.0
        """When the last scan ended [s]; 0 = never."""
        self.due = 0.0
        """When it is or was to be scanned next [s]."""
        self.ticket = 0
        """Counts its places in the schedule; only the last one holds."""
        self.queued = False
        """Waiting for its turn."""
        self.alive = True
        """False once a new plan has replaced it."""
        self.wanted = True
        """False for rows of a table that its head does not count: they are not read."""
        self.torn = 0
        """Tries of the scan that is due whose answer the device was changing."""
        self._revision = -1
        self._quick: list[_Quick] = []
        self._entries: list[_Entry] = []

    def bind(self, handles: Mapping[str, int], revision: int) -> None:
        """Look the handles up again when the plant has a new revision; everything is published anew then."""
        if revision == self._revision:
            return
        self._revision = revision
        self.words = self.quality = None
        self._quick, self._entries = [], []
        self._bind(self.points, handles)

    def _bind(self, points: Iterable[Point], handles: Mapping[str, int]) -> None:
        for point in points:
            register, handle = point.register, handles.get(point.name)
            if register is None or handle is None:
                continue
            low, high = good_range(point)
            offset = register.address - self.block.address
            quick = word_decoder(register)
            if quick is not None:
                self._quick.append((offset, handle, quick, low, high, point))
            else:
                self._entries.append((offset, register.words, handle, decoder(register), low, high, point))

    def seen(self, words: list[int], time: int, quality: int) -> Batch:
        """The batch for `words`, read at `time` [µs UTC] with base quality `quality`."""
        old = self.words
        if quality != self.quality:
            old, self.quality = None, quality
        if words == old:
            return Batch(self.source, self.number, time, time, (), (), quality)
        self.words = self.last = words
        self.answered = True
        handles: list[int] = []
        values: list[Value] = []
        uneven: dict[int, int] = {}
        self._collect(words, old or [-1] * len(words), quality, handles, values, uneven)
        qualities = [uneven.get(index, quality) for index in range(len(handles))] if uneven else None
        return Batch(self.source, self.number, time, time, handles, values, quality, qualities)

    def _collect(
        self,
        words: list[int],
        before: list[int],
        quality: int,
        handles: list[int],
        values: list[Value],
        uneven: dict[int, int],
    ) -> None:
        """Append what changed; `uneven` gets the quality of those that have one of their own."""
        for offset, handle, quick, low, high, point in self._quick:
            word = words[offset]
            if word != before[offset]:
                number = quick(word)
                if not low <= number <= high:
                    uneven[len(handles)] = beyond(point, number) | quality & 0xF00
                handles.append(handle)
                values.append(number)
        for offset, width, handle, decode, low, high, point in self._entries:
            raw = words[offset : offset + width]
            if raw != before[offset : offset + width]:
                value = decode(raw)
                if value is None:
                    uneven[len(handles)] = NOT_CONNECTED | quality & 0xF00
                elif not isinstance(value, str) and not low <= value <= high:
                    uneven[len(handles)] = beyond(point, value) | quality & 0xF00
                handles.append(handle)
                values.append(value)

    def lost(self, time: int, quality: int) -> Batch | None:
        """The batch that takes all values away, with a bad `quality`; None when it was published already."""
        self.words = None
        if quality == self.quality:
            return None
        self.quality = quality
        handles = self._handles()
        return Batch(self.source, self.number, time, time, handles, [None] * len(handles), quality)

    def _handles(self) -> list[int]:
        return [entry[1] for entry in self._quick] + [entry[2] for entry in self._entries]


def word_decoder(register: Register) -> WordDecoder | None:
    """A quick way for one plain word: the same number as `registers.codec.decode`; None when there is none.

    A quotient by a power of ten is the number nearest to the decimal one, so nothing is rounded afterwards.
    """
    plain = register.words == 1 and register.order is Order.ABCD and register.none is None and register.offset == 0
    if not plain or register.type not in (Type.U16, Type.BIT):
        return None
    keep, shift = 0xFFFF if register.mask is None else register.mask, register.shift
    whole = register.mask is None and shift == 0
    if register.scale == 1:
        return _as_it_is if whole else lambda word: word >> shift & keep
    divisor = _DIVISORS.get(register.scale)
    if divisor is None:
        return None
    return (lambda word: word / divisor) if whole else lambda word: (word >> shift & keep) / divisor


def _as_it_is(word: int) -> float:
    return word


def words_of(block: ScanBlock, point: Point) -> Sequence[int] | None:
    """Raw words of `point` as last read; None while there are none."""
    register = point.register
    if block.words is None or register is None:
        return None
    offset = register.address - block.block.address
    return tuple(block.words[offset : offset + register.words])
