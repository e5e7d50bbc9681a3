"""On a slow disk lines share a commit: who writes one waits for that which is at work and for the next, however many others write."""

import asyncio
from collections.abc import Iterator
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import pytest

from app.access.access import Access
from app.access.audit.search import Filter
from app.errors import StorageError
from tests.access.conftest import boss


class SlowDisk:
    """Its writes are done one by one when the test says so."""

    def __init__(self, access: Access) -> None:
        self.waiting: list[tuple[Future[Any], Any]] = []
        self.commits = 0
        self._database = access.audit._db
        self._submit = self._database.submit
        self._database.submit = self._later  # type: ignore[method-assign]

    def _later(self, work: Any) -> Future[Any]:
        future: Future[Any] = Future()
        self.waiting.append((future, work))
        return future

    async def commit(self, error: Exception | None = None) -> None:
        """The oldest write is done, or refused."""
        future, work = self.waiting.pop(0)
        self.commits += 1
        if error:
            future.set_exception(error)
        else:
            future.set_result(self._submit(work).result())
        for _ in range(5):
            await asyncio.sleep(0)

    def mend(self) -> None:
        self._database.submit = self._submit  # type: ignore[method-assign]


@pytest.fixture
def disk(access: Access) -> Iterator[SlowDisk]:
    disk = SlowDisk(access)
    yield disk
    disk.mend()


async def begun(access: Access, *kinds: str) -> list["asyncio.Task[int]"]:
    tasks = [asyncio.create_task(access.audit.record(kind, boss())) for kind in kinds]  # type: ignore[arg-type]
    for _ in range(5):
        await asyncio.sleep(0)
    return tasks


async def kinds(access: Access) -> list[str]:
    return [line.kind for line in reversed(await access.audit.find(Filter()))]


async def test_twenty_lines_that_wait_together_take_one_commit(access: Access, disk: SlowDisk) -> None:
    names = [f"line.{number}" for number in range(20)]
    tasks = await begun(access, *names)
    await disk.commit()
    assert [task.result() for task in tasks] == list(range(1, 21))
    assert disk.commits == 1 and not disk.waiting
    assert await kinds(access) == names
    assert access.audit.check_now().ok


async def test_who_comes_after_the_thread_took_them_goes_with_the_next(access: Access, disk: SlowDisk) -> None:
    (first,) = await begun(access, "one")
    access.audit._next.take(None)  # type: ignore[arg-type]
    second, third = await begun(access, "two", "three")
    assert len(disk.waiting) == 2
    await disk.commit()
    assert first.result() == 1 and not second.done()
    await disk.commit()
    assert (second.result(), third.result()) == (2, 3)
    assert await kinds(access) == ["one", "two", "three"]


async def test_who_waits_no_more_takes_no_line_of_others_with_them(access: Access, disk: SlowDisk) -> None:
    first, second = await begun(access, "one", "two")
    first.cancel()
    await asyncio.sleep(0)
    await disk.commit()
    assert second.result() == 2 and await kinds(access) == ["one", "two"]


async def test_of_lines_that_were_refused_together_each_waits_in_its_order(access: Access, disk: SlowDisk) -> None:
    tasks = await begun(access, "one", "two", "three")
    await disk.commit(StorageError("pogon.db: database or disk is full"))
    assert await asyncio.gather(*tasks) == [0, 0, 0] and not access.audit.healthy
    disk.mend()
    await access.audit.record("four", boss())
    assert await kinds(access) == ["one", "two", "three", "four"]
    assert access.audit.healthy and access.audit.check_now().ok


async def test_what_waits_is_asked_for_again_by_one_commit_however_many_ask(access: Access, disk: SlowDisk) -> None:
    for name in ("one", "two"):
        assert await access.audit.foretell(access.audit.entry("command.sent", boss(), name))
    asked = [asyncio.create_task(access.audit.replay()) for _ in range(5)]
    for _ in range(5):
        await asyncio.sleep(0)
    assert len(disk.waiting) == 1
    await disk.commit()
    assert await asyncio.gather(*asked) == [True] * 5
    assert await kinds(access) == ["command.sent"] * 2


async def test_a_line_that_came_too_late_for_somebody_is_not_put_into_the_buffer(access: Access, data: Path) -> None:
    """It would be told after a restart as a command of which nobody knows what became."""
    await access.audit.begin()
    waiting = access.audit._waiting
    id_ = waiting.add(access.audit.entry("command.sent", boss(), "m1"))
    assert id_ is not None
    waiting.drop(id_)
    waiting._append(id_)
    assert access.audit._buffer.read().lines == []
