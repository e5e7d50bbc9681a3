"""What a serial line still owes: requests without an answer, whose answers may come at any time, or never. Pure: it is told the time.

RTU has no transaction number. Two answers can only be told apart by unit, function and length (a read), or by the echo (a write), so a read
is sent only while no older one could still be answered by the same kind of telegram. Nothing is assumed of the order of answers.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from app.links.contract import Block
from app.registers.pdu import BITS, READS, Request, build_answer, most_read, size_of

LATEST = 10.0
"""A device that has not answered for so long has forgotten the request [s]; later answers are beyond what this can tell."""
SPANS = 8
"""Ranges that each unit is known to answer, the largest are kept."""
TRIALS = 8
"""How many registers more, or bytes of bits, a unit that never answered is asked for, to tell its answers apart."""

Pattern = tuple[int, int, bytes]
"""Unit, function, and what tells two answers apart: the byte count of a read, the echo of a write."""


def pattern_of_request(unit: int, request: Request) -> Pattern:
    """How the answer to `request` will look."""
    if request.function in READS:
        return unit, request.function, bytes((size_of(request.function, request.count),))
    return unit, request.function, build_answer(request)[1:]


def pattern_of_answer(unit: int, pdu: bytes) -> Pattern:
    """How this answer looks."""
    return unit, pdu[0], pdu[1:2] if pdu[0] in READS else pdu[1:]


@dataclass(frozen=True, slots=True)
class Piece:
    """One telegram of a read and the words of its answer that are wanted."""

    block: Block
    skip: int
    count: int


class LateAnswers:
    """Memory of one line. It outlives a reconnection: what the device was asked before, it may answer after."""

    def __init__(self) -> None:
        self._patterns: list[tuple[Pattern, float, int]] = []
        self._proven: dict[tuple[int, int], list[tuple[int, int]]] = {}

    def unanswered(self, pattern: Pattern, now: float, address: int = -1, *, until: float = 0.0) -> None:
        """A request whose answer looks like `pattern` was given up at `now` [s]: `address` of a read, `until` if not `LATEST` from now."""
        self._patterns.append((pattern, until or now + LATEST, address))

    def settle(self, pattern: Pattern, now: float) -> bool:
        """An answer that looks like `pattern` came: whether one was owed; the oldest is paid."""
        return self.settled(pattern, now) > 0

    def settled(self, pattern: Pattern, now: float) -> float:
        """`settle`, and until when that one was owed [s]; 0 = none was."""
        for index, (due, until, _) in enumerate(self._patterns):
            if due == pattern and until > now:
                del self._patterns[index]
                return until
        return 0.0

    def expects(self, pattern: Pattern, now: float) -> bool:
        """Whether an answer that looks like `pattern` may still come."""
        return any(due == pattern and until > now for due, until, _ in self._patterns)

    def only(self, unit: int, block: Block, now: float) -> bool:
        """Whether everything that an answer to `block` could be taken for is an earlier read of the same registers."""
        pattern = pattern_of_request(unit, Request(block.function, block.address, block.count))
        return all(address == block.address for due, until, address in self._patterns if due == pattern and until > now)

    def owes(self, unit: int, function: int, now: float) -> bool:
        """Whether an answer of this unit and function may still come: a refusal could be meant for that one."""
        self._patterns = [entry for entry in self._patterns if entry[1] > now]
        return any(pattern[:2] == (unit, function) for pattern, _, _ in self._patterns)

    def proven(self, unit: int, block: Block) -> None:
        """The unit has answered `block`."""
        spans = self._proven.setdefault((unit, block.function), [])
        if not any(first <= block.address and block.last <= last for first, last in spans):
            spans.append((block.address, block.last))
            spans.sort(key=lambda span: span[0] - span[1])
            del spans[SPANS:]

    def refused(self, unit: int, block: Block) -> None:
        """The unit has refused `block`: what it once answered there holds no longer."""
        spans = self._proven.get((unit, block.function), [])
        spans[:] = [span for span in spans if span[1] < block.address or block.last < span[0]]

    def pieces(self, unit: int, block: Block, now: float) -> tuple[Sequence[Piece], float]:
        """The telegrams that read `block` so that no late answer can be taken for theirs; none, and how long to wait [s], if nothing does.

        A read whose like is owed grows into registers that the unit is known to answer, else it is cut where no value is torn.
        """
        if not self.owes(unit, block.function, now):
            return [Piece(block, 0, block.count)], 0.0
        taken = {pattern[2][0]: until for pattern, until, _ in self._patterns if pattern[:2] == (unit, block.function)}
        size = size_of(block.function, block.count)
        if size not in taken:
            return [Piece(block, 0, block.count)], 0.0
        found = self._grown(unit, block, taken) or _cut(block, taken)
        if not found and (unit, block.function) not in self._proven:
            found = _tried(block, taken)
        return found, 0.0 if found else max(0.0, taken[size] - now)

    def _grown(self, unit: int, block: Block, taken: dict[int, float]) -> list[Piece]:
        best: list[Piece] = []
        for first, last in self._proven.get((unit, block.function), []):
            if not (first <= block.address and block.last <= last):
                continue
            for count in range(block.count + 1, last - first + 2):
                if size_of(block.function, count) not in taken and (not best or count < best[0].block.count):
                    begin = max(first, min(block.address, last + 1 - count))
                    best = [Piece(Block(begin, count, block.function), block.address - begin, block.count)]
                    break
        return best


def _cut(block: Block, taken: dict[int, float]) -> list[Piece]:
    """The fewest parts, none of a length that is owed. `taken`: lengths [bytes] → until when."""
    ends = (0, *block.cuts, block.count)
    best: dict[int, list[int]] = {0: []}
    for end in ends[1:]:
        ways = [
            best[begin]
            for begin in ends
            if begin < end and begin in best and size_of(block.function, end - begin) not in taken
        ]
        if ways:
            best[end] = [*min(ways, key=len), end]
    parts, begin = [], 0
    for end in best.get(block.count, []):
        parts.append(Piece(Block(block.address + begin, end - begin, block.function), 0, end - begin))
        begin = end
    return parts


def _tried(block: Block, taken: dict[int, float]) -> list[Piece]:
    """A few registers more than asked for; nobody knows whether they exist."""
    most = min(most_read(block.function), 0x10000 - block.address)
    trials = TRIALS * 8 if block.function in BITS else TRIALS
    for count in range(block.count + 1, min(block.count + trials, most) + 1):
        if size_of(block.function, count) not in taken:
            return [Piece(Block(block.address, count, block.function), 0, block.count)]
    return []
