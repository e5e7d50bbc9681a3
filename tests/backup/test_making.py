"""A backup is taken beside a running server, and only holds what was asked for."""

import fcntl
import os
from pathlib import Path

import pytest

from app.backup import back_up, table_counts
from app.db import Database
from app.errors import ConfigurationError
from app.historian import store
from tests.backup.shelf import BEGIN, restore
from tests.virtual import inline


def test_keys_are_only_in_it_when_asked_for(data: Path, plant: Path, tmp_path: Path) -> None:
    secrets = [(data / name).read_bytes().strip() for name in ("audit.key", "secret.key")]
    back_up(tmp_path / "b.tar", data, plant)
    assert not any(secret in (tmp_path / "b.tar").read_bytes() for secret in secrets)
    back_up(tmp_path / "k.tar", data, plant, keys=True)
    assert all(secret in (tmp_path / "k.tar").read_bytes() for secret in secrets)


@pytest.mark.sweep(8)
def test_a_backup_is_taken_while_the_databases_are_written(data: Path, plant: Path, tmp_path: Path) -> None:
    history = Database(data / "history.db", "history", inline)
    for i in range(5):
        for k in range(20):
            t = BEGIN + 10**6 + i * 1000 + k
            history.submit(lambda c, t=t: store.append(c, [(1, t, 1.0, None, 0)], BEGIN, t))  # type: ignore[misc]
        manifest = back_up(tmp_path / f"b{i}.tar", data, plant)
        assert manifest.counts["history.db"]["sample"] >= 500
    history.close()


def test_without_history_the_history_of_the_machine_stays(data: Path, plant: Path, tmp_path: Path) -> None:
    back_up(tmp_path / "b.tar", data, plant, history=False)
    restore(tmp_path / "b.tar", data)
    assert table_counts(data / "history.db")["sample"] == 500


@pytest.mark.parametrize("name", ["data?mode=rw", "data#2", "50%25 %2e", "č ć"])
def test_whatever_the_folder_is_called_its_own_databases_are_in_the_backup(
    data: Path, plant: Path, tmp_path: Path, name: str
) -> None:
    odd = data.rename(tmp_path / name)
    manifest = back_up(tmp_path / "b.tar", odd, plant)
    assert manifest.counts["history.db"]["sample"] == 500 and "person" in manifest.counts["pogon.db"]
    assert {one.name for one in tmp_path.iterdir()} >= {name, "b.tar"} and not (tmp_path / "data").exists()


def test_nothing_is_replaced(data: Path, plant: Path, tmp_path: Path) -> None:
    (tmp_path / "b.tar").write_text("mine")
    with pytest.raises(ConfigurationError, match="exists already"):
        back_up(tmp_path / "b.tar", data, plant)
    back_up(tmp_path / "c.tar", data, plant)
    with pytest.raises(ConfigurationError, match="has files already"):
        restore(tmp_path / "c.tar", tmp_path / "new", plant)
    with pytest.raises(ConfigurationError, match="nothing to back up"):
        back_up(tmp_path / "d.tar", tmp_path / "empty", plant)


def test_a_folder_that_is_not_there_is_not_made(data: Path, plant: Path, tmp_path: Path) -> None:
    """A typing mistake, or a disk that is not mounted: a backup in its place would be looked for in vain."""
    (tmp_path / "file").touch()
    for folder in (tmp_path / "mnt" / "nas", tmp_path / "file"):
        with pytest.raises(ConfigurationError, match="is no folder: a backup makes none"):
            back_up(folder / "b.tar", data, plant)
    (tmp_path / "dangling.tar").symlink_to(tmp_path / "mnt" / "b.tar")
    with pytest.raises(ConfigurationError, match="exists already"):
        back_up(tmp_path / "dangling.tar", data, plant)
    assert not (tmp_path / "mnt").exists()


def test_a_backup_has_a_plant(data: Path, plant: Path, tmp_path: Path) -> None:
    """Whoever mistypes its folder, or whose disk is not mounted, would find out when he restores."""
    (tmp_path / "file").touch()
    (tmp_path / "linked").mkdir()
    (tmp_path / "linked" / "plant.toml").symlink_to(plant / "plant.toml")
    for folder in (tmp_path / "mnt", tmp_path / "file", tmp_path, tmp_path / "linked"):
        with pytest.raises(ConfigurationError, match=rf"{folder}/plant\.toml is not there, or no ordinary file"):
            back_up(tmp_path / "b.tar", data, folder)
    assert not (tmp_path / "b.tar").exists()


@pytest.mark.parametrize("name", ["pogon.db", "history.db"])
@pytest.mark.parametrize("damage", ["rubbish", "cut", "page"])
def test_a_database_that_cannot_be_copied_is_one_line_and_no_archive(
    data: Path, plant: Path, tmp_path: Path, name: str, damage: str
) -> None:
    path = data / name
    whole = path.read_bytes()
    page = b"\xa5" * 4096 * 4
    damaged = {
        "rubbish": page,
        "cut": whole[: len(whole) // 2],
        "page": whole[:4096] + page + whole[4096 + len(page) :],
    }
    path.write_bytes(damaged[damage])
    with pytest.raises(ConfigurationError, match=name):
        back_up(tmp_path / "b.tar", data, plant)
    assert sorted(one.name for one in tmp_path.iterdir()) == ["data", "plant"]


def test_a_plant_that_lost_its_database_has_no_backup(data: Path, plant: Path, tmp_path: Path) -> None:
    (data / "pogon.db").write_bytes(b"")
    with pytest.raises(ConfigurationError, match="is empty, but this folder is of a plant that had accounts"):
        back_up(tmp_path / "b.tar", data, plant)
    assert not (tmp_path / "b.tar").exists()


def test_what_a_killed_backup_left_is_removed_by_the_next(data: Path, plant: Path, tmp_path: Path) -> None:
    stale, used = tmp_path / ".pogon-stale", tmp_path / ".pogon-used"
    for folder in (stale, used):
        folder.mkdir()
        (folder / "pogon.db").write_text("x")
    handle = os.open(used, os.O_RDONLY)
    fcntl.flock(handle, fcntl.LOCK_EX)
    back_up(tmp_path / "b.tar", data, plant)
    assert not stale.exists() and used.exists(), "another backup goes on"
    os.close(handle)
    back_up(tmp_path / "c.tar", data, plant)
    assert not list(tmp_path.glob(".pogon-*"))
