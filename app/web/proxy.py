"""The TLS proxies of POGON_BEHIND_PROXY: only from them a request is taken, and only them X-Forwarded-For and -Proto are believed.

The proxy hands on the Host that the browser sent. Whoever asks past it could say anything about its address and would get passwords over
an open line; only this machine may ask how the server is (health checks of a container).
"""

import ipaddress

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Receive, Scope, Send

from app.addresses import is_loopback, plain
from app.errors import ConfigurationError
from app.web.security import refuse

HEALTH = frozenset({"/healthz", "/readyz"})
"""What this machine itself may ask for."""
SCHEMES = ("http", "https")
MOST_HOPS = 20


class Proxied:
    """The layer that puts in place of the proxy's address the one of whoever it speaks for."""

    def __init__(self, app: ASGIApp, proxies: str) -> None:
        self._app = app
        self._proxies = networks(proxies)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        status = self._read(scope)
        if not status:
            await self._app(scope, receive, send)
        elif scope["type"] == "http":
            await refuse(scope, receive, send, status)
        else:
            await send({"type": "websocket.close", "code": 1008})

    def _read(self, scope: Scope) -> int:
        """Take over what the proxy says; the status of a refusal, or 0."""
        peer = (scope.get("client") or ("", 0))[0]
        if not self._is_proxy(peer):
            return 0 if scope["path"] in HEALTH and is_loopback(peer) else 403
        headers = Headers(scope=scope)
        schemes = headers.getlist("x-forwarded-proto")
        if schemes:
            scheme = schemes[0].strip().lower()
            if len(schemes) > 1 or scheme not in SCHEMES:
                return 400
            scope["scheme"] = scheme.replace("http", "ws") if scope["type"] == "websocket" else scheme
        hops = [hop.strip() for line in headers.getlist("x-forwarded-for") for hop in line.split(",")]
        if hops:
            addresses = [_address(hop) for hop in hops[-MOST_HOPS:]]
            for address in reversed(addresses):
                if not address:
                    return 400
                if not self._is_proxy(address):
                    break
            scope["client"] = (address, 0)
        return 0

    def _is_proxy(self, address: str) -> bool:
        try:
            found = plain(address)
        except ValueError:
            return False
        return any(found in network for network in self._proxies)


def networks(named: str) -> tuple[ipaddress.IPv4Network | ipaddress.IPv6Network, ...]:
    """Addresses and networks, comma separated.

    Raises:
        ConfigurationError: one is none.
    """
    try:
        return tuple(_network(part.strip()) for part in named.split(",") if part.strip())
    except ValueError as error:
        raise ConfigurationError(f"POGON_BEHIND_PROXY={named}: expected IP addresses or networks ({error})") from error


def _network(text: str) -> ipaddress.IPv4Network | ipaddress.IPv6Network:
    """The network of `text`, as `plain` has its addresses.

    Raises:
        ValueError: it is none.
    """
    network = ipaddress.ip_network(text)
    first = plain(str(network.network_address))
    if network.version == 6 and first.version == 4 and network.prefixlen >= 96:
        return ipaddress.IPv4Network((int(first), network.prefixlen - 96))
    return network


def _address(hop: str) -> str:
    """The address of `192.0.2.7`, `192.0.2.7:4711`, `2001:db8::1` or `[2001:db8::1]:4711`; empty when it is none."""
    host, _, port = hop.rpartition(":")
    if hop.startswith("["):
        host, closed, port = hop[1:].partition("]")
        if not closed or not port.startswith(":"):
            return ""
        port = port[1:]
    elif hop.count(":") != 1:
        host, port = hop, ""
    if port and not (port.isascii() and port.isdecimal() and len(port) <= 5):
        return ""
    try:
        return str(plain(host))
    except ValueError:
        return ""
