"""Anchors tell of a cut that nothing else tells of, and hang together."""

import os
from collections.abc import Callable
from concurrent.futures import Future
from errno import ENOSPC
from pathlib import Path
from typing import Any, TypeVar

import pytest

from app.access.access import Access
from app.access.audit.anchoring import ANCHOR_LINES
from app.access.audit.chain import signed
from app.clock import ManualClock
from app.db import Database
from tests.access.audit.filled import LINES, MARKS, filled, older, tamper
from tests.access.conftest import OpenAccess, boss
from tests.virtual import Inline, inline

T = TypeVar("T")


async def test_an_anchor_tells_of_a_cut_that_came_before_the_head_was_lost(
    access: Access, data: Path, clock: ManualClock
) -> None:
    await filled(access)
    clock.advance(3601)
    await access.audit.record("command", boss())
    anchored = int((data / "audit.anchors").read_text().split()[0])
    assert anchored == LINES + 1
    tamper(data, "DELETE FROM audit WHERE seq > 12")
    (data / "audit.head").unlink()
    verdict = access.audit.check_now()
    assert (verdict.bad, verdict.why) == (13, "cut")


async def test_the_loop_does_not_wait_for_the_disk_to_take_the_head(
    data: Path, clock: ManualClock, monkeypatch: pytest.MonkeyPatch
) -> None:
    at, wrote = ["the loop"], list[str]()

    class Pool(Inline):
        def __init__(self, _count: int, name: str) -> None:
            self._name = name

        def submit(self, fn: Callable[..., T], /, *args: Any, **kwargs: Any) -> "Future[T]":
            at.append(self._name)
            try:
                return super().submit(fn, *args, **kwargs)
            finally:
                at.pop()

    write = os.pwrite
    monkeypatch.setattr(os, "pwrite", lambda *given: wrote.append(at[-1]) or write(*given))
    access = Access(Database(data / "pogon.db", "pogon", inline), clock, data, threads=Pool)
    number = await access.audit.record("command", boss())
    assert int((data / "audit.head").read_text().split()[0]) == number == 1
    assert set(wrote) == {"audit-buffer"}
    access.close()


@pytest.mark.sweep(8)
async def test_an_anchor_after_a_thousand_lines(access: Access, data: Path) -> None:
    for _ in range(ANCHOR_LINES // 100):
        await access.audit.with_entries(
            lambda _connection: (None, [access.audit.entry("x", boss()) for _ in range(100)])
        )
    assert (data / "audit.anchors").read_text().startswith(f"{ANCHOR_LINES} ")
    assert access.audit.check_now().ok


async def test_everything_older_put_back_is_found_by_an_anchor_elsewhere(
    data: Path, clock: ManualClock, tmp_path: Path
) -> None:
    told: list[str] = []
    database = Database(data / "pogon.db", "pogon", inline)
    access = Access(database, clock, data, anchors=[told.append], threads=inline)
    copied = await older(access, data)
    clock.advance(3601)
    await access.audit.record("command", boss())
    tamper(data, "DELETE FROM audit WHERE seq > 12")
    for name in MARKS:
        if name in copied:
            (data / name).write_bytes(copied[name])
    (data / "audit.anchors").unlink()
    assert access.audit.check_now().ok  # nothing on this machine tells
    (tmp_path / "copied").write_text("\n".join(told))
    verdict = access.audit.check_now(tmp_path / "copied")
    assert (verdict.bad, verdict.why) == (13, "cut")
    access.close()
    database.close()


async def test_anchors_hang_together(access: Access, data: Path, clock: ManualClock) -> None:
    for _ in range(4):
        clock.advance(3601)
        await access.audit.record("command", boss())
    path = data / "audit.anchors"
    lines = path.read_text().splitlines()
    assert len(lines) == 4
    for wrong in ([*lines[:1], *lines[2:]], lines[1:], [lines[1], lines[0], *lines[2:]], [*lines, lines[0]]):
        path.write_text("\n".join(wrong) + "\n")
        assert access.audit.check_now().why == "anchor"
    path.write_text("\n".join(lines) + "\n")
    assert access.audit.check_now().ok


async def test_anchors_of_a_command_beside_the_server_hang_together_with_its_own(
    access: Access, open_access: OpenAccess, data: Path, clock: ManualClock
) -> None:
    await access.audit.record("command", boss())
    for _ in range(2):
        beside = open_access()
        beside.audit.run(lambda _connection: (None, [beside.audit.entry("person.roles", boss())]))  # noqa: B023
        beside.audit.close()
        await access.audit.record("command", boss())
        clock.advance(3601)
        await access.audit.record("command", boss())
        assert access.audit.check_now().ok
    anchors = [line.split() for line in (data / "audit.anchors").read_text().splitlines()]
    assert [line[3] for line in anchors[1:]] == [line[-1][:16] for line in anchors[:-1]]
    assert len(anchors) == 4


@pytest.mark.parametrize("room", [0, 1, 60, 140])
async def test_an_anchor_that_a_full_disk_takes_in_part_is_taken_back_and_written_later(
    access: Access, data: Path, clock: ManualClock, monkeypatch: pytest.MonkeyPatch, room: int
) -> None:
    for _ in range(2):
        clock.advance(3601)
        await access.audit.record("command", boss())
    path = data / "audit.anchors"
    before = path.read_text()

    def full(handle: int, content: bytes) -> int:
        if not room:
            raise OSError(ENOSPC, "No space left on device")
        return write(handle, content[:room])

    write = os.write
    clock.advance(3601)
    with monkeypatch.context() as patch:
        patch.setattr("app.files.os.write", full)
        patch.setattr("app.access.audit.anchoring.log.error", lambda *_: None)
        await access.audit.record("command", boss())
    assert path.read_text() == before
    assert access.audit.check_now().ok
    await access.audit.record("command", boss())
    assert len(path.read_text().splitlines()) == 3
    assert access.audit.check_now().ok


TORN = [b"\0\0\0", b"{seq} 17000", b"{seq} 1700000000000000 " + b"a" * 64 + b" - abc", b"{seq}", b"{whole}"]


@pytest.mark.sweep(8)
@pytest.mark.parametrize("before", [0, 1, 2])
@pytest.mark.parametrize("torn", TORN)
async def test_the_piece_of_an_anchor_that_a_power_cut_left_is_taken_away_at_the_next_start(
    open_access: OpenAccess, data: Path, clock: ManualClock, torn: bytes, before: int
) -> None:
    first = open_access()
    await first.start()
    for _ in range(before):
        clock.advance(3601)
        await first.audit.record("command", boss())
    key, path = (data / "audit.key").read_bytes(), data / "audit.anchors"
    clock.advance(3601)
    await first.audit.record("command", boss())
    first.close()
    whole = path.read_bytes().splitlines(keepends=True)[:before]
    last = path.read_bytes().splitlines()[before]
    # the power goes while it is written: the mark behind the key, which comes after it, still is the one before
    path.write_bytes(b"".join(whole) + torn.replace(b"{seq}", last.split()[0]).replace(b"{whole}", last))
    (data / "audit.key").write_bytes(key)
    again = open_access()
    await again.start()
    clock.advance(3601)
    await again.audit.record("command", boss())
    number_is_there = b" " in torn or b"{whole}" in torn
    if before or number_is_there:
        assert again.audit.check_now().ok
        assert path.read_bytes().startswith(b"".join(whole))


async def test_an_anchor_that_was_whole_once_is_missed(open_access: OpenAccess, data: Path, clock: ManualClock) -> None:
    first = open_access()
    await first.start()
    for _ in range(3):
        clock.advance(3601)
        await first.audit.record("command", boss())
    first.close()
    path = data / "audit.anchors"
    for cut, ok in ((-1, True), (-30, False), (-100, False)):
        path.write_bytes(path.read_bytes()[:cut])
        again = open_access()
        await again.start()
        clock.advance(3601)
        await again.audit.record("command", boss())
        assert again.audit.check_now().ok is ok, cut
        again.close()


async def test_anchors_of_the_first_versions_are_understood(access: Access, data: Path) -> None:
    await filled(access, 3)
    mac = access.audit._anchoring._newest[1]
    (data / "audit.anchors").write_text(f"3 5 {mac} {signed(access.audit._key, 'anchor', 3, mac, 5)}\n")
    assert access.audit.check_now().ok
