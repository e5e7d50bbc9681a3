"""What every request and every answer goes through: host, kind and size of the body, headers, and what is said when something breaks.

The order matters: this is the outermost layer, so that its headers are also on errors, static files and refusals. No parser sees what is
refused here, so no body and no cookie costs more than reading it. How heads and connections are limited is in app/web/connections.py.
"""

import asyncio
import logging
import re
from collections.abc import Awaitable, Callable, Iterable

from fastapi import Request
from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import ClientDisconnect
from starlette.responses import JSONResponse, PlainTextResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app import chance

log = logging.getLogger(__name__)

LARGEST_BODY = 16 * 1024
"""No form and no request of ours is longer [bytes]."""
MOST_FIELDS = 500
"""Fields of a query."""
BODY_TIME = 10.0
"""A body that is not whole after this is not waited for [s]."""
CONTENT = re.compile(
    r"(?:application/x-www-form-urlencoded|application/json)[ \t]*(?:;[ \t]*charset=(?:utf-8|utf8|\"utf-8\")[ \t]*)?",
    re.IGNORECASE,
)
"""What a body may be: nobody uploads files here, and no other character set is decoded (decoding some of them takes minutes)."""
COOKIE = re.compile(rb"(?:__Host-)?(?:sid|pre|half)|pogon_[a-z]{1,20}")
"""Our own cookies. Those of others, which a browser sends to every port of a host, go no further."""
HOST = re.compile(r"(?P<host>\[[0-9a-f:.]{2,45}\]|[a-z0-9._-]{1,253})(?::[0-9]{1,5})?")
PLAIN = re.compile(rb"[\w.-]{1,100}")
"""What a cookie of ours holds."""

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
        headers = Headers(scope=scope)
        host, length = host_of(scope), headers.get("content-length", "0")
        if host not in self._hosts:
            text = f'Host "{host[:100]}" is not served here. POGON_ALLOWED_HOSTS names the hosts that are.'
            await PlainTextResponse(text, 400)(scope, receive, answer)
        elif scope["query_string"].count(b"&") >= MOST_FIELDS:
            await refusal(scope, 400)(scope, receive, answer)
        elif not is_content(headers):
            await refusal(scope, 415)(scope, receive, answer)
        elif not length.isdecimal() or len(length) > 9 or int(length) > LARGEST_BODY:
            await refusal(scope, 413)(scope, receive, answer)
        else:
            _keep_own_cookies(scope)
            await self._guarded(scope, _Counted(receive, answer), answer)

    async def _guarded(self, scope: Scope, receive: Receive, answer: "_Answer") -> None:
        try:
            await self._app(scope, receive, answer)
        except ClientDisconnect:
            pass
        except Exception:
            reference = chance.token_hex(4)
            log.exception("request failed id=%s method=%s path=%.200r", reference, scope["method"], scope["path"])
            if answer.started:
                raise
            await (await self._broken(Request(scope), reference))(scope, receive, answer)
        if answer.refused and not answer.started:
            await refusal(scope, answer.refused)(scope, receive, answer.anyway)

    async def _socket(self, scope: Scope, receive: Receive, send: Send) -> None:
        """A socket from a page of another site, or to a host that is not ours, is refused before it is open.

        Only browsers send an origin, and they always do; a program without one has no cookie to be abused either.
        """
        origin = Headers(scope=scope).get("origin")
        if host_of(scope) not in self._hosts or (origin is not None and not is_own_origin(scope, origin)):
            await send({"type": "websocket.close", "code": 1008})
            return
        _keep_own_cookies(scope)
        await self._app(scope, receive, send)


class _Answer:
    """Sends what the application answers, with our headers; remembers whether it has begun."""

    def __init__(self, scope: Scope, send: Send) -> None:
        self.started = False
        self.refused = 0
        """Status of what is answered in place of what the application makes of half a body."""
        self._secure = scope.get("scheme") == "https"
        self._send = send

    async def __call__(self, message: Message) -> None:
        if self.refused and not self.started:
            return
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
    """Reads the body of a request up to the limits of size and time, also when it does not say how long it is."""

    def __init__(self, receive: Receive, answer: _Answer) -> None:
        self._receive = receive
        self._answer = answer
        self._read = 0
        self._whole = False
        self._until = asyncio.get_running_loop().time() + BODY_TIME

    async def __call__(self) -> Message:
        if self._whole:
            return await self._receive()
        try:
            async with asyncio.timeout_at(self._until):
                message = await self._receive()
        except TimeoutError:
            return self._refuse(408)
        if message["type"] == "http.request":
            self._read += len(message.get("body", b""))
            self._whole = not message.get("more_body", False)
            if self._read > LARGEST_BODY:
                return self._refuse(413)
        return message

    def _refuse(self, status: int) -> Message:
        self._answer.refused = status
        return {"type": "http.disconnect"}


def is_content(headers: Headers) -> bool:
    """Whether the body of a request is of a kind that is read here; one without a body need not say."""
    named = headers.getlist("content-type")
    if headers.get("content-encoding", "identity") != "identity":
        return False
    return not named or (len(named) == 1 and (not named[0] or CONTENT.fullmatch(named[0]) is not None))


def host_of(scope: Scope) -> str:
    """Host that the request names, lower case, without port; empty when it names none, two, or anything beside host and port."""
    named = Headers(scope=scope).getlist("host")
    found = HOST.fullmatch(named[0].lower()) if len(named) == 1 else None
    return found["host"] if found else ""


def is_own_origin(scope: Scope, origin: str) -> bool:
    """Whether `origin` (`https://host:port`) is where this request went to: the same scheme, host and port."""
    scheme = "https" if scope.get("scheme") in ("https", "wss") else "http"
    named = Headers(scope=scope).getlist("host")
    return len(named) == 1 and origin.lower() == f"{scheme}://{named[0].lower()}"


def _keep_own_cookies(scope: Scope) -> None:
    """Leave of the cookies of a request those that we have set, as far as they can be ours."""
    headers: list[tuple[bytes, bytes]] = list(scope["headers"])
    if any(name == b"cookie" for name, _ in headers):
        own = b"; ".join(_own(value for name, value in headers if name == b"cookie"))
        scope["headers"] = [one for one in headers if one[0] != b"cookie"] + ([(b"cookie", own)] if own else [])


def _own(values: Iterable[bytes]) -> list[bytes]:
    found = []
    for value in values:
        for part in value.split(b";"):
            name, _, text = part.strip().partition(b"=")
            if COOKIE.fullmatch(name) and PLAIN.fullmatch(text):
                found.append(part.strip())
    return found


REFUSALS = {
    400: ("error.bad_request", "The request cannot be understood."),
    403: ("error.forbidden", "Requests come through the proxy that POGON_BEHIND_PROXY names."),
    408: ("error.too_slow", f"The body of a request has to be here within {BODY_TIME:g} s."),
    413: ("error.too_large", f"A request may have {LARGEST_BODY} bytes."),
    415: ("error.media", "A request is a form (application/x-www-form-urlencoded) or application/json, in utf-8."),
}
"""Status → key and words of what is said before anybody looks at the language of the asker."""


async def refuse(scope: Scope, receive: Receive, send: Send, status: int) -> None:
    """Refuse a request with our headers, for a layer around this one."""
    await refusal(scope, status)(scope, receive, _Answer(scope, send))


def refusal(scope: Scope, status: int) -> Response:
    """What a request reads that is refused before any parser sees it; the connection is closed, since its body was not read."""
    key, text = REFUSALS[status]
    headers = {"Connection": "close"}
    if scope["path"].startswith("/api/"):
        return JSONResponse({"error": key, "text": text}, status, headers)
    return PlainTextResponse(text, status, headers)
