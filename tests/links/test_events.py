"""The event ring: everything in order, with the device's own time, once; what is lost is counted."""

import asyncio
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager

import pytest

from app.links.host_event import HostEvent
from app.links.plc import PlcUnit
from app.links.ring_head import Head
from app.plant.definitions import Equipment
from app.plant.events import RingPosition, begins_again, position_of
from app.registers import plc_map
from app.registers.plc_map import long_words
from app.sim.plc import EVENT_CAPACITY
from tests.links.devices import Line, until
from tests.links.plc_devices import KINDS, FaultyBus, SmallPlc, once, plant, small
from tests.virtual import loop_clock


class Taker:
    """Whoever takes events: remembers them, and can fail."""

    def __init__(self) -> None:
        self.events: list[HostEvent] = []
        self.lost: list[int] = []
        self.calls = 0
        self.failures = 0
        self.delay = 0.0
        self.equipment: set[str] = set()

    async def __call__(self, equipment: Equipment, events: Sequence[HostEvent], lost: int) -> None:
        self.calls += 1
        await asyncio.sleep(self.delay)
        if self.failures:
            self.failures -= 1
            raise OSError("the disk is full")
        self.equipment.add(equipment.id)
        self.events += events
        self.lost.append(lost)

    @property
    def codes(self) -> list[int]:
        return [event.code for event in self.events]

    @property
    def sequences(self) -> list[int]:
        return [event.sequence for event in self.events]


@asynccontextmanager
async def followed(
    device: SmallPlc, taker: Taker, kind: str = "memory", *, last: tuple[RingPosition | None, ...] = ()
) -> AsyncIterator[tuple[Line, FaultyBus]]:
    async with plant(device, kind, start=False) as (line, bus):
        line.link.events.take = taker
        if last:
            line.link.events.last_seen = lambda equipment: last
        task = asyncio.create_task(line.link.run())
        try:
            yield line, bus
        finally:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)


def acknowledged(device: SmallPlc) -> int:
    return device._ring.acknowledged


@pytest.mark.parametrize("kind", KINDS)
async def test_ten_events_of_one_scan_come_in_order_with_the_time_of_the_device(kind: str) -> None:
    device, taker, clock = SmallPlc(), Taker(), loop_clock()
    async with followed(device, taker, kind) as (line, _):
        await until(lambda: line.value("p.state") == 1)
        device.event(1, 5, 2.5, [*long_words(77), 1, 2, 3, 4])
        began = clock.micros()
        first = device.time
        for code in range(2, 11):
            device.event(code)
        await asyncio.sleep(0.05)
        device.event(11)
        second = device.time
        await until(lambda: taker.codes == list(range(1, 12)))
        event = taker.events[0]
        assert (event.sequence, event.source, event.value, event.boot) == (1, 5, 2.5, 1)
        assert event.snapshot == (0, 77, 1, 2, 3, 4)
        assert {event.time for event in taker.events[:10]} == {event.time}
        assert taker.events[10].time - event.time == second - first, "differences are the device's own"
        assert abs(event.time - began) < 100_000 and event.seen >= event.time - 50_000
        assert sum(taker.lost) == 0 and taker.equipment == {"p"}
        await until(lambda: acknowledged(device) == 11)


async def test_a_full_ring_is_read_over_its_seam_in_whole_rows() -> None:
    device, taker = SmallPlc(), Taker()
    async with followed(device, taker) as (line, _):
        await until(lambda: line.value("p.state") == 1)
        for round in range(4):
            for _ in range(EVENT_CAPACITY - 5):
                device.event(1)
            total = (round + 1) * (EVENT_CAPACITY - 5)
            await until(lambda total=total: len(taker.events) == total)
        assert taker.sequences == list(range(1, 4 * (EVENT_CAPACITY - 5) + 1)) and sum(taker.lost) == 0
        rows = [read for read in device.reads if plc_map.EVENT_ROWS <= read[0] < 0x0800]
        assert rows
        for address, count in rows:
            size = plc_map.EVENT_WORDS
            assert (address - plc_map.EVENT_ROWS) % size == 0 and count % size == 0 and count <= 125 // size * size


class OtherRows(SmallPlc):
    """Its rows have another number of words: those of map 1.0, or of one to come."""

    row = 16

    def read(self, function: int, address: int, count: int) -> list[int]:
        words = super().read(function, address, count) if not plc_map.EVENT_ROWS <= address < 0x0800 else []
        if address == plc_map.EVENTS:
            words[2] = self.row
        if words:
            return words
        size, spare = plc_map.EVENT_WORDS, [0xAAAA] * 8
        rows = [(self._ring.rows[at : at + size] + spare)[: self.row] for at in range(0, EVENT_CAPACITY * size, size)]
        flat = [word for row in rows for word in row]
        return flat[address - plc_map.EVENT_ROWS :][:count]


@pytest.mark.sweep(8)
@pytest.mark.parametrize(("row", "caused"), [(16, 0), (17, 300), (18, 300), (25, 300)])
async def test_rows_of_an_older_and_of_a_newer_map_are_read(row: int, caused: int) -> None:
    device, taker = OtherRows(), Taker()
    device.row = row
    async with followed(device, taker) as (line, _):
        await until(lambda: line.value("p.state") == 1)
        for code in range(1, 21):
            device._ring.add(device.time, code, code + 1, code / 2, [1, 2, 3, 4, 5, 6], 300)
        await until(lambda: len(taker.events) == 20)
        found = [(one.code, one.source, one.value, one.snapshot, one.request) for one in taker.events]
        assert found == [(code, code + 1, code / 2, (1, 2, 3, 4, 5, 6), caused) for code in range(1, 21)]


@pytest.mark.parametrize("row", [0, 10, 15, 126])
async def test_rows_that_no_map_has_are_told_and_not_taken(row: int, caplog: pytest.LogCaptureFixture) -> None:
    device, taker = OtherRows(), Taker()
    device.row = row
    async with followed(device, taker) as (line, _):
        await until(lambda: line.value("p.state") == 1)
        device.event(1)
        await asyncio.sleep(1.0)
    assert taker.events == []
    assert caplog.text.count(f"words={row} expected=16 to 125 words") == 1


async def test_what_the_ring_overwrote_is_counted_and_told() -> None:
    device, taker = SmallPlc(), Taker()
    async with followed(device, taker) as (line, bus):
        await until(lambda: line.value("p.state") == 1)
        device.event(1)
        await until(lambda: taker.codes == [1])
        bus.fault = lambda pdu: "request"
        await asyncio.sleep(0.1)
        for _ in range(EVENT_CAPACITY + 20):
            device.event(2)
        bus.fault = lambda pdu: ""
        await until(lambda: len(taker.events) == EVENT_CAPACITY + 1)
        assert sum(taker.lost) == 20
        assert taker.sequences == [1, *range(22, EVENT_CAPACITY + 22)]


async def test_events_that_nobody_took_come_again_and_are_not_acknowledged(caplog: pytest.LogCaptureFixture) -> None:
    device, taker = SmallPlc(), Taker()
    async with followed(device, taker) as (line, _):
        await until(lambda: line.value("p.state") == 1)
        taker.failures = 1
        device.event(1)
        await until(lambda: taker.calls == 1)
        await asyncio.sleep(0.3)
        assert not device.acknowledgements
        device.event(2)
        await until(lambda: taker.codes == [1, 2])
        await until(lambda: acknowledged(device) == 2)
        assert any("events not taken" in message for message in caplog.messages)


async def test_an_acknowledgement_that_met_a_busy_device_is_told_again_without_another_event() -> None:
    """It waited for the next event: until then the device counted what was long stored as not fetched."""
    device, taker = SmallPlc(), Taker()
    async with followed(device, taker) as (line, bus):
        await until(lambda: line.value("p.state") == 1)
        bus.fault = once("busy", lambda pdu: pdu[0] == 16, times=2)
        device.event(1)
        await until(lambda: acknowledged(device) == 1, 5.0)
        assert bus.spoiled == 2


async def test_without_a_taker_nothing_is_read_and_nothing_acknowledged() -> None:
    device = SmallPlc()
    async with plant(device) as (line, _):
        await until(lambda: line.value("p.state") == 1)
        device.event(1)
        await asyncio.sleep(0.2)
        assert not [read for read in device.reads if read[0] >= plc_map.EVENT_ROWS and read[0] < 0x0800]
        assert not device.acknowledgements


async def test_it_begins_behind_what_the_device_was_told() -> None:
    device, taker = SmallPlc(), Taker()
    for code in range(1, 6):
        device.event(code)
    device._ring.acknowledged = 3
    async with followed(device, taker):
        await until(lambda: taker.codes == [4, 5])
        await until(lambda: acknowledged(device) == 5)


async def test_it_begins_behind_what_the_owner_has_and_that_counts_more() -> None:
    device, taker = SmallPlc(), Taker()
    for code in range(1, 6):
        device.event(code)
    device._ring.acknowledged = 4
    async with followed(device, taker, last=(RingPosition(1, 2, 0), RingPosition(1, 4, 0))):
        await until(lambda: taker.codes == [3, 4, 5])
        assert sum(taker.lost) == 0


@pytest.mark.parametrize(
    ("marks", "told", "again"),
    [
        ([RingPosition(1, 5, 0), RingPosition(1, 5, 0)], [], False),
        ([RingPosition(1, 2, 0), RingPosition(1, 5, 0)], [3, 4, 5], False),
        ([RingPosition(1, 5, 10**16), RingPosition(1, 3, 0)], [4, 5], False),
        ([RingPosition(1, 60, 0), RingPosition(1, 3, 0)], [1, 2, 3, 4, 5], True),
        ([RingPosition(1, 60, 0), RingPosition(1, 61, 0)], [1, 2, 3, 4, 5], True),
        ([RingPosition(2, 3, 0), RingPosition(2, 3, 0)], [1, 2, 3, 4, 5], True),
    ],
)
async def test_a_ring_is_another_one_when_its_numbers_are_behind_what_is_known(
    marks: list[RingPosition], told: list[int], again: bool
) -> None:
    device, taker = SmallPlc(), Taker()
    for code in range(1, 6):
        device.event(code)
    async with followed(device, taker, last=tuple(marks)) as (line, _):
        await until(lambda: line.value("p.state") == 1)
        await until(lambda: taker.codes == told)
        device.event(6)
        await until(lambda: taker.codes == [*told, 6])
        assert any(begins_again(taker.events[0], mark) for mark in marks) is again
        assert sum(taker.lost) == 0


async def test_a_ring_that_nobody_ever_read_has_lost_nothing() -> None:
    device, taker = SmallPlc(), Taker()
    for _ in range(200):
        device.event(1)
    async with followed(device, taker):
        await until(lambda: len(taker.events) == EVENT_CAPACITY)
        assert taker.events[0].sequence == 200 - EVENT_CAPACITY + 1 and sum(taker.lost) == 0


@pytest.mark.parametrize("kind", KINDS)
async def test_a_lost_connection_loses_and_doubles_nothing(kind: str) -> None:
    device, taker = SmallPlc(), Taker()
    async with followed(device, taker, kind) as (line, bus):
        await until(lambda: line.value("p.state") == 1)
        for number in range(1, 31):
            device.event(number)
            if number % 10 == 5:
                bus.fault = lambda pdu: "answer"
            if number % 10 == 9:
                bus.fault = lambda pdu: ""
            await asyncio.sleep(0.02)
        await until(lambda: len(taker.events) == 30)
        assert taker.codes == list(range(1, 31)) and sum(taker.lost) == 0


async def test_a_connection_lost_while_events_are_taken_does_not_hand_them_over_twice() -> None:
    device, taker = SmallPlc(), Taker()
    async with followed(device, taker, "tcp") as (line, bus):
        await until(lambda: line.value("p.state") == 1)
        taker.delay = 1.5
        device.event(1)
        await until(lambda: taker.calls == 1)
        bus.fault = lambda pdu: "request"
        await asyncio.sleep(0.6)
        bus.fault = lambda pdu: ""
        device.event(2)
        await until(lambda: taker.codes == [1, 2])
        assert taker.calls == 2


async def test_a_restart_goes_on_in_the_ring_and_tells_the_start_of_each_event() -> None:
    device, taker = SmallPlc(), Taker()
    async with followed(device, taker) as (line, _):
        await until(lambda: line.value("p.state") == 1)
        device.event(1)
        await asyncio.sleep(0.25)
        device.power_cycle()
        await asyncio.sleep(0.02)
        device.event(2)
        await until(lambda: taker.codes == [1, 2])
        assert [event.boot for event in taker.events] == [1, 2]
        await until(lambda: acknowledged(device) == 2)


@pytest.mark.parametrize("more", [1, 30])
async def test_a_ring_that_begins_anew_is_read_from_its_beginning(more: int) -> None:
    device, taker = SmallPlc(), Taker()
    async with followed(device, taker) as (line, _):
        await until(lambda: line.value("p.state") == 1)
        for code in range(1, 11):
            device.event(code)
        await until(lambda: len(taker.events) == 10)
        await until(lambda: acknowledged(device) == 10)
        device._forget_all()
        device._start_up()
        for number in range(more):
            device.event(100 + number)
        await until(lambda: len(taker.events) == 10 + more)
        assert taker.codes[10:] == [100 + number for number in range(more)]
        assert sum(taker.lost) == 0


async def test_a_ring_that_begins_anew_is_dated_by_its_own_start_also_when_its_time_is_that_of_the_former_end() -> None:
    device, taker, clock = SmallPlc(), Taker(), loop_clock()
    async with followed(device, taker) as (line, _):
        await until(lambda: line.value("p.state") == 1)
        device.event(1)
        await until(lambda: taker.codes == [1])
        await asyncio.sleep(3)
        device._forget_all()
        device._start_up()
        told: list[int] = []
        for _ in range(450):
            device.event(100)
            told.append(clock.micros())
            await asyncio.sleep(0.01)
        await until(lambda: len(taker.events) == 1 + len(told))
        apart = [abs(event.time - time) for event, time in zip(taker.events[1:], told, strict=True)]
        assert max(apart) < 100_000
        assert sum(taker.lost) == 0


async def test_a_row_that_the_head_counts_and_that_is_not_there_yet_is_waited_for() -> None:
    class Slow(SmallPlc):
        behind = 0

        def read(self, function: int, address: int, count: int) -> list[int]:
            words = super().read(function, address, count)
            if plc_map.EVENT_ROWS <= address < 0x0800 and self.behind:
                self.behind -= 1
                words[-16:] = [0] * 16
            return words

    device, taker = Slow(), Taker()
    async with followed(device, taker) as (line, _):
        await until(lambda: line.value("p.state") == 1)
        device.behind = 2
        device.event(1)
        device.event(2)
        await until(lambda: taker.codes == [1, 2])
        device.behind = 1000
        device.event(3)
        await asyncio.sleep(0.6)
        device.behind = 0
        device.event(4)
        await until(lambda: taker.codes == [1, 2, 4])
        assert sum(taker.lost) == 1, "it never was there, and that is told"


@pytest.mark.parametrize(
    ("last", "first"),
    [
        ((), 9),
        ((None, None), 9),
        ((RingPosition(1, 5, 0), None), 1),
        ((None, RingPosition(1, 5, 0)), 1),
        ((RingPosition(1, 5, 0), RingPosition(1, 4, 0)), 5),
        ((RingPosition(1, 5, 0), RingPosition(1, 10, 0)), 6),
    ],
)
async def test_what_another_host_has_acknowledged_is_read_by_whoever_has_not_seen_it(
    last: tuple[RingPosition | None, ...], first: int
) -> None:
    """A server that was killed between the two transactions knows a mark of one of them only."""
    device, taker = SmallPlc(), Taker()
    for code in range(1, 13):
        device.event(code)
    device._ring.acknowledged = 8
    async with followed(device, taker, last=last):
        await until(lambda: taker.codes == list(range(first, 13)))
        assert sum(taker.lost) == 0


async def test_a_change_of_the_plant_keeps_the_place_in_the_ring() -> None:
    device, taker = SmallPlc(), Taker()
    async with followed(device, taker) as (line, _):
        await until(lambda: line.value("p.state") == 1)
        device.event(1)
        await until(lambda: taker.codes == [1])
        line.link.renew([small()])
        device.event(2)
        await until(lambda: taker.codes == [1, 2])
        line.link.events.last_seen = lambda equipment: [RingPosition(1, 0, 0)]  # would begin anew
        line.link.renew([small(slots=10)])
        device.event(3)
        await until(lambda: taker.codes == [1, 2, 3])
        assert sum(taker.lost) == 0


async def test_a_head_that_comes_late_on_another_connection_is_not_another_ring() -> None:
    device, taker = SmallPlc(), Taker()
    async with followed(device, taker) as (line, _):
        await until(lambda: line.value("p.state") == 1)
        for code in range(1, 6):
            device.event(code)
        await until(lambda: len(taker.events) == 5)
        unit = line.link.stations[1].service(PlcUnit)
        assert unit is not None
        unit.events.seen(Head(EVENT_CAPACITY, 16, 1, 3, 0))
        await asyncio.sleep(0.2)
        device.event(6)
        await until(lambda: taker.codes == [1, 2, 3, 4, 5, 6])


async def test_only_what_is_stored_is_acknowledged_and_what_is_left_of_it_is_counted() -> None:
    device, taker = SmallPlc(), Taker()
    stored: dict[str, RingPosition | None] = {"p": None}
    async with followed(device, taker) as (line, _):
        line.link.events.stored_up_to = lambda equipment: stored[equipment.id]
        await until(lambda: line.value("p.state") == 1)
        for code in range(1, 6):
            device.event(code)
        await until(lambda: taker.codes == [1, 2, 3, 4, 5])
        await asyncio.sleep(0.3)
        assert acknowledged(device) == 0 and line.link.only_here("p") == 0
        stored["p"] = position_of(taker.events[2])
        await until(lambda: acknowledged(device) == 3)
        for code in range(6, EVENT_CAPACITY + 20):
            device.event(code)
            if code % 20 == 0:
                await until(lambda code=code: taker.codes[-1] == code)
        total = EVENT_CAPACITY + 19
        await until(lambda: len(taker.events) == total)
        assert taker.codes == list(range(1, total + 1)), "they are handed over all the same"
        assert acknowledged(device) == 3 and line.link.only_here("p") == total - 3 - EVENT_CAPACITY
        stored["p"] = position_of(taker.events[-1])
        await until(lambda: acknowledged(device) == total)
        assert line.link.only_here("p") == 0 and sum(taker.lost) == 0


async def test_a_mark_of_the_ring_before_acknowledges_nothing_of_the_next_one() -> None:
    device, taker = SmallPlc(), Taker()
    stored: dict[str, RingPosition | None] = {"p": None}
    async with followed(device, taker) as (line, _):
        line.link.events.stored_up_to = lambda equipment: stored[equipment.id]
        await until(lambda: line.value("p.state") == 1)
        for code in range(1, 11):
            device.event(code)
        await until(lambda: len(taker.events) == 10)
        stored["p"] = position_of(taker.events[-1])
        await until(lambda: acknowledged(device) == 10)
        await asyncio.sleep(1.2)
        device._forget_all()
        device._start_up()
        device.event(100)
        await until(lambda: taker.codes[10:] == [100])
        await asyncio.sleep(0.3)
        assert acknowledged(device) == 0
        stored["p"] = position_of(taker.events[-1])
        await until(lambda: acknowledged(device) == 1)


# the clock
