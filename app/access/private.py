"""Writing files that nobody else may read."""

import os
from pathlib import Path

from app import chance


def write_private(path: Path, text: str, *, exclusive: bool = False) -> None:
    """Write `text` to a file that is private from its first byte on; a reader sees the old text or the new, never half."""
    temporary = path.with_name(f".{path.name}.{chance.token_hex(4)}")
    handle = os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o600)
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        if not exclusive or not path.exists():
            temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)
