"""Archives of a small machine, and what is in them."""

import io
import json
import tarfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from app.access.access import Access
from app.access.passwords import Cost
from app.backup import Manifest, Opening
from app.backup import restore as bring_back
from app.backup import verify_backup as verify
from app.clock import SystemClock
from app.db import Database
from tests.virtual import inline

BEGIN = 1_773_036_000_000_000


KEY = bytes(range(32))


OPENING = Opening(KEY)


def restore(archive: Path, data: Path, plant: Path | None = None, opening: Opening = OPENING) -> tuple[Manifest, Path]:
    return bring_back(archive, data, plant, opening=opening)


def verify_backup(archive: Path, opening: Opening = OPENING) -> Manifest:
    return verify(archive, opening)


class _access:
    """People and audit of a folder, closed at the end."""

    def __init__(self, folder: Path) -> None:
        self.db = Database(folder / "pogon.db", "pogon", inline)
        self.db.migrate()
        self.access = Access(self.db, SystemClock(), folder, Cost(1, 64, 1), threads=inline)

    def __enter__(self) -> Access:
        return self.access

    def __exit__(self, *_: object) -> None:
        self.access.close()
        self.db.close()


def rewritten(archive: Path, *, signature: str | None = None, change: Callable[[dict[str, Any]], object]) -> None:
    """The archive with another manifest; its signature as it was, `signature`, or none when that is empty."""
    with tarfile.open(archive) as tar:
        members = [(member, tar.extractfile(member).read()) for member in tar]  # type: ignore[union-attr]
    manifest = json.loads(members[0][1])
    changed = change(manifest)
    contents = [changed if isinstance(changed, bytes) else json.dumps(manifest).encode(), members[1][1]]
    if signature is not None:
        contents[1] = signature.encode()
    with tarfile.open(archive, "w") as tar:
        for (member, _), content in zip(members[:2], contents, strict=True):
            member.size = len(content)
            if content:
                tar.addfile(member, io.BytesIO(content))
        for member, content in members[2:]:
            tar.addfile(member, io.BytesIO(content))
