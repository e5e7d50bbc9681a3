"""Lines are found by person, object, kind and time."""

from app.access.access import Access
from app.access.audit.search import Filter
from app.clock import ManualClock
from tests.access.audit.filled import filled
from tests.access.conftest import boss


async def test_lines_are_found_by_person_object_kind_and_time_newest_first(access: Access, clock: ManualClock) -> None:
    await filled(access, 6)
    middle = clock.micros() + 1
    clock.advance(10)
    await access.audit.record("signin.failed", None, "marko")
    await access.audit.record("signin.ok", boss("marko"), "marko")

    async def seqs(wanted: Filter, limit: int = 50) -> list[int]:
        return [line.seq for line in await access.audit.find(wanted, limit)]

    assert await seqs(Filter()) == [8, 7, 6, 5, 4, 3, 2, 1]
    assert await seqs(Filter(before=4), 2) == [3, 2]
    assert await seqs(Filter(person="marko")) == [8]
    assert await seqs(Filter(object="m1")) == [5, 2]
    assert await seqs(Filter(kind="signin")) == [8, 7]
    assert await seqs(Filter(kind="sign")) == []
    assert await seqs(Filter(since=middle)) == [8, 7]
    assert await seqs(Filter(until=middle)) == [6, 5, 4, 3, 2, 1]
    assert await seqs(Filter(object="%")) == []
    assert await seqs(Filter(object="_")) == []
