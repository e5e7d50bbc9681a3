"""Hours of use by people: a server in a process of its own, browsers, commands, exports, and what it costs from minute to minute.

Samples of memory, threads, open files and sizes of the databases go to a CSV; their slopes are printed at the end, and a memory that
grows by more than 5 MB an hour once it has settled is a failure.

python tools/soak.py [--hours H] [--browsers N] [--out FILE.csv] [--seed S] [--port P]
"""

import argparse
import asyncio
import contextlib
import csv
import os
import re
import socket
import sys
import time
from collections import Counter
from collections.abc import Awaitable, Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from random import Random
from subprocess import Popen
from tempfile import TemporaryDirectory

import httpx2 as httpx
import orjson
import websockets
from websockets.typing import Origin

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from app.access.access import Access, prepare  # noqa: E402
from app.access.roles import ROLES, Person, permissions_of  # noqa: E402
from app.access.tokens import GRANTABLE  # noqa: E402
from app.cli_access import terminal  # noqa: E402
from app.clock import SystemClock  # noqa: E402
from app.db import Database  # noqa: E402
from app.web.language import COOKIE as LANGUAGE  # noqa: E402

PASSWORD = "tri plave ladice u kutu"
SETTLED = 1800.0
"""From here on a slope means something [s]; before, each page and each statement is met for the first time."""
STEEPEST = 5.0
"""Growth of the memory that is still level [MB/h]."""
FIGURES = ("rss_mb", "threads", "files", "pogon_mb", "history_mb", "wal_mb", "written_mb", "cpu_s")
MACHINES = ("m1", "m2", "c1", "cc1", "seq1")
PAGES = (
    "/", "/alarms", "/alarms/summary", "/trends", "/records/passage", "/records/run", "/records/force", "/records/coil",
    "/events", "/audit", "/storage", "/communication", "/forces", "/users",
    "/account", "/tokens", *(f"/equipment/{key}" for key in MACHINES),
)  # fmt: skip
LANGUAGES = ("hr", "en", "de", "cs")


class Crew:
    """Everybody who uses the server."""

    def __init__(self, url: str, token: str, browsers: int, seed: int) -> None:
        self.url = url
        self.browsers = browsers
        self.chance = Random(seed)
        self.done: Counter[str] = Counter()
        self.odd: Counter[str] = Counter()
        self.api = httpx.AsyncClient(base_url=url, headers={"Authorization": f"Bearer {token}"}, timeout=60)
        self.client = httpx.AsyncClient(base_url=url, headers={"Origin": url}, timeout=60, follow_redirects=True)

    async def work(self) -> None:
        """All of it, for ever."""
        await self.sign_in(self.client)
        async with asyncio.TaskGroup() as group:
            for index in range(self.browsers):
                group.create_task(self.keep(f"browser {index % 6}", self.browse, 0.5))
            for what, pause in (
                (self.look, 1.5),
                (self.command, 2.0),
                (self.trend, 4.0),
                (self.alarms, 10.0),
                (self.export, 30.0),
                (self.newcomer, 60.0),
            ):
                group.create_task(self.keep(what.__name__, what, pause))

    async def keep(self, name: str, what: Callable[[], Awaitable[None]], pause: float) -> None:
        while True:
            try:
                await what()
                self.done[name] += 1
            except (httpx.HTTPError, websockets.WebSocketException, OSError, TimeoutError) as error:
                self.odd[f"{name}: {type(error).__name__} {error}"[:100]] += 1
                await asyncio.sleep(1)
            await asyncio.sleep(pause * self.chance.uniform(0.5, 1.5))

    async def sign_in(self, client: httpx.AsyncClient) -> None:
        sheet = await client.get("/signin")
        csrf = re.search(r'name="csrf" value="([^"]+)"', sheet.text)
        assert csrf, sheet.text[:500]
        given = {"csrf": csrf[1], "name": "boss", "password": PASSWORD, "next": "/"}
        answer = await client.post("/signin", data=given)
        assert "sid" in client.cookies or any("sid" in name for name in client.cookies), answer.text[:800]

    async def browse(self) -> None:
        """A page is watched for one to ten minutes."""
        kind = self.chance.choice(["overview", "overview", *(f"equipment/{key}" for key in MACHINES)])
        url = self.url.replace("http", "ws") + "/live"
        cookie = "; ".join(f"{name}={text}" for name, text in self.client.cookies.items())
        async with websockets.connect(
            url,
            origin=Origin(self.url),
            additional_headers={"Cookie": cookie},
            user_agent_header=self.client.headers["user-agent"],  # of another browser the session counts for nothing
            compression=None,
        ) as socket:
            await socket.send(orjson.dumps({"subscribe": kind, "rev": 0}).decode())
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(self.chance.uniform(60, 600)):
                    while True:
                        await socket.recv(decode=False)
                        self.done["frame"] += 1

    async def look(self) -> None:
        page = self.chance.choice(PAGES)
        headers = {"Cookie": "; ".join(f"{k}={v}" for k, v in self.client.cookies.items() if k != LANGUAGE)}
        headers["Cookie"] += f"; {LANGUAGE}={self.chance.choice(LANGUAGES)}"
        answer = await self.client.get(page, headers=headers)
        if answer.status_code != 200:
            self.odd[f"{page} {answer.status_code}"] += 1

    async def command(self) -> None:
        key = self.chance.choice(("m1", "m2"))
        await self.api.post(f"/api/v1/equipment/{key}/control/take")
        nonce = (await self.api.post("/api/v1/nonce")).json()["nonce"]
        order = {"id": f"soak{self.done['command']:08}", "nonce": nonce, "confirmed": True}
        word = self.chance.choice(("set_frequency", "set_frequency", "forward", "stop", "reset", "coast"))
        if word == "set_frequency":
            order["value"] = round(self.chance.uniform(5, 50), 2)
        answer = await self.api.post(f"/api/v1/equipment/{key}/commands/{word}", json=order)
        self.done[f"command {answer.status_code}"] += 1
        if self.chance.random() < 0.2:
            await self.api.post(f"/api/v1/equipment/{key}/control/release")

    async def trend(self) -> None:
        now = datetime.now(UTC)
        begin = now - timedelta(hours=self.chance.choice((0.05, 0.5, 4, 24)))
        tags = ",".join(self.chance.sample(("m1.speed", "m1.current", "m2.speed", "c1.belt_speed_1", "m1.torque"), 3))
        asked: dict[str, str | int] = {
            "tags": "m1.frequency,m1.current",
            "from": begin.isoformat(),
            "to": now.isoformat(),
            "width": 1600,
        }
        answer = await self.api.get("/api/v1/history", params=asked)
        self.done[f"trend {answer.status_code}"] += 1
        await self.client.get("/trends", params={"tags": tags})

    async def alarms(self) -> None:
        found = await self.api.get("/api/v1/alarms")
        waiting = (
            [one["occurrence"] for one in found.json() if isinstance(one, dict)][:50]
            if found.status_code == 200
            else []
        )
        if waiting:
            await self.api.post("/api/v1/alarms/acknowledge", json={"occurrences": waiting})
        await self.client.get("/alarms.csv")

    async def export(self) -> None:
        now = datetime.now(UTC)
        asked = {
            "tags": "m1.frequency,m1.current,c1.mode",
            "from": (now - timedelta(hours=1)).isoformat(),
            "to": now.isoformat(),
            "interval": self.chance.choice((0, 1)),
            "locale": "machine",
        }
        answer = await self.client.get("/history/export.csv", params=asked)
        self.done[f"export {answer.status_code}"] += 1

    async def newcomer(self) -> None:
        """Somebody signs in, looks around and goes."""
        async with httpx.AsyncClient(
            base_url=self.url, headers={"Origin": self.url}, timeout=60, follow_redirects=True
        ) as client:
            await self.sign_in(client)
            await client.get("/")


async def make_people(data: Path) -> str:
    """An account that may do all, and the secret of its token."""
    prepare(data)
    database = Database(data / "pogon.db", "pogon")
    database.migrate()
    access = Access(database, SystemClock(), data)
    access.people.add_now(terminal(), [("boss", "", tuple(ROLES))])
    access.people.set_password_now(terminal(), "boss", PASSWORD)
    account = access.people.now()[0]
    boss = Person(account.id, "boss", "boss", frozenset(ROLES), permissions_of(ROLES), "")
    await access.start("soak")
    _, secret = await access.tokens.create(boss, "soak", sorted(permissions_of(ROLES) & set(GRANTABLE)), 1)
    await access.stop()
    access.close()
    database.close()
    return secret


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


READINGS, APART = 8, 0.25
"""The least of so many readings [s] is the memory that is kept: who checks a password takes 64 MB for a moment (Argon2)."""


async def sample(pid: int, data: Path) -> dict[str, float]:
    """What the process and its files are now."""
    process = Path(f"/proc/{pid}")
    readings = []
    for _ in range(READINGS):
        status = dict(line.split(":", 1) for line in (process / "status").read_text().splitlines() if ":" in line)
        readings.append(int(status["VmRSS"].split()[0]))
        await asyncio.sleep(APART)
    written = dict(line.split(": ") for line in (process / "io").read_text().splitlines())
    fields = (process / "stat").read_text().rpartition(")")[2].split()

    def size(name: str) -> float:
        return sum(file.stat().st_size for file in data.glob(name)) / 1e6

    return {
        "rss_mb": min(readings) / 1000,
        "threads": int(status["Threads"]),
        "files": len(list((process / "fd").iterdir())),
        "pogon_mb": size("pogon.db"),
        "history_mb": size("history.db"),
        "wal_mb": size("*-wal"),
        "written_mb": int(written["wchar"]) / 1e6,
        "cpu_s": (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK"),
    }


def slope(rows: list[dict[str, float]], name: str) -> float:
    """Least squares, per hour."""
    if len(rows) < 3:
        return float("nan")
    hours = [row["seconds"] / 3600 for row in rows]
    middle, mean = sum(hours) / len(hours), sum(row[name] for row in rows) / len(rows)
    above = sum((hour - middle) * (row[name] - mean) for hour, row in zip(hours, rows, strict=True))
    return above / sum((hour - middle) ** 2 for hour in hours)


async def soak(seconds: float, browsers: int, out: Path, seed: int, port: int) -> int:
    with TemporaryDirectory(prefix="pogon-soak-") as name:
        data = Path(name) / "data"
        token = await make_people(data)
        url = f"http://127.0.0.1:{port}"
        given = {"POGON_DATA": str(data), "POGON_PORT": str(port), "POGON_LOG_LEVEL": "warning"}
        with (out.with_suffix(".log")).open("wb") as log:
            process = Popen(  # noqa: ASYNC220 — it is not waited for
                [sys.executable, "-m", "app.cli", "run"], cwd=ROOT, env=os.environ | given, stdout=log, stderr=log
            )
        try:
            async with httpx.AsyncClient() as client:
                for _ in range(300):
                    with contextlib.suppress(httpx.HTTPError):
                        if (await client.get(f"{url}/healthz")).status_code == 200:
                            break
                    await asyncio.sleep(0.2)
            crew = Crew(url, token, browsers, seed)
            work = asyncio.create_task(crew.work())
            rows: list[dict[str, float]] = []
            began = time.monotonic()
            with out.open("w", newline="") as file:
                table = csv.DictWriter(file, ["seconds", *FIGURES])
                table.writeheader()
                while time.monotonic() < began + seconds:
                    await asyncio.wait([work], timeout=min(60, seconds / 10))
                    if work.done():
                        work.result()
                    if process.poll() is not None:
                        print(f"the server ended with {process.returncode}, see {out.with_suffix('.log')}")
                        return 1
                    row = {"seconds": round(time.monotonic() - began, 1)} | await sample(process.pid, data)
                    rows.append(row)
                    table.writerow(row)
                    file.flush()
            work.cancel()
            await asyncio.gather(work, return_exceptions=True)
        finally:
            process.terminate()
            process.wait(30)
    settled = [row for row in rows if row["seconds"] >= min(SETTLED, seconds / 3)]
    print(f"{seconds / 3600:.2f} h, {browsers} browsers, {dict(sorted(crew.done.items()))}")
    for what, count in crew.odd.items():
        print(f"odd: {count} x {what}")
    print(f"{'':12} {'first':>10} {'settled':>10} {'last':>10} {'most':>10} {'per hour':>10}")
    for name in FIGURES:
        print(
            f"{name:12} {rows[0][name]:10.1f} {settled[0][name]:10.1f} {rows[-1][name]:10.1f} {max(row[name] for row in rows):10.1f} "
            f"{slope(settled, name):10.2f}"
        )
    if failed := [what for what in (*crew.odd, *crew.done) if re.search(r" 5\d\d$", what)]:
        print(f"answered with an error of the server: {', '.join(failed)}")
        return 1
    grows = slope(settled, "rss_mb")
    if seconds >= 2 * SETTLED and grows > STEEPEST:
        print(f"memory grows by {grows:.1f} MB an hour: expected at most {STEEPEST:g}")
        return 1
    return 0


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--hours", type=float, default=2.0)
    parser.add_argument("--browsers", type=int, default=20)
    parser.add_argument("--out", type=Path, default=ROOT / "build" / "soak.csv")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--port", type=int, default=0, help="0 takes a free one")
    given = parser.parse_args()
    given.out.parent.mkdir(exist_ok=True)
    sys.exit(asyncio.run(soak(3600 * given.hours, given.browsers, given.out, given.seed, given.port or free_port())))
