"""Addresses as people write them: HOST:PORT, and whether a host is this machine."""

import ipaddress

from app.errors import ConfigurationError


def host_and_port(text: str) -> tuple[str, int]:
    """Host and TCP port of `text`, `127.0.0.1:5020` or `[::1]:5020`.

    Raises:
        ConfigurationError: it is neither.
    """
    host, _, port = text.rpartition(":")
    if not host or not port.isascii() or not port.isdecimal() or not int(port) <= 65535:
        raise ConfigurationError("expected HOST:PORT, such as 127.0.0.1:5020")
    return host.removeprefix("[").removesuffix("]"), int(port)


def is_loopback(host: str) -> bool:
    """Whether `host` can only be reached from this machine."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
