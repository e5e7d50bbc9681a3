"""Servers forked off a process that has read already what every Pogon reads: Python, templates, types, the tables of a database.

That is nine tenths of what a Pogon computes until its first page is there. Where pages are the subject a worker reads it once, and its
servers are light (tests/light.py); where a start or a disk is the subject a server is started as an operator does.
"""

import atexit
import gc
import json
import os
import select
import signal
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent


class Forked:
    """A server that was forked off; of `subprocess.Popen` it has what tests ask of a server."""

    def __init__(self, stem: "Stem", pid: int) -> None:
        self.pid = pid
        self.returncode: int | None = None
        self._stem = stem
        self._handle = os.pidfd_open(pid)  # of a process that nobody has reaped yet

    def poll(self) -> int | None:
        """With which code it ended, if it did; minus the number of the signal that ended it."""
        return self._ended(0)

    def wait(self, timeout: float | None = None) -> int:
        """The same, once it ended.

        Raises:
            subprocess.TimeoutExpired: it did not within `timeout` [s].
        """
        code = self._ended(timeout)
        if code is None:
            raise subprocess.TimeoutExpired("pogon run", timeout or 0.0)
        return code

    def send_signal(self, number: int) -> None:
        if self.poll() is None:
            signal.pidfd_send_signal(self._handle, number)

    def terminate(self) -> None:
        self.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)

    def _ended(self, limit: float | None) -> int | None:
        if self.returncode is None and _readable(self._handle, limit):
            self.returncode = self._stem.ask({"reap": self.pid})
            os.close(self._handle)
        return self.returncode


class Stem:
    """The process off which servers are forked. It ends with this one, and its servers with it."""

    def __init__(self) -> None:
        ours = {name: text for name, text in os.environ.items() if not name.startswith("POGON_")}
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.warm"],
            cwd=ROOT, env=ours, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
        atexit.register(self.end)

    def start(self, arguments: Sequence[str], environment: Mapping[str, str], output: Path) -> Forked:
        """`pogon run` with these arguments and this environment, which adds what it prints to `output`."""
        wanted = {"arguments": [*arguments], "environment": {**environment}, "output": str(output.absolute())}
        return Forked(self, self.ask(wanted))

    def ask(self, what: Mapping[str, Any]) -> int:
        """A number for a line."""
        assert self._process.stdin and self._process.stdout
        print(json.dumps(what), file=self._process.stdin, flush=True)
        return int(self._process.stdout.readline())

    def end(self) -> None:
        """End it and all that was forked off."""
        self._process.communicate()


@cache
def stem() -> Stem | None:
    """That of this process; none where the system has no handles of processes."""
    return Stem() if hasattr(os, "pidfd_open") else None


def _readable(handle: int, limit: float | None) -> bool:
    return bool(select.select([handle], [], [], limit)[0])


# ---- the process itself ----------------------------------------------------------------------------------


def _read_all() -> None:
    """What a server reads whatever its plant is."""
    import uvicorn

    from app import bundled
    from app.clock import SystemClock
    from app.main import create_app
    from app.plant.loader import read_plant
    from app.plant.texts import Texts
    from app.settings import Settings

    with tempfile.TemporaryDirectory(prefix="warm-") as folder:
        app = create_app(Settings(data=Path(folder)), SystemClock())
    environment = app.state.view._environment(Texts.read(), "en")
    for name in environment.list_templates(["html"]):
        environment.get_template(name)
    read_plant(bundled("plants/demo"))
    uvicorn.Config(app, ws="websockets-sansio").load()


def _serve() -> None:
    """Answer each line of the standard input; returns in what was forked off, ready to be a server."""
    children: set[int] = set()
    for line in sys.stdin:
        asked = json.loads(line)
        if "reap" in asked:
            children.discard(asked["reap"])
            answer = os.waitstatus_to_exitcode(os.waitpid(asked["reap"], 0)[1])
        elif answer := os.fork():
            children.add(answer)
        else:
            return _become(asked)
        print(answer, flush=True)
    for child in children:
        os.kill(child, signal.SIGKILL)
    os._exit(0)


def _become(asked: Mapping[str, Any]) -> None:
    for number, path, flags in (
        (0, os.devnull, os.O_RDONLY),
        (1, asked["output"], os.O_WRONLY | os.O_CREAT | os.O_APPEND),
    ):
        file = os.open(path, flags, 0o666)
        os.dup2(file, number)
        os.close(file)
    os.dup2(1, 2)
    os.environ.clear()
    os.environ.update(asked["environment"])
    sys.argv = ["pogon", "run", *asked["arguments"]]


if __name__ == "__main__":
    from app.cli import main
    from tests.light import light

    with light():
        _read_all()
        gc.collect()
        gc.freeze()
        _serve()
        main()
