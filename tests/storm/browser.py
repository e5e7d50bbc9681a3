"""A browser of one person at the application itself: forms, answers, cookies, the socket of a page; no server and no wire between."""

import asyncio
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlencode

from fastapi import FastAPI

from tests.asgi import Unanswered, exchange, scope

FORM = "application/x-www-form-urlencoded"
SETTLES = 30.0
"""A request that is not answered by then never will be [s]."""


@dataclass(frozen=True)
class Answer:
    """What came back."""

    status: int
    headers: Mapping[str, str]
    body: bytes

    @property
    def text(self) -> str:
        return self.body.decode()


class Browser:
    """Cookies are kept, forms carry the token of the page that was seen."""

    def __init__(self, app: FastAPI, agent: str, address: str, bearer: str = "") -> None:
        """`bearer`: the token of a program, which has no cookies."""
        self.app = app
        self._bearer = bearer
        self.cookies: dict[str, str] = {}
        self._agent, self._address = agent, address

    async def get(self, path: str) -> Answer:
        """Open a page."""
        return await self._ask("GET", path, b"")

    async def post(self, path: str, form: Mapping[str, str | Sequence[str]]) -> Answer:
        """Send a form of ours."""
        bound = self.cookies.get("sid") or self.cookies.get("pre", "")
        access = self.app.state.runtime.access
        return await self._ask("POST", path, urlencode({"csrf": access.form_token(bound), **form}, True).encode())

    async def order(self, path: str, **body: object) -> Answer:
        """Ask for something as a program does."""
        return await self._ask("POST", path, json.dumps(body).encode(), "application/json")

    async def sign_in(self, name: str, password: str, code: str = "") -> bool:
        """Fill the sheet, and with `code` that for the second factor; whether there is a session now."""
        former = self.cookies.get("sid")
        done = await self._fill("/signin", name=name, password=password)
        if done.status == 303 and done.headers.get("location", "").startswith("/signin/code"):
            if self.cookies.get("sid", former) != former:
                raise Unanswered(f"{name} has a session before the code was given")
            done = await self._fill("/signin/code", code=code)
        return done.status == 303 and "sid" in self.cookies

    async def _fill(self, path: str, **form: str) -> Answer:
        """Open a sheet and send it."""
        sheet = await self.get(path)
        token = re.search(r'name="csrf" value="([^"]*)"', sheet.text)
        return await self._ask("POST", path, urlencode({"csrf": token[1] if token else "", **form}).encode())

    async def _ask(self, method: str, path: str, body: bytes, kind: str = FORM) -> Answer:
        try:
            status, pairs, content = await exchange(self.app, self._scope("http", path, method, kind), body, SETTLES)
        except Unanswered as error:
            raise Unanswered(f"{method} {path}: {error}") from error
        for name, value in pairs:
            if name == "set-cookie":
                self._keep(value)
        return Answer(status, dict(pairs), content)

    def _keep(self, cookie: str) -> None:
        name, _, value = cookie.partition(";")[0].partition("=")
        if not value or value == '""' or "max-age=0" in cookie.lower():
            self.cookies.pop(name.removeprefix("__Host-"), None)
        else:
            self.cookies[name.removeprefix("__Host-")] = value

    def _scope(self, kind: str, path: str, method: str = "GET", content: str = FORM) -> dict[str, Any]:
        headers = [("user-agent", self._agent), ("hx-request", "true")]
        if self._bearer:
            headers.append(("authorization", f"Bearer {self._bearer}"))
        if self.cookies:
            headers.append(("cookie", "; ".join(f"{name}={value}" for name, value in self.cookies.items())))
        if method == "POST":
            headers.append(("content-type", content))
        return scope(kind, method, path, headers, self._address)

    def socket(self) -> "PageSocket":
        """The socket of a page; it opens with `async with`."""
        return PageSocket(self.app, self._scope("websocket", "/live"))


class PageSocket:
    """What a page says and hears."""

    def __init__(self, app: FastAPI, scope: dict[str, Any]) -> None:
        self._app, self._scope = app, scope
        self._up: asyncio.Queue[dict[str, Any]] = asyncio.Queue()
        self.heard: list[dict[str, Any]] = []
        """Messages of the server, frames too."""
        self.frames = 0
        self.closed = False

    async def __aenter__(self) -> "PageSocket":
        self._up.put_nowait({"type": "websocket.connect"})
        self._task = asyncio.get_running_loop().create_task(self._app(self._scope, self._up.get, self._send))
        return self

    async def __aexit__(self, *args: Any) -> None:
        self._up.put_nowait({"type": "websocket.disconnect", "code": 1001})
        await asyncio.wait([self._task], timeout=SETTLES)
        self._task.cancel()
        await asyncio.gather(self._task, return_exceptions=True)

    async def _send(self, message: dict[str, Any]) -> None:
        if message["type"] == "websocket.close":
            self.closed = True
        if message["type"] == "websocket.send":
            told = json.loads(message.get("text") or message["bytes"])
            if "v" in told:
                self.frames += 1
            else:
                self.heard.append(told)

    def say(self, **message: Any) -> None:
        """One message of the page."""
        self._up.put_nowait({"type": "websocket.receive", "text": json.dumps(message)})
