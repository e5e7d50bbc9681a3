"""Addresses as people write them: HOST:PORT, what a host may be called, whether it is this machine, and which are one client's."""

import ipaddress
import re

from app.errors import ConfigurationError

HOST_NAME = re.compile(r"(?!-)[A-Za-z0-9_-]{1,63}(\.(?!-)[A-Za-z0-9_-]{1,63})*\.?")
"""As browsers send it and resolvers take it; what is of digits and points alone is an address."""
LONGEST_HOST = 255
"""[characters]."""
NETWORK = 64
"""Bits of an IPv6 address that say whose it is: the rest one client chooses freely (RFC 6177, RFC 8981)."""


def host_and_port(text: str) -> tuple[str, int]:
    """Host and TCP port of `text`, `127.0.0.1:5020` or `[::1]:5020`.

    Raises:
        ConfigurationError: it is neither.
    """
    host, _, port = text.rpartition(":")
    if not host or not port.isascii() or not port.isdecimal() or not int(port) <= 65535:
        raise ConfigurationError("expected HOST:PORT, such as 127.0.0.1:5020")
    if host.startswith("[") and host.endswith("]"):
        host = host[1:-1]
    if not names_host(host):
        raise ConfigurationError("expected HOST:PORT, such as 127.0.0.1:5020, its host an address or a name")
    return host, int(port)


def as_written(host: str, port: int) -> str:
    """`host` and `port` as `host_and_port` takes them: an address of IPv6 is in brackets."""
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"


def names_host(text: str) -> bool:
    """Whether `text` is an IP address, or a name that may be one of a machine."""
    try:
        ipaddress.ip_address(text)
    except ValueError:
        digits = text.replace(".", "").isdigit()
        return not digits and len(text) <= LONGEST_HOST and HOST_NAME.fullmatch(text) is not None
    return True


def is_loopback(host: str) -> bool:
    """Whether `host` can only be reached from this machine."""
    if host == "localhost":
        return True
    try:
        return plain(host).is_loopback
    except ValueError:
        return False


def plain(text: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address:
    """The address of `text`: one of IPv4 in the clothes of IPv6 (`::ffff:192.0.2.7`) as IPv4, without the zone.

    Raises:
        ValueError: it is none.
    """
    address = ipaddress.ip_address(text.partition("%")[0])
    return getattr(address, "ipv4_mapped", None) or address


def client_of(text: str) -> str:
    """What limits per address count by: of IPv4 the address, of IPv6 its network of `NETWORK` bits, all of this machine as one.

    What is no address stays as it is.
    """
    try:
        address = plain(text)
    except ValueError:
        return text
    if address.is_loopback:
        return "127.0.0.1"
    if address.version == 4:
        return str(address)
    return str(ipaddress.IPv6Network((int(address) >> 128 - NETWORK << 128 - NETWORK, NETWORK)))
