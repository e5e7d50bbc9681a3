"""The ring keeps the last events, each in the row of its number, over the wrap of the numbers too."""

import pytest

from app.registers import plc_map
from app.sim.plc.ring import EVENT_CAPACITY, EventRing


@pytest.mark.parametrize("begun", [0, 100, 0xFFFFFFFF - 30])
@pytest.mark.parametrize("count", [0, 1, EVENT_CAPACITY - 1, EVENT_CAPACITY, EVENT_CAPACITY + 1, 3 * EVENT_CAPACITY])
def test_every_event_that_is_kept_stands_in_its_row(begun: int, count: int) -> None:
    ring = EventRing()
    ring.newest = begun
    numbers = []
    for number in range(count):
        ring.add(1000 * number, number % 50 + 1, 3, number / 2, [1, 2, 3, 4, 5, 6], number % 7)
        numbers.append(ring.newest)
    assert all(1 <= number <= 0xFFFFFFFF for number in numbers)
    for place, number in list(enumerate(numbers))[-EVENT_CAPACITY // 2 :]:
        row = number % EVENT_CAPACITY * plc_map.EVENT_WORDS
        event = plc_map.event_of(ring.rows[row : row + plc_map.EVENT_WORDS])
        assert (event.sequence, event.time, event.code, event.request) == (
            number,
            1000 * place,
            place % 50 + 1,
            place % 7,
        )
    head = list(ring.head)
    assert head[:2] == [EVENT_CAPACITY, plc_map.EVENT_WORDS]
    assert head[4:6] == list(plc_map.long_words(ring.newest))
    if begun == 0:
        assert head[2:4] == list(plc_map.long_words(max(1, count - EVENT_CAPACITY + 1)))


def test_what_was_never_switched_on_has_no_events() -> None:
    ring = EventRing()
    ring.add(1, 2, 3, 4.0, [], 0)
    ring.acknowledged = 1
    ring.clear()
    assert (ring.newest, ring.acknowledged, any(ring.rows)) == (0, 0, False)
