"""Connections: how long a head may take and how long it may be, how many there are, and who goes when there are too many.

Whoever opens a connection is a stranger until a request with a valid session has come over it (guard.py says so, `Place.known`). Strangers
share what is left beside the places kept for people who are signed in. When those are used up, the one that has waited longest at the
address with the most of them is closed, so the newest connection always gets its chance and one address cannot crowd out another.

    head        32 KB in all and 100 lines, trailers likewise; whole 10 s after its first byte, else 408 or 431
    body        whole `BODY_TIME` after its head (app/web/security.py says what it may be); what is not read is not kept
    idle        closed 5 s after an answer, 10 s after opening without a word
    answer      a reader that takes nothing of it for 60 s is let go
    in advance  at most 8 requests at a time on one connection
    frames      20 a second and 100 at once of a socket, pings and pieces of messages included; who sends more is closed

Everything here is O(1) per connection and event.
"""

import asyncio
import re
import resource
import ssl
from collections import OrderedDict
from collections.abc import Callable, Coroutine
from functools import partial
from typing import Any

from uvicorn.config import Config
from uvicorn.protocols.http.httptools_impl import STATUS_LINE, HttpToolsProtocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from uvicorn.server import ServerState
from websockets.frames import CloseCode

from app.addresses import client_of
from app.web.security import BODY_TIME, LARGEST_BODY

LARGEST_HEAD = 32 * 1024
"""Request line and header lines [bytes]; the trailers of a body together likewise."""
MOST_LINES = 100
HEAD_TIME = 10.0
"""From the first byte of a request to the end of its head; also from opening to the first byte [s]."""
LONGEST_BODY = BODY_TIME + 2.0
"""The layers above answer first [s]."""
LARGEST_RAW = 8 * LARGEST_BODY
"""A body with the frames of its chunks [bytes]; one byte in a chunk of its own takes six."""
SLOWEST_READER = 60.0
"""A reader that takes nothing of an answer for so long is let go [s]."""
MOST_AHEAD = 8
"""Requests sent before the answer to the first."""
FRAMES, FRAMES_AT_ONCE = 20.0, 100.0
"""Frames that a browser may send over a socket a second, and at once. Messages of our pages are one frame each and fewer (socket.py)."""
PORTION = 1024
"""A socket's bytes are looked at in portions [bytes]: the smallest frame has 6, and each costs some 20 µs."""
MOST = 2000
"""Connections in all."""
STRANGERS = 1200
"""Of them, connections over which nobody has shown a session."""
PER_ADDRESS = 600
"""Of strangers at one address: a class of thirty behind one address, each with several tabs, needs half of it."""
PER_SESSION = 100
"""Connections of one session; more of it count as strangers."""
KEPT_FILES = 200
"""Files that the rest of the server needs open."""
FIRST_LINE_HOST = re.compile(rb"[^/?#]*")
"""What stands between `http://` and the path."""
CHANCE = 2.0
"""A connection without a request goes before those that had one when it is older than this [s]."""


class Place:
    """One connection, as it is counted."""

    __slots__ = ("_doors", "address", "close", "opened", "served", "session")

    def __init__(self, doors: "Doors", address: str, opened: float, close: Callable[[], object]) -> None:
        self._doors = doors
        self.address = address
        self.opened = opened
        self.close = close
        self.session = ""
        """Whose it is; empty: a stranger's."""
        self.served = False
        """Whether a whole request head has come."""

    def known(self, session: str) -> None:
        """A request over it came with this session; empty: with none."""
        if session != self.session:
            self._doors.rename(self, session)

    def used(self) -> None:
        """A whole request head has come over it: it goes to the end of its row."""
        self._doors.used(self)

    def leave(self) -> None:
        """It is closed."""
        self._doors.leave(self)


class _Row:
    """The strangers of one address, each in the order of its last request."""

    __slots__ = ("served", "waiting")

    def __init__(self) -> None:
        self.waiting: OrderedDict[Place, None] = OrderedDict()
        self.served: OrderedDict[Place, None] = OrderedDict()

    def __len__(self) -> int:
        return len(self.waiting) + len(self.served)

    def oldest(self, now: float) -> Place:
        """Who goes first: whoever had time for a request and sent none, then whoever has been quiet longest."""
        first = next(iter(self.waiting), None)
        if first is not None and (now - first.opened > CHANCE or not self.served):
            return first
        return next(iter(self.served))


class Doors:
    """All connections of a server."""

    def __init__(
        self,
        most: int = MOST,
        strangers: int = STRANGERS,
        per_address: int = PER_ADDRESS,
        per_session: int = PER_SESSION,
    ) -> None:
        self.most = most
        self.strangers = strangers
        self.per_address = per_address
        self.per_session = per_session
        self.dropped = 0
        """Connections closed to make room, since the start."""
        self._sessions: dict[str, int] = {}
        self._all: set[Place] = set()
        self._rows: dict[str, _Row] = {}
        self._sizes: dict[int, OrderedDict[str, None]] = {}
        self._longest = 0
        self._unknown = 0

    def __len__(self) -> int:
        return len(self._all)

    def enter(self, address: str, now: float, close: Callable[[], object]) -> Place | None:
        """Count a new connection in, at the cost of another stranger's when there are enough; None when nobody can go."""
        address = client_of(address)
        row = self._rows.get(address)
        if row is not None and len(row) >= self.per_address:
            self._drop(row.oldest(now))
        elif self._unknown >= self.strangers or (len(self._all) >= self.most and self._unknown):
            self._drop(self._rows[next(iter(self._sizes[self._longest]))].oldest(now))
        if len(self._all) >= self.most:
            self.dropped += 1
            return None
        place = Place(self, address, now, close)
        self._all.add(place)
        self._put(place)
        return place

    def rename(self, place: Place, session: str) -> None:
        """A connection turns out to be somebody's, or nobody's any more."""
        if place not in self._all or (session and self._sessions.get(session, 0) >= self.per_session):
            return
        if place.session:
            self._forget(place.session)
        else:
            self._take(place)
        place.session = session
        if session:
            self._sessions[session] = self._sessions.get(session, 0) + 1
        else:
            self._put(place)

    def used(self, place: Place) -> None:
        """A whole request head has come over a connection."""
        row = self._rows.get(place.address)
        if row is not None and place not in row.served and place in row.waiting:
            del row.waiting[place]
            row.served[place] = None
        elif row is not None and place in row.served:
            row.served.move_to_end(place)
        place.served = True

    def leave(self, place: Place) -> None:
        """Count a connection out."""
        if place not in self._all:
            return
        self._all.discard(place)
        if place.session:
            self._forget(place.session)
        else:
            self._take(place)

    def _drop(self, place: Place) -> None:
        self.dropped += 1
        self.leave(place)
        place.close()

    def _forget(self, session: str) -> None:
        left = self._sessions[session] - 1
        if left:
            self._sessions[session] = left
        else:
            del self._sessions[session]

    def _put(self, place: Place) -> None:
        row = self._rows.setdefault(place.address, _Row())
        (row.served if place.served else row.waiting)[place] = None
        self._unknown += 1
        self._resize(place.address, len(row) - 1, len(row))

    def _take(self, place: Place) -> None:
        row = self._rows[place.address]
        row.waiting.pop(place, None)
        row.served.pop(place, None)
        self._unknown -= 1
        self._resize(place.address, len(row) + 1, len(row))
        if not len(row):
            del self._rows[place.address]

    def _resize(self, address: str, before: int, after: int) -> None:
        """Keep the addresses by how many strangers they have, so that the one with the most is at hand."""
        if before:
            del self._sizes[before][address]
            if not self._sizes[before]:
                del self._sizes[before]
        if after:
            self._sizes.setdefault(after, OrderedDict())[address] = None
        if after > self._longest or self._longest not in self._sizes:
            self._longest = after


def doors_of_this_machine(*, shared: bool = False) -> Doors:
    """As many connections as the files that this process may open allow; the soft limit is raised first.

    `shared`: all come from one proxy, so its address has no limit of its own.
    """
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft != resource.RLIM_INFINITY and soft < 2 * MOST:
        soft = 2 * MOST if hard == resource.RLIM_INFINITY else min(hard, 2 * MOST)
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
    most = MOST if soft == resource.RLIM_INFINITY else min(MOST, max(soft - KEPT_FILES, soft // 3))
    strangers = most * STRANGERS // MOST
    return Doors(most, strangers, strangers if shared else most * PER_ADDRESS // MOST)


def enter(doors: Doors, transport: asyncio.Transport, loop: asyncio.AbstractEventLoop) -> Place | None:
    """Count a connection in; one for which there is no place is closed."""
    peer = transport.get_extra_info("peername")
    place = doors.enter(str(peer[0]) if peer else "", loop.time(), transport.abort)
    if place is None:
        transport.abort()
    return place


class Greeter(asyncio.Protocol):
    """A connection that will speak TLS: it is counted before it has shaken hands, and has `HEAD_TIME` for that."""

    def __init__(
        self,
        config: Config,
        server_state: ServerState,
        app_state: dict[str, Any],
        _loop: asyncio.AbstractEventLoop | None = None,
        *,
        doors: Doors,
        context: ssl.SSLContext,
    ) -> None:
        self._given = (config, server_state, app_state, _loop)
        self._doors = doors
        self._context = context
        self._tasks = server_state.tasks
        self._loop = _loop or asyncio.get_running_loop()

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        place = enter(self._doors, transport, self._loop)
        if place is None:
            return
        spoken = Connection(*self._given, doors=self._doors, place=place)
        handshake = self._loop.start_tls(
            transport, spoken, self._context, server_side=True, ssl_handshake_timeout=HEAD_TIME
        )
        # Begun before this returns, not in a task's first step: uvloop reads from then on, paused or not, and a greeting that had come
        # by then, as on a busy machine, was given to this class, where nobody answers it.
        shaken = handshake.send(None)
        shaken._asyncio_future_blocking = False  # as a task leaves the future that it waits for
        task = self._loop.create_task(self._shake_hands(transport, place, spoken, handshake, shaken))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _shake_hands(
        self,
        transport: asyncio.Transport,
        place: Place,
        spoken: "Connection",
        handshake: Coroutine[Any, Any, asyncio.Transport | None],
        shaken: asyncio.Future[None],
    ) -> None:
        secure = None
        try:
            await shaken
            handshake.send(None)
        except StopIteration as ended:
            secure = ended.value
        except (OSError, TimeoutError):  # ssl.SSLError is one
            pass
        finally:
            handshake.close()
        if secure is None or transport.is_closing():  # closed to make room: uvloop tells no error of that
            place.leave()
            transport.abort()
        else:
            place.close = secure.abort
            spoken.connection_made(secure)


class Connection(HttpToolsProtocol):
    """HTTP/1.1 on one connection, within the limits of this page."""

    def __init__(
        self,
        config: Config,
        server_state: ServerState,
        app_state: dict[str, Any],
        _loop: asyncio.AbstractEventLoop | None = None,
        *,
        doors: Doors,
        place: Place | None = None,
    ) -> None:
        super().__init__(config, server_state, app_state, _loop)
        self._doors = doors
        self._place = place
        self._timer: asyncio.TimerHandle | None = None
        self._reading = False
        """Between the first byte of a request and its last."""
        self._in_head = False
        self._lines = 0
        self._size = 0
        self._raw = self._portion = 0
        self._refusal = 0
        self._stalled: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        if self._place is None:
            self._place = enter(self._doors, transport, self.loop)
        if self._place is None:
            return
        self.app_state = {**self.app_state, "place": self._place}
        self._wait(HEAD_TIME, transport.close)

    def connection_lost(self, exc: Exception | None) -> None:
        self._done()
        if self._stalled is not None:
            self._stalled.cancel()
        if self._place is not None:
            self._place.leave()
        if self.transport is not None:  # else it was lost while hands were shaken
            super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        if self._refusal or self.transport.is_closing():
            return
        self._portion = len(data)
        self._raw += self._portion
        self._begin()
        super().data_received(data)
        if self._refusal or self._place is None:
            return
        if self._in_head and self._raw > LARGEST_HEAD:
            self._refuse(431)
        elif self._reading and not self._in_head and self._raw > LARGEST_RAW + LARGEST_HEAD:
            self._refuse(413)

    def on_message_begin(self) -> None:
        self._begin()
        self._lines = self._size = 0
        super().on_message_begin()

    def on_url(self, url: bytes) -> None:
        self._count(len(url), 0)
        super().on_url(url)

    def on_header(self, name: bytes, value: bytes) -> None:
        self._count(len(name) + len(value) + 4, 1)
        if self._in_head:  # what comes after a body is counted, and never taken for a header of the request
            super().on_header(name, value)

    def on_headers_complete(self) -> None:
        if len(self.pipeline) >= MOST_AHEAD:
            self._refusal = 429
            raise ValueError("too many requests ahead")
        if self.parser.should_upgrade() and self.cycle is not None and not self.cycle.response_complete:
            self._refusal = 400  # the answers that are due would be written between its frames
            raise ValueError("a socket before the answers to what was asked before it")
        self._take_authority()
        self._in_head = False
        self._raw, self._lines, self._size = self._portion, 0, 0
        self._wait(LONGEST_BODY, partial(self._refuse, 408))
        if self._place is not None:
            self._place.used()
        super().on_headers_complete()

    def on_message_complete(self) -> None:
        self._reading = False
        self._raw = 0
        self._done()
        super().on_message_complete()
        if self.cycle is not None and self.cycle.response_complete:
            self._wait(self.timeout_keep_alive, self.timeout_keep_alive_handler)

    def handle_websocket_upgrade(self) -> None:
        self._done()
        self.ws_protocol_class = partial(Socket, place=self._place)  # type: ignore[assignment]
        super().handle_websocket_upgrade()

    def pause_writing(self) -> None:
        super().pause_writing()
        self._stalled = self.loop.call_later(SLOWEST_READER, self.transport.abort)

    def resume_writing(self) -> None:
        if self._stalled is not None:
            self._stalled.cancel()
            self._stalled = None
        super().resume_writing()

    def timeout_keep_alive_handler(self) -> None:
        if not self._reading:
            super().timeout_keep_alive_handler()

    def send_400_response(self, msg: str) -> None:
        if self._refusal:
            self._answer(self._refusal)
        else:
            super().send_400_response(msg)

    def _take_authority(self) -> None:
        """`GET http://host/path` names its host in its first line; what the header says beside it does not count (RFC 9112, 3.2.2)."""
        scheme, found, rest = self.url.partition(b"://")
        if not found or not scheme.isalpha():
            return
        authority = FIRST_LINE_HOST.match(rest)
        named = authority[0] if authority else b""
        path = rest[len(named) :]
        self.url = path if path.startswith(b"/") else b"/" + path
        self.headers[:] = [(name, named if name == b"host" else value) for name, value in self.headers]

    def _begin(self) -> None:
        """The first byte of a request: its head has to be here in time."""
        if not self._reading:
            self._reading = self._in_head = True
            self._wait(HEAD_TIME, partial(self._refuse, 408))

    def _count(self, size: int, lines: int) -> None:
        self._size += size
        self._lines += lines
        if self._size > LARGEST_HEAD or self._lines > MOST_LINES:
            self._refusal = 431
            raise ValueError("the head is too large")

    def _refuse(self, status: int) -> None:
        if not self._refusal and not self.transport.is_closing():
            self._refusal = status
            self._answer(status)

    def _answer(self, status: int) -> None:
        """Say why, unless an answer is under way, and close."""
        self._done()
        cycle = self.cycle
        quiet = cycle is None or (cycle.response_complete if self._in_head else not cycle.response_started)
        if quiet and not self.pipeline:
            text = b"The request is too large, too slow, or one of too many.\n"
            head = b"content-type: text/plain; charset=utf-8\r\ncontent-length: %d\r\nconnection: close\r\n\r\n" % len(
                text
            )
            self.transport.write(STATUS_LINE[status] + head + text)
        self.transport.close()

    def _wait(self, seconds: float, then: Callable[[], object]) -> None:
        self._done()
        self._timer = self.loop.call_later(seconds, then)

    def _done(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None


class Socket(WebSocketsSansIOProtocol):
    """A socket keeps the place of the connection that it was, and takes so many frames."""

    def __init__(
        self,
        config: Config,
        server_state: ServerState,
        app_state: dict[str, Any],
        _loop: asyncio.AbstractEventLoop | None = None,
        *,
        place: Place | None = None,
    ) -> None:
        super().__init__(config, server_state, app_state, _loop)
        self._place = place
        self._frames, self._then = FRAMES_AT_ONCE, self.loop.time()

    def connection_lost(self, exc: Exception | None) -> None:
        if self._place is not None:
            self._place.leave()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        for begin in range(0, len(data), PORTION):
            if self.transport.is_closing():
                return
            super().data_received(data[begin : begin + PORTION])
            if self.conn.handshake_exc is not None and not self.handshake_complete:
                self._turn_away()
                return

    def handle_events(self) -> None:
        now = self.loop.time()
        self._frames = min(FRAMES_AT_ONCE, self._frames + (now - self._then) * FRAMES) - len(self.conn.events)
        self._then = now
        if self._frames < 0:
            self._close_flood()
        else:
            super().handle_events()

    def send_receive_event_to_app(self) -> None:
        try:
            if self.curr_msg_data_type == "text":
                b"".join(self.frames).decode()
        except UnicodeDecodeError:  # what a stranger sends is no error of ours with a trace in the log
            self.frames = []
            self.conn.fail(CloseCode.INVALID_DATA, "a text is UTF-8")
            self.handle_parser_exception()
        else:
            super().send_receive_event_to_app()

    def _turn_away(self) -> None:
        """A head that is none to the sockets' own parser (a body, a line above 8 KB) is answered, and nobody stays without a socket."""
        self.handshake_complete = self.close_sent = True
        said = b"".join(self.conn.data_to_send())
        self.transport.write(said or STATUS_LINE[400] + b"content-length: 0\r\nconnection: close\r\n\r\n")
        self.transport.close()

    def _close_flood(self) -> None:
        """Say why, if it is read at all, and close: nobody waits for what is left of it."""
        self.stop_keepalive()
        if self.handshake_complete and not self.close_sent and not self.transport.get_write_buffer_size():
            self.conn.fail(CloseCode.TRY_AGAIN_LATER, "too many frames")
            self.transport.write(b"".join(self.conn.data_to_send()))
            self.close_sent = True
            self.queue.put_nowait({"type": "websocket.disconnect", "code": CloseCode.TRY_AGAIN_LATER, "reason": ""})
            self.transport.close()
        else:
            self.transport.abort()
