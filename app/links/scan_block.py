"""One block of registers as it is scanned: words in, a batch of changed values out. No input or output of its own.

Unchanged words are not decoded, unchanged values not published; an empty batch says that the whole block was seen.
"""

from collections.abc import Callable, Mapping, Sequence
from math import inf

from app.links.contract import Block
from app.links.planner import Reading
from app.plant.definitions import Point, Register, Scan, Type
from app.registers.codec import Decoder, decoder
from app.registers.register import Order
from app.tags.batch import Batch, Value
from app.tags.quality import NOT_CONNECTED, OUT_OF_RANGE

WordDecoder = Callable[[int], Value]
_Entry = tuple[int, int, int, WordDecoder | None, Decoder, float, float]
"""Offset in the block, words, handle, quick decoder of one word, decoder, least and greatest value."""


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
        self.points: tuple[Point, ...] = reading.points
        self.names = frozenset(point.name for point in reading.points)
        self.period = period
        self.words: list[int] | None = None
        """Last raw words; None before the first and while there are none."""
        self.quality: int | None = None
        """Quality last published for the whole block."""
        self.attempts = 0
        """Failed tries of the scan that is due."""
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
        self._revision = -1
        self._entries: list[_Entry] = []

    def bind(self, handles: Mapping[str, int], revision: int) -> None:
        """Look the handles up again when the plant has a new revision; everything is published anew then."""
        if revision == self._revision:
            return
        self._revision = revision
        self.words = self.quality = None
        self._entries = []
        for point in self.points:
            register, handle = point.register, handles.get(point.name)
            if register is None or handle is None:
                continue
            low = -inf if point.low is None else point.low
            high = inf if point.high is None else point.high
            offset = register.address - self.block.address
            quick = word_decoder(register)
            self._entries.append((offset, register.words, handle, quick, decoder(register), low, high))

    def seen(self, words: list[int], time: int, quality: int) -> Batch:
        """The batch for `words`, read at `time` [µs UTC] with base quality `quality`."""
        old = self.words
        if quality != self.quality:
            old, self.quality = None, quality
        if words == old:
            return Batch(self.source, self.number, time, time, (), (), quality)
        self.words = words
        handles: list[int] = []
        values: list[Value] = []
        qualities: list[int] | None = None
        for offset, width, handle, quick, decode, low, high in self._entries:
            if quick is not None:
                word = words[offset]
                if old is not None and word == old[offset]:
                    continue
                value = quick(word)
            else:
                raw = words[offset : offset + width]
                if old is not None and raw == old[offset : offset + width]:
                    continue
                value = decode(raw)
            own = quality
            if value is None:
                own = NOT_CONNECTED | quality & 0xF00
            elif not isinstance(value, str) and not low <= value <= high:
                own = OUT_OF_RANGE | quality & 0xF00
            if own != quality and qualities is None:
                qualities = [quality] * len(values)
            handles.append(handle)
            values.append(value)
            if qualities is not None:
                qualities.append(own)
        return Batch(self.source, self.number, time, time, handles, values, quality, qualities)

    def lost(self, time: int, quality: int) -> Batch | None:
        """The batch that takes all values away, with a bad `quality`; None when it was published already."""
        self.words = None
        if quality == self.quality:
            return None
        self.quality = quality
        handles = [entry[2] for entry in self._entries]
        return Batch(self.source, self.number, time, time, handles, [None] * len(handles), quality)


def word_decoder(register: Register) -> WordDecoder | None:
    """A quick way for one plain word: the same value as `registers.codec.decode`; None when there is none."""
    plain = register.words == 1 and register.order is Order.ABCD and register.none is None
    if not plain or register.type is not Type.U16:
        return None
    scale, offset, mask, shift = register.scale, register.offset, register.mask, register.shift
    if scale == 1 and offset == 0:
        if mask is None and shift == 0:
            return _as_it_is
        keep = 0xFFFF if mask is None else mask
        return lambda word: word >> shift & keep
    return None


def _as_it_is(word: int) -> Value:
    return word


def words_of(block: ScanBlock, point: Point) -> Sequence[int] | None:
    """Raw words of `point` as last read; None while there are none."""
    register = point.register
    if block.words is None or register is None:
        return None
    offset = register.address - block.block.address
    return tuple(block.words[offset : offset + register.words])
