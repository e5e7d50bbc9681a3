"""Silence of the bus is counted from the first telegram on."""

import pytest

from app.sim.watchdog import Watchdog

DT = 0.01


def silent(watchdog: Watchdog, limit: float, most: float = 10.0) -> float | None:
    """After how long it says so [s]."""
    for count in range(1, round(most / DT) + 1):
        if watchdog.step(limit, DT):
            return count * DT
    return None


@pytest.mark.parametrize("limit", [0.05, 0.3, 1.0, 7.5])
def test_it_tells_after_more_than_its_limit(limit: float) -> None:
    watchdog = Watchdog()
    watchdog.telegram()
    watchdog.step(limit, DT)
    assert silent(watchdog, limit) == pytest.approx(limit + DT)
    assert watchdog.step(limit, DT), "and goes on telling"
    watchdog.telegram()
    assert not watchdog.step(limit, DT)


@pytest.mark.parametrize(("heard", "limit"), [(False, 0.1), (True, 0.0)])
def test_it_is_quiet_before_the_first_telegram_and_with_no_limit(heard: bool, limit: float) -> None:
    watchdog = Watchdog()
    if heard:
        watchdog.telegram()
    assert silent(watchdog, limit) is None


def test_a_telegram_in_time_begins_the_count_anew() -> None:
    watchdog = Watchdog()
    for _ in range(20):
        watchdog.telegram()
        watchdog.step(0.1, DT)
        assert silent(watchdog, 0.1, most=0.1) is None
