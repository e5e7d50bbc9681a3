"""Files that only the server may read."""

import errno
import os
from pathlib import Path

import pytest

from app.access import access
from app.access.access import lock
from app.access.first_code import FirstCode
from app.access.keys import OPENED, PRIVATE, check_files, prepare, read_key
from app.errors import ConfigurationError


def test_two_installations_have_different_keys(tmp_path: Path) -> None:
    first, second = tmp_path / "a.key", tmp_path / "b.key"
    assert read_key(first) != read_key(second)
    assert read_key(first) == read_key(first)
    assert first.stat().st_mode & 0o777 == 0o600


def test_the_folder_and_the_database_are_private_whatever_the_umask(tmp_path: Path) -> None:
    before = os.umask(0)
    try:
        prepare(tmp_path / "data")
        read_key(tmp_path / "data" / "secret.key")
    finally:
        os.umask(before)
    assert (tmp_path / "data").stat().st_mode & 0o777 == 0o700
    assert {path.stat().st_mode & 0o777 for path in (tmp_path / "data").iterdir()} == {0o600}


@pytest.mark.parametrize("name", PRIVATE)
@pytest.mark.parametrize("mode", [0o640, 0o604, 0o620, 0o666])
def test_a_file_that_others_may_read_is_refused_by_name(tmp_path: Path, name: str, mode: int) -> None:
    prepare(tmp_path / "data")
    path = tmp_path / "data" / name
    path.touch()
    path.chmod(mode)
    with pytest.raises(ConfigurationError, match=f"{name}.*{mode:04o}.*chmod 0600"):
        check_files(tmp_path / "data")


@pytest.mark.parametrize("name", PRIVATE)
def test_a_folder_in_place_of_a_file_is_no_matter_of_its_mode(tmp_path: Path, name: str) -> None:
    (tmp_path / name).mkdir()
    (tmp_path / name).chmod(0o755)
    with pytest.raises(ConfigurationError, match=f"{name} is a folder .*: move it away") as refused:
        check_files(tmp_path)
    assert "chmod" not in str(refused.value)


def test_a_folder_that_everybody_may_write_is_refused(tmp_path: Path) -> None:
    (tmp_path / "data").mkdir()
    (tmp_path / "data").chmod(0o777)
    with pytest.raises(ConfigurationError, match="chmod 0700"):
        prepare(tmp_path / "data")


@pytest.mark.parametrize("text", ["", "zz", "00" * 31, "hello"])
def test_a_broken_key_is_refused_and_not_replaced(tmp_path: Path, text: str) -> None:
    path = tmp_path / "secret.key"
    path.write_text(text)
    with pytest.raises(ConfigurationError, match=r"secret\.key"):
        read_key(path)
    assert path.read_text() == text


def full(_handle: int) -> None:
    raise OSError(errno.ENOSPC, "No space left on device")


def test_a_key_that_finds_no_room_is_one_line_and_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(ConfigurationError, match=r"secret\.key cannot be written: No space left on device"):
        read_key(tmp_path / "secret.key")
    assert list(tmp_path.iterdir()) == []


def test_a_first_code_that_finds_no_room_is_good_all_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "fsync", full)
    code = FirstCode(tmp_path)
    assert code.matches(code.renew())
    assert list(tmp_path.iterdir()) == []


def test_one_data_folder_has_one_server(tmp_path: Path) -> None:
    held = lock(tmp_path)
    with pytest.raises(ConfigurationError, match="another pogon"):
        lock(tmp_path)
    os.close(held)
    os.close(lock(tmp_path))


@pytest.mark.parametrize("name", OPENED)
def test_a_pipe_among_the_files_of_the_folder_is_refused_by_name_and_keeps_nobody_waiting(
    tmp_path: Path, name: str
) -> None:
    os.mkfifo(tmp_path / name, 0o600)
    with pytest.raises(ConfigurationError, match=rf"{name}: a pipe, .* expected an ordinary file"):
        access.prepare(tmp_path)


def test_a_lock_that_is_no_file_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "server.lock").mkdir()
    with pytest.raises(ConfigurationError, match=r"server\.lock: Is a directory, expected an ordinary file"):
        lock(tmp_path)


def test_a_key_that_is_no_file_or_no_key_is_one_line(tmp_path: Path) -> None:
    path = tmp_path / "secret.key"
    os.mkfifo(path)
    with pytest.raises(ConfigurationError, match="is not a key"):
        read_key(path)
    path.unlink()
    for content in (b"\xff" * 64, b"ab" * 40_000, b"", b"zz" * 32):
        path.write_bytes(content)
        with pytest.raises(ConfigurationError, match="key"):
            read_key(path)
