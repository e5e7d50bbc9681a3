"""The chain binds a line to the one before: any other text, order or key gives another mac."""

import hmac
from itertools import combinations
from pathlib import Path

import pytest
from sqlalchemy import text

from app.access.audit.chain import begin_now, chained, genesis, is_mac, signed, tolerant
from app.db import Database
from tests.virtual import inline

KEYS = (b"k" * 32, b"l" * 32, b"")
BEFORE = (genesis(b"k"), "00" * 32, "", "é", "zz", 5, None)
"""Macs, and what somebody may have put in place of one."""
LINES: tuple[dict[str, object], ...] = (
    {},
    {"seq": 1},
    {"seq": "1"},
    {"seq": 1, "old": ""},
    {"seq": 1, "old": "a"},
    {"seq": 1, "old": b"a"},
    {"seq": 1, "old": "\ud800"},
    {"seq": 1, "old": None},
    {"seq": 1.5},
)


def test_every_key_place_and_line_has_a_mac_of_its_own() -> None:
    macs = [chained(key, before, line) for key in KEYS for before in BEFORE for line in LINES]
    assert len(set(macs)) == len(macs)
    assert all(is_mac(mac, mac) and len(mac) == 64 for mac in macs)


def test_the_order_of_the_fields_does_not_count() -> None:
    assert chained(b"k", "ab" * 32, {"a": 1, "b": 2}) == chained(b"k", "ab" * 32, {"b": 2, "a": 1})


@pytest.mark.parametrize("found", [None, 5, b"ab", "", "é", "\ud800", "AB" * 32, "ab" * 31])
def test_what_is_no_mac_is_none_whatever_its_type(found: object) -> None:
    assert not is_mac(found, "ab" * 32)


def test_two_installations_begin_differently() -> None:
    assert len({genesis(key) for key in KEYS}) == len(KEYS)


def test_a_signature_is_of_one_thing_and_of_all_its_parts() -> None:
    wanted = [
        (b"k", "head", 1, "ab"),
        (b"k", "mark", 1, "ab"),
        (b"k", "head", 2, "ab"),
        (b"k", "head", 1, "ac"),
        (b"l", "head", 1, "ab"),
    ]
    for one, other in combinations(wanted, 2):
        assert not hmac.compare_digest(signed(*one), signed(*other))


def test_a_text_that_is_no_utf8_is_read_and_the_connection_is_as_before(data: Path) -> None:
    database = Database(data / "pogon.db", "pogon", inline)

    def work(connection: object) -> list[object]:
        query = text("SELECT CAST(x'61ff' AS TEXT)")
        with tolerant(connection):  # type: ignore[arg-type]
            found = connection.execute(query).scalar_one()  # type: ignore[attr-defined]
        with pytest.raises(Exception, match="UTF-8"):
            connection.execute(query).scalar_one()  # type: ignore[attr-defined]
        return [found]

    assert database.run(work) == ["a\udcff"]  # type: ignore[arg-type]
    database.close()


def test_the_write_lock_is_taken_once(data: Path) -> None:
    database = Database(data / "pogon.db", "pogon", inline)

    def work(connection: object) -> bool:
        begin_now(connection)  # type: ignore[arg-type]
        begin_now(connection)  # type: ignore[arg-type]
        return bool(connection.connection.dbapi_connection.in_transaction)  # type: ignore[attr-defined]

    assert database.run(work)  # type: ignore[arg-type]
    database.close()
