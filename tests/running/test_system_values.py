"""What the system knows of itself, counted from its parts."""

from types import SimpleNamespace
from typing import Any

import pytest

from app.links.statistics import LinkState
from app.plant.system import FRAME, HISTORY
from app.running.system_values import system_values

KEYS = {key for key, *_ in (*FRAME, *HISTORY)} - {"loop_lag"}


def parts(states: list[LinkState], alive: list[bool], sim: object | None = None) -> dict[str, Any]:
    supervisor: Any = SimpleNamespace(tasks={n: SimpleNamespace(alive=one) for n, one in enumerate(alive)})
    links: Any = [SimpleNamespace(statistics=SimpleNamespace(state=state)) for state in states]
    history = {key.removeprefix("history."): 1 for key in KEYS if key.startswith("history.")}
    recorder: Any = SimpleNamespace(statistics=lambda: history)
    live: Any = SimpleNamespace(watchers=3)
    given: Any = sim
    return dict(system_values(supervisor, links, given, live, recorder))


@pytest.mark.parametrize(
    ("states", "up"),
    [
        ([], 0),
        ([LinkState.UP, LinkState.UP], 2),
        ([LinkState.UP, LinkState.DOWN, LinkState.CONNECTING], 1),
        ([LinkState.SOME_SILENT], 0),
    ],
)
def test_links_are_counted_and_only_a_whole_one_is_up(states: list[LinkState], up: int) -> None:
    values = parts(states, [])
    assert (values["links_up"], values["links_total"]) == (up, len(states))


@pytest.mark.parametrize(("alive", "failed"), [([], 0), ([True, True], 0), ([False, True, False], 2)])
def test_tasks_that_are_down_are_counted(alive: list[bool], failed: int) -> None:
    assert parts([], alive)["tasks_failed"] == failed


def test_the_simulation_is_late_in_milliseconds_and_without_one_nothing_is() -> None:
    values = parts([], [], SimpleNamespace(lag=0.12345, overruns=4, speed=10, achieved=7.26))
    assert (values["sim_lag"], values["sim_overruns"]) == (123.5, 4)
    assert (values["sim_speed"], values["sim_pace"]) == (10, 7.3)
    assert (parts([], [])["sim_lag"], parts([], [])["sim_overruns"], parts([], [])["watchers"]) == (0.0, 0, 3)


def test_there_is_a_value_for_every_point_of_the_system() -> None:
    assert set(parts([], [])) == KEYS
