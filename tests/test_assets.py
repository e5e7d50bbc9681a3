"""The libraries that we serve: what is fetched again is never missing in between."""

from pathlib import Path

from tools.assets import put


def files(folder: Path, **contents: str) -> Path:
    folder.mkdir()
    for name, content in contents.items():
        (folder / name).write_text(content)
    return folder


def test_a_server_reads_them_while_they_are_put_there_again(tmp_path: Path) -> None:
    target = files(tmp_path / "vendor", face="of one byte", former="no longer kept")
    (target / ".ready").touch()
    with (target / "face").open() as read, (target / "former").open() as gone:
        put(files(tmp_path / "made", face="another", new="one more"), target)
        assert (read.read(), gone.read()) == ("of one byte", "no longer kept")
    assert {path.name: path.read_text() for path in target.iterdir()} == {
        ".ready": "",
        "face": "another",
        "new": "one more",
    }
