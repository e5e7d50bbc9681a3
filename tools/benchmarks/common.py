"""What all measurements share: rows of the table, helper processes, CPU time, a plant of many drives."""

import asyncio
import json
import os
import socket
import statistics
import sys
import time
from asyncio.subprocess import PIPE, Process
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path

from app.plant.events import Ring

ROOT = Path(__file__).resolve().parents[2]
BENCH = ROOT / "tools" / "bench.py"
TICKS = os.sysconf("SC_CLK_TCK")


@dataclass(frozen=True, slots=True)
class Row:
    """One figure."""

    what: str
    measured: str
    target: str = ""
    bare: str = ""
    """The bare loop of the same run, and what it is."""
    ratio: float | None = None
    """Measured / bare."""
    met: bool | None = None
    """Whether the target is met; None where there is none."""
    note: str = ""


RING = Ring("bench")


@dataclass(frozen=True, slots=True)
class DeviceEvent:
    """An event as a link delivers it (`RingEvent`)."""

    sequence: int
    time: int
    code: int
    source: int
    value: float
    snapshot: Sequence[int]
    boot: int = 1
    request: int = 0
    ring: Ring = RING


def timed(work: Callable[[], object], times: int = 15) -> float:
    """CPU time of one of them [s]: what the others on the machine do does not count."""
    work()
    taken = []
    for _ in range(times):
        began = time.thread_time()
        work()
        taken.append(time.thread_time() - began)
    return median(taken)


def percentile(values: Sequence[float], percent: float) -> float:
    """The value below which `percent` of `values` lie."""
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, round(percent / 100 * (len(ordered) - 1)))]


def median(values: Sequence[float]) -> float:
    return statistics.median(values)


def milliseconds(seconds: float) -> str:
    return f"{1000 * seconds:.3g} ms" if seconds < 0.1 else f"{1000 * seconds:.0f} ms"


def thousands(number: float) -> str:
    """A count as people read it."""
    return f"{number:,.0f}".replace(",", " ")


def cpu_time(pid: int) -> float:
    """CPU time of a process so far, all threads [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS


def resident(pid: int) -> float:
    """Memory of a process that is in RAM [MB]."""
    for line in Path(f"/proc/{pid}/status").read_text().splitlines():
        if line.startswith("VmRSS:"):
            return int(line.split()[1]) / 1000
    raise LookupError("VmRSS")


def free_port() -> int:
    """A TCP port of loopback that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class Helper:
    """A process of ours: a line in, a line of JSON out."""

    def __init__(self, process: Process) -> None:
        self.process = process
        self.pid = process.pid

    async def ask(self, line: str = "", limit: float = 120.0) -> object:
        """Send `line` and take the answer."""
        assert self.process.stdin is not None and self.process.stdout is not None
        if line:
            self.process.stdin.write(line.encode() + b"\n")
        async with asyncio.timeout(limit):
            answer = await self.process.stdout.readline()
        if not answer:
            raise RuntimeError(f"helper process ended with {await self.process.wait()}")
        return json.loads(answer)


@asynccontextmanager
async def helper(name: str, *arguments: object) -> AsyncIterator[Helper]:
    """A module of this package, `name`, as a process; it is ended with the block."""
    process = await asyncio.create_subprocess_exec(
        sys.executable,
        str(BENCH),
        "--helper",
        name,
        *map(str, arguments),
        stdin=PIPE,
        stdout=PIPE,
        limit=1 << 26,
        cwd=ROOT,
    )
    try:
        yield Helper(process)
    finally:
        if process.returncode is None:
            process.terminate()
            try:
                await asyncio.wait_for(process.wait(), 10)
            except TimeoutError:
                process.kill()
                await process.wait()


def say(answer: object) -> None:
    """Answer the process that started this one."""
    assert sys.__stdout__ is not None
    sys.__stdout__.write(json.dumps(answer) + "\n")
    sys.__stdout__.flush()


async def lines_in() -> AsyncIterator[str]:
    """What the process that started this one says."""
    reader = asyncio.StreamReader()
    await asyncio.get_running_loop().connect_read_pipe(lambda: asyncio.StreamReaderProtocol(reader), sys.stdin)
    while line := await reader.readline():
        yield line.decode().strip()


def write_plant(folder: Path, drives: int, port: int, links: int = 4) -> Path:
    """A plant of E800 drives `d1` … behind `links` sockets to one server."""
    parts = [
        '[plant]\nname = { en = "Bench" }\ntimezone = "UTC"\nlanguages = ["en"]\n[areas.drives]\nlabel = { en = "Drives" }\n'
    ]
    for link in range(links):
        parts.append(f'[links.l{link}]\ntransport = "tcp"\nhost = "127.0.0.1"\nport = {port}\nwrites = true\n')
    for drive in range(1, drives + 1):
        parts.append(
            f'[equipment.d{drive}]\ntype = "eura_e800"\nlink = "l{drive % links}"\nunit = {drive}\n'
            f'label = {{ en = "Drive {drive}" }}\narea = "drives"\n'
        )
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "plant.toml").write_text("".join(parts))
    return folder
