"""docs/connect-e800.md, the part without a drive: its commands in their order, typed as they stand there."""

import json
import os
import re
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from tests.conftest import ROOT, find_port

pytestmark = pytest.mark.real_time
PAGE = (ROOT / "docs" / "connect-e800.md").read_text("utf-8")
SECTION = PAGE.partition("## Try it without a drive\n")[2].partition("\n## ")[0]
BLOCKS = re.findall(r"```(\w*)\n(.*?)```", SECTION, re.DOTALL)
SHOWN, PTY, PORT = "rtu /dev/pts/3 9600 baud parity none", "/dev/pts/3", "1502"
LIMIT = 90.0
OVERCURRENT = 0x04
"""Status of a drive that tripped so."""


class Room:
    """A folder with the plant of the page and a `pogon` to type."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.pty, self.port, self.web = folder, PTY, find_port(), find_port()
        (folder / "plants" / "press_shop").mkdir(parents=True)
        toml = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)[0]
        (folder / "plants" / "press_shop" / "plant.toml").write_text(toml, "utf-8")
        (folder / "bin").mkdir()
        (folder / "bin" / "pogon").write_text(f'#!/bin/sh\nexec "{sys.executable}" -m app.cli "$@"\n', "utf-8")
        (folder / "bin" / "pogon").chmod(0o755)
        clean = {name: value for name, value in os.environ.items() if not name.startswith("POGON_")}
        path = f"{folder / 'bin'}:{os.environ['PATH']}"
        self.surroundings = clean | {"PATH": path, "PYTHONPATH": str(ROOT), "POGON_PORT": str(self.web)}

    def typed(self, line: str) -> str:
        """`line` of the page with the terminal and the port that are ours this time."""
        return line.replace(PTY, self.pty).replace(f"127.0.0.1:{PORT}", f"127.0.0.1:{self.port}")

    def run(self, line: str) -> str:
        done = subprocess.run(
            ["/bin/sh", "-c", self.typed(line)],
            cwd=self.folder,
            env=self.surroundings,
            capture_output=True,
            text=True,
            timeout=LIMIT,
            check=False,
        )
        assert (done.returncode, done.stderr) == (0, ""), f"{line}: {done.stdout}{done.stderr}"
        return done.stdout

    @contextmanager
    def running(self, line: str) -> Iterator[Path]:
        """The command until the end of the block; the file that has what it says."""
        said = self.folder / f"said-{len(list(self.folder.iterdir()))}"
        with said.open("w") as log:
            process = subprocess.Popen(
                ["/bin/sh", "-c", re.sub(r"\bpogon ", "exec pogon ", self.typed(line))],
                cwd=self.folder,
                env=self.surroundings,
                stdout=log,
                stderr=subprocess.STDOUT,
            )
        try:
            yield said
        finally:
            process.terminate()
            process.wait(LIMIT)

    def tag(self, name: str) -> dict[str, Any]:
        """What a visitor reads; empty while nobody answers."""
        try:
            with urllib.request.urlopen(f"http://127.0.0.1:{self.web}/api/v1/tags/{name}", timeout=10) as answer:
                return json.load(answer)  # type: ignore[no-any-return]
        except (urllib.error.URLError, ConnectionError):
            return {}

    def until(self, name: str, quality: str, value: float | None = None) -> dict[str, Any]:
        end = time.monotonic() + LIMIT
        while (found := self.tag(name)).get("quality") != quality or value not in (None, found["value"]):
            assert time.monotonic() < end, f"{name}: {found}, expected {quality}"
            time.sleep(0.1)
        return found


def lines(number: int) -> list[str]:
    """The commands of a block of the section."""
    return BLOCKS[number][1].strip().splitlines()


def test_what_the_page_shows_without_a_drive_is_what_happens(tmp_path: Path) -> None:
    assert [kind for kind, _ in BLOCKS] == ["sh", "", "sh", "", "sh", "sh"]
    room = Room(tmp_path)
    with room.running(lines(0)[0]) as simulated:
        end = time.monotonic() + LIMIT
        while len(said := simulated.read_text().splitlines()) < len(lines(1)):
            assert time.monotonic() < end, said
            time.sleep(0.1)
        room.pty = said[2].split()[1]
        assert said == [room.typed(line) for line in lines(1)] and SHOWN in lines(1)
        for command in lines(2):
            assert room.run(command.replace("--unit 1-5", "--unit 1-2 --baud 9600")).startswith(lines(3)[0])
        prepared, checked = lines(4)[:2], lines(4)[2]
        for command in prepared:
            room.run(command)
        assert "no problems" in room.run(checked)
        with room.running(lines(4)[3]):
            found = room.until("m1.frequency", "good")
            assert (found["value"], found["origin"]) == (0.0, ["simulated"])
            cable, overcurrent, clear = lines(5)
            room.run(cable)
            room.until("m1.frequency", "bad:comm_failure")
            room.run(clear)
            room.until("m1.frequency", "good")
            room.run(overcurrent)
            room.until("m1.status", "good", OVERCURRENT)
