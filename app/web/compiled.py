"""What templates were compiled to, kept from one start to the next as Python keeps its byte code.

To compile the templates of the first page takes half a second. What is kept lies where Python keeps the byte code of this folder: who may
write there may as well change the program. A file is taken only when it is of this program, Jinja and Python, of exactly this template,
whole, and nobody but its owner (we, or root) can have written it; else the template is compiled. `PYTHONDONTWRITEBYTECODE` and a folder
that is read only mean what they mean to Python: nothing is kept. `app/web/compile_templates.py` compiles all that there are, for an
installation whose server may not write into it.
"""

import hashlib
import marshal
import os
import stat
import sys
from contextlib import suppress
from pathlib import Path
from tempfile import NamedTemporaryFile
from types import CodeType
from typing import Any

import jinja2

from app import __version__

FOLDER = Path(__file__).parent / "__pycache__" / "templates"
OPTIONS: dict[str, Any] = {"autoescape": True, "trim_blocks": True, "lstrip_blocks": True}
"""What our templates are compiled with."""
VIEW = hashlib.sha256((Path(__file__).parent / "view.py").read_bytes()).hexdigest()
"""Of what says how templates are compiled, which changes between two versions as well."""
MAKER = repr((__version__, VIEW, jinja2.__version__, sys.version, sys.flags.optimize, sorted(OPTIONS.items())))
"""Who compiled; what another one made is not taken."""
DIGEST = hashlib.sha256().digest_size


class KeptCode:
    """The folder of what is kept; it is made when it is missing."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def read(self, key: str, checksum: str) -> tuple[list[str], CodeType] | None:
        """The templates that template `key` names, and its code; None when there is nothing that may be taken.

        `checksum`: of its source.
        """
        try:
            if not _only_ours(self._folder.stat()):
                return None
            with open(
                os.open(self._path(key), os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC), "rb"
            ) as file:
                status = os.fstat(file.fileno())
                if not stat.S_ISREG(status.st_mode) or not _only_ours(status):
                    return None
                found, kept = file.read(DIGEST), file.read()
        except OSError:
            return None
        if found != _digest(key, checksum, kept):
            return None
        names, code = marshal.loads(kept)
        return names, code

    def write(self, key: str, checksum: str, names: list[str], code: CodeType) -> None:
        """Keep it, as a whole or not at all; where that cannot be done it is not."""
        if sys.dont_write_bytecode:
            return
        kept = marshal.dumps((names, code))
        with suppress(OSError):
            self._folder.mkdir(0o755, parents=True, exist_ok=True)
            if not _only_ours(self._folder.stat()):
                return
            with NamedTemporaryFile(dir=self._folder, delete=False) as file:
                spare = Path(file.name)
                try:
                    file.write(_digest(key, checksum, kept) + kept)
                    file.flush()
                    spare.chmod(self._mode())
                    spare.replace(self._path(key))
                except OSError:
                    spare.unlink()

    def _path(self, key: str) -> Path:
        return self._folder / f"{key}.{sys.implementation.cache_tag}.jinja"

    def _mode(self) -> int:
        """Who may read the folder may read the file: one account may install and another run."""
        return 0o600 | (self._folder.stat().st_mode & 0o044)


def _only_ours(status: os.stat_result) -> bool:
    """Whether nobody but this account, or root, can have written it."""
    return status.st_uid in (os.geteuid(), 0) and not status.st_mode & 0o022


def _digest(key: str, checksum: str, kept: bytes) -> bytes:
    return hashlib.sha256("\n".join((MAKER, key, checksum, "")).encode() + kept).digest()
