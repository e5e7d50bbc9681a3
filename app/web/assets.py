"""Static files under names that contain their content: fetched once, kept for ever, never stale.

`url("css/frame.css")` is `/static/css/frame.3f2a….css`, answered with `immutable`. The plain name works too (scripts import each other by
it) and is asked for again with its ETag. What a style sheet or a script names by the way from its own folder (`url("../vendor/a.woff2")`,
`from "./format.js"`) gets its lasting name when it is read; scripts must not import each other in a circle.

An equipment type brings `screens/<type>.css` and `.js` for its screens, and `screens/<type>.tile.css` for its tile on the overview.
"""

import gzip
import hashlib
import logging
import posixpath
import re
from dataclasses import dataclass
from functools import lru_cache
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
NAMED = re.compile(rb'(?P<how>\burl\(|\bfrom )"(?P<way>\.{1,2}/[^"]+)"')
REMARK = re.compile(rb"""(?P<text>"[^"\n]*"|'[^'\n]*')|/\*.*?\*/""", re.DOTALL)
"""A comment of a style sheet, or a text in quotes, in which nothing is one."""
JOINED = {
    "css/pages.css": tuple(
        f"css/{name}.css"
        for name in (
            *(
                "font",
                "tokens",
                "base",
                "frame",
                "panel",
                "value",
                "indicators",
                "commands",
                "forms",
                "tables",
                "overlays",
            ),
            *("plot", "operation", "screens/faceplate", "screens/palette"),
        )
    ),
    "css/glance.css": ("css/screens/overview.css", "css/screens/plant_picture.css", "css/mimic.css"),
}
"""Several files that are fetched as one, in their order: what all pages need, and what the overview and areas do."""
HASHED = re.compile(r"^(?P<stem>.+)\.(?P<hash>[0-9a-f]{12})(?P<suffix>\.[a-z0-9]+)$")


@dataclass(frozen=True, slots=True)
class Asset:
    """One file as it is on disk now."""

    name: str
    path: Path
    stamp: tuple[object, ...]
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

    def of_screen(self, kind: str, *endings: str) -> list[str]:
        """Addresses of what an equipment type brings for its screens, found by name: `screens/<kind><ending>` for those that are there."""
        names = [f"screens/{kind}{ending}" for ending in endings]
        return [self.url(name) for name in names if self._find(name) is not None]

    @property
    def build(self) -> str:
        """Short name of this version of program and pages: other when a page that is open should be loaded anew."""
        digest = hashlib.sha256(__version__.encode())
        for folder in ("css", "js", "screens"):
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
        if name in JOINED:
            return self._joined(name)
        known = self._known.get(name)
        if known is None and not _allowed(name):
            return None
        path = known.path if known is not None else self._folder / name
        try:
            status = path.stat()
            stamp = (status.st_mtime_ns, status.st_size, status.st_ino, status.st_dev)
            if known is None or known.stamp != stamp:  # a page asks for forty files: what is known costs one look
                if not path.is_file() or not path.resolve().is_relative_to(self._folder):
                    return None
                known = self._known[name] = _asset(name, path, stamp, self._lasting(name, path.read_bytes()))
        except (OSError, ValueError):
            return None
        return known

    def _joined(self, name: str) -> Asset | None:
        parts = [part for part in map(self._find, JOINED[name]) if part is not None]
        stamp, known = tuple(part.hash for part in parts), self._known.get(name)
        if parts and (known is None or known.stamp != stamp):
            content = b"\n".join(part.content for part in parts)
            known = self._known[name] = _asset(name, self._folder / name, stamp, content)
        return known if parts else None

    def _lasting(self, name: str, content: bytes) -> bytes:
        """`content` of the file `name`, with the lasting names of what it names; a sheet of ours without its comments."""
        if not name.endswith((".css", ".js")) or name.startswith("vendor/"):
            return content
        if name.endswith(".css"):
            content = REMARK.sub(lambda found: found["text"] or b"", content)
        folder = posixpath.dirname(name)

        def lasting(found: re.Match[bytes]) -> bytes:
            url = self.url(posixpath.normpath(f"{folder}/{found['way'].decode()}"))
            return found["how"] + b'"' + url.encode() + b'"'

        return NAMED.sub(lasting, content)


def _allowed(name: str) -> bool:
    """Whether a file of this name may be served."""
    return Path(name).suffix in TYPES and not any(
        part in ("", "..") or part.startswith(".") for part in name.split("/")
    )


def _asset(name: str, path: Path, stamp: tuple[object, ...], content: bytes) -> Asset:
    packs = path.suffix in COMPRESSED and len(content) >= SMALLEST
    return Asset(
        name, path, stamp, hashlib.sha256(content).hexdigest()[:12], content, _packed(content) if packs else None
    )


@lru_cache(maxsize=256)
def _packed(content: bytes) -> bytes:
    """Once in a process, however many applications it has."""
    return gzip.compress(content, 9, mtime=0)
