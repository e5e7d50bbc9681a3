"""What every test may ask for: a free port, a running Pogon, a browser that never leaves this machine."""

import asyncio
import atexit
import gc
import os
import shutil
import socket
import ssl
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass
from hashlib import blake2b
from pathlib import Path
from random import Random
from typing import Any

import pytest
from hypothesis import HealthCheck, settings

from app import chance
from app.access.access import Access, prepare
from app.cli_access import terminal
from app.clock import SystemClock
from app.db import Database
from app.plant import types
from tests.light import NAMES, light, read_once
from tests.virtual import VirtualLoop, inline
from tests.warm import Forked, Stem

sys.dont_write_bytecode = False  # two thirds of what it takes to collect all tests is their compilation
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # nor do the processes that tests start compile it anew
settings.register_profile("house", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("house")  # how long an example takes is the machine's affair

ROOT = Path(__file__).resolve().parent.parent
LONGEST = (
    *(
        "test_newcomer",
        "test_layout_machines",
        "test_layout_operating",
        "test_layout",
        "test_crane_cycle",
        "test_commands",
    ),
    *("test_gone", "test_sequence", "test_live", "test_sequence_tcp", "test_conveyor"),
    *("test_sequence_engineering", "test_sinamics", "test_alarms", "test_trends", "test_crane"),
    *("test_frame", "test_conveyor_by_hand"),
)
"""Files of browser tests that take half a minute and more, the longest first, so that none begins when the other browsers end.

Who has no more than two tests left gets another file at once; so what follows the two long tests of the crane is short.
"""
START_LIMIT = 90.0
"""A server has answered by then even on a machine that is busy with other tests [s]."""

YOUNG = 50_000
"""So many new objects are there before garbage is searched for: a house that starts makes that many, and none of them is garbage."""


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--draw", type=int, help="of the tests marked sweep, run those that this number draws")


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """What test files read of the product's types, to say what they sweep, is read once, too."""
    gc.disable()  # nothing of what is collected here is garbage
    try:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(types, "read_type", read_once)
            return (yield)
    finally:
        gc.enable()


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Browser tests go last: after Playwright's own loop no other asynchronous test can start in this process."""
    for item in items:
        if {"page", "browser"} & set(getattr(item, "fixturenames", ())):
            item.add_marker("browser")
            if not item.path.is_relative_to(ROOT / "tests" / "browser") and not item.get_closest_marker("soak"):
                raise pytest.UsageError(f"{item.nodeid} drives a browser: expected below tests/browser")
        if item.get_closest_marker("real_time") and "mark.real_time" not in item.path.read_text("utf-8"):
            raise pytest.UsageError(f"{item.nodeid} lives in real time: expected mark.real_time in its file")
    items.sort(key=_order)
    if (seed := config.getoption("--draw")) is not None:
        left = [item for item in items if not drawn(item, seed)]
        config.hook.pytest_deselected(items=left)
        items[:] = [item for item in items if drawn(item, seed)]


DEAR = 0.5
"""A test that runs each time and takes longer is named [s]."""
BROWSERS = 24
"""One in so many tests with a browser is drawn: a second of theirs costs what fifty tests without one do."""


def drawn(item: pytest.Item, seed: int) -> bool:
    """Whether a test runs when `seed` draws: one in so many as its mark says, and every one that neither sweeps nor has a browser."""
    if mark := item.get_closest_marker("sweep"):
        one_in: int = mark.args[0]
    else:
        one_in = BROWSERS if item.get_closest_marker("browser") and not item.get_closest_marker("always") else 1
    return int.from_bytes(blake2b(f"{seed} {item.nodeid}".encode(), digest_size=8).digest()) % one_in == 0


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    """After a draw: the dearest of the tests that run each time, of which one that is one of many should be marked `sweep`."""
    if config.getoption("--draw") is None:
        return
    ran = [one for one in terminalreporter.stats.get("passed", ()) if one.when == "call"]
    each = [one for one in ran if not {"sweep", "browser"} & {*one.keywords} and one.duration > DEAR]
    each.sort(key=lambda one: -one.duration)
    if each:
        whole = sum(one.duration for one in each)
        terminalreporter.write_line(
            f"Run each time, not drawn: {len(each)} tests of more than {DEAR:g} s, {whole:.0f} s in all"
        )
        for one in each[:5]:
            terminalreporter.write_line(f"  {one.duration:.1f} s {one.nodeid}")


def pytest_collection_finish() -> None:
    """What is there now stays until the end: thousands of tests are not looked through again at every search for garbage."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(YOUNG, *gc.get_threshold()[1:])


def _order(item: pytest.Item) -> tuple[bool, int]:
    """Browsers last; of their files, each of which stays with one worker, the longest first; of tests in real time the slow ones."""
    name = item.path.stem
    if item.get_closest_marker("browser"):
        return True, LONGEST.index(name) if name in LONGEST else len(LONGEST)
    return False, int(bool(item.get_closest_marker("real_time") and not item.get_closest_marker("slow")))


def pytest_asyncio_loop_factories(
    config: pytest.Config, item: pytest.Item
) -> Mapping[str, Callable[[], asyncio.AbstractEventLoop]]:
    """Asynchronous tests live in virtual time, but for those whose subject is real: sockets, ttys, processes, browsers."""
    real = any(item.get_closest_marker(mark) for mark in ("real_time", "soak", "browser"))
    return {"real": asyncio.SelectorEventLoop} if real else {"virtual": VirtualLoop}


@pytest.fixture(autouse=True)
def _seeded(request: pytest.FixtureRequest) -> Iterator[None]:
    """Jitter, ids and nonces come from a seed, the same for a test wherever and whenever it runs."""
    chance.use(Random(request.node.nodeid))
    yield
    chance.use()


@pytest.fixture(scope="session", autouse=True)
def _light() -> Iterator[None]:
    """This process is light; those that it starts are as an operator has them."""
    with light():
        yield


@pytest.fixture
def free_port() -> int:
    """A TCP port on loopback that nobody listens on."""
    return find_port()


def find_port() -> int:
    """A TCP port on loopback that is ours until this process ends.

    It stays bound but nobody listens, so the system gives it to nobody else; who names it, as a server does, may listen on it.
    """
    held = socket.socket()
    atexit.register(held.close)  # which also keeps it
    held.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    held.bind(("127.0.0.1", 0))
    port: int = held.getsockname()[1]
    return port


def clean() -> dict[str, str]:
    """The environment without the settings of whoever runs the tests."""
    return {name: text for name, text in os.environ.items() if not name.startswith("POGON_")}


def enroll(data: Path, people: Mapping[str, Sequence[str]], password: str) -> None:
    """Make accounts with these roles in a data folder, beside a running server too, as `pogon user` does."""
    prepare(data)
    database = Database(data / "pogon.db", "pogon")
    database.migrate()
    access = Access(database, SystemClock(), data)
    try:
        access.people.add_now(terminal(), [(name, "", tuple(roles)) for name, roles in people.items()])
        for name in people:
            access.people.set_password_now(terminal(), name, password)
    finally:
        access.close()
        database.close()


@dataclass
class PogonServer:
    """A Pogon of its own process, as an operator starts it."""

    url: str
    data: Path
    output: Path
    process: subprocess.Popen[bytes] | Forked

    @property
    def port(self) -> int:
        return int(self.url.rsplit(":", 1)[1])

    @classmethod
    def start(
        cls, data: Path, output: Path, *arguments: str, stem: Stem | None = None, **settings: Any
    ) -> "PogonServer":
        """`pogon run` with the POGON_ variables `settings`, ready to answer; what it prints is added to `output`.

        With a `stem` it is forked off that and light.
        """
        given = {"data": data, "port": find_port()} | settings
        environment = clean() | {f"POGON_{name.upper()}": str(value) for name, value in given.items()}
        process: subprocess.Popen[bytes] | Forked
        if stem is not None:
            process = stem.start(arguments, environment, output)
        else:
            with output.open("ab") as sink:
                process = subprocess.Popen(
                    [sys.executable, "-m", "app.cli", "run", *arguments],
                    cwd=ROOT, env=environment, stdin=subprocess.DEVNULL, stdout=sink, stderr=subprocess.STDOUT,
                )  # fmt: skip
        scheme = "https" if given.get("tls_cert") else "http"
        server = cls(f"{scheme}://127.0.0.1:{given['port']}", data, output, process)
        try:
            wait_healthy(server)
        except BaseException:
            server.kill()
            raise
        return server

    def log(self) -> str:
        """All it has printed so far."""
        return self.output.read_text("utf-8", errors="replace")

    def stop(self, limit: float = 15.0) -> int:
        """Ask it to end, as systemd does; returns its exit code."""
        self.process.terminate()
        try:
            return self.process.wait(limit)
        except subprocess.TimeoutExpired:
            self.kill()
            raise

    def kill(self) -> None:
        """End it the hard way: nothing is saved any more."""
        self.process.kill()
        self.process.wait()


@pytest.fixture
def pogon_server(tmp_path: Path) -> Iterator[Callable[..., PogonServer]]:
    """Start servers: `pogon_server(dry_run=True)` is a Pogon with POGON_DRY_RUN set, ready to answer.

    `data=` gives a second server the folder of a first one. All are ended after the test.
    """
    started: list[PogonServer] = []

    def start(*arguments: str, **settings: Any) -> PogonServer:
        data = Path(settings.pop("data", tmp_path / "data"))
        server = PogonServer.start(data, tmp_path / f"pogon-{len(started)}.log", *arguments, **settings)
        started.append(server)
        return server

    yield start
    for server in started:
        if server.process.poll() is None:
            server.stop()


def wait_healthy(server: PogonServer) -> None:
    until = time.monotonic() + START_LIMIT
    anybody = ssl._create_unverified_context() if server.url.startswith("https:") else None
    while time.monotonic() < until:
        if server.process.poll() is not None:
            pytest.fail(f"pogon ended with {server.process.returncode} at start:\n{server.log()}")
        try:
            with urllib.request.urlopen(f"{server.url}/healthz", timeout=2, context=anybody):
                return
        except (urllib.error.URLError, ConnectionError, TimeoutError):
            time.sleep(0.05)
    pytest.fail(f"pogon did not answer in {START_LIMIT} s:\n{server.log()}")


CHROMIUMS = ("chromium-headless-shell", "chromium")
"""What drives the pages, the lightest first; POGON_CHROMIUM names another."""


@pytest.fixture(scope="session")
def browser_type_launch_args() -> dict[str, Any]:
    """Debian's Chromium, quiet: no graphics card, no calls home; the sandbox only goes for root, who cannot have one."""
    quiet = ["--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking"]
    quiet += ["--disable-component-update", "--disable-sync"]
    if os.geteuid() == 0:
        quiet.append("--no-sandbox")
    named = os.environ.get("POGON_CHROMIUM")
    found = [shutil.which(name) for name in ((named,) if named else CHROMIUMS)]
    return {"executable_path": next(filter(None, found), None), "args": quiet}


@pytest.fixture(scope="session")
def browser_context_args() -> dict[str, Any]:
    return {"viewport": {"width": 1280, "height": 800}, "locale": "en-GB", "timezone_id": "Europe/Zagreb"}


@pytest.fixture(scope="module")
def empty_databases(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with both databases as they are made."""
    folder = tmp_path_factory.mktemp("empty")
    for name in NAMES:
        database = Database(folder / f"{name}.db", name, inline)
        database.migrate()
        database.close()
    return folder
