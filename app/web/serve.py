"""Uvicorn with our limits; says where the server is, and the one-time code, once the port is really open."""

import socket

import typer
import uvicorn
from fastapi import FastAPI

from app.settings import Settings
from app.web.guard import access_of


def serve(app: FastAPI, settings: Settings) -> None:
    """Serve `app` until a signal ends it."""
    config = uvicorn.Config(
        app,
        host=settings.host,
        port=settings.port,
        log_level=settings.log_level,
        ssl_certfile=settings.tls_cert,
        ssl_keyfile=settings.tls_key,
        timeout_graceful_shutdown=2,
        server_header=False,
        proxy_headers=False,  # create_app trusts the proxies of POGON_BEHIND_PROXY, and nobody else
        ws_max_size=65536,
        ws_per_message_deflate=False,  # a frame is small, and every browser would cost a compressor
    )
    Server(config, app, settings).run()


class Server(uvicorn.Server):
    """Announces itself after its sockets are open, so that also port 0 is told as what it became."""

    def __init__(self, config: uvicorn.Config, app: FastAPI, settings: Settings) -> None:
        super().__init__(config)
        self._pogon = app
        self._settings = settings

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Open the port and say so."""
        await super().startup(sockets)
        if self.started and self.servers:
            port = self.servers[0].sockets[0].getsockname()[1]
            typer.echo(announcement(self._pogon, self._settings, port))


def announcement(app: FastAPI, settings: Settings, port: int) -> str:
    """What the terminal shows: the address, and the code while there is no account. The code is typed; no link carries it."""
    scheme = "https" if settings.tls_cert else "http"
    host = "localhost" if settings.host in ("127.0.0.1", "::1", "0.0.0.0", "::") else settings.host
    host = f"[{host}]" if ":" in host else host
    address = f"{scheme}://{host}:{port}/"
    access = access_of(app)
    code = access.first_code.text if access else ""
    lines = [f"Pogon is at {address}"]
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
