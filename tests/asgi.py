"""One request at the application itself, as a server hands it over: no server and no wire between."""

import asyncio
from collections.abc import Sequence
from typing import Any
from urllib.parse import unquote

from fastapi import FastAPI

HOST = "127.0.0.1:8000"
ORIGIN = f"http://{HOST}"


class Unanswered(Exception):
    """The application raised, or answered nothing in time."""


def scope(
    kind: str, method: str, address: str, headers: Sequence[tuple[str, str]], client: str = "127.0.0.1"
) -> dict[str, Any]:
    """What a server tells the application of a request, or of a socket that is opened (`kind`: http or websocket).

    `address` is quoted, with its query; it comes from HOST's own pages, and from the IP address `client`.
    """
    where, _, query = address.partition("?")
    named = [("host", HOST), ("origin", ORIGIN), *headers]
    return {
        "type": kind, "asgi": {"version": "3.0", "spec_version": "2.4"}, "http_version": "1.1", "method": method,
        "scheme": "http" if kind == "http" else "ws", "path": unquote(where), "raw_path": where.encode(), "root_path": "",
        "query_string": query.encode(), "headers": [(name.encode(), value.encode("latin-1")) for name, value in named],
        "client": (client, 50000), "server": ("127.0.0.1", 8000), "subprotocols": [], "state": {},
    }  # fmt: skip


async def exchange(
    app: FastAPI, asked: dict[str, Any], body: bytes, limit: float
) -> tuple[int, list[tuple[str, str]], bytes]:
    """Send it with this body; returns the status, every head with its name in small letters, and the body that came back.

    Raises:
        Unanswered: nothing came in `limit` [s], or the application raised.
    """
    sent: list[dict[str, Any]] = []
    given = [{"type": "http.request", "body": body, "more_body": False}]

    async def receive() -> dict[str, Any]:
        if given:
            return given.pop()
        await asyncio.sleep(1e9)
        return {"type": "http.disconnect"}

    async def send(message: dict[str, Any]) -> None:
        sent.append(message)

    try:
        async with asyncio.timeout(limit):
            await app(asked, receive, send)
    except TimeoutError as error:
        raise Unanswered(f"nothing in {limit:g} s") from error
    except Exception as error:
        raise Unanswered(f"{type(error).__name__}: {error}") from error
    start = next((one for one in sent if one["type"] == "http.response.start"), None)
    if start is None:
        raise Unanswered("no answer at all")
    pairs = [(name.decode("latin-1").lower(), value.decode("latin-1")) for name, value in start["headers"]]
    return start["status"], pairs, b"".join(one.get("body", b"") for one in sent)
