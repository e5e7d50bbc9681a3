"""The hand of tests that changes what machines say, and what it looks at: whether something that is drawn follows."""

import re
from collections.abc import Callable, Iterator, Sequence
from html import unescape

from fastapi.testclient import TestClient

from app.links.scan_block import beyond, good_range
from app.plant.definitions import Equipment
from app.runtime import Runtime
from app.tags.batch import Batch
from tests.web.people import Staff

CHANGES: Sequence[Callable[[float], float]] = (
    lambda value: {0: 1, 1: 0}.get(value, value + 1),
    lambda value: value + 100,
)
LIVE = re.compile(r'<[^>]*\bdata-tag="[^"]*"[^>]*>(?:<b>)?[^<]*')
PASSING = re.compile(r'<time.*?</time>|data-(?:revision|mark|nonce|signal)="[^"]*"|\d\d:\d\d:\d\d', re.S)
PART = re.compile(r'<[^>]*\bhx-get="([^"]+)"[^>]*\bdata-renewed="part"[^>]*\bdata-tags="([^"]*)"[^>]*>', re.S)


class House:
    """A plant that has run for a while, somebody who looks at it, and the hand that changes what it says."""

    def __init__(self, client: TestClient) -> None:
        self.client = client
        self.staff = Staff(client)
        self.staff.enter("eva", "engineer", "operator", "viewer")
        self.runtime: Runtime = client.app.state.runtime  # type: ignore[attr-defined]
        self._was: dict[str, int] = {}

    def pages(self, item: Equipment) -> list[str]:
        """Addresses of the screens of a machine."""
        first = self.client.get(f"/equipment/{item.id}").text
        links = {unescape(one) for one in re.findall(rf'href="(/equipment/{item.id}/[\w/]+)"', first)}
        return [f"/equipment/{item.id}", *sorted(links)]

    def parts(self) -> Iterator[tuple[Equipment, str, set[str]]]:
        """Machine, address and tags of every part of every screen of a machine."""
        assert self.runtime.plant
        seen: set[str] = set()
        for item in self.runtime.plant.equipment.values():
            for page in (self.client.get(url).text for url in self.pages(item)):
                for address, tags in PART.findall(page):
                    url = unescape(address)
                    if url.startswith(f"/equipment/{item.id}/") and url not in seen:
                        seen.add(url)
                        yield item, url, set(unescape(tags).split())

    def drawn(self, url: str) -> str:
        answer = self.client.get(url, headers={"hx-request": "true"})
        assert answer.status_code == 200, (url, answer.text)
        return PASSING.sub("", LIVE.sub("", answer.text))

    def values_of(self, item: Equipment) -> dict[str, float]:
        """What the machine, and the one that it drives, say in numbers, by tag."""
        assert self.runtime.plant
        tags, found = self.runtime.tags, {}
        for one in (item, self.runtime.plant.equipment.get(item.machine)):
            for point in one.points.values() if one else ():
                value = tags.value(tags.handle(point.name)) if point.name in tags else None
                if isinstance(value, int | float):
                    found[point.name] = value
        return found

    def put(self, values: dict[str, float]) -> None:
        """Machines say `values`; what no device can mean is as good as a link would take it for."""

        async def publish() -> None:
            tags, now = self.runtime.tags, self.runtime.clock.micros()
            handles = [tags.handle(name) for name in values]
            worth = [self._worth(name, value) for name, value in values.items()]
            tags.publish(Batch("probe", 1, now, now, handles, list(values.values()), qualities=worth))

        self.staff.wait(publish)

    def _worth(self, name: str, value: float) -> int:
        tags, point = self.runtime.tags, self.runtime.points[name]
        was = self._was.setdefault(name, tags.quality(tags.handle(name)))
        low, high = good_range(point)
        return was if low <= value <= high or point.register is None else beyond(point, value) | was & 0xF00

    def moved_by(self, url: str, values: dict[str, float], change: Callable[[float], float]) -> bool:
        """Whether the part is another one when these values are changed; they are as they were afterwards."""
        self.put(values)
        before = self.drawn(url)
        self.put({name: change(value) for name, value in values.items()})
        after = self.drawn(url)
        self.put(values)
        return after != before

    def first_of(self, url: str, values: dict[str, float], change: Callable[[float], float]) -> list[str]:
        """The fewest of these values, found by halves, that move the part."""
        names = list(values)
        while len(names) > 1:
            half = next(
                (
                    part
                    for part in (names[: len(names) // 2], names[len(names) // 2 :])
                    if self.moved_by(url, {name: values[name] for name in part}, change)
                ),
                None,
            )
            if half is None:
                break
            names = half
        return names
