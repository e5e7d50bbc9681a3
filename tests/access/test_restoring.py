"""A restore's journal: whatever state it is found in, the renames are done whole, or what was staged is removed whole."""

import fcntl
import json
from pathlib import Path

import pytest

from app.access.restoring import JOURNAL, commit, finish_restore, stage, sync_tree
from app.errors import ConfigurationError

NAMES = ("pogon.db", "history.db", "plant")


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """A data folder, what a restore put beside it, and where what is there goes."""
    data = tmp_path / "data"
    (data / "plant").mkdir(parents=True)
    (data / "plant" / "plant.toml").write_text("old")
    for name in NAMES[:2]:
        (data / name).write_text("old")
    fresh = data / ".restore-1"
    (fresh / "plant").mkdir(parents=True)
    (fresh / "plant" / "plant.toml").write_text("new")
    for name in NAMES[:2]:
        (fresh / name).write_text("new")
    (data / "before-restore-1").mkdir()
    sync_tree(data)
    return data


def moves(data: Path) -> list[tuple[Path, Path]]:
    fresh, before = data / ".restore-1", data / "before-restore-1"
    return [pair for name in NAMES for pair in ((data / name, before / name), (fresh / name, data / name))]


def removed(data: Path) -> list[Path]:
    return [data / ".restore-1", data / "before-restore-1"]


def contents(data: Path) -> set[str]:
    return {(data / name / "plant.toml" if name == "plant" else data / name).read_text() for name in NAMES}


def test_without_a_journal_there_is_nothing_to_do(data: Path) -> None:
    assert finish_restore(data) == ""
    assert contents(data) == {"old"}


def test_what_was_staged_only_is_taken_back(data: Path) -> None:
    stage(data, removed(data))
    assert finish_restore(data) == "staged"
    assert contents(data) == {"old"}
    assert sorted(path.name for path in data.iterdir()) == [*sorted(NAMES), "server.lock"]
    assert finish_restore(data) == ""


@pytest.mark.parametrize("done", range(2 * len(NAMES) + 1))
def test_what_was_committed_is_done_wherever_it_was_interrupted(data: Path, done: int) -> None:
    commit(data, moves(data), removed(data))
    for source, target in moves(data)[:done]:
        source.replace(target)
    assert finish_restore(data) == "committed"
    assert contents(data) == {"new"}
    assert contents(data / "before-restore-1") == {"old"}
    assert not (data / ".restore-1").exists()
    assert not (data / JOURNAL).exists()


def test_a_journal_that_was_half_written_is_none(data: Path) -> None:
    (data / f".{JOURNAL}.0123abcd").write_text('{"state": "comm')
    assert finish_restore(data) == ""
    assert not list(data.glob(f".{JOURNAL}.*"))
    assert contents(data) == {"old"}


@pytest.mark.parametrize(
    "content",
    [
        "",
        "{}",
        "[]",
        "null",
        "5",
        '{"state": "committed"}',
        '{"state": 1, "moves": 5, "remove": []}',
        '{"moves": [["a"]]}',
        "[" * 5000,
        "\x00",
    ],
)
def test_a_journal_that_is_none_changes_nothing_and_stays(data: Path, content: str) -> None:
    (data / JOURNAL).write_text(content)
    with pytest.raises(ConfigurationError, match=r"restore\.journal"):
        finish_restore(data)
    assert contents(data) == {"old"}
    assert (data / JOURNAL).exists()


@pytest.mark.parametrize("name", ["plant", "..", "pogon.db", "restore-1"])
def test_nothing_but_what_a_restore_leaves_is_removed(data: Path, name: str) -> None:
    (data / JOURNAL).write_text(json.dumps({"state": "staged", "moves": [], "remove": [str(data / name)]}))
    with pytest.raises(ConfigurationError, match="nothing that a restore leaves"):
        finish_restore(data)
    assert contents(data) == {"old"}


def test_while_somebody_holds_the_folder_it_waits(data: Path) -> None:
    stage(data, removed(data))
    with (data / "server.lock").open("w") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        with pytest.raises(ConfigurationError, match="a restore runs on it"):
            finish_restore(data)
        assert finish_restore(data, locked=True) == "staged"
