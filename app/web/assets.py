"""Static files under names that contain their content: fetched once, kept for ever, never stale.

`url("css/frame.css")` is `/static/css/frame.3f2a….css`, answered with `immutable`. The plain name works too (scripts import each other by
it) and is asked for again with its ETag.
"""

import gzip
import hashlib
import logging
import re
from dataclasses import dataclass
from pathlib import Path

from fastapi import Request
from fastapi.responses import Response
from starlette.exceptions import HTTPException

from app import __version__

log = logging.getLogger(__name__)

TYPES = {
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
    ".png": "image/png",
    ".ico": "image/x-icon",
    ".woff2": "font/woff2",
    ".txt": "text/plain; charset=utf-8",
}
"""What is served; a file of another kind is not there."""
COMPRESSED = {".css", ".js", ".svg", ".txt"}
SMALLEST = 1024
"""Below this, compressing costs more than it saves [bytes]."""
HASHED = re.compile(r"^(?P<stem>.+)\.(?P<hash>[0-9a-f]{12})(?P<suffix>\.[a-z0-9]+)$")


@dataclass(frozen=True, slots=True)
class Asset:
    """One file as it is on disk now."""

    name: str
    stamp: tuple[int, int]
    hash: str
    content: bytes
    packed: bytes | None


class Assets:
    """The folder `static`."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder.resolve()
        self._known: dict[str, Asset] = {}
        self._missing: set[str] = set()

    def url(self, name: str) -> str:
        """Address of the file `name` (`css/frame.css`); the plain one, with a line in the log, when there is no such file."""
        asset = self._find(name)
        if asset is None:
            if name not in self._missing:
                self._missing.add(name)
                log.warning("static file missing name=%s", name)
            return f"/static/{name}"
        stem, _, suffix = name.rpartition(".")
        return f"/static/{stem}.{asset.hash}.{suffix}"

    @property
    def build(self) -> str:
        """Short name of this version of program and pages: other when a page that is open should be loaded anew."""
        digest = hashlib.sha256(__version__.encode())
        for folder in ("css", "js"):
            for path in sorted((self._folder / folder).rglob("*.*")):
                if asset := self._find(path.relative_to(self._folder).as_posix()):
                    digest.update(asset.hash.encode())
        return digest.hexdigest()[:12]

    def respond(self, request: Request, name: str) -> Response:
        """The file as an answer.

        Raises:
            HTTPException: 404, there is no such file.
        """
        match = HASHED.match(name)
        asset = self._find(match["stem"] + match["suffix"]) if match else None
        lasting = asset is not None and match is not None and match["hash"] == asset.hash
        asset = asset or self._find(name)
        if asset is None:
            raise HTTPException(404)
        headers = {
            "Cache-Control": "public, max-age=31536000, immutable" if lasting else "no-cache",
            "ETag": f'"{asset.hash}"',
            "Vary": "Accept-Encoding",
        }
        if asset.hash in request.headers.get("if-none-match", ""):
            return Response(status_code=304, headers=headers)
        body = asset.content
        if asset.packed is not None and "gzip" in request.headers.get("accept-encoding", ""):
            body = asset.packed
            headers["Content-Encoding"] = "gzip"
        return Response(body, media_type=TYPES[Path(asset.name).suffix], headers=headers)

    def _find(self, name: str) -> Asset | None:
        if Path(name).suffix not in TYPES or any(
            part in ("", "..") or part.startswith(".") for part in name.split("/")
        ):
            return None
        path = self._folder / name
        try:
            status = path.stat()
            if not path.is_file() or not path.resolve().is_relative_to(self._folder):
                return None
            stamp = (status.st_mtime_ns, status.st_size)
            known = self._known.get(name)
            if known is None or known.stamp != stamp:
                known = self._known[name] = _load(path, name, stamp)
        except (OSError, ValueError):
            return None
        return known


def _load(path: Path, name: str, stamp: tuple[int, int]) -> Asset:
    content = path.read_bytes()
    packed = None
    if path.suffix in COMPRESSED and len(content) >= SMALLEST:
        packed = gzip.compress(content, 9, mtime=0)
    return Asset(name, stamp, hashlib.sha256(content).hexdigest()[:12], content, packed)
