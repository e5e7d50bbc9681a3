"""A serial line on which nothing is understood says what is likely wrong: speed, parity, wires."""

import os
import struct
from typing import Any

import pytest

from app.links import port_errors as counting
from app.links.port_errors import PortErrors, port_errors


def test_the_numbers_of_the_driver_are_read_where_they_stand(monkeypatch: pytest.MonkeyPatch) -> None:
    numbers = list(range(1000, 1020))
    asked = []

    def ioctl(port: int, request: int, room: bytes) -> bytes:
        asked.append((port, request, len(room)))
        return struct.pack("20i", *numbers)

    class Port:
        def fileno(self) -> int:
            return 7

    monkeypatch.setattr(counting.fcntl, "ioctl", ioctl)
    assert port_errors(Port()) == PortErrors(parity=1008, framing=1006)
    assert asked == [(7, 0x545D, 80)]


def test_a_port_that_counts_nothing_says_so() -> None:
    ours, theirs = os.openpty()

    class Port:
        def fileno(self) -> int:
            return theirs

    assert port_errors(Port()) is None
    os.close(ours)
    os.close(theirs)
    closed: Any = Port()
    assert port_errors(closed) is None


def test_counters_that_a_driver_began_anew_are_not_negative() -> None:
    assert PortErrors(2, 3).since(PortErrors(10, 1)) == PortErrors(0, 2)
