"""The table of transports: a new one is a file and a line here."""

from collections.abc import Mapping

from app.links.contract import Transport
from app.links.memory import MemoryTransport
from app.links.rtu import RtuTransport
from app.links.tcp import TcpTransport

TRANSPORTS: Mapping[str, type[MemoryTransport] | type[TcpTransport] | type[RtuTransport]] = {
    "memory": MemoryTransport,
    "tcp": TcpTransport,
    "rtu": RtuTransport,
}
"""Kind of link in the plant file → transport, called with the link and the exchange of its simulated line (or None)."""

__all__ = ["TRANSPORTS", "Transport"]
