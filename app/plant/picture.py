"""Where the machines of a plant stand in its picture: the flow of material runs from left to right, what has none is set in rows (pure)."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

WIDTH, MANY, WIDTH_OF_MANY = 3, 7, 4
"""Machines without a flow that stand side by side, from `MANY` on one more; still more where the flow needs more columns."""
MOST_COLUMNS = 8
MOST_MACHINES = 48
"""Of a picture: a larger plant has its tiles only."""
Pair = tuple[str, str]
CELL = 100
"""Width and height of a place in the units of a line."""


@dataclass(frozen=True, slots=True)
class PictureData:
    """What the picture of the plant shows of a machine."""

    state: str
    """Point: its state in words."""
    moving: str
    """Point that tells that it moves, by being one of `when`."""
    when: str
    """`1,2`"""
    figure: str
    """Point: the one number that matters."""


@dataclass(frozen=True, slots=True)
class Picture:
    """Machines at their places."""

    columns: int
    cells: Sequence[str]
    """Row by row, `columns` in each: the id of a machine, or empty."""
    lines: Mapping[Pair, str]
    """From one machine to another → the path between their places, `CELL` units each."""
    entries: Mapping[str, frozenset[str]]
    """Machine → sides at which lines reach it: left, right, top, bottom."""

    @property
    def rows(self) -> int:
        """How many rows of places there are."""
        return len(self.cells) // self.columns if self.columns else 0


def arrange(machines: Sequence[str], pairs: Iterable[Pair]) -> Picture:
    """Places for `machines` (in the order of the plant file) of which each of `pairs` goes from the first to the second.

    Each machine stands right of all that lead to it; a pair that closes a circle goes back. Machines that are joined stand together.
    A pair with a machine that is not among them does not count.
    """
    known = set(machines)
    joined = [pair for pair in dict.fromkeys(pairs) if set(pair) <= known and pair[0] != pair[1]]
    depth = _depths(machines, joined)
    columns = max(
        [*(depth[id] + 1 for id in machines), min(WIDTH if len(machines) < MANY else WIDTH_OF_MANY, len(machines))],
        default=0,
    )
    rows: list[list[str]] = []
    loose: list[str] = []
    for group in _groups(machines, joined):
        if len(group) == 1:
            loose += group
            continue
        block: list[list[str]] = []
        for id in group:
            row = next((row for row in block if not row[depth[id]]), None)
            if row is None:
                row = [""] * columns
                block.append(row)
            row[depth[id]] = id
        rows += block
    for id in loose:  # into what is empty at the right of the flow first, then into rows of their own
        row = next((row for row in rows if not row[-1]), None)
        if row is None:
            row = [""] * columns
            rows.append(row)
        row[next(at for at in range(columns) if not any(row[at:]))] = id
    cells = [id for row in rows for id in row]
    place = {id: divmod(at, columns)[::-1] for at, id in enumerate(cells) if id}
    lines = {(a, b): _path(place[a], place[b]) for a, b in joined}
    entries = {id: frozenset(_side(place[a], place[b]) for a, b in joined if b == id) for id in {b for _, b in joined}}
    return Picture(columns, cells, lines, entries)


def _depths(machines: Sequence[str], pairs: Sequence[Pair]) -> dict[str, int]:
    """Machine → how many stand left of it on its longest way; none stands beyond the last column."""
    forward: list[Pair] = []
    for a, b in pairs:
        if a not in _reached(b, forward):
            forward.append((a, b))
    depth = dict.fromkeys(machines, 0)
    for _ in range(MOST_COLUMNS):
        for a, b in forward:
            depth[b] = min(max(depth[b], depth[a] + 1), MOST_COLUMNS - 1)
    return depth


def _reached(start: str, pairs: Sequence[Pair]) -> set[str]:
    found, todo = {start}, [start]
    while todo:
        id = todo.pop()
        more = {b for a, b in pairs if a == id} - found
        found |= more
        todo += more
    return found


def _groups(machines: Sequence[str], pairs: Sequence[Pair]) -> list[list[str]]:
    """Machines that are joined, whatever the direction, in the order of the plant file."""
    both = [*pairs, *((b, a) for a, b in pairs)]
    found: list[list[str]] = []
    seen: set[str] = set()
    for id in machines:
        if id not in seen:
            reached = _reached(id, both)
            seen |= reached
            found.append([one for one in machines if one in reached])
    return found


def _path(a: tuple[int, int], b: tuple[int, int]) -> str:
    """From the middle of place `a` to that of `b`: along, across just before `b`, along."""
    (ax, ay), (bx, by) = ((CELL * column + CELL // 2, CELL * row + CELL // 2) for column, row in (a, b))
    if ax == bx or ay == by:
        return f"M{ax} {ay}L{bx} {by}"
    turn = bx - CELL // 2 if bx > ax else bx + CELL // 2
    return f"M{ax} {ay}H{turn}V{by}H{bx}"


def _side(a: tuple[int, int], b: tuple[int, int]) -> str:
    if a[0] != b[0]:
        return "left" if a[0] < b[0] else "right"
    return "top" if a[1] < b[1] else "bottom"
