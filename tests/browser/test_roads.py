"""The roads with TLS on which a browser comes to the house, its own and that of a proxy before it: one story on each."""

import re
import signal
import ssl
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page, StorageState, expect

from app.web.guard import SID
from tests.browser.proxy import Proxy
from tests.browser.station import Sit, Stations, serving, small, take
from tests.conftest import PogonServer, find_port
from tests.test_cli import self_signed

ROADS = ("tls", "proxy")  # plainly comes every other story
SPEED = ".hero-v .val b"


@pytest.fixture(scope="module", params=ROADS)
def road(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, PogonServer]]:
    """How the browser comes, and a Pogon with two drives that has the address to which it goes."""
    folder = small(tmp_path_factory.mktemp(f"road-{request.param}"), "m1", "m2")
    file = folder / "plant" / "plant.toml"
    file.write_text(file.read_text("utf-8").replace("F113 = 40.0", "F113 = 40.0, F114 = 1.5, F115 = 1.5"), "utf-8")
    people = {"ana": ("operator", "engineer")}
    cert, key = self_signed(folder)
    key.chmod(0o600)
    if request.param == "tls":
        with serving(folder, people, tls_cert=cert, tls_key=key) as running:
            assert running.url.startswith("https:")
            yield request.param, running
    else:
        with serving(folder, people, behind_proxy="127.0.0.1") as running:
            context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
            context.load_cert_chain(cert, key)
            with Proxy(running.port, find_port(), context) as proxy:
                yield request.param, PogonServer(proxy.url, running.data, running.output, running.process)


@pytest.fixture
def seat(stations: Stations, road: tuple[str, PogonServer]) -> Iterator[Sit]:
    made = Sit(stations, road[1], dict[str, StorageState](), "ana", "/equipment/m1")
    yield made
    made.leave()
    assert not made.complaints


def settles(page: Page, speed: re.Pattern[str]) -> None:
    expect(page.locator(SPEED)).to_have_text(speed, timeout=30_000)


def test_one_story_on_every_road(road: tuple[str, PogonServer], seat: Sit, tmp_path: Path) -> None:
    """Sign in, operate, hold, take history home, lose the server and find it again, sign out."""
    _, server = road
    page = seat(ignore_https_errors=True)
    kept = {one["name"]: one for one in page.context.cookies()}
    session = next(one for key, one in kept.items() if key.removeprefix("__Host-") == SID)
    assert session["httpOnly"]
    assert session["secure"]
    assert session["name"].startswith("__Host-")

    take(page)
    page.click("[data-command='m1.forward']")
    expect(page.locator("#message")).to_contain_text(re.compile("M1 Forward: Accepted .* → Done"), timeout=30_000)
    settles(page, re.compile(r"^[1-9]\d{2,3}$|^1\D?\d{3}$"))
    page.click(".zone .stop")
    expect(page.locator("#message")).to_contain_text(re.compile("Stop: Accepted .* Done"), timeout=30_000)
    settles(page, re.compile("^0$"))

    page.goto(f"{server.url}/equipment/m2")
    take(page)
    page.click(".op-mode label:has([value=hold])")
    button = page.locator("[data-hold='m2.jog_forward']")
    expect(button).not_to_have_attribute("aria-disabled", "true")
    button.hover()
    page.mouse.down()
    expect(button).to_have_attribute("data-state", "held", timeout=30_000)
    settles(page, re.compile(r"[1-9]"))
    page.mouse.up()
    settles(page, re.compile("^0$"))

    page.goto(f"{server.url}/trends?pens=m1.speed")
    page.locator("[data-take] > summary").click()
    with page.expect_download() as download:
        page.locator("[data-export]").first.click()
    download.value.save_as(tmp_path / "speed.csv")
    assert "m1.speed" in (tmp_path / "speed.csv").read_text("utf-8-sig")

    page.goto(f"{server.url}/equipment/m1")
    expect(page.locator("body")).to_have_attribute("data-live", "live")
    server.process.send_signal(signal.SIGSTOP)
    try:
        expect(page.locator("body")).to_have_attribute("data-live", "offline", timeout=10_000)
    finally:
        server.process.send_signal(signal.SIGCONT)
    expect(page.locator("body")).to_have_attribute("data-live", "live", timeout=30_000)
    # the browser tells of every socket that a frozen server did not answer
    seat.complaints[:] = [told for told in seat.complaints if "closed before the connection is established" not in told]

    page.locator(".head .who").first.click()
    page.locator("form[action='/signout'] button").first.click()
    expect(page.locator(".head .who")).not_to_contain_text("ana")
    page.context.add_cookies([session])
    page.goto(f"{server.url}/equipment/m1")
    expect(page.locator(".head .who")).not_to_contain_text("ana")
