"""Lines and what they tell of happen together, over restarts and beside another process."""

from pathlib import Path

import pytest

from app.access.access import Access
from app.access.audit.audit import Audit
from app.clock import ManualClock
from app.errors import Refused
from tests.access.audit.filled import broken_disk, filled
from tests.access.conftest import OpenAccess, add, boss


async def test_the_chain_goes_on_over_a_restart_and_from_two_processes_at_once(open_access: OpenAccess) -> None:
    server, terminal = open_access(), open_access()
    for _ in range(5):
        await server.audit.record("a", boss())
        terminal.audit.run(lambda _connection: (None, [terminal.audit.entry("b", boss())]))
    verdict = open_access().audit.check_now()
    assert (verdict.ok, verdict.count) == (True, 10)


async def test_two_installations_have_two_chains(access: Access, data: Path) -> None:
    await filled(access, 3)
    (data / "audit.key").write_text("ab" * 32)
    assert Audit(access.audit._db, ManualClock(), data).check_now().bad is not None


async def test_a_lone_surrogate_does_not_break_the_chain(access: Access) -> None:
    await access.audit.record("x", boss(), reason="\ud800", object="\udfff", note="\ud800")
    assert access.audit.check_now().ok


async def test_changes_of_people_are_refused_meanwhile(access: Access) -> None:
    key = await add(access, "ana", "admin")
    mend = broken_disk(access)
    await access.audit.record("stop", boss())
    for change in (
        access.people.add(boss(), "eve", "", ["admin"]),
        access.people.set_roles(boss(), key, ["viewer"]),
        access.tokens.create(boss(), "x", ["view"], 7),
    ):
        with pytest.raises(Refused) as caught:
            await change
        assert caught.value.status == 503
    mend()
    assert await access.audit.replay()
    assert [account.name for account in await access.people.all()] == ["ana"]


async def test_a_change_and_its_line_happen_together_or_not_at_all(access: Access) -> None:
    await add(access, "ana", "admin")
    before = await access.audit.count()
    with pytest.raises(Refused):
        await access.people.add(boss(), "ana", "", ["operator"])
    assert await access.audit.count() == before
    assert access.audit.check_now().ok
