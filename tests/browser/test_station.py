"""The browsers that tests leave to each other know nothing of what was done with them."""

from collections.abc import Callable

import pytest
from playwright.sync_api import Page

from tests.browser.station import Stations
from tests.browser.test_alarms import BEEPS

LASTING: dict[str, Callable[[Page], None]] = {
    "clock": lambda page: page.clock.install(),
    "script": lambda page: page.add_init_script(f"({BEEPS})()"),
}


@pytest.mark.parametrize("what", LASTING)
def test_a_browser_that_cannot_be_put_back_is_left_to_nobody(stations: Stations, what: str) -> None:
    page = stations.sit()
    LASTING[what](page)
    stations.leave(page)
    assert page.is_closed()


def test_a_browser_that_was_without_a_network_has_it_again(stations: Stations) -> None:
    page = stations.sit()
    page.context.set_offline(True)
    stations.leave(page)
    assert stations.sit() is page
    assert page.evaluate("navigator.onLine")
    stations.leave(page)
