"""Archives are signed, and may be encrypted."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from app.access.keys import read_key
from app.backup import BACKUP_KEY, Opening, back_up, make_identity, table_counts
from app.errors import ConfigurationError
from tests.backup.shelf import KEY, OPENING, restore, rewritten, verify_backup


def older(manifest: dict[str, Any]) -> None:
    """As the first version wrote it."""
    manifest["format"] = 1


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("signature", "change", "opening", "said"),
    [
        (None, len, Opening(bytes(32)), "signed with the key .*, and the key here is .*--key-file"),
        (None, len, Opening(), "signed with the key .*, which is not here"),
        (
            None,
            lambda manifest: manifest.update(version="2"),
            OPENING,
            "its signature is not true: somebody changed it",
        ),
        (None, lambda manifest: manifest.update(version="2"), Opening(KEY, True), "its signature is not true"),
        ("", len, OPENING, "it is not signed: anybody may have written it; --unsigned takes it nevertheless"),
        ("", older, OPENING, "it is not signed"),
        ("hmac-sha256 é", len, OPENING, "its signature cannot be read"),
        ("hmac-sha256 00000000 " + "0" * 64, len, OPENING, "signed with the key 00000000"),
        ("x" * 5000, len, OPENING, "its signature cannot be read"),
    ],
)
def test_an_archive_is_believed_only_with_its_signature(
    data: Path, plant: Path, tmp_path: Path, signature: str | None, change: Any, opening: Opening, said: str
) -> None:
    archive = tmp_path / "b.tar"
    back_up(archive, data, plant)
    rewritten(archive, signature=signature, change=change)
    with pytest.raises(ConfigurationError, match=said):
        restore(archive, tmp_path / "new", opening=opening)
    assert [path.name for path in (tmp_path / "new").iterdir()] == ["server.lock"]


@pytest.mark.sweep(8)
@pytest.mark.parametrize("change", [len, older])
def test_an_unsigned_archive_is_restored_when_somebody_says_so(
    data: Path, plant: Path, tmp_path: Path, change: Callable[[dict[str, Any]], object]
) -> None:
    archive = tmp_path / "b.tar"
    back_up(archive, data, plant)
    assert verify_backup(archive).signed
    rewritten(archive, signature="", change=change)
    manifest, _ = restore(archive, tmp_path / "new", opening=Opening(KEY, unsigned=True))
    assert not manifest.signed
    assert table_counts(tmp_path / "new" / "pogon.db")["person"] == 2


def test_the_key_of_the_signature_is_made_kept_private_and_never_in_an_archive(
    data: Path, plant: Path, tmp_path: Path
) -> None:
    (data / BACKUP_KEY).unlink()
    back_up(tmp_path / "b.tar", data, plant, keys=True)
    key = (data / BACKUP_KEY).read_bytes().strip()
    assert (data / BACKUP_KEY).stat().st_mode & 0o777 == 0o600
    assert key not in (tmp_path / "b.tar").read_bytes()
    elsewhere = tmp_path / "usb.key"
    back_up(tmp_path / "c.tar", data, plant, key_file=elsewhere)
    assert verify_backup(tmp_path / "c.tar", Opening(read_key(elsewhere))).signed
    elsewhere.chmod(0o644)
    with pytest.raises(ConfigurationError, match="may be read or written by others: chmod 0600"):
        back_up(tmp_path / "d.tar", data, plant, key_file=elsewhere)


def test_an_encrypted_archive_is_opened_by_its_private_key_only(data: Path, plant: Path, tmp_path: Path) -> None:
    mine, other = tmp_path / "mine.txt", tmp_path / "other.txt"
    public = make_identity(mine)
    make_identity(other)
    assert mine.stat().st_mode & 0o777 == 0o600
    archive = tmp_path / "b.tar.age"
    back_up(archive, data, plant, encrypt_to=[public])
    content = archive.read_bytes()
    assert content.startswith(b"age-encryption.org/v1") and b"plant.toml" not in content and b"SQLite" not in content
    for identities, said in [((), "it is encrypted: give"), ((other,), "cannot be decrypted"), ((plant,), "a folder")]:
        with pytest.raises(ConfigurationError, match=said):
            restore(archive, tmp_path / "new", opening=Opening(KEY, identities=identities))
    manifest, _ = restore(archive, tmp_path / "new", opening=Opening(KEY, identities=[other, mine]))
    assert manifest.signed
    assert table_counts(tmp_path / "new" / "pogon.db")["person"] == 2
    assert not [path for path in tmp_path.rglob(".*") if path.name != ".secret"], "nothing decrypted stays"
    archive.write_bytes(content[:-100])
    with pytest.raises(ConfigurationError):
        verify_backup(archive, Opening(KEY, identities=[mine]))
    with pytest.raises(ConfigurationError, match="expected public keys of age"):
        back_up(tmp_path / "c.tar", data, plant, encrypt_to=["age1nonsense"])
    with pytest.raises(ConfigurationError, match="exists already"):
        make_identity(mine)
