"""Wires inside a loop: TCP and serial lines whose bytes arrive the moment they are sent, so that virtual time can carry them.

A connection is a pair of sockets that no other program sees; an address is an entry in a table of the loop, a serial device one in a table
of this process.
"""

import asyncio
import errno
import os
import socket
from collections.abc import Callable
from itertools import count
from typing import Any

from app.links import rtu as rtu_transport
from app.plant.definitions import Link
from app.sim import server as sim_server
from app.sim.bus import Bus
from app.sim.server import SerialServer

BUFFER = 1 << 20
"""What a wire takes before somebody reads [bytes]."""


class Listener:
    """Who waits for connections at an address of a loop."""

    def __init__(
        self, network: "Network", factory: Callable[[], asyncio.BaseProtocol], address: tuple[str, int]
    ) -> None:
        self._network = network
        self.factory = factory
        self.address = address
        self.sockets = (self,)

    def getsockname(self) -> tuple[str, int]:
        return self.address

    def is_serving(self) -> bool:
        return self._network.listeners.get(self.address) is self

    def close(self) -> None:
        if self.is_serving():
            del self._network.listeners[self.address]

    async def wait_closed(self) -> None:
        pass


class Network(asyncio.SelectorEventLoop):
    """A loop with a network of its own: nobody from outside gets in, nothing inside gets out."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.listeners: dict[tuple[str, int], Listener] = {}
        self._ports = count(50_000)

    async def create_server(self, protocol_factory: Any, host: Any = None, port: Any = None, **options: Any) -> Any:
        """Listen at an address of this loop; port 0 takes a free one.

        Raises:
            OSError: somebody listens there.
        """
        if options.get("sock") is not None:
            return await super().create_server(protocol_factory, host, port, **options)
        if port is not None and not 0 <= port <= 65535:
            raise OverflowError("bind(): port must be 0-65535.")
        address = (host, port or next(self._ports))
        if address in self.listeners:
            raise OSError(
                errno.EADDRINUSE, f"error while attempting to bind on address {address}: address already in use"
            )
        self.listeners[address] = Listener(self, protocol_factory, address)
        return self.listeners[address]

    async def create_connection(self, protocol_factory: Any, host: Any = None, port: Any = None, **options: Any) -> Any:
        """Connect to an address of this loop.

        Raises:
            ConnectionRefusedError: nobody listens there.
        """
        if options.get("sock") is not None:
            return await super().create_connection(protocol_factory, host, port, **options)
        listener = self.listeners.get((host, port))
        if listener is None:
            raise ConnectionRefusedError(errno.ECONNREFUSED, f"Connect call failed {(host, port)}")
        ours, theirs = pair()
        accepted: asyncio.BaseTransport | None = None
        try:
            accepted, _ = await self.connect_accepted_socket(listener.factory, theirs)
            return await super().create_connection(protocol_factory, sock=ours)
        except BaseException:
            ours.close()
            if accepted is None:
                theirs.close()
            else:
                accepted.close()  # the loop would not give its number to another socket
            raise


def pair() -> tuple[socket.socket, socket.socket]:
    """Both ends of a wire; neither blocks."""
    ends = socket.socketpair()
    for end in ends:
        end.setblocking(False)
        end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, BUFFER)
    return ends


class Port:
    """The master's end of a serial line, as `open_port` gives it."""

    def __init__(self, end: socket.socket) -> None:
        self._end = end.dup()
        self._end.setblocking(False)
        self.reset_input_buffer()

    def fileno(self) -> int:
        return self._end.fileno()

    def reset_input_buffer(self) -> None:
        try:
            while self._end.recv(4096):
                pass
        except BlockingIOError:
            pass

    def reset_output_buffer(self) -> None:
        pass

    def close(self) -> None:
        self._end.close()


class SerialLine:
    """A serial line without a device file; masters open its `path`, and may come and go."""

    def __init__(self, path: str = "") -> None:
        self.ours, self._theirs = pair()
        self.path = path or f"/wires/{next(_numbers)}"
        _lines[self.path] = self._theirs

    def fileno(self) -> int:
        """Of the end where the slaves are."""
        return self.ours.fileno()

    def close(self) -> None:
        """Pull the cable: who reads hears that the device is gone."""
        _lines.pop(self.path, None)
        self._theirs.shutdown(socket.SHUT_RDWR)
        self._theirs.close()
        self.ours.close()


async def serve_line(bus: Bus, baud: int = 9600, *, paced: bool = True) -> SerialServer:
    """Serve `bus` as RTU slaves on a line of this process until `close()`, with the time that a line takes."""
    line = SerialLine()
    opened = sim_server._Line(line.ours.fileno(), line.close)
    server = SerialServer(bus, lambda: opened, line.path, baud, paced=paced)
    await server.start()
    return server


def open_port(link: Link) -> Any:
    """As the transport's own, which it stands in for, on a line of this process too."""
    if not link.port.startswith("/wires/"):
        return _open_device(link)
    if link.port not in _lines:
        raise rtu_transport.NotConnected(f"{link.port}: {os.strerror(errno.ENOENT)}")
    return Port(_lines[link.port])


_numbers = count(1)
_lines: dict[str, socket.socket] = {}
_open_device = rtu_transport.open_port
rtu_transport.open_port = open_port
