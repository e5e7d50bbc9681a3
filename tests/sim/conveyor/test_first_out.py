"""First-out of the conveyor: the first cause stands until a reset; when it ends by itself the next one is the first."""

import pytest

from app.sim import training
from app.sim.conveyor.first_out import FORGOTTEN, FirstOut, StopCause
from app.sim.conveyor.register_map import (
    ConveyorState,
)
from tests.sim.conveyor.bench import QUICK, line, put
from tests.sim.conveyor.line import TestLine


@pytest.mark.sweep(8)
@pytest.mark.parametrize("belt", [1, 2, 3])
@pytest.mark.parametrize("early", [0.6, 0.5, 0.4, 0.3, 0.2, 0.1, 0.0, -0.1, -0.3])
async def test_a_jam_while_the_gap_stops_the_line_is_what_stopped_it_when_the_gap_is_over(
    belt: int, early: float
) -> None:
    """A gap stop that ends by itself is forgotten; what keeps the line standing is not."""

    async def meeting() -> TestLine:
        on = line(settings={**QUICK, "unload_dwell": 3.0})
        for place in (655.0, 485.0, 425.0):
            await put(on, place)
        await on.start()
        return on

    on = await meeting()
    begun = on.device.steps
    await on.until_event(20)
    steps = on.device.steps - begun
    on = await meeting()
    on.go(max(0.0, steps / 100 - early))
    await on.train(training.REG_MACHINE_FAULT, belt)
    for _ in range(40):
        on.go(1)
        status = await on.status()
        if status["state"] == ConveyorState.FAULT:
            break
    assert status["state"] == ConveyorState.FAULT
    on.go(25)
    status = await on.status()
    assert status["state"] == ConveyorState.FAULT
    assert (status["first_out"], status["first_out_source"]) == (24, belt)
    jam = next(event for event in await on.fetch() if event.code == 24)
    assert status["first_out_time"] == jam.time


def causes(*codes: int) -> FirstOut:
    found = FirstOut()
    for at, code in enumerate(codes):
        found.add(StopCause(code, time=at))
    return found


def test_the_first_of_several_causes_stands_until_a_reset() -> None:
    found = causes(22, 24, 26)
    assert found.first.code == 22
    found.age(10 * FORGOTTEN)
    assert found.first.code == 22, "it has not ended"
    found.reset()
    assert found.first == StopCause()


@pytest.mark.parametrize(("codes", "after"), [((20,), 20), ((20, 24), 24), ((20, 24, 26), 24), ((24, 20), 24)])
def test_a_cause_that_ends_by_itself_makes_way_for_the_next(codes: tuple[int, ...], after: int) -> None:
    found = causes(*codes)
    found.end(20, 1000)
    assert found.first.code == after
    found.age(1000 + FORGOTTEN)
    assert found.first.code == after, "it is still shown"
    found.age(1001 + FORGOTTEN)
    assert found.first.code == (0 if after == 20 else after)


def test_what_stops_the_line_after_the_first_has_ended_is_the_first() -> None:
    found = causes(20)
    found.end(20, 1000)
    found.add(StopCause(22, time=2000))
    assert (found.first.code, found.first.ended) == (22, 0)
