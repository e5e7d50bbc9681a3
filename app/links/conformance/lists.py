"""Rules of what is told in rows: the event ring, the answers to commands, the tables."""

import asyncio
from collections.abc import Sequence
from itertools import pairwise

from app.links.conformance.finding import Skipped, at, require, require_none, several, span
from app.links.conformance.images import unknown_value
from app.links.conformance.subject import MOST_WORDS, PAUSE, TRIES, Rows, Subject, number
from app.plant.definitions import Image, TableMap
from app.registers import plc_map
from app.registers.plc_map import AnswerState, DeviceEvent

FEWEST, MOST = 32, 63
"""Rows of a ring."""
RING = Image(plc_map.EVENTS, plc_map.EVENTS_WORDS)
ANSWERS = Image(plc_map.ANSWERS, plc_map.ANSWERS_WORDS)


async def ring(subject: Subject) -> None:
    """The head: capacity, words of a row, oldest, newest and acknowledged sequence."""
    if not subject.map.events:
        raise Skipped("none")
    words = await subject.again(RING)
    capacity, size = words[1], words[2]
    require(FEWEST <= capacity <= MOST, at(plc_map.EVENTS + 1, capacity), f"{FEWEST} … {MOST}")
    assert subject.first
    told = plc_map.EVENT_WORDS if subject.first.words[plc_map.AT_MINOR] else plc_map.LEAST_EVENT_WORDS
    require(told <= size <= MOST_WORDS, at(plc_map.EVENTS + 2, size), f"{told}")
    end = plc_map.EVENT_ROWS + capacity * size
    others = [image.address for image in subject.map.images] + [table.address for table in subject.kind.tables.values()]
    next_one = min((place for place in others if place > plc_map.EVENT_ROWS), default=0x10000)
    require(end <= next_one, f"{span(plc_map.EVENT_ROWS, capacity * size)}", f"< 0x{next_one:04X}")
    oldest, newest, seen = (
        number(words[n : n + 2]) for n in (plc_map.AT_OLDEST, plc_map.AT_NEWEST, plc_map.AT_ACKNOWLEDGED)
    )
    kept = newest - oldest + 1
    told_span = f"{at(plc_map.EVENTS + plc_map.AT_OLDEST, oldest)}, {at(plc_map.EVENTS + plc_map.AT_NEWEST, newest)}"
    require(0 <= kept <= capacity, told_span, f"0x0405 − 0x0403 + 1 = 0 … {capacity}")
    require(seen <= newest, at(plc_map.EVENTS + plc_map.AT_ACKNOWLEDGED, seen), f"≤ {newest}")


async def ring_rows(subject: Subject) -> None:
    """The event with a sequence stands in row `sequence % capacity`."""
    events, wrong = await _events(subject)
    require_none(wrong)
    if not events:
        raise Skipped("nothing")


async def event_codes(subject: Subject) -> None:
    """Every code is one of the type."""
    events, _ = await _events(subject)
    if not events:
        raise Skipped("nothing")
    wrong = [f"{event.sequence}: {event.code}" for event in events if event.code not in subject.kind.events]
    require(not wrong, several(wrong), several((str(code) for code in sorted(subject.kind.events)), 60))


async def event_time(subject: Subject) -> None:
    """Later events are not earlier, and none is of the future."""
    events, _ = await _events(subject)
    if not events:
        raise Skipped("nothing")
    now = (await subject.look()).long(plc_map.AT_TIME, 4)
    wrong = [
        f"{one.sequence}: {one.time}, {other.sequence}: {other.time}"
        for one, other in pairwise(events)
        if other.time < one.time
    ]
    wrong += [f"{event.sequence}: {event.time}" for event in events if event.time > now]
    require(not wrong, several(wrong), f"{{not_falling}}, ≤ {now} µs")


async def _events(subject: Subject) -> tuple[list[DeviceEvent], list[tuple[str, str]]]:
    """The events that are there and stay there while they are read, and the rows that are not what their place says."""
    before = await subject.again(RING)
    capacity, size = before[1], before[2]
    newest = number(before[plc_map.AT_NEWEST : plc_map.AT_NEWEST + 2])
    first = number(before[plc_map.AT_OLDEST : plc_map.AT_OLDEST + 2])
    rows: dict[int, list[int]] = {}
    each = max(1, MOST_WORDS // size)
    for slot in range(0, capacity, each):
        count = min(each, capacity - slot)
        words = await subject.read(plc_map.EVENT_ROWS + slot * size, count * size)
        rows.update({slot + n: words[n * size : (n + 1) * size] for n in range(count)})
    after = await subject.again(RING)
    still = number(after[plc_map.AT_OLDEST : plc_map.AT_OLDEST + 2])
    events: list[DeviceEvent] = []
    wrong: list[tuple[str, str]] = []
    for sequence in range(max(first, still, 1), newest + 1):
        slot = sequence % capacity
        event = plc_map.event_of(rows[slot])
        if event.sequence == sequence:
            events.append(event)
        else:
            wrong.append((at(plc_map.EVENT_ROWS + slot * size, event.sequence), f"{sequence}"))
    return events, wrong


async def answers(subject: Subject) -> None:
    """Eight places: known states and reasons, every id once, the free places behind those in use."""
    words = await subject.again(ANSWERS)
    wrong: list[tuple[str, str]] = []
    ids: list[int] = []
    free = False
    for place in range(plc_map.ANSWERS_KEPT):
        begin = 1 + place * plc_map.ANSWER_WORDS
        row, where = words[begin : begin + plc_map.ANSWER_WORDS], plc_map.ANSWERS + begin
        if not row[0]:
            free = True
            continue
        if free or row[0] in ids:
            wrong.append((at(where, row[0]), "{once}"))
        if not AnswerState.ACCEPTED <= row[1] <= max(AnswerState):
            wrong.append((at(where + 1, row[1]), "1 … 6"))
        if row[1] == AnswerState.REJECTED and row[2] not in subject.kind.reasons:
            wrong.append((at(where + 2, row[2]), several(map(str, sorted(subject.kind.reasons)), 60)))
        ids.append(row[0])
    require_none(wrong)


async def tables(subject: Subject) -> None:
    """The heads, and that head and rows come in the telegrams that the host reads them in."""
    if not subject.kind.tables:
        raise Skipped("none")
    assert subject.first
    for table in subject.kind.tables.values():
        if subject.first.words[plc_map.AT_MINOR] < table.since:
            continue
        found = await _table(subject, table)
        generation, capacity, count, size = found.head
        require(size == table.row, at(table.address + 3, size), f"{table.row}")
        require(generation % 2 == 0, at(table.address, generation), "{even}")
        require(capacity, at(table.address + 1, capacity), "≥ 1")
        require(count <= capacity, at(table.address + 2, count), f"≤ {capacity}")
        subject.tables[table.key] = found


async def rows(subject: Subject) -> None:
    """Each row has its generation twice, every id stands once, enumerations have one of their values, spare words are 0."""
    if not any(found.rows for found in subject.tables.values()):
        raise Skipped("nothing")
    wrong: list[tuple[str, str]] = []
    for key, found in subject.tables.items():
        table = subject.kind.tables[key]
        ids = [number(row[:2]) for row in found.rows]
        for slot, row in enumerate(found.rows):
            where = table.address + plc_map.TABLE_HEAD + slot * table.row
            if not _row_whole(row):
                ends = f"{at(where + plc_map.ROW_GENERATION, row[2])}, {at(where + table.row - 1, row[-1])}"
                wrong.append((ends, "{same_even}"))
            elif ids[slot] and ids[slot] in ids[:slot]:
                wrong.append((at(where, ids[slot]), "{once}"))
            elif ids[slot]:
                wrong += _strange(subject, table, row, where)
    require_none(wrong)


def _strange(subject: Subject, table: TableMap, row: Sequence[int], where: int) -> list[tuple[str, str]]:
    """What in a row means nothing."""
    wrong: list[tuple[str, str]] = []
    taken = {plc_map.ROW_GENERATION, table.row - 1}
    base = table.address + plc_map.TABLE_HEAD
    for name, register in subject.cells(table):
        begin = register.address - base
        taken |= set(range(begin, begin + register.words))
        point = subject.columns[table.key][name]
        wrong += unknown_value(point, row[begin : begin + register.words], where + begin)
    wrong += [(at(where + n, row[n]), "0") for n in range(table.row) if n not in taken and row[n]]
    return wrong


def _row_whole(row: Sequence[int]) -> bool:
    return row[plc_map.ROW_GENERATION] == row[-1] and row[-1] % 2 == 0


async def _table(subject: Subject, table: TableMap) -> Rows:
    """Head and counted rows, from one state of the table as far as its generation tells."""
    found = Rows([])
    for _ in range(TRIES):
        first = (MOST_WORDS - plc_map.TABLE_HEAD) // table.row
        head = await subject.read(table.address, plc_map.TABLE_HEAD)
        if head[3] != table.row or head[2] > head[1]:
            return Rows(head)
        found = Rows(head)
        slot = 0
        while slot < head[2]:
            count = min(first if slot == 0 else MOST_WORDS // table.row, head[2] - slot)
            found.rows += await _rows(subject, table, slot, count)
            slot += count
        again = await subject.read(table.address, plc_map.TABLE_HEAD)
        if again[0] == head[0]:
            break
    return found


async def _rows(subject: Subject, table: TableMap, slot: int, count: int) -> list[list[int]]:
    """Rows in one telegram, read again while one of them is being changed."""
    skip = plc_map.TABLE_HEAD if slot == 0 else 0
    address = table.address + plc_map.TABLE_HEAD - skip + slot * table.row
    found: list[list[int]] = []
    for _ in range(TRIES):
        words = (await subject.read(address, skip + count * table.row))[skip:]
        found = [words[n * table.row : (n + 1) * table.row] for n in range(count)]
        if all(map(_row_whole, found)):
            break
        await asyncio.sleep(PAUSE)
    return found
