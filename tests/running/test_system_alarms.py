"""What the server itself has to say becomes an alarm, and ends."""

from types import SimpleNamespace
from typing import Any

import pytest

from app.historian.upkeep import WARN_AT
from app.links.statistics import LinkState
from app.running.system_alarms import tell_of_certificate, tell_of_links, tell_of_server, tell_of_task
from app.supervisor import SupervisedTask


class Alarms:
    """Notes the last report of each alarm and object."""

    def __init__(self) -> None:
        self.active: dict[tuple[str, str], bool] = {}
        self.system = self

    def report(self, key: str, object: str = "", active: bool = True, params: Any = None) -> None:
        self.active[key, object] = active

    def told(self) -> set[str]:
        return {key for (key, _), active in self.active.items() if active}


def link(
    state: LinkState, only_here: int = 0, halted: bool = False, restarts: bool = False, closed: bool = False
) -> Any:
    return SimpleNamespace(
        statistics=SimpleNamespace(state=state),
        only_here=lambda _: only_here,
        halted=lambda _: halted,
        restarts=lambda _: restarts,
        stations={1: SimpleNamespace(refuses_by_closing=closed)},
    )


PLANT: Any = SimpleNamespace(equipment={"c1": SimpleNamespace(id="c1", link="hall", unit=1)})


@pytest.mark.parametrize("state", LinkState)
def test_a_link_on_which_somebody_answers_is_not_down(state: LinkState) -> None:
    alarms: Any = Alarms()
    tell_of_links(alarms, PLANT, {"hall": link(state)})
    assert ("link_down" in alarms.told()) is (state not in (LinkState.UP, LinkState.SOME_SILENT))


@pytest.mark.parametrize(("only_here", "halted"), [(0, False), (3, False), (0, True)])
def test_events_only_here_and_a_halted_program_are_told_of_their_machine(only_here: int, halted: bool) -> None:
    alarms: Any = Alarms()
    tell_of_links(alarms, PLANT, {"hall": link(LinkState.UP, only_here, halted)})
    assert alarms.active["events_unstored", "c1"] is (only_here > 0)
    assert alarms.active["program_halted", "c1"] is halted


@pytest.mark.parametrize("closed", [True, False])
def test_a_device_that_closes_the_connection_at_a_register_is_told(closed: bool) -> None:
    alarms: Any = Alarms()
    tell_of_links(alarms, PLANT, {"hall": link(LinkState.UP, closed=closed)})
    assert ("connection_closed" in alarms.told()) is closed


@pytest.mark.parametrize("restarts", [True, False])
def test_a_plc_that_restarts_again_and_again_is_told_of_its_machine(restarts: bool) -> None:
    alarms: Any = Alarms()
    tell_of_links(alarms, PLANT, {"hall": link(LinkState.UP, restarts=restarts)})
    assert alarms.active["device_restarts", "c1"] is restarts


def server(**changed: Any) -> set[str]:
    state: dict[str, Any] = {
        "lag": 0.0, "speed": 1, "achieved": 1.0, "healthy": True, "intact": True, "full": False, "failed": False, "fill": 0.1,
        "disk_low": False, "clock_leapt": False, "slow": False,
    } | changed  # fmt: skip
    it: Any = SimpleNamespace(**state)
    it.upkeep = it
    it.is_slow = lambda: it.slow
    alarms: Any = Alarms()
    tell_of_server(alarms, it, it, it, it, it)
    return set(alarms.told())


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        ({}, set()),
        ({"lag": 1.1}, {"simulation_late"}),
        ({"achieved": 0.8}, {"simulation_late"}),
        ({"achieved": 0.0, "speed": 0}, set()),
        ({"achieved": 1.5, "speed": 10}, set()),
        ({"achieved": 0.8, "speed": 10}, {"simulation_late"}),
        ({"healthy": False}, {"audit_waiting"}),
        ({"intact": False}, {"audit_broken"}),
        ({"full": True}, {"history_full"}),
        ({"failed": True}, {"history_full"}),
        ({"fill": WARN_AT}, {"history_quota"}),
        ({"disk_low": True}, {"disk_low"}),
        ({"clock_leapt": True}, {"clock_leapt"}),
        ({"slow": True}, {"disk_slow"}),
    ],
)
def test_each_fault_of_the_server_has_its_alarm(changed: dict[str, Any], told: set[str]) -> None:
    assert server(**changed) == told


@pytest.mark.parametrize(("days", "told"), [(-1, True), (0, True), (13, True), (15, False), (None, False)])
def test_a_certificate_is_told_two_weeks_before_its_end(days: int | None, told: bool) -> None:
    alarms: Any = Alarms()
    now = 1_800_000_000_000_000
    tell_of_certificate(alarms, None if days is None else now + days * 86_400_000_000, now)
    assert ("certificate_ends" in alarms.told()) is told


@pytest.mark.parametrize("alive", [True, False])
def test_a_task_that_is_down_is_told(alive: bool) -> None:
    alarms: Any = Alarms()
    tell_of_task(alarms, SupervisedTask("store", alive))
    assert ("task_down" in alarms.told()) is not alive
