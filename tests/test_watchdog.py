"""A server whose event loop hangs ends and says where; one that only stands still, or ends in order, is left alone."""

import asyncio
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from app.watchdog import ENDED, LIMIT, Watchdog
from tests.conftest import ROOT, PogonServer, clean, find_port, wait_healthy

HANGS = """
import signal, time
from app import watchdog

watchdog.PERIOD, watchdog.LIMIT = 0.1, 20

def hang(*_):
    time.sleep(600)

signal.signal(signal.SIGUSR1, hang)  # a handler runs in the thread of the loop
from app.cli import main
main()
"""


@pytest.mark.parametrize("gap", [1, 2, LIMIT - 1])
async def test_a_loop_that_turns_now_and_then_is_left_alone(gap: int) -> None:
    watchdog = Watchdog()
    watchdog.start()
    try:
        for _ in range(5):
            assert not any(watchdog.look() for _ in range(gap + 1)), "the first of them finds the sign"
            await asyncio.sleep(1.5)
    finally:
        watchdog.stop()


async def test_only_so_many_looks_in_a_row_without_a_sign_are_a_loop_that_hangs() -> None:
    watchdog = Watchdog()
    watchdog.start()
    watchdog.stop()
    assert [watchdog.look() for _ in range(LIMIT + 1)] == [False] * LIMIT + [True]


@pytest.fixture
def server(tmp_path: Path) -> Iterator[PogonServer]:
    """A server that SIGUSR1 hangs, with a watchdog that waits two seconds."""
    port, output = find_port(), tmp_path / "pogon.log"
    environment = clean() | {"POGON_DATA": str(tmp_path / "data"), "POGON_PORT": str(port), "PYTHONPATH": str(ROOT)}
    with output.open("wb") as sink:
        process = subprocess.Popen([sys.executable, "-c", HANGS, "run"], env=environment, stdout=sink, stderr=sink)
    one = PogonServer(f"http://127.0.0.1:{port}", tmp_path / "data", output, process)
    try:
        wait_healthy(one)
        yield one
    finally:
        if process.poll() is None:
            one.kill()


@pytest.mark.real_time
@pytest.mark.sweep(8)
def test_a_server_that_hangs_ends_says_where_and_starts_again_from_its_files(server: PogonServer) -> None:
    os.kill(server.process.pid, signal.SIGUSR1)
    assert server.process.wait(60) == ENDED
    assert "in hang" in server.log() and "the event loop has not turned" in server.log()
    again = PogonServer.start(server.data, server.output)
    assert again.stop() == -signal.SIGTERM


@pytest.mark.real_time
@pytest.mark.sweep(8)
def test_a_server_that_was_stopped_goes_on_and_ends_in_order(server: PogonServer) -> None:
    os.kill(server.process.pid, signal.SIGSTOP)
    time.sleep(5)  # more than its watchdog waits
    os.kill(server.process.pid, signal.SIGCONT)
    wait_healthy(server)
    time.sleep(3)
    assert server.process.poll() is None and "the event loop" not in server.log()
    assert server.stop() == -signal.SIGTERM
