"""Uvicorn with our limits; says where the server is, and the one-time code, once the port is really open."""

import atexit
import gc
import logging
import signal
import socket
import ssl
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from threading import current_thread, main_thread
from typing import Any

import typer
import uvicorn
from fastapi import FastAPI

from app import logs
from app.errors import ConfigurationError, PogonError
from app.plant.toml import parse
from app.settings import Settings
from app.watchdog import Watchdog
from app.web.connections import Connection, Greeter, doors_of_this_machine
from app.web.guard import access_of

BACKLOG = 2048


def serve(app: FastAPI, settings: Settings) -> None:
    """Serve `app` until a signal ends it.

    Raises:
        ConfigurationError: address, port or TLS files cannot be used, or the plant's server cannot start with these settings.
    """
    atexit.register(logs.start(settings.log_level, settings.log, settings.syslog))
    check_key(settings.tls_key)
    lifespan = _Lifespan(app)
    doors = doors_of_this_machine(shared=bool(settings.behind_proxy))
    config = uvicorn.Config(
        lifespan,
        http=partial(Connection, doors=doors),  # type: ignore[arg-type]  # a factory of protocols is one
        ws="websockets-sansio",
        host=settings.host,
        port=settings.port,
        log_level=settings.log_level,
        log_config=None,  # its lines go where ours do
        ssl_certfile=settings.tls_cert,
        ssl_keyfile=settings.tls_key,
        timeout_graceful_shutdown=2,
        server_header=False,
        proxy_headers=False,  # create_app trusts the proxies of POGON_BEHIND_PROXY, and nobody else
        ws_max_size=65536,
        ws_per_message_deflate=False,  # a frame is small, and every browser would cost a compressor
        lifespan="on",
    )
    for name in ("uvicorn.access", "uvicorn.error"):
        logging.getLogger(name).addFilter(without_query)
    try:
        config.load()
    except (OSError, ssl.SSLError) as error:
        raise ConfigurationError(
            f"POGON_TLS_CERT={settings.tls_cert}, POGON_TLS_KEY={settings.tls_key}: expected a PEM certificate and its key "
            f"({error.strerror or error})"
        ) from error
    if config.ssl is not None:
        config.http_protocol_class = partial(Greeter, doors=doors, context=config.ssl)  # type: ignore[assignment]
        config.ssl = None
    sockets = open_sockets(settings.host, settings.port)
    try:
        Server(config, app, settings).run(sockets)
    except SystemExit:
        if lifespan.refused:
            raise ConfigurationError(lifespan.refused) from None
        raise
    finally:
        for one in sockets:
            one.close()


def check_key(path: Path | None) -> None:
    """Refuse a private key that others than its owner may read.

    Raises:
        ConfigurationError: names the file and its mode. One that cannot be looked at is told when it is loaded.
    """
    if path is not None and path.exists() and not path.is_file():
        raise ConfigurationError(f"POGON_TLS_KEY={path}: expected an ordinary file with a PEM key")
    with suppress(OSError):
        if path is not None and (mode := path.stat().st_mode & 0o777) & 0o077:
            raise ConfigurationError(
                f"POGON_TLS_KEY={path}: its mode {mode:04o} lets others use it, expected 0600 (chmod 600 {path})"
            )


def without_query(record: logging.LogRecord) -> bool:
    """Leave the query out of an address in the server's log: it may hold what somebody typed."""
    if isinstance(record.args, tuple):
        record.args = tuple(
            one.partition("?")[0] if isinstance(one, str) and one.startswith("/") else one for one in record.args
        )
    return True


def open_sockets(host: str, port: int) -> list[socket.socket]:
    """Listening sockets on every address of `host`, before anything is started that would have to be stopped again.

    Raises:
        ConfigurationError: the port is in use or not allowed, or the address is not one of this machine.
    """
    opened: list[socket.socket] = []
    try:
        found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
        for family, _, _, _, address in dict.fromkeys(found):
            if family == socket.AF_INET6 and not socket.has_dualstack_ipv6():
                continue
            one = socket.socket(family, socket.SOCK_STREAM)
            opened.append(one)
            one.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            if family == socket.AF_INET6:
                one.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
            one.bind(address)
            one.listen(BACKLOG)
    except OSError as error:
        for one in opened:
            one.close()
        raise ConfigurationError(
            f"POGON_HOST={host} POGON_PORT={port}: expected a free port on an address of this machine "
            f"({error.strerror or error})"
        ) from error
    return opened


class _Lifespan:
    """The application; an error of ours at the start is kept as one line and not told as a crash."""

    def __init__(self, app: FastAPI) -> None:
        self._app = app
        self.refused = ""

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        if scope["type"] != "lifespan":
            await self._app(scope, receive, send)
            return

        async def tell(message: Mapping[str, Any]) -> None:
            if message["type"] == "lifespan.startup.failed":
                error = sys.exception()
                if isinstance(error, PogonError):
                    self.refused = str(error)
                    message = {"type": message["type"]}
            await send(message)

        await self._app(scope, receive, tell)


class Server(uvicorn.Server):
    """Announces itself after its sockets are open, so that also port 0 is told as what it became; ends in order with its terminal."""

    def __init__(self, config: uvicorn.Config, app: FastAPI, settings: Settings) -> None:
        super().__init__(config)
        self._pogon = app
        self._settings = settings
        self._watchdog = Watchdog()

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        """SIGHUP, a terminal or a connection that was closed, ends it like SIGTERM, but for one that was started with `nohup`."""
        hang_up = signal.getsignal(signal.SIGHUP)
        with super().capture_signals():
            if heard := hang_up == signal.SIG_DFL and current_thread() is main_thread():
                signal.signal(signal.SIGHUP, self.handle_exit)
            try:
                yield
            finally:
                if heard:
                    signal.signal(signal.SIGHUP, hang_up)
                if self._captured_signals:  # the signal that ends this process comes next, and nothing after it
                    logging.shutdown()

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Answer on the open sockets and say so."""
        await super().startup(sockets)
        parse.cache_clear()  # what the files say is in the plant now
        # what was built so far stays: the collector need not walk it again and hold up the loop (40 ms with 1 000 tags)
        gc.collect()
        gc.freeze()
        gc.enable()  # `pogon run` starts without it
        if self.started:
            self._watchdog.start()  # not before: a database is migrated first, however long that takes
        if self.started and self.servers:
            port = self.servers[0].sockets[0].getsockname()[1]
            typer.echo(announcement(self._pogon, self._settings, port))

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Close the sockets and let the plant end; an end that hangs, or waits for a disk for too long, is ended."""
        self._watchdog.end_in_time()
        try:
            await super().shutdown(sockets)
        finally:
            self._watchdog.stop()


def announcement(app: FastAPI, settings: Settings, port: int) -> str:
    """What the terminal shows: the address, and the code while there is no account. The code is typed; no link carries it."""
    scheme = "https" if settings.tls_cert else "http"
    host = "localhost" if settings.host in ("127.0.0.1", "::1", "0.0.0.0", "::") else settings.host
    host = f"[{host}]" if ":" in host else host
    port = settings.published_port or port
    address = f"{scheme}://{host}:{port}/"
    access = access_of(app)
    code = access.first_code.text if access else ""
    how = " (Ctrl+C ends it)" if sys.stdout.isatty() else ""  # a service has no keyboard
    lines = [f"Pogon is at {address}{how}"]
    if settings.host in ("0.0.0.0", "::") and not settings.behind_proxy:  # a proxy has a port of its own
        names = sorted(settings.hosts - {"localhost", "127.0.0.1", "::1", "[::1]"})
        lines += [f"Others reach it at {scheme}://{name}:{port}/" for name in names]
    runtime = getattr(app.state, "runtime", None)
    modbus = runtime.modbus.address if runtime else None
    if modbus:
        lines.append(f"Its simulated plant answers Modbus TCP at {':'.join(map(str, modbus))}")
    if code:
        lines += [
            f"There is no account yet. Open {address}first and type this code:",
            "",
            f"    {code}",
            "",
            f"It makes one account and is then gone (until then also in {settings.data / 'first-code'}).",
        ]
    width = max(map(len, lines))
    return "\n".join(["", "─" * width, *lines, "─" * width, ""])
