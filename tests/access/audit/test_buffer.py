"""What is in the buffer on the disk is taken once, and nothing that others put there."""

import json
import tracemalloc
from pathlib import Path

import pytest

from app.access.access import Access
from app.access.audit.buffer import HEAD, SIZE, Buffer
from app.access.audit.search import Filter
from tests.access.audit.filled import broken_disk
from tests.access.conftest import OpenAccess, boss

FORGED = {
    "time": 1, "kind": "command", "person_id": 7, "person": "vic", "address": "", "session": "", "object": "m1.forward",
    "old": "", "new": "", "result": "confirmed", "reason": "", "params": "{}", "id": "0123456789abcdef",
}  # fmt: skip


@pytest.mark.sweep(8)
@pytest.mark.parametrize("where", ["alone", "before", "behind", "again", "shuffled"])
async def test_a_foreign_line_in_the_buffer_is_found_and_never_chained(
    open_access: OpenAccess, data: Path, where: str
) -> None:
    access = open_access()
    buffer, forged = data / "audit.buffer", json.dumps(FORGED).encode() + b"\n"
    genuine = []
    if where == "alone":
        await access.audit.record("x", boss())
        buffer.write_bytes(forged)
        buffer.chmod(0o600)
    else:
        broken_disk(access)
        await access.audit.record("stop", boss())
        await access.audit.record("acknowledge", boss())
        content = buffer.read_bytes()
        first, second, _ = content[HEAD:].split(b"\n", 2)
        lines = {
            "before": [forged.strip(), first, second],
            "behind": [first, second, forged.strip()],
            "again": [first, second, second],
            "shuffled": [second, first],
        }[where]
        buffer.write_bytes(content[:HEAD] + b"\n".join(lines) + b"\n\0")
        genuine = ["acknowledge", "stop"] if where != "shuffled" else ["stop"]
    assert access.audit.check_now().why == "buffer"
    again = open_access()
    await again.audit.begin()
    kinds = [line.kind for line in await again.audit.find(Filter())]
    assert kinds == ["audit.foreign", *(genuine or ["x"])]
    assert again.audit.healthy
    verdict = again.audit.check_now()  # until somebody has looked at it
    assert (verdict.ok, verdict.why) == (False, "buffer")
    assert (data / "audit.foreign").stat().st_mode & 0o777 == 0o600
    (data / "audit.foreign").unlink()
    assert again.audit.check_now().ok
    assert open_access().audit.check_now().ok


async def test_what_is_read_of_it_is_what_is_in_it_and_not_its_room(open_access: OpenAccess, data: Path) -> None:
    """It is 4 MiB of room: each thread that read it whole kept as much memory."""
    access = open_access()
    broken_disk(access)
    for number in range(3):
        await access.audit.record("stop", boss(), f"m{number}")
    made = Buffer(data, b"k" * 32)
    assert made.path.stat().st_size == SIZE
    tracemalloc.start()
    try:
        found = made.read()
        assert tracemalloc.get_traced_memory()[1] < 100_000
    finally:
        tracemalloc.stop()
    assert (found.lines, found.foreign) == ([], 3), "of another key"


async def test_a_record_that_was_torn_off_is_none(open_access: OpenAccess, data: Path) -> None:
    access = open_access()
    broken_disk(access)
    for kind in ("one", "two"):
        await access.audit.record(kind, boss())
    content = (data / "audit.buffer").read_bytes().rstrip(b"\0")
    (data / "audit.buffer").write_bytes(content[:-40])
    again = open_access()
    await again.audit.begin()
    await again.audit.record("three", boss())
    assert [line.kind for line in await again.audit.find(Filter())] == ["three", "one"]
    assert again.audit.check_now().ok


async def test_a_buffer_that_is_full_does_not_stop_the_database(
    access: Access, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.access.audit.buffer.SIZE", 2000)
    mend = broken_disk(access)
    kept = [await access.audit.foretell(access.audit.entry("command.sent", boss(), str(n))) for n in range(9)]
    assert kept == sorted(kept, reverse=True)
    assert 0 < sum(kept) < 9
    mend()
    assert await access.audit.foretell(access.audit.entry("command.sent", boss(), "x"))
    await access.audit.replay()
    assert await access.audit.count() == sum(kept) + 1
    access.audit.disk.submit(lambda: None).result()
    assert await access.audit.foretell(access.audit.entry("command.sent", boss(), "y"))  # it begins anew in front
