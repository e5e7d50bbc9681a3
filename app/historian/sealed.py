"""Samples of hours that are over: packed, some thousand of a point in one row of `block`, so that a day takes a tenth of its room.

The samples of a point lie either in `sample` or in a block, never in both. Late ones are put into `sample` as ever, also where a block
lies already: whoever reads takes both together, and the next sealing joins them.
"""

from collections.abc import Iterator, Sequence
from heapq import merge
from itertools import groupby

from sqlalchemy import Connection, bindparam, delete, exists, func, insert, select

from app.historian.dialect import EVERYTHING, Statement, adding, greatest, updating
from app.historian.packing import Packed, Sample, columns, pack, unpack
from app.historian.tables import block, mark, point, sample

HOUR = 3_600_000_000
"""[µs]"""
YOUNG = 2 * HOUR
"""Samples stay as they are so long [µs]: those are read most, late ones come meanwhile, and roll-ups are written."""
LEAST = 500
"""So many samples of a point are packed; fewer wait for more, but not longer than a day."""
LONGEST = 24 * HOUR
MOST = 8000
"""Samples of one block."""
AT_ONCE = 40_000
"""Samples that are sealed in one transaction."""
MARK = "sealed"
"""Name of the mark up to when anything is sealed."""


def seal(connection: Connection, before: int, point: int = 0) -> int | None:
    """Seal what is older than the hour of `before` [µs UTC] of the points from number `point` on, some of it; None: all is done.

    Returns the number of the point to go on with.
    """
    before = before // HOUR * HOUR
    left = AT_ONCE
    for number in RIPE(connection, since=point, before=before).scalars().all():
        while (count := _seal(connection, number, before)) > 0:
            left -= count
            if left <= 0:
                return int(number)
    return None


RIPE = Statement(
    select(point.c.id)
    .where(
        point.c.id >= bindparam("since"),
        exists().where(sample.c.point == point.c.id, sample.c.t < bindparam("before")).correlate(point),
    )
    .order_by(point.c.id)
)
"""Points with samples that may be sealed: each costs a look into the index, and not a statement."""


def _seal(connection: Connection, number: int, before: int) -> int:
    """Seal one block of a point; how many samples it has, 0: there are too few."""
    rows = _stored(connection, number, 0, before, MOST)
    if len(rows) < LEAST and not (rows and rows[0][0] < before - LONGEST):
        return 0
    first, last = rows[0][0], rows[-1][0]
    sealed = _blocks(connection, number, first, last + 1)
    if sealed:
        rows = _joined([_read(connection, id).rows() for id, _, _, _ in sealed], rows)
        REMOVE.rows(connection, [(id,) for id, _, _, _ in sealed])
    PACKED(connection, number=number, first=first, last=last)
    for at in range(0, len(rows), MOST):
        _put(connection, number, rows[at : at + MOST])
    return len(rows)


def _put(connection: Connection, number: int, rows: Sequence[Sample]) -> None:
    last = rows[-1][0]
    PUT(connection, point=number, t=rows[0][0], last=last, count=len(rows), data=pack(rows))
    REACH(connection, name=MARK, t=last)


PACKED = Statement(
    delete(sample).where(
        sample.c.point == bindparam("number"), sample.c.t >= bindparam("first"), sample.c.t <= bindparam("last")
    )
)
PUT = Statement(insert(block), "point", "t", "last", "count", "data")
REMOVE = Statement(delete(block).where(block.c.id == bindparam("number")), "number")
REACH = Statement(updating(mark, ["name"], lambda new: {"t": greatest(mark.c.t, new.t)}), "name", "t")


def reached(connection: Connection) -> int:
    """Up to when anything is sealed [µs UTC]; 0: nothing is."""
    return int(REACHED(connection, name=MARK).scalar() or 0)


def unseal(connection: Connection, first: int, last: int, begin: int, end: int) -> None:
    """Make rows again of what lies in begin <= time < end, of the points `first` to `last`: for statements that read `sample`."""
    if begin > reached(connection):
        return
    for id, number in OF_POINTS(connection, first=first, last=last, begin=begin, end=end).all():
        rows = _read(connection, id).rows()
        PUT_BACK.rows(connection, [(number, *row) for row in rows])  # one that came later wins
        REMOVE(connection, number=id)


def unseal_all(connection: Connection) -> None:
    """Make rows again of all that is sealed."""
    unseal(connection, 0, 2**62, 0, 2**62)
    FORGET(connection, name=MARK)


REACHED = Statement(select(mark.c.t).where(mark.c.name == bindparam("name")))
FORGET = Statement(delete(mark).where(mark.c.name == bindparam("name")))
PUT_BACK = Statement(adding(sample), "point", "t", "v", "s", "q")
OF_POINTS = Statement(
    select(block.c.id, block.c.point).where(
        block.c.point >= bindparam("first"),
        block.c.point <= bindparam("last"),
        block.c.t < bindparam("end"),
        block.c.last >= bindparam("begin"),
    )
)


# ---- reading ----------------------------------------------------------------------------------------------


def samples(connection: Connection, number: int, begin: int, end: int, limit: int = -1) -> list[Sample]:
    """The first `limit` samples (negative: all) of a point with begin <= time < end, in order."""
    rows = _stored(connection, number, begin, end, limit)
    parts: list[list[Sample]] = []
    found = 0
    for part in packed(connection, number, begin, end):
        parts.append(part.rows())
        found += len(parts[-1])
        if 0 <= limit <= found:
            break
    if not parts:
        return rows
    joined = _joined(parts, rows)
    return joined if limit < 0 else joined[:limit]


def packed(connection: Connection, number: int, begin: int, end: int) -> Iterator[Packed]:
    """Those sealed samples of a point with begin <= time < end, block by block, in order."""
    for id, first, last, _ in _blocks(connection, number, begin, end):
        whole = _read(connection, id)
        yield whole if begin <= first and last < end else whole.within(begin, end)


def together(connection: Connection, number: int, begin: int, end: int) -> Packed:
    """The samples of a point with begin <= time < end, those of a block with those that came later."""
    parts, rows = list(packed(connection, number, begin, end)), _stored(connection, number, begin, end, -1)
    if len(parts) == 1 and not rows:
        return parts[0]
    return columns(_joined([part.rows() for part in parts], rows))


def spans(connection: Connection, number: int, begin: int, end: int) -> list[tuple[int, int]]:
    """First and last time of the blocks of a point that have to do with begin <= time < end, in order."""
    return [(first, last) for _, first, last, _ in _blocks(connection, number, begin, end)]


def last(connection: Connection, number: int, time: int) -> Sample | None:
    """The last sample of a point at or before `time` [µs UTC]."""
    row = LAST(connection, number=number, time=time).first()
    found: Sample | None = None if row is None else (row[0], row[1], row[2], row[3])
    part = LAST_BLOCK(connection, number=number, time=time).first()
    if part is None or (found is not None and found[0] >= min(part[1], time)):
        return found
    whole = _read(connection, part[0])
    at = whole.place(time + 1)
    (sealed,) = whole.part(at - 1, at).rows()
    return sealed if found is None or found[0] < sealed[0] else found


def count(connection: Connection, number: int, begin: int, end: int) -> int:
    """How many samples of a point there are with begin <= time < end."""
    found = int(COUNT(connection, number=number, begin=begin, end=end).scalar_one())
    for id, first, last, count in _blocks(connection, number, begin, end):
        found += count if begin <= first and last < end else len(_read(connection, id).within(begin, end))
    return found


def oldest(connection: Connection) -> int | None:
    """Time of the oldest sealed sample [µs UTC]."""
    time: int | None = OLDEST(connection).scalar()
    return time


def cut(connection: Connection, number: int, before: int, at_once: int) -> tuple[int, int | None]:
    """Remove blocks of a point with samples older than `before`, of about `at_once` samples; of one that goes on, what is younger stays.

    Returns how many samples were removed, and the time up to which, None: up to `before`.
    """
    removed = 0
    for id, first, last, count in _blocks(connection, number, 0, before):
        if removed >= at_once:
            return removed, first
        whole = _read(connection, id)
        rest = [] if last < before else whole.within(before, last + 1).rows()
        REMOVE(connection, number=id)
        if rest:
            _put(connection, number, rest)
        removed += count - len(rest)
    return removed, None


def _stored(connection: Connection, number: int, begin: int, end: int, limit: int) -> list[Sample]:
    rows = STORED(connection, number=number, begin=begin, end=end, limit=limit if limit >= 0 else EVERYTHING)
    return [(t, v, s, q) for t, v, s, q in rows]


def _blocks(connection: Connection, number: int, begin: int, end: int) -> list[tuple[int, int, int, int]]:
    """Number, first and last time, count of the blocks of a point that have to do with begin <= time < end. None overlaps another."""
    rows = BLOCKS(connection, number=number, begin=begin, end=end)
    return [(id, first, last, count) for id, first, last, count in rows]


def _read(connection: Connection, id: int) -> Packed:
    return unpack(DATA(connection, number=id).scalar_one())


def _joined(parts: Sequence[Sequence[Sample]], rows: Sequence[Sample]) -> list[Sample]:
    """All in order of time; of two at the same time that of `rows`, which came later."""
    whole = [row for part in parts for row in part]
    if not rows or not whole or whole[-1][0] < rows[0][0]:
        return [*whole, *rows]
    both = merge(whole, rows, key=lambda row: row[0])  # of equal ones those of the first come first
    return [list(same)[-1] for _, same in groupby(both, key=lambda row: row[0])]


_mine, _its = sample.c.point == bindparam("number"), block.c.point == bindparam("number")
_in_span = _mine, sample.c.t >= bindparam("begin"), sample.c.t < bindparam("end")
STORED = Statement(
    select(sample.c.t, sample.c.v, sample.c.s, sample.c.q)
    .where(*_in_span)
    .order_by(sample.c.t)
    .limit(bindparam("limit"))
)
COUNT = Statement(select(func.count()).select_from(sample).where(*_in_span))
LAST = Statement(
    select(sample.c.t, sample.c.v, sample.c.s, sample.c.q)
    .where(_mine, sample.c.t <= bindparam("time"))
    .order_by(sample.c.t.desc())
    .limit(1)
)
LAST_BLOCK = Statement(
    select(block.c.id, block.c.last).where(_its, block.c.t <= bindparam("time")).order_by(block.c.t.desc()).limit(1)
)
_before = block.alias()
_first = (
    select(func.max(_before.c.t))
    .where(_before.c.point == bindparam("number"), _before.c.t <= bindparam("begin"))
    .scalar_subquery()
)
BLOCKS = Statement(
    select(block.c.id, block.c.t, block.c.last, block.c.count)
    .where(
        _its, block.c.t < bindparam("end"), block.c.last >= bindparam("begin"), block.c.t >= func.coalesce(_first, 0)
    )
    .order_by(block.c.t)
)
DATA = Statement(select(block.c.data).where(block.c.id == bindparam("number")))
_least = select(func.min(block.c.t)).where(block.c.point == point.c.id).correlate(point).scalar_subquery()
_of_each = select(_least.label("t")).select_from(point).subquery()
OLDEST = Statement(select(func.min(_of_each.c.t)))
