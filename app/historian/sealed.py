"""Samples of hours that are over: packed, some thousand of a point in one row of `block`, so that a day takes a tenth of its room.

The samples of a point lie either in `sample` or in a block, never in both. Late ones are put into `sample` as ever, also where a block
lies already: whoever reads takes both together, and the next sealing joins them.
"""

from collections.abc import Iterator, Sequence
from heapq import merge
from itertools import groupby

from sqlalchemy import Connection

from app.historian.packing import Packed, Sample, columns, pack, unpack

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
    for number in connection.exec_driver_sql(RIPE, (point, before)).scalars().all():
        while (count := _seal(connection, number, before)) > 0:
            left -= count
            if left <= 0:
                return int(number)
    return None


RIPE = """
SELECT id FROM point p WHERE id >= ? AND EXISTS (SELECT 1 FROM sample WHERE point = p.id AND t < ?) ORDER BY id
"""
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
        connection.exec_driver_sql(f"DELETE FROM block WHERE id IN ({', '.join(str(id) for id, _, _, _ in sealed)})")
    connection.exec_driver_sql("DELETE FROM sample WHERE point = ? AND t >= ? AND t <= ?", (number, first, last))
    for at in range(0, len(rows), MOST):
        _put(connection, number, rows[at : at + MOST])
    return len(rows)


def _put(connection: Connection, number: int, rows: Sequence[Sample]) -> None:
    connection.exec_driver_sql(
        "INSERT INTO block (point, t, last, count, data) VALUES (?, ?, ?, ?, ?)",
        (number, rows[0][0], rows[-1][0], len(rows), pack(rows)),
    )
    connection.exec_driver_sql(
        "INSERT INTO mark (name, t) VALUES (?, ?) ON CONFLICT (name) DO UPDATE SET t = max(t, excluded.t)",
        (MARK, rows[-1][0]),
    )


def reached(connection: Connection) -> int:
    """Up to when anything is sealed [µs UTC]; 0: nothing is."""
    return int(connection.exec_driver_sql("SELECT t FROM mark WHERE name = ?", (MARK,)).scalar() or 0)


def unseal(connection: Connection, first: int, last: int, begin: int, end: int) -> None:
    """Make rows again of what lies in begin <= time < end, of the points `first` to `last`: for statements that read `sample`."""
    if begin > reached(connection):
        return
    blocks = connection.exec_driver_sql(
        "SELECT id, point FROM block WHERE point >= ? AND point <= ? AND t < ? AND last >= ?", (first, last, end, begin)
    ).all()
    for id, number in blocks:
        rows = _read(connection, id).rows()
        connection.exec_driver_sql(  # one that came later wins
            "INSERT OR IGNORE INTO sample (point, t, v, s, q) VALUES (?, ?, ?, ?, ?)",
            [(number, *row) for row in rows],
        )
        connection.exec_driver_sql("DELETE FROM block WHERE id = ?", (id,))


def unseal_all(connection: Connection) -> None:
    """Make rows again of all that is sealed."""
    unseal(connection, 0, 2**62, 0, 2**62)
    connection.exec_driver_sql("DELETE FROM mark WHERE name = ?", (MARK,))


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
    row = connection.exec_driver_sql(
        "SELECT t, v, s, q FROM sample WHERE point = ? AND t <= ? ORDER BY t DESC LIMIT 1", (number, time)
    ).first()
    found: Sample | None = None if row is None else (row[0], row[1], row[2], row[3])
    block = connection.exec_driver_sql(
        "SELECT id, last FROM block WHERE point = ? AND t <= ? ORDER BY t DESC LIMIT 1", (number, time)
    ).first()
    if block is None or (found is not None and found[0] >= min(block[1], time)):
        return found
    whole = _read(connection, block[0])
    at = whole.place(time + 1)
    (sealed,) = whole.part(at - 1, at).rows()
    return sealed if found is None or found[0] < sealed[0] else found


def count(connection: Connection, number: int, begin: int, end: int) -> int:
    """How many samples of a point there are with begin <= time < end."""
    stored = connection.exec_driver_sql(
        "SELECT count(*) FROM sample WHERE point = ? AND t >= ? AND t < ?", (number, begin, end)
    ).scalar_one()
    found = int(stored)
    for id, first, last, count in _blocks(connection, number, begin, end):
        found += count if begin <= first and last < end else len(_read(connection, id).within(begin, end))
    return found


def oldest(connection: Connection) -> int | None:
    """Time of the oldest sealed sample [µs UTC]."""
    time: int | None = connection.exec_driver_sql(
        "SELECT min(t) FROM (SELECT (SELECT min(t) FROM block WHERE point = p.id) AS t FROM point p)"
    ).scalar()
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
        connection.exec_driver_sql("DELETE FROM block WHERE id = ?", (id,))
        if rest:
            _put(connection, number, rest)
        removed += count - len(rest)
    return removed, None


def _stored(connection: Connection, number: int, begin: int, end: int, limit: int) -> list[Sample]:
    rows = connection.exec_driver_sql(
        "SELECT t, v, s, q FROM sample WHERE point = ? AND t >= ? AND t < ? ORDER BY t LIMIT ?",
        (number, begin, end, limit),
    )
    return [(t, v, s, q) for t, v, s, q in rows]


def _blocks(connection: Connection, number: int, begin: int, end: int) -> list[tuple[int, int, int, int]]:
    """Number, first and last time, count of the blocks of a point that have to do with begin <= time < end. None overlaps another."""
    rows = connection.exec_driver_sql(
        "SELECT id, t, last, count FROM block WHERE point = ? AND t < ? AND last >= ? "
        "AND t >= coalesce((SELECT max(t) FROM block WHERE point = ? AND t <= ?), 0) ORDER BY t",
        (number, end, begin, number, begin),
    )
    return [(id, first, last, count) for id, first, last, count in rows]


def _read(connection: Connection, id: int) -> Packed:
    return unpack(connection.exec_driver_sql("SELECT data FROM block WHERE id = ?", (id,)).scalar_one())


def _joined(parts: Sequence[Sequence[Sample]], rows: Sequence[Sample]) -> list[Sample]:
    """All in order of time; of two at the same time that of `rows`, which came later."""
    whole = [row for part in parts for row in part]
    if not rows or not whole or whole[-1][0] < rows[0][0]:
        return [*whole, *rows]
    both = merge(whole, rows, key=lambda row: row[0])  # of equal ones those of the first come first
    return [list(same)[-1] for _, same in groupby(both, key=lambda row: row[0])]
