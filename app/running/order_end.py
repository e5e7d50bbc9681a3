"""How an action of a sequence begins and ends, by what the device says: never by what it was asked.

A reading counts only when it was made after one began to wait for it. What is bad, stale or not a number decides nothing: the step then
stays until its greatest time.
"""

import asyncio
from collections.abc import Iterable, Mapping
from math import inf

from app.commands import interlocks
from app.errors import Refused
from app.plant.actions import BEFORE, Action
from app.plant.definitions import Equipment
from app.plant.expression import Reading, parse
from app.tags.database import TagDatabase
from app.tags.quality import GOOD, NO_DATA, is_good

ENDED = "why.order_ended"
UNKNOWN = "why.bad_value"
LOOK = 0.1
"""Between two looks at what the device says [s]."""
KNOWN = 10.0
"""How long what an action asks before it begins may take to be read [s]."""
UNSEEN: Reading = (None, NO_DATA)


class OrderEnd:
    """The sentences of one order of a run: over points, the values that its step gave, and what points said before it began."""

    def __init__(self, tags: TagDatabase | None, action: Action, values: Mapping[str, float]) -> None:
        self._tags, self._action = tags, action
        self._given: dict[str, Reading] = {one.name: (values.get(one.name), GOOD) for one in action.arguments}
        self._armed = not action.armed

    async def begin(self, item: Equipment) -> None:
        """Before its first command: what it needs, and what its sentences want to know of the time before.

        Raises:
            Refused: something it needs is not so, or not known.
        """
        needs, before = self._action.needs, self._before()
        names = {name for one in needs for name in parse(one.expression).names} | set(before)
        if not names:
            return
        known = await self._read(item, names, within=KNOWN)
        for reason in interlocks.missing(needs, lambda name: seen(self._tags, f"{item.id}.{name}")):
            raise Refused(reason.key, 409, **{**reason.params, "label": reason.label})
        for name in before:
            reading = seen(self._tags, f"{item.id}.{name}")
            if not known or not is_good(reading[1]) or reading[0] is None:
                raise Refused(UNKNOWN, 409, label=item.points[name].label)
            self._given[BEFORE + name] = reading
        self._armed = not self._action.armed

    def done(self, item: Equipment) -> bool:
        """Whether it is over and well, as far as one sees now."""
        return self._armed and self._true(item, self._action.done)

    async def wait(self, item: Equipment) -> None:
        """Wait for its end, by what was read since it was confirmed.

        One that gives a command then must be done by two readings, one after the other: a counter that is put right a moment later
        would have it stop too early.

        Raises:
            Refused: it ended otherwise.
        """
        action = self._action
        if not action.done:
            return
        if not self._armed:
            await self._well(item, action.armed)
            self._armed = True
        while True:
            await self._well(item, action.done)
            if not action.then:
                return
            await self._read(item, _names(action.done))
            if self._true(item, action.done):
                return

    async def _well(self, item: Equipment, wanted: str) -> None:
        if await self.first_true(item, wanted, self._action.failed) != wanted:
            raise Refused(ENDED, 409, machine=item.id)

    async def first_true(self, item: Equipment, *sentences: str, within: float = inf) -> str:
        """Wait until one of `sentences` is true by what was read from now on; which one, empty = none was `within` so many seconds."""
        loop = asyncio.get_running_loop()
        since = loop.time()
        wanted = [text for text in sentences if text]
        names = {f"{item.id}.{name}" for text in wanted for name in self._read_by(_names(text))}
        while (passed := loop.time() - since) <= within:
            if _fresh(self._tags, names, passed):
                for text in wanted:
                    if self._true(item, text):
                        return text
            await asyncio.sleep(LOOK)
        return ""

    async def _read(self, item: Equipment, names: Iterable[str], within: float = inf) -> bool:
        """Wait until all of `names` were read from now on; False = they were not `within` so many seconds."""
        loop = asyncio.get_running_loop()
        since = loop.time()
        wanted = {f"{item.id}.{name}" for name in self._read_by(names)}
        while (passed := loop.time() - since) <= within:
            if _fresh(self._tags, wanted, passed):
                return True
            await asyncio.sleep(LOOK)
        return False

    def _read_by(self, names: Iterable[str]) -> list[str]:
        """Those of `names` that are points of the machine."""
        values = {one.name for one in self._action.arguments}
        return [name for name in names if name not in values and not name.startswith(BEFORE)]

    def _before(self) -> list[str]:
        """Points whose value from before it began its sentences name."""
        texts = (self._action.done, self._action.failed, self._action.stands, self._action.armed)
        names = {name for text in texts if text for name in _names(text)}
        return sorted(name.removeprefix(BEFORE) for name in names if name.startswith(BEFORE))

    def _true(self, item: Equipment, sentence: str) -> bool:
        def look(name: str) -> Reading:
            return self._given.get(name) or seen(self._tags, f"{item.id}.{name}")

        def age(name: str) -> float | None:
            handle = self._tags.handles.get(f"{item.id}.{name}") if self._tags else None
            return self._tags.age(handle) if self._tags and handle is not None else None

        return parse(sentence, machines=True).true(look, age=age) is True


def seen(tags: TagDatabase | None, name: str) -> Reading:
    """What is known of the point `name`, `m1.speed`."""
    handle = tags.handles.get(name) if tags else None
    return (tags.value(handle), tags.quality(handle)) if tags and handle is not None else UNSEEN


def _names(sentence: str) -> frozenset[str]:
    return parse(sentence, machines=True).names


def _fresh(tags: TagDatabase | None, names: Iterable[str], age: float) -> bool:
    return tags is not None and all(name in tags and tags.age(tags.handles[name]) < age for name in names)
