"""Browsers in a process of their own: sockets that subscribe, take every frame off the wire, and note when it came.

They do no more than that, so that as many as possible fit on the second core. Lines in: `open N KIND SID,SID…`
(as people who are signed in, in turns; without any, bytes are all that is taken), `measure SECONDS`, `watch SECONDS
HANDLE` (notes each value of one tag on each socket), `close`.
"""

import asyncio
import base64
import os
import sys
import time
from functools import partial

import orjson

from benchmarks.common import lines_in, percentile, say


class Browser(asyncio.Protocol):
    """One socket."""

    def __init__(self, crowd: "Crowd", host: str, kind: str, sid: str) -> None:
        self.crowd = crowd
        self.host = host
        self.kind = kind
        self.sid = sid
        self.heard = bytearray()
        self.open = False
        self.transport: asyncio.Transport

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self.transport = transport  # type: ignore[assignment]
        if not self.kind:
            self.open = True
            self.crowd.ready += 1
            return
        key = base64.b64encode(os.urandom(16)).decode()
        self.transport.write(
            f"GET /live HTTP/1.1\r\nHost: {self.host}\r\nOrigin: http://{self.host}\r\nUpgrade: websocket\r\n"
            f"User-Agent: bench\r\nCookie: sid={self.sid}\r\n"
            f"Connection: Upgrade\r\nSec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n\r\n".encode()
        )

    def data_received(self, data: bytes) -> None:
        if not self.kind:
            self.crowd.bytes += len(data)
            return
        self.heard += data
        if not self.open:
            if b"\r\n\r\n" not in self.heard:
                return
            head, _, rest = bytes(self.heard).partition(b"\r\n\r\n")
            if b" 101 " not in head.split(b"\r\n")[0]:
                self.crowd.refused.append(head.split(b"\r\n")[0].decode())
                return
            self.heard = bytearray(rest)
            self.open = True
            self._say(orjson.dumps({"subscribe": self.kind, "rev": 0}))
        while (frame := self._frame()) is not None:
            self.crowd.take(self, frame)

    def _say(self, payload: bytes) -> None:
        self.transport.write(bytes((0x81, 0x80 | len(payload), 0, 0, 0, 0)) + payload)

    def _frame(self) -> bytes | None:
        heard = self.heard
        if len(heard) < 2:
            return None
        size, at = heard[1] & 0x7F, 2
        if size == 126:
            size, at = int.from_bytes(heard[2:4], "big"), 4
        elif size == 127:
            size, at = int.from_bytes(heard[2:10], "big"), 10
        if len(heard) < at + size:
            return None
        opcode, payload = heard[0] & 0x0F, bytes(heard[at : at + size])
        del heard[: at + size]
        if opcode == 9:
            self.transport.write(bytes((0x8A, 0x80 | len(payload), 0, 0, 0, 0)) + payload)
        return payload if opcode == 1 else b""


class Crowd:
    """All of them."""

    def __init__(self) -> None:
        self.browsers: list[Browser] = []
        self.ready = 0
        self.refused: list[str] = []
        self.bytes = self.frames = self.values = 0
        self.delays: list[float] = []
        self.handle = -1
        self.seen: list[tuple[float, int]] = []

    def take(self, browser: Browser, frame: bytes) -> None:
        now = time.time()
        if not frame:
            return
        if frame.startswith(b'{"hello"'):
            self.ready += 1
            return
        if frame.startswith(b'{"error"'):
            self.refused.append(frame.decode())
            return
        self.frames += 1
        self.bytes += len(frame)
        at = frame.find(b'"t":') + 4
        self.delays.append(now - int(frame[at : frame.find(b",", at)]) / 1e6)
        if self.handle >= 0:
            moment = time.monotonic()
            for handle, value, _ in orjson.loads(frame)["v"]:
                if handle == self.handle and value is not None:
                    self.seen.append((moment, int(value)))
        elif browser is self.browsers[0]:
            self.values += len(orjson.loads(frame)["v"])

    def forget(self) -> None:
        self.bytes = self.frames = self.values = 0
        self.delays, self.seen = [], []


async def _browse(port: int) -> None:
    crowd, loop = Crowd(), asyncio.get_running_loop()
    host = f"127.0.0.1:{port}"
    async for line in lines_in():
        word, *rest = line.split()
        if word == "open":
            crowd.ready = 0
            kind = rest[1] if len(rest) > 1 else ""
            sids = rest[2].split(",") if len(rest) > 2 else [""]
            for index in range(int(rest[0])):
                one = partial(Browser, crowd, host, kind, sids[index % len(sids)])
                _, browser = await loop.create_connection(one, "127.0.0.1", port)
                crowd.browsers.append(browser)
                if index % 20 == 19:
                    await asyncio.sleep(0.02)
            until = loop.time() + 20
            while (  # noqa: ASYNC110
                crowd.ready < int(rest[0]) and not crowd.refused and loop.time() < until
            ):
                await asyncio.sleep(0.05)
            say({"ready": crowd.ready, "refused": crowd.refused[:3]})
        elif word in ("measure", "watch"):
            crowd.handle = int(rest[1]) if word == "watch" else -1
            crowd.forget()
            cpu, began = time.process_time(), time.monotonic()
            await asyncio.sleep(float(rest[0]))
            seconds = time.monotonic() - began
            delays = crowd.delays or [float("nan")]
            say(
                {
                    "seconds": seconds,
                    "cpu": (time.process_time() - cpu) / seconds,
                    "frames": crowd.frames,
                    "bytes": crowd.bytes,
                    "values": crowd.values,
                    "median": percentile(delays, 50),
                    "p99": percentile(delays, 99),
                    "seen": crowd.seen,
                }
            )
        elif word == "close":
            for browser in crowd.browsers:
                browser.transport.close()
            crowd.browsers.clear()
            await asyncio.sleep(0.5)
            say("closed")


def main() -> None:
    """`crowd PORT`"""
    asyncio.run(_browse(int(sys.argv[1])))
