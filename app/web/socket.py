"""The socket of a page: `/live` carries what its tags do, and nothing else.

    browser → {"subscribe": kind, "rev": n}          first, and again after a new revision
    server  → {"hello": {"kind", "rev", "handles": {name: handle}, "build", "who"}}, then frames (live/frames.py), the first one full
    browser → {"snapshot": true}                     after a gap in `n`: the next frame is full
    browser → {"hold": {"equipment", "lease", "counter"}}   every 150 ms while a hold-to-run button is held; the first one starts the motion
    browser → {"hold": {"equipment", "lease", "release": cause}}
    server  → {"hold": {"lease", "counter"}}, with "over": words when the motion ended or never began
    server  → {"error": code}, then it closes: bad_message, unknown_kind, not_allowed, too_large, too_fast, too_many_tags,
                                                          unavailable

`who` is the name of whoever is signed in, empty for nobody; it is left out while the database does not say.

The route asks for host, origin, number of sockets and the right to the page at opening, and for the right again every 30 s.
"""

import asyncio
import contextlib
import logging
from collections import Counter
from collections.abc import Awaitable, Callable, Collection
from typing import Any

import orjson
from fastapi import APIRouter, Request
from starlette.requests import HTTPConnection
from starlette.responses import PlainTextResponse
from starlette.websockets import WebSocket, WebSocketDisconnect

from app.access.roles import Person
from app.addresses import client_of
from app.commands.gate import Gate
from app.commands.hold import CAUSES
from app.errors import Refused
from app.live.frames import Live, Watcher
from app.running.page_tags import page_tags
from app.web.guard import address_of, allow, permission_of_point
from app.web.operation import Operation
from app.web.security import host_of, is_own_origin

log = logging.getLogger(__name__)

MOST = 500
"""Sockets in all."""
MOST_GUESTS = 300
"""Of them, sockets of visitors without sign-in; the first to go when somebody who is signed in needs a place."""
MOST_PER_ADDRESS = 200
"""Of visitors at one address: a class of thirty behind one address, each with several tabs."""
MOST_PER_SESSION = 30
"""Tabs of one session."""
MESSAGES, AT_ONCE = 10.0, 30.0
"""A browser may send so many messages a second, and so many at once (a button that is held sends 7 a second)."""
LARGEST_MESSAGE = 4096
"""Of a browser [characters]; the server itself refuses a frame above 64 KB."""
TAGS, MOST_TAGS = "tags/", 200
"""A page of tags by name, and how many it may have."""
DIAGNOSIS = "communication"
"""A kind of page that shows what is not for everybody (app/access/roles.py)."""
RECHECK = 30.0
"""The right to the page is asked again after this [s]."""
FIRST_WORD = 10.0
"""A browser that has not subscribed by then is closed [s]."""
LAST_WORD = 0.2
"""A socket that is to be closed is told why within that, or not at all [s]."""
SLOWEST_SEND = 20.0
"""A browser that does not take one frame within this is closed [s]."""
TOLD_AGAIN = 60.0
"""Why the sockets of this server are refused is logged again after this [s]."""
NO_UPGRADE = (
    "expected a WebSocket: a proxy before this server has to pass Upgrade and Connection on (docs/operations.md)"
)
OTHER_ORIGIN = (
    "expected the origin of this host: a proxy has to pass Host and X-Forwarded-Proto on (docs/operations.md)"
)
POLICY = 1008
TOO_LARGE = 1009
GOING_AWAY = 1001
TRY_LATER = 1013

Guard = Callable[[WebSocket, str], Awaitable[bool]]
"""Whether whoever opened the socket may watch a kind of page, asked at each subscription and every 30 s."""

router = APIRouter()


async def guests_while_simulated(websocket: WebSocket, kind: str) -> bool:
    """Everybody may watch while every link of the plant says that it is simulated."""
    runtime = websocket.app.state.runtime
    return bool(runtime.simulated) or runtime.plant is None


class Sockets:
    """The open sockets of this server: how many there are, who may watch what."""

    def __init__(
        self,
        may_watch: Guard = guests_while_simulated,
        *,
        most: int = MOST,
        most_guests: int = MOST_GUESTS,
        per_address: int = MOST_PER_ADDRESS,
        per_session: int = MOST_PER_SESSION,
    ) -> None:
        self.may_watch = may_watch
        self.most = most
        self.most_guests = most_guests
        self.per_address = per_address
        self.per_session = per_session
        self.recheck = RECHECK
        self._told: dict[str, float] = {}
        self._open: dict[WebSocket, tuple[str, str]] = {}
        self._guests: dict[WebSocket, None] = {}
        self._count: Counter[tuple[str, str]] = Counter()
        self._closing: set[asyncio.Task[None]] = set()

    def __len__(self) -> int:
        return len(self._open)

    def enter(self, websocket: WebSocket, address: str, session: str = "") -> bool:
        """Count a socket in, of a session or of a guest at `address`; False when there are enough.

        Who is signed in takes the place of the guest who has been there longest.
        """
        who = ("session", session) if session else ("address", client_of(address))
        if self._count[who] >= (self.per_session if session else self.per_address):
            return False
        if not session and (len(self._guests) >= self.most_guests or len(self._open) >= self.most):
            return False
        if len(self._open) >= self.most:
            if not self._guests:
                return False
            oldest = next(iter(self._guests))
            self.leave(oldest)
            self._close_soon(oldest, TRY_LATER)
        self._open[websocket] = who
        self._count[who] += 1
        if not session:
            self._guests[websocket] = None
        return True

    def refuse(self, connection: HTTPConnection, why: str) -> None:
        """Log `why` no socket comes about, with what says so; the same once a minute, as every page asks again each second."""
        now = asyncio.get_running_loop().time()
        if now - self._told.get(why, -TOLD_AGAIN) < TOLD_AGAIN:
            return
        self._told[why] = now
        said = connection.headers
        log.warning(
            "socket refused scheme=%s host=%r origin=%r address=%s reason=%s",
            connection.scope["scheme"],
            said.get("host", ""),
            said.get("origin", ""),
            address_of(connection.scope),
            why,
        )

    def leave(self, websocket: WebSocket) -> None:
        """Count it out."""
        who = self._open.pop(websocket, None)
        self._guests.pop(websocket, None)
        if who is not None:
            self._count[who] -= 1
            if not self._count[who]:
                del self._count[who]

    def end(self, sessions: Collection[str]) -> None:
        """Close the sockets of sessions that are over, at once; each is told why, so that its page does not say that nobody answers."""
        for websocket in self._of(sessions):
            self._close_soon(websocket, POLICY, "not_allowed")

    def begin_anew(self, sessions: Collection[str]) -> None:
        """Close the sockets of sessions that have other rights now: their pages connect anew."""
        for websocket in self._of(sessions):
            self._close_soon(websocket, POLICY)

    def _of(self, sessions: Collection[str]) -> list[WebSocket]:
        people = ((websocket, getattr(websocket.state, "person", None)) for websocket in self._open)
        return [websocket for websocket, person in people if person is not None and person.session in sessions]

    def _close_soon(self, websocket: WebSocket, code: int, error: str = "") -> None:
        task = asyncio.get_running_loop().create_task(_close(websocket, code, error))
        self._closing.add(task)
        task.add_done_callback(self._closing.discard)

    async def close(self) -> None:
        """Close all sockets: the server ends."""
        for websocket in tuple(self._open):
            await _close(websocket, GOING_AWAY)


async def _close(websocket: WebSocket, code: int, error: str = "") -> None:
    if error:
        with contextlib.suppress(RuntimeError, WebSocketDisconnect, OSError, TimeoutError):
            async with asyncio.timeout(LAST_WORD):
                await websocket.send_text(orjson.dumps({"error": error}).decode())
    with contextlib.suppress(RuntimeError, WebSocketDisconnect):
        await websocket.close(code)


def sockets_of(app: Any) -> Sockets:
    """The sockets of an application; the first call makes them."""
    found: Sockets | None = getattr(app.state, "sockets", None)
    if found is None:
        found = app.state.sockets = Sockets()
    return found


@router.websocket("/live", dependencies=[allow("open")])  # each kind of page is asked for at subscribing
async def live(websocket: WebSocket) -> None:
    """One page of one browser."""
    runtime = websocket.app.state.runtime
    sockets = sockets_of(websocket.app)
    if not same_origin(websocket, runtime.settings.hosts):
        sockets.refuse(websocket, OTHER_ORIGIN)
        await websocket.close(POLICY)
        return
    person: Person | None = getattr(websocket.state, "person", None)
    if not sockets.enter(websocket, address_of(websocket.scope), person.session if person else ""):
        log.warning("socket refused open=%s", len(sockets))
        await websocket.close(TRY_LATER)
        return
    try:
        await websocket.accept()
        await _Conversation(websocket, sockets).run()
    finally:
        sockets.leave(websocket)


@router.get("/live", dependencies=[allow("open")])  # tells nothing
async def no_socket(request: Request) -> PlainTextResponse:
    """A socket whose wish to be one was lost on the road."""
    sockets_of(request.app).refuse(request, NO_UPGRADE)
    return PlainTextResponse(f"{NO_UPGRADE}\n", 426, {"Connection": "Upgrade", "Upgrade": "websocket"})


def same_origin(websocket: WebSocket, hosts: frozenset[str]) -> bool:
    """Whether a page of this very server opens the socket: its `Origin` is this `Host`, and that is one of `hosts`."""
    site = websocket.headers.get("sec-fetch-site", "same-origin")
    own = is_own_origin(websocket.scope, websocket.headers.get("origin", ""))
    return own and host_of(websocket.scope) in hosts and site == "same-origin"


class _Refuse(Exception):
    def __init__(self, error: str, code: int = POLICY) -> None:
        super().__init__(error)
        self.error = error
        self.code = code


class _TooSlow(Exception):
    """A browser did not take what was sent to it in time."""


class Allowance:
    """How many messages a browser may still send: some at once, then so many a second."""

    def __init__(self, now: float, rate: float = MESSAGES, at_once: float = AT_ONCE) -> None:
        self._rate, self._most = rate, at_once
        self._left, self._then = at_once, now

    def take(self, now: float) -> bool:
        """Whether one may come at `now` [s, of the loop]."""
        self._left = min(self._most, self._left + (now - self._then) * self._rate)
        self._then = now
        if self._left < 1:
            return False
        self._left -= 1
        return True


class _Conversation:
    """What goes to and fro on one socket: this task hears, a second one speaks."""

    def __init__(self, websocket: WebSocket, sockets: Sockets) -> None:
        self.websocket = websocket
        self.sockets = sockets
        self.runtime = websocket.app.state.runtime
        self.live: Live = self.runtime.live
        self.watcher: Watcher | None = None
        self.kind = self.asks = ""
        """What is watched; the kind of page whose right is asked for now and then."""
        self.speaker: asyncio.Task[None] | None = None
        person = getattr(websocket.state, "person", None)
        self.session: str = person.session if person is not None else ""
        self.allowance = Allowance(asyncio.get_running_loop().time())
        self.leases: set[str] = set()
        """Leases of hold-to-run that were kept alive here: they end with the socket."""

    @property
    def gate(self) -> Gate | None:
        """The gate of the plant as it runs now."""
        gate: Gate | None = getattr(self.runtime, "gate", None)
        return gate

    async def run(self) -> None:
        entered = self.gate if self.session else None
        if entered is not None:
            entered.control.socket_opened(self.session)
        try:
            async with asyncio.timeout(FIRST_WORD):
                await self.hear()
            while True:
                await self.hear()
        except _Refuse as refusal:
            await self.refuse(refusal)
        except TimeoutError:
            await self.refuse(_Refuse("bad_message"))
        except _TooSlow:
            await self.give_up()
        except (WebSocketDisconnect, RuntimeError):
            pass
        finally:
            self.let_go()
            if entered is not None:
                entered.control.socket_closed(self.session)
            await self.fall_silent()
            if self.watcher:
                self.live.leave(self.watcher)

    async def hear(self) -> None:
        """Take one message and do what it asks."""
        message = await self.websocket.receive()
        if message["type"] == "websocket.disconnect":
            raise WebSocketDisconnect(message.get("code", 1005))
        if not self.allowance.take(asyncio.get_running_loop().time()):
            raise _Refuse("too_fast", TRY_LATER)
        text = message.get("text")
        if text is None or len(text) > LARGEST_MESSAGE:
            raise _Refuse("too_large" if text else "bad_message", TOO_LARGE if text else POLICY)
        try:
            asked = orjson.loads(text)
        except orjson.JSONDecodeError:
            raise _Refuse("bad_message") from None
        match asked:
            case {"subscribe": str(kind)}:
                await self.subscribe(kind)
            case {"snapshot": True}:
                if self.watcher:
                    self.watcher.fall_behind()
            case {"hold": {"equipment": str(equipment), "lease": str(lease), "counter": int(counter)}}:
                await self.keep_alive(equipment, lease, counter)
            case {"hold": {"lease": str(lease), "release": str(cause)}}:
                self.release(lease, cause)
            case {"pong": _}:
                pass
            case _:
                raise _Refuse("bad_message")

    async def keep_alive(self, equipment: str, lease: str, counter: int) -> None:
        """A hold-to-run button is held down."""
        gate, answer = self.gate, {"lease": lease, "counter": counter}
        if gate is None or not self.session:
            raise _Refuse("not_allowed")
        try:
            gate.hold.keep_alive(lease, counter, self.session)
            self.leases.add(lease)
        except Refused as refusal:
            self.leases.discard(lease)
            answer["over"] = self.words(equipment, refusal)
        await self.send(orjson.dumps({"hold": answer}))

    def release(self, lease: str, cause: str) -> None:
        """The button is up."""
        self.leases.discard(lease)
        if self.gate is not None:
            with contextlib.suppress(Refused):
                self.gate.hold.release(lease, self.session, cause if cause in CAUSES else "released")

    def let_go(self) -> None:
        """The page is gone: what it held stops."""
        for lease in tuple(self.leases):
            self.release(lease, "closed")

    def words(self, equipment: str, refusal: Refused) -> str:
        """`refusal` in the language of the page."""
        plant = self.runtime.plant
        item = plant.equipment.get(equipment) if plant else None
        return Operation(self.websocket, item).words.refusal(refusal) if item else refusal.reason

    async def subscribe(self, kind: str) -> None:
        try:
            names = page_tags(kind, self.runtime.plant, self.runtime.points)
        except LookupError:
            raise _Refuse("unknown_kind") from None
        person: Person | None = getattr(self.websocket.state, "person", None)
        unread = getattr(self.websocket.state, "unread", False)
        if not await self.sockets.may_watch(self.websocket, kind):
            raise _Refuse("unavailable", TRY_LATER) if unread else _Refuse("not_allowed")
        told: dict[str, Any] = {} if unread else {"who": person.display if person else ""}
        self.asks = kind
        if kind.startswith(TAGS):
            told |= await self.sort_out(kind.removeprefix(TAGS))
            names = [name for name in names if name not in told.get("denied", ())]
        await self.fall_silent()
        if self.watcher:
            self.live.leave(self.watcher)
        self.kind = kind
        self.watcher = self.live.join(kind, names)
        handles = self.runtime.tags.handles
        hello = {
            "kind": kind,
            "rev": self.runtime.tags.revision,
            "handles": {name: handles[name] for name in names if name in handles},
            "build": getattr(getattr(self.websocket.app.state, "view", None), "build", ""),
        } | told
        await self.send(orjson.dumps({"hello": hello}))
        self.speaker = asyncio.create_task(self.speak(self.watcher))

    async def sort_out(self, text: str) -> dict[str, list[str]]:
        """Of tags that are asked for by name those that are `unknown`, and those `denied` because their page is not for everybody."""
        asked = list(dict.fromkeys(name for name in text.split(",") if name))
        if len(asked) > MOST_TAGS:
            raise _Refuse("too_many_tags")
        points = self.runtime.points
        unknown = [name for name in asked if name not in points]
        guarded = [name for name in asked if name in points and permission_of_point(points[name]) != "view"]
        if guarded and await self.sockets.may_watch(self.websocket, DIAGNOSIS):
            self.asks, guarded = DIAGNOSIS, []
        if guarded and len(guarded) + len(unknown) == len(asked):
            raise _Refuse("not_allowed")
        return {name: found for name, found in (("unknown", unknown), ("denied", guarded)) if found}

    async def speak(self, watcher: Watcher) -> None:
        """Send frames for ever, and ask for the right to them now and then; a frame comes at least every second."""
        loop = asyncio.get_running_loop()
        check = loop.time() + self.sockets.recheck
        try:
            while True:
                frame = await watcher.next()
                if loop.time() >= check:
                    check = loop.time() + self.sockets.recheck
                    if not await self.sockets.may_watch(self.websocket, self.asks):
                        await self.refuse(_Refuse("not_allowed"))
                        return
                await self.send(frame)
        except (WebSocketDisconnect, RuntimeError, OSError):
            return
        except _TooSlow:
            await self.give_up()

    async def fall_silent(self) -> None:
        """End the speaking task and wait until it has ended."""
        if self.speaker:
            self.speaker.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await self.speaker
            self.speaker = None

    async def send(self, data: bytes) -> None:
        """Send one message.

        Raises:
            _TooSlow: the browser took it too slowly, whoever waits for a word of it meanwhile.
        """
        try:
            async with asyncio.timeout(SLOWEST_SEND):
                await self.websocket.send({"type": "websocket.send", "text": data.decode()})
        except TimeoutError as error:
            raise _TooSlow from error

    async def give_up(self) -> None:
        """Close to a browser that reads too slowly: it may come again."""
        log.info("socket too slow kind=%s", self.kind)
        with contextlib.suppress(WebSocketDisconnect, RuntimeError, OSError):
            await self.websocket.close(TRY_LATER)

    async def refuse(self, refusal: _Refuse) -> None:
        """Say why and close."""
        with contextlib.suppress(WebSocketDisconnect, RuntimeError, OSError, _TooSlow):
            await self.send(orjson.dumps({"error": refusal.error}))
            await self.websocket.close(refusal.code)
