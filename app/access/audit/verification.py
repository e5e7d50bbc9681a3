"""Verifying: the chain is walked from its first line and compared with what stands outside the database."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from sqlalchemy import Connection, select

from app.access.audit.buffer import Found
from app.access.audit.chain import chained, genesis, is_mac, signed, tolerant
from app.access.keys import Mark, read_mark
from app.access.tables import audit_table
from app.errors import ConfigurationError
from app.files import read_text

LARGEST = 256 << 20
"""Of a file of anchors, some hundred years of them [bytes]."""
FOREIGN = "audit.foreign"
"""In POGON_DATA, what the server found in the buffer at its start and did not put there; the chain counts as broken while it lies there."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """What verifying found."""

    count: int
    """Lines that are in order, from the first on."""
    bad: int | None = None
    """Number of the first line that is not."""
    why: str = ""
    """`changed`, `removed`, `inserted`, `cut`, `head`, `anchor`, `copied`, `mark`, `wiped`, `buffer` or `unread`."""
    newest: int = 0
    """Number of the newest line that was looked at."""

    @property
    def ok(self) -> bool:
        """Whether every line is in order."""
        return self.bad is None


@dataclass(frozen=True, slots=True)
class Anchor:
    """A line of the chain, signed outside the database."""

    seq: int
    time: int
    mac: str
    before: str
    """Beginning of the signature of the anchor before; empty in anchors of the first versions."""
    sign: str

    def is_true(self, key: bytes) -> bool:
        """Whether it was signed with `key`."""
        return is_mac(self.sign, signed(key, "anchor", self.seq, self.mac, self.time, *filter(None, [self.before])))


@dataclass(frozen=True, slots=True)
class Marks:
    """What stands outside the database, as it was before the lines were read."""

    heads: Sequence[tuple[int, str, str]] = ()
    """Number, mac, signature: from `audit.head` and from the buffer."""
    anchors: Sequence[Anchor] = field(default_factory=tuple)
    copied: Sequence[Anchor] = field(default_factory=tuple)
    """Anchors from elsewhere."""
    mark: Mark | None = None
    headless: bool = False
    """There is no `audit.head`."""
    broken: str = ""
    """`head`, `anchor` or `copied`: that file cannot be understood."""
    foreign: int = 0
    unread: bool = False
    """There is something in the place of `audit.buffer` that is no file or cannot be read."""


def read_marks(data: Path, buffer: Found | None = None, copied: Path | None = None, *, unread: bool = False) -> Marks:
    """Read what is outside the database; a file that is not there is an empty one. `unread`: the buffer could not be."""
    broken, heads = "", []
    headless = not (data / "audit.head").exists()
    for text in (None if headless else _text(data / "audit.head"), buffer.head if buffer else ""):
        try:
            if text != "" and (text is not None or not headless):
                seq, mac, sign = (text or "").split()
                heads.append((int(seq), mac, sign))
        except ValueError:
            broken = "head"
    anchors = _read_anchors(data / "audit.anchors")
    from_elsewhere = _read_anchors(copied) if copied else ()
    if from_elsewhere is None:
        broken = "copied"
    if anchors is None:
        broken = "anchor"
    foreign = (buffer.foreign if buffer else 0) + (data / FOREIGN).exists()
    mark = read_mark(data / "audit.key")
    return Marks(heads, anchors or (), from_elsewhere or (), mark, headless, broken, foreign, unread)


def _text(path: Path) -> str | None:
    try:
        return read_text(path, LARGEST)
    except ConfigurationError:
        return None


def _read_anchors(path: Path) -> list[Anchor] | None:
    if not os.path.lexists(path):
        return []
    lines = []
    try:
        for line in (_text(path) or "?").splitlines():
            at, time, mac, *before, sign = line.split()
            (link,) = before or [""]
            lines.append(Anchor(int(at), int(time), mac, link, sign))
    except ValueError:
        return None
    return lines


def verify(connection: Connection, key: bytes, marks: Marks) -> Verdict:
    """Walk the chain from its first line and compare it with `marks`. Whatever stands in it, there is a verdict."""
    before_sign = ""
    for why, read in (("anchor", marks.anchors), ("copied", marks.copied)):
        untrue = next((anchor for anchor in read if not anchor.is_true(key)), None)
        if untrue is not None:
            return Verdict(0, untrue.seq, why)
    for anchor in marks.anchors:
        if anchor.before and anchor.before != (before_sign[:16] or "-"):
            return Verdict(0, anchor.seq, "anchor")
        before_sign = anchor.sign
    if marks.broken:
        return Verdict(0, 1, marks.broken)
    for seq, mac, sign in marks.heads:
        if not is_mac(sign, signed(key, "head", seq, mac)):
            return Verdict(0, seq, "head")
    mark = marks.mark
    if mark is not None and not is_mac(mark.sign, signed(key, "mark", mark.install, mark.seq, mark.mac)):
        return Verdict(0, mark.seq, "mark")
    with tolerant(connection):
        verdict = _walked(connection, key, marks)
    if not verdict.ok:
        return verdict
    last, anchored = verdict.count, [anchor.seq for anchor in (*marks.anchors, *marks.copied)]
    if mark is not None and not last and not marks.heads and not anchored:
        return Verdict(0, 1, "wiped")
    known = max([mark.seq if mark else 0, *(seq for seq, _, _ in marks.heads), *anchored])
    if known > last:
        return Verdict(last, last + 1, "cut", last)
    if last and marks.headless:
        return Verdict(last, last, "head", last)
    if marks.foreign:
        return Verdict(last, last + 1, "buffer", last)
    if marks.unread:
        return Verdict(last, last + 1, "unread", last)
    return verdict


def _walked(connection: Connection, key: bytes, marks: Marks) -> Verdict:
    outside: list[tuple[str, Mapping[int, str]]] = [
        ("anchor", {anchor.seq: anchor.mac for anchor in marks.anchors}),
        ("copied", {anchor.seq: anchor.mac for anchor in marks.copied}),
    ]
    before, expected = genesis(key), 1
    columns = [column for column in audit_table.c if column.name != "mac"]
    for row in connection.execute(select(audit_table).order_by(audit_table.c.seq)).yield_per(1000):
        if row.seq != expected:
            why, bad = ("removed", expected) if row.seq > expected else ("inserted", row.seq)
            return Verdict(expected - 1, bad, why, row.seq)
        fields = {column.name: getattr(row, column.name) for column in columns}
        if not is_mac(row.mac, chained(key, before, fields)):
            return Verdict(expected - 1, row.seq, "changed", row.seq)
        for why, macs in outside:
            if macs.get(row.seq, row.mac) != row.mac:
                return Verdict(expected - 1, row.seq, why, row.seq)
        if any(seq == row.seq and mac != row.mac for seq, mac, _ in marks.heads):
            return Verdict(expected - 1, row.seq, "head", row.seq)
        if marks.mark is not None and marks.mark.seq == row.seq and marks.mark.mac != row.mac:
            return Verdict(expected - 1, row.seq, "mark", row.seq)
        before, expected = row.mac, expected + 1
    return Verdict(expected - 1, newest=expected - 1)
