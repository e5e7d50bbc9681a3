"""A request as the server hands it to the application, with bytes that no client library would send, and what was read of its body."""

import asyncio
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

from fastapi.testclient import TestClient

Header = tuple[str, str]


@dataclass
class Knocked:
    """What came of it."""

    status: int = 0
    headers: dict[str, str] = field(default_factory=dict)
    body: bytes = b""
    taken: int = 0
    """Portions of the body that somebody read."""


def knock(
    client: TestClient,
    method: str,
    path: str,
    headers: Sequence[Header] = (),
    body: Iterable[bytes] = (),
    *,
    query: str = "",
    peer: str = "127.0.0.1",
    host: str = "127.0.0.1:8000",
) -> Knocked:
    """Ask the application of `client` on its loop; `body` is read portion by portion, and only as far as it is asked for."""
    names = {name.lower() for name, _ in headers}
    named = [("host", host)] * ("host" not in names) + [("origin", f"http://{host}")] * ("origin" not in names)
    scope: dict[str, Any] = {
        "type": "http",
        "asgi": {"version": "3.0"},
        "http_version": "1.1",
        "method": method,
        "scheme": "http",
        "path": path,
        "raw_path": path.encode("utf-8", "replace"),
        "query_string": query.encode("latin-1"),
        "root_path": "",
        "headers": [(name.lower().encode(), value.encode("latin-1")) for name, value in (*named, *headers)],
        "client": (peer, 50000),
        "server": ("127.0.0.1", 8000),
        "state": {},
    }
    out, portions, over = Knocked(), iter(body), False

    async def receive() -> dict[str, Any]:
        nonlocal over
        if over:  # it waits for the end of the connection, and that does not come
            await asyncio.Event().wait()
        out.taken += 1
        portion = next(portions, None)
        over = portion is None
        return {"type": "http.request", "body": portion or b"", "more_body": portion is not None}

    async def send(message: dict[str, Any]) -> None:
        if message["type"] == "http.response.start":
            out.status = message["status"]
            out.headers = {name.decode().lower(): value.decode() for name, value in message["headers"]}
        else:
            out.body += message.get("body", b"")

    assert client.portal is not None
    client.portal.call(client.app, scope, receive, send)
    return out
