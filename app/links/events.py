"""The event ring of a Pogon PLC: what happened between two scans, in its order and with the device's own time.

Rows are handed over in order; what nobody took comes again. To the device only those are acknowledged that are stored: until then the ring
is where they are found again after a crash of this program. What the ring overwrote before it was read is counted and told with the next
events, never left out in silence.
"""

import asyncio
import inspect
import logging
from collections.abc import Sequence
from functools import reduce

from app.errors import GATEWAY, DeviceException, LinkError
from app.links.bus_access import BusAccess
from app.links.contract import Block
from app.links.device_clock import DeviceClock
from app.links.host_event import HostEvent
from app.links.ring_head import Head, head_of
from app.links.schedule import Priority
from app.links.station import Station
from app.links.taken_events import TakenEvents
from app.plant.definitions import Equipment, Scan
from app.plant.events import Ring, earlier
from app.registers import plc_map
from app.registers.pdu import MAX_READ, WRITE_MULTIPLE
from app.registers.plc_map import DeviceEvent

log = logging.getLogger(__name__)

AGAIN = 1.0
"""Before events that were not taken are handed over again [s]."""
ABSENT_TRIES = 5
"""How often a row is read that the head counts and that is not there, before it counts as lost."""

NOT_NOW = (6, *GATEWAY)
"""Refusals of an acknowledgement that is told again: the device is busy, or a gateway does not reach it."""


class EventReader:
    """Follows the ring of one unit."""

    def __init__(self, bus: BusAccess, station: Station, clock: DeviceClock) -> None:
        self.position: int | None = None
        """Sequence of the last event that was taken; None until somebody was asked where to begin."""
        self.lost = 0
        """Overwritten before they were read, not told yet."""
        self._bus = bus
        self._station = station
        self._clock = clock
        self._last: DeviceEvent | None = None
        """The event at `position`, to see whether the ring is still the same one."""
        self._suspect = True
        """Whether that is to be looked at."""
        self._ring: Ring | None = None
        self._busy: object = None
        self._head: Head | None = None
        self._delivery: tuple[asyncio.Task[None], Sequence[HostEvent], DeviceEvent, int] | None = None
        self._taken = TakenEvents()
        self._acknowledged = 0
        """The last acknowledgement that the device took, or refused."""
        self._absent = 0
        self._told = False

    @property
    def equipment(self) -> Equipment:
        """The machine that the ring belongs to."""
        return self._station.equipment[0]

    def begin(self) -> None:
        """The unit is there, again: it may be another one, or have been started anew."""
        self._suspect, self._busy, self._acknowledged, self._absent, self._told = True, None, 0, 0, False

    def adopt(self, before: "EventReader") -> None:
        """Go on where another reader of the same ring was."""
        self.position, self.lost, self._last, self._delivery = (
            before.position,
            before.lost,
            before._last,
            before._delivery,
        )
        self._taken, self._ring = before._taken, before._ring

    async def end(self) -> None:
        """Whoever takes events is still given the time to finish with those that he has."""
        if self._delivery is not None:
            await asyncio.wait([self._delivery[0]], timeout=AGAIN)
            self._delivery[0].cancel()

    def restarted(self) -> None:
        """The device was started anew; its ring may be."""
        self._suspect, self._acknowledged = True, 0

    def seen(self, head: Head) -> None:
        """The head was read: fetch and acknowledge what is new."""
        if self._bus.events.take is None or self._busy is not None:
            return
        if not head.capacity or not plc_map.LEAST_EVENT_WORDS <= head.words <= MAX_READ:
            if not self._told:
                self._told = True
                log.error(
                    "event ring not understood link=%s unit=%d capacity=%d words=%d expected=%d to %d words",
                    self._station.link.name,
                    self._station.number,
                    head.capacity,
                    head.words,
                    plc_map.LEAST_EVENT_WORDS,
                    MAX_READ,
                )
            return
        if self._suspect or head.newest != self.position or self._to_acknowledge(head) is not None:
            self._head = head
            self._busy = token = object()
            self._bus.attend(self._station, self._follow(token))

    async def _follow(self, token: object) -> None:
        try:
            await self._finish_delivery()
            while await self._take_some():
                pass
            await self._acknowledge()
        except LinkError as error:  # the next head tries again
            log.debug("events not read link=%s unit=%d: %s", self._station.link.name, self._station.number, error)
        finally:
            if self._busy is token:
                self._busy = None

    async def _take_some(self) -> bool:
        """Read what is new and hand it over; whether the ring has to be looked at once more."""
        head = self._head
        assert head is not None
        if self.position is None:
            self.position = await self._start(head)
        if not self._suspect and head.newest == self.position:
            return False
        if head.newest < self.position:  # is it, or is this head older than what was read since?
            head = head_of(await self._bus.read(self._station, Block(plc_map.EVENTS, plc_map.EVENTS_WORDS))) or head
            self._head = head
        await self._read_clock()
        if head.newest < self.position:
            self._begin_anew(head)
        if head.newest and head.oldest > self.position + 1:
            self._skip(head.oldest - 1)
        found = await self._new_rows(head)
        if found is None:
            self._begin_anew(head)
            return True
        self._suspect = False
        if found:
            await self._deliver(found)
        if self.position >= head.newest:
            self._absent = 0
            return False
        again = head_of(await self._bus.read(self._station, Block(plc_map.EVENTS, plc_map.EVENTS_WORDS, again=True)))
        if again is None:
            return False
        self._head = again
        if again.oldest > self.position + 1 or again.newest < self.position:
            return True  # they were overwritten while they were read
        self._absent += 1
        if self._absent >= ABSENT_TRIES:
            self._absent = 0
            self._skip(self.position + 1)
        return False

    async def _start(self, head: Head) -> int:
        """Sequence of the last event that needs not be taken."""
        if self._clock.boots is None:
            await self._read_clock()
        self._ring = Ring(object(), 0, self._clock.boots or 0, head.newest)
        if self._bus.events.last_seen is not None:
            try:
                known = self._bus.events.last_seen(self.equipment)
                if inspect.isawaitable(known):
                    known = await known
            except Exception:
                log.exception("last event not known equipment=%s", self.equipment.id)
                known = ()
            positions = [position for position in known if position is not None]
            if any(self._ring.replaces(position) for position in positions):
                self._tell(
                    "event ring is another one link=%s unit=%d newest=%d last taken=%s",
                    head.newest,
                    max(position.sequence for position in positions),
                )
                return 0
            if positions and len(positions) == len(known):
                return reduce(earlier, positions).sequence
            if positions:  # one of them has none: he is told all that is there, whatever another host has acknowledged
                return max(0, head.oldest - 1)
        if 0 < head.acknowledged <= head.newest:
            return head.acknowledged
        return max(0, head.oldest - 1)  # nobody ever took one: what is there is the beginning

    def _begin_anew(self, head: Head) -> None:
        """The ring is not the one that was read before."""
        self._tell("event ring begins anew link=%s unit=%d newest=%d last taken=%s", head.newest, self.position)
        assert self._ring is not None
        self._ring = Ring(self._ring.reader, self._ring.number + 1, self._clock.boots or 0, head.newest)
        self.position, self._last = 0, None
        self._taken = TakenEvents()
        self._clock.forget_former()

    async def _new_rows(self, head: Head) -> list[DeviceEvent] | None:
        """The rows behind `position`, up to the first that is not what the head says; None when it is another ring.

        The row of the last event taken is read with them: of the same ring it is the same event.
        """
        assert self.position is not None
        last, found = self._last, list[DeviceEvent]()
        following = self.position + (last is None or head.oldest > self.position)
        while following <= head.newest:
            for event in await self._rows(head, following, head.newest - following + 1):
                if following == self.position and last is not None:
                    same = (event.time, event.code, event.source) == (last.time, last.code, last.source)
                    if event.sequence == following and not same:
                        return None
                elif event.sequence != following:
                    return found
                else:
                    found.append(event)
                following += 1
        return found

    async def _rows(self, head: Head, sequence: int, count: int) -> list[DeviceEvent]:
        """At most `count` rows from `sequence` on, as many as one telegram takes without cutting one."""
        size, slot = head.words, sequence % head.capacity
        device = self._station.device
        limit = min(
            device.max_read, device.group_read.get(Scan.FAST.value, MAX_READ), self._station.learned.limit, MAX_READ
        )
        count = max(1, min(count, limit // size, head.capacity - slot))
        cuts = tuple(range(size, count * size, size))
        words = await self._bus.read(
            self._station, Block(plc_map.EVENT_ROWS + slot * size, count * size, cuts=cuts, again=True)
        )
        return [plc_map.event_of(words[at : at + size]) for at in range(0, count * size, size)]

    async def _read_clock(self) -> None:
        """The device's time and start as they are now: the header may be a second old."""
        first, last = plc_map.AT_BOOTS, plc_map.AT_TIME_QUALITY
        now = asyncio.get_running_loop().time
        began = now()
        words = await self._bus.read(self._station, Block(plc_map.HEADER + first, last - first + 1))
        if self._clock.header(words, first, began, now(), self._bus.clock.micros(), halted=self._station.halted):
            self._suspect = True

    def _skip(self, to: int) -> None:
        """Everything up to `to` is lost."""
        assert self.position is not None
        lost = to - self.position
        self.lost, self.position, self._last = self.lost + lost, to, None
        self._tell("events lost link=%s unit=%d count=%d up to=%d", lost, to)

    async def _deliver(self, found: Sequence[DeviceEvent]) -> None:
        """Hand over until they are taken."""
        seen = self._bus.clock.micros()
        assert self._ring is not None
        events = [
            HostEvent(
                event.sequence,
                self._clock.utc(event.time, instead=seen),
                seen,
                event.code,
                event.source,
                event.value,
                event.snapshot,
                self._clock.boot(event.time),
                self._ring,
                event.request,
            )
            for event in found
        ]
        while True:
            work = self._hand_over(self.equipment, events, self.lost)
            self._delivery = asyncio.get_running_loop().create_task(work), events, found[-1], self.lost
            if await self._finish_delivery():
                return
            await asyncio.sleep(AGAIN)

    async def _hand_over(self, equipment: Equipment, events: Sequence[HostEvent], lost: int) -> None:
        if self._bus.events.take is not None:
            await self._bus.events.take(equipment, events, lost)

    async def _finish_delivery(self) -> bool:
        """Wait for whoever takes the events. A lost connection ends the waiting, not his work; the next reader waits on."""
        if self._delivery is None:
            return True
        task, events, last, lost = self._delivery
        await asyncio.wait([task])
        self._delivery = None
        error = asyncio.CancelledError() if task.cancelled() else task.exception()
        if error is not None:
            log.error("events not taken, handed over again equipment=%s", self.equipment.id, exc_info=error)
            return False
        self.position, self._last = last.sequence, last
        self.lost -= lost
        self._taken.add(events)
        return True

    @property
    def only_here(self) -> int:
        """Events that are stored nowhere and that the ring has overwritten: they are lost when this program is killed now."""
        self._note_stored()
        capacity = self._head.capacity if self._head else 0
        return max(0, len(self._taken) - capacity)

    def _note_stored(self) -> int | None:
        """Sequence of the last event that is stored, as far as this reader handed it over; None when it knows of none."""
        if self._bus.events.stored_up_to is None:
            self._taken.all_stored(self.position)
        elif self._taken:
            self._taken.stored_up_to(self._bus.events.stored_up_to(self.equipment))
        return self._taken.stored

    def _to_acknowledge(self, head: Head) -> int | None:
        """Sequence that the device is to be told; None when it knows it, or is told nothing."""
        stored = self._note_stored()
        if stored is None or not self._station.may_write or stored == self._acknowledged:
            return None
        return stored if head.acknowledged < stored <= head.newest else None

    async def _acknowledge(self) -> None:
        sequence = None if self._head is None else self._to_acknowledge(self._head)
        if sequence is None:
            return
        job = self._bus.job(self._station.number)
        job.address, job.function = plc_map.EVENTS + plc_map.AT_ACKNOWLEDGED, WRITE_MULTIPLE
        job.words = plc_map.long_words(sequence)
        try:
            await self._bus.ask(job, Priority.WRITE)
        except DeviceException as error:
            if error.code in NOT_NOW:
                raise
            self._tell("acknowledgement refused link=%s unit=%d sequence=%d: %s", sequence, error)
        self._acknowledged = sequence

    def _tell(self, text: str, *values: object) -> None:
        log.warning(text, self._station.link.name, self._station.number, *values)
