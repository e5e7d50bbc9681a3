"""Who sits where: a Pogon for all stories of a module, which ends with them, and signed-in browsers at it."""

from collections.abc import Generator, Iterator

import pytest
from playwright.sync_api import Browser, Error, Page, StorageState, expect

from tests.browser.station import Operator, Sit, Stations, fault, serving, small
from tests.conftest import PogonServer, find_port

expect.set_options(timeout=15_000)  # what has to happen sooner than this says so itself
LAST = 40
"""So many lines of the log of a server are told with a test that failed."""


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """With a test that failed it is told what its servers said last, and what stood on its pages: often it fails only once."""
    report = yield
    if call.when == "call" and report.failed:
        for name, given in getattr(item, "funcargs", {}).items():
            if isinstance(given, PogonServer):
                report.sections.append((f"log of {name}", "\n".join(given.log().splitlines()[-LAST:])))
            for page in given.pages if isinstance(given, Sit) else [given] if isinstance(given, Page) else []:
                report.sections.append((f"page of {name}", _told(page)))
    return report


def _told(page: Page) -> str:
    try:
        return f"{page.url}\n{page.inner_text('body', timeout=1_000)}"
    except Error as error:
        return str(error)


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PogonServer]:
    """One Pogon with the drives of the demo plant for all that only look at them. Idle it would cost more than another start."""
    with serving(small(tmp_path_factory.mktemp("demo"), "m1", "m2"), people={}) as running:
        yield running


@pytest.fixture(scope="module")
def sessions() -> dict[str, StorageState]:
    """Whoever signed in once stays so."""
    return {}


@pytest.fixture(scope="session")
def stations(browser: Browser) -> Stations:
    """Browsers of this process, which one test after the other sits at."""
    return Stations(browser)


@pytest.fixture
def page(stations: Stations) -> Iterator[Page]:
    """An empty page of a browser that knows nobody."""
    page = stations.sit()
    yield page
    stations.leave(page)


@pytest.fixture
def sit(
    stations: Stations, server: PogonServer, sessions: dict[str, StorageState], request: pytest.FixtureRequest
) -> Iterator[Sit]:
    """Sit down at the `server` of a module, as its WHO and before its HOME if nothing else is said.

    Whatever a console complains of fails the test.
    """
    module = request.module
    seat = Sit(stations, server, sessions, module.WHO, module.HOME)
    yield seat
    seat.leave()
    assert not seat.complaints


@pytest.fixture(scope="module")
def broken(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PogonServer]:
    """One Pogon with the drives of the demo plant, which may be broken over Modbus, with somebody who may do everything."""
    people = {"ana": ("admin", "engineer", "operator")}
    modbus = f"127.0.0.1:{find_port()}"
    with serving(small(tmp_path_factory.mktemp("broken"), "m1", "m2"), people, serve_modbus=modbus) as running:
        yield running


@pytest.fixture(scope="module")
def abnormal(stations: Stations, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    """A page of the whole demo plant at work, one of whose drives has tripped."""
    with serving(tmp_path_factory.mktemp("whole"), {"ana": ("admin", "engineer", "operator")}) as running:
        seat = Sit(stations, running, {}, "ana", "/equipment/m2")
        page = seat()
        fault(page, "m2", 13)
        expect(page.locator("#alarms .banner-row, #alarms li, #alarms a").first).to_be_visible()
        yield page
        seat.leave()


@pytest.fixture
def operator(stations: Stations, broken: PogonServer, sessions: dict[str, StorageState]) -> Iterator[Operator]:
    """Somebody before a plant as it was built, with no alarm, whatever went on before."""
    seat = Sit(stations, broken, sessions, "ana", "/")
    who = Operator(seat(), broken)
    who.rebuild("m1", "m2")
    yield who
    seat.leave()
    assert not seat.complaints
