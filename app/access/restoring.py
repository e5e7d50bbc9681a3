"""The second half of a restore: a journal of renames that is done whole, at once or at the next start, or taken back whole.

A restore puts everything beside what is there and writes `restore.journal` twice: "staged" before its first file (all of it is removed
again), "committed" when everything lies on the disk (the renames are done, each once). Between the two writes nothing changes.
"""

import fcntl
import json
import os
import shutil
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path

from app.access.private import check_entered, write_private
from app.errors import ConfigurationError
from app.files import read_text

JOURNAL = "restore.journal"
UNTOLD = "restore.untold"
"""What was restored, until the audit that came with it has its line: one that a kill left is told by the next start."""
LONGEST = 4_000_000
"""Of a journal [bytes]."""


def stage(data: Path, remove: Iterable[Path]) -> None:
    """Say that `remove` is being filled and belongs to nobody yet."""
    _write(data, {"state": "staged", "moves": [], "remove": [str(path) for path in remove]})


def commit(data: Path, moves: Sequence[tuple[Path, Path]], remove: Iterable[Path]) -> None:
    """From here on the restore happens: rename each (from, to), then remove what is left of `remove`."""
    pairs = [(str(source), str(target)) for source, target in moves]
    _write(data, {"state": "committed", "moves": pairs, "remove": [str(path) for path in remove]})


def note_untold(folder: Path, archive: str, made: str, *, signed: bool) -> Path:
    """Put what is being restored beside it in `folder`; returns the file."""
    path = folder / UNTOLD
    path.write_text(json.dumps({"archive": archive, "made": made, "signed": signed}), "utf-8")
    path.chmod(0o600)
    return path


def untold(data: Path) -> dict[str, object] | None:
    """What was restored into `data` and has no line in its audit: `archive`, `made`, `signed`; None = nothing."""
    try:
        found = json.loads(read_text(data / UNTOLD, LONGEST))
        return {name: found[name] for name in ("archive", "made", "signed")}
    except (ConfigurationError, ValueError, KeyError, TypeError, RecursionError):
        return None


def told(data: Path) -> None:
    """The audit has the line of what was restored."""
    (data / UNTOLD).unlink(missing_ok=True)


def is_interrupted(data: Path) -> bool:
    """Whether a restore was interrupted, which the next start ends.

    Raises:
        ConfigurationError: its journal cannot be read, so no start ends it.
    """
    journal = data / JOURNAL
    if not journal.exists():
        return False
    _read(journal)
    return True


def finish_restore(data: Path, *, locked: bool = False) -> str:
    """Do or take back what an interrupted restore left: "staged" = taken back, "committed" = done, empty = there was none.

    `locked`: the caller holds the lock of the folder.

    Raises:
        ConfigurationError: a restore runs on it right now, its journal or the folder cannot be read, or the disk refuses.
    """
    check_entered(data)
    journal = data / JOURNAL
    if not journal.exists() and not any(_half_written(data)):
        return ""
    try:
        handle = os.open(data / "server.lock", os.O_CREAT | os.O_RDWR, 0o600)
    except OSError as error:
        raise ConfigurationError(
            f"{data / 'server.lock'}: {error.strerror}; without it an interrupted restore cannot be finished"
        ) from error
    try:
        if not locked:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        for left in _half_written(data):
            left.unlink()
        if not journal.exists():
            return ""
        state, moves, remove = _read(journal)
        for source, target in moves:
            _move(source, target)
        for folder in dict.fromkeys(path.parent for pair in moves for path in pair):
            if folder.exists():  # the emptied one may be gone already
                sync_folder(folder)
        for path in remove:
            if not path.name.startswith((".restore-", "before-restore-")):
                raise ConfigurationError(f"{journal}: {path} is nothing that a restore leaves")
            if path.name.startswith("."):
                shutil.rmtree(path, ignore_errors=True)
            else:
                with suppress(OSError):
                    path.rmdir()  # what was there is in it when the restore is done: then it stays
        journal.unlink()
        sync_folder(data)
        return state
    except BlockingIOError as error:
        raise ConfigurationError(
            f"POGON_DATA={data}: a restore runs on it, or a server; try again when it is done"
        ) from error
    except OSError as error:
        raise ConfigurationError(f"{journal}: the restore cannot be finished: {error.strerror or error}") from error
    finally:
        os.close(handle)


def sync_tree(folder: Path) -> None:
    """Have everything below `folder` on the disk."""
    for path in folder.rglob("*"):
        if path.is_file() and not path.is_symlink():
            with path.open("rb") as file:
                os.fsync(file.fileno())
        elif path.is_dir():
            sync_folder(path)
    sync_folder(folder)


def sync_folder(folder: Path) -> None:
    """Have the names in `folder` on the disk."""
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _half_written(data: Path) -> Iterator[Path]:
    """Journals whose writing was interrupted."""
    return data.glob(f".{JOURNAL}.*")


def _move(source: Path, target: Path) -> None:
    """Rename once: what was done before the interruption is not done again."""
    if not source.exists() or (target.exists() and not _is_empty_folder(target)):
        return
    source.replace(target)


def _is_empty_folder(path: Path) -> bool:
    return path.is_dir() and not any(path.iterdir())


def _write(data: Path, content: dict[str, object]) -> None:
    write_private(data / JOURNAL, json.dumps(content))
    sync_folder(data)


def _read(journal: Path) -> tuple[str, list[tuple[Path, Path]], list[Path]]:
    try:
        content = json.loads(read_text(journal, LONGEST))
        state = str(content["state"])
        moves = [(Path(source), Path(target)) for source, target in content["moves"]]
        return state, moves, [Path(path) for path in content["remove"]]
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise ConfigurationError(f"{journal}: expected the journal of a restore; nothing was changed") from error
