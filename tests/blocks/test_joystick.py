"""Manual driving: four steps, one axis at a time, hold-to-run."""

from itertools import count

import pytest

from app.blocks.joystick import Joystick, Lever
from app.sim.crane.figures import AXES

STEPS = {name: [figures[f"step_{n}"].value for n in (1, 2, 3, 4)] for name, figures in AXES.items()}
DT = 0.02


class Cab:
    """A joystick whose counter runs by itself."""

    def __init__(self) -> None:
        self.joystick, self.counter = Joystick(STEPS), count()
        self.move(0.1)

    def move(self, seconds: float, *, frozen: bool = False, allowed: bool = True, **levers: Lever) -> tuple[str, float]:
        number, moved = next(self.counter), ("", 0.0)
        for _ in range(round(seconds / DT)):
            number = number if frozen else next(self.counter)
            moved = self.joystick.step({name: Lever() for name in STEPS} | levers, number, DT, allowed=allowed)
        return moved


@pytest.mark.parametrize("axis", STEPS)
@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize("step", [1, 2, 3, 4])
def test_each_step_is_its_speed_in_millimetres_per_second(axis: str, direction: int, step: int) -> None:
    assert Cab().move(0.1, **{axis: Lever(direction, step)}) == (axis, direction * STEPS[axis][step - 1])  # type: ignore[arg-type]


@pytest.mark.parametrize(("step", "speed"), [(0, 20.32), (-3, 20.32), (5, 132.08)])
def test_a_step_that_is_not_there_is_the_nearest(step: int, speed: float) -> None:
    assert Cab().move(0.1, hoist=Lever(1, step)) == ("hoist", speed)


def test_steps_may_change_while_it_is_held_and_release_stops_at_once() -> None:
    cab = Cab()
    assert [cab.move(0.1, hoist=Lever(1, n))[1] for n in (1, 4, 2)] == [20.32, 132.08, 50.8]
    assert cab.move(DT) == ("", 0.0)


def test_a_second_axis_stops_both_until_everything_was_released() -> None:
    cab = Cab()
    cab.move(0.2, hoist=Lever(1))
    assert cab.move(DT, hoist=Lever(1), trolley=Lever(1)) == ("", 0.0)
    assert cab.move(1.0, hoist=Lever(1)) == ("", 0.0)
    assert cab.move(1.0, trolley=Lever(1)) == ("", 0.0)
    cab.move(DT)
    assert cab.move(DT, trolley=Lever(1)) == ("trolley", 81.28)


def test_going_over_to_another_axis_without_release_does_not_move_it() -> None:
    cab = Cab()
    cab.move(0.2, hoist=Lever(1))
    assert cab.move(0.5, trolley=Lever(1)) == ("", 0.0)


def test_a_counter_that_stands_still_releases_after_half_a_second() -> None:
    cab = Cab()
    cab.move(0.2, hoist=Lever(1))
    assert cab.move(0.4, hoist=Lever(1), frozen=True) == ("hoist", 20.32)
    assert cab.move(0.6, hoist=Lever(1), frozen=True) == ("", 0.0)
    assert cab.move(1.0, hoist=Lever(1)) == ("", 0.0), "a counter that comes back moves nothing"
    cab.move(0.1)
    assert cab.move(DT, hoist=Lever(1)) == ("hoist", 20.32)


@pytest.mark.parametrize(("pause", "moves"), [(0.0, False), (0.1, False), (0.26, False), (0.32, True), (1.0, True)])
def test_the_other_direction_wants_a_pause(pause: float, moves: bool) -> None:
    cab = Cab()
    cab.move(0.2, hoist=Lever(1))
    cab.move(pause)
    assert (cab.move(0.5, hoist=Lever(-1))[1] != 0) is moves
    other = Cab()
    other.move(0.2, hoist=Lever(1))
    other.move(max(pause, DT))
    assert other.move(DT, hoist=Lever(1))[1] and Cab().move(DT, trolley=Lever(-1))[1], "the same way, or another axis"


def test_what_was_held_before_does_not_move() -> None:
    joystick = Joystick(STEPS)
    for n in range(20):
        assert joystick.step({"hoist": Lever(1)}, n, DT) == ("", 0.0)
    cab = Cab()
    cab.move(0.2, hoist=Lever(1), allowed=False)
    assert cab.move(0.2, hoist=Lever(1)) == ("", 0.0), "manual mode came while it was held"
    cab.move(DT)
    assert cab.move(DT, hoist=Lever(1))[1]
    assert cab.move(DT, hoist=Lever(1), allowed=False) == ("", 0.0)


@pytest.mark.parametrize(
    "bad", [(1.0, 2.0, 3.0), (0.0, 1.0, 2.0, 3.0), (1.0, 3.0, 2.0, 4.0), (1.0, 2.0, 3.0, 4.0, 5.0)]
)
def test_four_rising_steps_are_wanted(bad: tuple[float, ...]) -> None:
    with pytest.raises(ValueError, match="four rising"):
        Joystick({"hoist": bad})
    with pytest.raises(KeyError):
        Joystick(STEPS).step({"jib": Lever(1)}, 0, DT)
