"""Anchors are added to a file elsewhere, which nobody else may read."""

from pathlib import Path

import pytest

from app.access.audit.anchors import to_file


def test_every_anchor_is_a_line_behind_the_others(tmp_path: Path) -> None:
    path = tmp_path / "anchors"
    for tell in (to_file(path), to_file(path)):
        tell("1 2 ab - cd")
        tell("2 3 ac cd ef")
    assert path.read_text() == "1 2 ab - cd\n2 3 ac cd ef\n" * 2
    assert path.stat().st_mode & 0o777 == 0o600


@pytest.mark.parametrize("what", ["folder", "nowhere"])
def test_a_file_that_cannot_be_written_is_an_error_of_the_system(tmp_path: Path, what: str) -> None:
    path = tmp_path if what == "folder" else tmp_path / "no" / "anchors"
    with pytest.raises(OSError, match="directory"):
        to_file(path)("1 2 ab - cd")
