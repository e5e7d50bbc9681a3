"""The registers of a virtual PLC: areas that are encoded when they are first asked for and kept until the next scan."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from struct import unpack

from app.registers import plc_map

Give = Callable[[int, int], Sequence[int]]
"""Words of an area from the first offset up to the second."""


@dataclass(frozen=True, slots=True)
class Image:
    """Registers that are swapped as one: generation, what `encode` gives (big-endian bytes), generation."""

    address: int
    words: int
    encode: Callable[[], bytes]


@dataclass(slots=True)
class Table:
    """Rows in fixed slots: a thing keeps its slot as long as it is there; a new one takes the lowest free one."""

    address: int
    row_words: int
    capacity: int
    encode: Callable[[int], bytes]
    """Slot (from 0) → the whole row, big-endian bytes."""
    ids: list[int] = field(default_factory=list)
    """Id by slot, 0 = empty; retained."""
    generation: int = 0
    """Changes (by 2) whenever a slot is taken or freed."""

    def __post_init__(self) -> None:
        if not self.ids:
            self.ids = [0] * self.capacity

    @property
    def count(self) -> int:
        """Rows that a reader must take: the highest used slot, 0 = none."""
        return next((slot + 1 for slot in range(self.capacity - 1, -1, -1) if self.ids[slot]), 0)

    @property
    def words(self) -> int:
        return plc_map.TABLE_HEAD + self.capacity * self.row_words

    def take(self, id: int) -> int | None:
        """The slot that `id` has from now on, None when all are taken."""
        try:
            slot = self.ids.index(0)
        except ValueError:
            return None
        self.ids[slot] = id
        self.generation = self.generation + 2 & 0xFFFE
        return slot

    def free(self, slot: int) -> None:
        """Nothing is in `slot` any more."""
        self.ids[slot] = 0
        self.generation = self.generation + 2 & 0xFFFE

    def clear(self) -> None:
        """Nothing is in any slot."""
        self.ids = [0] * self.capacity
        self.generation = self.generation + 2 & 0xFFFE


class Areas:
    """Who gives the words of which addresses, and what was encoded in this scan."""

    def __init__(self) -> None:
        self._areas: list[tuple[int, int, Give]] = []
        self._encoded: dict[int, Sequence[int]] = {}

    def add(self, address: int, words: int, give: Give) -> None:
        """An area whose words are there at any time.

        Raises:
            ValueError: it overlaps another one.
        """
        self._areas.append((address, address + words, give))
        self._areas.sort(key=lambda one: one[0])
        for (_, after, _), (begin, _, _) in zip(self._areas, self._areas[1:], strict=False):
            if after > begin:
                raise ValueError(f"registers overlap at 0x{begin:04X}")

    def add_image(self, address: int, words: int, encode: Callable[[], Sequence[int]]) -> None:
        """An area that is encoded as a whole, once a scan."""

        def give(first: int, after: int) -> Sequence[int]:
            image = self._encoded.get(address)
            if image is None:
                image = self._encoded[address] = encode()
            return image[first:after]

        self.add(address, words, give)

    def add_table(self, table: Table) -> None:
        """The rows of `table`; only those that are asked for are encoded."""
        self.add(table.address, table.words, lambda first, after: self._rows(table, first, after))

    def read(self, address: int, count: int) -> list[int]:
        """`count` words from `address` on; fewer when the next one is not mapped."""
        words: list[int] = []
        at, end = address, address + count
        for begin, after, give in self._areas:
            if begin <= at < after:
                part = min(end, after)
                words += give(at - begin, part - begin)
                at = part
                if at == end:
                    break
        return words

    def forget(self) -> None:
        """What was encoded is of an earlier scan."""
        self._encoded.clear()

    def _rows(self, table: Table, first: int, after: int) -> Sequence[int]:
        words: list[int] = []
        size = table.row_words
        if first < plc_map.TABLE_HEAD:
            words += [table.generation, table.capacity, table.count, size]
            begin = 0
        else:
            begin = first - (first - plc_map.TABLE_HEAD) % size
        row, last = max(0, begin - plc_map.TABLE_HEAD) // size, (after - plc_map.TABLE_HEAD - 1) // size
        for slot in range(row, last + 1):
            key = table.address + plc_map.TABLE_HEAD + slot * size
            encoded = self._encoded.get(key)
            if encoded is None:
                encoded = self._encoded[key] = unpack(f">{size}H", table.encode(slot))
            words += encoded
        return words[first - begin : after - begin]
