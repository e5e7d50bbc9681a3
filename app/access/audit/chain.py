"""The chain of a table of lines: each line's mac binds it to the one before. Also that of the alarm journal.

rec_n  = canonical JSON of the line (sorted keys, UTF-8, numbers as text)
mac_n  = HMAC-SHA256(K, mac_{n-1} || SHA-256(rec_n))        mac_0 = HMAC(K, "genesis")
"""

import hashlib
import hmac
import json
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from sqlalchemy import Connection


def genesis(key: bytes) -> str:
    """What the first line is chained to."""
    return hmac.new(key, b"genesis", hashlib.sha256).hexdigest()


def chained(key: bytes, before: object, fields: Mapping[str, object]) -> str:
    """The mac of the line `fields` that follows the line with mac `before`; what was put there instead of either gives one, too."""
    text = json.dumps(fields, ensure_ascii=False, sort_keys=True, separators=(",", ":"), default=repr)
    digest = hashlib.sha256(text.encode("utf-8", "surrogatepass")).digest()
    try:
        link = bytes.fromhex(str(before))
    except ValueError:
        link = hashlib.sha256(str(before).encode("utf-8", "surrogatepass")).digest()
    return hmac.new(key, link + digest, hashlib.sha256).hexdigest()


def is_mac(found: object, expected: str) -> bool:
    """Whether what stands in a chain is the mac `expected`; anything else is not, whatever its type."""
    return isinstance(found, str) and hmac.compare_digest(found.encode("utf-8", "surrogatepass"), expected.encode())


def signed(key: bytes, what: str, *parts: object) -> str:
    """Signature of `parts` of a thing `what` that stands outside the table."""
    return hmac.new(key, " ".join([what, *map(str, parts)]).encode(), hashlib.sha256).hexdigest()


@contextmanager
def tolerant(connection: Connection) -> Iterator[None]:
    """Texts that are not UTF-8 are read all the same, as something else than they should be."""
    driver = connection.connection.dbapi_connection
    assert isinstance(driver, sqlite3.Connection)
    former = driver.text_factory
    driver.text_factory = lambda raw: raw.decode("utf-8", "surrogateescape")
    try:
        yield
    finally:
        driver.text_factory = former


def begin_now(connection: Connection) -> None:
    """Take the database's write lock before reading, so that two processes cannot both append after the same line."""
    driver = connection.connection.dbapi_connection
    if driver is not None and not driver.in_transaction:
        connection.exec_driver_sql("BEGIN IMMEDIATE")
