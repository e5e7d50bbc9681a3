"""A private file is never read by others, and never half written."""

import os
from pathlib import Path

import pytest

from app.access.private import write_private


@pytest.mark.parametrize("mask", [0o000, 0o022, 0o077])
@pytest.mark.parametrize("before", [None, "old", "a much longer text that was there before"])
def test_only_its_owner_reads_it_and_it_is_whole(tmp_path: Path, before: str | None, mask: int) -> None:
    path = tmp_path / "key"
    if before is not None:
        path.write_text(before)
        path.chmod(0o644)
    former = os.umask(mask)
    try:
        write_private(path, "čćž new")
    finally:
        os.umask(former)
    assert path.read_text("utf-8") == "čćž new"
    assert path.stat().st_mode & 0o777 == 0o600
    assert [one.name for one in tmp_path.iterdir()] == ["key"]


def test_an_exclusive_one_leaves_what_is_there(tmp_path: Path) -> None:
    path = tmp_path / "key"
    for text in ("first", "second"):
        write_private(path, text, exclusive=True)
    assert path.read_text() == "first"
    assert [one.name for one in tmp_path.iterdir()] == ["key"]


@pytest.mark.parametrize("refused", ["fsync", "replace"])
def test_a_disk_that_refuses_leaves_the_old_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, refused: str) -> None:
    path = tmp_path / "key"
    path.write_text("old")

    def refuse(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os if refused == "fsync" else Path, refused, refuse)
    with pytest.raises(OSError, match="No space"):
        write_private(path, "new")
    assert path.read_text() == "old"
    assert [one.name for one in tmp_path.iterdir()] == ["key"]
