"""Addresses as people write them: HOST:PORT, what a host may be called, and whether it is this machine."""

import ipaddress
import re

from app.errors import ConfigurationError

HOST_NAME = re.compile(r"(?!-)[A-Za-z0-9_-]{1,63}(\.(?!-)[A-Za-z0-9_-]{1,63})*\.?")
"""As browsers send it and resolvers take it; what is of digits and points alone is an address."""
LONGEST_HOST = 255
"""[characters]."""


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
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
