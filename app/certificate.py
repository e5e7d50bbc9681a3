"""When a TLS certificate ends."""

import ssl
from contextlib import suppress
from pathlib import Path
from typing import Any


def end_of(cert: Path) -> float:
    """When the first certificate of a PEM file ends [s since 1970]. The standard library knows, and says it only here.

    Raises:
        OSError: the file cannot be read.
        ValueError: this Python cannot tell.
    """
    decode: Any = getattr(getattr(ssl, "_ssl", None), "_test_decode_cert", None)
    if decode is None:
        raise ValueError("the end of a certificate cannot be read by this Python")
    return ssl.cert_time_to_seconds(decode(str(cert))["notAfter"])


def end_if_known(cert: Path | None) -> int | None:
    """When it ends [µs UTC]; None without a certificate, and when nobody can tell."""
    with suppress(OSError, ValueError):
        return round(end_of(cert) * 1e6) if cert is not None else None
    return None
