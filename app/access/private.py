"""Writing files that nobody else may read, in a folder that we may use."""

import os
from pathlib import Path

from app import chance
from app.errors import ConfigurationError


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


def check_entered(data: Path) -> None:
    """Refuse a data folder into which whoever runs this may not look. One that is not there is none of these.

    Raises:
        ConfigurationError: names it, why, and whose it is.
    """
    try:
        (data / "server.lock").stat()
    except (FileNotFoundError, NotADirectoryError):
        return
    except PermissionError as error:
        raise ConfigurationError(
            f"POGON_DATA={data} cannot be used: {error.strerror}; expected to be run by {_owner(data)}"
        ) from error
    except OSError as error:
        raise ConfigurationError(f"POGON_DATA={data} cannot be used: {error.strerror}") from error


def _owner(data: Path) -> str:
    try:
        return f"its owner, {data.owner()}"
    except (OSError, KeyError):  # a folder above is closed, too, or nobody has this number
        return "its owner"
