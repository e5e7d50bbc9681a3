"""Frames for browsers: what changed on a kind of page, encoded once for all who watch it.

A frame is JSON: `{"rev": revision, "n": number, "t": µs UTC, "v": [[handle, value, quality], …]}`, with `"full": true` when it lists every
tag of the page (docs/api.md). A watcher has one slot: while it is full, frames are dropped and the next one it gets is a full one.
"""

import asyncio
import math
from collections.abc import Iterable, Sequence

import orjson

from app.clock import Clock
from app.tags.batch import Batch
from app.tags.database import TagDatabase

HEARTBEAT = 1.0
"""A frame at least this often, also an empty one [s]."""


class Watcher:
    """One browser tab: takes the next frame out of its slot."""

    def __init__(self, page: "Page") -> None:
        self.page = page
        self.dropped = 0
        self._slot: bytes | None = None
        self._behind = True
        self._event = asyncio.Event()
        self._event.set()

    def offer(self, frame: bytes) -> None:
        """Put `frame` into the slot, or note that one was missed."""
        if self._behind or self._slot is not None:
            self.dropped += self._slot is not None
            self._behind = True
            self._slot = None
        else:
            self._slot = frame
        self._event.set()

    def fall_behind(self) -> None:
        """Ask for a full frame: the next one is."""
        self._behind, self._slot = True, None
        self._event.set()

    async def next(self) -> bytes:
        """The next frame to send; waits until there is one."""
        await self._event.wait()
        self._event.clear()
        if self._behind or self._slot is None:
            self._behind, self._slot = False, None
            return self.page.full_frame()
        frame, self._slot = self._slot, None
        return frame


class Page:
    """One kind of page: its tags, its changes since the last frame, its watchers."""

    def __init__(self, kind: str, names: Sequence[str], live: "Live") -> None:
        self.kind = kind
        self.names = tuple(names)
        self.handles: tuple[int, ...] = ()
        self.watchers: set[Watcher] = set()
        self.number = 0
        self.changed: set[int] = set()
        self.last_sent = -math.inf
        self.timer: asyncio.TimerHandle | asyncio.Handle | None = None
        self._live = live

    def full_frame(self) -> bytes:
        """Every tag of the page as it stands, with the number of the last frame."""
        return self._encode(self.handles, full=True)

    def next_frame(self) -> bytes:
        """What changed since the last frame."""
        self.number += 1
        changed, self.changed = sorted(self.changed), set()
        return self._encode(changed, full=False)

    def _encode(self, handles: Iterable[int], *, full: bool) -> bytes:
        tags = self._live.tags
        frame: dict[str, object] = {
            "rev": tags.revision,
            "n": self.number,
            "t": self._live.clock.micros(),
            "v": [(handle, tags.value(handle), tags.quality(handle)) for handle in handles],
        }
        if full:
            frame["full"] = True
        return orjson.dumps(frame)


class Live:
    """Follows the tag database and feeds every watcher of every kind of page."""

    def __init__(self, tags: TagDatabase, clock: Clock, period: float = 0.05) -> None:
        self.tags = tags
        self.clock = clock
        self._period = period
        self._pages: dict[tuple[str, tuple[str, ...]], Page] = {}
        self._interest: dict[int, dict[Page, None]] = {}
        self._unsubscribe = tags.subscribe(self._take)

    @property
    def watchers(self) -> int:
        """How many browser tabs watch."""
        return sum(len(page.watchers) for page in self._pages.values())

    @property
    def pages(self) -> list[Page]:
        """The kinds of page that somebody watches."""
        return list(self._pages.values())

    def join(self, kind: str, names: Sequence[str]) -> Watcher:
        """Watch the tags `names` (unknown ones are left out) as the page `kind`; pages of one kind share their frames."""
        key = (kind, tuple(names))
        page = self._pages.get(key)
        if page is None:
            page = self._pages[key] = Page(kind, names, self)
            self._follow(page)
        watcher = Watcher(page)
        page.watchers.add(watcher)
        return watcher

    def leave(self, watcher: Watcher) -> None:
        """End watching; a page that nobody watches costs nothing."""
        page = watcher.page
        page.watchers.discard(watcher)
        if not page.watchers:
            if page.timer:
                page.timer.cancel()
            if self._pages.pop((page.kind, page.names), None):
                for handle in page.handles:
                    if followed := self._interest.get(handle):
                        followed.pop(page, None)

    def renew(self) -> None:
        """The tag database has a new revision: look all handles up again and send everybody a full frame."""
        self._resolve()
        for page in self._pages.values():
            for watcher in page.watchers:
                watcher.fall_behind()

    async def beat(self) -> None:
        """Send every page a frame at least once a second, for ever."""
        loop = asyncio.get_running_loop()
        while True:
            await asyncio.sleep(HEARTBEAT / 4)
            for page in tuple(self._pages.values()):
                if loop.time() - page.last_sent >= HEARTBEAT * 0.75:
                    self._send(page)

    def close(self) -> None:
        """Stop following the tag database."""
        self._unsubscribe()

    def _resolve(self) -> None:
        self._interest = {}
        for page in self._pages.values():
            page.changed.clear()
            self._follow(page)

    def _follow(self, page: Page) -> None:
        known = self.tags.handles
        page.handles = tuple(known[name] for name in page.names if name in known)
        for handle in page.handles:
            self._interest.setdefault(handle, {})[page] = None

    def _take(self, batch: Batch) -> None:
        interest = self._interest
        if not interest:
            return
        touched: set[Page] = set()
        for handle in batch.handles:
            for page in interest.get(handle, ()):
                page.changed.add(handle)
                touched.add(page)
        if touched:
            loop = asyncio.get_running_loop()
            for page in touched:
                if page.timer is None:
                    wait = page.last_sent + self._period - loop.time()
                    page.timer = (
                        loop.call_later(wait, self._send, page) if wait > 0 else loop.call_soon(self._send, page)
                    )

    def _send(self, page: Page) -> None:
        if page.timer:
            page.timer.cancel()
        page.timer = None
        page.last_sent = asyncio.get_running_loop().time()
        frame = page.next_frame()
        for watcher in page.watchers:
            watcher.offer(frame)
