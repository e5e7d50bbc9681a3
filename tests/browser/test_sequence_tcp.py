"""The same sequences and the same browser, with the plant in a process of its own behind Modbus TCP."""

import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import suppress

import pytest

from tests import coil_plant
from tests.browser.station import serving
from tests.browser.test_sequence import (
    HOME,
    WHO,
    test_a_coil_is_carried_from_the_mandrel_to_a_saddle,
    test_a_force_names_its_permissive_asks_for_the_password_and_ends_by_itself,
    test_a_stall_says_what_is_missing_and_what_fell_first,
    test_an_abort_is_told_with_its_cause_and_has_to_be_reset,
    test_suspend_stops_the_time_and_resume_goes_on,
)
from tests.conftest import ROOT, START_LIMIT, PogonServer, clean, find_port

__all__ = [
    "HOME",
    "WHO",
    "test_a_coil_is_carried_from_the_mandrel_to_a_saddle",
    "test_a_force_names_its_permissive_asks_for_the_password_and_ends_by_itself",
    "test_a_stall_says_what_is_missing_and_what_fell_first",
    "test_an_abort_is_told_with_its_cause_and_has_to_be_reset",
    "test_suspend_stops_the_time_and_resume_goes_on",
]


def wait_for(port: int, devices: "subprocess.Popen[bytes]") -> None:
    """The devices listen: a Pogon is forked off a process that is there, and would be before them."""
    end = time.monotonic() + START_LIMIT
    while True:
        with suppress(ConnectionRefusedError):
            socket.create_connection(("127.0.0.1", port)).close()
            return
        assert devices.poll() is None and time.monotonic() < end
        time.sleep(0.1)


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PogonServer]:
    """`pogon simulate` with the coil line, and a Pogon whose link leads there."""
    folder = tmp_path_factory.mktemp("coils")
    port = find_port()
    coil_plant.write(folder / "devices")
    coil_plant.write(folder / "plant", f'"tcp"\nhost = "127.0.0.1"\nport = {port}\nsimulated = true')
    with (folder / "simulate.log").open("wb") as sink:
        devices = subprocess.Popen(
            [sys.executable, "-m", "app.cli", "simulate", str(folder / "devices"), "--tcp", f"127.0.0.1:{port}"],
            cwd=ROOT, env=clean(), stdin=subprocess.DEVNULL, stdout=sink, stderr=subprocess.STDOUT,
        )  # fmt: skip
    try:
        wait_for(port, devices)
        with serving(folder) as running:
            yield running
    finally:
        devices.terminate()
        devices.wait(10)
