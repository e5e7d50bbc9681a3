"""Looking after accounts: what is changed counts at once, and an administrator stays."""

import pytest

from app.access.access import Access
from app.errors import Refused
from tests.access.conftest import OpenAccess, add, boss, enter, who


async def test_a_forgotten_password_is_replaced_and_all_sessions_end(access: Access) -> None:
    key = await add(access, "marko")
    sid = await enter(access, "marko")
    initial = await access.people.new_initial(boss(), key)
    assert await who(access, sid) is None
    with pytest.raises(Refused):
        await enter(access, "marko")
    assert await enter(access, "marko", initial)


async def test_a_disabled_person_is_out_with_the_next_request(access: Access) -> None:
    key = await add(access, "marko")
    ended: list[str] = []
    access.sessions.subscribe(ended.extend)
    sid = await enter(access, "marko")
    await access.people.disable(boss(), key, True)
    assert await who(access, sid) is None
    assert len(ended) == 1
    with pytest.raises(Refused):
        await enter(access, "marko")
    await access.people.disable(boss(), key, False)
    assert await who(access, sid) is None
    assert await enter(access, "marko")


async def test_another_role_counts_with_the_next_request(access: Access) -> None:
    key = await add(access, "marko", "engineer")
    sid = await enter(access, "marko")
    await access.people.set_roles(boss(), key, ["viewer"])
    person = await who(access, sid)
    assert person and person.roles == {"viewer"} and not person.may("operate")


async def test_the_last_administrator_stays(access: Access) -> None:
    key = await add(access, "ana", "admin")
    for change in (
        access.people.disable(boss(), key, True),
        access.people.delete(boss(), key),
        access.people.set_roles(boss(), key, ["operator"]),
    ):
        with pytest.raises(Refused, match="last_admin"):
            await change
    assert (await access.people.get(key)).roles == {"admin"}


async def test_a_new_administrator_is_told_whoever_made_them_one(open_access: OpenAccess) -> None:
    server, terminal = open_access(), open_access()
    told: list[tuple[str, str]] = []
    server.tell = lambda alarm, name: told.append((alarm, name))
    await add(server, "ana", "admin")
    await server.people.watch_admins()
    assert told == []  # known from before
    await add(server, "ivo", "admin")
    await server.people.watch_admins()
    await add(server, "eve", "operator")
    terminal.people.set_roles_now(boss(), "eve", ["operator", "admin"])
    await server.people.watch_admins()
    await server.people.watch_admins()
    assert told == [("admin_added", "ivo"), ("admin_added", "eve")]
