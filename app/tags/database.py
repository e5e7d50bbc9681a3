"""The tag database: the last value of every point, with its quality and its age."""

import logging
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import inf

from app.clock import Clock
from app.tags.batch import Batch, Value
from app.tags.quality import BAD, GOOD, NO_DATA, STALE

log = logging.getLogger(__name__)

Subscriber = Callable[[Batch], None]

STOOD_STILL = 2.0
"""A program that neither heard nor looked for so long was not there: what it knew holds no longer than this [s]."""


@dataclass(frozen=True, slots=True)
class Tag:
    """What the tag database must know of a point."""

    name: str
    """`equipment.point`."""
    id: str
    """Lasting identity: survives a rename."""
    source: str
    """The only one that may publish it."""
    stale_after: float = 0.0
    """Age from which the value counts as stale [s]; 0 = never."""


class TagTable:
    """A set of tags with what is looked up in it, made before it is taken: with some ten thousand this takes a while."""

    def __init__(self, tags: Iterable[Tag]) -> None:
        """
        Raises:
            ValueError: two tags have one name.
        """
        self.tags = list(tags)
        self.handles = {tag.name: index for index, tag in enumerate(self.tags)}
        """Handle of every tag by name."""
        self.places = [(tag.id, tag.source) for tag in self.tags]
        """What a value belongs to, by handle."""
        self.by_place = {place: handle for handle, place in enumerate(self.places)}
        if len(self.handles) != len(self.tags):
            raise ValueError(f"tag names must be unique: {len(self.tags) - len(self.handles)} are not")
        self._former: tuple[TagTable, list[int | None]] | None = None

    def look_up(self, former: "TagTable") -> None:
        """Find every tag in the table `former`, for `handles_in`."""
        self._former = former, [*map(former.by_place.get, self.places)]

    def handles_in(self, former: "TagTable") -> list[int | None]:
        """Handle of every tag in the table `former`, by handle; None = it was not there. What was looked up is forgotten."""
        known, self._former = self._former, None
        return known[1] if known is not None and known[0] is former else [*map(former.by_place.get, self.places)]


@dataclass(frozen=True, slots=True)
class Sample:
    """One value as it stands."""

    value: Value
    quality: int
    time: int
    """When it was true [µs UTC]."""
    seen: int
    """When its source last made sure of it [µs UTC]."""


@dataclass(frozen=True, slots=True)
class Standstill:
    """A time in which this program did not run (stopped, suspended, held up) or that its wall clock left out: nobody saw anything."""

    begin: int
    """Until then the last values hold [µs UTC]."""
    end: int
    """When it was noticed [µs UTC]; not before `begin`."""
    seconds: float
    """What delays and leases must not count [s, monotonic]; 0 when only the wall clock was set."""


class TagDatabase:
    """Values by handle; a handle is an index, valid for one revision of the plant.

    A value is stale from `seen + stale_after` on, whenever that is noticed: by the sweep, or by the first batch behind it. Once it is swept
    it also knows when the program itself stood still (`on_standstill`).
    """

    def __init__(self, clock: Clock) -> None:
        self.revision = 0
        self._clock = clock
        self._table = TagTable(())
        self._values: list[Value] = []
        self._qualities: list[int] = []
        self._times: list[int] = []
        self._blocks: list[tuple[str, int] | None] = []
        self._seen: dict[tuple[str, int], int] = {}
        self._seen_monotonic: dict[tuple[str, int], float] = {}
        self._members: dict[tuple[str, int], set[int]] = {}
        self._stale: dict[tuple[str, int], set[int]] = {}
        """Handles that are overdue, by block."""
        self._limits: dict[tuple[str, int], float] = {}
        """Least age from which anything of a block is stale [s], as far as known; infinite = nothing ever is."""
        self._subscribers: list[Subscriber] = []
        self._on_standstill: list[Callable[[Standstill], None]] = []
        self.standstills = 0
        """How many there were: what was asked before one and answered after it is of no time that anybody could name."""
        self._active = 0.0
        """When it last heard or looked [s, monotonic]."""
        self._looked: tuple[float, int] | None = None
        """Both clocks at the last look [s, µs UTC]; None before the first."""
        self._wall_limit = 0
        """A batch that was seen later than this shows that the wall clock jumped [µs UTC]; 0 = not known."""
        self._dark = 0
        """End of the last standstill [µs UTC]."""

    def configure(self, tags: Iterable[Tag]) -> None:
        """As `take`, of tags that nobody has looked at yet.

        Raises:
            ValueError: two tags have one name.
        """
        self.take(TagTable(tags))

    def take(self, table: TagTable) -> None:
        """Take a new set of tags; values of tags whose id and source stay are kept."""
        old = table.handles_in(self._table)
        self._values = [None if o is None else self._values[o] for o in old]
        self._qualities = [NO_DATA if o is None else self._qualities[o] for o in old]
        self._times = [0 if o is None else self._times[o] for o in old]
        self._blocks = [None if o is None else self._blocks[o] for o in old]
        members: dict[tuple[str, int], set[int]] = defaultdict(set)
        for handle, block in enumerate(self._blocks):
            if block is not None:
                members[block].add(handle)
        self._members = dict(members)
        self._stale, self._limits = {}, {}
        self._table = table
        self.revision += 1

    @property
    def table(self) -> TagTable:
        """The tags of this revision."""
        return self._table

    @property
    def tags(self) -> Sequence[Tag]:
        """All tags; their handles are their places."""
        return self._table.tags

    def __len__(self) -> int:
        return len(self._table.tags)

    def __contains__(self, name: object) -> bool:
        return name in self._table.handles

    @property
    def handles(self) -> Mapping[str, int]:
        """Handle of every tag by name."""
        return self._table.handles

    def handle(self, name: str) -> int:
        """Handle of the tag `name`.

        Raises:
            KeyError: there is no such tag.
        """
        return self._table.handles[name]

    def subscribe(self, subscriber: Subscriber) -> Callable[[], None]:
        """Call `subscriber` with every batch from now on; the returned function ends it."""
        self._subscribers.append(subscriber)
        return lambda: self._subscribers.remove(subscriber)

    def publish(self, batch: Batch) -> None:
        """Take a batch and hand it on. A subscriber that fails is logged and does not keep the others from it."""
        block = (batch.source, batch.block)
        now = self._clock.monotonic()
        if self._looked is not None:
            if now - self._active > STOOD_STILL or batch.seen > self._wall_limit:
                self.wake()
            self._active = now
        if now - self._seen_monotonic.get(block, now) > self._limits.get(block, inf):
            self._mark_overdue(now, (block,))
        self._seen[block] = batch.seen
        self._seen_monotonic[block] = now
        values, qualities, times, blocks = self._values, self._qualities, self._times, self._blocks
        if batch.handles:
            members = self._members.setdefault(block, set())
            count = len(members)
            members.update(batch.handles)
            if len(members) != count:
                self._limits.pop(block, None)
            time = batch.time
            if batch.qualities is None:
                quality = batch.quality
                for handle, value in zip(batch.handles, batch.values, strict=True):
                    values[handle], qualities[handle], times[handle] = value, quality, time
                    blocks[handle] = block
            else:
                for handle, value, quality in zip(batch.handles, batch.values, batch.qualities, strict=True):
                    values[handle], qualities[handle], times[handle] = value, quality, time
                    blocks[handle] = block
        self._hand_on(batch)
        if block in self._stale:
            self._revive(block, batch)

    def read(self, handle: int) -> Sample:
        """The tag as it stands."""
        block = self._blocks[handle]
        seen = self._seen.get(block, 0) if block is not None else 0
        return Sample(self._values[handle], self._qualities[handle], self._times[handle], seen)

    def sample(self, name: str) -> Sample:
        """The tag `name` as it stands.

        Raises:
            KeyError: there is no such tag.
        """
        return self.read(self._table.handles[name])

    def value(self, handle: int) -> Value:
        """The value alone."""
        return self._values[handle]

    def quality(self, handle: int) -> int:
        """The quality alone."""
        return self._qualities[handle]

    def age(self, handle: int) -> float:
        """Seconds since its source last made sure of it; infinite when never."""
        block = self._blocks[handle]
        seen = self._seen_monotonic.get(block) if block is not None else None
        return inf if seen is None else self._clock.monotonic() - seen

    def on_standstill(self, tell: Callable[[Standstill], None]) -> None:
        """Call `tell` when this program stood still, before anything else is handed on."""
        self._on_standstill.append(tell)

    def wake(self) -> None:
        """Notice a standstill. For whoever acts on time alone, before it does; the sweep and the first batch notice it as well."""
        if self._looked is not None:
            self._look(*self._looked)

    def _look(self, looked: float, looked_wall: int) -> None:
        now, wall, active = self._clock.monotonic(), self._clock.micros(), self._active
        self._looked, self._active = (now, wall), now
        self._wall_limit = wall + round(2 * STOOD_STILL * 1e6)
        lost = now - active
        jumped = (wall - looked_wall) / 1e6 - (now - looked)
        if max(lost, jumped) <= STOOD_STILL:
            return
        begin = min(wall, looked_wall + round((active - looked + STOOD_STILL) * 1e6))
        self.standstills += 1
        still = Standstill(begin, wall, lost if lost > STOOD_STILL else 0.0)
        log.warning("stood still seconds=%.1f clock_jump=%.1f", lost, jumped if jumped > STOOD_STILL else 0.0)
        self._mark_overdue(now, list(self._members), until=begin)
        for tell in self._on_standstill:
            try:
                tell(still)
            except Exception:
                log.exception("told of a standstill and failed")
        self._dark = wall

    def sweep(self) -> None:
        """Mark overdue values as stale; the value is kept, its quality becomes uncertain. Called a few times a second."""
        now = self._clock.monotonic()
        if self._looked is None:
            self._looked, self._active = (now, self._clock.micros()), now
        self.wake()
        self._mark_overdue(now, self._members)

    def _mark_overdue(self, now: float, blocks: Iterable[tuple[str, int]], until: int | None = None) -> None:
        """Values of `blocks` that nobody has made sure of for too long, as of when they became so; later than `until` stays open."""
        overdue: dict[tuple[int, tuple[str, int]], list[int]] = {}
        wall = self._clock.micros()
        for block in blocks:
            members = self._members.get(block, ())
            age = now - self._seen_monotonic.get(block, now)
            if age <= self._limit(block, members):
                continue
            known, seen = self._stale.get(block, ()), self._seen.get(block, 0)
            for handle in members:
                if self._blocks[handle] != block:  # another plan of its link reads it in another block now
                    continue
                limit = self.tags[handle].stale_after
                if limit and age > limit and self._qualities[handle] & 3 == GOOD and handle not in known:
                    at = min(wall, max(seen + round(limit * 1e6), self._dark))
                    if until is None or at <= until:
                        overdue.setdefault((at, block), []).append(handle)
        for (at, block), handles in sorted(overdue.items()):
            self._stale.setdefault(block, set()).update(handles)
            for handle in handles:
                self._qualities[handle] = self._qualities[handle] & 0xF00 | STALE
            self._hand_on(self._as_it_stands(block, handles, at))

    def _limit(self, block: tuple[str, int], members: Iterable[int]) -> float:
        limit = self._limits.get(block)
        if limit is None:
            limits = [self.tags[handle].stale_after for handle in members]
            limit = self._limits[block] = min((one for one in limits if one), default=inf)
        return limit

    def _revive(self, block: tuple[str, int], batch: Batch) -> None:
        """A block that was overdue is seen again: what the batch did not list is good again."""
        listed = set(batch.handles)
        back = [handle for handle in self._stale.pop(block) if self._blocks[handle] == block]
        silent = [handle for handle in back if handle not in listed]
        if silent and batch.quality & 3 != BAD:
            for handle in silent:
                self._qualities[handle] = self._qualities[handle] & 0xF00
            self._hand_on(self._as_it_stands(block, silent, self._clock.micros()))

    def _as_it_stands(self, block: tuple[str, int], handles: list[int], time: int) -> Batch:
        return Batch(
            source=block[0],
            block=block[1],
            time=time,
            seen=self._seen.get(block, 0),
            handles=handles,
            values=[self._values[h] for h in handles],
            qualities=[self._qualities[h] for h in handles],
        )

    def _hand_on(self, batch: Batch) -> None:
        for subscriber in tuple(self._subscribers):
            try:
                subscriber(batch)
            except Exception:
                log.exception("subscriber failed source=%s block=%s", batch.source, batch.block)
