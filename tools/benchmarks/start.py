"""What a person waits for: the first page after a warm start, and what a browser without a cache has to fetch for it."""

import asyncio
import gzip
import os
import re
import sys
import time
import urllib.request
from pathlib import Path
from subprocess import DEVNULL, Popen
from tempfile import TemporaryDirectory
from urllib.error import HTTPError, URLError
from urllib.parse import urljoin

from benchmarks.common import ROOT, Row, cpu_time, free_port, median

TIMES = 5
BARE = """
import sys, uvicorn
from fastapi import FastAPI
app = FastAPI()
@app.get("/")
def page(): return "page"
uvicorn.run(app, port=int(sys.argv[1]), log_level="error")
"""
LINKED = re.compile(
    r"""(?:src|href)="([^"]+\.(?:css|js|svg|woff2|png|ico|webmanifest)[^"#]*)|url\(["']?([^"')#]+)|from ["']([^"']+)["']"""
)


def _fetch(url: str) -> tuple[bytes, dict[str, str]]:
    request = urllib.request.Request(url, headers={"Accept-Encoding": "gzip"})
    with urllib.request.urlopen(request, timeout=5) as answer:
        return answer.read(), {name.lower(): value for name, value in answer.headers.items()}


def _started(command: list[str], port: int, environment: dict[str, str]) -> tuple[float, float, Popen[bytes]]:
    """Seconds, and seconds of CPU, from the start of the process to its first page."""
    began = time.perf_counter()
    process = Popen(command, cwd=ROOT, env=environment, stdout=DEVNULL, stderr=DEVNULL)
    while True:
        try:
            _fetch(f"http://127.0.0.1:{port}/")
            return time.perf_counter() - began, cpu_time(process.pid), process
        except (URLError, HTTPError, ConnectionError):
            if process.poll() is not None:
                raise RuntimeError(f"{command[1:3]} ended with {process.returncode}") from None
            if time.perf_counter() - began > 30:
                process.kill()
                raise
            time.sleep(0.005)


def _weight(base: str) -> tuple[int, int, int]:
    """Bytes that a browser without a cache transfers for the page, what they are with gzip, number of requests."""
    waiting, done, sent, zipped = [base], set[str](), 0, 0
    while waiting:
        url = waiting.pop()
        if url in done or not url.startswith(base):
            continue
        done.add(url)
        body, headers = _fetch(url)
        sent += len(body)
        packed = headers.get("content-encoding") == "gzip"
        text = gzip.decompress(body) if packed else body
        binary = url.partition("?")[0].endswith((".woff2", ".png", ".ico"))
        zipped += len(body) if packed or binary else len(gzip.compress(text, 6))
        if not binary:
            for found in LINKED.findall(text.decode("utf-8", "replace")):
                link = next(part for part in found if part)
                if not link.startswith("data:"):
                    waiting.append(urljoin(url, link))
    return sent, zipped, len(done)


def _measure() -> list[Row]:
    with TemporaryDirectory() as folder:
        clean = {name: value for name, value in os.environ.items() if not name.startswith("POGON_")}
        times, works, weight = [], [], (0, 0, 0)
        for number in range(TIMES + 1):
            port = free_port()
            environment = clean | {"POGON_DATA": folder + "/data", "POGON_PORT": str(port)}
            took, work, process = _started([sys.executable, "-m", "app.cli", "run"], port, environment)
            if number:  # the first one is cold: it makes the databases
                times.append(took)
                works.append(work)
            else:
                weight = _weight(f"http://127.0.0.1:{port}/")
            process.terminate()
            process.wait(15)
        bare = []
        script = Path(folder) / "bare.py"
        script.write_text(BARE)
        for _ in range(3):
            port = free_port()
            took, _, process = _started([sys.executable, str(script), str(port)], port, clean)
            bare.append(took)
            process.terminate()
            process.wait(15)
    ours, least = median(times), median(bare)
    sent, zipped, requests = weight
    return [
        Row(
            "warm start to the first page",
            f"{ours:.2f} s",
            "1 s",
            f"{least:.2f} s, FastAPI and uvicorn with one route",
            ours / least,
            ours <= 1.0,
            f"the demo plant by `pogon run`, median of {TIMES}, from the start of the process; "
            f"{median(works):.2f} s of CPU",
        ),
        Row(
            "cold page weight",
            f"{zipped / 1000:.0f} KB gzip",
            "150 KB gzip",
            "",
            None,
            zipped <= 150_000,
            f"overview of the demo plant with everything it links to, {requests} requests; this server sends {sent / 1000:.0f} KB for it"
            + (" (a proxy has to compress)" if sent > 1.1 * zipped else ""),
        ),
    ]


async def measure() -> list[Row]:
    return await asyncio.to_thread(_measure)
