"""Virtual time itself: it jumps, it keeps order, it never spins, it says when it would wait for ever."""

import asyncio
import time
from collections.abc import Iterator
from pathlib import Path
from random import Random

import pytest

from app import chance
from app.clock import ManualClock
from app.settings import Settings
from tests.virtual import VirtualLoop, house
from tests.wires import pair


@pytest.fixture
def loop() -> Iterator[VirtualLoop]:
    loop = VirtualLoop(ManualClock())
    yield loop
    loop.close()


def test_an_hour_of_sleep_passes_on_the_clock_only(loop: VirtualLoop) -> None:
    began, wall = time.monotonic(), loop.clock.micros()
    loop.run_until_complete(asyncio.sleep(3600))
    assert loop.clock.micros() - wall == 3_600_000_000
    assert loop.time() == 4600.0
    assert time.monotonic() - began < 60


def test_timers_come_in_their_order_and_never_early(loop: VirtualLoop) -> None:
    random, heard = Random(1), []
    dues = [loop.time() + random.uniform(0, 1) for _ in range(2000)] + [loop.time() + 1e-14 * n for n in range(50)]

    def fired(due: float) -> None:
        heard.append(due)
        assert due <= loop.time() < due + 2e-6

    for due in dues:
        loop.call_at(due, fired, due)
    loop.run_until_complete(asyncio.sleep(2))
    assert len(heard) == len(dues)
    assert [round(due, 6) for due in heard] == sorted(round(due, 6) for due in heard)


def test_a_wait_that_nothing_can_end_is_an_error(loop: VirtualLoop) -> None:
    with pytest.raises(RuntimeError, match="wait for ever"):
        loop.run_until_complete(asyncio.Event().wait())


def test_work_for_threads_is_done_when_it_is_asked_for(loop: VirtualLoop) -> None:
    async def count() -> list[int]:
        return [await asyncio.to_thread(lambda n=n: n) for n in range(3)]

    assert loop.run_until_complete(count()) == [0, 1, 2]
    with pytest.raises(ZeroDivisionError):
        loop.run_until_complete(asyncio.to_thread(lambda: 1 // 0))


@pytest.mark.sweep(20)
def test_the_whole_house_lives_the_same_time_twice(tmp_path: Path) -> None:
    """The demo plant with its databases, links, alarms and recorder, from one seed."""

    def live(data: Path) -> list[object]:
        chance.use(Random(7))
        with house(Settings(data=data)) as client:
            client.pass_time(12)  # a storm is played twice for a whole minute
            runtime = client.app.state.runtime  # type: ignore[attr-defined]
            assert not [task.name for task in runtime.supervisor.tasks.values() if task.failures]
            return [
                (tag.name, runtime.tags.value(n), runtime.tags.quality(n)) for n, tag in enumerate(runtime.tags.tags)
            ]

    first = live(tmp_path / "one")
    assert first == live(tmp_path / "two")
    assert len(first) > 200


def test_a_wire_that_is_given_up_while_it_is_laid_leaves_no_number_behind(loop: VirtualLoop) -> None:
    """Cancelled at whatever step: the next socket that gets its number can be waited for, though somebody remembers the transport."""
    remembered: list[asyncio.BaseTransport] = []

    class Server(asyncio.Protocol):
        def connection_made(self, transport: asyncio.BaseTransport) -> None:
            remembered.append(transport)

    async def given_up(steps: int) -> None:
        task = asyncio.create_task(loop.create_connection(asyncio.Protocol, "127.0.0.1", 5020))
        for _ in range(steps):
            await asyncio.sleep(0)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        await asyncio.sleep(0.1)
        ends = pair()
        for end in ends:
            loop.add_reader(end, remembered.clear)
            loop.remove_reader(end)
            end.close()

    async def all_of_them() -> None:
        await loop.create_server(Server, "127.0.0.1", 5020)
        for steps in range(5):
            await given_up(steps)

    loop.run_until_complete(all_of_them())
    assert remembered
