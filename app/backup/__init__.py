"""Backup and restore: both databases, the plant folder and the marks of the audit in one signed tar, with a manifest that proves it.

The databases are copied with SQLite's own backup beside a running server, each as it is at one moment. Keys (`audit.key`, `secret.key`)
are left out unless asked for; sessions are never in it, nor is the key that signs. Nothing of an archive is executed, and only what its
signed manifest names is read. A restore that is interrupted at any moment leaves the old state or, at the next start, the new one.
"""

from app.backup.archive import FORMAT, MANIFEST, Manifest, table_counts, verify_backup
from app.backup.making import back_up
from app.backup.restoring import restore
from app.backup.sealing import BACKUP_KEY, Opening, make_identity, signing_key

__all__ = [
    "BACKUP_KEY",
    "FORMAT",
    "MANIFEST",
    "Manifest",
    "Opening",
    "back_up",
    "make_identity",
    "restore",
    "signing_key",
    "table_counts",
    "verify_backup",
]
