"""Steps of the clock are written down."""

from app.access.access import Access
from app.access.audit.search import Filter
from app.clock import ManualClock
from tests.access.conftest import boss


async def test_a_step_of_the_clock_is_written_and_order_is_kept_by_number(access: Access, clock: ManualClock) -> None:
    await access.audit.record("before", boss())
    clock.step_wall(-3600)
    await access.audit_watch.note_clock()
    clock.advance(30)
    await access.audit_watch.note_clock()
    lines = await access.audit.find(Filter())
    assert [line.kind for line in lines] == ["clock.stepped", "before"]
    assert lines[0].parameters == {"seconds": "-3600.0"}
    assert lines[0].time < lines[1].time
