"""The product itself in a process, with two additions: more sockets than a real server takes, and somebody who clicks.

Lines in: `ready` (answers once every link is up, with the cookies of people who are signed in), `clicks N` (gives N commands over HTTP,
answers their moments and values).
"""

import asyncio
import logging
import sys
import time
from collections.abc import Sequence
from io import StringIO
from pathlib import Path
from urllib.parse import urlencode

import uvicorn

from app.access.access import Access
from app.access.roles import Person, permissions_of
from app.access.signin import SignedIn
from app.links.statistics import LinkState
from app.main import create_app
from app.settings import Settings
from app.web.serve import Server
from app.web.socket import sockets_of
from benchmarks.common import lines_in, say

BOSS = Person(0, "boss", "boss", frozenset({"admin"}), permissions_of({"admin"}), "")
AGENT = "bench"
PASSWORD = "tri plave ladice u kutu"
PEOPLE = 12
"""Signed in; their browsers share them."""
CLICKING = 5
"""Of them, people who give commands."""
PACE = 0.055
"""Between two clicks [s]: five people stay below five commands a second each."""


async def _serve(plant: Path, data: Path, port: int) -> None:
    settings = Settings(plant=plant, data=data, port=port, log_level="error")
    app = create_app(settings)
    sockets = sockets_of(app)
    sockets.most = sockets.per_session = 5000
    config = uvicorn.Config(app, port=port, log_level="error", ws_max_size=65536, proxy_headers=False)
    server = Server(config, app, settings)
    serving = asyncio.create_task(server.serve())
    people: list[str] = []
    async for line in lines_in():
        word, _, rest = line.partition(" ")
        if word == "ready":
            told = await _ready(server, app)
            people = people or [await _sign_in(app.state.runtime.access, n) for n in range(PEOPLE)]
            say({**told, "sids": people})
        elif word == "clicks":
            say(await _clicks(app, port, int(rest), people[:CLICKING]))
    server.should_exit = True
    await serving


async def _ready(server: Server, app: object) -> dict[str, int]:
    while not server.started:  # noqa: ASYNC110 — uvicorn has no event for it
        await asyncio.sleep(0.01)
    runtime = app.state.runtime  # type: ignore[attr-defined]
    while not all(  # noqa: ASYNC110
        link.statistics.state is LinkState.UP for link in runtime.links.values()
    ):
        await asyncio.sleep(0.05)
    return {"tags": len(runtime.tags), "handle": runtime.tags.handles.get("d1.counter", -1)}


async def _sign_in(access: Access, number: int) -> str:
    """The cookie of a new operator."""
    name = f"bench{number}"
    await access.people.add(BOSS, name, "", ("operator",))
    await asyncio.to_thread(access.people.set_password_now, BOSS, name, PASSWORD)
    signed_in = await access.sign_in.with_password(name, PASSWORD, "127.0.0.1", AGENT)
    assert isinstance(signed_in, SignedIn)
    return signed_in.sid


async def _clicks(app: object, port: int, number: int, sids: Sequence[str]) -> list[tuple[float, int, int, int]]:
    """(moment, unit, word, HTTP status) of each click: the new frequency of one drive after the other."""
    runtime = app.state.runtime  # type: ignore[attr-defined]
    access, gate = runtime.access, runtime.gate
    people = []
    for sid in sids:
        who = await access.sessions.find(sid, "127.0.0.1", AGENT)
        assert who is not None
        people.append((sid, who))
    machines = list(runtime.plant.equipment.values())
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    results = []
    for index in range(number):
        (sid, who), item = people[index % len(people)], machines[index % len(machines)]
        if gate.control.holder(item.id) is None:
            gate.control.take(who, item.id)
        word = 1000 + index
        form = urlencode(
            {
                "csrf": access.form_token(sid),
                "nonce": gate.nonces.issue(who.session),
                "id": f"click{index}",
                "argument": f"{word / 100:.2f}",
                "confirmed": "1",
            }
        )
        head = (
            f"POST /equipment/{item.id}/command/set_frequency HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n"
            f"Origin: http://127.0.0.1:{port}\r\nSec-Fetch-Site: same-origin\r\nUser-Agent: {AGENT}\r\nCookie: sid={sid}; lang=en\r\n"
            f"Content-Type: application/x-www-form-urlencoded\r\nContent-Length: {len(form)}\r\nHX-Request: true\r\n\r\n"
        )
        began = time.monotonic()
        writer.write((head + form).encode())
        answer = await reader.readuntil(b"\r\n\r\n")
        results.append((began, item.unit, word, int(answer.split()[1])))
        await _rest_of(reader, answer)
        await asyncio.sleep(max(0.0, PACE - (time.monotonic() - began)))
    writer.close()
    return results


async def _rest_of(reader: asyncio.StreamReader, head: bytes) -> bytes:
    lower = head.lower()
    if b"content-length:" in lower:
        size = int(lower.partition(b"content-length:")[2].split()[0])
        return await reader.readexactly(size)
    body = b""
    while size := int((await reader.readline()).strip() or b"0", 16):
        body += await reader.readexactly(size)
        await reader.readline()
    await reader.readline()
    return body


def main() -> None:
    """`server PLANT DATA PORT`"""
    logging.disable(logging.WARNING)
    sys.stdout = StringIO()  # the announcement is for people
    asyncio.run(_serve(Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3])))
