"""A server and what it was started from: a terminal that is held or closed, a pipe that nobody reads, no standard file at all."""

import os
import signal
import subprocess
import sys
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from app.watchdog import ENDED
from tests.conftest import ROOT, PogonServer, clean, find_port, wait_healthy
from tests.test_watchdog import HANGS

PIPE = 65_536
"""What a pipe takes that nobody reads [bytes]."""
SHORTEST = len("2026-03-09T06:05:00.123Z INFO uvicorn.access: 127.0.0.1:5000 - GET /healthz 200")
"""A line of the log for a request."""
pytestmark = [pytest.mark.real_time, pytest.mark.sweep(4)]
Start = Callable[..., PogonServer]


@contextmanager
def started(data: Path, *command: str, closed: bool = False) -> Iterator[PogonServer]:
    """A server whose standard output and error are a pipe that nobody reads, or that has no standard files."""
    port, (held, given) = find_port(), os.pipe()
    environment = clean() | {"POGON_DATA": str(data), "POGON_PORT": str(port), "PYTHONPATH": str(ROOT)}
    shell = ["sh", "-c", 'exec "$@" <&- >&- 2>&-', "sh"] if closed else []
    process = subprocess.Popen([*shell, sys.executable, *command, "run"], env=environment, stdout=given, stderr=given)
    os.close(given)
    server = PogonServer(f"http://127.0.0.1:{port}", data, Path(os.devnull), process)
    try:
        yield server
    finally:
        if process.poll() is None:
            server.kill()
        os.close(held)


def ask(server: PogonServer) -> int:
    with urllib.request.urlopen(f"{server.url}/healthz", timeout=5) as answer:
        status: int = answer.status
        return status


def test_a_log_that_nobody_reads_holds_up_nothing(tmp_path: Path) -> None:
    with started(tmp_path / "data", "-m", "app.cli") as server:
        wait_healthy(server)
        for _ in range(2 * PIPE // SHORTEST):
            assert ask(server) == 200
        assert server.stop(10) == -signal.SIGTERM


def test_a_loop_that_hangs_is_ended_although_nobody_reads_where(tmp_path: Path) -> None:
    with started(tmp_path / "data", "-c", HANGS) as server:
        wait_healthy(server)
        full = Path(f"/proc/{server.process.pid}/fd/2")
        handle = os.open(full, os.O_WRONLY | os.O_NONBLOCK)
        try:
            while True:
                os.write(handle, b"-")
        except BlockingIOError:
            os.close(handle)
        os.kill(server.process.pid, signal.SIGUSR1)
        assert server.process.wait(20) == ENDED


@contextmanager
def hanging_up(meant: signal.Handlers) -> Iterator[None]:
    """What is started inside takes SIGHUP as `meant`: as a terminal has it, or `nohup`, from which these tests may have been started."""
    before = signal.signal(signal.SIGHUP, meant)
    try:
        yield
    finally:
        signal.signal(signal.SIGHUP, before)


def test_a_terminal_that_is_closed_ends_it_in_order(pogon_server: Start) -> None:
    with hanging_up(signal.SIG_DFL):
        server = pogon_server()
    os.kill(server.process.pid, signal.SIGHUP)
    assert server.process.wait(10) == -signal.SIGHUP
    assert "server.stopped" in server.log() and "Finished server process" in server.log()
    assert not [*server.data.glob("*-wal")]


def test_one_that_was_told_to_outlive_its_terminal_does(pogon_server: Start) -> None:
    with hanging_up(signal.SIG_IGN):
        server = pogon_server()
    os.kill(server.process.pid, signal.SIGHUP)
    assert ask(server) == 200
    assert server.stop() == -signal.SIGTERM


def test_it_starts_without_standard_files_and_opens_no_other_in_their_place(tmp_path: Path) -> None:
    with started(tmp_path / "data", "-m", "app.cli", closed=True) as server:
        wait_healthy(server)
        files = Path(f"/proc/{server.process.pid}/fd")
        assert {(files / str(number)).readlink() for number in range(3)} == {Path(os.devnull)}
        assert server.stop() == -signal.SIGTERM
