"""A pool of threads has its size and its name, and what computes for long comes after the loop."""

import os
import sys
import threading

import pytest

from app.threads import NICENESS, Turns, threads


@pytest.mark.parametrize("count", [1, 3])
def test_no_more_threads_than_asked_for_and_all_are_called_so(count: int) -> None:
    together = threading.Barrier(count)
    with threads(count, "store") as pool:
        names = list(pool.map(lambda _: (together.wait(5), threading.current_thread().name)[1], range(count)))
        later = list(pool.map(lambda _: threading.current_thread().name, range(20)))
    assert len(set(names)) == count and {*names, *later} == set(names)
    assert all(name.startswith("store") for name in names)


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere that counts for whole processes")
def test_password_hashes_and_what_they_start_give_way_and_nothing_else_does() -> None:
    """Thirty people who prove who they are at once made a Stop wait for 0.6 s on two cores, which eight lanes of argon2 had."""

    def niceness() -> int:
        return os.getpriority(os.PRIO_PROCESS, threading.get_native_id())

    def started() -> int:
        found: list[int] = []
        lane = threading.Thread(target=lambda: found.append(niceness()))
        lane.start()
        lane.join()
        return found[0]

    before = niceness()
    with threads(1, "argon2") as behind, threads(1, "store") as pool:
        assert [behind.submit(work).result() for work in (niceness, started)] == [NICENESS, NICENESS]
        assert pool.submit(niceness).result() == before
    assert niceness() == before


def test_work_that_takes_its_turn_has_a_number_as_long_as_it_lasts() -> None:
    turns = Turns(threads(1, "store"))
    with turns:
        assert [turns.submit(lambda: turns.at_work).result() for _ in range(3)] == [1, 2, 3]
        with pytest.raises(ZeroDivisionError):
            turns.submit(lambda: 1 // 0).result()
        assert turns.submit(lambda at: (at, turns.at_work), 7).result() == (7, 5)
    assert turns.at_work == 0
