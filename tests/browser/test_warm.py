"""A server that was forked off (tests/warm.py) is a Pogon of its own."""

import os
import signal
from pathlib import Path

import pytest

from tests.browser.station import serving, small
from tests.warm import stem

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(not hasattr(os, "pidfd_open"), reason="this system has no handles of processes"),
]


def test_two_that_were_forked_off_share_nothing(tmp_path: Path) -> None:
    """Neither plant, nor chance, nor end."""
    folders = [tmp_path / name for name in ("one", "other")]
    for folder in folders:
        folder.mkdir()
    with serving(small(folders[0], "m1"), people={}) as one, serving(small(folders[1], "m2"), people={}) as other:
        assert one.process.pid != other.process.pid and one.port != other.port
        first, second = ((folder / "data" / "first-code").read_text("utf-8") for folder in folders)
        assert first and second and first != second
        assert one.process.poll() is None
        one.kill()
        assert one.process.poll() == one.process.wait() == -signal.SIGKILL
        assert other.process.poll() is None
        assert "Started server process" in other.log() and str(one.process.pid) not in other.log()
        assert other.stop() == other.process.returncode == -signal.SIGTERM


def test_one_that_cannot_start_says_why(tmp_path: Path) -> None:
    """With the exit code of the command line."""
    fork = stem()
    assert fork is not None
    process = fork.start((), {"POGON_PORT": "none"}, tmp_path / "log")
    assert process.wait(60) == 78
    assert "POGON_PORT" in (tmp_path / "log").read_text("utf-8")
