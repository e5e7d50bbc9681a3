"""What every request and every answer goes through: host, size, headers, and what is said when something breaks.

The order matters: this is the outermost layer, so that its headers are also on errors, static files and refusals.

Behind a TLS proxy set POGON_BEHIND_PROXY to the proxy's addresses: only from those are X-Forwarded-For and X-Forwarded-Proto believed
(`create_app` puts uvicorn's own layer around this one). The proxy must hand on the Host that the browser sent.
"""

import logging
import secrets
from collections.abc import Awaitable, Callable
from urllib.parse import urlsplit

from fastapi import Request
from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import ClientDisconnect
from starlette.responses import PlainTextResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

log = logging.getLogger(__name__)

LARGEST_BODY = 1024 * 1024
"""No form and no request of ours is longer [bytes]."""

POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; font-src 'self'; connect-src 'self'; "
    "form-action 'self'; base-uri 'none'; object-src 'none'; frame-ancestors 'none'; manifest-src 'self'"
)
ALWAYS = {
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "camera=(), microphone=(), geolocation=(), payment=(), usb=()",
}
UNLESS_SET = {"Content-Security-Policy": POLICY, "Cache-Control": "no-store"}
"""A page of others (the API pages) has its own policy, a static file its own cache rule."""
TLS_ONLY = ("Strict-Transport-Security", "max-age=31536000; includeSubDomains")

Broken = Callable[[Request, str], Awaitable[Response]]
"""Makes the answer for an error of ours; gets the reference that is also in the log."""


class Shield:
    """The layer around the application."""

    def __init__(self, app: ASGIApp, hosts: frozenset[str], broken: Broken) -> None:
        self._app = app
        self._hosts = hosts
        self._broken = broken

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "websocket":
            await self._socket(scope, receive, send)
        elif scope["type"] == "http":
            await self._request(scope, receive, send)
        else:
            await self._app(scope, receive, send)

    async def _request(self, scope: Scope, receive: Receive, send: Send) -> None:
        answer = _Answer(scope, send)
        host = host_of(scope)
        length = Headers(scope=scope).get("content-length", "0")
        if host not in self._hosts:
            text = f'Host "{host[:100]}" is not served here. POGON_ALLOWED_HOSTS names the hosts that are.'
            await PlainTextResponse(text, 400)(scope, receive, answer)
        elif not length.isdecimal() or int(length) > LARGEST_BODY:
            await _too_large()(scope, receive, answer)
        else:
            await self._guarded(scope, _Counted(receive, answer), answer)

    async def _guarded(self, scope: Scope, receive: Receive, answer: "_Answer") -> None:
        try:
            await self._app(scope, receive, answer)
        except ClientDisconnect:
            return
        except Exception:
            reference = secrets.token_hex(4)
            log.exception("request failed id=%s method=%s path=%s", reference, scope["method"], scope["path"])
            if answer.started:
                raise
            await (await self._broken(Request(scope), reference))(scope, receive, answer)
        if answer.too_large and not answer.started:
            await _too_large()(scope, receive, answer.anyway)

    async def _socket(self, scope: Scope, receive: Receive, send: Send) -> None:
        """A socket from a page of another site, or to a host that is not ours, is refused before it is open.

        Only browsers send an origin, and they always do; a program without one has no cookie to be abused either.
        """
        headers = Headers(scope=scope)
        origin = headers.get("origin")
        if host_of(scope) not in self._hosts or (
            origin is not None and urlsplit(origin).netloc.lower() != headers.get("host", "").lower()
        ):
            await send({"type": "websocket.close", "code": 1008})
            return
        await self._app(scope, receive, send)


class _Answer:
    """Sends what the application answers, with our headers; remembers whether it has begun."""

    def __init__(self, scope: Scope, send: Send) -> None:
        self.started = False
        self.too_large = False
        self._secure = scope.get("scheme") == "https"
        self._send = send

    async def __call__(self, message: Message) -> None:
        if self.too_large and not self.started:
            return  # what it makes of half a body is not wanted
        await self.anyway(message)

    async def anyway(self, message: Message) -> None:
        if message["type"] == "http.response.start":
            self.started = True
            headers = MutableHeaders(scope=message)
            for name, value in ALWAYS.items():
                headers[name] = value
            for name, value in UNLESS_SET.items():
                headers.setdefault(name, value)
            if self._secure:
                headers[TLS_ONLY[0]] = TLS_ONLY[1]
        await self._send(message)


class _Counted:
    """Reads the body of a request that does not say how long it is, up to the limit."""

    def __init__(self, receive: Receive, answer: _Answer) -> None:
        self._receive = receive
        self._answer = answer
        self._read = 0

    async def __call__(self) -> Message:
        message = await self._receive()
        if message["type"] == "http.request":
            self._read += len(message.get("body", b""))
            if self._read > LARGEST_BODY:
                self._answer.too_large = True
                return {"type": "http.disconnect"}
        return message


def host_of(scope: Scope) -> str:
    """Host that the request names, lower case, without port; empty when it names none or two."""
    named = Headers(scope=scope).getlist("host")
    if len(named) != 1:
        return ""
    host = named[0].lower()
    return host[: host.index("]") + 1] if host.startswith("[") and "]" in host else host.partition(":")[0]


def _too_large() -> Response:
    return PlainTextResponse(f"A request may have {LARGEST_BODY} bytes.", 413, headers={"Connection": "close"})
