"""A part of a screen that is fetched again names every tag it is made of: of one that it forgets it would show the former value on.

Tried from outside: values that a part does not name are changed under it, all at once, and it must come out as it was, but for what is
drawn live by its own tag.
"""

import re
from collections.abc import Callable, Iterator, Sequence
from html import unescape
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from app.plant.definitions import Equipment
from app.runtime import Runtime
from app.settings import Settings
from app.tags.batch import Batch
from tests import virtual
from tests.conftest import ROOT
from tests.web.people import Staff

PLANTS = ("demo", "feeding", "drive_steps", "belts")
"""Those whose screens have parts."""
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

    def parts(self) -> Iterator[tuple[Equipment, str, set[str]]]:
        """Machine, address and tags of every part of every screen of a machine."""
        assert self.runtime.plant
        seen: set[str] = set()
        for item in self.runtime.plant.equipment.values():
            first = self.client.get(f"/equipment/{item.id}").text
            links = {unescape(one) for one in re.findall(rf'href="(/equipment/{item.id}/[\w/]+)"', first)}
            for page in (first, *(self.client.get(link).text for link in sorted(links))):
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
        async def publish() -> None:
            tags, now = self.runtime.tags, self.runtime.clock.micros()
            handles = [tags.handle(name) for name in values]
            worth = [tags.quality(handle) for handle in handles]
            tags.publish(Batch("probe", 1, now, now, handles, list(values.values()), qualities=worth))

        self.staff.wait(publish)

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


@pytest.mark.parametrize("plant", PLANTS)
def test_a_part_names_every_tag_that_it_is_made_of(tmp_path: Path, plant: str) -> None:
    forgotten: list[Any] = []
    with virtual.house(Settings(data=tmp_path / "data", plant=ROOT / "plants" / plant)) as client:
        client.pass_time(20)
        client.cookies.set("pogon_lang", "en")
        house = House(client)
        for item, url, own in list(house.parts()):
            others = {name: value for name, value in house.values_of(item).items() if name not in own}
            for change in CHANGES:
                if house.moved_by(url, others, change):
                    forgotten.append((url, house.first_of(url, others, change)))
    assert forgotten == []


def test_the_hand_finds_what_a_part_forgets(tmp_path: Path) -> None:
    """Or the test above would be green whatever a part forgets."""
    with virtual.house(Settings(data=tmp_path / "data", plant=ROOT / "plants" / "feeding")) as client:
        client.pass_time(20)
        house = House(client)
        parts = {url: (item, own) for item, url, own in house.parts()}
        assert len(parts) >= 8
        item, own = parts["/equipment/seq1/part/head"]
        named = {name: value for name, value in house.values_of(item).items() if name in own}
        assert any(
            house.moved_by("/equipment/seq1/part/head", {name: value}, CHANGES[0]) for name, value in named.items()
        )
