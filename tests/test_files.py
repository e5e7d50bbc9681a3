"""Files that others wrote: ordinary ones, of a size, inside their folder; everything else is one line that shows nothing of them."""

import os
import socket
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import pytest

from app.access.private import write_private
from app.clock import SystemClock
from app.errors import MissingFile, UnusableFile
from app.files import exchange_file, open_ordinary, read_bytes, read_text, remove_unfinished


def _pipe(path: Path) -> None:
    os.mkfifo(path)


def _socket(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as one:
        one.bind(str(path))


@pytest.mark.parametrize(("made", "found"), [(Path.mkdir, "a folder"), (_pipe, "a pipe"), (_socket, "a socket")])
def test_what_is_no_ordinary_file_is_named_and_not_waited_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, made: Callable[[Path], None], found: str
) -> None:
    monkeypatch.chdir(tmp_path)
    made(Path("x"))
    with pytest.raises(UnusableFile, match=f"x: {found}, expected an ordinary file"):
        open_ordinary(Path("x"))


def test_a_device_behind_a_link_is_one(tmp_path: Path) -> None:
    (tmp_path / "x").symlink_to("/dev/zero")
    with pytest.raises(UnusableFile, match="a device"):
        read_bytes(tmp_path / "x", 10)


@pytest.mark.parametrize("name", ["missing", "file/missing", "dangling"])
def test_what_is_not_there_is_missing(tmp_path: Path, name: str) -> None:
    (tmp_path / "file").write_text("x")
    (tmp_path / "dangling").symlink_to(tmp_path / "nowhere")
    with pytest.raises(MissingFile, match="no such file"):
        open_ordinary(tmp_path / name)


def test_a_name_that_cannot_be_is_no_traceback(tmp_path: Path) -> None:
    with pytest.raises(UnusableFile):
        open_ordinary(tmp_path / "a\0b")


def test_a_link_may_stay_inside_its_folder_only(tmp_path: Path) -> None:
    inside = tmp_path / "plant"
    inside.mkdir()
    (inside / "real").write_text("ok")
    (tmp_path / "secret").write_text("no")
    (inside / "good").symlink_to(inside / "real")
    (inside / "bad").symlink_to(tmp_path / "secret")
    assert read_text(inside / "good", 10, inside=inside) == "ok"
    for path in (inside / "bad", inside / ".." / "secret"):
        with pytest.raises(UnusableFile, match="leads out of its folder"):
            read_text(path, 10, inside=inside)


@pytest.mark.parametrize(("size", "most", "fits"), [(0, 0, True), (5, 5, True), (6, 5, False), (100, 5, False)])
def test_more_than_agreed_is_not_read(tmp_path: Path, size: int, most: int, fits: bool) -> None:
    (tmp_path / "x").write_bytes(b"a" * size)
    if fits:
        assert read_bytes(tmp_path / "x", most) == b"a" * size
        return
    with pytest.raises(UnusableFile, match=f"{size} bytes, expected at most {most} bytes"):
        read_bytes(tmp_path / "x", most)


def test_room_is_made_for_what_is_there_not_for_the_most_that_may_be(tmp_path: Path) -> None:
    (tmp_path / "x").write_bytes(b"0123456789")
    tracemalloc.start()
    try:
        assert read_bytes(tmp_path / "x", 100_000_000) == b"0123456789"
        assert tracemalloc.get_traced_memory()[1] < 3_000_000
    finally:
        tracemalloc.stop()


def test_what_a_killed_writer_left_is_removed_and_nothing_else(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def killed(*_: object, **__: object) -> None:
        raise SystemExit

    for name in ("key", "lift.toml"):
        (tmp_path / name).write_bytes(b"old")
    with monkeypatch.context() as patch:
        for name in ("replace", "unlink"):
            patch.setattr(Path, name, killed)
        for write in (
            lambda: write_private(tmp_path / "key", "new"),
            lambda: exchange_file(tmp_path / "lift.toml", b"new"),
        ):
            with pytest.raises(SystemExit):
                write()
    left = {path.name for path in tmp_path.iterdir()} - {"key", "lift.toml"}
    assert len(left) == 2
    now = SystemClock().micros()
    kept = {"key", "lift.toml", ".hidden", ".gone.toml.new", ".key.bak", "key.new"}
    for name in kept:
        (tmp_path / name).touch()
    (tmp_path / ".lift.toml.0a1b2c3d").mkdir()
    assert remove_unfinished(tmp_path, now) == [], "one that was written just now may be at work"
    assert {path.name for path in remove_unfinished(tmp_path, now + 61_000_000)} == left
    assert {path.name for path in tmp_path.iterdir()} == kept | {".lift.toml.0a1b2c3d"}
    assert remove_unfinished(tmp_path / "none", now) == []


def test_a_text_may_have_its_mark_and_is_utf_8(tmp_path: Path) -> None:
    path = tmp_path / "x"
    path.write_bytes("\ufeffčaj\n".encode())
    assert read_text(path, 100) == "čaj\n"
    path.write_bytes(b"one\ntwo\xff\n")
    with pytest.raises(UnusableFile, match=":2: byte 0xff, expected text in UTF-8"):
        read_text(path, 100)
