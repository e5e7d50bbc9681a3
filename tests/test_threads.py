"""A pool of threads has its size and its name."""

import threading

import pytest

from app.threads import threads


@pytest.mark.parametrize("count", [1, 3])
def test_no_more_threads_than_asked_for_and_all_are_called_so(count: int) -> None:
    together = threading.Barrier(count)
    with threads(count, "store") as pool:
        names = list(pool.map(lambda _: (together.wait(5), threading.current_thread().name)[1], range(count)))
        later = list(pool.map(lambda _: threading.current_thread().name, range(20)))
    assert len(set(names)) == count and {*names, *later} == set(names)
    assert all(name.startswith("store") for name in names)
