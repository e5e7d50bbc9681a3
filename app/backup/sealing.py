"""Who made an archive, and who may read it: a signature with a key that is never in it, and encryption to public keys.

The signature is an HMAC over the manifest, which has the SHA-256 of everything else. It proves that whoever wrote the archive had the key,
nothing more: the key that is made by itself lies in the data folder, so it protects what was carried away, not against the machine's owner.
Encryption is that of age (age-encryption.org), so that its own tools open an archive, too.
"""

import hashlib
import hmac
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from app.access.keys import read_key
from app.access.private import write_private
from app.errors import ConfigurationError, UnusableFile
from app.files import open_ordinary, read_text

BACKUP_KEY = "backup.key"
"""Of POGON_DATA; made by the first backup."""
AGE = b"age-encryption.org/v1"
"""An encrypted archive begins so."""
LARGEST_KEY_FILE = 65_536
_PURPOSE = b"pogon backup manifest\0"


@dataclass(frozen=True, slots=True)
class Opening:
    """What is needed to open an archive and to believe it."""

    key: bytes = b""
    """Of the signature; empty = there is none here."""
    unsigned: bool = False
    """Believe it without a signature that can be checked."""
    identities: Sequence[Path] = ()
    """Files of age with private keys, of which one opens an encrypted archive."""


def signing_key(file: Path, *, make: bool = False) -> bytes:
    """The key in `file`; one that is missing is made with `make`, else it is empty.

    Raises:
        ConfigurationError: the file is no key, or others may read it.
    """
    if not make and not file.exists():
        return b""
    if file.exists():
        with open_ordinary(file) as opened:
            if os.fstat(opened.fileno()).st_mode & 0o077:
                raise ConfigurationError(f"{file} may be read or written by others: chmod 0600 {file}")
    return read_key(file)


def sign(manifest: bytes, key: bytes) -> str:
    """The signature of a manifest: `hmac-sha256 <name of the key> <hex>`."""
    mac = hmac.new(key, _PURPOSE + manifest, hashlib.sha256).hexdigest()
    return f"hmac-sha256 {key_name(key)} {mac}"


def key_name(key: bytes) -> str:
    """What tells keys apart and says nothing of them."""
    return hashlib.sha256(b"name of a pogon backup key\0" + key).hexdigest()[:8]


def check_signature(archive: Path, manifest: bytes, signature: str, opening: Opening) -> bool:
    """Whether the signature was checked; False only if `opening` does without.

    Raises:
        ConfigurationError: there is none, it is of another key, or the archive was changed.
    """
    match = re.fullmatch(r"hmac-sha256 ([0-9a-f]{8}) ([0-9a-f]{64})\s*", signature)
    if match and opening.key and match[1] == key_name(opening.key):
        if not hmac.compare_digest(signature.strip(), sign(manifest, opening.key)):
            raise ConfigurationError(f"{archive}: its signature is not true: somebody changed it")
        return True
    if opening.unsigned:
        return False
    if not signature:
        said = "it is not signed: anybody may have written it"
    elif not match:
        said = "its signature cannot be read"
    elif opening.key:
        said = f"signed with the key {match[1]}, and the key here is {key_name(opening.key)}: give the right one with --key-file"
    else:
        said = f"signed with the key {match[1]}, which is not here: give it with --key-file"
    raise ConfigurationError(f"{archive}: {said}; --unsigned takes it nevertheless")


def encrypt(source: Path, target: Path, recipients: Sequence[str]) -> None:
    """Encrypt a file to the public keys `recipients` (`age1…`); any one of their private keys opens it.

    Raises:
        ConfigurationError: one is no public key.
    """
    import pyrage

    try:
        keys = [pyrage.x25519.Recipient.from_str(text.strip()) for text in recipients]
        pyrage.encrypt_file(str(source), str(target), keys)
    except pyrage.RecipientError as error:
        raise ConfigurationError(
            f"--encrypt-to: expected public keys of age, age1…, not {recipients} ({error})"
        ) from error
    except pyrage.EncryptError as error:
        raise ConfigurationError(f"{target}: not encrypted ({error})") from error


def decrypt(archive: Path, target: Path, identities: Sequence[Path]) -> None:
    """Decrypt an archive with the first of the private keys in `identities` that fits.

    Raises:
        ConfigurationError: none fits, or the archive was changed.
    """
    import pyrage

    if not identities:
        raise ConfigurationError(f"{archive}: it is encrypted: give the file of the private key with --identity")
    keys = []
    for file in identities:
        for line in read_text(file, LARGEST_KEY_FILE).splitlines():
            if line.strip() and not line.startswith("#"):
                try:
                    keys.append(pyrage.x25519.Identity.from_str(line.strip()))
                except pyrage.IdentityError:
                    raise UnusableFile(file, "no private key of age", "lines AGE-SECRET-KEY-1…") from None
    try:
        pyrage.decrypt_file(str(archive), str(target), keys)
    except pyrage.DecryptError as error:
        raise ConfigurationError(f"{archive}: it cannot be decrypted ({error})") from error


def make_identity(file: Path) -> str:
    """Write a new private key of age to `file`, readable by its owner only; returns the public key.

    Raises:
        ConfigurationError: the file exists, or cannot be written.
    """
    import pyrage

    if file.exists():
        raise ConfigurationError(f"{file} exists already: a key replaces no file")
    identity = pyrage.x25519.Identity.generate()
    public = str(identity.to_public())
    try:
        write_private(file, f"# public key: {public}\n{identity}\n", exclusive=True)
    except OSError as error:
        raise ConfigurationError(f"{file}: {error.strerror or error}") from error
    return public
