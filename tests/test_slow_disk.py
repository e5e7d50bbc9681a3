"""A disk that takes seconds for each write: told as an alarm, Stop goes out, and the server ends in the time that its unit gives it."""

import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from app import chance
from app.watchdog import CUT_SHORT
from tests.conftest import ROOT, PogonServer, clean, enroll, find_port, wait_healthy
from tests.test_killed_audit import Program, ids, opened, tokens

UNIT_LIMIT = 15.0
"""TimeoutStopSec of the unit [s]."""
SLOW = """
import os, time
from pathlib import Path
from sqlalchemy import Engine, event

slow = Path(os.environ["SLOW"])

def wait():
    if slow.exists():
        time.sleep(float(slow.read_text()))

def committed(connection):
    if connection.connection.dbapi_connection.in_transaction:  # it has written something
        wait()

event.listen(Engine, "commit", committed)
for name in ("fsync", "fdatasync"):
    def synced(handle, sync=getattr(os, name)):
        wait()
        sync(handle)
    setattr(os, name, synced)
from app.cli import main
main()
"""


@pytest.fixture
def server(tmp_path: Path) -> Iterator[PogonServer]:
    """A server each of whose writes takes as many seconds as the file `slow` says, while that is there."""
    data, port, output = tmp_path / "data", find_port(), tmp_path / "pogon.log"
    enroll(data, {"ana": ["operator", "engineer"]}, "tri plave ladice u kutu")
    given = {"POGON_DATA": str(data), "POGON_PORT": str(port), "PYTHONPATH": str(ROOT), "SLOW": str(tmp_path / "slow")}
    with output.open("wb") as sink:
        process = subprocess.Popen([sys.executable, "-c", SLOW, "run"], env=clean() | given, stdout=sink, stderr=sink)
    one = PogonServer(f"http://127.0.0.1:{port}", data, output, process)
    try:
        yield one
    finally:
        if process.poll() is None:
            one.kill()


@pytest.mark.slow
@pytest.mark.real_time
def test_a_slow_disk_is_told_stop_goes_out_and_the_end_comes_in_time(
    server: PogonServer, tmp_path: Path, pogon_server: Callable[..., PogonServer]
) -> None:
    (secret,) = tokens(server.data)
    wait_healthy(server)
    program = Program(server, secret, "m1")
    (tmp_path / "slow").write_text("4")
    stop, asked = chance.token_hex(16), time.monotonic()
    status, _ = program.ask("/stop", id=stop)
    assert status == 200 and time.monotonic() - asked < 2
    standing: list[str] = []
    while "sys.disk_slow" not in standing:
        assert time.monotonic() - asked < 10, standing
        time.sleep(0.2)
        standing = re.findall(r"sys\.\w+", str(program.ask(f"{server.url}/api/v1/alarms", method="GET")))
    told = time.monotonic()
    server.process.terminate()
    server.process.wait(3 * UNIT_LIMIT)
    assert time.monotonic() - told < UNIT_LIMIT
    (tmp_path / "slow").unlink()
    pogon_server(data=server.data).stop()
    assert stop in ids(server.data)
    with opened(server.data) as access:
        assert access.audit.check_now().ok


@pytest.mark.slow
@pytest.mark.real_time
def test_who_ends_a_server_whose_disk_stands_still_does_not_get_it_back(server: PogonServer, tmp_path: Path) -> None:
    (secret,) = tokens(server.data)
    wait_healthy(server)
    (tmp_path / "slow").write_text("600")
    told = time.monotonic()
    assert Program(server, secret, "m1").ask("/stop", id=chance.token_hex(16))[0] == 200
    server.process.terminate()
    assert server.process.wait(3 * UNIT_LIMIT) == CUT_SHORT
    assert time.monotonic() - told < UNIT_LIMIT + 5
    unit = (ROOT / "packaging" / "pogon.service").read_text("utf-8")
    assert re.search(rf"^RestartPreventExitStatus=.*\b{CUT_SHORT}\b", unit, re.MULTILINE)
