"""What the history must say, recomputed from the raw rows in the plainest way."""

from dataclasses import dataclass

GAP = 630_000_000
RawRow = tuple[int, float | None, int]
"""time, value, quality"""


def spans(rows: list[RawRow]) -> list[tuple[int, int, float, int]]:
    """(from, to, value, level) of every value that held, and how long."""
    out = []
    for index, (t, v, q) in enumerate(rows):
        end = rows[index + 1][0] if index + 1 < len(rows) else t + GAP
        if v is not None and q & 3 < 2:
            out.append((t, min(end, t + GAP), v, q & 3))
    return out


@dataclass
class Bucket:
    low: float | None
    high: float | None
    first_t: int
    first: float | None
    last_t: int
    last: float | None
    last_q: int
    mean: float | None
    good: int
    held: int
    count: int
    level: int


def bucket(rows: list[RawRow], begin: int, end: int) -> Bucket | None:
    """The samples with begin <= t < end, and what held then; None without samples."""
    inside = [row for row in rows if begin <= row[0] < end]
    if not inside:
        return None
    values = [v for _, v, _ in inside if v is not None]
    pieces = [(min(b, end) - max(a, begin), v, level) for a, b, v, level in spans(rows) if a < end and b > begin]
    good = sum(d for d, _, level in pieces if level == 0)
    area = sum(d * v for d, v, level in pieces if level == 0)
    return Bucket(
        low=min(values, default=None),
        high=max(values, default=None),
        first_t=inside[0][0],
        first=inside[0][1],
        last_t=inside[-1][0],
        last=inside[-1][1],
        last_q=inside[-1][2],
        mean=area / good if good else None,
        good=good,
        held=sum(d for d, _, _ in pieces),
        count=len(inside),
        level=max(q & 3 for _, _, q in inside),
    )


def held_at(rows: list[RawRow], time: int) -> float | None:
    """The value at `time`, None where it was bad or not recorded."""
    return next((v for a, b, v, _ in spans(rows) if a <= time < b), None)
