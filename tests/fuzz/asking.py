"""One request as a server hands it to the application, whatever bytes it has; and a socket with what its page says."""

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any
from urllib.parse import quote, urlencode

from fastapi import FastAPI

from tests.asgi import Unanswered, exchange, scope
from tests.fuzz.values import CSRF, FRESH, NONCE

FORM, JSON, FILES = "application/x-www-form-urlencoded", "application/json", "multipart/form-data; boundary=B"
SETTLES = 60.0
"""A request that is not answered by then never will be [s, virtual]."""
TALKS = 1.5
"""A page stays with its socket for so long after its last word [s, virtual]."""


@dataclass(frozen=True)
class Request:
    """Everything that was drawn for it, so that a list with requests taken away is a list again."""

    who: str
    method: str
    """Of HTTP, or LIVE: a socket."""
    address: str
    """Quoted, with its query."""
    form: tuple[tuple[str, str], ...] = ()
    raw: bytes | None = None
    """A body that is no form."""
    kind: str = FORM
    fragment: bool = False
    """Whether htmx asks."""
    language: str = "en"
    said: tuple[str | bytes, ...] = ()
    """What the page says over its socket."""
    wait: float = 0.0
    """That passes before [s, virtual]."""

    def __str__(self) -> str:
        what = f"{self.who:8} {self.method:4} {self.address[:300]}"
        if self.said:
            return f"{what}  says {', '.join(f'{one!r:.120}' for one in self.said)}"
        if self.raw is not None:
            return f"{what}  {self.kind} {self.raw[:300]!r}"
        return f"{what}  {'&'.join(f'{name}={value!r:.120}' for name, value in self.form)}".rstrip()


@dataclass(frozen=True)
class Answer:
    """What came back."""

    status: int
    headers: dict[str, str]
    cookies: tuple[str, ...]
    body: bytes

    @property
    def content(self) -> str:
        return self.headers.get("content-type", "").partition(";")[0]

    @property
    def text(self) -> str:
        return self.body.decode()


def address(path: str, query: Sequence[tuple[str, str]] = ()) -> str:
    """`path` (each of its parts quoted already) with `query`; what is no text in UTF-8 goes as its bytes."""
    return path + ("?" + urlencode(query, errors="surrogatepass") if query else "")


def part(text: str) -> str:
    """`text` as one part of a path."""
    return quote(text.encode("utf-8", "surrogatepass"), safe="")


def body_of(request: Request, made: dict[str, str]) -> bytes:
    """The bytes of its body; `made` stands in for the marks."""
    if request.raw is not None:
        raw = request.raw
        for mark, value in made.items():
            raw = raw.replace(mark.encode(), value.encode())
        return raw
    return urlencode([(name, made.get(value, value)) for name, value in request.form], errors="surrogatepass").encode()


def needs(request: Request) -> set[str]:
    """Which marks are in it."""
    if request.raw is not None:
        return {mark for mark in (CSRF, NONCE, FRESH) if mark.encode() in request.raw}
    return {value for _, value in request.form} & {CSRF, NONCE, FRESH}


def _scope(kind: str, request: Request, headers: Sequence[tuple[str, str]]) -> dict[str, Any]:
    return scope(kind, request.method, request.address, [("accept", "text/html,*/*"), *headers])


async def ask(app: FastAPI, request: Request, headers: Sequence[tuple[str, str]], body: bytes) -> Answer:
    """Send it.

    Raises:
        Unanswered: nothing came in `SETTLES`, or the application raised.
    """
    asked = _scope("http", request, [*headers, ("content-length", str(len(body)))])
    status, pairs, content = await exchange(app, asked, body, SETTLES)
    return Answer(status, dict(pairs), tuple(value for name, value in pairs if name == "set-cookie"), content)


async def talk(app: FastAPI, request: Request, headers: Sequence[tuple[str, str]]) -> list[str]:
    """Open a socket, say everything and listen; returns what was heard.

    Raises:
        Unanswered: the application raised, or did not end when the page had gone.
    """
    up: asyncio.Queue[dict[str, Any]] = asyncio.Queue()
    heard: list[str] = []

    async def send(message: dict[str, Any]) -> None:
        if message["type"] == "websocket.send":
            heard.append(message.get("text") or message["bytes"].decode())

    up.put_nowait({"type": "websocket.connect"})
    for one in request.said:
        up.put_nowait({"type": "websocket.receive", "text" if isinstance(one, str) else "bytes": one})
    task = asyncio.ensure_future(app(_scope("websocket", request, headers), up.get, send))
    await asyncio.wait([task], timeout=TALKS)
    up.put_nowait({"type": "websocket.disconnect", "code": 1001})
    await asyncio.wait([task], timeout=SETTLES)
    if not task.done():
        task.cancel()
        raise Unanswered("a socket lives on without its page")
    if error := task.exception():
        raise Unanswered(f"{type(error).__name__}: {error}") from error
    return heard
