"""Commands of an E800 with slow ramps: each is given the time that the drive needs, whatever F119 counts its ramps from."""

import pytest

from app.commands import interlocks
from app.commands.lifecycle import ProgressState
from app.plant.expression import Reading
from tests.commands.test_gate_e800 import Hall, hall  # noqa: F401  a fixture

SLOW = {"F113": 20.0, "F114": 10.0, "F115": 60.0, "F905": 1.0}
TO_HIGHEST = {**SLOW, "F111": 20.0, "F119": 1}
"""60 s are from 20 Hz to 0."""


def told(hall: Hall, way: str) -> float:  # noqa: F811
    """How long the motor brakes, as the person is told before the direction changes [s]."""

    def look(key: str) -> Reading:
        sample = hall.tags.sample(f"m2.{key}")
        return sample.value, sample.quality

    return float(interlocks.effect(hall.plant.equipment["m2"].type.commands[way], look)[1]["time"])


@pytest.mark.sweep(8)
@pytest.mark.parametrize(("hall", "takes"), [(SLOW, 24), (TO_HIGHEST, 60)], indirect=["hall"])
async def test_a_stop_and_both_reversals_are_confirmed_when_the_ramp_has_ended(hall: Hall, takes: float) -> None:  # noqa: F811
    await hall.ask("forward")
    await hall.ended(ProgressState.CONFIRMED)
    for way in ("reverse", "forward"):
        await hall.until(lambda: hall.value("frequency") == 20.0)
        assert told(hall, way) == pytest.approx(takes)
        await hall.ask(way, confirmed=True)
        began = hall.clock.monotonic()
        await hall.ended(ProgressState.CONFIRMED, 100)
        assert hall.clock.monotonic() - began == pytest.approx(takes, abs=1)
    await hall.until(lambda: hall.value("frequency") == 20.0)
    progress = await hall.ask("stop")
    assert progress.limit == pytest.approx(takes + 3)
    await hall.ended(ProgressState.CONFIRMED, 100)
    assert not hall.alarms


@pytest.mark.parametrize("hall", [{**SLOW, "F111": 100.0, "F119": 1}], indirect=True)
async def test_a_ramp_from_a_high_limit_is_told_and_waited_for_as_it_is(hall: Hall) -> None:  # noqa: F811  # noqa: F811
    """From 100 Hz it takes 60 s, from 20 Hz 12."""
    await hall.ask("forward")
    await hall.until(lambda: hall.value("frequency") == 20.0)
    assert told(hall, "reverse") == pytest.approx(12)
    assert (await hall.ask("stop")).limit == pytest.approx(12 + 3)
