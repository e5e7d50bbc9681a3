"""A part of a screen that is fetched again names every tag it is made of: of one that it forgets it would show the former value on.

Tried from outside: values that a part does not name are changed under it, all at once, and it must come out as it was, but for what is
drawn live by its own tag.
"""

from pathlib import Path
from typing import Any

import pytest

from app.settings import Settings
from tests import virtual
from tests.conftest import ROOT
from tests.web.hand import CHANGES, House

PLANTS = ("demo", "feeding", "drive_steps", "belts")
"""Those whose screens have parts."""


@pytest.mark.sweep(8)
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


@pytest.mark.sweep(8)
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
