"""Whatever happens to the disk, no line is lost and nobody waits."""

import asyncio
import errno
import os
from dataclasses import asdict
from pathlib import Path

import pytest

from app.access.access import Access
from app.access.audit.buffer import SIZE
from app.access.audit.search import Filter
from tests.access.audit.filled import broken_disk
from tests.access.conftest import OpenAccess, boss


async def test_a_full_disk_loses_no_line_and_holds_nobody_up(access: Access, data: Path) -> None:
    await access.audit.record("one", boss())
    mend = broken_disk(access)
    assert await access.audit.record("stop", boss(), "m1") == 0
    assert await access.audit.record("acknowledge", boss()) == 0
    assert not access.audit.healthy
    assert not await access.audit.replay()
    assert (data / "audit.buffer").stat().st_mode & 0o777 == 0o600
    mend()
    await access.audit.record("after", boss())
    assert access.audit.healthy
    assert [line.kind for line in await access.audit.find(Filter())] == ["after", "acknowledge", "stop", "one"]
    assert access.audit.check_now().count == 4
    access.audit.disk.submit(lambda: None).result()
    assert access.audit._buffer.read().lines == []


async def test_the_buffer_outlives_the_server_and_is_written_once(open_access: OpenAccess, data: Path) -> None:
    access = open_access()
    broken_disk(access)
    await access.audit.record("stop", boss(), "m1")
    kept = (data / "audit.buffer").read_text()
    after = open_access()
    assert not after.audit.healthy
    assert await after.audit.replay()
    (data / "audit.buffer").write_text(kept)  # died between commit and emptying the buffer
    (data / "audit.buffer").chmod(0o600)
    again = open_access()
    assert await again.audit.replay()
    assert [line.kind for line in await again.audit.find(Filter())] == ["stop"]
    assert again.audit.check_now().ok


async def test_what_was_foretold_is_on_the_disk_and_soon_in_the_chain(open_access: OpenAccess, data: Path) -> None:
    access = open_access()
    await access.audit.begin()
    assert (data / "audit.buffer").stat().st_size >= SIZE  # allocated before it is needed
    for number in range(3):
        assert await access.audit.foretell(access.audit.entry("command.sent", boss(), f"m{number}", result="sent"))
    await access.audit.record("command", boss(), "m0", result="confirmed")
    lines = await access.audit.find(Filter())
    assert [line.kind for line in lines] == ["command", *["command.sent"] * 3]
    assert access.audit.healthy
    assert access.audit.check_now().ok


@pytest.mark.parametrize("committed", [False, True])
async def test_a_killed_server_leaves_the_line_of_what_it_had_begun(
    open_access: OpenAccess, data: Path, committed: bool
) -> None:
    """Killed after the line was on the disk: before the database had it, or before the buffer knew of that."""
    access = open_access()
    if not committed:
        broken_disk(access)
    access.audit._buffer.rewind = lambda: None  # type: ignore[method-assign]
    line: dict[str, object] = {"id": "a" * 16, **asdict(access.audit.entry("command.sent", boss()))}
    access.audit._buffer.append(line)
    if committed:
        access.audit._waiting._lines["a" * 16] = line
        assert await access.audit.replay()
    after = open_access()
    await after.audit.begin()
    assert [line.kind for line in await after.audit.find(Filter())] == ["command.sent"]
    assert after.audit.check_now().ok
    assert after.audit.healthy


async def test_without_a_database_it_goes_to_the_buffer_and_nobody_waits(access: Access) -> None:
    mend = broken_disk(access)
    assert await access.audit.foretell(access.audit.entry("command.sent", boss()))
    await asyncio.sleep(0)
    await asyncio.sleep(0)
    assert not access.audit.healthy
    mend()
    assert await access.audit.replay()
    assert [line.kind for line in await access.audit.find(Filter())] == ["command.sent"]


async def test_without_a_buffer_it_goes_to_the_database(access: Access, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "fdatasync", _full)
    assert await access.audit.foretell(access.audit.entry("command.sent", boss()))
    assert await access.audit.count() == 1


async def test_with_neither_it_is_kept_nowhere_and_says_so(access: Access, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "fdatasync", _full)
    mend = broken_disk(access)
    assert not await access.audit.foretell(access.audit.entry("command.sent", boss()))
    assert not access.audit.healthy
    await access.audit.record("stop", boss())  # kept in memory, at least
    mend()
    assert await access.audit.replay()
    assert [line.kind for line in await access.audit.find(Filter())] == ["stop"]


async def test_a_buffer_that_takes_nothing_and_a_head_that_is_not_written_are_told_once_each(
    access: Access, data: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level("INFO")
    (data / "audit.head").unlink(missing_ok=True)
    (data / "audit.head").mkdir()
    with monkeypatch.context() as patch:
        patch.setattr(os, "fdatasync", _full)
        for _ in range(3):
            assert await access.audit.foretell(access.audit.entry("command.sent", boss()))
    assert caplog.text.count("audit buffer not written") == caplog.text.count("audit head not written") == 1
    (data / "audit.head").rmdir()
    assert await access.audit.foretell(access.audit.entry("command.sent", boss()))
    await access.audit.replay()
    await access.audit.record("stop", boss())
    assert caplog.text.count("audit buffer written again") == caplog.text.count("audit head written again") == 1


def _full(_handle: int) -> None:
    raise OSError(errno.ENOSPC, "No space left on device")
