"""Registers may hold anything: a machine that says rubbish is drawn as it says, and every page, part and answer of the house goes on.

One such value ended the overview for all machines, another took all the memory there was.
"""

import random
import re
from collections.abc import Iterator
from html import unescape
from pathlib import Path

import pytest

from app.plant.definitions import Point, Type
from app.registers.codec import raw_limits
from app.settings import Settings
from app.tags.quality import BAD, QualityReason, is_good, level, reason
from tests import virtual
from tests.conftest import ROOT
from tests.web.hand import House

PLANTS = ("demo", "feeding", "drive_steps", "belts", "sinamics", "epos")
REALS = (0.0, -1.0, 1e9, 3.4e38, -3.4e38, 1e-30)
SEEDS = 4


def rubbish(point: Point, dice: random.Random) -> float | None:
    """Something that the register of `point` can hold; None where it has none."""
    register = point.register
    if register is None or register.type is Type.STRING:
        return None
    if register.type in (Type.F32, Type.F64):
        return dice.choice(REALS)
    low, high = raw_limits(register)
    raw = int(dice.choice((low, high, 0, 1, 101, dice.randint(int(low), int(high)))))
    return raw * register.scale + register.offset if register.scale != 1 or register.offset else raw


def addresses(house: House) -> Iterator[str]:
    """Every page that shows machines, the parts of it, and what programs read."""
    plant = house.runtime.plant
    assert plant
    yield from ("/", "/alarms", "/events", "/forces", "/communication", "/lessons", "/api/v1/tags", "/api/v1/alarms")
    yield from (f"/area/{area}" for area in plant.areas)
    for id in plant.equipment:
        first = f"/equipment/{id}"
        links = set(re.findall(rf'href="({first}/[\w/]+)"', house.client.get(first).text))
        for page in (first, *sorted(unescape(link) for link in links)):
            yield page
            found = re.findall(r'(?:hx-get|data-row)="(/[^"]+)"', house.client.get(page).text)
            yield from (unescape(one) for one in found)
        yield from (f"{first}/faceplate", f"{first}/commands", f"/api/v1/equipment/{id}")


@pytest.mark.sweep(8)
@pytest.mark.parametrize("plant", PLANTS)
def test_no_value_of_a_machine_ends_a_page(tmp_path: Path, plant: str) -> None:
    wrong = []
    with virtual.house(Settings(data=tmp_path / "data", plant=ROOT / "plants" / plant)) as client:
        client.pass_time(20)
        house = House(client)
        urls = [url for url in dict.fromkeys(addresses(house)) if client.get(url).status_code == 200]
        assert len(urls) > 20
        assert house.runtime.plant
        points = [one for item in house.runtime.plant.equipment.values() for one in item.points.values()]
        for seed in range(SEEDS):
            dice = random.Random(f"{plant} {seed}")
            share = (1.0, 0.2, 0.02)[seed % 3]
            said = {one.name: rubbish(one, dice) for one in points if dice.random() < share}
            known = {name: value for name, value in said.items() if value is not None and name in house.runtime.tags}
            house.put(known)
            for url in urls:
                answer = client.get(url)
                if answer.status_code >= 500 or len(answer.content) > 3_000_000:
                    wrong.append((seed, url, answer.status_code, len(answer.content)))
    assert wrong == []


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("plant", "key", "said"), [("belts", "device_line_length", 1e38), ("crane", "bridge_max_position", -3.4e38)]
)
def test_a_length_that_no_machine_has_is_bad_and_draws_nothing(
    tmp_path: Path, plant: str, key: str, said: float
) -> None:
    with virtual.house(Settings(data=tmp_path / "data", plant=ROOT / "plants" / plant)) as client:
        client.pass_time(20)
        house = House(client)
        assert house.runtime.plant
        item = next(one for one in house.runtime.plant.equipment.values() if key in one.points)
        name, tags = f"{item.id}.{key}", house.runtime.tags
        assert is_good(tags.quality(tags.handle(name)))
        house.put({name: said})
        assert client.get(f"/equipment/{item.id}").text.count("<path") < 2000
        assert level(tags.quality(tags.handle(name))) == BAD
        assert reason(tags.quality(tags.handle(name))) is QualityReason.OUT_OF_RANGE
