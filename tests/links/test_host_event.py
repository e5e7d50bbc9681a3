"""An event as the host has it is what alarms and history ask of one."""

from dataclasses import FrozenInstanceError
from math import nan

import pytest

from app.links.host_event import HostEvent
from app.plant.events import Ring, RingPosition, is_new, position_of

RING = Ring(object(), 0, 3, 0)
EVENT = HostEvent(9, 1000, 1005, 40, 2, nan, (1, 2), 3, RING)


def test_its_mark_is_behind_it_and_what_follows_is_new() -> None:
    mark = position_of(EVENT)
    assert mark == RingPosition(3, 9, 1000, RING)
    for sequence, new in ((8, False), (9, False), (10, True), (11, True)):
        event = HostEvent(sequence, 1000 + sequence, 1005, 40, 2, nan, (), 3, RING)
        assert is_new(event, mark) is new


def test_nobody_changes_it_and_without_a_command_it_names_none() -> None:
    assert EVENT.request == 0
    with pytest.raises(FrozenInstanceError):
        EVENT.sequence = 1  # type: ignore[misc]
