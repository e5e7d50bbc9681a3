"""Alarms of a real server: a drive trips, the server is killed, the next one knows what stood and tells nothing anew."""

import socket
import sqlite3
import struct
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from tests.conftest import PogonServer, find_port

MACHINE_FAULT = 0xE010


def write(port: int, unit: int, address: int, word: int) -> None:
    """One register by Modbus TCP, function 06."""
    with socket.create_connection(("127.0.0.1", port), timeout=5) as line:
        line.sendall(struct.pack(">HHHBBHH", 1, 0, 6, unit, 6, address, word))
        assert line.recv(64)[7] == 6


def read(data: Path, query: str) -> list[Any]:
    with closing(sqlite3.connect(f"file:{data / 'pogon.db'}?mode=ro", uri=True)) as base:
        return base.execute(query).fetchall()


def wait(what: Callable[[], Any], limit: float = 60.0) -> Any:
    until = time.monotonic() + limit
    while not (found := what()):
        assert time.monotonic() < until, "it did not happen"
        time.sleep(0.1)
    return found


@pytest.mark.slow
@pytest.mark.real_time
def test_a_killed_server_comes_back_with_its_alarms_and_tells_nothing_anew(
    pogon_server: Callable[..., PogonServer],
) -> None:
    modbus = find_port()
    first = pogon_server(serve_modbus=f"127.0.0.1:{modbus}")
    time.sleep(2)
    write(modbus, 1, MACHINE_FAULT, 4)
    stood = wait(lambda: read(first.data, "select alarm, occurrence, active, acked, first_true from alarm_state"))
    assert [row[0] for row in stood] == ["m1.overcurrent"]
    first.kill()
    assert read(first.data, "select alarm, occurrence, active, acked, first_true from alarm_state") == stood

    second = pogon_server(data=first.data)
    events = "select event from alarm_journal where alarm = 'm1.overcurrent' order by seq"
    told = wait(lambda: [event for (event,) in read(second.data, events)][1:])
    # the plant of the second server is a new one and runs: the trip is over, nothing was told twice
    assert told[0] == "RESTORED"
    wait(lambda: [event for (event,) in read(second.data, events)] == ["RAISED", "RESTORED", "RTN"])
    ((occurrence, acked),) = read(
        second.data, "select occurrence, acked from alarm_state where alarm = 'm1.overcurrent'"
    )
    assert (occurrence, acked) == (stood[0][1], 0), "it still waits for somebody"
    numbers = [seq for (seq,) in read(second.data, "select seq from alarm_journal order by seq")]
    assert numbers == list(range(1, len(numbers) + 1))
